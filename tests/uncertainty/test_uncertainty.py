"""Uncertainty on the path: laws, an independent Monte-Carlo, files, and its report in a correction."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.calibration import measurements_of
from cases.fast import some_fast
from hypothesis import given, settings
from hypothesis import strategies as st
from judge import simulated
from judge.uncertain import sampled

import olp
from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.covariance import covariance_of
from olp.calibration.estimator.curves import calibration_of
from olp.calibration.estimator.fitted import Fit
from olp.calibration.observations.measurements import Measurements
from olp.core.errors import ConfigError
from olp.core.progress import silent
from olp.core.toolpath import Frame, Toolpath
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Thermal
from olp.errormodel.entry import Entry
from olp.errormodel.sensitivity import Expansion, Sensitivity
from olp.errormodel.uncertainty import Uncertainty, fingerprint, of_sigmas
from olp.files.calibration.covariance import covariance_bytes, load_uncertainty, parse_covariance
from olp.files.calibration.reader import load_calibration
from olp.files.calibration.writer import calibration_files
from olp.reports.report import to_text
from olp.uncertainty.components import components, improbable
from olp.uncertainty.probability import within
from olp.uncertainty.spread import (
    Confidence,
    Points,
    Unknowns,
    _largest_of_runs,
    bands,
    confidence,
    covariances,
)

KNOTS = {axis: np.linspace(*simulated.BOX[k], 6 + k) for k, axis in enumerate("XYZ")}
TOOL = np.array([40.0, -60.0, -150.0])
TOUCH = ((600.0, 300.0, -200.0), (0.0, 0.0, -80.0))
rng = np.random.default_rng(3)
AT = rng.uniform(*np.array(simulated.BOX).T, (7, 3))


def taken(machine: simulated.Machine, seed: int) -> Measurements:
    """The readings of a full set of lines."""
    readings = measurements_of(simulated.all_lines(machine, seed), simulated.PITCH)
    return replace(readings, measured=datetime.date(2026, 5, 14))


def flat(**more: Any) -> Calibration:
    """A calibration without errors; curves hold at the datum, zero."""
    curves = tuple(
        Curve(a, KNOTS[a], {f"E{d}{a}": np.zeros(len(KNOTS[a])) for d in "XYZABC"}, interpolation="linear")
        for a in "XYZ"
    )
    options: dict[str, Any] = {"curves": curves, "box_mm": np.array(simulated.BOX)} | more
    return Calibration("m", measured=datetime.date(2026, 5, 14), **options)


def random_uncertainty(rank: int = 5, seed: int = 1) -> Uncertainty:
    """All curves and squareness unknown together."""
    draw = np.random.default_rng(seed)
    entries = []
    for name in simulated.NAMES:
        q = KNOTS[name[2]]
        size = 1e-5 if name[1] in "ABC" else 5e-3
        entries.append(Entry("mean", name, size * draw.normal(size=(len(q), rank)), np.zeros(len(q)), q))
    for name in ("C0Y", "B0Z", "A0Z"):
        entries.append(Entry("squareness", name, 1e-5 * draw.normal(size=(1, rank)), np.zeros(1)))
    return Uncertainty(tuple(entries), fingerprint(flat()), "test")


def path_of(position: np.ndarray, *, touch: bool = False, line: np.ndarray | None = None) -> Toolpath:
    n = len(position)
    frame = Frame(tool_mm=tuple(TOOL), touched=TOUCH if touch else None)
    number = np.arange(1, n + 1) if line is None else line
    return Toolpath(
        np.ones(n, np.uint8), np.zeros(n, np.uint8), number.astype(np.int32), np.zeros(n, np.int32), position,
        (frame,),
    )  # fmt: skip


def points_of(
    position: np.ndarray, before: np.ndarray | None = None, after: np.ndarray | None = None
) -> Points:
    zero = np.zeros(position.shape)
    return Points(
        np.arange(len(position)),
        position,
        zero if before is None else before,
        zero if after is None else after,
        None,
    )


def unknowns(uncertainty: Uncertainty, chain: str = "FXYZ", repeat: float = 0.0) -> Unknowns:
    return Unknowns(Sensitivity.of(flat(), chain, uncertainty), (repeat,) * 3)


@pytest.mark.slow
@pytest.mark.parametrize(("chain", "touch"), some_fast([("YFXZ", True), ("FXYZ", False), ("ZYFX", True)], 3))
def test_an_independent_monte_carlo_agrees(chain: str, touch: bool) -> None:
    known = random_uncertainty()

    def draw(rng: np.random.Generator) -> tuple[dict[str, np.ndarray], dict[str, float]]:
        z = rng.normal(size=5)
        values = {e.name: e.factor @ z for e in known.entries}
        return values, {name: float(values[name][0]) for name in ("C0Y", "B0Z", "A0Z")}

    at_touch = (np.array(TOUCH[0]), np.array(TOUCH[1])) if touch else None
    judged = sampled(chain, draw, KNOTS, AT, TOOL, at_touch, 2000)
    # tables: the judge counts levers of workpiece axes as the contract does, own coordinate left out
    covariance = covariances(unknowns(known, chain), path_of(AT, touch=touch), points_of(AT))
    scale = np.sqrt(np.einsum("nii,njj->nij", judged, judged))
    assert np.abs((covariance - judged) / scale).max() < 0.13


def test_four_times_the_covariance_doubles_the_bands_and_none_gives_none() -> None:
    known, path, points = random_uncertainty(), path_of(AT, touch=True), points_of(AT)
    one = bands(covariances(unknowns(known), path, points))
    two = bands(covariances(unknowns(known.scaled(2.0)), path, points))
    assert two == pytest.approx(2.0 * one, rel=1e-5)
    none = bands(covariances(unknowns(known.scaled(0.0)), path, points))
    assert (none == 0.0).all() and (one > 1e-3).all()


def test_a_position_where_it_was_touched_off_is_known() -> None:
    position = np.array([TOUCH[0], (900.0, 300.0, -200.0)])
    path = path_of(position, touch=True)
    frame = replace(path.frames[0], tool_mm=TOUCH[1])
    path = replace(path, frames=(frame,))
    for known in (random_uncertainty(), of_sigmas(flat(), {"curves": {"EXX": np.full(6, 3e-3)}})):
        assert known is not None
        band = bands(covariances(unknowns(known), path, points_of(position)))
        assert band[0] < 1e-9 < 1e-3 < band[1]


@given(st.floats(0.0, 3000.0), st.sampled_from(["EXX", "EBX"]))
@settings(max_examples=30, deadline=None)
def test_sigma_columns_hold_anywhere_between_their_positions(q: float, name: str) -> None:
    sigma = np.array([1.0, 2.0, 3.0, 2.0, 1.0, 4.0]) * (1e-3 if name == "EXX" else 1e-6)
    known = of_sigmas(flat(), {"curves": {name: sigma}})
    assert known is not None
    position = np.array([[q, 0.0, -400.0]])
    rows = Sensitivity.of(flat(), "FXYZ", known).rows(position, np.zeros(3))[0, 0]
    tool_vector = 1.0 if name == "EXX" else 400.0
    assert np.sqrt(rows @ rows) == pytest.approx(tool_vector * np.interp(q, KNOTS["X"], sigma), rel=1e-5)


def test_variances_of_independent_numbers_add() -> None:
    first = of_sigmas(flat(), {"curves": {"EXX": np.full(6, 3e-3)}, "squareness": {"C0Y": 4e-6}})
    assert first is not None
    position = np.array([[100.0, 1000.0, 0.0]])
    sigma = np.sqrt(np.diagonal(covariances(unknowns(first), path_of(position), points_of(position))[0]))
    assert sigma == pytest.approx([5e-3, 0.0, 0.0])
    scatter = covariances(unknowns(first, repeat=1e-3), path_of(position), points_of(position))[0]
    assert np.sqrt(np.diagonal(scatter)) == pytest.approx([np.sqrt(26.0) * 1e-3, 1e-3, 1e-3])


@pytest.mark.slow
def test_probability_in_a_ball_against_known_distributions() -> None:
    from scipy.stats import ncx2, norm

    for sigma in (0.05, 0.2, 0.7, 3.0):
        round_ = within(np.eye(3)[None] * sigma**2, np.array([[0.0, 0.4, 0.0]]), 1.0)[0]
        assert round_ == pytest.approx(ncx2.cdf(1.0 / sigma**2, 3, (0.4 / sigma) ** 2), abs=5e-4)
        line = np.diag([sigma**2, 0.0, 0.0])[None]
        along = within(line, np.array([[0.3, 0.0, 0.0]]), 1.0)[0]
        assert along == pytest.approx(norm.cdf(0.7 / sigma) - norm.cdf(-1.3 / sigma), abs=1e-3)
        aside = within(line, np.array([[0.0, 0.6, 0.0]]), 1.0)[0]
        assert aside == pytest.approx(2.0 * norm.cdf(0.8 / sigma) - 1.0, abs=1e-3)
    exact = within(np.zeros((2, 3, 3)), np.array([[0.0, 0.0, 0.9], [0.0, 0.0, 1.1]]), 1.0)
    assert exact.tolist() == [1.0, 0.0]


@given(st.integers(0, 2**31), st.floats(0.1, 3.0))
@settings(max_examples=25, deadline=None)
def test_probability_in_a_ball_turns_with_the_frame_and_grows_with_the_ball(seed: int, size: float) -> None:
    draw = np.random.default_rng(seed)
    root = size * draw.normal(size=(3, 3))
    turn = np.linalg.qr(draw.normal(size=(3, 3)))[0]
    offset = draw.normal(size=3)
    covariance = root @ root.T
    one = within(covariance[None], offset[None], 1.0)[0]
    turned = within((turn @ covariance @ turn.T)[None], (turn @ offset)[None], 1.0)[0]
    assert turned == pytest.approx(one, abs=4e-3)
    assert within(covariance[None], offset[None], 1.2)[0] >= one - 4e-3


def assessed(lines: np.ndarray, radius: float, repeat: float = 0.0) -> Confidence:
    n = len(lines)
    position = np.random.default_rng(9).uniform(*np.array(simulated.BOX).T, (n, 3))
    before = np.random.default_rng(8).normal(size=(n, 3)) * 5e-3
    return confidence(
        unknowns(random_uncertainty().scaled(0.2), repeat=repeat), path_of(position, line=lines),
        points_of(position, before), radius, tell=silent,
    )  # fmt: skip


@pytest.mark.parametrize("repeat", [0.0, 2e-3])
def test_lines_and_programs_are_no_more_probable_than_their_waypoints(repeat: float) -> None:
    lines = np.array([3, 3, 1, 2, 2, 3, 1, 7])
    result = assessed(lines, 0.012, repeat).chances
    assert result is not None
    assert result.lines.tolist() == [1, 2, 3, 7]
    slack = 4.0 * np.sqrt(0.25 / result.draws)
    for k, line in enumerate(result.lines.tolist()):
        own = lines == line
        assert result.line_after[k] <= result.after[own].min() + slack
        assert result.line_after[k] >= 1.0 - (1.0 - result.after[own]).sum() - slack
        assert result.line_before[k] <= result.before[own].min() + slack
    assert result.program_after <= result.line_after.min()
    assert result.line_after[3] == pytest.approx(result.after[7], abs=slack)
    assert 0.02 < result.program_after < result.after.max()


def test_lines_do_not_depend_on_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = np.repeat(np.arange(1, 8), 5)[np.random.default_rng(2).permutation(35)]
    whole = assessed(lines, 0.012)
    monkeypatch.setattr("olp.uncertainty.spread._BLOCK", 4)
    parts = assessed(lines, 0.012)
    first, second = whole.chances, parts.chances
    assert first is not None
    assert second is not None
    assert second.lines.tolist() == first.lines.tolist()
    assert second.line_after == pytest.approx(first.line_after, abs=2e-3)
    assert second.program_after == pytest.approx(first.program_after, abs=2e-3)
    assert second.gain == pytest.approx(first.gain)


def test_the_gain_of_one_number_is_probable_beyond_two_sigma() -> None:
    known = of_sigmas(flat(), {"curves": {"EXX": np.full(6, 2e-3)}})
    assert known is not None
    position = np.full((2, 3), [1500.0, 0.0, 0.0])
    before = np.array([[4.0e-3, 0.0, 0.0], [1.0e-3, 0.0, 0.0]])
    result = confidence(unknowns(known), path_of(position), points_of(position, before), 0.005, tell=silent)
    # the tip gets nearer unless the true error is below half of what is corrected: Phi(v / 2 sigma)
    assert result.chances is not None
    assert result.chances.nearer == pytest.approx([0.8413, 0.5987], abs=1e-4)
    assert result.band_mm == pytest.approx([4e-3, 4e-3])


def test_components_within_their_uncertainty_are_named() -> None:
    q = KNOTS["X"]
    curves = (
        Curve("X", q, {"EXX": np.full(6, 5e-3), "EYX": np.full(6, 1e-3)}, interpolation="linear"),
        *flat().curves[1:],
    )
    calibration = flat(curves=curves, squareness={"C0Y": 30e-6, "B0Z": 4e-6})
    known = of_sigmas(
        calibration,
        {
            "curves": {"EXX": np.full(6, 2e-3), "EYX": np.full(6, 2e-3)},
            "squareness": {"C0Y": 5e-6, "B0Z": 5e-6},
        },
    )
    assert known is not None
    assert improbable(calibration, known) == {"EYX", "B0Z"}
    assert {c.name for c in components(calibration, known)} == {"EXX", "EYX", "C0Y", "B0Z"}


def test_expansion_without_a_model_is_uncertainty() -> None:
    known = Uncertainty((), "", "", temperature_K=0.5)
    expansion = Expansion.of(flat(), known, {"X_scale": 24.0})
    assert expansion.unmodelled_K == 4.0
    assert expansion.scale == pytest.approx((11.5e-6 * np.hypot(4.0, 0.5), 11.5e-6 * 0.5, 11.5e-6 * 0.5))
    modelled = flat(thermal=Thermal(scale_per_K=(10e-6, 0.0, 0.0)))
    expansion = Expansion.of(modelled, known, {"X_scale": 24.0})
    assert expansion.unmodelled_K == 0.0 and expansion.scale[0] == pytest.approx(5e-6)
    sensitivity = Sensitivity.of(modelled, "FXYZ", known, expansion=expansion)
    rows = sensitivity.rows(np.array([[1000.0, 0.0, 0.0]]), np.zeros(3))
    assert np.sqrt((rows[0, 0] ** 2).sum()) == pytest.approx(np.hypot(5e-3, 11.5e-6 * 0.5 * 1000.0))


def test_uncertainties_grow_with_age_as_stated() -> None:
    known = replace(random_uncertainty(), growth_per_year=0.5)
    assert known.growth(None) == known.growth(-3) == 1.0
    assert known.growth(2 * 365.25) == pytest.approx(2.0)


# ---- files


@pytest.fixture(scope="module")
def fitted() -> Iterator[tuple[Fit, Calibration, Uncertainty]]:
    result = fit(taken(simulated.machine(1, "rough"), 1), "FXYZ")
    calibration = calibration_of(result)
    yield result, calibration, covariance_of(result, calibration)


@pytest.mark.slow
def test_the_covariance_of_a_fit_is_that_of_the_path(fitted: tuple[Fit, Calibration, Uncertainty]) -> None:
    result, calibration, known = fitted
    position = np.random.default_rng(4).uniform(*result.box_mm.T, (60, 3))
    rows = Sensitivity.of(calibration, "FXYZ", known).rows(position, TOOL)
    sigma = np.sqrt((rows.astype(float) ** 2).sum(axis=2)).T
    judged = result.sigma(position, TOOL)
    away = np.abs(sigma / judged - 1.0)
    # where a step is in doubt its uncertainty is a half circle over the doubt, here of eight straight pieces
    assert np.median(away) < 0.005 and np.quantile(away, 0.95) < 0.06
    assert known.dropped <= 1e-3


def test_a_covariance_reads_back_and_fits_its_own_calibration_alone(tmp_path: Path) -> None:
    calibration = flat(squareness={"C0Y": 1e-5})
    wave = Entry("wave", "EXX", np.full((2, 5), 1e-4), np.zeros(2), period_mm=10.0)
    half = Entry("half", "EYY", np.full((2, 5), 1e-4), np.array([1e-4, 0.0]), np.array([0.0, 2000.0]))
    known = replace(random_uncertainty(), fingerprint=fingerprint(calibration))
    known = replace(known, entries=(*known.entries, wave, half))
    target = tmp_path / "calibration.toml"
    files = calibration_files(calibration, target, covariance=known)
    for path, data in files.items():
        path.write_bytes(data)
    again = load_uncertainty(target, load_calibration(target))
    assert again is not None and again.rank == known.rank and again.source == known.source
    for mine, other in zip(known.entries, again.entries, strict=True):
        assert (mine.kind, mine.name, mine.period_mm) == (other.kind, other.name, other.period_mm)
        assert other.factor == pytest.approx(mine.factor, rel=1e-6, abs=1e-12)
        assert (other.position_mm == mine.position_mm).all() and (other.rest == mine.rest).all()
    assert covariance_bytes(again) == covariance_bytes(known)
    text = target.read_text("utf-8")
    assert '[covariance]\nfile = "calibration-covariance.npz"' in text
    target.write_text("# a comment is nothing\n" + text)
    assert load_uncertainty(target, load_calibration(target)) is not None
    square = next(line for line in text.split("\n") if line.startswith("C0Y_urad"))
    target.write_text(text.replace(square, "C0Y_urad = 1.5"))
    with pytest.raises(ConfigError, match=r"does not belong to calibration\.toml"):
        load_uncertainty(target, load_calibration(target))


@pytest.mark.parametrize("broken", ["text", "cut", "array", "shape", "kind", "twice", "nan"])
def test_what_is_no_covariance_is_refused(broken: str) -> None:
    import io

    data = covariance_bytes(random_uncertainty())
    if broken in ("text", "cut"):
        data = b"X_mm,EXX_um\n" if broken == "text" else data[: len(data) // 2]
    else:
        arrays = dict(np.load(io.BytesIO(data)))
        if broken == "array":
            del arrays["rest"]
        elif broken == "shape":
            arrays["count"] = arrays["count"][:-1]
        elif broken == "kind":
            arrays["kind"][0] = "mood"
        elif broken == "twice":
            arrays["name"][1] = arrays["name"][0]
        else:
            arrays["factor"][0, 0] = np.nan
        buffer = io.BytesIO()
        np.savez(buffer, **arrays)
        data = buffer.getvalue()
    with pytest.raises(ConfigError) as caught:
        parse_covariance(data, "c.npz")
    assert caught.value.file == "c.npz"


# ---- a correction

PROGRAM = b"""G21 G90 G54 G17 G61
G0 X0 Y0 Z5
G1 Z0 F600
G1 X200
G1 Y150
G1 X0
G1 Y0
G0 Z5
M2
"""
MACHINE = """schema = "olp-machine-1"
name = "m"
chain = "FXYZ"
controller = "linuxcnc"
calibration = "calibration.toml"
{axes}
[work_offsets.G54]
X_mm = 100.0
Y_mm = 100.0
Z_mm = -200.0
[tools.1]
Z_mm = 100.0
[job_defaults]
tool = 1
"""
AXIS = """[axes.{name}]
travel_mm = [{low}, {high}]
least_increment_mm = 0.0001
velocity_mm_s = 500.0
acceleration_mm_s2 = 2000.0
jerk_mm_s3 = 20000.0
"""
CALIBRATION = """schema = "olp-calibration-1"
machine = "m"
measured = 2026-05-14
temperature_degC = 20.0
sign = "actual-minus-commanded"
model = "rigid-body"
datum_mm = [0.0, 0.0, 0.0]
box_mm = [[0, 400], [0, 400], [-400, 0]]
[[curves]]
file = "x.csv"
interpolation = "linear"
[squareness]
C0Y_urad = 5.0
sigma_C0Y_urad = {square}
{more}
"""


def shop(folder: Path, *, sigma: float = 1.0, square: float = 5.0, more: str = "") -> Path:
    """A machine whose X stretches by 100 um/m, known to `sigma` um; and a squareness that is hardly known."""
    axes = "".join(
        AXIS.format(name=n, low=low, high=low + 400.0) for n, low in (("X", 0.0), ("Y", 0.0), ("Z", -400.0))
    )
    (folder / "machine.toml").write_text(MACHINE.format(axes=axes))
    (folder / "calibration.toml").write_text(CALIBRATION.format(square=square, more=more))
    column = f",{sigma}" if sigma else ""
    head = "X_mm,EXX_um" + (",sigma_EXX_um" if sigma else "")
    (folder / "x.csv").write_text(
        "\n".join([head, *(f"{q},{q / 10}{column}" for q in range(0, 401, 50))]) + "\n"
    )
    return folder / "machine.toml"


def codes(findings: tuple[olp.Finding, ...]) -> set[str]:
    return {f.code for f in findings if f.code.startswith("OLP43")}


def test_a_correction_reports_its_uncertainty(tmp_path: Path) -> None:
    result = olp.correct(PROGRAM, shop(tmp_path), part_tolerance_um=5.0)
    confidence_, report = result.confidence, result.report["uncertainty"]
    assert confidence_ is not None
    assert confidence_.line.tolist() == [3, 4, 5, 6, 7]
    # against the touch-off at X 100: two independent positions of 1 um each; C0Y over 150 mm and at none
    assert confidence_.sigma_mm[1, 0] == pytest.approx(np.sqrt(2.0) * 1e-3, rel=1e-4)
    assert confidence_.sigma_mm[2, 0] == pytest.approx(np.hypot(np.sqrt(2.0) * 1e-3, 0.75e-3), rel=1e-4)
    assert confidence_.points.before_mm[1] == pytest.approx([20e-3, 0.0, 0.0], abs=1e-6)
    assert np.abs(confidence_.points.after_mm).max() < 0.1e-3
    assert report["within"]["before"]["program"] == 0.0
    assert report["within"]["after"]["program"] > 0.95 and report["expected"]["probability_better"] > 0.999
    assert codes(result.findings) == {"OLP435"}
    assert "better with probability >99.9 %" in to_text(result.report)


def test_without_stated_uncertainties_nothing_is_reported(tmp_path: Path) -> None:
    machine = shop(tmp_path, sigma=0.0, square=0.0)
    result = olp.correct(PROGRAM, machine)
    assert result.confidence is None and "uncertainty" not in result.report
    with pytest.raises(ConfigError, match="states no uncertainty"):
        olp.correct(PROGRAM, machine, only_sure_components=True)


def test_only_sure_components_leaves_the_improbable_squareness(tmp_path: Path) -> None:
    machine = shop(tmp_path)
    whole, sure = olp.correct(PROGRAM, machine), olp.correct(PROGRAM, machine, only_sure_components=True)
    assert b"X199.9808" in whole.data and b"X199.9808" not in sure.data
    assert codes(sure.findings) >= {"OLP436"}
    assert sure.confidence is not None and whole.confidence is not None
    # what is left out remains as expected deviation: 5 urad over 150 mm
    deviation = sure.confidence.points.after_mm
    assert deviation[2] == pytest.approx([-0.75e-3, 0.0, 0.0], abs=0.1e-3)
    assert sure.confidence.sigma_mm == pytest.approx(whole.confidence.sigma_mm)
    checked = olp.verify(PROGRAM, sure.data, machine, only_sure_components=True)
    assert checked.report["deviation"]["holds"] and checked.report["uncertainty"]["waypoints"] == 5


def test_where_nothing_is_known_well_correction_is_not_advised(tmp_path: Path) -> None:
    result = olp.correct(PROGRAM, shop(tmp_path, sigma=30.0), part_tolerance_um=5.0)
    assert codes(result.findings) == {"OLP431", "OLP432", "OLP433", "OLP435"}
    gain = next(f for f in result.findings if f.code == "OLP431")
    assert gain.lines == (4, 5)
    good = olp.correct(PROGRAM, shop(tmp_path, sigma=0.001, square=0.001), part_tolerance_um=5.0)
    assert codes(good.findings) == set()


def test_age_and_temperature_count(tmp_path: Path) -> None:
    machine = shop(tmp_path, more="[covariance]\ngrowth_per_year = 1.0\n[repeatability]\nX_um = 2.0\n")
    new = olp.correct(PROGRAM, machine, date=datetime.date(2026, 5, 14))
    old = olp.correct(PROGRAM, machine, date=datetime.date(2028, 5, 13), accept=["OLP401"])
    assert "OLP437" in codes(old.findings) and "OLP437" not in codes(new.findings)
    assert new.confidence is not None and old.confidence is not None
    # scatter of the machine, at the position and at the touch, does not grow
    assert new.confidence.sigma_mm[1, 0] == pytest.approx(1e-3 * np.sqrt(2.0 + 8.0), rel=1e-4)
    assert old.confidence.sigma_mm[1, 0] == pytest.approx(1e-3 * np.sqrt(9.0 * 2.0 + 8.0), rel=2e-3)
    (tmp_path / "job.toml").write_text(
        'schema = "olp-job-1"\nmachine = "machine.toml"\n[temperatures_degC]\nX_scale = 23.0\n'
    )
    warm = olp.correct(PROGRAM, machine, tmp_path / "job.toml", part_tolerance_um=1.0)
    assert "OLP434" in codes(warm.findings)
    assert warm.confidence is not None
    assert warm.confidence.sigma_mm[1, 0] == pytest.approx(
        1e-3 * np.sqrt(10.0 + (11.5e-3 * 3.0 * 200.0) ** 2), rel=1e-4
    )


@pytest.mark.slow
def test_two_sigma_cover_the_errors_of_fresh_machines() -> None:
    inside, count = 0.0, 0
    for seed in range(4):
        machine = simulated.machine(100 + seed, ("smooth", "rough")[seed % 2])
        result = fit(taken(machine, seed), "FXYZ")
        calibration = calibration_of(result)
        known = Sensitivity.of(calibration, "FXYZ", covariance_of(result, calibration))
        position = np.random.default_rng(seed).uniform(*calibration.box_mm.T, (40, 3))
        off = machine.error(position, TOOL) - build(calibration, "FXYZ").error(position, TOOL)
        sigma = np.sqrt((known.rows(position, TOOL).astype(float) ** 2).sum(axis=2)).T
        inside += (np.abs(off) <= 2.0 * sigma).sum()
        count += off.size
    # four machines: a squareness out of 12 beyond 2 sigma is 8 % of all (the benchmark takes 200)
    assert 0.85 <= inside / count <= 1.0


def test_the_largest_of_each_run_of_rows_is_that_of_its_rows() -> None:
    values = np.random.default_rng(4).normal(size=(2, 40, 3)).astype(np.float32)
    for starts in ([0], [0, 1, 2, 17, 39], list(range(40)), [0, 30]):
        expected = np.maximum.reduceat(values, starts, axis=1)
        assert np.array_equal(_largest_of_runs(values, np.array(starts)), expected)


def test_without_a_part_tolerance_nothing_but_bands_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("olp.uncertainty.spread.normal", None)
    known = of_sigmas(flat(), {"curves": {"EXX": np.full(6, 2e-3)}})
    assert known is not None
    position = np.full((2, 3), [1500.0, 0.0, 0.0])
    path, points = path_of(position), points_of(position, np.full((2, 3), 1e-3))
    assert confidence(unknowns(known), path, points, None, tell=silent).chances is None
