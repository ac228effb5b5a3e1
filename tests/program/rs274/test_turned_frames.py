"""Turned work offsets, as LinuxCNC carries them out: every move ends where its interpreter has it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from judge import linuxcnc, machines
from judge.machines import Recipe

from olp.core.turns import Turns, about_z, rows_of, turned
from olp.files.config import load_setup
from olp.program.registry import DIALECTS
from olp.program.rs274.reader import read

#: one block each; what is left out keeps its coordinate in the program, whatever turns
BLOCKS = (
    "G0 X{} Y{} Z{}", "G0 X{}", "G1 Y{}", "G1 Z{}", "G2 X{} Y{} R300", "G3 I4 J1", "G3 Z{} I5 P2",
    "G10 L2 P1 R{}", "G10 L2 P1 X{} R{}", "G10 L2 P2 R{} Y{}", "G54\nG1 X{}", "G55\nG1 Y{}",
    "G92 X{} Y{}\nG1 Y{}\nX{}\nG92.1",
    "G92 Z{}", "G43 H2\nG1 X{}", "G43 H1\nG1 Y{}", "G49\nG1 Y{}", "G91 G1 X{}\nG90", "G91 G1 Y{} Z{}\nG90",
    "G53 G0 Y{}", "G81 X{} Y{} Z-90 R90", "G91 G81 X3 Z-2 R40 L2\nG90", "G80",
)  # fmt: skip


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(10))
def test_interleaved_blocks_end_where_the_interpreter_has_them(tmp_path: Path, seed: int) -> None:
    linuxcnc.require()
    rng = np.random.default_rng(seed)
    path = machines.random_machine(tmp_path, seed, Recipe())
    lines = ["G21 G90 G17 F600", "G0 X0 Y0 Z9", f"G10 L2 P1 R{rng.uniform(-180, 180):.3f}"]
    for block in rng.choice(BLOCKS, 40):
        lines.append(str(block).format(*np.round(rng.uniform(-50, 50, 4), 3)))
        if "G2" in block or "G3" in block or "G8" in block:
            lines += ["G80", "G1 X1"]
    text = ("\n".join(lines) + "\nM2\n").encode()
    moves = linuxcnc.interpret(text, path, find_known=False)
    program = read(text, load_setup(path), DIALECTS["linuxcnc"])
    ours = program.toolpath
    reached, stated = ends(moves.line, moves.axis), ends(ours.line, ours.end_mm)
    assert set(stated) <= set(reached)
    for line, place in stated.items():
        assert place == pytest.approx(reached[line], abs=1e-6), lines[line - 1]
    arcs = moves.centre[moves.kind == linuxcnc.ARC]
    assert ours.arcs.centre_mm[:, :2] == pytest.approx(arcs[:, :2], abs=1e-6)


def ends(line: np.ndarray, axis: np.ndarray) -> dict[int, np.ndarray]:
    """The position behind each line."""
    return dict(zip(line.tolist(), axis, strict=True))


def test_an_axis_that_is_not_known_makes_only_those_unknown_that_it_enters() -> None:
    point = np.array([[1.0, np.nan, 3.0]])
    assert np.isnan(turned(about_z(30.0), point)).tolist() == [[True, True, False]]
    assert turned(about_z(90.0), point).tolist()[0][1:] == [1.0, 3.0]


def test_words_and_axes_are_inverse_in_any_frame() -> None:
    mirror = np.diag([-2.0, 2.0, 2.0])
    turns = Turns.of([None, rows_of(about_z(33.0)), rows_of(mirror), rows_of(about_z(33.0))])
    assert turns is not None
    assert turns.of_frame.tolist() == [0, 1, 2, 1]
    points = np.random.default_rng(1).uniform(-9, 9, (4, 3))
    assert turns.axes(turns.words(points, turns.of_frame), turns.of_frame) == pytest.approx(points)
    planes = np.zeros(4, np.int64)
    assert turns.mirrors(turns.of_frame, planes).tolist() == [False, False, True, False]
    assert turns.sizes(turns.of_frame, planes) == pytest.approx([1.0, 1.0, 2.0, 1.0])
    assert turns.mirrors(turns.of_frame, planes + 2).tolist() == [False] * 4
    assert Turns.of([None, None]) is None


def test_right_angles_are_exact() -> None:
    assert (about_z(-270.0) @ [1.0, 2.0, 3.0]).tolist() == [-2.0, 1.0, 3.0]
    assert about_z(45.0)[0] == pytest.approx([0.5**0.5, -(0.5**0.5), 0.0])
