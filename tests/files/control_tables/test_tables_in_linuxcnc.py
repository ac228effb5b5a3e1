"""LinuxCNC itself with an exported table: its drives get the commands that the model of the table predicts,
and the judge's machine is then at the position of the predicted residual."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from judge import controller, machines
from judge.machines import Recipe
from judge.model import JudgeModel

import olp
from olp.calibration.control_tables.controls import AxisTables
from olp.errormodel.build import build
from olp.files.calibration.reader import load_calibration
from olp.files.control_tables.base import Given
from olp.files.control_tables.registry import read_table
from olp.files.write import write_files

pytestmark = [pytest.mark.oracle, pytest.mark.slow]

#: Difference to the table at rest: the control shows positions rounded to the nanometre.
AT_REST_MM = 2e-6
#: Difference to the table on the move, where the control ramps to it.
MOVING_MM = 3e-4
#: Cycles of 1 ms after a change of direction in which it ramps from one side of the table to the other.
RAMP = 150


def test_without_a_table_the_drives_follow_the_command(tmp_path: Path) -> None:
    controller.require()
    machine = machines.zero_machine(tmp_path / "machine")
    run = controller.run(b"G21 G90 G61 F9000\nG1 X-100 Y-50\nG1 X0\nM2\n", machine, tmp_path / "control")
    assert np.ptp(run.axis[:, 0]) > 50.0
    assert np.abs(run.motor - run.axis).max() <= AT_REST_MM


def program(machine_offset_mm: tuple[float, float, float]) -> bytes:
    """In both directions along each axis with rests, and slanted moves; in axis positions."""
    x, y, z = machine_offset_mm
    stops = [
        (700, 20, -30), (650, 20, -30), (20, 550, -30), (20, 500, -380), (20, 500, -40), (400, 300, -200),
        (390, 310, -210), (60.5, 33.25, -3.125),
    ]  # fmt: skip
    lines = [b"G21 G90 G94 G61 G54 F9000"]
    lines += [f"G1 X{a - x:.4f} Y{b - y:.4f} Z{c - z:.4f}\nG4 P0.4".encode() for a, b, c in stops]
    return b"\n".join([*lines, b"M2\n"])


def directions(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) sign of the last motion of each joint, and the cycles since it changed."""
    sign, since = np.zeros(axis.shape), np.zeros(axis.shape, int)
    for i in range(1, len(axis)):
        step = np.sign(np.where(np.abs(axis[i] - axis[i - 1]) > 5e-7, axis[i] - axis[i - 1], 0.0))
        turned = (step != 0) & (step != sign[i - 1])
        sign[i] = np.where(turned, step, sign[i - 1])
        since[i] = np.where(turned, 0, since[i - 1] + 1)
    return sign, since


@pytest.mark.parametrize("kind", [0, 1])
def test_the_control_moves_as_the_table_predicts(kind: int, tmp_path: Path) -> None:
    controller.require()
    recipe = Recipe(angular=False, squareness=False, directed="X", backlash_um={"Y": 8.0})
    machine = machines.random_machine(tmp_path / "machine", 5 + kind, recipe)
    exported = olp.export_table(machine, "linuxcnc", tmp_path / "table.ini", comp_type=kind)
    write_files(exported.files)
    setup = olp.load_setup(machine).machine
    travel = np.array([setup.axes[a].travel_mm for a in "XYZ"])
    table = read_table(tmp_path / "table.ini", "linuxcnc", Given(travel_mm=travel)).calibration

    text = program(setup.work_offsets["G54"].offset_mm)
    run = controller.run(text, machine, tmp_path / "control", tables=tmp_path / "table.ini")

    sign, since = directions(run.axis)
    predicted = AxisTables(table).offset(run.axis, np.zeros(3), sign)
    shown = run.motor - run.axis
    moved = (sign != 0).all(axis=1)
    still = np.zeros(len(moved), bool)
    still[RAMP:] = (np.abs(run.axis[RAMP:] - run.axis[:-RAMP]) == 0.0).all(axis=1)
    settled = moved & (since > RAMP).all(axis=1)
    assert (moved & still).sum() > 500 and settled.sum() > 3000
    assert np.abs(shown - predicted)[moved & still].max() <= AT_REST_MM
    assert np.abs(shown - predicted)[settled].max() <= MOVING_MM

    # at a change of direction it goes from one side to the other in a ramp, not in a step
    ones = np.ones(run.axis.shape)
    sides = [AxisTables(table).offset(run.axis, np.zeros(3), side * ones) for side in (1.0, -1.0)]
    assert np.abs(sides[0] - sides[1])[:, 1].max() == pytest.approx(0.008, abs=1e-9)
    step = np.abs(np.diff(shown[:, 1]))
    assert 5e-4 < step.max() < 6e-3

    # the judge's machine under these drives is at the position of the predicted residual
    judge = JudgeModel(machine.parent)
    chosen = np.flatnonzero(moved & still)[::40]
    tool_vector = np.array([0.0, 0.0, -120.0])
    tools = np.tile(tool_vector, (len(chosen), 1))
    drives = run.motor[chosen]
    actual = drives - run.axis[chosen] + judge.error_mm(drives, tools, sign[chosen])
    command = run.axis[chosen] + predicted[chosen]
    calibration = load_calibration(machine.parent / "calibration.toml")
    model = build(calibration, setup.chain, outside="hold")
    residual = predicted[chosen] + model.error(command, tool_vector, sign[chosen])
    assert np.abs(actual - residual).max() <= 1e-5
    uncorrected = judge.error_mm(run.axis[chosen], tools, sign[chosen])
    assert np.abs(uncorrected).max() > 0.01
