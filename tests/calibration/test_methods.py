"""Equation (1), the map of two pods and the adjustment on one shop's readings, against simulated truth."""

from __future__ import annotations

import dataclasses
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))
import bench_two_pods as bench
from cases.calibration import case, cloud, measurements_of, two_pods
from judge import simulated

import olp
from olp.calibration.estimator.adjustment import fit
from olp.calibration.methods.equation_1 import equation_1, in_the_papers_signs
from olp.calibration.methods.judging import Judged, best, judged, noise_of, stated
from olp.calibration.methods.pod_map import adjusted, pod_map
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.points import Points
from olp.cli import main
from olp.core.errors import CannotCompute, ConfigError
from olp.core.machine import Axis, Machine, Setup
from olp.errormodel.build import build

UM = 1e-3
LINES = Path(__file__).resolve().parents[2] / "programs" / "gantry-lines"
SHOP = simulated.machine(0, "smooth", "FXYZ")


def shop(chain: str = "FXYZ") -> Setup:
    axes = {
        axis: Axis((float(low), float(high)), 1e-3, 500.0, 2000.0, 20000.0)
        for axis, (low, high) in zip("XYZ", SHOP.box, strict=True)
    }
    return Setup(Machine(name="simulated", chain=chain, controller="linuxcnc", axes=axes))


# -- equation (1) ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("placed", [False, True])
def test_equation_1_of_a_shop_is_that_of_the_benchmark(placed: bool) -> None:
    """The benchmark puts the same lines into the equation by itself; squares are perfect there."""
    machine, measurements = case(0, "smooth", "FXYZ")
    origin = simulated.LINE if placed else (0.0, 0.0, 0.0)
    other = bench.equation_1(machine, simulated.all_lines(machine, 0), origin)
    calibration = equation_1(measurements, "FXYZ", machine.box, placed=placed)
    model = build(calibration, "FXYZ", outside="hold")
    low, high = machine.box[:, 0] + 60.0, machine.box[:, 1] - 60.0
    position = np.random.default_rng(1).uniform(low, high, (300, 3))
    zero = np.zeros((300, 3))
    difference = model.error(position, zero) - other(position, zero)
    assert simulated.rms_um(difference - difference.mean(axis=0)) < 0.8


def test_the_error_of_a_square_is_taken_out_and_the_signs_are_the_papers() -> None:
    _, measurements = case(0, "smooth", "FXYZ")
    box = SHOP.box
    plain = equation_1(measurements, "FXYZ", box, placed=True)
    wide = tuple(dataclasses.replace(square, error_rad=20e-6) for square in measurements.squares)
    other = equation_1(dataclasses.replace(measurements, squares=wide), "FXYZ", box, placed=True)
    before, after = in_the_papers_signs(plain), in_the_papers_signs(other)
    for name in ("XY_sqr", "XZ_sqr", "YZ_sqr"):
        assert after[name] - before[name] == pytest.approx(-20e-6)
    assert before["XY_sqr"] == -plain.squareness["C0Y"] and before["XZ_sqr"] == plain.squareness["B0Z"]
    assert before["X_yaw"] == pytest.approx(float(np.ptp(plain.curves[0].columns["ECX"])))


def test_equation_1_is_for_one_chain_and_needs_lines() -> None:
    _, measurements = case(0, "smooth", "FXYZ")
    with pytest.raises(CannotCompute, match="this machine is XYFZ"):
        equation_1(measurements, "XYFZ", SHOP.box, placed=True)
    with pytest.raises(CannotCompute, match="needs lines"):
        equation_1(Measurements("m"), "FXYZ", SHOP.box, placed=True)


# -- the map of two pods ---------------------------------------------------------------------------------


def test_rays_without_noise_give_the_deviations_of_their_points(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also on a machine with errors of 70 um, which the poses of the pods must not absorb."""
    places = np.array(simulated.PODS)
    rays = simulated.directions(SHOP, 3, 24, places, 0.0, [simulated.TOOL])
    apart = float(np.linalg.norm(places[1] - places[0]))
    pods = dataclasses.replace(two_pods(SHOP, 3, 24), **dict(zip(
        ("axis_mm", "tool_mm", "azimuth_rad", "elevation_rad"), rays, strict=True
    )), baselines=((0, 1, apart, 1e-3),))  # fmt: skip
    first, second = adjusted(pods)
    assert np.linalg.norm(second.place_mm - first.place_mm) == pytest.approx(apart, abs=1e-3)
    made = pod_map(pods)
    true = SHOP.error(pods.axis_mm, pods.tool_mm[0])
    assert simulated.rms_um(true) > 40.0
    rest = simulated.off_frame(pods.axis_mm, made.error(pods.axis_mm, pods.tool_mm) - true)
    assert simulated.rms_um(rest) < 0.3
    # linear between points, that of the nearest one beyond them
    middle = pods.axis_mm.mean(axis=0, keepdims=True)
    assert np.isfinite(made.error(middle, np.zeros((1, 3)))).all()
    far = made.error(np.array([[1e5, 1e5, 1e5]]), np.zeros((1, 3)))
    assert (made.deviation_mm == far).all(axis=1).any()


def test_a_map_needs_two_pods_and_a_volume() -> None:
    pods = two_pods(SHOP, 3, 30)
    one = dataclasses.replace(
        pods, azimuth_rad=pods.azimuth_rad[:, :1], elevation_rad=pods.elevation_rad[:, :1], baselines=()
    )
    with pytest.raises(CannotCompute, match="two pods or more"):
        pod_map(one)


# -- the judgement ---------------------------------------------------------------------------------------


def test_a_shift_and_a_turn_are_no_error_and_noise_is_noise() -> None:
    points = cloud(SHOP, 5, 120, 4.0)
    turn, shift = np.array([30e-6, -50e-6, 20e-6]), np.array([0.3, -0.1, 0.2])

    def errors(axis: np.ndarray, tool: np.ndarray) -> np.ndarray:
        true = np.array([SHOP.error(a[None], t)[0] for a, t in zip(axis, tool, strict=True)])
        return true + shift + np.cross(turn, axis + tool)

    rms, worst = judged(points, errors)
    assert rms == pytest.approx(noise_of(points), rel=0.15) and rms < worst < 4.0 * rms


def test_the_frame_takes_its_share_of_the_noise_of_few_points() -> None:
    random = np.random.default_rng(2)
    axis = random.uniform(0.0, 1000.0, (8, 3))
    squares = []
    for _ in range(200):
        measured = axis + random.normal(0.0, 5.0 * UM, axis.shape)
        points = Points(axis, np.zeros((8, 3)), measured, 5.0 * UM)
        squares.append(judged(points, lambda place, tool: np.zeros(place.shape))[0] ** 2)
    assert np.sqrt(np.mean(squares)) == pytest.approx(noise_of(points), rel=0.05)


@pytest.mark.slow
def test_what_an_adjustment_states_is_what_it_is_off() -> None:
    _, measurements = case(0, "smooth", "FXYZ")
    fitted = fit(measurements, "FXYZ")
    points = cloud(SHOP, 5, 120, 0.01)
    off, _ = judged(points, fitted.error)
    assert 0.4 < off / stated(points, fitted) < 2.0


@pytest.mark.slow
def test_what_an_adjustment_states_holds_between_few_targets() -> None:
    """On rough machines much of the error lies between the targets, where the covariance alone is silent."""
    machine = simulated.machine(3, "rough", "FXYZ")
    taken = simulated.all_lines(machine, 3, runs=3, count=(13, 9, 7))
    fitted = fit(measurements_of(taken), "FXYZ")
    points = cloud(machine, 5, 120, 0.01)
    assert judged(points, fitted.error)[0] / stated(points, fitted) < 1.1


def test_of_equal_methods_the_quick_one_is_used() -> None:
    slow, quick, bad = (
        Judged("a", 1.0, 2.0, None, 5.0),
        Judged("b", 1.05, 2.0, None, 1.0),
        Judged("c", 2.0, 3.0),
    )
    assert best([bad, slow, quick]) is quick
    assert best([bad, slow]) is slow
    says = dataclasses.replace(slow, name="d", stated_mm=1.0)
    assert best([slow, says]) is says


@pytest.mark.slow
def test_lines_and_pods_beat_equation_1_and_the_map() -> None:
    """With a tool that nothing was measured with: the conclusion of the benchmark, on one shop's readings."""
    _, measurements = case(0, "smooth", "FXYZ")
    whole = dataclasses.replace(
        measurements, observations=(*measurements.lines, two_pods(SHOP, 0, 120)), machine="simulated"
    )
    check = cloud(SHOP, 9, 60, 0.5, [(90.0, 60.0, -220.0)])
    compared = olp.compare_methods(whole, check, shop())
    off = {method.name: method.residual_mm / UM for method in compared.methods}
    assert len(off) == 7 and not compared.report["not_possible"]
    assert off["adjustment, all readings"] < off["adjustment, lines"] + 0.5 < off["adjustment, pods"]
    assert off["adjustment, pods"] < 0.7 * off["linear map of the pods"]
    assert off["adjustment, lines"] < off["equation (1), lever arms from the lines"]
    assert off["equation (1), lever arms from the lines"] < off["equation (1), lever arms from machine zero"]
    assert compared.use.name.startswith("adjustment") and compared.use.stated_mm is not None
    hours = {method.name: method.hours for method in compared.methods}
    assert hours["adjustment, all readings"] == pytest.approx(
        hours["adjustment, lines"] + hours["adjustment, pods"]
    )


def test_points_that_were_used_do_not_judge() -> None:
    _, measurements = case(0, "smooth", "FXYZ")
    check = cloud(SHOP, 9, 30, 0.5)
    used = dataclasses.replace(measurements.also([check]), machine="simulated")
    with pytest.raises(ConfigError, match="the same readings as"):
        olp.compare_methods(used, check, shop())


@pytest.mark.slow
def test_another_chain_has_no_equation_1_and_nothing_is_nothing() -> None:
    machine, measurements = case(2, "smooth", "XYFZ")
    axes = shop("XYFZ")
    check = cloud(machine, 9, 30, 0.5)
    compared = olp.compare_methods(dataclasses.replace(measurements, machine="simulated"), check, axes)
    why = compared.report["not_possible"]
    assert len(why) == 2 and all("XYFZ" in row["why"] for row in why)
    assert [m.name for m in compared.methods] == ["uncorrected", "adjustment, lines"]
    with pytest.raises(ConfigError, match="nothing to compare"):
        olp.compare_methods(Measurements("simulated", (check,)), check, axes)


@pytest.mark.slow
def test_the_command_prints_a_table_and_draws_it(tmp_path: Path) -> None:
    call = ["calibrate", "compare-methods", str(LINES), "--check", str(LINES / "tracker.csv")]
    call += ["-m", str(LINES / "machine.toml"), "--plot", str(tmp_path / "methods.svg"), "--json"]
    done = CliRunner().invoke(main, call)
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert report["schema"] == "olp-methods-1" and report["use"] == "adjustment, lines"
    rows = {row["name"]: row for row in report["methods"]}
    assert rows["uncorrected"]["residual_um"] > 25.0 and rows[report["use"]]["beyond_noise_um"] < 3.0
    assert "adjustment, lines" in (tmp_path / "methods.svg").read_text()
