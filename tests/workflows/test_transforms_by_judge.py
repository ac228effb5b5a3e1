"""Rotated, mirrored and scaled programs of ISO controls, judged by a reader of its own and another error
model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.fast import some_fast
from judge import iso_frames, machines
from judge.machines import Recipe
from judge.model import JudgeModel

import olp
from olp.core.geometry import arc_points
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read

HEAD = "%\nO1\nG21 G90 G17 G54 G40 G69 G80\nT1 M6\nG0 X0. Y0. Z-10.\n"
OFFSET = np.array((250.0, 200.0, -300.0))
TRAVEL = ((-500.0, 1000.0), (-500.0, 1000.0), (-500.0, 0.0))
#: the last digit where each coordinate is off by half of one
CORNER_UM = 0.87


def block(rng: np.random.Generator, scale: float) -> str:
    x, y, z = rng.uniform(-40, 40, 3) / scale
    r = rng.uniform(80, 110) / scale
    return str(
        rng.choice(
            [
                f"G1 X{x:.3f} Y{y:.3f}", f"G1 X{x:.3f}", f"G1 Y{y:.3f}", f"G1 Z{z / 4 - 20:.3f} X{y:.3f}",
                f"G2 X{x:.3f} R{r:.3f}", f"G3 X{x:.3f} Y{y:.3f} R{r:.3f}", f"G3 X{x:.3f} Y{y:.3f} R-{r:.3f}",
                f"G2 I{x / 2:.3f} J{y / 2:.3f}", f"G3 I{x / 2 + 1:.3f} Z-15.000",
                f"G91 G1 X{x / 4:.3f}\nY{y / 4:.3f}\nG90", f"G0 X{x:.3f}\nG1 Y{y:.3f}",
            ]
        )
    )  # fmt: skip


def program(rng: np.random.Generator, on: str, off: str, scale: float) -> str:
    lines = []
    for _ in range(3):
        lines += [on.format(*np.round(rng.uniform(-1, 1, 3) * (9, 9, 60), 3)), "G0 X1.0 Y2.0 Z-12.0", "F600."]
        lines += [block(rng, scale) for _ in range(8)]
        lines += [off, "G0 Z-10.0", "X3.0 Y1.0", "G1 X5.0 Z-11.0", "Y7.0"]
    return HEAD + "\n".join(lines) + "\nM30\n%\n"


#: how each is switched on and off, the control, keys of the machine, a factor, and the unit of P
KINDS = {
    "rotation": ("G68 X{} Y{} R{}", "G69", "fanuc", 1.0, None),
    "rotation on Haas": ("G68 X{} Y{} R{}", "G69", "haas", 1.0, None),
    "mirror of X": ("G51.1 X{}", "G50.1", "fanuc", 1.0, None),
    "mirror of Y": ("G51.1 Y{}", "G50.1", "fanuc", 1.0, None),
    "both mirrors": ("G51.1 X{}\nG51.1 Y{}", "G50.1", "fanuc", 1.0, None),
    "scaling": ("G51 X{} Y{} Z{} P1500", "G50", "fanuc", 1.5, 0.001),
    "scaling that mirrors": ("G51 X{} Y{} Z{} I-800 J800 K1000", "G50", "fanuc", 0.8, 0.001),
    "scaling on Haas": ("G51 X{} Y{} Z{} P0.5", "G50", "haas", 0.5, None),
}  # fmt: skip


def machine(folder: Path, seed: int, control: str, **more: Any) -> Path:
    path = machines.random_machine(folder, seed, Recipe(controller=control, travel=TRAVEL, **more))
    if control == "fanuc":
        path.write_text(path.read_text().replace("controller", "scaling_unit = 0.001\ncontroller", 1))
    return path


def axes(cut: iso_frames.Cut) -> np.ndarray:
    """(n, 3) axis positions that a cut passes."""
    points = np.array([(w.real, w.imag, z) for w, z in cut.points])
    return points + OFFSET


@pytest.mark.parametrize("seed", some_fast(range(6), 6, 2))
@pytest.mark.parametrize("kind", KINDS)
def test_the_tip_goes_where_the_program_says(tmp_path: Path, kind: str, seed: int) -> None:
    on, off, control, scale, unit = KINDS[kind]
    path = machine(tmp_path, seed, control)
    text = program(np.random.default_rng(seed), on, off, scale)
    result = olp.correct(text.encode(), path)
    nominal = [cut for cut in iso_frames.cuts(text, unit=unit) if not cut.rapid]
    written = iso_frames.cuts(result.data.decode(), unit=unit)
    model = JudgeModel(path)
    tool = model.tool_vector_mm(1)
    reached = np.array([axes(cut)[-1] for cut in written if not cut.rapid])
    ends = reached + model.error_mm(reached, tool)
    digit = max(scale, 1.0)
    for cut in nominal:
        wanted = axes(cut)
        away = np.linalg.norm(ends - wanted[-1], axis=1)
        assert away.min() * 1e3 <= CORNER_UM * digit + 0.05, (cut.line, text.splitlines()[cut.line - 1])
    deviation = result.report["deviation"]
    assert deviation["path_max_um"] <= 1.0 + CORNER_UM * digit * 1.1
    # the digit of a word counts as far as it leads the axes
    assert deviation["allowed_um"] == pytest.approx(1.0 + CORNER_UM * digit, abs=0.01)
    assert deviation["holds"]
    assert len(ends) >= len(nominal)


@pytest.mark.parametrize("kind", KINDS)
def test_every_move_ends_where_the_judge_has_it(tmp_path: Path, kind: str) -> None:
    on, off, control, scale, unit = KINDS[kind]
    path = machine(tmp_path, 1, control)
    for seed in range(8):
        text = program(np.random.default_rng(seed + 50), on, off, scale)
        toolpath = read(text.encode(), load_setup(path), DIALECTS[control]).toolpath
        judged = {cut.line: axes(cut) for cut in iso_frames.cuts(text, unit=unit)}
        move = dict(zip(toolpath.line.tolist(), toolpath.end_mm, strict=True))
        for line, end in move.items():
            if line in judged and not np.isnan(end).any():
                assert end == pytest.approx(judged[line][-1], abs=1e-9), text.splitlines()[line - 1]
        arcs, index = toolpath.arcs, toolpath.arcs.move
        middle = arc_points(
            toolpath.starts_mm()[index], toolpath.end_mm[index], arcs.centre_mm, arcs.plane, arcs.sweep_rad,
            np.full(len(index), 0.5),
        )  # fmt: skip
        for line, point in zip(toolpath.line[index].tolist(), middle, strict=True):
            assert point == pytest.approx(judged[line][3], abs=2e-3), text.splitlines()[line - 1]


@pytest.mark.parametrize("kind", some_fast(KINDS, 4))
def test_arcs_keep_their_way_round_where_backlash_is_taken_up(tmp_path: Path, kind: str) -> None:
    """A step before an arc makes its code necessary, which a mirror image turns round."""
    on, off, control, _, unit = KINDS[kind]
    path = machine(tmp_path, 2, control, backlash_um={"X": 6.0, "Y": 4.0, "Z": 5.0})
    shapes = (
        "G1 X20. Y20.\nX10.\nG3 X-10. Y5. R40.\nG2 X10. Y30. R50.\nG1 X20.\nG2 X0. Y40. R60.\nG3 I9. J3.\n"
    )
    head = on.format(5.0, 7.0, 30.0) + "\nG0 X1. Y2. Z-12.\nF600.\n"
    text = HEAD + head + shapes * 2 + off + "\nM30\n%\n"
    result = olp.correct(text.encode(), path)
    assert result.report["moves"]["inserted_blocks"] > 4
    nominal = np.vstack([axes(cut) for cut in iso_frames.cuts(text, 3000, unit) if not cut.rapid])
    written = np.vstack(
        [axes(c) for c in iso_frames.cuts(result.data.decode(), 8, unit) if len(c.points) > 1]
    )
    for point in written:
        assert np.linalg.norm(nominal - point, axis=1).min() < 0.2
