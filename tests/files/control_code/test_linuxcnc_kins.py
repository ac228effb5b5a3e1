"""LinuxCNC itself with the generated component runs programs that were not corrected: its joints, through the
judge's model of the machine, stay on the programmed path."""

from __future__ import annotations

import csv
import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from judge import controller, linuxcnc, machines
from judge.controller import Kinematics, Run
from judge.linuxcnc import interpret
from judge.machines import Recipe
from judge.model import JudgeModel
from judge.path import away

import olp
from olp.core.errors import ConfigError, UsageError
from olp.files.calibration.reader import load_calibration
from olp.files.control_code.linear import linear_code
from olp.files.control_code.registry import write_code
from olp.files.write import write_files

pytestmark = [pytest.mark.oracle, pytest.mark.slow]

#: of the judge, wherever it cuts
PATH_UM = 0.2
NAME = "gantrykins"
#: mm/s2; with more, an axis that turns beside one that does not lags within its first two cycles
ACCELERATION = 500.0
PINS = (
    *(f"{NAME}.correction-{a}" for a in "xyz"),
    f"{NAME}.switched-on",
    "motion.tooloffset.z",
    "motion.analog-out-00",
    "motion.analog-out-01",
)
TOOLS = {1: {"Z_mm": 120.0, "radius_mm": 5.0}, 2: {"Z_mm": 85.5, "radius_mm": 3.0}}
#: kg on the machine while measuring
MEASURED_KG = 5.0
#: what every program begins with: every axis takes up its backlash before it cuts
START = """G21 G90 G61 G17 F1200 G54
M68 E0 Q5
M68 E1 Q20
T1 M6 G43 H1
G0 X-60 Y-80 Z10
G0 X5 Y5 Z5
G0 X0 Y0 Z0
"""
PROGRAMS = {
    "lines": "G1 X120 Y20 Z-8\nG1 X130 Y90 Z-30\nG1 X-40 Y60 Z-12\nG1 X0 Y0 Z0\n",
    "arcs": "G2 X40 Y40 I0 J40\nG3 X-40 Y40 I-40 J0\nG2 X-40 Y40 Z-8 I30 J0\n"
    "G18 G2 X0 Z-8 I20 K0\nG17 G1 X0 Y0\n",
    "reversals": "G1 X50\nG1 X10\nG1 X60\nG1 Y20\nG1 Y-5\nG1 Z-10\nG1 Z-2\n"
    "G1 X20 Y10 Z-6\nG1 X60 Y-5 Z-2\nG1 X20 Y10 Z-6\n",
    "tool changes": "G1 X60 Y10 Z-5\nG0 Z20\nT2 M6 G43 H2\nG0 X0 Y0 Z0\nG1 X60 Y10 Z-5\nG2 X60 Y10 I-12 J0\n"
    "G0 Z20\nT1 M6 G43 H1\nG0 X70 Y60\nG1 X0 Y0 Z-3\n",
    "payload": "G1 X60 Y10 Z-5\nM68 E0 Q40\nG0 Z5\nG1 X0 Y40 Z-5\nG3 X30 Y40 I15 J0\n"
    "M68 E0 Q15\nG0 Z2\nG1 X60 Y0 Z-9\n",
    "temperature": "G1 X60 Y10 Z-5\nM68 E1 Q29\nG0 Z5\nG1 X0 Y40 Z-5\nG3 X30 Y40 I15 J0\n"
    "M68 E1 Q17.5\nG0 Z2\nG1 X60 Y0 Z-9\n",
}
WARM = """schema = "olp-thermal-1"
machine = "m"
[[sensors]]
name = "beam"
reference_degC = 20.0
range_degC = [15.0, 30.0]
[[distortions]]
component = "EXX"
sensor = "beam"
span_mm = [0.0, 800.0]
offset_um_K = -6.0
growth_um_m_K = 11.0
[[distortions]]
component = "EBX"
sensor = "beam"
span_mm = [0.0, 800.0]
offset_urad_K = 2.0
growth_urad_m_K = 15.0
"""


def turns_alone(path: Path) -> None:
    """Only the own component of an axis depends on its direction."""
    rows = list(csv.reader(path.read_text().splitlines()))
    half = (len(rows) - 1) // 2
    for column, name in enumerate(rows[0]):
        if name.startswith(("Z_mm", "direction", "EZZ")):
            continue
        for one, other in zip(rows[1 : half + 1], rows[half + 1 :], strict=True):
            one[column] = other[column] = f"{(float(one[column]) + float(other[column])) / 2:.9g}"
    path.write_text("\n".join(map(",".join, rows)) + "\n")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A machine with everything that the judge knows, and its component, compiled."""
    controller.require()
    if shutil.which("halcompile") is None:
        missing = "needs halcompile: apt-get install linuxcnc-uspace-dev"
        pytest.fail(missing) if os.environ.get("OLP_REQUIRE_ORACLE") == "1" else pytest.skip(missing)
    folder = tmp_path_factory.mktemp("kins")
    recipe = Recipe(
        chain="YXFZ", off_datum=True, cyclic=True, directed="Z", backlash_um={"X": 6.0, "Y": 4.0}, tools=TOOLS
    )
    machine = machines.random_machine(folder / "m", 5, recipe)
    turns_alone(folder / "m" / "z.csv")
    machines.add_map_and_load(machine, np.random.default_rng(1))
    (folder / "m" / "job.toml").unlink()
    (folder / "m" / "warm.toml").write_text(WARM)
    with (folder / "m" / "calibration.toml").open("a") as stream:
        stream.write('[thermal]\nstructure = "warm.toml"\n')
    exported = olp.export_table(machine, "linuxcnc-kins", folder / f"{NAME}.comp", self_test=True)
    assert exported.report["self_test"].endswith(" 0 unsolved")
    write_files(exported.files)
    compiled = subprocess.run(
        ["halcompile", "--compile", f"{NAME}.comp"], cwd=folder, capture_output=True, text=True, check=True
    )
    assert "warning" not in compiled.stderr
    return folder


def executed(built: Path, program: str, folder: Path, hal: str = "") -> Run:
    lines = (built / f"{NAME}.hal").read_text().splitlines()
    taken = [line for line in lines if not line.startswith("#") and "payload" not in line]
    taken += [f"net payload motion.analog-out-00 => {NAME}.payload"]
    taken += [f"net warm motion.analog-out-01 => {NAME}.temperature-beam", hal]
    component = Kinematics(NAME, built, "\n".join(taken) + "\n", PINS, ACCELERATION)
    return controller.run(program.encode(), built / "m" / "machine.toml", folder, kinematics=component)


def on_the_machine(built: Path, run: Run) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) where the tip is, as an axis position of an exact machine, and the cycles that cut."""
    judge = JudgeModel(built / "m")
    play, known = judge.play(run.axis)
    tool, actual = np.zeros(run.axis.shape), run.axis.copy()
    tool[:, 2] = -run.pins[:, 4]
    for payload, beam in np.unique(run.pins[:, 5:7], axis=0):
        rows = (run.pins[:, 5:7] == (payload, beam)).all(axis=1)
        judge.load_kg, judge.temperature_degC = payload - MEASURED_KG, {"beam": beam}
        actual[rows] += judge.error_mm(run.axis[rows], tool[rows], play[rows])
    return actual, run.cutting & known.all(axis=1)


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_machine_follows_the_program(name: str, built: Path, tmp_path: Path) -> None:
    program = f"{START}{PROGRAMS[name]}M2\n"
    run = executed(built, program, tmp_path)
    actual, cutting = on_the_machine(built, run)
    moves = interpret(program.encode(), built / "m" / "machine.toml")
    moves = moves.pick(moves.kind != linuxcnc.DWELL)
    assert cutting.sum() > 8000
    assert away(moves, actual[cutting]).max() * 1e3 <= PATH_UM
    # without the component the joints would be the path, and the tip where the joints' error leads it
    assert away(moves, run.axis[cutting]).max() * 1e3 > 20.0


def test_it_is_switched_without_a_jump(built: Path, tmp_path: Path) -> None:
    """Switched on and off at rest, and off again on the move; outside of it the joints are the program."""
    program = (
        f"{START}G1 X30 Y20\nG4 P0.2\nM64 P0\nG4 P1.3\nM65 P0\nG4 P1.3\nM64 P0\nG4 P1.3\n"
        "M65 P0\nG1 X90 Y30 F3000\nG4 P0.5\nM2\n"
    )
    run = executed(built, program, tmp_path, f"net on motion.digital-out-00 => {NAME}.enable")
    correction, share = run.pins[:, :3], run.pins[:, 3]
    step = np.abs(np.diff(correction, axis=0)).max(axis=1)
    ramp = (share[1:] > 0.0) & (share[1:] < 1.0)
    assert {0.0, 1.0} <= set(share.tolist()) and np.abs(np.diff(share)).max() <= 1.01e-3
    assert np.abs(correction[share == 1.0]).max() > 0.02
    assert not correction[share == 0.0].any()
    text = (built / f"{NAME}.comp").read_text()
    rate, most = (float(re.findall(rf"most_{what} = (\S+)", text)[0]) for what in ("rate", "correction"))
    assert ramp.sum() > 3000 and step[ramp].max() <= 4e-3 * most + 2e-6
    assert step.max() <= rate * 1e-3 + 2e-6


def test_what_has_no_name_in_hal_is_refused(tmp_path: Path) -> None:
    machine = machines.random_machine(tmp_path / "m", 2, Recipe())
    calibration = load_calibration(machine.parent / "calibration.toml")
    for name in ("Gantry.comp", "my-kins.comp", "kins.c"):
        with pytest.raises(UsageError, match="expected the name of a component"):
            write_code(linear_code(calibration, "FXYZ", "0" * 64), "linuxcnc-kins", tmp_path / name)
    folder = machine.parent
    (folder / "warm.toml").write_text(
        'schema = "olp-thermal-1"\nmachine = "m"\n'
        + "".join(
            f'[[sensors]]\nname = "{name}"\nreference_degC = 20.0\nrange_degC = [15.0, 30.0]\n'
            f'[[distortions]]\ncomponent = "EXX"\nsensor = "{name}"\n'
            "span_mm = [0.0, 800.0]\noffset_um_K = 1.0\n"
            for name in ("beam 1", "beam-1")
        )
    )
    text = (folder / "calibration.toml").read_text()
    (folder / "calibration.toml").write_text(f'{text}[thermal]\nstructure = "warm.toml"\n')
    calibration = load_calibration(folder / "calibration.toml")
    with pytest.raises(ConfigError, match='"beam-1" has no name of its own in HAL'):
        write_code(linear_code(calibration, "FXYZ", "0" * 64), "linuxcnc-kins", tmp_path / "kins.comp")
