"""Waypoints that pass near singular postures and borders of reach, for random machines of every structure."""

from __future__ import annotations

import numpy as np
from cases.any_machines import Made
from judge.whole_path import Whole
from scipy.spatial.transform import Rotation

#: mm; a turn counts as its arc at this radius.
ARM = 500.0
#: Axes that lead to a singular posture, as far as they are there.
LEADING = ("J5", "J4", "J3", "J2", "L", "A", "B", "C")
#: How far beside the singular posture programs go, in deg or mm; with signs it is passed.
BESIDE = (6.0, 3.0, 1.0, 0.3, 0.05, 0.01, 0.0)
#: A posture with a smaller least singular value is singular.
SINGULAR = 0.02
STEP = 1e-3


def least_slope(judge: Whole, values: np.ndarray) -> float:
    """How well the axes move what counts: the least singular value, 1 at best."""
    here = judge.poses(values[None], False)
    columns = []
    for column, name in enumerate(judge.order):
        if not judge.file["axes"][name].get("correct", True):
            continue
        ahead = values.copy()
        ahead[column] += STEP
        there = judge.poses(ahead[None], False)
        turn = Rotation.from_matrix(there[1][0] @ here[1][0].T).as_rotvec()
        size = ARM * np.radians(STEP) if judge.whole.turning(name) else STEP
        columns.append(np.append(there[0][0] - here[0][0], ARM * turn) / size)
    slopes = np.array(columns).T
    if judge.counts == "axis":
        base = np.linalg.svd(here[1][0][:, 2:])[0][:, 1:]
        slopes = np.vstack((slopes[:3], base.T @ slopes[3:]))
    rows = {"tip": [0, 1, 2], "turn": [0, 1, 2, 5]}.get(judge.counts, list(range(len(slopes))))
    return float(np.linalg.svd(slopes[rows], compute_uv=False)[min(slopes[rows].shape) - 1])


def near(made: Made, judge: Whole, rng: np.random.Generator, count: int) -> np.ndarray | None:
    """Axis values (count + 3, k) about a singular posture, None where the structure has none in its reach."""
    if made.legs is not None:
        return _of_legs(made, rng, count)
    place = np.array([made.middle[name] for name in made.axes], float)
    names = [name for name in LEADING if name in made.axes]
    for name in rng.permutation(names):
        column = list(made.axes).index(name)
        found = _scan(judge, place, column)
        if found is not None:
            break
    else:
        return None
    reach, rows = np.array([made.reach[name] for name in made.axes]), []
    others, side = np.arange(len(reach)) != column, rng.choice([-1.0, 1.0])
    size, crosses = float(rng.choice(BESIDE)), rng.random() < 0.5
    place = place.copy()
    for number in range(count + 3):
        way = 6.0 * side * (1.0 - number / 4.0)
        beside = way if crosses else side * max(abs(way), size)
        place = place + rng.uniform(-1, 1, len(reach)) * 0.3 * reach * others
        row = place.copy()
        row[column] = found + beside + (size * 0.1 if crosses else 0.0)
        rows.append(row)
    return np.array(rows).round(3)


def _scan(judge: Whole, place: np.ndarray, column: int) -> float | None:
    """The value of an axis nearest to that of `place` at which the posture is singular."""

    def slope(value: float) -> float:
        there = place.copy()
        there[column] = value
        return least_slope(judge, there)

    grid = place[column] + np.arange(-180.0, 181.0, 5.0)
    sizes = np.array([slope(value) for value in grid])
    inner = np.flatnonzero((sizes[1:-1] <= sizes[:-2]) & (sizes[1:-1] <= sizes[2:])) + 1
    best = []
    for at in inner.tolist():
        low, high = grid[at - 1], grid[at + 1]
        for _ in range(40):
            left, right = low + (high - low) / 3, high - (high - low) / 3
            low, high = (low, right) if slope(left) < slope(right) else (left, high)
        if slope(0.5 * (low + high)) < SINGULAR:
            best.append(0.5 * (low + high))
    return min(best, key=lambda value: abs(value - place[column])) if best else None


def _of_legs(made: Made, rng: np.random.Generator, count: int) -> np.ndarray | None:
    """Toward the border of reach: legs that are flat or end, or a platform that is turned far."""
    assert made.legs is not None
    start, turn = np.array(made.start, float), np.zeros(3)
    step, spin = rng.normal(0.0, 1.0, 3), np.zeros(3)
    step /= np.linalg.norm(step)
    if made.counts == "pose" and rng.random() < 0.7:
        step, spin = 0.1 * step, np.array([0.0, 0.0, rng.choice([-1.0, 1.0])]) + rng.normal(0.0, 0.2, 3)
    far = 0.0
    for size in np.arange(0.0, 600.0, 1.0):
        shift, turned = start + size * step, turn + np.radians(0.3 * size) * spin
        with np.errstate(invalid="ignore"):
            values = made.legs(shift, Rotation.from_rotvec(turned).as_matrix())
            slopes = _slopes(made, shift, turned)
        good = np.isfinite(values).all() and np.isfinite(slopes).all()
        if not good or np.linalg.svd(slopes, compute_uv=False)[-1] < 0.02:
            break
        far = size
    rows = []
    for number in range(count + 3):
        size = far - float(rng.choice([0.0, 0.5, 2.0])) - 4.0 * max(3 - number, 0) - rng.uniform(0, 6)
        turned = turn + np.radians(0.3 * size) * spin
        rows.append(made.legs(start + size * step, Rotation.from_rotvec(turned).as_matrix()))
    values = np.array(rows)
    return values.round(3) if np.isfinite(values).all() else None


def _slopes(made: Made, shift: np.ndarray, turned: np.ndarray) -> np.ndarray:
    """How the axes move by motions of the platform, scaled to mm."""
    assert made.legs is not None
    axes, scale = (
        list(made.axes.values()),
        np.array([200.0 if a.kind == "rotary" else 1.0 for a in made.axes.values()]),
    )
    scale = np.where([axis.kind == "rotary" for axis in axes], np.radians(scale), 1.0)
    columns = []
    for k in range(6 if made.counts == "pose" else 3):
        parts = []
        for sign in (1.0, -1.0):
            move, more = shift.copy(), np.zeros(3)
            if k < 3:
                move[k] += sign * 1e-3
            else:
                more[k - 3] = sign * 1e-3 / 200.0
            turn = Rotation.from_rotvec(more) * Rotation.from_rotvec(turned)
            parts.append(made.legs(move, turn.as_matrix()) * scale)
        columns.append((parts[0] - parts[1]) / 2e-3)
    return np.array(columns).T
