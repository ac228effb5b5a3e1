"""Maps of what no rigid bodies make: simulated machines that bend, machines that do not, and the files."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from cases.calibration import CHAINS, FRESH, cloud, two_pods
from click.testing import CliRunner
from judge import simulated

import olp
from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.field import Modes, matern
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.marginal import log_evidence
from olp.calibration.estimator.nonrigid import NonRigid, nonrigid
from olp.calibration.estimator.residual_map import residual_map
from olp.calibration.estimator.widened import Adjustment
from olp.calibration.observations.measurements import MapWish, Measurements
from olp.calibration.observations.points import Points
from olp.cli import main
from olp.core.errors import CannotCompute
from olp.errormodel.build import build

BOX = np.array(simulated.BOX)


def positions(n: int = 500) -> np.ndarray:
    return np.random.default_rng(99).uniform(BOX[:, 0], BOX[:, 1], (n, 3))


def of_points(machine: simulated.Machine, seed: int, n: int, **more: object) -> Fit:
    return fit(Measurements("simulated", (cloud(machine, seed, n, 5.0, **more),)), machine.chain)


@pytest.fixture(scope="module")
def bent() -> tuple[simulated.Machine, Fit, NonRigid]:
    machine = simulated.bent(simulated.machine(1, "smooth", CHAINS[1]))
    before = of_points(machine, 1, 120)
    return machine, before, nonrigid(before)


def residual_um(machine: simulated.Machine, error: np.ndarray, tool: np.ndarray) -> float:
    position = positions(len(error))
    return simulated.rms_um(simulated.off_frame(position, machine.error(position, tool) - error))


# -- what it finds ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_sag_is_found_and_the_residual_falls_with_tools_not_measured_with(
    bent: tuple[simulated.Machine, Fit, NonRigid],
) -> None:
    machine, before, result = bent
    assert "DZ" in [process.coordinate for process in result.processes]
    for tool in np.array(FRESH):
        position = positions()
        rigid = residual_um(machine, before.error(position, tool), tool)
        both = residual_um(machine, result.fit.error(position, tool) + result.value(position), tool)
        assert both < 0.9 * rigid
        assert both < 6.5


@pytest.mark.slow
def test_its_uncertainty_is_that_of_its_residual(bent: tuple[simulated.Machine, Fit, NonRigid]) -> None:
    machine, _, result = bent
    position, tool = positions(200), np.array(FRESH[0])
    z = (
        machine.error(position, tool) - result.fit.error(position, tool) - result.value(position)
    ) / result.sigma(position, tool)
    assert 0.5 < np.sqrt(np.mean(z**2)) < 1.5
    assert np.mean(np.abs(z) < 2.0) > 0.88


@pytest.mark.slow
def test_held_out_readings_are_predicted_better(bent: tuple[simulated.Machine, Fit, NonRigid]) -> None:
    figures = bent[2].figures
    assert figures is not None
    assert figures.held_out_after < figures.held_out_before
    assert figures.residual_after < figures.residual_before
    assert figures.held_out_after > figures.residual_after


@pytest.mark.slow
@pytest.mark.parametrize("family", ["smooth", "rough"])
@pytest.mark.parametrize("seed", [200, 201])
def test_nothing_is_invented_on_rigid_machines(family: str, seed: int) -> None:
    result = nonrigid(before := of_points(simulated.machine(seed, family, CHAINS[seed % 6]), seed, 120))
    assert not result.processes
    assert result.fit is before
    assert "evidence" in result.reason
    assert not result.value(positions()).any()


@pytest.mark.slow
def test_noise_that_was_stated_too_small_is_no_field() -> None:
    """It is more than what curves hide between positions."""
    points = cloud(simulated.machine(203, "smooth"), 203, 120, 50.0)
    lying = dataclasses.replace(points, sigma=0.5 * points.sigma)
    result = nonrigid(fit(Measurements("simulated", (lying,)), "FXYZ"))
    assert not result.processes
    assert result.noise > 1.05


@pytest.mark.slow
def test_directions_of_pods_show_a_sag_too() -> None:
    machine = simulated.bent(simulated.machine(2, "smooth"), sag_mm=0.15)
    result = nonrigid(before := fit(Measurements("simulated", (two_pods(machine, 2, 250),)), "FXYZ"))
    assert "DZ" in [process.coordinate for process in result.processes]
    position, tool = positions(), np.array(FRESH[0])
    after = residual_um(machine, result.fit.error(position, tool) + result.value(position), tool)
    assert after < 0.9 * residual_um(machine, before.error(position, tool), tool)


@pytest.mark.slow
def test_too_few_points_or_points_in_a_plane_make_no_map() -> None:
    machine = simulated.machine(3, "smooth")
    few = nonrigid(of_points(machine, 3, 30))
    assert not few.processes
    assert "30 volumetric points" in few.reason
    whole = cloud(machine, 3, 200, 5.0)
    use = whole.axis_mm[:, 2] > -200.0
    low = Points(whole.axis_mm[use], whole.tool_mm[use], whole.measured_mm[use], whole.sigma)
    fitted = fit(Measurements("simulated", (low,)), "FXYZ")
    wide = dataclasses.replace(fitted, box_mm=BOX)
    assert "along Z" in nonrigid(wide).reason


# -- the mathematics -------------------------------------------------------------------------------------


def test_the_sines_make_the_kernel() -> None:
    modes, position = Modes.over(BOX, 1000), positions(200)
    lengths = 0.3 * np.ptp(BOX, axis=1)
    log_variance, _ = modes.log_variance(np.log(2.0), np.log(lengths))
    rows = modes.values(position)
    apart = np.linalg.norm((position[:, None] - position[None]) / lengths, axis=2)
    ours, true = (rows * np.exp(log_variance)) @ rows.T, 4.0 * matern(apart)
    assert np.sqrt(np.mean((ours - true) ** 2)) < 0.02 * 4.0
    assert matern(np.array([0.0, 1.0]))[1] == pytest.approx(0.523994, abs=1e-6)  # by hand


@pytest.mark.slow
def test_the_evidence_is_that_of_the_dense_gaussian() -> None:
    """Against the log density of the readings themselves, with every unknown marginalised."""
    machine = simulated.machine(4, "smooth")
    before = of_points(machine, 4, 45)
    modes = Modes(BOX.mean(axis=1), np.ptp(BOX, axis=1), np.array([[1.0, 1, 1], [2, 1, 1], [1, 2, 2]]))
    work = Adjustment(before, modes)
    log = np.array([[np.log(s), *np.log(0.5 * np.ptp(BOX, axis=1))] for s in (0.01, 0.004, 0.02)])

    def ours(size: float) -> float:
        return log_evidence(
            work.reduced(), modes, log + np.array([np.log(size), 0.0, 0.0, 0.0]), np.log(1.3)
        )[0]

    block, size = work.blocks[0], before.parameters.size
    (chunk,) = block.chunks()
    nominal = chunk.local @ chunk.local.T  # the frame: any

    def dense(factor: float) -> float:
        variance = np.concatenate([np.exp(modes.log_variance(h[0] + np.log(factor), h[1:])[0]) for h in log])
        curves = np.linalg.inv(before.prior.precision()[0])
        rigid = chunk.rows[:, :size] @ curves @ chunk.rows[:, :size].T + nominal
        field = (chunk.rows[:, size:] * variance) @ chunk.rows[:, size:].T
        noise = np.diag(chunk.sigma**2)
        cov = 1.69 * (rigid + noise) + field
        return float(-0.5 * np.linalg.slogdet(cov)[1] - 0.5 * chunk.y @ np.linalg.solve(cov, chunk.y))

    assert ours(1.0) - ours(0.1) == pytest.approx(dense(1.0) - dense(0.1), abs=2e-2)


@pytest.mark.slow
def test_derivatives_of_the_evidence() -> None:
    machine = simulated.bent(simulated.machine(5, "smooth"))
    work = Adjustment(of_points(machine, 5, 60), modes := Modes.over(BOX, 60))
    reduced = work.reduced()
    log = np.log([[0.01, 900.0, 700.0, 400.0], [0.004, 1500.0, 900.0, 700.0], [0.02, 1200.0, 800.0, 500.0]])
    _, slope, by_noise = log_evidence(reduced, modes, log, 0.1)
    for k, i in ((0, 0), (1, 2), (2, 3)):
        step = np.zeros(log.shape)
        step[k, i] = 1e-4
        up, down = (log_evidence(reduced, modes, log + s * step, 0.1)[0] for s in (1, -1))
        assert slope[k, i] == pytest.approx((up - down) / 2e-4, rel=1e-2, abs=2e-2)
    up, down = (log_evidence(reduced, modes, log, 0.1 + s)[0] for s in (1e-4, -1e-4))
    assert by_noise == pytest.approx((up - down) / 2e-4, rel=1e-3)


@pytest.mark.slow
def test_without_a_field_the_adjustment_is_that_of_the_fit() -> None:
    before = of_points(simulated.machine(6, "rough"), 6, 80)
    x, covariance, _ = Adjustment(before, Modes.over(BOX, 80)).solve((), np.zeros(0), 1.0)
    position, tool, size = positions(50), np.array(FRESH[1]), before.parameters.size
    again = dataclasses.replace(before, theta=x[:size], covariance=covariance[:size, :size])
    assert again.error(position, tool) == pytest.approx(before.error(position, tool), abs=1e-6)
    grown = max(1.0, before.chi_square / before.freedom)
    assert again.sigma(position, tool) * np.sqrt(grown) == pytest.approx(
        before.sigma(position, tool), rel=1e-3
    )


# -- maps and files --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_map_loses_no_more_than_stated(bent: tuple[simulated.Machine, Fit, NonRigid]) -> None:
    _, before, result = bent
    wanted = Measurements("simulated", before.measurements.observations, map=MapWish(within_mm=2e-4))
    fitted = olp.fit_calibration(dataclasses.replace(wanted, chain=before.parameters.chain))
    (described,) = fitted.calibration.maps
    assert described.sigma is not None
    position = positions(2000)
    position = fitted.calibration.box_mm[:, 0] + (position - BOX[:, 0]) / np.ptp(BOX, axis=1) * np.ptp(
        fitted.calibration.box_mm, axis=1
    )
    model = build(dataclasses.replace(fitted.calibration, curves=(), squareness={}), before.parameters.chain)
    assert np.abs(model.error(position, np.zeros(3)) - result.value(position)).max() < 2.5e-4
    with pytest.raises(CannotCompute, match="within_um"):
        residual_map(result, fitted.calibration, 1e-9)


@pytest.mark.slow
def test_sigmas_of_curves_and_map_add_up_to_that_of_both(
    bent: tuple[simulated.Machine, Fit, NonRigid],
) -> None:
    _, before, result = bent
    fitted = olp.fit_calibration(
        dataclasses.replace(before.measurements, chain=before.parameters.chain), map=MapWish(within_mm=1e-3)
    )
    (described,) = fitted.calibration.maps
    assert described.sigma is not None
    tool, position = np.array(described.tool_mm), np.array([[k[0] for k in described.knots_mm]])
    whole = np.sqrt(described.sigma[0, 0, 0] ** 2 + result.fit.sigma(position, tool)[0] ** 2)
    assert np.all(whole >= result.sigma(position, tool)[0] - 1e-6)
    assert whole == pytest.approx(result.sigma(position, tool)[0], rel=0.15)


def written(
    folder: Path, machine: simulated.Machine, more: str = "[map]\nwithin_um = 1.0\n", tools: object = None
) -> Path:
    points = cloud(machine, 1, 120, 5.0, tools)
    table = np.column_stack([points.axis_mm, points.measured_mm, points.tool_mm])
    columns = [f"{a}{b}_mm" for a in ("", "measured_", "tool_") for b in "XYZ"]
    np.savetxt(folder / "points.csv", table, delimiter=",", fmt="%.6f", header=",".join(columns), comments="")
    (folder / "measurements.toml").write_text(
        'schema = "olp-measurements-1"\nmachine = "m"\nchain = "YFXZ"\nmeasured = 2026-05-14\n'
        f'temperature_degC = 20.0\n{more}\n[[points]]\nfile = "points.csv"\nsigma_um = 5.0\n'
    )
    return folder


@pytest.mark.slow
def test_from_points_to_a_calibration_with_a_map(tmp_path: Path) -> None:
    machine = simulated.bent(simulated.machine(1, "smooth", "YFXZ"))
    plan = written(tmp_path, machine, "[map]\nwithin_um = 0.5\n")
    target = tmp_path / "calibration.toml"
    result = CliRunner().invoke(main, ["calibrate", "fit", str(plan), "-o", str(target), "--json", "-q"])
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert report["map"]["written"]
    assert report["map"]["held_out_after_sigma"] < report["map"]["held_out_before_sigma"]
    assert "OLP841" in [finding["code"] for finding in report["findings"]]
    from olp.files.calibration.reader import load_calibration

    read = load_calibration(target)
    again = olp.fit_calibration(plan).calibration
    assert read.maps[0].values == pytest.approx(again.maps[0].values, abs=1e-12)
    assert read.maps[0].sigma == pytest.approx(again.maps[0].sigma, abs=1e-12)
    tool = np.array(FRESH[0])
    model = build(read, "YFXZ", outside="hold")
    rigid = build(dataclasses.replace(read, maps=()), "YFXZ", outside="hold")
    position = positions()
    assert residual_um(machine, model.error(position, tool), tool) < 6.5
    assert residual_um(machine, model.error(position, tool), tool) < residual_um(
        machine, rigid.error(position, tool), tool
    )
    plain = CliRunner().invoke(main, ["calibrate", "fit", str(plan), "--no-map", "--json", "-q"])
    assert "map" not in json.loads(plain.stdout)


@pytest.mark.slow
def test_one_offset_says_what_the_map_holds_for(tmp_path: Path) -> None:
    machine = simulated.bent(simulated.machine(1, "smooth", "YFXZ"))
    plan = written(tmp_path, machine, tools=[simulated.OFFSETS[0]])
    result = CliRunner().invoke(main, ["calibrate", "fit", str(plan), "--map"])
    assert "OLP843" in result.output
    assert "[0, 0, -120] mm" in " ".join(result.output.split())


@pytest.mark.slow
def test_no_map_is_reported(tmp_path: Path) -> None:
    plan = written(tmp_path, simulated.machine(1, "smooth", "YFXZ"))
    result = CliRunner().invoke(
        main, ["calibrate", "fit", str(plan), "--map", "-o", str(tmp_path / "c.toml")]
    )
    assert "OLP842" in result.output
    assert not list(tmp_path.glob("c-map*"))
