"""Plans of measurements: time, order, programs, what they would know, and the files that they ask for."""

from __future__ import annotations

import csv
import dataclasses
import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from cases.calibration import residual_of
from click.testing import CliRunner
from hypothesis import example, given, settings
from hypothesis import strategies as st
from judge import simulated

from olp.calibration.design import layout
from olp.calibration.design.prediction import predict
from olp.calibration.design.visiting import move_s, order
from olp.calibration.estimator.adjustment import fit
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.points import Points
from olp.cli import main
from olp.core.errors import CannotCompute, UsageError
from olp.files.config import load_setup
from olp.files.measurements.reader import load_measurements
from olp.program.registry import DIALECTS
from olp.program.rs274.positions import positions_program
from olp.program.rs274.profiles.base import Profile
from olp.program.rs274.reader import read
from olp.workflows.calibrate_plan import INSTRUMENTS, plan_measurements

MACHINE = Path(__file__).resolve().parents[2] / "programs" / "gantry-lines" / "machine.toml"
BOX = np.array(simulated.BOX)


# -- time and order --------------------------------------------------------------------------------------


def slow_time(way: float, v: float, a: float, j: float) -> float:
    """Rest to rest by the peak velocity alone, found by bisection on the distance of two ramps."""

    def ramp(p: float) -> float:
        return p / a + a / j if p > a * a / j else 2.0 * np.sqrt(p / j)

    low, high = 0.0, v
    if v * ramp(v) <= way:
        return way / v + ramp(v)
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if middle * ramp(middle) < way else (low, middle)
    return 2.0 * ramp(low)


@given(st.floats(0.01, 5000), st.floats(10, 1000), st.floats(50, 5000), st.floats(100, 50000))
def test_time_of_a_move(way: float, v: float, a: float, j: float) -> None:
    limits = dict.fromkeys("XYZ", (v, a, j))
    assert move_s(np.array([[0.0, way, 0.5 * way]]), limits)[0] == pytest.approx(
        slow_time(way, v, a, j), 1e-6
    )


@settings(max_examples=15)
@given(st.integers(3, 40), st.integers(0, 99))
@example(6, 64)
def test_an_order_visits_all_and_is_no_slower_than_the_rows(n: int, seed: int) -> None:
    places = np.random.default_rng(seed).uniform(0, 1000, (n, 3))
    limits = load_setup(MACHINE).machine.motion_limits()
    ordered = order(places, limits)
    assert sorted(ordered.tolist()) == list(range(n))
    took = [float(move_s(np.diff(places[k], axis=0), limits).sum()) for k in (ordered, np.arange(n))]
    assert took[0] <= took[1] * (1.0 + 1e-9)


# -- layouts and predictions -----------------------------------------------------------------------------


@given(st.integers(8, 200), st.integers(0, 50))
def test_a_latin_hypercube_has_as_many_levels_as_points(n: int, seed: int) -> None:
    position_mm = layout.hypercube(BOX, n, seed)
    for k in range(3):
        # one in each of n slices, to the digits of a program
        edges = np.linspace(*BOX[k], n + 1)
        assert (np.sort(position_mm[:, k]) >= edges[:-1] - 0.051).all()
        assert (np.sort(position_mm[:, k]) <= edges[1:] + 0.051).all()
    assert (position_mm >= BOX[:, 0]).all() and (position_mm <= BOX[:, 1]).all()


def test_targets_at_which_a_period_hides_are_not_proposed() -> None:
    planned = layout.lines("m", BOX, (0.0, 0.0, -100.0), ((20.0,), (10.0,), (5.0,)), 1)
    for line in planned.measurements.lines:
        period = planned.measurements.periods_mm[line.axis][0]
        phase = np.exp(2j * np.pi * np.unique(line.target_mm) / period)
        assert abs(phase.mean()) < 0.6
    with pytest.raises(CannotCompute, match="no targets"):
        layout.lines("m", BOX, (0.0, 0.0, -100.0), ((6000.0,), (), ()), 1)


@pytest.mark.parametrize(
    ("tools", "hidden"),
    [
        (((0.0, 0.0, -120.0),), {"ECY", "EAZ", "EBZ", "ECZ"}),
        (((0.0, 0.0, -120.0), (0.0, 0.0, -400.0)), {"ECY", "ECZ"}),
        (((0.0, 0.0, -120.0), (200.0, 0.0, -120.0), (400.0, 0.0, -120.0)), {"EAZ"}),
        (simulated.OFFSETS, set()),
    ],
)
def test_what_the_offsets_of_a_reflector_hide(tools: tuple, hidden: set[str]) -> None:
    planned = layout.points("m", BOX, tools, 400, 0.002, 3)
    assert set(predict(planned, "FXYZ", BOX, [tools[0]]).hidden) == hidden


@pytest.mark.slow
def test_a_prediction_is_what_comes_out() -> None:
    """Machines that had no part in it: the median over seeds is within a third of the prediction."""
    tools = (simulated.OFFSETS[0],)
    planned = layout.points("m", BOX, simulated.OFFSETS, 120, 0.005, 1)
    prediction = predict(planned, "FXYZ", BOX, tools)
    after = []
    for seed in range(3):
        machine = simulated.machine(seed, "smooth")
        machine.half = {}
        axis_mm, tool, place = simulated.points(machine, seed, 120, 0.005)
        fitted = fit(Measurements("m", (Points(axis_mm, tool, place, 0.005),)), "FXYZ")
        after.append(residual_of(machine, fitted, tools[0], 400).after_framed)
    assert 0.7 < np.median(after) / (1e3 * prediction.rms_mm) < 1.4


def test_more_points_and_better_ones_are_never_worse() -> None:
    def rms(n: int, sigma: float) -> float:
        planned = layout.points("m", BOX, simulated.OFFSETS, n, sigma, 1)
        return predict(planned, "YFXZ", BOX, [(0.0, 0.0, -99.0)]).rms_mm

    assert rms(400, 0.005) < rms(100, 0.005) < rms(100, 0.01)


# -- programs --------------------------------------------------------------------------------------------


#: controls whose G53 is another code, or an option of the firmware
WITHOUT_MACHINE_POSITIONS = ("okuma", "marlin", "klipper", "fagor")


@pytest.mark.parametrize("control", sorted(name for name, d in DIALECTS.items() if isinstance(d, Profile)))
def test_programs_stop_where_they_are_meant_to(control: str) -> None:
    setup = load_setup(MACHINE)
    setup = dataclasses.replace(setup, machine=dataclasses.replace(setup.machine, controller=control))
    places = np.array([[10.0, 20.0, -30.0], [10.0, 20.0, -200.125], [700.5, 3.25, -4.0]])
    arguments = (DIALECTS[control], places, [0.0, 2.5, 4.0], 3, ["a (note) " * 12])
    if control in WITHOUT_MACHINE_POSITIONS:
        with pytest.raises(CannotCompute, match="has no G53"):
            positions_program(*arguments)
        return
    text = positions_program(*arguments)
    path = read(text, setup, DIALECTS[control]).toolpath
    assert np.array_equal(path.end_mm[0], [np.nan, np.nan, -30.0], equal_nan=True)
    assert np.array_equal(path.end_mm[1:], places)
    words = text.decode().split()
    waits_of = [w for before, w in itertools.pairwise(words) if before == "G4"]
    assert {w[0] for w in waits_of} == {DIALECTS[control].dwell}
    dwell = [float(w[1:]) for w in waits_of]
    pointed = ["." in w for w in waits_of]
    waits = [DIALECTS[control].dwell_s(d, pointed=p) for d, p in zip(dwell, pointed, strict=True)]
    assert waits == [2.5, 4.0]
    assert max(map(len, text.decode().splitlines())) <= 72


# -- the whole -------------------------------------------------------------------------------------------


def filled(folder: Path, values: object) -> None:
    """Fill empty cells of every CSV file with readings."""
    rng = np.random.default_rng(1)
    for file in folder.glob("*.csv"):
        rows = list(csv.reader(file.read_text("utf-8").splitlines()))
        for row in rows[1:]:
            numbers = [float(c) for c in row if c]
            blank = row.count("")
            row[len(row) - blank :] = [f"{v:.5f}" for v in values(numbers, blank, rng)]
        file.write_text("\n".join(",".join(r) for r in rows) + "\n", "utf-8")


@pytest.mark.slow
def test_a_plan_of_points_can_be_filled_in(tmp_path: Path) -> None:
    plan = plan_measurements(MACHINE, instrument="tracker", uncertainty_um=8.0)
    assert plan.chosen.prediction.rms_mm <= 8e-3
    files = plan.files(tmp_path)
    for path, data in files.items():
        path.write_bytes(data)
    travel = plan.setup.machine.axes
    for run in plan.chosen.passes:
        for k, axis in enumerate("XYZ"):
            low, high = travel[axis].travel_mm
            assert (run.places_mm[:, k] >= low).all() and (run.places_mm[:, k] <= high).all()
    filled(tmp_path, lambda v, n, rng: np.add(v[:3], v[3:]) + rng.normal(0, 0.008, 3))
    taken = load_measurements([tmp_path / "measurements.toml"], "FXYZ")
    assert len(taken.scattered[0].axis_mm) == plan.chosen.planned.measurements.scattered[0].axis_mm.shape[0]
    programs = [p for p in files if p.suffix == ".ngc"]
    assert len(programs) == 3
    for program in programs:
        lines = program.read_text("utf-8").splitlines()
        # the ram goes up before anything else moves
        assert next(line for line in lines if line.startswith("G53")) == "G53 G0 Z-4.500"


def test_a_plan_of_lines_can_be_filled_in(tmp_path: Path) -> None:
    plan = plan_measurements(MACHINE, instrument="lines", periods_mm=((10.0,), (), ()))
    for path, data in plan.files(tmp_path).items():
        path.write_bytes(data)
    filled(tmp_path, lambda v, n, rng: rng.normal(0, 0.5, n))
    taken = load_measurements([tmp_path / "measurements.toml"], "FXYZ")
    wanted = plan.chosen.planned.measurements
    assert [line.component for line in taken.lines] == [line.component for line in wanted.lines]
    for a, b in zip(taken.lines, wanted.lines, strict=True):
        assert np.allclose(a.target_mm, b.target_mm)
        assert [v for k, v in enumerate(a.line_mm) if k != a.axis] == [
            v for k, v in enumerate(b.line_mm) if k != b.axis
        ]
        assert (a.tool_mm, a.square, a.sigma) == (b.tool_mm, b.square, pytest.approx(b.sigma))


@pytest.mark.parametrize("instrument", ["pods", "multilateration"])
def test_plans_of_other_instruments_load(tmp_path: Path, instrument: str) -> None:
    plan = plan_measurements(MACHINE, instrument=instrument, points=40)  # type: ignore[arg-type]
    for path, data in plan.files(tmp_path).items():
        path.write_bytes(data)
    filled(tmp_path, lambda v, n, rng: rng.uniform(1000, 1200, n) if n == 1 else rng.uniform(1, 20, n))
    taken = load_measurements([tmp_path / "measurements.toml"], "FXYZ")
    count = sum(len(x.axis_mm) for x in taken.scattered)
    assert count == {"pods": 40, "multilateration": 240}[instrument]


@pytest.mark.slow
def test_the_quickest_good_method_is_chosen() -> None:
    plan = plan_measurements(MACHINE, uncertainty_um=6.0)
    good = [m for m in plan.methods if m.prediction.rms_mm <= 6e-3]
    assert plan.chosen.hours == min(m.hours for m in good)
    assert {m.instrument for m in plan.methods} == set(INSTRUMENTS)
    none = plan_measurements(MACHINE, uncertainty_um=0.01, instrument="tracker", points=30)
    assert next(f.code for f in none.findings) == "OLP837"


def test_a_box_outside_the_travel_is_refused() -> None:
    with pytest.raises(UsageError, match="box along X"):
        plan_measurements(MACHINE, box_mm=((-10.0, 500.0), (0.0, 500.0), (-400.0, 0.0)))


def test_the_command(tmp_path: Path) -> None:
    call = ["calibrate", "plan", "-m", str(MACHINE), "--instrument", "tracker", "--points", "40"]
    done = CliRunner().invoke(main, [*call, "-o", str(tmp_path), "--json"])
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert report["schema"] == "olp-plan-1"
    assert report["methods"][0]["total_h"] > 0
    again = CliRunner().invoke(main, [*call, "-o", str(tmp_path)])
    assert again.exit_code == 2
    assert CliRunner().invoke(main, [*call, "-o", str(tmp_path), "--force"]).exit_code == 0
