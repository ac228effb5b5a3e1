"""The C file holds the model itself: compiled, it gives the errors of `olp.error_at`, and its own inverse."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from judge import machines
from judge.machines import Recipe
from judge.model import JudgeModel

import olp
from olp.cli import main
from olp.core.errors import CannotCompute, ConfigError, UsageError
from olp.core.machine import Vector
from olp.errormodel.calibration import Calibration, Curve
from olp.errormodel.sources.expansion import Thermal
from olp.errormodel.sources.structure import Distortion, Sensor, Structure
from olp.files.calibration.reader import load_calibration
from olp.files.control_code.carried import carried
from olp.files.control_code.compiled import self_test
from olp.files.control_code.linear import linear_code, vectors
from olp.files.control_code.registry import CODE, write_code
from olp.workflows.session import Session

pytestmark = pytest.mark.slow

DIGEST = "0123456789abcdef" * 4
#: mm; the C file and the model do the same sums
SAME_MM = 1e-9
MANY = """
void many(int n, const double *rows, double *errors)
{
    for (int i = 0; i < n; i++) {
        const double *row = rows + i * (10 + OLP_SENSORS);
        olp_state state;
        for (int k = 0; k < 3; k++) {
            state.tool_mm[k] = row[3 + k];
            state.play[k] = row[7 + k];
        }
        state.payload_kg = row[6];
        for (int k = 0; k < OLP_SENSORS; k++) state.temperature_degC[k] = row[10 + k];
        olp_error(row, &state, errors + 3 * i);
    }
}
"""


def compiled(text: bytes, folder: Path) -> Callable[[np.ndarray], np.ndarray]:
    """The error of the C file at rows of axis position, tool vector, payload, play and temperatures."""
    (folder / "many.c").write_bytes(text + MANY.encode())
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2"]
    library = folder / "many.so"
    subprocess.run(
        ["gcc", *strict, "-shared", "-fPIC", "-o", str(library), str(folder / "many.c"), "-lm"], check=True
    )
    many = ctypes.CDLL(str(library)).many
    double = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
    many.argtypes, many.restype = (ctypes.c_int, double, double), None

    def error(rows: np.ndarray) -> np.ndarray:
        result = np.empty((len(rows), 3))
        many(len(rows), np.ascontiguousarray(rows), result)
        return result

    return error


def test_the_file_agrees_with_error_at_on_1e5_points(tmp_path: Path) -> None:
    recipe = Recipe(chain="YXFZ", off_datum=True, cyclic=True, on_table="Y", peak_um=(300.0, 500.0))
    machine = machines.random_machine(tmp_path / "m", 8, recipe)
    machines.add_map_and_load(machine, np.random.default_rng(8))
    job = machine.parent / "job.toml"
    job.write_text('schema = "olp-job-1"\nmachine = "machine.toml"\nprogram = "p.ngc"\npayload_kg = 30.0\n')
    exported = olp.export_table(None, "c", tmp_path / "model.c", job)
    error = compiled(exported.files[tmp_path / "model.c"], tmp_path)
    rng, tool = np.random.default_rng(1), (40.0, -60.0, -85.5)
    low, high = np.array(machines.TRAVEL).T
    rows = np.zeros((100_000, 10))
    rows[:, :3] = rng.uniform(low - 20.0, high + 20.0, (len(rows), 3))
    rows[:, 3:6], rows[:, 6] = tool, 30.0
    wanted = olp.error_at(machine, rows[:, :3], tool, job, outside_box="hold")["error_um"] / 1e3
    assert np.abs(wanted).max() > 0.1
    assert np.abs(error(rows) - wanted).max() <= SAME_MM
    # and the judge, who multiplies the angles of the load with the other errors too
    judged = JudgeModel(machine).error_mm(rows[::50, :3], tool)
    assert np.abs(error(rows[::50]) - judged).max() <= 1e-4


@pytest.mark.parametrize(
    ("seed", "recipe"),
    [
        (1, Recipe(backlash_um={"X": 6.0, "Z": 3.0}, directed="Y", cyclic=True)),
        (2, Recipe(chain="XYZF", interpolation="linear", off_datum=True, on_table="XZ")),
        (3, Recipe(chain="ZFYX", peak_um=(4000.0, 5000.0), samples=7)),
    ],
)
def test_every_state_of_a_machine_agrees(seed: int, recipe: Recipe, tmp_path: Path) -> None:
    machine = machines.random_machine(tmp_path / "m", seed, recipe)
    machines.add_map_and_load(machine, np.random.default_rng(seed))
    calibration = load_calibration(machine.parent / "calibration.toml")
    told = self_test(
        CODE["c"], write_code(linear_code(calibration, recipe.chain, DIGEST), "c", tmp_path / "model.c")
    )
    assert told.startswith("2000 vectors") and told.endswith("0 unsolved")


LINE: Vector = (0.0, 30.0, -20.0)


def warm(line: Vector = LINE) -> Calibration:
    """A structure with two sensors on one line, and a scale, a beam and a workpiece that grow."""
    spans = {"X": (0.0, 400.0), "Y": (0.0, 300.0)}
    distortions = (
        Distortion("EXX", "beam", spans["X"], 1e-3, 2e-5, 3e-3, LINE),
        Distortion("EBX", "beam", spans["X"], 1e-6, 1e-8, 4e-6, LINE),
        Distortion("EYX", "spindle", spans["X"], 2e-3, 0.0, 0.0, line),
        Distortion("EAY", "spindle", spans["Y"], 0.0, 3e-8, 0.0),
    )
    sensors = (Sensor("beam", 20.0, (15.0, 30.0)), Sensor("spindle", 22.0, (22.0, 40.0)))
    curve = Curve("X", [0.0, 150.0, 400.0], {"EXX": [0.0, 0.01, 0.005], "ECX": [0.0, 4e-5, 1e-5]})
    box = [[0.0, 400.0], [0.0, 300.0], [-200.0, 0.0]]
    thermal = Thermal((0.0, 11e-6, 8e-6), (10.0, 20.0, 30.0), 23e-6, (1.0, 2.0, 3.0), 21.0)
    return Calibration(
        "g", np.array(box), curves=(curve,), thermal=thermal, structure=Structure(sensors, distortions)
    )


@pytest.mark.parametrize("model", ["rigid-body", "huddersfield"])
def test_temperatures_are_taken_at_run_time(model: str, tmp_path: Path) -> None:
    calibration = replace(warm(), model=model)
    kept = carried(calibration, "FXYZ")
    assert [s.name for s in kept.sensors] == ["Y_scale", "Z_scale", "workpiece", "beam", "spindle"]
    rows = vectors(kept, 4000)
    source = write_code(linear_code(calibration, "FXYZ", DIGEST), "c", tmp_path / "model.c")[
        tmp_path / "model.c"
    ]
    found = compiled(source, tmp_path)(rows[:, :-3])
    assert np.abs(found - rows[:, -3:]).max() <= SAME_MM
    assert np.ptp(rows[:, -3:], axis=0).min() > 0.01


def test_a_file_that_is_not_the_model_is_found_out(tmp_path: Path) -> None:
    files = write_code(linear_code(warm(), "FXYZ", DIGEST), "c", tmp_path / "model.c")
    first = next(iter(files))
    for right, wrong in ((b"0.01, ", b"0.0100001, "), (b"(expansion->of_tip ?", b"(!expansion->of_tip ?")):
        broken = files[first].replace(right, wrong)
        assert broken != files[first]
        with pytest.raises(CannotCompute, match="does not agree"):
            self_test(CODE["c"], {**files, first: broken})


BOUNDS = """
#include <stdio.h>
int main(void)
{
    olp_follower at;
    olp_limits limits = {1.0, 1.0, 2.0, 2.0, 0.5, 5e-5, 1};
    olp_state now;
    double place[3] = {300.0, 200.0, -50.0}, wanted[3], command[3], before[3], most = 0.0, switched = 0.0;
    int tick, j, held = 0, limited = 0;
    memset(&at, 0, sizeof at);
    memset(&now, 0, sizeof now);
    memcpy(now.temperature_degC, olp_start_degC, sizeof now.temperature_degC);
    olp_led(&at, &now, place);
    for (j = 0; j < 3; j++) before[j] = at.correction[j];
    for (tick = 0; tick < 4000; tick++) {
        if (tick == 1000) now.tool_mm[2] = -150.0;
        if (tick == 2000) limits.most_mm = 0.002;
        if (tick == 3000) limits.on = 0;
        for (j = 0; j < 3; j++) {
            wanted[j] = place[j];
            if (tick >= 500 && tick < 2900) wanted[j] += 0.02 * (tick - 500) * (j - 1);
        }
        olp_switch(&at, &limits, 1e-3);
        olp_follow(&at, &limits, &now, wanted, 1e-3, command);
        for (j = 0; j < 3; j++) {
            double step = fabs(command[j] - wanted[j] - before[j]);
            if (step > most) most = step;
            if (tick < 500 && step > switched) switched = step;
            if (tick > 2100 && fabs(command[j] - wanted[j]) > 0.002 + 1e-12) held++;
            before[j] = command[j] - wanted[j];
        }
        limited += at.limited;
    }
    printf("%.9f %.9f %d %d %.9f %d %d\\n", most, switched, held, limited, at.share, olp_outside(place),
           olp_outside(wanted) + (command[0] == wanted[0]));
    return 0;
}
"""


def test_every_cycle_is_bounded(tmp_path: Path) -> None:
    """Switched on, another tool, a smaller bound, outside of the box, switched off: in no cycle more than the
    rate allows, and never more than the bound once it is reached."""
    calibration = replace(warm(), backlash_mm=(0.004, 0.0, 0.006))
    files = write_code(linear_code(calibration, "FXYZ", DIGEST), "c", tmp_path / "model.c")
    (tmp_path / "bounds.c").write_bytes(next(iter(files.values())) + BOUNDS.encode())
    built, program = str(tmp_path / "bounds.c"), str(tmp_path / "bounds")
    subprocess.run(["gcc", "-std=c99", "-O1", "-o", program, built, "-lm"], check=True)
    said = subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()
    most, switched, share = float(said[0]), float(said[1]), float(said[4])
    assert 1.9e-3 < most <= 2e-3 + 1e-12
    assert 0.0 < switched < 1e-4
    assert said[2] == "0" and int(said[3]) > 100
    assert share == 0.0
    assert said[5] == "0" and said[6] == "1"


def test_what_code_cannot_hold_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="distortions of axis X on 2 measuring lines"):
        carried(warm((0.0, 99.0, 0.0)), "FXYZ")
    with pytest.raises(ConfigError, match="a backlash below 0"):
        carried(replace(warm(), backlash_mm=(0.0, -0.002, 0.0)), "FXYZ")
    curve = Curve("Y", [0.0, 300.0], {}, {"EYY": [0.0, 0.003]}, {"EYY": [0.001, 0.002]})
    with pytest.raises(ConfigError, match="a backlash below 0"):
        carried(replace(warm(), curves=(curve,)), "FXYZ")
    machine = machines.random_machine(tmp_path / "m", 2, Recipe())
    with pytest.raises(UsageError, match="a table has no code"):
        olp.export_table(machine, "linuxcnc", tmp_path / "t.comp", self_test=True)


def test_the_command_writes_the_file_and_tests_it(tmp_path: Path) -> None:
    machine = machines.random_machine(tmp_path / "m", 2, Recipe(backlash_um={"Y": 4.0}))
    call = ["calibrate", "export", "-m", str(machine), "--format", "c", "-o", str(tmp_path / "model.c")]
    done = CliRunner().invoke(main, [*call, "--self-test"])
    assert done.exit_code == 0, done.output
    assert "self-test: 2000 vectors" in done.stdout
    assert (tmp_path / "model-vectors.txt").stat().st_size > 1000
    digest = Session.start(machine).loaded("hold").digest[:12]
    assert f'olp_calibration[] = "{digest}"' in (tmp_path / "model.c").read_text()
    assert f'real_time = "{digest}"\n' in done.stdout
