"""Readings that each registered instrument would take of a machine whose errors are a function of axis
positions (n, 3) and tool vectors, worked out from what the instrument measures and from nothing else. What
only the instrument knows (a zero, a centre, where it stands) is in the readings too."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from olp.calibration.observations.artefact import Artefact
from olp.calibration.observations.base import Observation
from olp.calibration.observations.circles import PLANES, Circles
from olp.calibration.observations.diagonals import Diagonal
from olp.calibration.observations.lengths import Lengths
from olp.calibration.observations.lines import Line
from olp.calibration.observations.pods import Pods
from olp.calibration.observations.points import Points, polar_points
from olp.calibration.observations.squareness import SquarenessReading

Error = Callable[[np.ndarray, np.ndarray], np.ndarray]
Readings = tuple[Observation, ...]

BOX = ((0.0, 1000.0), (0.0, 800.0), (-500.0, 0.0))
DATUM = (500.0, 400.0, -250.0)
TOOL = (0.0, 0.0, -100.0)
TOOLS = np.array([TOOL, (80.0, 0.0, -150.0), (0.0, 90.0, -60.0)])
N = 60


def places() -> tuple[np.ndarray, np.ndarray]:
    low, high = np.array(BOX).T
    axis_mm = np.random.default_rng(7).uniform(low, high, (N, 3)).round(1)
    return axis_mm, TOOLS[np.arange(N) % len(TOOLS)]


def lines(error: Error) -> Readings:
    """Positioning, straightness, and pitch from two offsets of the reflector; three runs, both directions."""
    there = np.linspace(0.0, 1000.0, 11)
    q = np.tile(np.concatenate([there, there[::-1]]), 3)
    run, side = np.repeat([1, 2, 3], 22), np.tile(np.repeat([1, -1], 11), 3)
    axis_mm = np.tile(np.array(DATUM), (len(q), 1))
    axis_mm[:, 0] = q
    tool, higher = np.array(TOOL), np.add(TOOL, (0.0, 0.0, 1000.0))
    plain = error(axis_mm, tool)
    values = {
        "EXX": plain[:, 0] + 0.02,
        "EYX": plain[:, 1] - 0.03 + 2e-5 * q,
        "EBX": (error(axis_mm, higher) - plain)[:, 0] / 1000.0,
    }
    return tuple(
        Line(
            name, q, value, run, side, DATUM, TOOL, sigma=1e-7 if name[1] in "ABC" else 1e-4,
            source=f"{name.lower()}.csv",
        )
        for name, value in values.items()
    )  # fmt: skip


def points(error: Error) -> Readings:
    axis_mm, tool = places()
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    seen = (axis_mm + tool + error(axis_mm, tool)) @ turn.T + (1000.0, -2000.0, 300.0)
    return (Points(axis_mm, tool, seen, 0.5e-3, source="points.csv"),)


def _rays(error: Error, place: tuple[float, float, float]) -> tuple[np.ndarray, ...]:
    axis_mm, tool = places()
    ray = axis_mm + tool + error(axis_mm, tool) - np.array(place)
    return axis_mm, tool, ray


def polar(error: Error) -> Readings:
    axis_mm, tool, ray = _rays(error, (-700.0, -1800.0, 200.0))
    azimuth, elevation = (
        np.arctan2(ray[:, 1], ray[:, 0]),
        np.arctan2(ray[:, 2], np.hypot(ray[:, 0], ray[:, 1])),
    )
    distance = np.linalg.norm(ray, axis=1)
    return (
        polar_points(
            axis_mm,
            tool,
            distance,
            azimuth,
            elevation,
            sigma_mm=np.array(0.5e-3),
            sigma_rad=0.5e-6,
            source="polar.csv",
        ),
    )


def artefacts(error: Error) -> Readings:
    """A plate of 12 balls in four poses; one ball is 0.2 mm from where its drawing says."""
    grid = np.array([(x, y, 0.0) for x in (0.0, 130.0, 260.0, 390.0) for y in (0.0, 150.0, 300.0)])
    drawn = grid.copy()
    drawn[5] += (0.2, -0.1, 0.05)
    axis_mm, ball, pose = [], [], []
    for k, (angle, shift) in enumerate(
        [(0, (150, 150)), (90, (700, 120)), (180, (800, 600)), (0, (450, 320))]
    ):
        c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        turned = grid @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T
        stop = place = turned + np.array([*shift, -200.0 - 40.0 * k]) - np.array(TOOL)
        for _ in range(8):
            stop = place - error(stop, np.array(TOOL))
        axis_mm.append(stop)
        ball.append(np.arange(len(grid)))
        pose.append(np.full(len(grid), k + 1))
    return (
        Artefact(
            np.concatenate(axis_mm), TOOL, np.concatenate(ball), np.concatenate(pose), drawn,
            np.zeros(len(drawn)), 1e-4, "artefact.csv",
        ),
    )  # fmt: skip


def stations(error: Error) -> Readings:
    measurements = []
    for k, place in enumerate([(-700.0, -900.0, 100.0), (1800.0, -600.0, -400.0)]):
        axis_mm, tool, ray = _rays(error, place)
        length = np.linalg.norm(ray, axis=1)
        sigma = 0.1e-3 + 0.1e-6 * length
        measurements.append(Lengths(axis_mm, tool, length - 100.0, sigma, source=f"station {k + 1}"))
    return tuple(measurements)


def pods(error: Error) -> Readings:
    stands = [(-300.0, -1200.0, -300.0), (1300.0, -1200.0, -300.0)]
    azimuth, elevation = [], []
    for place in stands:
        axis_mm, tool, ray = _rays(error, place)
        azimuth.append(np.arctan2(ray[:, 1], ray[:, 0]))
        elevation.append(np.arctan2(ray[:, 2], np.hypot(ray[:, 0], ray[:, 1])))
    apart = float(np.linalg.norm(np.subtract(*stands)))
    return (
        Pods(
            axis_mm,
            tool,
            np.stack(azimuth, axis=1),
            np.stack(elevation, axis=1),
            0.2e-6,
            ((0, 1, apart, 0.01),),
            "pods",
        ),
    )


def diagonals(error: Error) -> Readings:
    start, end = np.array([0.0, 0.0, -500.0]), np.array([1000.0, 800.0, 0.0])
    far = float(np.linalg.norm(end - start))
    there = np.linspace(0.0, far, 21)
    d = np.tile(np.concatenate([there, there[::-1]]), 2)
    unit = (end - start) / far
    run, side = np.repeat([1, 2], 42), np.tile(np.repeat([1, -1], 21), 2)
    value = error(start + d[:, None] * unit, np.array(TOOL)) @ unit + 0.05 + 0.002 * side
    return (Diagonal(tuple(start), tuple(end), d, value, run, side, TOOL, sigma=1e-4, source="diagonal.csv"),)


def ballbars(error: Error) -> Readings:
    angle = np.tile(np.radians(np.arange(0.0, 360.0, 4.0)), 2)
    direction = np.repeat([1, -1], 90)
    measurements = []
    for plane, (first, second, _) in PLANES.items():
        radial = np.zeros((len(angle), 3))
        radial[:, first], radial[:, second] = np.cos(angle), np.sin(angle)
        value = np.einsum("ni,ni->n", error(np.array(DATUM) + 150.0 * radial, np.array(TOOL)), radial)
        value += 0.02 + 0.003 * radial[:, first] - 0.004 * radial[:, second]
        value += 0.001 * direction * np.sin(2.0 * angle)
        run = np.ones(len(angle), int)
        measurements.append(
            Circles(
                plane, 150.0, DATUM, angle, value, run, direction, TOOL, sigma=1e-4,
                source=f"circle-{plane}.csv",
            )
        )  # fmt: skip
    return tuple(measurements)


def squareness(error: Error) -> Readings:
    """Minus the slopes of Y over X and of X over Y together: by how much Y leans to -X."""
    slopes = []
    for moving, along in ((0, 1), (1, 0)):
        q = np.linspace(*BOX[moving], 101)
        axis_mm = np.tile(np.array(DATUM), (len(q), 1))
        axis_mm[:, moving] = q
        slopes.append(np.polyfit(q - q.mean(), error(axis_mm, np.array(TOOL))[:, along], 1)[0])
    value = -float(sum(slopes))
    return (SquarenessReading("C0Y", value, DATUM, (BOX[0], BOX[1]), TOOL, 1e-7, "plan.toml"),)


#: By the key of the instrument's tables in a plan.
EXAMPLES: Mapping[str, Callable[[Error], Readings]] = {
    f.__name__: f for f in (lines, points, polar, artefacts, stations, pods, diagonals, ballbars, squareness)
}
