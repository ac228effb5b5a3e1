"""Instruments that read all over a machine's volume, and mixtures of them with lines, by name: simulated
readings of machines of tests/judge/families.py."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator

import numpy as np
from cases.calibration import cloud, line_of, measurements_of, rays, two_pods
from judge import simulated

from olp.calibration.observations.artefact import Artefact
from olp.calibration.observations.base import Observation
from olp.calibration.observations.circles import Circles
from olp.calibration.observations.diagonals import Diagonal
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.pods import Pods
from olp.calibration.observations.points import polar_points

Readings = Iterator[Observation]
#: Where three theodolites stand, mm.
THEODOLITES = ((-1500.0, -2500.0, 200.0), (4500.0, -2500.0, 0.0), (1500.0, 5000.0, 400.0))
#: Standard deviation of a direction of a theodolite, rad.
THEODOLITE = 3e-6
#: Where a laser tracker stands, mm.
TRACKER = (-1200.0, 900.0, 100.0)
#: Standard deviations of its distances (mm) and angles (rad).
TRACKER_SIGMA = 1e-3, 3e-6
#: Standard deviation of a touched centre of a ball and of a certificate, mm.
BALL_SIGMA = 1e-3, 0.8e-3
#: Poses of a plate.
POSES = 12
#: Middle of circles, mm.
MIDDLE = (1500.0, 1000.0, -500.0)


def points(machine: simulated.Machine, seed: int) -> Readings:
    yield cloud(machine, seed, 120, 5.0)


def tracker(machine: simulated.Machine, seed: int) -> Readings:
    """Distances and angles of 150 points."""
    axis_mm, tool, distance, *angles = simulated.polar(machine, seed, 150, TRACKER)
    rng = np.random.default_rng([seed, 43])
    along, across = TRACKER_SIGMA
    seen = [angle + rng.normal(0.0, across, len(angle)) for angle in angles]
    distance = distance + rng.normal(0.0, along, len(distance))
    yield polar_points(
        axis_mm, tool, distance, *seen, sigma_mm=np.array(along), sigma_rad=across, source="tracker.csv"
    )


def stations(machine: simulated.Machine, seed: int) -> Readings:
    yield from rays(machine, seed, 6, 150)


def pods(machine: simulated.Machine, seed: int) -> Readings:
    yield two_pods(machine, seed, 250)


def theodolites(machine: simulated.Machine, seed: int) -> Readings:
    """Three, whose distances are known within 20 um, and 100 points."""
    places = np.array(THEODOLITES)
    taken = simulated.directions(machine, seed, 100, places, THEODOLITE)
    apart = {(i, j): float(np.linalg.norm(places[j] - places[i])) for i, j in ((0, 1), (0, 2), (1, 2))}
    pairs = [(i, j, length, 0.02) for (i, j), length in apart.items()]
    yield Pods(*taken, THEODOLITE, tuple(pairs), "theodolites.csv")


def artefacts(machine: simulated.Machine, seed: int) -> Readings:
    """A plate of 36 balls with a certificate in twelve poses, each with one of three probes."""
    rng = np.random.default_rng([seed, 47])
    side = np.linspace(0.0, 800.0, 6)
    drawn = np.array([(x, y, 0.0) for x in side for y in side])
    true = drawn + rng.normal(0.0, BALL_SIGMA[1], drawn.shape)
    share = np.stack([rng.permutation(np.linspace(0.0, 1.0, POSES)) for _ in range(3)], axis=1)
    low, high = machine.box.T
    stops, probes, balls, poses = [], [], [], []
    for k in range(POSES):
        vector = np.array(simulated.OFFSETS[k % 3])
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        place = (true - true.mean(axis=0)) @ turn.T + low + share[k] * (high - low)
        # the outer poses touch the ends of the axes, so that readings span them
        place += np.where(share[k] == 0.0, low - place.min(axis=0), 0.0)
        place += np.where(share[k] == 1.0, high - place.max(axis=0), 0.0)
        use = np.flatnonzero(((place >= low - 1e-6) & (place <= high + 1e-6)).all(axis=1))
        stop = place[use]
        for _ in range(6):
            stop = place[use] - machine.error(stop, vector)
        stops.append(stop + rng.normal(0.0, BALL_SIGMA[0], stop.shape))
        probes.append(np.tile(vector, (len(use), 1)))
        balls.append(use)
        poses.append(np.full(len(use), k))
    yield Artefact(
        np.concatenate(stops), np.concatenate(probes), np.concatenate(balls), np.concatenate(poses), drawn,
        np.full(len(drawn), BALL_SIGMA[1]), BALL_SIGMA[0], "plate.csv",
    )  # fmt: skip


def diagonals(machine: simulated.Machine, seed: int) -> Readings:
    """The four body diagonals and two of faces."""
    low, high = machine.box.T
    for k, side in enumerate(((1, 1, 1), (1, 0, 1), (0, 1, 1), (0, 0, 1), (1, 1, 0), (0, 1, 0))):
        start, end = np.where(side, low, high), np.where(side, high, low)
        if not side[2]:
            start[2] = end[2] = MIDDLE[2]
        a, b = tuple(start.tolist()), tuple(end.tolist())
        columns = simulated.diagonal(machine, seed, a, b, simulated.TOOL)
        yield Diagonal(a, b, *columns, simulated.TOOL, source=f"diagonal-{k}.csv")


def ballbars(machine: simulated.Machine, seed: int) -> Readings:
    """Circles in three planes."""
    for plane in ("XY", "YZ", "ZX"):
        angle, value, run, direction = simulated.circles(machine, seed, plane, MIDDLE, 300.0, simulated.TOOL)
        yield Circles(
            plane, 300.0, MIDDLE, angle, value, run, direction, simulated.TOOL, sigma=2e-4,
            source=f"circle-{plane.lower()}.csv",
        )  # fmt: skip


INSTRUMENTS: dict[str, Callable[[simulated.Machine, int], Readings]] = {
    f.__name__: f for f in (points, tracker, stations, pods, theodolites, artefacts, diagonals, ballbars)
}
#: Lines with so many targets, and further instruments. Below zero only EXX, EYX and EYY have lines.
MIXTURES: dict[str, tuple[int, tuple[str, ...]]] = {
    **{name: (0, (name,)) for name in INSTRUMENTS if name not in ("diagonals", "ballbars")},
    "lines3": (3, ()),
    "lines8": (8, ()),
    "lines5+points": (5, ("points",)),
    "lines5+diagonals": (5, ("diagonals",)),
    "lines5+ballbars": (5, ("ballbars",)),
    "few8+pods": (-8, ("pods",)),
    "few8+stations": (-8, ("stations",)),
}


def readings(machine: simulated.Machine, mixture: str, seed: int) -> Measurements:
    """What a mixture reads of a machine."""
    count, names = MIXTURES[mixture]
    lines = simulated.all_lines(machine, seed, count=(abs(count),) * 3) if count else []
    if count < 0:
        few = ("EXX", "EYX", "EYY")
        lines = [dataclasses.replace(line, square=None) for line in lines if line.component in few]
    taken = measurements_of(lines)
    more = [one for name in names for one in INSTRUMENTS[name](machine, seed)]
    return dataclasses.replace(taken, observations=(*map(line_of, lines), *more), chain=machine.chain)
