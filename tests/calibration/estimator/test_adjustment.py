"""The adjustment: judged by simulated machines of two families, by laws, and by figures worked by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from cases.calibration import FRESH, TOOLS, case, cloud, line_of, measurements_of, rays, residual_of, two_pods
from cases.fast import some_of_a_campaign
from hypothesis import given, settings
from hypothesis import strategies as st
from judge import simulated

from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.basis import CurveSpace, Kink, Spline, Step
from olp.calibration.estimator.curves import calibration_of, sigmas_of
from olp.calibration.estimator.findings import findings_of
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.normal import Block, Chunk, Normal, residuals_of, solve
from olp.calibration.estimator.summary import unobservable
from olp.calibration.observations.lengths import LengthsState
from olp.calibration.observations.lines import Line, drift_ramps, group_of, noise_of
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.pods import PodsState
from olp.calibration.observations.squareness import SquarenessReading
from olp.core.errors import CannotCompute, ConfigError
from olp.errormodel.build import build
from olp.findings.catalogue import Finding

#: Seeds of smooth machines.
SMOOTH = range(4)
#: Seeds of rough machines.
ROUGH = range(2)
#: mm per um.
UM = 1e-3


@pytest.fixture(scope="module")
def one() -> tuple[simulated.Machine, Measurements, Fit]:
    machine, measurements = case(0, "smooth", "FXYZ")
    return machine, measurements, fit(measurements, "FXYZ")


def findings_with(fitted: Fit, code: str) -> list[Finding]:
    return [f for f in findings_of(fitted, [(0.0, 0.0, -120.0)], None) if f.code == code]


def without(measurements: Measurements, *names: str) -> Measurements:
    kept = tuple(line for line in measurements.lines if line.component not in names)
    return measurements.with_lines(kept)


# -- simulated machines ----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("family", "seeds"), [("smooth", SMOOTH), ("rough", ROUGH)])
def test_residuals_of_simulated_machines(family: str, seeds: range) -> None:
    """All chains of the benchmark, tables too; the uncertainty is neither too small nor too large."""
    rows = []
    for seed in seeds:
        machine, measurements = case(seed, family)
        fitted = fit(measurements, machine.chain)
        rows += [dataclasses.astuple(residual_of(machine, fitted, tool, 400)) for tool in TOOLS]
    before, before_framed, after, after_framed, z = np.array(rows).T
    assert np.median(before) > 70.0
    assert np.median(before_framed) > 40.0
    assert np.median(after) <= 10.0
    assert np.median(after_framed) <= 6.5
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.5


@pytest.mark.slow
def test_the_files_say_what_the_fit_says(one: tuple[simulated.Machine, Measurements, Fit]) -> None:
    """The exact model of the written curves against the linear one of the fit."""
    machine, _, fitted = one
    model = build(calibration_of(fitted), "FXYZ")
    position = np.random.default_rng(1).uniform(machine.box[:, 0], machine.box[:, 1], (500, 3))
    for tool in TOOLS:
        assert np.abs(model.error(position, np.array(tool)) - fitted.error(position, tool)).max() < 0.15 * UM


@pytest.mark.slow
def test_curves_of_a_rough_machine_are_written_true() -> None:
    """Steps and kinks are straight pieces in the file; cyclic terms are beside the curves."""
    machine, measurements = case(2, "rough", "YFXZ")
    fitted = fit(measurements, "YFXZ")
    calibration = calibration_of(fitted)
    assert {c.component for c in calibration.cyclic} >= {"EXX", "EYY", "EZZ"}
    for term in calibration.cyclic:
        if term.component[1] == term.component[2]:
            assert term.period_mm == simulated.PITCH["XYZ".index(term.component[2])]
    assert "linear" in {curve.interpolation for curve in calibration.curves}
    model = build(calibration, "YFXZ")
    position = np.random.default_rng(1).uniform(machine.box[:, 0], machine.box[:, 1], (500, 3))
    differ = np.abs(model.error(position, np.array(TOOLS[0])) - fitted.error(position, TOOLS[0]))
    assert differ.max() < 0.3 * UM
    assert findings_with(fitted, "OLP804")


def test_the_gauge_of_the_datum(one: tuple[simulated.Machine, Measurements, Fit]) -> None:
    """On lines through the datum X has no mean slope, and the three values of squareness hold the slopes of
    the others."""
    _, _, fitted = one
    datum = np.array([fitted.parameters.datum_mm])
    slopes = {}
    for axis in range(3):
        position = np.repeat(datum, 301, axis=0)
        position[:, axis] = np.linspace(*fitted.box_mm[axis], 301)
        error = fitted.error(position, np.zeros(3))
        for row in range(3):
            slopes[row, axis] = np.polyfit(position[:, axis], error[:, row], 1)[0]
    for row, axis in ((1, 0), (2, 0), (2, 1)):
        assert abs(slopes[row, axis]) < 1e-7
    square = {name: fitted.squareness(name) @ fitted.theta for name in ("C0Y", "B0Z", "A0Z")}
    assert slopes[0, 1] == pytest.approx(-square["C0Y"], abs=1e-7)
    assert slopes[0, 2] == pytest.approx(square["B0Z"], abs=1e-7)
    assert slopes[1, 2] == pytest.approx(-square["A0Z"], abs=1e-7)


@pytest.mark.slow
def test_zeros_and_slopes_of_instruments_mean_nothing(
    one: tuple[simulated.Machine, Measurements, Fit],
) -> None:
    """Another zero of every line, and another pose of every square, change no estimate."""
    machine, measurements, fitted = one
    moved = []
    for k, line in enumerate(measurements.lines):
        tilt = 0.0
        if line.square:
            tilt = 40e-6 if line.axis < "XYZ".index(line.component[1]) else -40e-6
        value = line.value + (0.01 * k if line.quantity != "angle" else 1e-5 * k) + tilt * line.target_mm
        moved.append(dataclasses.replace(line, value=value))
    again = fit(measurements.with_lines(tuple(moved)), "FXYZ")
    position = np.random.default_rng(1).uniform(machine.box[:, 0], machine.box[:, 1], (100, 3))
    assert np.abs(again.error(position, TOOLS[1]) - fitted.error(position, TOOLS[1])).max() < 0.01 * UM


# -- points of a tracker ---------------------------------------------------------------------------------


@pytest.mark.slow
def test_residuals_with_points_alone_and_with_lines() -> None:
    """The frame of the instrument is far away and turned; fresh tools."""
    alone, both = [], []
    for seed in range(2):
        machine, measurements = case(seed, "smooth")
        points = cloud(machine, seed, 120, 5.0)
        fitted = fit(Measurements("m", (points,)), machine.chain)
        alone += [residual_of(machine, fitted, tool, 400) for tool in FRESH]
        few = cloud(machine, seed, 40, 8.0)
        fitted = fit(measurements.also((few,)), machine.chain)
        both += [residual_of(machine, fitted, tool, 400) for tool in FRESH]
    assert np.median([one.after_framed for one in alone]) <= 6.0
    assert np.median([one.after_framed for one in both]) <= 3.5
    assert 0.5 < np.sqrt(np.mean([one.z**2 for one in alone])) < 1.5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("chain", "hidden"), some_of_a_campaign([("FXYZ", "ECY"), ("YFXZ", "ECX"), ("ZXFY", "EBX")], 3)
)
def test_what_one_offset_of_the_reflector_hides(chain: str, hidden: str) -> None:
    """All turns of the last axis, and of the one before about the last one's direction: they move no point
    of one offset otherwise than its own displacement does. Two offsets hide the turn about their line."""
    last = chain.replace("F", "")[2]
    machine = simulated.machine(1, "smooth", chain)
    one = fit(Measurements("m", (cloud(machine, 1, 250, 5.0, [(30.0, 0.0, 9.0)]),)), chain)
    assert set(unobservable(one)) == {hidden, *(f"E{d}{last}" for d in "ABC")}
    assert all("one offset" in finding.message for finding in findings_with(one, "OLP801"))
    line = [(0.0, 0.0, -80.0), (0.0, 0.0, -400.0)]
    along_z = fit(Measurements("m", (cloud(machine, 1, 250, 5.0, line),)), chain)
    assert set(unobservable(along_z)) == {f"EC{last}", *([hidden] if hidden[1] == "C" else [])}
    assert "on one line" in findings_with(along_z, "OLP801")[0].message
    three = fit(Measurements("m", (cloud(machine, 1, 250, 5.0),)), chain)
    assert not unobservable(three)


@pytest.mark.slow
def test_where_the_instrument_stands_means_nothing() -> None:
    machine = simulated.machine(2, "smooth", "FXYZ")
    points = cloud(machine, 2, 60, 5.0)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    moved = dataclasses.replace(points, measured_mm=points.measured_mm @ turn.T + 1234.5)
    first, second = (fit(Measurements("m", (p,)), "FXYZ") for p in (points, moved))
    position = np.random.default_rng(1).uniform(first.box_mm[:, 0], first.box_mm[:, 1], (50, 3))
    assert first.error(position, FRESH[0]) == pytest.approx(second.error(position, FRESH[0]), abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4, 5])
def test_a_slip_among_few_points_is_the_first_that_is_left_out(seed: int) -> None:
    """150 points hardly determine 18 curves: readings beside it may be left out with it, it always is."""
    machine = simulated.machine(seed, "smooth", "FXYZ")
    points = cloud(machine, seed, 150, 5.0)
    measured = points.measured_mm.copy()
    measured[17] += 0.2
    fitted = fit(Measurements("m", (dataclasses.replace(points, measured_mm=measured),)), "FXYZ")
    assert fitted.outliers[0].row == 18
    assert len(fitted.outliers) <= 4


@pytest.mark.slow
def test_a_point_that_slipped_is_left_out_and_named() -> None:
    machine = simulated.machine(2, "smooth", "FXYZ")
    points = cloud(machine, 2, 150, 5.0)
    measured = points.measured_mm.copy()
    measured[17] += 0.2
    fitted = fit(Measurements("m", (dataclasses.replace(points, measured_mm=measured),)), "FXYZ")
    assert [outlier.row for outlier in fitted.outliers] == [18]
    assert "points.csv: row 18" in findings_with(fitted, "OLP802")[0].message


@pytest.mark.slow
def test_a_forgotten_scale_is_caught_by_chi_square() -> None:
    """A tracker that is off by 50 um/m beside a laser's lines; stated as unknown it fits."""
    machine, measurements = case(0, "smooth", "FXYZ")
    points = cloud(machine, 0, 60, 5.0)
    points = dataclasses.replace(points, measured_mm=points.measured_mm * (1.0 + 5e-5))
    forgotten = fit(measurements.also((points,)), "FXYZ")
    assert findings_with(forgotten, "OLP808") or forgotten.outliers
    known = dataclasses.replace(points, sigma_scale=5e-5)
    assert not findings_with(fit(measurements.also((known,)), "FXYZ"), "OLP808")


# -- lengths from stations -------------------------------------------------------------------------------


@pytest.mark.slow
def test_residuals_with_lengths() -> None:
    """Six stations of 250 lengths, positions and dead lengths unknown; the stations are estimated too."""
    left_same, left_other = [], []
    for seed in range(2):
        machine = simulated.machine(seed, "smooth", ("FXYZ", "YFXZ")[seed])
        fitted = fit(Measurements("m", rays(machine, seed, 6, 250)), machine.chain)
        left_same.append(residual_of(machine, fitted, simulated.OFFSETS[0], 400).after_framed)
        left_other.append(residual_of(machine, fitted, FRESH[1], 400).after_framed)
        places = simulated.stations(machine, seed, 6)
        for result, place in zip(fitted.of(LengthsState), places, strict=True):
            assert result.state.station.place_mm == pytest.approx(place, abs=0.05)
        assert not findings_with(fitted, "OLP808")
    assert np.median(left_same) <= 0.9
    assert np.median(left_other) <= 1.2


@pytest.mark.slow
def test_a_length_that_slipped_is_left_out_and_named() -> None:
    machine = simulated.machine(0, "smooth", "FXYZ")
    all_rays = rays(machine, 0, 6, 120)
    wrong = all_rays[2].length_mm.copy()
    wrong[33] += 0.05
    bad = (*all_rays[:2], dataclasses.replace(all_rays[2], length_mm=wrong), *all_rays[3:])
    fitted = fit(Measurements("m", bad), "FXYZ")
    assert [(outlier.source, outlier.row) for outlier in fitted.outliers] == [("station-2.csv", 34)]
    assert not fitted.prior.joints, "what it seemed to show of rails is forgotten"
    assert not findings_with(fitted, "OLP808")


def test_lengths_of_points_in_a_plane_are_refused() -> None:
    machine = simulated.machine(0, "smooth", "FXYZ")
    (one,) = rays(machine, 0, 1, 50, [(0.0, 0.0, 0.0)])
    flat = one.axis_mm.copy()
    flat[:, 2] = -900.0 + 0.2 * flat[:, 0]
    with pytest.raises(CannotCompute, match="one plane"):
        fit(Measurements("m", (dataclasses.replace(one, axis_mm=flat),)), "FXYZ")


# -- directions from pods --------------------------------------------------------------------------------


@pytest.mark.slow
def test_residuals_with_two_pods() -> None:
    """Poses unknown, one distance known: 10 urad at 4 m; the pods are estimated too."""
    rows = []
    for seed, n in ((0, 250), (1, 250)):
        machine = simulated.machine(seed, "smooth", "FXYZ")
        fitted = fit(Measurements("m", (two_pods(machine, seed, n),)), "FXYZ")
        rows += [residual_of(machine, fitted, tool, 400).after_framed for tool in FRESH]
        for pose, place in zip(fitted.of(PodsState)[0].state.poses, simulated.PODS, strict=True):
            assert pose.place_mm == pytest.approx(place, abs=0.5)
        assert not findings_with(fitted, "OLP808")
    assert np.median(rows) <= 25.0


@pytest.mark.slow
def test_without_a_distance_the_scale_is_not_observable() -> None:
    """With one offset of the reflector the mean of the three scales is not observable then, but their
    differences are."""
    machine = simulated.machine(1, "smooth", "FXYZ")
    pods = two_pods(machine, 1, 1000, [(0.0, 0.0, -100.0)])
    known = fit(Measurements("m", (pods,)), "FXYZ")
    free = fit(Measurements("m", (dataclasses.replace(pods, baselines=()),)), "FXYZ")

    def scales(fitted: Fit, weights: tuple[float, float, float]) -> float:
        """Standard uncertainty of a combination of the scales of X, Y, Z, in um/m."""
        row = np.zeros(fitted.parameters.size)
        for axis, weight in enumerate(weights):
            ends = fitted.curve(f"E{'XYZ'[axis]}{'XYZ'[axis]}", fitted.box_mm[axis])
            row += weight * (ends[1] - ends[0]) / np.ptp(fitted.box_mm[axis])
        return float(np.sqrt(row @ fitted.covariance @ row)) * 1e6

    assert findings_with(free, "OLP809") and not findings_with(known, "OLP809")
    third = 1.0 / 3.0
    assert scales(free, (third, third, third)) > 3.0 * scales(known, (third, third, third))
    assert scales(free, (1.0, -1.0, 0.0)) < 1.3 * scales(known, (1.0, -1.0, 0.0))


# -- what is not observable ------------------------------------------------------------------------------


@pytest.mark.slow
def test_roll_of_z_without_its_lines_is_reported_as_unknown() -> None:
    machine, measurements = case(0, "smooth", "FXYZ")
    kept = [line for line in measurements.lines if abs(line.tool_mm[0]) < 1.0]
    fitted = fit(measurements.with_lines(tuple(kept)), "FXYZ")
    assert list(unobservable(fitted)) == ["ECZ"]
    (finding,) = findings_with(fitted, "OLP801")
    assert "ECZ" in finding.message and "um" in finding.message
    assert "ECZ" not in {name for curve in calibration_of(fitted).curves for name in curve.names}
    # known with the tool of the lines; far to the side its uncertainty contains the roll
    middle = machine.box.mean(axis=1)[None]
    near, far = (float(fitted.sigma(middle, tool)[0, 1]) for tool in (TOOLS[0], (300.0, 0.0, -120.0)))
    assert far > 2.0 * near


@pytest.mark.slow
def test_straightness_without_a_square_leaves_squareness_unknown() -> None:
    _, measurements = case(0, "smooth", "FXYZ")
    lines = [dataclasses.replace(line, square=None) for line in measurements.lines]
    plain = dataclasses.replace(measurements.with_lines(tuple(lines)), squares=())
    fitted = fit(plain, "FXYZ")
    (finding,) = findings_with(fitted, "OLP806")
    assert finding.message.startswith("C0Y, B0Z, A0Z are taken as zero: ")


@pytest.mark.slow
def test_a_reading_of_squareness_does_what_a_square_does() -> None:
    """The true mean slopes at the position of the lines, given as a value, instead of the square."""
    machine, measurements = case(0, "smooth", "FXYZ")
    with_square = fit(measurements, "FXYZ")
    readings = []
    for name, first, second, sign in (("C0Y", 0, 1, -1.0), ("B0Z", 0, 2, 1.0), ("A0Z", 1, 2, -1.0)):
        total = 0.0
        for moving, row in ((first, second), (second, first)):
            position = np.tile(np.array(simulated.LINE), (201, 1))
            position[:, moving] = np.linspace(*machine.box[moving], 201)
            total += np.polyfit(
                position[:, moving], machine.error(position, np.array(simulated.TOOL))[:, row], 1
            )[0]
        spans = (tuple(machine.box[first].tolist()), tuple(machine.box[second].tolist()))
        readings.append(
            SquarenessReading(name, sign * total, simulated.LINE, spans, simulated.TOOL, 1e-6)  # type: ignore[arg-type]
        )
    lines = [dataclasses.replace(line, square=None) for line in measurements.lines]
    fitted = fit(dataclasses.replace(measurements.with_lines(lines).also(readings), squares=()), "FXYZ")
    for name in ("C0Y", "B0Z", "A0Z"):
        functional = fitted.squareness(name)
        assert functional @ fitted.theta == pytest.approx(machine.square[name], abs=6e-6)
        assert np.sqrt(functional @ fitted.covariance @ functional) < 3e-6
        assert functional @ fitted.theta == pytest.approx(
            with_square.squareness(name) @ with_square.theta, abs=20e-6
        )


@pytest.mark.slow
def test_an_aliased_period_is_never_fitted() -> None:
    machine = simulated.machine(3, "rough", "FXYZ")
    taken = simulated.all_lines(machine, 3, jitter=0.0)
    fitted = fit(measurements_of(taken, simulated.PITCH), "FXYZ")
    assert not fitted.parameters.waves
    assert {f.message[:3] for f in findings_with(fitted, "OLP853")} >= {"EXX", "EYY", "EZZ"}
    assert not calibration_of(fitted).cyclic


@pytest.mark.slow
def test_a_fine_sweep_shows_what_is_not_observable_at_the_targets() -> None:
    """Targets at multiples of the pitch, and a sweep over two pitches: amplitude and phase of X, judged by
    what the machine does at the sweep and far from it."""
    machine = simulated.machine(3, "rough", "FXYZ")
    taken = simulated.all_lines(machine, 3, jitter=0.0)
    sweep = simulated.take(
        machine, np.random.default_rng(8), "EXX", targets=np.arange(1400.0, 1440.5, 1.0), runs=3
    )
    fitted = fit(measurements_of([*taken, sweep], simulated.PITCH), "FXYZ")
    assert set(fitted.parameters.waves) == {"EXX"}
    (term,) = calibration_of(fitted).cyclic
    for start in (1410.0, 130.0):
        q = start + np.linspace(0.0, 20.0, 81)
        true = machine.curves["EXX"](q)
        cyclic = term.amplitude * np.sin(2 * np.pi * q / term.period_mm + term.phase_rad)
        rest = (true - cyclic) - np.polyval(np.polyfit(q, true - cyclic, 1), q)
        assert np.std(rest) < 0.4 * UM
        assert np.std(true - np.polyval(np.polyfit(q, true, 1), q)) > 0.7 * UM


def test_an_axis_without_lines_has_no_answer() -> None:
    _, measurements = case(0, "smooth", "FXYZ")
    with pytest.raises(CannotCompute, match="no line along Z"):
        fit(without(measurements, *(f"E{d}Z" for d in "XYZABC")), "FXYZ")


TRAVEL = [(0.0, 3000.0), (0.0, 2000.0), (-1000.0, 0.0)]


@pytest.mark.slow
@pytest.mark.parametrize("names", [("EXX",), ("EXX", "EYY")])
def test_one_axis_alone_is_corrected_along_itself(names: tuple[str, ...]) -> None:
    """What no reading shows is zero over the travel, and stated with its uncertainty and cost."""
    machine, measurements = case(0, "smooth", "FXYZ")
    lines = tuple(line for line in measurements.lines if line.component in names)
    fitted = fit(measurements.with_lines(lines), "FXYZ", travel_mm=TRAVEL)
    calibration = calibration_of(fitted)
    model = build(calibration, "FXYZ")
    for line in lines:
        axis = line.axis
        position = np.tile(np.array(line.line_mm), (60, 1))
        position[:, axis] = np.linspace(*fitted.box_mm[axis], 60)
        tool = np.array(line.tool_mm)
        true = machine.error(position, tool)[:, axis]
        rest = true - model.error(position, tool)[:, axis]
        assert np.std(true) > 5.0 * UM > 5.0 * np.std(rest)
        along = np.diff(fitted.design(position[[0, -1]], tool)[:, axis], axis=0)[0]
        assert np.sqrt(along @ fitted.covariance @ along) < 3.0 * UM
    dark = [k for k, letter in enumerate("XYZ") if f"E{letter}{letter}" not in names]
    assert [tuple(side) for side in fitted.box_mm[dark].tolist()] == [TRAVEL[k] for k in dark]
    found = findings_with(fitted, "OLP801")
    messages = [finding.message.replace(" is taken", " are taken") for finding in found]
    told = [message.partition(" are taken as zero")[0] for message in messages]
    assert len(told) == 3, "positioning, straightness, angles"
    hidden = {f"E{a}{b}" for a in "XYZABC" for b in "XYZ"} - set(names)
    assert sorted(", ".join(told).split(", ")) == sorted(hidden)
    middle = fitted.box_mm.mean(axis=1)
    far = np.array(middle + 0.4 * np.ptp(fitted.box_mm, axis=1))
    assert np.all(fitted.sigma(far[None], np.array([0.0, 0.0, -120.0]))[0, dark] > 3.0 * UM)


# -- directions, noise, slips ----------------------------------------------------------------------------


def test_backlash_that_is_constant(one: tuple[simulated.Machine, Measurements, Fit]) -> None:
    machine, _, fitted = one
    calibration = calibration_of(fitted)
    for axis, letter in enumerate("XYZ"):
        true = -2.0 * machine.half[f"E{letter}{letter}"]
        assert calibration.backlash_mm[axis] == pytest.approx(true, abs=0.2 * UM)
    assert not any(curve.forward for curve in calibration.curves)


@pytest.mark.slow
def test_an_axis_that_goes_farther_after_a_reversal_is_told() -> None:
    """As with a control that takes up more than there is, or with directions that were swapped."""
    _, measurements = case(0, "smooth", "FXYZ")
    swapped = [
        dataclasses.replace(line, direction=-line.direction) if line.component == "EYY" else line
        for line in measurements.lines
    ]
    assert not findings_with(fit(measurements, "FXYZ"), "OLP855")
    fitted = fit(measurements.with_lines(swapped), "FXYZ")
    (finding,) = findings_with(fitted, "OLP855")
    told = calibration_of(fitted).backlash_mm[1] / UM
    assert told < -0.5 and finding.message.startswith(f"Y: {told:.2f} +- ")


@pytest.mark.slow
def test_backlash_that_is_not_constant_becomes_a_direction_column(
    one: tuple[simulated.Machine, Measurements, Fit],
) -> None:
    _, measurements, _ = one
    lines = []
    for line in measurements.lines:
        if line.component == "EXX":
            more = line.direction * 4.0 * UM * np.sin(np.pi * line.target_mm / 3000.0)
            line = dataclasses.replace(line, value=line.value + more)
        lines.append(line)
    fitted = fit(measurements.with_lines(tuple(lines)), "FXYZ")
    calibration = calibration_of(fitted)
    assert calibration.backlash_mm[0] == 0.0
    assert calibration.backlash_mm[1] > 0.0
    (curve,) = [curve for curve in calibration.curves if curve.forward]
    assert curve.names == ("EXX",)
    middle = np.interp(1500.0, curve.position_mm, curve.forward["EXX"] - curve.backward["EXX"])
    ends = np.interp(30.0, curve.position_mm, curve.forward["EXX"] - curve.backward["EXX"])
    assert middle - ends == pytest.approx(8.0 * UM, abs=1.0 * UM)


@pytest.mark.slow
def test_a_slip_is_left_out_and_named(one: tuple[simulated.Machine, Measurements, Fit]) -> None:
    machine, measurements, fitted = one
    lines = list(measurements.lines)
    k = next(i for i, line in enumerate(lines) if line.component == "EYX")
    value = lines[k].value.copy()
    value[77] += 40 * UM
    lines[k] = dataclasses.replace(lines[k], value=value)
    again = fit(measurements.with_lines(tuple(lines)), "FXYZ")
    assert [(o.source, o.row) for o in again.outliers] == [("eyx.csv", 78)]
    (finding,) = findings_with(again, "OLP802")
    assert finding.lines == (78,) and "eyx.csv" in finding.message
    position = np.random.default_rng(1).uniform(machine.box[:, 0], machine.box[:, 1], (100, 3))
    assert np.abs(again.error(position, TOOLS[0]) - fitted.error(position, TOOLS[0])).max() < 0.3 * UM


@pytest.mark.slow
def test_runs_that_scatter_more_than_stated_are_reported(
    one: tuple[simulated.Machine, Measurements, Fit],
) -> None:
    _, measurements, _ = one
    lines = [
        dataclasses.replace(line, sigma=0.1 * UM) if line.component == "EXX" else line
        for line in measurements.lines
    ]
    fitted = fit(measurements.with_lines(tuple(lines)), "FXYZ")
    (finding,) = findings_with(fitted, "OLP803")
    assert finding.message.startswith("exx.csv")


def test_noise_and_drift_of_a_line() -> None:
    """Against one least-squares problem with a mean for each target and direction."""
    machine = simulated.machine(0, "smooth", "FXYZ")
    q = np.linspace(0.0, 3000.0, 16)
    line = line_of(simulated.take(machine, np.random.default_rng(3), "EXX", targets=q))
    groups, ramps = group_of(line), drift_ramps(line)
    table = np.hstack([np.eye(groups.max() + 1)[groups], ramps])
    solution, _, rank, _ = np.linalg.lstsq(table, line.value, rcond=1e-9)
    rest = line.value - table @ solution
    noise = noise_of(line)
    assert noise.spread == pytest.approx(np.sqrt(rest @ rest / (len(rest) - rank)), rel=1e-6)
    assert noise.sigma == pytest.approx(0.5 * UM, rel=0.2)


@pytest.mark.slow
def test_one_run_in_both_directions_is_no_reversal_but_drift() -> None:
    machine = simulated.machine(0, "smooth", "FXYZ")
    lines = []
    for a in "XYZ":
        targets = np.linspace(*machine.box["XYZ".index(a)], 40)
        taken = simulated.take(machine, np.random.default_rng(1), f"E{a}{a}", targets=targets, runs=1)
        lines.append(line_of(taken, 0.5 * UM))
    calibration = calibration_of(fit(Measurements("m", tuple(lines)), "FXYZ"))
    assert not any(curve.forward for curve in calibration.curves)


@pytest.mark.slow
def test_recordings_of_many_samples_are_read_in_reasonable_memory() -> None:
    """A sweep of 800 targets in both directions: no table of samples by targets."""
    machine = simulated.machine(0, "smooth", "FXYZ")
    rng = np.random.default_rng(3)
    fine = [
        line_of(simulated.take(machine, rng, f"E{a}{a}", targets=np.linspace(*machine.box[k], count), runs=3))
        for k, (a, count) in enumerate(zip("XYZ", (800, 40, 40), strict=True))
    ]
    fitted = fit(Measurements("m", tuple(fine)), "FXYZ")
    q = np.linspace(100.0, 2900.0, 50)
    position = np.tile(np.array(simulated.LINE), (len(q), 1))
    position[:, 0] = q
    rest = fitted.curve("EXX", q) @ fitted.theta - machine.error(position, np.array(simulated.TOOL))[:, 0]
    assert np.std(rest - np.polyval(np.polyfit(q, rest, 1), q)) < 0.3 * UM


def test_one_run_without_sigma_is_refused() -> None:
    q = np.linspace(0.0, 100.0, 11)
    ones = np.ones(11, np.int64)
    line = Line("EXX", q, 0.0 * q, ones, ones, (0.0, 0.0, 0.0), source="exx.csv")
    with pytest.raises(ConfigError, match="sigma_um"):
        fit(Measurements("m", (line,)), "FXYZ")


@pytest.mark.slow
def test_a_wrong_sign_of_one_line_does_not_fit() -> None:
    """Two lines of one straightness at two heights contradict each other when one is reversed."""
    machine, measurements = case(0, "smooth", "FXYZ")
    rng = np.random.default_rng(5)
    q = np.linspace(*machine.box[0], 31)
    other = line_of(
        simulated.take(machine, rng, "EYX", targets=q, line_mm=(0.0, 700.0, -100.0), tool=simulated.TOOL)
    )
    for sign, expected in ((1.0, 0), (-1.0, 1)):
        turned = dataclasses.replace(other, value=sign * other.value)
        fitted = fit(measurements.with_lines((*measurements.lines, turned)), "FXYZ")
        assert len(findings_with(fitted, "OLP808")) == expected


def test_sigmas_stand_at_every_position(one: tuple[simulated.Machine, Measurements, Fit]) -> None:
    _, _, fitted = one
    calibration = calibration_of(fitted)
    sigmas = sigmas_of(fitted, calibration)
    for curve in calibration.curves:
        for name in curve.names:
            assert sigmas[name].shape == curve.position_mm.shape
            unit = 1e-6 if name[1] in "ABC" else UM
            assert sigmas[name].min() >= 0.0
            assert sigmas[name].max() < 3.0 * unit


# -- parts -----------------------------------------------------------------------------------------------


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3), st.integers(5, 60))
def test_what_a_block_alone_knows_is_eliminated_exactly(seed: int, locals_: int, n: int) -> None:
    """Against one least-squares problem with every unknown in it."""
    rng = np.random.default_rng(seed)
    prior = np.diag(rng.uniform(0.5, 2.0, 6))
    normal, blocks = Normal.of(6), []
    tables, rights = [np.hstack([np.sqrt(prior), np.zeros((6, 2 * locals_))])], [np.zeros(6)]
    for k in range(2):
        rows, own = rng.normal(size=(n, 4)), rng.normal(size=(n, locals_))
        columns = np.sort(rng.permutation(6)[:4])
        y, sigma = rng.normal(size=n), rng.uniform(0.5, 2.0, n)
        precision = rng.uniform(0.5, 2.0, locals_)
        block = Block.of(Chunk(rows, y, sigma, own), columns, precision)
        blocks.append(block)
        normal.add(block)
        table = np.zeros((n, 6 + 2 * locals_))
        table[:, columns] = rows
        table[:, 6 + k * locals_ : 6 + (k + 1) * locals_] = own
        tables.append(table / sigma[:, None])
        rights.append(y / sigma)
        penalty = np.zeros((locals_, 6 + 2 * locals_))
        penalty[:, 6 + k * locals_ : 6 + (k + 1) * locals_] = np.diag(np.sqrt(precision))
        tables.append(penalty)
        rights.append(np.zeros(locals_))
    whole, right = np.vstack(tables), np.concatenate(rights)
    expected = np.linalg.lstsq(whole, right, rcond=None)[0]
    solved = solve(normal, prior)
    assert solved.theta == pytest.approx(expected[:6], abs=1e-8)
    covariance = np.linalg.inv(whole.T @ whole)[:6, :6]
    assert np.abs(solved.covariance - covariance).max() < 1e-8
    nu, _, _ = residuals_of(blocks[0], solved.theta)
    assert nu == pytest.approx(expected[6 : 6 + locals_], abs=1e-8)


def test_splines_are_the_standard_ones() -> None:
    from scipy.interpolate import BSpline

    spline = Spline(-200.0, 300.0, 7)
    step = 500.0 / 7
    knots = -200.0 + step * np.arange(-3, 11)
    q = np.linspace(-200.0, 300.0, 101)
    expected = BSpline.design_matrix(q, knots, 3).toarray()
    assert spline.values(q) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("kind", ["straight", "zero", "free"])
def test_gauges_of_a_curve(kind: str) -> None:
    spline = Spline(0.0, 900.0, 9)
    space = CurveSpace.of(spline, (Step(300.0, 400.0), Kink(600.0, 900.0)), 150.0, kind)
    curve = np.random.default_rng(2).normal(size=space.size)
    assert space.size == 14 - {"straight": 2, "zero": 1, "free": 0}[kind]
    q = np.linspace(0.0, 900.0, 401)
    at_datum = (space.values(np.array([150.0])) @ curve)[0]
    slope = np.polyfit(q, space.values(q) @ curve, 1)[0]
    assert (abs(at_datum) < 1e-12) == (kind != "free")
    assert (abs(slope) < 1e-14) == (kind == "straight")
