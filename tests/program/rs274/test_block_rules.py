"""Which words may be together in a block, by tables: letters that need a code, codes that need letters, modal
groups. The tables are those of LinuxCNC 2.9, which refuses the same blocks."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest

from olp.core.errors import ProgramError
from olp.program.rs274.block_rules import ISO_RULES, NGC_RULES, OTHER_RULES, BlockRules, M
from olp.program.rs274.block_text import BlockText
from olp.program.rs274.lexer import lex

_CODE = re.compile(r"[GM]\d+(?:\.\d)?")
#: Axis letters.
AXES = "XYZABCUVW"
DRILLING = "G73 G81 G82 G83 G84 G85 G86 G89"
USER_M = " ".join(f"M{m}" for m in range(100, 200))

#: The codes that use a letter; beside others it is refused.
USERS = {
    "D": "G41 G41.1 G42 G42.1 G96",
    "E": "M66 M67 M68",
    "H": "G43 G43.2 G76",
    "I": "G2 G3 G5 G5.1 G5.2 G76 G87",
    "J": "G2 G3 G5 G5.1 G5.2 G76 G87",
    "K": "G2 G3 G33 G33.1 G76 G87",
    "L": f"{DRILLING} G10 G76 M66 M98",
    "P": "G2 G3 G4 G10 G64 G5 G5.1 G5.2 G74 G76 G82 G84 G86 G88 G89 "
    f"M19 M50 M51 M52 M53 M62 M63 M64 M65 M66 M98 {USER_M}",
    "Q": f"G5 G10 G64 G73 G76 G83 M19 M61 M66 M67 M68 {USER_M}",
    "R": f"G2 G3 {DRILLING} G74 G10 G76 M19",
}
#: Codes of which a block has one.
GROUPS = (
    f"G0 G1 G2 G3 {DRILLING} G74 G38.2 G38.3 G38.4 G38.5 G33 G33.1 G76 G87 G88",
    "G17 G18 G19",
    "G90 G91",
    "G90.1 G91.1",
    "G93 G94 G95",
    "G98 G99",
    "G4 G10 G28 G28.1 G30 G30.1 G52 G53 G92 G92.1 G92.2 G92.3",
    "G20 G21",
    "G40 G41 G41.1 G42 G42.1",
    "G43 G43.1 G43.2 G44 G49",
    "G54 G54.1 G55 G56 G57 G58 G59 G59.1 G59.2 G59.3",
    "G61 G61.1 G64",
    "G96 G97",
    "G7 G8",
    "M0 M1 M2 M30 M60",
    "M6 M61",
    "M3 M4 M5 M19",
    "M7 M8 M9",
    "M48 M49",
    "M50 M51 M52 M53",
    "M62 M63 M64 M65 M66 M67 M68",
    USER_M,
)
#: Groups that every control has.
COMMON = GROUPS[:6]
#: Codes that need one of these letters in their block.
NEEDS = {
    "G2": "IJKR", "G3": "IJKR", "G4": "P", "G33": "K", "G43.2": "HXYZ", "G96": "S", "G52": AXES, "G92": AXES,
    **dict.fromkeys(f"{DRILLING} G74 G38.2 G38.3 G38.4 G38.5 G53".split(), AXES),
    **dict.fromkeys(["M62", "M63", "M64", "M65"], "P"), "M66": "PE", "M67": "E", "M68": "E",
}  # fmt: skip
CODES = sorted({code for group in (*GROUPS, *USERS.values()) for code in group.split()})


def refused(
    blocks: list[str],
    rules: BlockRules = NGC_RULES,
    *,
    motion: int = 0,
    plane: int = 170,
    active: bool = True,
) -> dict[int, ProgramError]:
    """What the rules say of blocks, by line from 1, with these codes in force on all of them."""
    chunk = lex(np.frombuffer("\n".join(blocks).encode(), np.uint8), BlockText(), first_line=30)
    lines, keys = [], []
    for line, block in enumerate(blocks):
        for code in _CODE.findall(block.partition("(")[0]):
            lines.append(line)
            keys.append(round(10 * float(code[1:])) + (M if code[0] == "M" else 0))
    force = [np.full(len(blocks), value, np.int16) for value in (motion, plane)]
    count = np.full(len(blocks), active)
    codes = np.array(lines, np.int64), np.array(keys, np.int64)
    try:
        rules.tables().check(chunk, count, codes, force[0], force[1])
    except ProgramError as error:
        return {(one.line or 0) - 30: one for one in (error, *error.others)}
    return {}


def one(block: str, **force: int) -> tuple[str, str, str] | None:
    """What the rules say of a block: why, the code, and the word."""
    error = refused(["G1 X1", block, "G1 X1"], **force).get(2)  # type: ignore[arg-type]
    return None if error is None else (error.message, error.code, error.word)


def unused(letter: str) -> tuple[str, str, str]:
    why = f"no code of this block uses its word {letter}; remove it, or give the code that does"
    return why, "OLP519", letter


@pytest.mark.parametrize("letter", USERS)
def test_a_letter_stands_beside_the_codes_that_use_it_and_no_others(letter: str) -> None:
    said = refused([f"{code} {letter}1" for code in CODES], BlockRules(users=NGC_RULES.users))
    assert {(error.message, error.code, error.word) for error in said.values()} == {unused(letter)}
    free = {code for line, code in enumerate(CODES, 1) if line not in said}
    assert free == set(USERS[letter].split())


def test_other_letters_need_no_code() -> None:
    assert refused([f"{letter}1" for letter in "XYZABCUVWFSTN"]) == {}
    assert refused([f"{letter}1" for letter in USERS], OTHER_RULES) == {}


@pytest.mark.parametrize(("rules", "groups"), [(NGC_RULES, GROUPS), (OTHER_RULES, COMMON)])
def test_two_codes_of_one_group_are_refused_and_two_of_two_groups_are_not(
    rules: BlockRules, groups: tuple[str, ...]
) -> None:
    some = [code for code in CODES if not re.fullmatch(r"M1[0-8]\d", code)]
    pairs = list(itertools.combinations(some, 2))
    group_of = {code: number for number, group in enumerate(groups) for code in group.split()}
    said = refused([f"{a} {b}" for a, b in pairs], rules)
    twice = {line: error.message for line, error in said.items() if error.code == "OLP515"}
    assert twice == {
        line: f"{a} and {b} of one modal group are in this block; expected one of them"
        for line, (a, b) in enumerate(pairs, 1)
        if a in group_of and group_of[a] == group_of.get(b)
    }


def test_codes_of_a_group_are_named_in_their_order() -> None:
    assert one("G3 G0 X1 G2 R5") == (
        "G3 and G0 and G2 of one modal group are in this block; expected one of them", "OLP515", "",
    )  # fmt: skip
    assert refused(["M3", "M4", "G90", "G91"]) == {}


def test_codes_that_need_a_letter_have_one_of_them() -> None:
    rules = BlockRules(needs=NGC_RULES.needs)
    said = refused(CODES, rules)
    assert {CODES[line - 1]: error.message for line, error in said.items()} == {
        code: f"{code} needs {'one of ' * (len(letters) > 1)}{', '.join(letters)} in its block"
        for code, letters in NEEDS.items()
    }
    assert {(error.code, error.word) for error in said.values()} == {("OLP516", "")}
    for code, letters in NEEDS.items():
        blocks = [f"{code} {letter}1" for letter in map(chr, range(65, 91)) if letter not in "GM"]
        lacking = refused(blocks, rules)
        assert {block[-2] for line, block in enumerate(blocks, 1) if line not in lacking} == set(letters)
    assert refused(CODES, OTHER_RULES) == {}


@pytest.mark.parametrize(
    ("block", "force", "spare"),
    [
        # words of arcs count in the blocks that move on an arc
        ("X1 I2", {"motion": 20}, ""),
        ("X1 R2", {"motion": 30}, ""),
        ("I2", {"motion": 20}, ""),
        ("X1 I2", {"motion": 10}, "I"),
        ("X1 I2", {"motion": -1}, "I"),
        ("X1 I2", {"motion": 800}, "I"),
        ("R2", {"motion": 20}, "R"),
        ("F1 P2", {"motion": 20}, "P"),
        ("J2 P2", {"motion": 20}, ""),
        ("J2 K2", {"motion": 20}, "K"),
        ("I2 J2", {"motion": 20}, ""),
        ("I2 K2", {"motion": 20, "plane": 180}, ""),
        ("X1 I2 J2", {"motion": 30, "plane": 180}, "J"),
        ("J2 K2", {"motion": 20, "plane": 190}, ""),
        ("J2 I2", {"motion": 20, "plane": 190}, "I"),
        ("G2 J2 K2", {"motion": 20}, "K"),
        ("G3 X1 K2 R2", {"motion": 30}, "K"),
        # words of cycles in the blocks that make a hole
        ("X1 R2 L2", {"motion": 810}, ""),
        ("A1 R2", {"motion": 810}, ""),
        ("W1 R2", {"motion": 810}, ""),
        ("R2", {"motion": 810}, "R"),
        ("Y1 Q2", {"motion": 830}, ""),
        ("Z1 Q2", {"motion": 810}, "Q"),
        ("Z1 P2", {"motion": 890}, ""),
        ("Z1 I2", {"motion": 810}, "I"),
        # the first letter of the alphabet is named
        ("R1 Q1 H1", {}, "H"),
        ("D1 R1", {}, "D"),
    ],
)  # fmt: skip
def test_a_motion_in_force_uses_the_words_of_its_moves(block: str, force: dict[str, int], spare: str) -> None:
    assert one(block, **force) == (unused(spare) if spare else None)


@pytest.mark.parametrize(
    ("block", "motion", "spare"),
    [
        ("X1 I2", 10, "I"), ("G40 X1 J2", 10, "J"), ("G41 D1 Y1 I2", 0, "I"), ("G90 G1 Z1 R2", 0, "R"),
        ("A1 K2", 0, "K"), ("X1 L2", 10, "L"), ("I2", 10, "I"), ("X1 I2", 810, ""), ("X1 I2", 20, ""),
        ("G2 X1 I2 L3", 20, "L"), ("I2 P3", 30, "P"), ("X1 R2 Q3", 20, "Q"), ("X1 R2 K3", 30, "K"),
        ("X1 I2 K0", 20, ""),
        ("X1 I2 K.5", 20, "K"), ("G65 P1 X1 K2", 20, ""), ("X1 R2 M8", 10, "R"), ("G43 H1 Z1 R2", 0, "R"),
        ("X1 R2 M100", 10, ""),
        ("G68 X1 R2", 10, ""), ("X1 I2 M98 P1", 10, ""), ("G54.1 P2 X1", 20, ""),
        ("X1 F2 S3 T4 H5 D6", 10, ""),
    ],
)  # fmt: skip
def test_a_move_of_an_iso_control_has_no_word_that_could_change_it(
    block: str, motion: int, spare: str
) -> None:
    said = refused([block], ISO_RULES, motion=motion).get(1)
    assert (None if said is None else (said.code, said.word)) == (("OLP519", spare) if spare else None)


def test_numbers_that_may_not_be_negative() -> None:
    letters = [letter for letter in map(chr, range(65, 91)) if letter not in "GM"]
    rules = BlockRules(positive=NGC_RULES.positive)
    assert refused([f"{letter}0" for letter in letters], rules) == {}
    blocks = [f"{letter}-0.5" for letter in letters]
    assert refused(blocks, rules, active=False) == {}
    said = refused(blocks, rules)
    assert {(error.message, error.code, error.word) for error in said.values()} == {
        (f"the word {letter} is negative; expected zero or more", "OLP516", letter) for letter in "NFSTLH"
    }
    assert [letters[line - 1] for line in said] == sorted("NFSTLH")


@pytest.mark.parametrize(
    ("block", "wrong"),
    [
        ("N5 X1", False),
        ("N5", False),
        ("X1 N5", True),
        ("(a) N5 X1", True),
        ("N5 (a) X1", False),
        ("N5 X1 (a)", False),
        ("X1", False),
    ],
)
@pytest.mark.parametrize("before", ["G1", "(a) G1 (b)"])
def test_a_number_of_a_block_is_its_first_word(block: str, wrong: bool, before: str) -> None:
    said = refused([before, block, "(c) G1"])
    assert said.keys() == ({2} if wrong else set())
    if wrong:
        error = said[2]
        assert (error.message, error.code, error.word) == (
            "N is not the first word of this block; put the block number in front", "OLP505", "N",
        )  # fmt: skip
        assert refused([before, block], active=False) == {}
    assert refused([before, block], OTHER_RULES) == {}


@pytest.mark.parametrize(
    ("block", "expected"),
    [
        ("X1 Y1 X2", ("the word X is twice in this block; expected it once", "OLP515", "")),
        ("Y1 X1 X2 Y2", ("the word Y is twice in this block; expected it once", "OLP515", "")),
        ("X1 Y1 Y2", ("the word Y is twice in this block; expected it once", "OLP515", "")),
        ("F1 G90 F1 G1 M3 M8", ("the word F is twice in this block; expected it once", "OLP515", "")),
        ("X1 Y1 G90 G17 G1 M3 M8", None),
        ("A1 A2", ("the word A is twice in this block; expected it once", "OLP515", "")),
        ("Z1 Z2", ("the word Z is twice in this block; expected it once", "OLP515", "")),
        ("G43.2 H1 X1", ("G43.2 takes H, or words of axes; expected one of the two", "OLP518", "")),
        ("G43.2 H1", None),
        ("G43.2 Y1", None),
        ("G43 H1 X1", None),
        *(
            (
                f"{code} {motion} X1",
                ("two G codes of this block use its axis words; give each its own block", "OLP518", ""),
            )
            for code in ("G10", "G28", "G30", "G52", "G92", "G43.1")
            for motion in ("G0", "G1", "G81", "G38.2")
        ),
        ("G92.1 G1 X1", None),
        ("G92 X1", None),
        ("G53 G1 X1", None),
    ],
)
def test_what_is_twice_or_means_two_things_is_refused(
    block: str, expected: tuple[str, str, str] | None
) -> None:
    assert one(block) == expected
    if expected is not None and expected[1] == "OLP515":
        assert refused([block], active=False) == {}


def test_the_first_fault_of_each_block_is_said_and_the_others_beside_it() -> None:
    said = refused(["G1 X1", "X1 X2 P5", "G90 G91", "P1", "G4"])
    assert {line: error.code for line, error in said.items()} == {
        2: "OLP515", 3: "OLP515", 4: "OLP519", 5: "OLP516",
    }  # fmt: skip
