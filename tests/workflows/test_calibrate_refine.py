"""Calibrations refined by measured runs: laws of the update, three turns, files and the command."""

from __future__ import annotations

import dataclasses
import datetime
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from cases.refine import run, start, turns
from click.testing import CliRunner
from judge import simulated

from olp.calibration.diagnosis.refinement import refine
from olp.calibration.observations.points import Points
from olp.cli import main
from olp.core.errors import ConfigError
from olp.errormodel.build import build
from olp.errormodel.sensitivity import Sensitivity
from olp.errormodel.uncertainty import Uncertainty
from olp.files.calibration.covariance import load_uncertainty
from olp.files.calibration.reader import load_calibration
from olp.files.calibration.writer import calibration_files
from olp.files.config import load_setup
from olp.files.measurements.checkpoints import load_checkpoints
from olp.workflows.calibrate_refine import _findings, refine_calibration

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "family"), [(0, "smooth"), (0, "rough")])
def test_three_turns(seed: int, family: str) -> None:
    results = turns(seed, family, quick=True)
    residuals = [one.residual for one in results]
    assert residuals == sorted(residuals, reverse=True)
    assert residuals[-1] < 0.7 * residuals[0]
    stated = [one.stated for one in results]
    assert stated == sorted(stated, reverse=True)


@pytest.fixture(scope="module")
def begun():
    machine, calibration, uncertainty = start(1, "smooth", True)
    machine.half = {}
    return machine, calibration, uncertainty


@pytest.mark.slow
def test_the_update_is_that_of_bayes(begun) -> None:
    """Against the textbook form with the gain, and the frame as columns of a large variance."""
    machine, calibration, uncertainty = begun
    points = run(machine, 3, 12, 0.01)
    done = refine(calibration, machine.chain, uncertainty, points)
    parts = Sensitivity.of(calibration, machine.chain, uncertainty)
    fresh = run(machine, 4, 9, 0.01)

    def table(p: Points) -> np.ndarray:
        rows = np.moveaxis(parts.rows(p.axis_mm, p.tool_mm), 0, 1)
        return rows.reshape(3 * len(p.axis_mm), -1).astype(float)

    old = build(calibration, machine.chain)
    new = build(done.calibration, machine.chain)
    h, g = table(points), table(fresh)
    nominal = points.axis_mm + points.tool_mm + old.error(points.axis_mm, points.tool_mm)
    a, b = points.measured_mm.mean(axis=0), nominal.mean(axis=0)
    u, _, v = np.linalg.svd((points.measured_mm - a).T @ (nominal - b))
    turn = v.T @ np.diag([1, 1, np.sign(np.linalg.det(v.T @ u.T))]) @ u.T
    misses = ((points.measured_mm - a) @ turn.T + b - nominal).reshape(-1)
    arm = (points.axis_mm + points.tool_mm - (points.axis_mm + points.tool_mm).mean(axis=0)) / 1000.0
    frame = np.zeros((len(arm), 3, 6))
    for k in range(3):
        frame[:, k, k] = 1.0
        frame[:, :, 3 + k] = np.cross(np.eye(3)[k], arm)
    frame = frame.reshape(-1, 6)
    spread = h @ h.T + 1e2 * frame @ frame.T + 0.01**2 * np.eye(len(h))
    gained = (g @ h.T @ np.linalg.solve(spread, misses)).reshape(-1, 3)
    moved = new.error(fresh.axis_mm, fresh.tool_mm) - old.error(fresh.axis_mm, fresh.tool_mm)
    assert np.abs(moved).max() > 2e-3
    assert np.allclose(moved, gained, atol=6e-4)


@pytest.mark.slow
def test_what_is_known_exactly_does_not_move(begun) -> None:
    machine, calibration, uncertainty = begun
    done = refine(calibration, machine.chain, uncertainty.scaled(1e-6), run(machine, 5, 40, 0.01))
    for a, b in zip(done.calibration.curves, calibration.curves, strict=True):
        assert all(np.allclose(a.mean(n), b.mean(n), atol=1e-7) for n in b.names)


@pytest.mark.slow
def test_a_run_that_fits_nothing_is_told_and_widens(begun) -> None:
    machine, calibration, uncertainty = begun
    good = refine(calibration, machine.chain, uncertainty.scaled(0.2), run(machine, 6, 40, 0.001))
    assert good.chi_square / good.freedom > 1.5
    parts = [Sensitivity.of(calibration, machine.chain, u) for u in (good.uncertainty, uncertainty)]
    axis_mm = simulated.points(machine, 9, 20, 0.0)[0]
    rms = [float(np.sqrt((p.rows(axis_mm, np.zeros(3)) ** 2).sum())) for p in parts]
    assert rms[0] > 0.05 * rms[1]


@pytest.mark.slow
def test_a_slip_is_left_out(begun) -> None:
    machine, calibration, uncertainty = begun
    points = run(machine, 7, 60, 0.005)
    places = points.measured_mm.copy()
    places[17] += [0.0, 0.3, 0.0]
    wrong = dataclasses.replace(points, measured_mm=places)
    done = refine(calibration, machine.chain, uncertainty, wrong)
    assert [row for row, _ in done.outliers] == [18]
    clean = refine(calibration, machine.chain, uncertainty, points)
    assert done.after_mm == pytest.approx(clean.after_mm, rel=0.1)


def test_one_run_twice_is_told(begun) -> None:
    """It counts as two, and passed in silence."""
    machine, calibration, uncertainty = begun
    points = run(machine, 7, 40, 0.005)
    once = refine(calibration, machine.chain, uncertainty, points)
    twice = refine(once.calibration, machine.chain, once.uncertainty, points)
    other = refine(once.calibration, machine.chain, once.uncertainty, run(machine, 8, 40, 0.005))
    told = [[finding.code for finding in _findings(done)] for done in (once, twice, other)]
    assert "OLP840" in told[1] and "OLP840" not in told[0] + told[2]


def test_points_say_nothing_along_their_path(begun) -> None:
    machine, calibration, uncertainty = begun
    points = run(machine, 8, 50, 0.005)
    along = np.tile([1.0, 0.0, 0.0], (50, 1))
    known = dataclasses.replace(points, measured_mm=_in_machine(machine, points))
    done = [
        refine(calibration, machine.chain, uncertainty, p, frame_known=True, along=along)
        for p in (known, dataclasses.replace(known, measured_mm=known.measured_mm + 0.2 * along))
    ]
    for a, b in zip(done[0].calibration.curves, done[1].calibration.curves, strict=True):
        assert all(np.allclose(a.mean(n), b.mean(n), atol=1e-9) for n in a.names)


def _in_machine(machine, points: Points) -> np.ndarray:
    axis_mm, tools = points.axis_mm, points.tool_mm
    tip_mm = axis_mm + tools
    for tool in np.unique(tools, axis=0):
        own = (tools == tool).all(axis=1)
        tip_mm[own] += machine.error(axis_mm[own], tool)
    return tip_mm


# -- files and the command -------------------------------------------------------------------------------


def call(*words: str):
    return CliRunner().invoke(main, [*words])


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("refine") / "gantry-lines"
    shutil.copytree(PROGRAMS / "gantry-lines", folder, ignore=shutil.ignore_patterns("calibration*"))
    machine = ["-m", str(folder / "machine.toml")]
    done = call("calibrate", "fit", str(folder), *machine, "-q", "-o", str(folder / "calibration.toml"))
    assert done.exit_code == 0, done.output
    return folder


@pytest.mark.slow
def test_the_command_and_a_second_turn_from_its_files(shop: Path, tmp_path: Path) -> None:
    files = [str(shop / "calibration.toml"), str(shop / "tracker.csv"), "-m", str(shop / "machine.toml")]
    one, two = tmp_path / "one.toml", tmp_path / "two.toml"
    before = {p: p.read_bytes() for p in shop.iterdir()}
    done = call("calibrate", "refine", *files, "-o", str(one), "--json", "--date", "2026-06-01")
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert report["schema"] == "olp-refinement-1"
    assert report["rms_after_um"] < report["rms_before_um"]
    assert {p: p.read_bytes() for p in shop.iterdir()} == before
    again = call("calibrate", "refine", str(one), *files[1:], "-o", str(two), "-q")
    assert again.exit_code == 0, again.output
    sigma = []
    for file in (shop / "calibration.toml", one, two):
        known = load_uncertainty(file, load_calibration(file))
        assert known is not None
        sigma.append(np.mean([np.mean(e.sigma**2) for e in known.entries if e.kind == "mean"]))
    assert sigma[0] > sigma[1] > sigma[2]
    assert call("calibrate", "refine", *files, "-o", files[0], "--force").exit_code == 2


@pytest.mark.slow
def test_a_run_of_a_corrected_program(shop: Path, tmp_path: Path) -> None:
    """The plate, corrected by a calibration with a wrong squareness that it thinks uncertain, run on the true
    machine: the squareness comes back."""
    plate, machine = PROGRAMS / "gantry-plate" / "plate.ngc", shop / "machine.toml"
    text = (shop / "calibration.toml").read_text("utf-8")
    value = load_calibration(shop / "calibration.toml").squareness["C0Y"] * 1e6
    lines = []
    for line in text.splitlines():
        if line.startswith("C0Y_urad"):
            line = f"C0Y_urad = {value + 40.0}\nsigma_C0Y_urad = 30.0"
        lines.append(line)
        if line.startswith("[covariance]"):
            lines.pop()
    off = "\n".join(line for line in lines if "npz" not in line)
    (shop / "off.toml").write_text(off, "utf-8")
    (shop / "machine-off.toml").write_text(
        machine.read_text("utf-8").replace('"calibration.toml"', '"off.toml"'), "utf-8"
    )
    corrected, measured = tmp_path / "plate.ngc", tmp_path / "measured.csv"
    done = call("correct", str(plate), "-m", str(shop / "machine-off.toml"), "-o", str(corrected), "-q")
    assert done.exit_code in (0, 1), done.output
    true = PROGRAMS / "gantry-plate" / "machine.toml"
    done = call("simulate", str(corrected), "-m", str(true), "-o", str(measured))
    assert done.exit_code == 0, done.output
    refined = refine_calibration(shop / "off.toml", measured, machine, program=plate, sigma_um=10.0)
    new = refined.calibration.squareness["C0Y"] * 1e6
    assert abs(new - value) < 12.0
    assert refined.refinement.after_mm < 0.6 * refined.refinement.before_mm


@pytest.mark.slow
def test_a_calibration_without_uncertainty_is_refused(shop: Path) -> None:
    gantry = PROGRAMS / "gantry-plate"
    with pytest.raises(ConfigError, match="states no uncertainty"):
        refine_calibration(gantry / "calibration.toml", shop / "tracker.csv", gantry / "machine.toml")


@pytest.mark.slow
def test_what_is_known_fades_until_the_run(shop: Path, tmp_path: Path) -> None:
    """Against a run whose old covariance was made larger by hand; the new file keeps the growth."""
    file, points, machine = (shop / name for name in ("calibration.toml", "tracker.csv", "machine.toml"))
    old = load_calibration(file)
    assert old.measured is not None
    day = old.measured + datetime.timedelta(days=731)
    ageing = file.read_text("utf-8").replace("[covariance]", "[covariance]\ngrowth_per_year = 0.25")
    (shop / "ageing.toml").write_text(ageing, "utf-8")
    done = refine_calibration(shop / "ageing.toml", points, machine, date=day)
    growth = 1.0 + 0.25 * 731 / 365.25
    assert done.report["growth_by_age"] == pytest.approx(growth)
    known = load_uncertainty(file, old)
    assert known is not None
    taken, _ = load_checkpoints(points, sigma_um=None, tool_mm=None)
    chain = load_setup(machine).machine.chain
    by_hand = refine(old, chain, known.scaled(growth), taken)
    assert done.refinement.expected_mm == pytest.approx(by_hand.expected_mm)
    for a, b in zip(done.calibration.curves, by_hand.calibration.curves, strict=True):
        assert all(np.array_equal(a.mean(name), b.mean(name)) for name in a.names)
    # the day from which one and a half of the uncertainty is reached
    rms = done.report["uncertainty_um"]
    again = refine_calibration(shop / "ageing.toml", points, machine, date=day, uncertainty_um=1.5 * rms)
    assert again.report["measure_again"] == (day + datetime.timedelta(days=2 * 365.25)).isoformat()
    now = refine_calibration(shop / "ageing.toml", points, machine, date=day, uncertainty_um=0.9 * rms)
    assert now.report["measure_again"] == day.isoformat()
    never = refine_calibration(file, points, machine, date=day)
    assert never.report["measure_again"] is None and never.report["growth_by_age"] == 1.0
    assert never.report["uncertainty_um"] < rms
    done.write(tmp_path / "new.toml")
    kept = load_uncertainty(tmp_path / "new.toml", load_calibration(tmp_path / "new.toml"))
    assert kept is not None and kept.growth_per_year == 0.25


def test_fading_needs_the_day_of_the_run(tmp_path: Path) -> None:
    """A share for a year, and no day."""
    machine = PROGRAMS / "gantry-lines" / "machine.toml"
    calibration, uncertainty = begun_files(tmp_path)
    assert uncertainty.growth_per_year == 0.0
    with pytest.raises(ConfigError, match=r"growth_per_year needs the day of the run; give it \(--date\)"):
        refine_calibration(
            calibration, PROGRAMS / "gantry-lines" / "tracker.csv", machine, growth_per_year=0.2
        )


def test_a_run_before_the_calibration_is_refused(tmp_path: Path) -> None:
    calibration, _ = begun_files(tmp_path)
    points, machine = (PROGRAMS / "gantry-lines" / name for name in ("tracker.csv", "machine.toml"))
    with pytest.raises(ConfigError, match="after the day of the run, 2026-04-19"):
        refine_calibration(calibration, points, machine, date=datetime.date(2026, 4, 19))


def begun_files(folder: Path) -> tuple[Path, Uncertainty]:
    """A calibration of one squareness with its uncertainty."""
    file = folder / "calibration.toml"
    file.write_text(
        'schema = "olp-calibration-1"\nmachine = "gantry-1600"\nmeasured = 2026-04-20\n'
        'temperature_degC = 20.0\nsign = "actual-minus-commanded"\nmodel = "rigid-body"\n'
        "datum_mm = [0.0, 0.0, 0.0]\nbox_mm = [[20, 1580], [20, 980], [-440, -5]]\n"
        "active_during_measurement = []\n[squareness]\nC0Y_urad = 20.0\nsigma_C0Y_urad = 5.0\n",
        "utf-8",
    )
    known = load_uncertainty(file, load_calibration(file))
    assert known is not None
    return file, known


def test_a_written_calibration_keeps_growth_and_temperature(tmp_path: Path) -> None:
    file, known = begun_files(tmp_path)
    ageing = dataclasses.replace(known, growth_per_year=0.3, temperature_K=0.5)
    for path, data in calibration_files(
        load_calibration(file), tmp_path / "new.toml", covariance=ageing
    ).items():
        path.write_bytes(data)
    kept = load_uncertainty(tmp_path / "new.toml", load_calibration(tmp_path / "new.toml"))
    assert kept is not None and (kept.growth_per_year, kept.temperature_K) == (0.3, 0.5)
