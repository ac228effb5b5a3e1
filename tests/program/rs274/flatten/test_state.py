"""What the unroller knows of the position and of the modes: each code that changes or loses them."""

from __future__ import annotations

import pytest
from cases.unrolling import fanuc, flatten, lcnc, refusal, refused

from olp.core.errors import ProgramError

_START = "G21 G90 G0 X1 Y2 Z3\n"
_NUMBERS = {"X": 5420, "Y": 5421, "Z": 5422}


def known(block: str, profile: str = "linuxcnc", start: str = _START) -> dict[str, float]:
    """The axes whose position is known behind a block, and where they are."""
    points = profile == "fanuc"
    head = f"O1\n{start}" if points else start
    positions = {}
    for axis, number in _NUMBERS.items():
        number -= 419 if points else 0
        source = f"{head}{block}\nA#{number}\nM30\n"
        try:
            text = flatten(source.encode(), profile=profile).decode()
        except ProgramError:
            error = refusal(source, profile)
            assert (error.code, error.line) == ("OLP524", source.count("\n") - 1)
            assert error.message.startswith(f"the position of {axis} is needed here and not known off line; ")
        else:
            positions[axis] = float(text.splitlines()[-2][1:])
    return positions


@pytest.mark.parametrize(
    ("block", "positions"),
    [
        ("X5", {"X": 5, "Y": 2, "Z": 3}),
        ("G1 Y5", {"X": 1, "Y": 5, "Z": 3}),
        ("G2 X5 I2", {"X": 5, "Y": 2, "Z": 3}),
        ("G3 X5 I2", {"X": 5, "Y": 2, "Z": 3}),
        ("G33 Z-5 K1", {"X": 1, "Y": 2, "Z": -5}),
        ("G5 X5 Y5 I1 J1 P1 Q1", {"X": 5, "Y": 5, "Z": 3}),
        ("G5.1 X5 Y5 I1 J1", {"X": 5, "Y": 5, "Z": 3}),
        ("G5.2 X5 Y5 P1", {"X": 1, "Y": 2, "Z": 3}),
        ("G91 X5\nX1", {"X": 7, "Y": 2, "Z": 3}),
        ("G91 G1 Z5", {"X": 1, "Y": 2, "Z": 8}),
        ("A5", {"X": 1, "Y": 2, "Z": 3}),
        # units
        ("G20", {"X": 1 / 25.4, "Y": 2 / 25.4, "Z": 3 / 25.4}),
        ("G20\nG21", {"X": 1, "Y": 2, "Z": 3}),
        ("G20 X5", {"X": 5, "Y": 2 / 25.4, "Z": 3 / 25.4}),
        ("G21", {"X": 1, "Y": 2, "Z": 3}),
        # an offset that is stated
        ("G92 X10", {"X": 10, "Y": 2, "Z": 3}),
        ("G92 X10 Y0\nG91 X1", {"X": 11, "Y": 0, "Z": 3}),
        # axis words that are no motion
        ("G4 P1 X5", {"X": 1, "Y": 2, "Z": 3}),
        ("G10 L1 P1 Z5\nX4", {"X": 4}),
        # motion in another frame
        ("G53 G0 X5", {"Y": 2, "Z": 3}),
        ("G53 G0 X5 Z1\nX6", {"X": 6, "Y": 2}),
        ("G28 X5", {}), ("G30 Z5", {}), ("G28 X5\nX6", {"X": 6}),
        # a frame that begins with the block
        ("G55 X5", {"X": 5}), ("G59.3 X5 Y6", {"X": 5, "Y": 6}), ("G43 H1 Z5", {"Z": 5}),
        ("G43.1 Z5 X4", {"X": 4, "Z": 5}), ("G91 G55 X5", {}), ("G92.1 X5", {}), ("G10 L20 P1 X5", {}),
        # what moves without axis words, and polar words
        ("@5 ^90", {"X": 0, "Y": 5, "Z": 3}), ("G0 X3 Y4\n@10", {"X": 6, "Y": 8, "Z": 3}),
        ("M6", {}), ("M100", {}), ("M199", {}),
        ("M6 X5", {"X": 5}),
        ("M8", {"X": 1, "Y": 2, "Z": 3}), ("M68 E1 Q1", {"X": 1, "Y": 2, "Z": 3}),
        # motion that does not end at its words
        ("G38.2 X5", {}), ("G38.3 X5", {}), ("G38.4 X5", {}), ("G38.5 X5", {}), ("G38.2 X5\nG1 X6", {"X": 6}),
        ("G80\nX5", {"Y": 2, "Z": 3}), ("G91 G80\nX5", {"Y": 2, "Z": 3}),
        ("G80 G1 X5", {"X": 5, "Y": 2, "Z": 3}), ("G91 G80 G1 X5", {"X": 6, "Y": 2, "Z": 3}),
    ],
)  # fmt: skip
def test_the_position_behind_a_block(block: str, positions: dict[str, float]) -> None:
    assert known(block) == pytest.approx(positions, abs=1e-9)


@pytest.mark.parametrize(
    "code",
    ["G43 H1", "G44 H1", "G49", "G43.1 Z1", "G43.2 H1", "G54", "G54.1 P1", "G55", "G56", "G57", "G58", "G59",
     "G59.1",
     "G59.2", "G59.3", "G52 X1", "G92.1", "G92.2", "G92.3", "G28", "G30", "G38.2 X1", "G10 L2 P1 X1",
     "G10.1 X1",
     "G28.1", "G30.1", "G31 X1", "G33.1 Z1 K1", "G76 Z1", "G87 Z1", "G88 Z1"],
)  # fmt: skip
def test_no_position_is_known_behind_what_only_the_control_knows(code: str) -> None:
    assert set(known(code)) <= {word[0] for word in code.split()[1:] if code.startswith(("G43.1", "G54"))}


@pytest.mark.parametrize(
    ("code", "end"),
    [("G7", "G8"), ("G7.1", "G8"), ("G12.1", "G13.1"), ("G16", "G15"), ("G43.4 H1", "G49"),
     ("G51 X1 P2", "G50"),
     ("G51.1 X1", "G50.1"), ("G68 X1 Y1 R30", "G69"), ("G68.2 X1", "G69")],
)  # fmt: skip
def test_no_position_is_known_in_a_turned_frame(code: str, end: str) -> None:
    assert known(f"{code}\nG1 X5 Y6 Z7") == {}
    assert known(f"{code}\nG1 X5 Y6 Z7\n{end}") == {}
    assert known(f"{code}\nG1 X5 Y6 Z7\n{end}\nX8 Y9") == {"X": 8, "Y": 9}
    assert known(f"{end}\nX8 Y9 Z7") == {"X": 8, "Y": 9, "Z": 7}


@pytest.mark.parametrize("code", ["G41 D1", "G42 D1", "G41.1 D5", "G42.1 D5"])
def test_no_position_is_known_under_cutter_compensation(code: str) -> None:
    assert known(f"{code}\nG1 X5 Y6 Z7") == {}
    assert known(f"{code}\nG1 X5 Y6 Z7\nG40") == {}
    assert known(f"{code}\nG1 X5 Y6 Z7\nG40\nX8 Y9") == {"X": 8, "Y": 9}
    # without a compensation that ends, G40 changes nothing
    assert known("G40") == {"X": 1, "Y": 2, "Z": 3}


def test_before_any_unit_a_position_is_in_none() -> None:
    start = "G90 G0 X1 Y2 Z3\n"
    assert known("A1", start=start) == {"X": 1, "Y": 2, "Z": 3}
    assert known("G21", start=start) == {}
    assert known("G20 X5", start=start) == {"X": 5}


def test_what_fanuc_reads_in_its_own_way() -> None:
    start = "G21 G90 G0 X1. Y2. Z3.\n"
    everything = {"X": 1, "Y": 2, "Z": 3}
    cases = {
        # a tool length counts along Z alone
        "G43 H1": {"X": 1, "Y": 2}, "G44 H1": {"X": 1, "Y": 2}, "G49": {"X": 1, "Y": 2},
        "G43 H1 Z5.": {"X": 1, "Y": 2, "Z": 5},
        "G68 X0 Y0 R30.\nG43 H1": {}, "G54 G43 H1": {}, "G43.1 Z1.": {"Z": 1},
        # G5 is no motion, and an M code that is not known may move
        "G5 P1": everything, "G91\nG5 P1 X1.": {"X": 2, "Y": 2, "Z": 3}, "M70": {}, "M29": everything,
        # the unit of a number without a point is open
        "X5": {"Y": 2, "Z": 3}, "X0": {"X": 0, "Y": 2, "Z": 3}, "X5.": {"X": 5, "Y": 2, "Z": 3},
        "X[5]": {"X": 5, "Y": 2, "Z": 3}, "G91 X5": {"Y": 2, "Z": 3}, "G92 X5": {"Y": 2, "Z": 3},
        "G92 X5.": {"X": 5, "Y": 2, "Z": 3}, "G4 X5": everything, "F5 S6 T7": everything,
    }  # fmt: skip
    assert {block: known(block, "fanuc", start) for block in cases} == cases


# --- canned cycles that are written out ---------------------------------------------------------------------


def strokes(text: str, profile: str = "linuxcnc", **options: object) -> list[str]:
    """The blocks that take the place of the cycles of a program, without the exact stop around them."""
    blocks = flatten(text.encode(), profile=profile, expand_cycles=True, **options).decode().splitlines()
    return [block for block in blocks if block.startswith(("G0 ", "G1 ", "G4 ", "M"))]


def lcnc_strokes(block: str, before: str = "", **options: object) -> list[str]:
    start = f"(s) G21 G90 G99 F1 {before}\n(s) G0 X1 Y1 Z5\n"
    return strokes(f"{start}{block}\n", **options)


def fanuc_strokes(block: str, **options: object) -> list[str]:
    return strokes(f"O1\n(s) G21 G90 G99 F1.\n(s) G0 X1. Y1. Z5.\n{block}\n", "fanuc", **options)


_HOLE = ["G0 X2", "G0 Z1", "G1 Z-1", "G0 Z1"]


@pytest.mark.parametrize(
    ("block", "expected"),
    [
        ("G81 X2 Z-1 R1", _HOLE),
        ("G98 G81 X2 Z-1 R1", [*_HOLE[:3], "G0 Z5"]),
        ("G82 X2 Z-1 R1 P.5", ["G0 X2", "G0 Z1", "G1 Z-1", "G4 P0.5", "G0 Z1"]),
        ("G82 X2 Z-1 R1 P0", _HOLE),
        ("G85 X2 Z-1 R1", [*_HOLE[:3], "G1 Z1"]),
        ("G89 X2 Z-1 R1 P2", ["G0 X2", "G0 Z1", "G1 Z-1", "G4 P2", "G1 Z1"]),
        ("G83 X2 Z-1 R1 Q1.5", ["G0 X2", "G0 Z1", "G1 Z-0.5", "G0 Z1", "G0 Z-0.246", "G1 Z-1", "G0 Z1"]),
        ("G73 X2 Z-1 R1 Q1.5", ["G0 X2", "G0 Z1", "G1 Z-0.5", "G0 Z-0.246", "G1 Z-1", "G0 Z1"]),
        # a series keeps depth and R
        ("G81 X2 Z-1 R1\nY3", [*_HOLE, "G0 Y3", "G1 Z-1", "G0 Z1"]),
        ("G81 X2 Z-1 R1\nZ-2", [*_HOLE, "G1 Z-2", "G0 Z1"]),
        ("G98 G81 X2 Z-1 R1\nX3", [*_HOLE[:3], "G0 Z5", "G0 X3", "G0 Z1", "G1 Z-1", "G0 Z5"]),
        # the position behind a cycle is that of its last stroke
        ("G81 X2 Z-1 R1\nG80 G0 X#5420 Y#5421 Z#5422", [*_HOLE]),
        # in G91 R counts from the level before, and depth from R
        ("G91 G81 X1 Z-2 R-4", _HOLE), ("G91 G81 X1 Z-2 R-4 L2", [*_HOLE, "G0 X3", "G1 Z-1", "G0 Z1"]),
        ("G81 X2 Z-1 R1 L2", [*_HOLE, "G1 Z-1", "G0 Z1"]),
        # other planes
        ("G18 G81 X2 Z3 Y0 R1", ["G0 X2 Z3", "G1 Y0", "G0 Y1"]),
        ("G19 G81 Y2 Z3 X0 R.5", ["G0 Y2 Z3", "G0 X0.5", "G1 X0", "G0 X0.5"]),
        # what the block does besides
        ("G81 X2 Z-1 R1 M8", ["M8", *_HOLE]), ("G0 G81 X2 Z-1 R1", _HOLE),
    ],
)  # fmt: skip
def test_strokes_of_linuxcnc(block: str, expected: list[str]) -> None:
    assert lcnc_strokes(block) == expected


def test_the_words_of_a_cycle_are_taken_out_and_the_others_kept() -> None:
    source = "G21 G0 X1 Y1 Z5\nN9 G99 G81 X2 Y3 Z-1 R1 P1 Q1 L1 F9 M8 (h)\nX3 (i)\nN10 X4\nG80 M9\nM2\n"
    blocks = lcnc(source, expand_cycles=True).splitlines()
    kept = [block for block in blocks if not block.startswith(("G0 X", "G0 Y", "G0 Z", "G1 ", "G6", "G9"))]
    assert [" ".join(block.split()) for block in kept] == [
        "G21 G0 X1 Y1 Z5", "N9 G99 F9 M8 (h)", "(i)", "G80 M9", "M2"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("before", "expected"),
    [
        ("", ["G61", "G0 X2", "G64"]), ("G64", ["G61", "G0 X2", "G64"]),
        ("G64 P0.05 Q0.1", ["G61", "G0 X2", "G64 P0.05 Q0.1"]), ("G64 Q0.1", ["G61", "G0 X2", "G64 Q0.1"]),
        ("G61.1", ["G61", "G0 X2", "G61.1"]), ("G61", ["G0 X2"]), ("G61\nG64", ["G61", "G0 X2", "G64"]),
        ("G91", ["G61", "G90", "G0 X3", "G91", "G64"]),
        ("G61 G91", ["G90", "G0 X3", "G91"]),
    ],
)  # fmt: skip
def test_the_modes_around_a_cycle_come_back(before: str, expected: list[str]) -> None:
    levels = "Z0 R-4" if "G91" in before else "Z1 R1"
    source = f"G21 G0 X1 Y1 Z5\n{before} (b)\nG81 X2 {levels}\nM2\n"
    blocks = lcnc(source, expand_cycles=True).splitlines()
    blocks = blocks[blocks.index(next(b for b in blocks if "(b)" in b)) + 1 : -1]
    assert [block for block in blocks if "Z" not in block] == expected
    assert [block for block in blocks if "Z" in block] == ["G0 Z1"]


def test_blocks_of_a_cycle_under_block_delete_have_its_mark() -> None:
    source = "G21 G61 G0 X1 Y1 Z5\n/G99 G81 X2 Z-1 R1\nG80\nM2\n"
    assert lcnc(source, expand_cycles=True).splitlines()[1:] == [
        "/G99", *(f"/{block}" for block in _HOLE), "G80", "M2"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("spindle", "expected"),
    [("M3", ["M5", "M4", "M5", "M3"]), ("M4", ["M5", "M3", "M5", "M4"]),
     ("M3\n(s) M8\n(s) M4", ["M5", "M3", "M5", "M4"])],
)  # fmt: skip
def test_tapping_reverses_the_spindle(spindle: str, expected: list[str]) -> None:
    code = "G84" if spindle == "M3" else "G74"
    blocks = lcnc_strokes(f"{code} X2 Z-1 R1", f"(s) {spindle}")
    assert [block for block in blocks if block.startswith("M")] == expected
    assert [block for block in blocks if block.startswith("G1")] == ["G1 Z-1", "G1 Z1"]


def test_boring_with_a_stop_gives_the_spindle_back() -> None:
    blocks = lcnc_strokes("G86 X2 Z-1 R1 P1", "M4")
    assert blocks == ["G0 X2", "G0 Z1", "G1 Z-1", "G4 P1", "M5", "G0 Z1", "M4"]


@pytest.mark.parametrize("before", ["", "M3\n(s) M5"])
def test_a_cycle_that_reverses_needs_a_direction(before: str) -> None:
    source = f"G21 G0 X1 Y1 Z5 {before}\nG84 X2 Z-1 R1\n"
    assert refused(source, expand_cycles=True)[:2] == (
        "OLP532", "the cycle reverses the spindle, whose direction is not set; give M3 or M4 before"
    )  # fmt: skip


@pytest.mark.parametrize(
    ("block", "code", "message"),
    [
        *((f"G81 {letter}5 Z-1 R1", "OLP531", f"a canned cycle moves {letter}, which is not understood")
          for letter in "ABCUVW"),
        *((f"G81 X2 Z-1 R1 M{m}", "OLP518", f"M{m} in the block of a canned cycle; put it into its own block")
          for m in (0, 1, 2, 30, 60, 99)),
        ("G81 X2 Z-1 R1 M[98]", "OLP518", "M98 in the block of a canned cycle; put it into its own block"),
        *((f"{mode}\nG81 X2 Z-1 R1", "OLP518",
          "a canned cycle is in inverse time, cutter compensation or a turned frame, "
           "which is not read; end these modes first") for mode in ("G93", "G41 D1", "G68 R3")),
        ("G81 X2 R1", "OLP531", "the canned cycle has no Z word"),
        ("G81 X2 Z-1", "OLP531", "the canned cycle has no R word"),
        ("G18 G81 X2 Z-1 R1", "OLP531", "the canned cycle has no Y word"),
        ("G81 X2 Z-1 R1 L0", "OLP531", "the cycle is repeated L0 times; expected L1 or more"),
        ("G81 X2 Z-1 R1 L1.5", "OLP540", "the repeat count L is 1.5; expected an integer"),
        # another cycle of a series takes nothing from the one before
        ("G81 X2 Z-1 R1\nG82 X3 P1", "OLP531", "the canned cycle has no R word"),
        ("G82 X2 Z-1 R1 P1\nG81 X2 Z-1 R1\nG82 X3 Z-1 R1", "OLP531", "G82 needs a dwell P; give P0 for none"),
        # another motion ends a series
        ("G81 X2 Z-1 R1\nG0 X3\nG81 X4", "OLP531", "the canned cycle has no R word"),
        ("G81 X2 Z-1 R1\nG80\nG81 X4", "OLP531", "the canned cycle has no R word"),
        ("M6\nG81 X2 Y2 Z-1 R1", "OLP524",
         "the position of Z is needed here and not known off line; M6 before it may have moved it: state in "
         "tool_change_moves of the machine file which axes it moves, or command Z behind it"),
        ("M100\nX2\nG81 Y2 Z-1 R1", "OLP524",
         "the position of Z is needed here and not known off line; M100 before it may have moved it: list "
         "100 in still_m_codes of the machine file if it moves no axis, or command Z behind it"),
        ("M100\nG28\nX5 Z5\nG81 X2 Z-1 R1", "OLP524",
         "the position of Y is needed here and not known off line; command Y before in the program"),
        ("G28\nZ5\nG81 X2 Z-1 R1", "OLP524",
         "the position of Y is needed here and not known off line; command Y before in the program"),
    ],
)  # fmt: skip
def test_cycles_of_linuxcnc_that_are_refused(block: str, code: str, message: str) -> None:
    source = f"G21 G90 G0 X1 Y1 Z5\n{block}\n"
    assert refused(source, expand_cycles=True) == (code, message, source.count("\n"))
    # as they are they may be kept
    text = f"{source}M2\n"
    assert lcnc(text).startswith(source.replace("M[98]", "M98"))


def test_the_clearance_of_pecks() -> None:
    inch = "(s) G20 G99 F1\n(s) G0 X1 Y1 Z5\nG83 X2 Z-1 R1 Q1.5\n"
    assert "G0 Z-0.49" in strokes(inch)
    assert "G0 Z0.5" in strokes(inch, peck_clearance=1.0)
    assert "G0 Z-0.5" not in strokes(inch)
    # zero is a clearance: there is nothing to come back over
    assert strokes(inch, peck_clearance=0.0)[2:6] == ["G1 Z-0.5", "G0 Z1", "G0 Z-0.5", "G1 Z-1"]
    for code in (83, 73):
        source = f"G0 X1 Y1 Z5\nG{code} X2 Z-1 R1 Q1.5\n"
        assert refused(source, expand_cycles=True) == (
            "OLP541", f"G{code} before any G20 or G21, on which its peck clearance depends", 2
        )  # fmt: skip
        assert refused(f"O1\nG0 X1. Y1. Z5.\nG{code} X2. Z-1. R1. Q1.5\n", "fanuc", expand_cycles=True) == (
            "OLP541", f"G{code} pecks with a clearance that a parameter of the control sets; "
            "give peck_clearance_mm (--peck-clearance-mm)", 3
        )  # fmt: skip
    assert fanuc_strokes("G73 X2. Z-1. R1. Q1.5", peck_clearance=0.25)[2:5] == [
        "G1 Z-0.5",
        "G0 Z-0.25",
        "G1 Z-1.",
    ]
    # other cycles need none
    assert strokes("(s) G0 X1 Y1 Z5\nG99 G81 X2 Z-1 R1\n")[0] == "G0 X2"


_FANUC_HOLE = ["G0 X2.", "G0 Z1.", "G1 Z-1.", "G0 Z1."]


@pytest.mark.parametrize(
    ("block", "expected"),
    [
        ("G81 X2. Z-1. R1.", _FANUC_HOLE),
        # another cycle of a series keeps the words of the one before
        ("G81 X2. Z-1. R1.\nG82 X3. P500", [*_FANUC_HOLE, "G0 X3.", "G1 Z-1.", "G4 P500", "G0 Z1."]),
        # P with a point is in seconds
        ("G82 X2. Z-1. R1. P0.5", [*_FANUC_HOLE[:3], "G4 P500", "G0 Z1."]),
        ("G82 X2. Z-1. R1. P2.", [*_FANUC_HOLE[:3], "G4 P2000", "G0 Z1."]),
        ("G82 X2. Z-1. R1. P[250]", [*_FANUC_HOLE[:3], "G4 P250", "G0 Z1."]),
        # of both counts the first one holds
        ("G91 G81 X1. Z-2. R-4. K1 L2", [*_FANUC_HOLE, "G0 X3.", "G1 Z-1.", "G0 Z1."]),
        # no hole stores the words
        ("G81 Z-1. R1. K0\nX3.", ["G0 X3.", *_FANUC_HOLE[1:]]),
        ("G81 Z-1. R1. L0\nX3.", ["G0 X3.", *_FANUC_HOLE[1:]]),
        ("G91 G81 X1. Z-2. R-4. K2", [*_FANUC_HOLE, "G0 X3.", "G1 Z-1.", "G0 Z1."]),
        ("G91 G81 X1. Z-2. R-4. L2", [*_FANUC_HOLE, "G0 X3.", "G1 Z-1.", "G0 Z1."]),
        # after a change of G90 and G91 with R and depth
        ("G81 X2. Z-1. R1.\nG91 X1. Z-2. R-4.", [*_FANUC_HOLE, "G0 X3.", "G1 Z-1.", "G0 Z1."]),
        ("G91 G81 X1. Z-2. R-4.\nX1.", [*_FANUC_HOLE, "G0 X3.", "G1 Z-1.", "G0 Z1."]),
        # the change counts within a series only
        ("G81 X2. Z-1. R1.\nG80\n(s) G91 G0 Z4.\nG81 Z-2. R-4.",
         [*_FANUC_HOLE, "G0 Z1.", "G1 Z-1.", "G0 Z1."]),
        ("G81 X2. Z-1. R1.\n(s) G91\n(s) G90\nX3.", [*_FANUC_HOLE, "G0 X3.", "G1 Z-1.", "G0 Z1."]),
        # a series that ended may be in another frame
        ("G81 X2. Z-1. R1.\nG80\n(s) G92 X7.\nG81 X8. Z-1. R1.",
         [*_FANUC_HOLE, "G0 X8.", "G1 Z-1.", "G0 Z1."]),
    ],
)  # fmt: skip
def test_strokes_of_fanuc(block: str, expected: list[str]) -> None:
    assert fanuc_strokes(block) == expected


_BROKEN = (
    "an offset, the tool length, the unit or another move comes within a series of canned cycles; what this "
    "control keeps then is not known; end the series with G80"
)
_CHANGED = "G90 and G91 change within a series of cycles; give R and the depth again"
_NO_POINT = (
    "{} has no decimal point, so a parameter decides whether it counts least increments or whole units; "
    'write the point, or state decimal_point = "calculator" in the machine file'
)


@pytest.mark.parametrize(
    ("block", "code", "message"),
    [
        *((f"G81 X2. Z-1. R1.\n{between}\nX3. Y3.", "OLP518", _BROKEN)
          for between in ("G92 X7.", "G54", "G20", "G43 H1", "G52 X1.", "G28 Z5.", "G10 L2 P1 X1.")),
        ("G81 X2. Z-1. R1.\nG91 X1. Z-2.", "OLP518", _CHANGED),
        ("G81 X2. Z-1. R1.\nG91 X1. R-4.", "OLP518", _CHANGED),
        ("G81 X2. Z-1. R1.\nG91 X1. Z-4.", "OLP518", _CHANGED),
        ("G81 X2 Z-1. R1.", "OLP541", _NO_POINT.format("X")),
        ("G81 X2. Z-1 R1.", "OLP541", _NO_POINT.format("Z")),
        ("G81 X2. Z-1. R1", "OLP541", _NO_POINT.format("R")),
        ("G81 X2. Z-1. R1. K1.5", "OLP540", "the repeat count K is 1.5; expected an integer"),
        ("G81 X2. Z-1. R1. K0", "OLP531", "a canned cycle with zero repeats stores its values, and whether "
         "it goes to its place is not known; leave the place out"),
        ("G83 X2. Z-1. R1. Q2", "OLP541", _NO_POINT.format("Q")),
        # X was commanded behind M100, by a number whose unit is open
        ("M100\nX2. Y1. Z5.\nX4\nG81 Y2. Z-1. R1.", "OLP524",
         "the position of X is needed here and not known off line; command X before in the program"),
        *((f"G{code} X2. Z-1. R1.", "OLP544",
           "G74 and G84 are synchronised by the control, and it stops the spindle of G76 and G87 at an "
           "angle: plain moves cannot replace them") for code in (74, 76, 84, 87)),
    ],
)  # fmt: skip
def test_cycles_of_fanuc_that_are_refused(block: str, code: str, message: str) -> None:
    source = f"O1\nG21 G90 G0 X1. Y1. Z5.\n{block}\n"
    line = source.count("\n")
    assert refused(source, "fanuc", expand_cycles=True, peck_clearance=1.0) == (code, message, line)
    assert fanuc(f"{source}M30\n") == f"{source}M30\n"


def test_on_linuxcnc_a_series_goes_on_in_another_frame() -> None:
    assert lcnc_strokes("G81 X2 Z-1 R1\n(s) G92 X7\nX8") == [*_HOLE, "G0 X8", "G1 Z-1", "G0 Z1"]
    # in G91 R1 counts from Z5, and Z-1 from R
    assert lcnc_strokes("G81 X2 Z-1 R1\n(s) G91\nX1 L2")[4:] == [
        "G0 Z6", "G0 X3", "G1 Z5", "G0 Z6", "G0 X4", "G1 Z5", "G0 Z6"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("block", "position"),
    [
        ("G99 G81 X2 Z-1 R1", (2, 2, 1)), ("G98 G81 X2 Z-1 R1", (2, 2, 3)), ("G81 X2 Z-1 R4\nY7", (2, 7, 4)),
        ("G91 G81 X2 Z-1 R1 L3", (7, 2, 4)), ("G18 G81 Y-1 R5 X6", (6, 5, 3)),
        # G4, G10 and others within a series make no hole
        ("G99 G81 X2 Z-1 R1\nG4 P1 X7", (2, 2, 1)), ("G99 G81 X2 Z-1 R1\nM8", (2, 2, 1)),
        ("G99 G81 X2 Z-1 R1\nA5 F1", (2, 2, 1)), ("G99 G83 X2 Z-1 R1 Q1", (2, 2, 1)),
    ],
)  # fmt: skip
def test_a_cycle_that_is_kept_leaves_its_position(block: str, position: tuple[float, ...]) -> None:
    assert known(block) == pytest.approx(dict(zip("XYZ", position, strict=True)))


def test_after_a_cycle_that_is_not_understood_no_position_is_known() -> None:
    assert known("G81 X2") == {}
    assert known("G81 A2 Z-1 R1\nG0 X4") == {"X": 4}


@pytest.mark.parametrize("expand_cycles", [False, True])
def test_the_strokes_of_a_program_are_bounded(expand_cycles: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("olp.program.rs274.cycles._STROKES_PER_BYTE", 0.0)
    source = "G21 G0 X1 Y1 Z5\nG99 G81 X2 Z-1 R1\nX3\nM2\n"
    monkeypatch.setattr("olp.program.rs274.cycles._STROKES", 7)
    assert lcnc(source, expand_cycles=expand_cycles).endswith("M2\n")
    monkeypatch.setattr("olp.program.rs274.cycles._STROKES", 6)
    assert refused(source, expand_cycles=expand_cycles) == (
        "OLP543", "the canned cycles of the program have more than 6 strokes; split the program", 3
    )  # fmt: skip
