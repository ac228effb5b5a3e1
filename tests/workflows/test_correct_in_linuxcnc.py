"""Corrected programs executed by the whole of LinuxCNC: what its planner commands, on the judge's machine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import ROUNDING, TOLERANCE_UM
from judge import controller, linuxcnc, machines, programs
from judge.machines import Recipe
from judge.model import JudgeModel
from judge.path import densify, shifts, tool_vectors
from scipy.spatial import cKDTree

import olp

pytestmark = [pytest.mark.oracle, pytest.mark.slow]

RANGE = ((-20.0, 20.0), (-20.0, 20.0), (-10.0, 10.0))
#: what sampling adds, in um; with G61 the control stays on its interpreter's path
SLACK_UM = 0.05


def distances_mm(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """(n,) distance of points (n, 3) from a finely sampled line (m, 3), which may pass a place many times."""
    _, near = cKDTree(line).query(points, k=16)
    distance = np.full(len(points), np.inf)
    for first in (*np.maximum(near - 1, 0).T, *np.minimum(near, len(line) - 2).T):
        a, d = line[first], line[first + 1] - line[first]
        square = np.maximum((d * d).sum(axis=1), 1e-30)
        share = np.clip(((points - a) * d).sum(axis=1) / square, 0.0, 1.0)
        distance = np.minimum(distance, np.sqrt(((points - a - share[:, None] * d) ** 2).sum(axis=1)))
    return distance


@pytest.mark.parametrize("seed", [11, 12])
def test_the_control_drives_the_corrected_path(seed: int, tmp_path: Path) -> None:
    controller.require()
    recipe = Recipe(chain="YFXZ" if seed % 2 else "FXYZ", cyclic=bool(seed % 2))
    machine = machines.random_machine(tmp_path / "machine", seed, recipe)
    features = ["lines", "arcs", "helix", "planes"]
    nominal = programs.random_program(seed, features=features, range_mm=RANGE, blocks=6, inch=False)
    nominal = nominal.replace(b"G94", b"G61 G94", 1)
    corrected = olp.correct(nominal, machine).data
    model = JudgeModel(machine.parent)

    moves = linuxcnc.interpret(nominal, machine.parent)
    dense = densify(moves, 0.02)
    tip = dense.points + shifts(dense.moves, model)[dense.move]
    cutting = np.isin(moves.kind, (linuxcnc.FEED, linuxcnc.ARC)) & moves.known.all(axis=1)
    tool_vector = tool_vectors(moves, model)[cutting]
    assert (tool_vector == tool_vector[0]).all()
    kept = np.isin(dense.move, np.flatnonzero(cutting))
    vertices = tip[dense.last & kept]

    allowed_mm = (TOLERANCE_UM + ROUNDING * 1.0 + SLACK_UM) * 1e-3
    worst = []
    for text in (nominal, corrected):
        run = controller.run(text, machine, tmp_path / f"control{len(worst)}")
        commanded = run.axis[run.cutting]
        assert len(commanded) > 1000
        real = commanded + model.error_mm(commanded, np.tile(tool_vector[0], (len(commanded), 1)))
        worst.append((distances_mm(real, tip).max(), distances_mm(vertices, real).max()))
    assert worst[0][0] > 0.02
    assert max(worst[1]) <= allowed_mm
