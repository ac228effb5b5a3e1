"""Random contours under cutter compensation, nominal and corrected, judged by LinuxCNC's interpreter."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
from judge import linuxcnc, machines
from judge.contours import contour, entered, worn
from judge.linuxcnc import ARC, CanonMoves
from judge.machines import Recipe
from judge.path import _Curves, judge_programs

import olp
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read

pytestmark = pytest.mark.oracle

OFFSETS = {"G54": {"X_mm": 300.0, "Y_mm": 300.0, "Z_mm": -200.0, "set_by": "true"}}
#: a new cutter, worn ones, and one that is worn to less than nothing, as where the program has its path
TOOLS = {
    1: {"Z_mm": 0.0, "radius_mm": 5.0, "wear_mm": -0.03},
    2: {"Z_mm": 0.0, "radius_mm": 3.0, "wear_mm": 0.02},
    3: {"Z_mm": 0.0, "radius_mm": 0.0, "wear_mm": -0.35},
    4: {"Z_mm": 0.0, "radius_mm": 0.0, "wear_mm": 0.8},
}
RECIPE = Recipe(work_offsets=OFFSETS)
WORN = Recipe(work_offsets=OFFSETS, tools=TOOLS, peak_um=(10.0, 30.0), increment_mm=0.0001)
PLAY = {"X": 6.0, "Y": 4.0, "Z": 3.0}
CUTTING = ("feed", "arc")
#: um: numerical tolerance and the last digit; digits turn a block by their share of its length
ALLOWED_UM = 1.0 + 0.2


def swept(moves: CanonMoves) -> np.ndarray:
    """(n,) rad along the arcs of the interpreter, 0 of other moves."""
    rad = np.zeros(len(moves))
    rows = np.flatnonzero(moves.kind == ARC)
    rad[rows] = _Curves.of(moves).sweep
    return rad


@pytest.mark.parametrize("block", range(4))
def test_the_path_of_the_tool_is_the_interpreters(tmp_path: Path, block: int) -> None:
    """Every move of it, or a refusal by both. What the interpreter takes, and goes nearly round for a short
    arc, is refused too."""
    path = machines.zero_machine(tmp_path, RECIPE)
    setup = load_setup(path)
    taken, refused, differ = 0, 0, []
    for seed in range(100 * block, 100 * block + 100):
        text = contour(seed)
        try:
            moves = linuxcnc.interpret(text, path, find_known=False)
        except linuxcnc.InterpreterError:
            moves = None
        try:
            mine = read(text, setup, DIALECTS["linuxcnc"]).toolpath
        except ProgramError:
            mine = None
        if moves is None or mine is None:
            refused += 1
            # the arcs of these programs have 2.5 rad at most
            away = moves is not None and np.abs(swept(moves)).max() > 3.2
            differ += [seed] if (moves is None) != (mine is None) and not away else []
            continue
        taken += 1
        same = len(mine) == len(moves) and np.abs(mine.end_mm - moves.axis).max() < 1e-6
        for arc, move in enumerate(mine.arcs.move if same else ()):
            axes = list(PLANES[mine.arcs.plane[arc]][:2])
            off = np.abs(mine.arcs.centre_mm[arc] - moves.centre[move])[axes].max()
            same &= bool(off < 1e-6 and moves.kind[move] == ARC)
        if same:
            off = np.abs(swept(moves)[mine.arcs.move] - mine.arcs.sweep_rad).max(initial=0.0)
            same = bool(off < 1e-5)
        differ += [] if same else [seed]
    assert not differ
    assert taken > 40 and refused > 20


#: what may be between two blocks of a contour
BETWEEN = (
    "M0", "M1", "G61", "G64 P0.1", "G98", "G99", "M48", "M52", "M64 P0", "G43 H1", "G49", "G43.1 Z1", "G18",
    "G17", "G4 P0.1", "M8", "M3 S100", "T2", "G90", "(MSG, here)", "G91 X5 Y5\nG90", "X30\nX30", "Z5",
    "M6 T1", "G28", "G53 G0 X0", "G41 D1", "G42 D1", "G92 X0", "G55", "G80", "G40 M1\nG41 D2 X33 Y-9",
    "G40 G61\nG41 D2 X33 Y-9", "G40\nG0 Z5\nG42 D2 X33 Y-9",
)  # fmt: skip


@pytest.mark.parametrize("entry", ["G1 X20", "G1 Z5\nX20", "G0 Z5\nX20", "G1 X20 Z5", "G1 X2"])
def test_what_is_in_a_contour_is_taken_or_refused_as_by_the_interpreter(tmp_path: Path, entry: str) -> None:
    path = machines.zero_machine(tmp_path, WORN)
    setup = load_setup(path)
    for block in BETWEEN:
        text = f"G21 G90 G17 G54 F600\nG0 X0 Y0 Z10\nG41 D2\n{entry}\n{block}\n".encode()
        text += b"G1 X40 Y20\nG40 X90\nM2\n"
        taken = True
        try:
            read(text, setup, DIALECTS["linuxcnc"])
        except ProgramError:
            taken = False
        # a stop within a corner makes the interpreter cut into it
        assert taken == (linuxcnc.accepts(text, path) and block not in ("M0", "M1")), block


def moving(axis: np.ndarray) -> np.ndarray:
    """Without moves of zero length."""
    return axis[np.append(True, (np.abs(np.diff(axis, axis=0)) > 1e-7).any(axis=1))]


@pytest.mark.parametrize("cycle", ["G81 {} Z-5 R{}", "G98 G83 {} Z-5 R{} Q2", "G85 {} Z-5 R{}\nX70"])
def test_holes_behind_a_contour_are_reached_as_by_the_interpreter(tmp_path: Path, cycle: str) -> None:
    """Where the contour ended, at places beside it, at all levels; behind G40, and a move along Z."""
    path = machines.zero_machine(tmp_path, WORN)
    setup = load_setup(path)
    for place in ("X50 Y0", "", "X50", "Y0", "X60 Y0"):
        for level in (-2, 0, 3, 7):
            for off in ("G40\n", "G40 ", "G40\nG0 Z5\n"):
                text = f"G21 G90 G17 G54 F600\nG0 X0 Y0 Z10\nG1 Z0\nG42 D1 G1 X20 Y0\nX50\n{off}"
                data = f"{text}{cycle.format(place, level)}\nG80\nM2\n".encode()
                theirs = moving(linuxcnc.interpret(data, path, find_known=False).axis)
                mine = moving(read(data, setup, DIALECTS["linuxcnc"]).toolpath.end_mm)
                assert mine == pytest.approx(theirs, abs=1e-6), (place, level, off)


@pytest.mark.parametrize(
    ("block", "form"), some_of_a_campaign([(b, form) for form in ("contour", "path") for b in range(4)], 4)
)
def test_the_tool_goes_where_it_should_with_a_worn_cutter(tmp_path: Path, block: int, form: str) -> None:
    """Along 25 contours each: the interpreter's path of the corrected program, on the judge's machine."""
    path = machines.random_machine(tmp_path, block, WORN)
    off, taken = {}, 0
    for seed in range(25 * block, 25 * block + 25):
        nominal = worn(seed)
        result = olp.correct(nominal, path, contour=form)  # type: ignore[arg-type]
        verdict = judge_programs(nominal, result.data, path, kinds=CUTTING)
        taken += verdict.after.judged > 0
        if verdict.max_um > ALLOWED_UM:
            off[seed] = verdict.max_um
        assert (b"G41" in result.data or b"G42" in result.data) == (form == "contour")
        assert olp.verify(nominal, result.data, path).report["deviation"]["holds"]
    assert not off
    assert taken == 25


def test_an_arc_enters_a_contour_as_the_interpreter_has_it(tmp_path: Path) -> None:
    path = machines.zero_machine(tmp_path, RECIPE)
    setup = load_setup(path)
    differ = []
    for seed in range(100):
        mine = read(entered(seed), setup, DIALECTS["linuxcnc"]).toolpath
        moves = linuxcnc.interpret(entered(seed), path, find_known=False)
        arc = int(np.flatnonzero(moves.kind == ARC)[0])
        same = len(mine) == len(moves) and np.abs(mine.end_mm - moves.axis).max() < 1e-6
        same = same and np.abs(mine.arcs.centre_mm[0] - moves.centre[arc])[:2].max() < 1e-5
        same = same and abs(swept(moves)[arc] - mine.arcs.sweep_rad[0]) < 1e-5
        differ += [] if same else [seed]
    assert not differ


#: an arc whose begin is behind the end of the tool's path, and an own arc of the tool that stays near
BACKWARD = 5052


def test_an_arc_that_enters_backwards_is_written_as_the_path_of_the_tool(tmp_path: Path) -> None:
    path = machines.random_machine(tmp_path, 3, WORN)
    nominal = entered(BACKWARD)
    with pytest.raises(ProgramError, match="against its own direction") as refused:
        olp.correct(nominal, path)
    assert refused.value.line == 5
    assert "--contour path" in refused.value.message
    result = olp.correct(nominal, path, contour="path")
    assert judge_programs(nominal, result.data, path, kinds=CUTTING).max_um < ALLOWED_UM
    assert olp.verify(nominal, result.data, path).report["deviation"]["holds"]


@pytest.mark.parametrize("form", some_of_a_campaign(["contour", "path"], 2))
def test_the_tool_goes_where_it_should_along_an_arc_that_enters(tmp_path: Path, form: str) -> None:
    path = machines.random_machine(tmp_path, 3, WORN)
    off, taken = {}, 0
    for seed in range(20):
        nominal = entered(seed)
        try:
            result = olp.correct(nominal, path, contour=form)  # type: ignore[arg-type]
        except ProgramError as error:
            assert "on the wrong side" in error.message
            continue
        verdict = judge_programs(nominal, result.data, path, kinds=CUTTING)
        taken += 1
        assert olp.verify(nominal, result.data, path).report["deviation"]["holds"]
        if verdict.max_um > ALLOWED_UM:
            off[seed] = verdict.max_um
    assert not off
    assert taken >= 18


@pytest.mark.parametrize("block", some_of_a_campaign(range(3), 3))
def test_short_blocks_turn_no_farther_than_the_tolerance(tmp_path: Path, block: int) -> None:
    """Blocks from 0.03 mm on, which one digit turns by 3 mrad: along the path the tool may be early."""
    path = machines.random_machine(tmp_path, block, WORN)
    off, taken = {}, 0
    for seed in range(50 * block, 50 * block + 50):
        nominal = contour(seed)
        if not linuxcnc.accepts(nominal, path):
            continue
        result = olp.correct(nominal, path)
        verdict = judge_programs(nominal, result.data, path, kinds=CUTTING, smooth_rad=0.05)
        taken += 1
        if verdict.max_um > ALLOWED_UM or not result.report["deviation"]["holds"]:
            off[seed] = verdict.max_um
    assert not off
    assert taken > 15


@pytest.mark.parametrize("play", [{}, PLAY])
@pytest.mark.parametrize("block", some_of_a_campaign(range(3), 3))
def test_a_contour_that_was_taken_is_taken_once_corrected(
    tmp_path: Path, block: int, play: dict[str, float]
) -> None:
    path = machines.random_machine(tmp_path, block, Recipe(backlash_um=play, waves=4.0, work_offsets=OFFSETS))
    wrong, taken, refused = [], 0, 0
    for seed in range(50 * block, 50 * block + 50):
        nominal = contour(seed)
        if not linuxcnc.accepts(nominal, path):
            continue
        try:
            result = olp.correct(nominal, path)
        except ProgramError as error:
            assert error.line is not None
            refused += 1
            continue
        taken += 1
        wrong += [] if linuxcnc.accepts(result.data, path) else [seed]
    assert not wrong
    assert taken > 15
    assert refused <= 4


def test_nothing_changes_without_errors(tmp_path: Path) -> None:
    path = machines.zero_machine(tmp_path, WORN)
    for seed in range(60):
        assert olp.correct(worn(seed), path).data == worn(seed)


@pytest.mark.parametrize("seed", range(4))
def test_with_backlash_a_path_turns_by_steps(tmp_path: Path, seed: int) -> None:
    recipe = Recipe(
        work_offsets=OFFSETS, tools=TOOLS, peak_um=(10.0, 30.0), increment_mm=0.0001, backlash_um=PLAY
    )
    path = machines.random_machine(tmp_path, seed, recipe)
    contours = olp.correct(worn(seed), path).report["deviation"]
    paths = olp.correct(worn(seed), path, contour="path").report["deviation"]
    assert paths["holds"]
    assert paths["path_max_um"] <= contours["path_max_um"]
