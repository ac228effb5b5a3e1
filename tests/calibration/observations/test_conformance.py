"""What every registered instrument must do. Its rows are derivatives of its own readings; errors explain the
readings that they made; a blunder is detected; the report names it; its files are read back unchanged."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from cases.instruments import BOX, DATUM, EXAMPLES, TOOL, Error

from olp.calibration.estimator.basis import CurveSpace, Spline
from olp.calibration.estimator.normal import residuals_of
from olp.calibration.estimator.parameters import MeasuringLine, Parameters
from olp.calibration.estimator.summary import TALLIES
from olp.calibration.observations.base import OUTLIER, Observation, Result, ScatteredState, State
from olp.core.arrays import Array
from olp.core.machine import COMPONENTS
from olp.core.schema import fields_of
from olp.core.units import AXES
from olp.files.measurements.instruments.registry import INSTRUMENTS, planner_of, rank_of
from olp.files.measurements.reader import load_measurements
from olp.files.measurements.schemas import MeasurementsFile

CHAIN = "FXYZ"
KEYS = [instrument.key for instrument in INSTRUMENTS]
PLAN = 'schema = "olp-measurements-1"\nmachine = "m"\nmeasured = 2026-05-14\ntemperature_degC = 20.0\n'


def _parameters() -> Parameters:
    spaces, measuring_lines = {}, {}
    for name in COMPONENTS:
        axis = AXES.index(name[2])
        kind = "straight" if name[1] in AXES and name[1] != name[2] else "zero"
        spaces[name] = CurveSpace.of(Spline(*BOX[axis], 5), (), DATUM[axis], kind)  # type: ignore[arg-type]
        measuring_lines[name] = MeasuringLine(DATUM, TOOL)
    return Parameters(CHAIN, DATUM, spaces, measuring_lines)


P = _parameters()
NONE = np.zeros(P.size)


def theta_of(seed: int) -> Array:
    """Errors of some um, some urad and a squareness of some tens of urad."""
    theta = np.random.default_rng(seed).normal(0.0, 3e-3, P.size)
    for name, part in P.slices.items():
        theta[part] *= 1.0 if name in COMPONENTS and name[1] in AXES else 2e-3
    return theta


def machine(theta: Array) -> Error:
    return lambda position, tool: np.asarray(P.design(np.atleast_2d(position), np.asarray(tool)) @ theta)


def settled(taken: Observation, theta: Array) -> State:
    """Its state once its own unknowns have converged under errors theta."""
    screened = taken.screened()
    state = screened.observation.start(screened.noise)
    for _ in range(12):
        step = state.step(state.block(P, theta), theta)
        if step.small:
            return state
        state = state.moved(step, ())
    raise AssertionError("its own unknowns do not converge")


def standardised(taken: Observation, theta: Array) -> Array:
    return residuals_of(settled(taken, theta).block(P, theta), theta)[2]


@pytest.mark.parametrize("key", KEYS)
def test_it_is_registered_whole(key: str) -> None:
    """A list of its tables in a plan, readings for this suite, and a position in the order of the report."""
    (instrument,) = (i for i in INSTRUMENTS if i.key == key)
    assert key in EXAMPLES, f"no readings for {key}; add them to tests/cases/instruments.py"
    assert instrument.words.startswith(f"tables [[{key}]]") and key in fields_of(MeasurementsFile)
    for taken in EXAMPLES[key](machine(NONE)):
        assert type(taken) is instrument.gives
        assert INSTRUMENTS[rank_of(taken)].gives is instrument.gives


@pytest.mark.parametrize("key", KEYS)
def test_a_perfect_machine_leaves_no_residual(key: str) -> None:
    for taken in EXAMPLES[key](machine(NONE)):
        assert np.abs(standardised(taken, NONE)).max() < 1e-3


@pytest.mark.parametrize("key", KEYS)
def test_the_errors_that_made_readings_explain_them(key: str) -> None:
    """All of the readings: estimate and residuals are what was read. Without the errors they do not fit."""
    theta = theta_of(1)
    unexplained = 0.0
    for taken in EXAMPLES[key](machine(theta)):
        unexplained = max(unexplained, float(np.abs(standardised(taken, NONE)).max()))
        assert np.abs(standardised(taken, theta)).max() < 0.05
    assert unexplained > 3.0


@pytest.mark.parametrize("key", KEYS)
def test_rows_are_finite_differences_of_what_it_expects_to_read(key: str) -> None:
    theta, change = theta_of(2), theta_of(3)
    for taken in EXAMPLES[key](machine(theta)):
        state = settled(taken, theta)

        def misses(errors: Array, state: State = state) -> Array:
            """Read less expected where the errors are `errors`, with the present own unknowns."""
            block = state.block(P, errors)
            return np.concatenate([c.y - c.rows @ errors[block.columns] for c in block.chunks()])

        block = state.block(P, theta)
        rows = np.concatenate([c.rows for c in block.chunks()]) @ change[block.columns]
        differences = 0.5 * (misses(theta - change) - misses(theta + change))
        assert np.abs(rows).max() > 0.0
        assert differences == pytest.approx(rows, abs=1e-4 * float(np.abs(rows).max()))


@pytest.mark.parametrize("key", KEYS)
def test_its_reach_is_where_it_was_read(key: str) -> None:
    for taken in EXAMPLES[key](machine(NONE)):
        for (low, high), q in zip(BOX, map(taken.reach, range(3)), strict=True):
            assert q.ndim == 1 and (not len(q) or (low <= q.min() and q.max() <= high))


#: The columns that an instrument reads, and a blunder in their unit.
READ = {
    "value": 0.05, "measured_mm": 0.05, "length_mm": 0.05, "azimuth_rad": 1e-4, "value_rad": 1e-4,
    "axis_mm": 0.05,
}  # fmt: skip


@pytest.mark.parametrize("key", KEYS)
def test_a_blunder_is_left_out_or_stands_out(key: str) -> None:
    theta = theta_of(4)
    taken = EXAMPLES[key](machine(theta))[0]
    name = next(name for name in READ if hasattr(taken, name))
    values = np.array(getattr(taken, name), float)
    size = READ[name] * (1e-2 if getattr(taken, "quantity", "") == "angle" else 1.0)
    values[(7, *[0] * (values.ndim - 1)) if values.ndim else ()] += size
    wrong = dataclasses.replace(taken, **{name: values if values.ndim else float(values)})  # type: ignore[type-var]
    assert not taken.screened().outliers
    outliers = [*wrong.screened().outliers]
    state = settled(wrong, theta)
    block = state.block(P, theta)
    outliers += state.slips(block, theta, True)
    screens = type(state).slips is not State.slips or type(taken).screened is not Observation.screened
    assert bool(outliers) == screens
    if outliers:
        rows = getattr(taken, "row")  # noqa: B009
        assert [outlier.row for outlier in outliers] == [int(rows[7])]
        kept = state.moved(state.step(block, theta), outliers)
        assert kept.count == settled(taken, theta).count - 1
    else:
        assert np.abs(residuals_of(block, theta)[2]).max() > OUTLIER


@pytest.mark.parametrize("key", KEYS)
def test_the_report_names_it(key: str) -> None:
    for taken in EXAMPLES[key](machine(theta_of(5))):
        state = settled(taken, NONE)
        result = Result.of(state, state.block(P, NONE), NONE, np.zeros((P.size, P.size)))
        assert result.chi_square > 0.0 and state.count > 0
        assert state.tally in ("", *TALLIES)
        assert bool(state.section) == bool(state.noun) == bool(result.row())
        if state.section:
            assert state.label and state.section not in ("frame", *TALLIES)
            row = result.row()
            assert row["name"] and any(key.startswith("chi_square_per_") for key in row)
            assert all(np.isfinite(v).all() for v in row.values() if not isinstance(v, str))


@pytest.mark.parametrize("key", KEYS)
def test_every_row_of_scattered_readings_is_of_one_point(key: str) -> None:
    """So that readings of a point are held out together."""
    for taken in EXAMPLES[key](machine(NONE)):
        state = settled(taken, NONE)
        if isinstance(state, ScatteredState):
            points = np.arange(1, len(state.observation.axis_mm) + 1)
            spread = state.spread_over_rows(points)
            block = state.block(P, NONE)
            rows = np.concatenate([c.rows for c in block.chunks()])
            assert len(spread) == len(rows)
            # rows of a point depend on nothing but the curves there
            still = np.abs(rows[:, P.slices["EXX"]]).max(axis=1) > 0.0
            assert not still[spread == 0].any()
            for point in (1, len(points) // 2, len(points)):
                own = P.design(
                    state.observation.axis_mm[point - 1 : point], state.observation.tool_mm[point - 1]
                )
                rest = rows[spread == point] - rows[spread == point] @ np.linalg.pinv(own[0]) @ own[0]
                assert np.abs(rest).max() < 1e-9 * np.abs(rows[spread == point]).max() + 1e-12


def filled(taken: Observation, empty: bytes, cells: Array) -> str:
    """The file with readings (n, k) in its empty cells."""
    header, *rows = empty.decode().splitlines()
    kept = [row[: len(row) - cells.shape[1]] for row in rows]
    text = [f"{row},{','.join(repr(float(v)) for v in cell)}" for row, cell in zip(kept, cells, strict=True)]
    return "\n".join([header, *text]) + "\n"


@pytest.mark.parametrize("key", [i.key for i in INSTRUMENTS if i.plans])
def test_its_files_are_read_back_unchanged(key: str, tmp_path: Path) -> None:
    theta = theta_of(6)
    for taken in EXAMPLES[key](machine(theta)):
        instrument = planner_of(taken)
        name = next(name for name in READ if hasattr(taken, name))
        cells = np.atleast_2d(np.asarray(getattr(taken, name), float).T).T
        if name == "azimuth_rad":
            both = np.stack([cells, np.asarray(getattr(taken, "elevation_rad"))], axis=2)  # noqa: B009
            cells = np.degrees(both.reshape(len(cells), -1))
        elif name == "value":
            cells = cells * (1e6 if getattr(taken, "quantity", "") == "angle" else 1e3)
        empty = instrument.empty(taken, np.arange(len(cells)))
        (tmp_path / "file.csv").write_text(filled(taken, empty, cells))
        plan = tmp_path / "measurements.toml"
        plan.write_text(PLAN + "\n".join(instrument.asked(taken, "file.csv")) + "\n")
        (again,) = load_measurements([plan], CHAIN).observations
        assert type(again) is type(taken)
        first, second = standardised(taken, NONE), standardised(again, NONE)
        assert second == pytest.approx(first, rel=1e-3, abs=1e-3 * float(np.abs(first).max()))
