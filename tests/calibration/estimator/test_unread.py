"""Curves without lines: their character by evidence, and what their cells hide as noise and uncertainty."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from cases import volumetric
from cases.calibration import FRESH, measurements_of
from judge import families, simulated

from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.basis import RIPPLE, Scales, Spline
from olp.calibration.estimator.between import beside_cells, in_cells
from olp.calibration.estimator.character import USUAL, candidates, of_others, rms_of_processes
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.normal import Block, Chunk, Normal, evidence
from olp.calibration.estimator.unread import STRAIGHT
from olp.calibration.observations.points import Points, PointsState

#: mm per um.
UM = 1e-3


def fitted_to(family: str, mixture: str, seed: int = 0) -> tuple[simulated.Machine, Fit]:
    machine = families.machine(seed, family)
    readings = volumetric.readings(machine, mixture, seed)
    return machine, fit(readings, machine.chain, datum_mm=(0.0, 0.0, 0.0))


def ripple_of(fitted: Fit, kind: str) -> float:
    """Root mean square in mm of positioning."""
    return fitted.prior.classes[kind][1].ripple * float(rms_of_processes()[RIPPLE]) / USUAL[kind]


def test_lengths_tell_waves_of_screws_from_smooth_curves_and_bands_cover_both() -> None:
    for family, least, most in (("smooth", 0.0, 0.3 * UM), ("screws", 2.0 * UM, 5.0 * UM)):
        machine, fitted = fitted_to(family, "stations")
        assert least <= ripple_of(fitted, "angle") < most
        # sizes are those of machines, too, though bows of any size fit as well
        assert 6.0 * UM < fitted.prior.classes["straightness"][0] / STRAIGHT["straightness"] / 0.4 < 40.0 * UM
        position, tool = np.random.default_rng(3).uniform(*machine.box.T, (200, 3)), np.array(FRESH[1])
        off = np.abs(fitted.error(position, tool) - machine.error(position, tool))
        sigma = fitted.sigma(position, tool)
        assert np.mean(off <= 2.0 * sigma) > 0.9
        assert sigma.mean() < 2.0 * np.sqrt(np.mean(off**2))


def test_lengths_deny_ripple_of_curves_with_lines_too() -> None:
    """Three lines with eight targets cannot: of them alone, ripple stays in the uncertainty."""
    _, fitted = fitted_to("smooth", "few8+stations")
    machine = families.machine(0, "smooth")
    lines = volumetric.readings(machine, "few8+stations", 0).lines
    alone = fit(measurements_of(()).also(lines), machine.chain, travel_mm=simulated.BOX)
    for name in ("EXX", "EYX", "EYY"):
        ripple = [one.prior.shapes[name].scales.ripple for one in (fitted, alone)]
        assert ripple[0] < 0.2 * ripple[1]
        hidden = [one.prior.hidden[name].variance.mean() for one in (fitted, alone)]
        assert hidden[0] < 0.3 * hidden[1]


def test_what_cells_hide_of_steps_is_what_no_spline_of_theirs_fits() -> None:
    """A value that wanders, drawn at many positions: splines that stand for it are somewhat smoother. Of
    ripple it is three quarters."""
    rng = np.random.default_rng(2)
    spline, q = Spline(0.0, 1.0, 16), np.linspace(0.0, 1.0, 3001)
    walks = np.cumsum(rng.normal(size=(400, len(q))), axis=1)
    walks -= walks.mean(axis=1)[:, None]
    table = spline.values(q)
    rest = walks.T - table @ np.linalg.lstsq(table, walks.T)[0]
    # of what is not a straight line, as `Scales` count it
    line = np.vander(q, 2)
    bent = walks.T - line @ np.linalg.lstsq(line, walks.T)[0]
    steps = Scales(0.0, 0.0, 1.0 / float(rms_of_processes()[2]), 0.0)
    share = float(beside_cells(spline, steps).variance[0])
    drawn = np.mean(rest**2) / np.mean(bent**2)
    assert 0.4 * drawn < share < 1.1 * drawn
    ripple = Scales(0.0, 0.0, 0.0, 1.0 / float(rms_of_processes()[RIPPLE]))
    kept = (in_cells(ripple).ripple / ripple.ripple) ** 2
    assert beside_cells(spline, ripple).variance[0] + kept == pytest.approx(1.0, rel=0.05)


def test_readings_at_one_position_do_not_average_what_is_hidden_there() -> None:
    """Ten readings of a place say no more of the places beside it than the hidden variance lets them, and
    differ from each other by their noise alone: as the dense Gaussian has it."""
    _, fitted = fitted_to("screws", "points")
    place = np.array([[900.0, 700.0, -300.0]])
    position = np.concatenate((place + np.arange(4)[:, None], np.tile(place, (10, 1))))
    state = PointsState(Points(position, np.zeros(3), position, UM, known_frame=True))
    (chunk,) = fitted.block(state).chunks()
    assert chunk.beside is not None and chunk.beside.min() > 0.5 * UM
    place_of = np.repeat([0, 1, 2, 3, *([0] * 10)], 3) * 3 + np.tile(np.arange(3), 14)
    # noise differs from reading to reading, too
    chunk = dataclasses.replace(chunk, sigma=UM * np.linspace(0.5, 2.0, len(place_of)))
    common = (place_of[:, None] == place_of) * np.outer(chunk.beside, chunk.beside)
    whole = np.diag(chunk.sigma**2) + common
    root = chunk.standardised(np.eye(len(whole)))
    assert root.T @ root @ whole == pytest.approx(np.eye(len(whole)), abs=1e-9)
    assert chunk.log_sigma == pytest.approx(0.5 * np.linalg.slogdet(whole)[1])


def test_readings_of_one_place_that_contradict_each_other_are_no_ripple() -> None:
    """A tracker that was moved by 30 um between two rounds of the same points, with no line beside it."""
    machine = families.machine(0, "smooth")
    first = volumetric.readings(machine, "points", 0).observations[0]
    assert isinstance(first, Points)
    moved = dataclasses.replace(
        first, axis_mm=np.tile(first.axis_mm, (2, 1)), row=np.arange(2 * len(first.axis_mm)),
        tool_mm=np.tile(np.broadcast_to(first.tool_mm, first.axis_mm.shape), (2, 1)),
        measured_mm=np.concatenate((first.measured_mm, first.measured_mm + np.array([0.03, 0.0, 0.0]))),
    )  # fmt: skip
    fitted = fit(measurements_of(()).also((moved,)), machine.chain)
    assert fitted.chi_square > 3.0 * fitted.freedom


def test_the_evidence_counts_the_size_of_noise() -> None:
    """Noise of two sizes, with an unknown of the block alone: as of the dense Gaussian."""
    rng = np.random.default_rng(5)
    rows, local, y = rng.normal(size=(12, 3)), rng.normal(size=(12, 2)), rng.normal(size=12)
    found, dense = [], []
    for size in (0.4, 1.7):
        sigma = size * np.linspace(0.5, 1.0, 12)
        normal = Normal.of(3)
        normal.add(Block.of(Chunk(rows, y, sigma, local), np.arange(3), np.full(2, 4.0)))
        found.append(evidence(normal, np.eye(3), 0.0))
        whole = rows @ rows.T + 0.25 * local @ local.T + np.diag(sigma**2)
        dense.append(-0.5 * (np.linalg.slogdet(whole)[1] + y @ np.linalg.solve(whole, y)))
    assert found[1] - found[0] == pytest.approx(dense[1] - dense[0], abs=1e-9)


def test_curves_without_lines_are_expected_like_those_with_lines() -> None:
    """Eight angles of lines show next to no ripple: the ninth is expected to have none; alone it may."""
    ripple = candidates("angle")[:, RIPPLE]
    quiet = {f"E{d}{a}": np.where(ripple < 2e-7, 0.0, -30.0) for d in "ABC" for a in "XYZ" if d + a != "CZ"}
    shown, before = of_others(quiet)["angle"], of_others({})["angle"]
    assert shown.sum(axis=(0, 1, 2))[0] > 0.8
    assert before.sum(axis=(0, 1, 2))[0] < 0.3
