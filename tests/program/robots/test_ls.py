"""TP programs on three linear axes: read and corrected as a judge that shares nothing with it says."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from judge import machines, tp
from judge.machines import Recipe
from judge.model import JudgeModel

import olp
from olp.core.errors import OlpError, ProgramError
from olp.program.robots.dialect import next_number

FRAMES = {1: (300.0, 250.0, -300.0, 25.0), 2: (350.0, 200.0, -250.0, 0.0)}
RECIPE = Recipe(
    controller="fanuc-tp", job_defaults={},
    work_offsets={
        f"UFRAME{n}": {"X_mm": x, "Y_mm": y, "Z_mm": z, "C_deg": c, "set_by": "true"}
        for n, (x, y, z, c) in FRAMES.items()
    },
)  # fmt: skip
LEVER = np.array([0.0, 0.0, -120.0])
#: rounding of the third decimal, mm
DIGIT = 0.5e-3


def position(number: int, point: list[float], frame: int = 1, more: str = "") -> str:
    x, y, z = (f"{v:.1f}" for v in point)
    return (
        f"P[{number}:\"a b\"]{{\n   GP1:\n\tUF : {frame}, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',\n"
        f"\tX = {x} mm, Y = {y} mm, Z = {z} mm,\n\tW = 180.0 deg, P = 0.0 deg, R = 30.0 deg{more}\n}};\n"
    )


def text_of(lines: list[str], positions: list[str], count: int | None = None) -> bytes:
    main = "".join(f"{k:4d}:{line} ;\n" for k, line in enumerate(lines, 1))
    head = f"/PROG  T\n/ATTR\nLINE_COUNT\t= {len(lines) if count is None else count};\n/MN\n"
    return f"{head}{main}/POS\n{''.join(positions)}/END\n".encode()


def program(rng: np.random.Generator, count: int) -> bytes:
    """Moves to shared positions and their own, with and without an offset."""
    points = rng.uniform(-60, 60, (count, 3)).round(1).tolist()
    positions = [position(k + 1, point, 1 + k % 2) for k, point in enumerate(points)]
    lines = ["  UFRAME_NUM=1", *(f"  PR[5,{k}]={v}" for k, v in enumerate((0, 0, 20, 0, 0, 0), 1))]
    for _ in range(count):
        number, kind = rng.integers(1, count + 1), "L" if rng.random() < 0.7 else "J"
        speed = "200mm/sec" if kind == "L" else "50%"
        tail = " Offset,PR[5]" if rng.random() < 0.3 else ""
        lines.append(f'{kind} P[{number}:"a b"] {speed} {rng.choice(["FINE", "CNT50"])}{tail}   ')
    return text_of(lines, positions)


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.random_machine(tmp_path_factory.mktemp("bent"), 8, RECIPE)


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.zero_machine(tmp_path_factory.mktemp("zero"), RECIPE)


def world(move: tp.TpMove) -> np.ndarray:
    x, y, z, c = FRAMES[move.frame]
    cosine, sine = np.cos(np.radians(c)), np.sin(np.radians(c))
    return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]]) @ move.tip + (x, y, z)


@pytest.mark.parametrize("seed", range(3))
def test_each_position_is_where_the_judge_wants_it(bent: Path, zero: Path, seed: int) -> None:
    text = program(np.random.default_rng(seed), 25)
    assert olp.correct(text, zero).data == text
    done = olp.correct(text, bent)
    assert done.report["verdict"]["ok"]
    nominal, written, model = tp.moves(text), tp.moves(done.data), JudgeModel(bent)
    assert len(written) > len(nominal), "long moves are split"
    place = 0
    for k, move in enumerate(nominal):
        tip, start = world(move), world(nominal[k - 1])
        want = model.command_for(tip[None], LEVER)[0]
        while np.abs(world(written[place]) - want).max() > 2 * DIGIT:
            here = world(written[place])
            actual = here + model.error_mm(here[None], LEVER)[0]
            share = np.clip((actual - start) @ (tip - start) / max((tip - start) @ (tip - start), 1e-9), 0, 1)
            assert np.linalg.norm(start + share * (tip - start) - actual) < 1e-3 + 2 * DIGIT
            place += 1
        place += 1
    assert place == len(written)


def test_counts_and_lines_stay_right(bent: Path) -> None:
    lines = [
        "J P[1] 50% FINE",
        '  !don\'t; "move"',
        "L P[2] 200mm/sec CNT50 ACC80",
        "L P[3] 200mm/sec FINE TB .05sec,CALL X",
    ]
    points = [position(k, p) for k, p in ((1, [-60, -60, 0]), (2, [60, 60, 20]), (3, [60, -60, 20]))]
    text = olp.correct(text_of(lines, points), bent).data.decode()
    main = text.split("/MN\n")[1].split("/POS")[0].splitlines()
    assert re.search(r"LINE_COUNT\t= (\d+)", text)[1] == str(len(main))
    assert main[0].startswith("    :  !olp-corrected ")
    assert len(main[0].split("!")[1]) <= 33
    parts = [line for line in main if re.match(r" +:L P\[\d+\] 200mm/sec CNT100( ACC80)? ;", line)]
    assert len(parts) == len(main) - 5
    # a move with an action stays whole
    assert re.match(r"(?s).*ACC80 ;$", main[-2]) and main[-1].endswith("TB .05sec,CALL X ;")
    wrong = olp.correct(text_of(lines, points, 77), bent).data
    assert b"LINE_COUNT\t= 77;" in wrong


def test_frames_and_tools_of_registers(tmp_path: Path) -> None:
    path = machines.shift_machine(tmp_path, (100.0, 0.0, 0.0), recipe=replace(RECIPE, work_offsets={}))
    lines = [f"  PR[1,{k}]={v}" for k, v in enumerate((300, 200, -300, 0, 0, 90), 1)]
    lines += ["  UFRAME[1]=PR[1]", "J P[1] 50% FINE"]
    text = olp.correct(text_of(lines, [position(1, [1, 2, 3])]), path).data
    assert b"X = 1.0 mm, Y = 2.100 mm, Z = 3.0 mm" in text
    with pytest.raises(OlpError, match="UFRAME1"):
        olp.correct(text_of(["J P[1] 50% FINE"], [position(1, [1, 2, 3])]), path)
    with pytest.raises(OlpError, match="gets numbers that the text does not state"):
        olp.correct(text_of(["  UFRAME[1]=PR[9]", *lines[-1:]], [position(1, [1, 2, 3])]), path)


@pytest.mark.parametrize(
    ("before", "behind"),
    [
        ((), ("  UFRAME[R[9]]=PR[1]",)),
        ((), ("  $MNUFRAME[1,1]=PR[1]",)),
        (("  IF R[1]=1,JMP LBL[1]",), ("  LBL[1]",)),
        (("  IF (R[1]=1) THEN",), ("  ENDIF",)),
        ((), ("  UFRAME[1]=PR[2]",)),
    ],
)
def test_a_frame_that_the_run_may_set_otherwise_is_refused(
    zero: Path, before: tuple[str, ...], behind: tuple[str, ...]
) -> None:
    stated = [*(f"  PR[1,{k}]={k}" for k in range(1, 7)), *before, "  UFRAME[1]=PR[1]", *behind]
    move = "J P[1] 50% FINE"
    point = position(1, [200, 200, -100]).replace("UF : 3", "UF : 1")
    for lines in ([*stated, move], ["  LBL[7]", move, *stated, "  JMP LBL[7]"]):
        with pytest.raises(OlpError, match=r"UFRAME\[1\] gets numbers that the text does not state; state"):
            olp.correct(text_of(lines, [point]), zero)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("L P[9] 200mm/sec FINE", "not stated"),
        ("L P[1] 200mm/sec FINE INC", "INC"),
        ("L P[1] 200mm/sec FINE COORD", "COORD"),
        ("L P[1] 200mm/sec FINE VOFFSET,VR[1]", "sensor"),
        ("L P[1] 200mm/sec CNT60 ACC80 RTCP", "`RTCP` behind a move is not read: the tool stands still"),
        ("L P[1] 200mm/sec CNT60 PTH FPLIN(1)", "`FPLIN` behind a move .* post the move without it"),
        ("L P[3] 200mm/sec FINE", "P.3. of line 19 states `Y = 2.0 inch`; expected mm"),
        ("  P[1]=LPOS", "another value"),
        ("  OFFSET CONDITION PR[1]", "targets are moved"),
        ("L P[2] 200mm/sec FINE", "not taught"),
    ],
)
def test_what_is_not_certain_is_refused_with_its_line(zero: Path, line: str, why: str) -> None:
    untaught = position(2, [0, 0, 0]).replace("0.0 mm", "******** mm")
    with pytest.raises(OlpError, match=why) as error:
        inch = position(3, [1, 2, 3]).replace("2.0 mm", "2.0 inch")
        olp.correct(text_of([line], [position(1, [0, 0, 0]), untaught, inch]), zero)
    assert isinstance(error.value, ProgramError)
    assert error.value.line == 5


def test_what_the_text_does_not_state_is_left_and_listed(bent: Path) -> None:
    lines = ["J P[1] 50% FINE", "L PR[3] 200mm/sec FINE", "L P[2] 200mm/sec FINE", "L P[3] 200mm/sec FINE"]
    points = [position(k, p) for k, p in ((1, [-60, -60, 0]), (2, [60, 60, 20]))]
    joints = "P[3]{\n   GP1:\n\tUF : 1, UT : 1,\n\tJ1= 0.0 deg\n};\n"
    done = olp.correct(text_of(lines, [*points, joints]), bent)
    assert joints.encode() in done.data
    assert b"L PR[3] 200mm/sec FINE ;\n   3:L P[2]" in done.data
    assert any("does not state where this move goes" in finding.message for finding in done.findings)


@pytest.mark.parametrize(
    "tail", ["Skip,LBL[1]", "Skip,LBL[1],PR[2]=LPOS", "TA 0.10sec,DO[1]=ON", "DB R[5]mm,CALL X", "AP_LD10"]
)
def test_a_move_with_words_of_its_own_is_corrected_and_stays_whole(bent: Path, tail: str) -> None:
    points = [position(k, p) for k, p in ((1, [-60, -60, 0]), (2, [60, 60, 20]))]
    for more, whole in ((tail, True), ("ACC R[1] EV 50% Wjnt", False)):
        done = olp.correct(text_of(["J P[1] 50% FINE", f"L P[2] 200mm/sec FINE {more}"], points), bent)
        assert (done.report["moves"]["inserted_blocks"] == 0) == whole
        assert whole or done.data.count(b":L ") == done.data.count(more.encode())
        assert b"X = 60.0 mm" not in done.data


@pytest.mark.parametrize(
    ("speed", "whole"), [("R[1:fast speed]mm/sec", False), ("R[1:a time]sec", True), ("5.0sec", True)]
)
def test_a_speed_of_a_register_stays_and_a_time_is_not_split(bent: Path, speed: str, whole: bool) -> None:
    points = [position(k, p) for k, p in ((1, [-60, -60, 0]), (2, [60, 60, 20]))]
    done = olp.correct(text_of(["J P[1] 50% FINE", f"L P[2] {speed} CNT R[2:a b]"], points), bent)
    assert (done.report["moves"]["inserted_blocks"] == 0) == whole
    assert done.data.count(b":L ") == done.data.count(speed.encode())
    assert b"X = 60.0 mm" not in done.data


@pytest.mark.parametrize(
    "between", ["  CALL X", "  LBL[1]", "  SELECT R[1]=1,CALL X", "  IF R[1]=1,CALL X", "  GRIP OPEN"]
)
def test_behind_what_may_move_only_the_end_is_corrected(bent: Path, between: str) -> None:
    points = [position(k, p) for k, p in ((1, [-60, -60, 0]), (2, [60, 60, 20]))]
    ends = ["J P[1] 50% FINE", "L P[2] 200mm/sec FINE"]
    split = olp.correct(text_of(ends, points), bent)
    whole = olp.correct(text_of([ends[0], between, ends[1]], points), bent)
    assert split.report["moves"]["inserted_blocks"] > 0
    assert whole.report["moves"]["inserted_blocks"] == 0
    assert any("where this move begins" in finding.message for finding in whole.findings)


def test_what_the_program_says_of_frames_and_tools_is_held_against_the_job(tmp_path: Path) -> None:
    """Also behind a move for which it said nothing yet."""
    recipe = replace(RECIPE, tools={1: {"gauge_to_tip_mm": [0.0, 0.0, -120.0]}})
    path = machines.zero_machine(tmp_path, recipe)
    words = [f"PR[1,{k}]={v}" for k, v in enumerate((0, 0, -100, 0, 0, 0), 1)]
    where = [position(1, [1, 2, 3])]
    for first in ([], ["J P[1] 50% FINE"]):
        lines = [*first, *words, "UTOOL[1]=PR[1]", "J P[1] 50% FINE"]
        with pytest.raises(OlpError, match=r"UTOOL1 is stated by the program and by \[tools.1\]"):
            olp.correct(text_of(lines, where), path)
    lines = ["UFRAME_NUM=2", "UTOOL_NUM=1", "Weave Sine[1]", "J P[1] 50% FINE", "Weave End[1]"]
    told = [one["message"] for one in olp.correct(text_of(lines, where), path).report["findings"]]
    assert "P[1] is in UFRAME 1, and UFRAME_NUM is 2 here: the control stops" in told
    assert any("the tool weaves from here on" in one for one in told)
    assert not any("UTOOL" in one for one in told)


def test_the_numbers_of_clones_follow_those_of_the_text() -> None:
    """Each is found in a few steps, however many there are."""
    taken: set[str] = set()
    assert [next_number(taken, lambda: [3, 7, 1], 1) for _ in range(4)] == [8, 9, 10, 11]
    assert [next_number(set(), list, least) for least in (0, 1)] == [0, 1]
    reads = Counted(taken)
    assert next_number(reads, list, 1) == 12
    assert reads.count < 12


class Counted(set[str]):
    """A set that counts how often it is asked."""

    count = 0

    def __contains__(self, name: object) -> bool:
        self.count += 1
        return super().__contains__(name)
