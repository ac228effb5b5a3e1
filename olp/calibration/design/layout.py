"""Where to measure: targets of lines, points, stations; as measurements with nominal readings."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from olp.calibration.design.prediction import Planned
from olp.calibration.iso230.separation import aliased
from olp.calibration.observations.base import Noise
from olp.calibration.observations.lengths import Lengths, LengthsState, Station
from olp.calibration.observations.lines import Line, LineState
from olp.calibration.observations.pods import Pods, PodsState, Pose
from olp.calibration.observations.points import Points, PointsState
from olp.calibration.observations.references import Square
from olp.core.arrays import Array
from olp.core.errors import CannotCompute
from olp.core.machine import Vector
from olp.core.units import AXES

#: Distance between the targets of a line, mm.
STEP_MM = 100.0
#: Targets of a line, at least.
FEWEST = 11
#: Runs of a line, each in both directions.
RUNS = 5
#: Targets are off equal steps by a random part of this (mm) where no period is stated.
PITCH_MM = 10.0
#: Noise of a laser reading, mm.
LASER = 0.5e-3
#: Noise of a laser reading that grows with the distance, mm/mm.
LASER_SCALE = 0.5e-6
#: Noise of an angle reading, rad.
ANGLE = 1e-6
#: Standard uncertainty of the error of a square, rad.
SQUARE = 5e-6
#: Second offset of the reflector for roll of the vertical axis, mm.
ASIDE_MM = 150.0
#: Noise of a length of a tracking interferometer, mm.
LENGTH = 0.2e-3
#: Noise of such a length that grows with it, mm/mm.
LENGTH_SCALE = 0.3e-6
#: Noise of an angle of a pod, rad.
POD = 10e-6
#: Standard uncertainty of the known distance between two pods, mm.
BASELINE = 0.01
#: Stations are so far off the box, as a share of its longest side.
_OFF = 0.4
#: Random sets of targets that are tried.
_TRIES = 40
#: Drift of a line over one run, as a share of the noise of a reading.
_DRIFT = 0.5


def hypercube(box_mm: Array, n: int, seed: int) -> Array:
    """(n, 3) axis positions of a Latin hypercube in a box (3, 2), to a tenth of a millimetre: as many levels
    of each axis as points, unlike a lattice (M. D. McKay, R. J. Beckman, W. J. Conover, 1979)."""
    from scipy.stats import qmc

    share = qmc.LatinHypercube(3, seed=seed).random(n)
    inside = np.clip(np.round(box_mm[:, 0] + share * np.ptp(box_mm, axis=1), 1), box_mm[:, 0], box_mm[:, 1])
    return np.asarray(inside)


def points(machine: str, box_mm: Array, tools: Sequence[Vector], n: int, sigma: float, seed: int) -> Planned:
    """Points of a tracker with each tool vector in turn."""
    axis, tool = scattered(box_mm, tools, n, seed)
    return Planned(machine, (PointsState(Points(axis, tool, axis + tool, sigma, source="points")),))


def lengths(
    machine: str, box_mm: Array, tools: Sequence[Vector], n: int, stations: int, sigma: float, seed: int
) -> Planned:
    """Lengths from stations around the box, one after the other, with n points each."""
    axis, tool = scattered(box_mm, tools, n, seed)
    return lengths_from(machine, axis, tool, around(box_mm, stations), sigma)


def lengths_from(machine: str, axis: Array, tool: Array, places: Array, sigma: float) -> Planned:
    """Lengths from stations at places (n, 3) to the same points."""
    rays = []
    for k, place in enumerate(places):
        distance = np.linalg.norm(axis + tool - place, axis=1)
        read = Lengths(axis, tool, distance, sigma + LENGTH_SCALE * distance, source=f"station {k + 1}")
        rays.append(LengthsState(read, Station(place, 0.0)))
    return Planned(machine, tuple(rays))


def pods(machine: str, box_mm: Array, tools: Sequence[Vector], n: int, sigma: float, seed: int) -> Planned:
    """Directions from two pods in front of the longest side of the box, with their distance known."""
    axis, tool = scattered(box_mm, tools, n, seed)
    long = int(np.argmax(np.ptp(box_mm[:2], axis=1)))
    across = 1 - long
    size = float(np.ptp(box_mm, axis=1).max())
    middle = box_mm.mean(axis=1)
    poses, azimuth, elevation = [], [], []
    for side in (-0.5, 0.5):
        place = middle.copy()
        place[long] += side * size
        place[across] = box_mm[across, 0] - _OFF * size
        ray = axis + tool - place
        poses.append(Pose(place, np.eye(3)))
        azimuth.append(np.arctan2(ray[:, 1], ray[:, 0]))
        elevation.append(np.arctan2(ray[:, 2], np.hypot(ray[:, 0], ray[:, 1])))
    directions = Pods(
        axis, tool, np.stack(azimuth, axis=1), np.stack(elevation, axis=1), sigma,
        ((0, 1, size, BASELINE),), "pods",
    )  # fmt: skip
    return Planned(machine, (PodsState(directions, tuple(poses)),))


def lines(
    machine: str, box_mm: Array, tool: Vector, periods_mm: Sequence[Sequence[float]], seed: int
) -> Planned:
    """A full set along the middle of the box: positioning, angles, straightness pairs that share a square,
    and straightness of Z with the reflector at a second offset. Roll of Z is left out, as a level cannot read
    it."""
    middle = np.round(box_mm.mean(axis=1), 1)
    place = (float(middle[0]), float(middle[1]), float(middle[2]))
    targets = [line_targets(box_mm[k], periods_mm[k], seed + k) for k in range(3)]
    states: list[LineState] = []

    def add(name: str, square: str | None = None, reflector: Vector = tool) -> None:
        q = targets[AXES.index(name[2])]
        states.append(line(name, q, place, reflector, box_mm, square, f"{name.lower()}.csv"))

    for a in AXES:
        add(f"E{a}{a}")
        for d in "ABC":
            if (d, a) != ("C", "Z"):
                add(f"E{d}{a}")
    for a, b in itertools.combinations(AXES, 2):
        add(f"E{b}{a}", f"square {a}{b}")
        add(f"E{a}{b}", f"square {a}{b}")
    add("EYZ", "square YZ", (tool[0] + ASIDE_MM, tool[1], tool[2]))
    squares = tuple(Square(f"square {a}{b}", 0.0, SQUARE) for a, b in itertools.combinations(AXES, 2))
    x, y, z = (tuple(map(float, p)) for p in periods_mm)
    return Planned(machine, tuple(states), squares, (x, y, z))


def line(
    name: str, targets_mm: Array, place_mm: Vector, tool: Vector, box_mm: Array, square: str | None,
    source: str,
) -> LineState:  # fmt: skip
    """A line of a component in runs of both directions, with the noise of its instrument."""
    both_ways = np.concatenate([targets_mm, targets_mm[::-1]])
    n = len(both_ways)
    sigma = line_sigma(name, box_mm)
    taken = Line(
        name,
        np.tile(both_ways, RUNS),
        np.zeros(n * RUNS),
        np.repeat(np.arange(1, RUNS + 1), n),
        np.tile(np.repeat([1, -1], len(targets_mm)), RUNS),
        place_mm,
        tool,
        square=square,
        sigma=sigma,
        sigma_scale=LASER_SCALE if name[1] == name[2] else 0.0,
        source=source,
    )
    return LineState(taken, Noise(sigma, _DRIFT * sigma, None))


def line_sigma(name: str, box_mm: Array) -> float:
    """Noise of a reading of a component along its axis of the box, mm or rad."""
    if name[1] in "ABC":
        return ANGLE
    half = 0.5 * float(np.ptp(box_mm[AXES.index(name[2])]))
    return LASER if name[1] == name[2] else LASER + LASER_SCALE * half


def together(first: Planned, second: Planned) -> Planned:
    """Lines of the one with the points of the other."""
    return dataclasses.replace(first, states=(*first.states, *second.states))


def scattered(box_mm: Array, tools: Sequence[Vector], n: int, seed: int) -> tuple[Array, Array]:
    """(n, 3) axis positions of a hypercube, and (n, 3) the tools in turn."""
    return hypercube(box_mm, n, seed), np.array(tools, float)[np.arange(n) % len(tools)]


def around(box_mm: Array, stations: int) -> Array:
    """(stations, 3) positions around the box, at several heights: a golden spiral about its middle."""
    middle, side = box_mm.mean(axis=1), np.ptp(box_mm, axis=1)
    k = np.arange(stations)
    angle = 2.399963 * k + 0.4
    height = ((k * 0.618034) % 1.0) - 0.5
    reach = (0.5 + _OFF) * float(side.max())
    return np.stack(
        [middle[0] + reach * np.cos(angle), middle[1] + reach * np.sin(angle), middle[2] + height * side[2]],
        axis=1,
    )


def line_targets(side: Array, periods_mm: Sequence[float], seed: int) -> Array:
    """Targets off equal steps by random parts of a period, as ISO 230-2 asks, at which every period is
    observable. Raises CannotCompute where there are none."""
    low, high = side.tolist()
    count = max(FEWEST, int((high - low) / STEP_MM) + 1)
    step = (high - low) / (count - 1)
    stray = min(0.4 * step, max([*periods_mm, 0.0]) or PITCH_MM)
    for attempt in range(_TRIES):
        rng = np.random.default_rng([seed, attempt])
        q = np.linspace(low, high, count)
        q[1:-1] += rng.uniform(-0.5, 0.5, count - 2) * stray
        q = np.round(q, 2)
        if all(aliased(q, period) is None for period in periods_mm):
            return np.asarray(q, float)
    raise CannotCompute(
        f"no targets between {low:g} and {high:g} mm separate errors with a period of "
        f"{', '.join(f'{p:g}' for p in periods_mm)} mm from smooth ones; leave the period out here, and add "
        "a fine sweep over two periods"
    )
