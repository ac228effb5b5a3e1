"""Where readings all over the volume show joints of rails: by evidence.

A joint is at one position of an axis, and any of its six errors may have a step there. So all six speak for
it together. Joints are taken one after the other, the most probable first, and each must gain more than the
choice of its place costs. Where it lies is a distribution over the gaps between readings. See
docs/background/uncertainty.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from olp.calibration.estimator.basis import Spline, Step
from olp.calibration.estimator.character import USUAL, class_of
from olp.calibration.estimator.normal import Chunk
from olp.calibration.estimator.rail_joints import STEP, Joint, Joints
from olp.calibration.estimator.unread import Readings
from olp.core.arrays import Array
from olp.core.units import AXES
from olp.core.values import dataclass

#: Steps of positioning that are tried, as standard deviations in mm.
SIZES = STEP * np.array([0.25, 0.5, 1.0, 2.0])
#: Places of an axis that are tried first.
PLACES = 60
#: Gaps between readings that are tried then, around the best of these.
FINE = 48
#: A joint is at least so wide, mm.
NARROW = 0.1
#: What one more joint must gain beyond the choice of its place, nats: a dent gains up to some, as two joints.
GAIN = 6.0
#: Pieces of a rail are at least so long, against the axis: two joints side by side are one bad reading.
SHORTEST = 0.05
#: Joints of all axes at most.
MOST = 20
#: Before any reading, half of the errors of an axis have a step at its joint: what a step costs, nats.
_HALF = math.log(2.0)
#: Width of an even distribution against its standard deviation.
_EVEN = math.sqrt(12.0)


def found(readings: Readings, known: Joints) -> Joints:
    """The `known` joints, and those that readings show beside them, of curves that no line reads."""
    prior = readings.prior
    spaces = prior.parameters.spaces
    axes = [[name for name in spaces if name[2] == axis and name not in prior.shapes] for axis in AXES]
    axes = [names for names in axes if names]
    joints, search = dict(known), _Search.of(readings)
    cost = GAIN + math.log(PLACES * max(len(axes), 1))
    for _ in range(MOST if axes else 0):
        tried = [search.best(names, spaces[names[0]].spline, joints) for names in axes]
        k = max(range(len(axes)), key=lambda k: tried[k][0])
        gain, low, high = tried[k]
        if gain < cost:
            break
        for name, joint in search.taken(axes[k], search.placed(axes[k], low, high)).items():
            joints[name] = (*joints.get(name, ()), joint)
    return joints


@dataclass(slots=True, eq=False)
class _Search:
    """Readings in standard deviations of noise, y (n,) = base (n, k) @ unknowns. `precision` (k, k) and
    `pull` (k,) are what is known of these before. Joints that are found become unknowns. `explained` (k, n)
    is a root of what unknowns explain, `rest` (n,) what they leave of y."""

    readings: Readings
    noisy: Chunk
    base: Array
    y: Array
    precision: Array
    pull: Array
    explained: Array
    rest: Array

    @classmethod
    def of(cls, readings: Readings) -> _Search:
        prior = readings.prior
        chunk, own = readings.noisy(prior.classes, prior.shapes), np.diag(readings.precision)
        table = chunk.standardised(np.concatenate([chunk.rows, chunk.local, chunk.y[:, None]], axis=1))
        precision = _beside(readings.lines.H + prior.precision()[0], own)
        pull = np.concatenate([readings.lines.g, np.zeros(len(own))])
        base, y = table[:, :-1], table[:, -1]
        return cls(readings, chunk, base, y, precision, pull, *_explained(base, y, precision, pull))

    def best(self, names: Sequence[str], spline: Spline, known: Joints) -> tuple[float, float, float]:
        """The log evidence that the best of coarse places for a joint gains, away from those that are known,
        and its sides in mm."""
        edges = np.linspace(spline.low_mm, spline.high_mm, PLACES + 1)
        gains = _steps(*self._seen(names, edges[:-1], edges[1:])[1:])[0]
        far = SHORTEST * (spline.high_mm - spline.low_mm)
        for step in {joint.step for name in names for joint in known.get(name, ())}:
            gains[(edges[1:] > step.low_mm - far) & (edges[:-1] < step.high_mm + far)] = -np.inf
        k = int(np.argmax(gains))
        return float(gains[k]), float(edges[k]), float(edges[k + 1])

    def placed(self, names: Sequence[str], low: float, high: float) -> Step:
        """A joint at or right beside a coarse place, as wide as where it may be."""
        q = np.unique(self.readings.position[:, AXES.index(names[0][2])])
        q = q[(q >= 2.0 * low - high) & (q <= 2.0 * high - low)]
        if len(q) < 3:
            return Step(low, high)
        if len(q) > FINE:
            q = q[np.unique(np.linspace(0, len(q) - 1, FINE).round().astype(int))]
        middle, gap = 0.5 * (q[1:] + q[:-1]), np.diff(q)
        gains = _steps(*self._seen(names, q[:-1], q[1:])[1:])[0]
        weight = np.exp(gains - gains.max()) * gap
        weight /= weight.sum()
        mean = float(weight @ middle)
        variance = float(weight @ ((middle - mean) ** 2 + gap**2 / 12.0))
        half = 0.5 * max(_EVEN * math.sqrt(variance), NARROW)
        return Step(mean - half, mean + half)

    def taken(self, names: Sequence[str], step: Step) -> dict[str, Joint]:
        """The joint of each curve that has a step there. From now on they are unknowns."""
        columns, G, b = self._seen(names, np.array([step.low_mm]), np.array([step.high_mm]))
        use = np.flatnonzero(_steps(G, b)[1][0])
        own = np.eye(len(use)) / STEP**2
        jump = np.linalg.solve(G[0][np.ix_(use, use)] + own, b[0, use])
        self.base = np.concatenate([self.base, columns[:, 0, use]], axis=1)
        self.precision = _beside(self.precision, own)
        self.pull = np.concatenate([self.pull, np.zeros(len(use))])
        self.explained, self.rest = _explained(self.base, self.y, self.precision, self.pull)
        return {
            names[k]: Joint(step, float(height * USUAL[class_of(names[k])]))
            for k, height in zip(use.tolist(), jump, strict=True)
        }

    def _seen(self, names: Sequence[str], low: Array, high: Array) -> tuple[Array, Array, Array]:
        """Steps of each curve between sides (p,): what readings see of them (n, p, curves), how well these
        tell them from unknowns (p, curves, curves), and their pull (p, curves)."""
        r = self.readings
        q = r.position[:, AXES.index(names[0][2])]
        step = np.clip((q[:, None] - low) / (high - low), 0.0, 1.0)
        gain = r.gain[:, [r.names.index(name) for name in names]] * [USUAL[class_of(name)] for name in names]
        table = self.noisy.standardised((step[:, :, None] * gain[:, None]).reshape(len(q), -1))
        columns = table.reshape(len(q), len(low), len(names)).transpose(1, 0, 2)
        left = (self.explained @ table).reshape(-1, len(low), len(names)).transpose(1, 0, 2)
        G = columns.transpose(0, 2, 1) @ columns - left.transpose(0, 2, 1) @ left
        return columns.transpose(1, 0, 2), G, np.einsum("pnc,n->pc", columns, self.rest)


def _explained(base: Array, y: Array, precision: Array, pull: Array) -> tuple[Array, Array]:
    """What unknowns with these columns explain of readings, as a root (k, n), and what they leave of y."""
    from scipy.linalg import solve_triangular

    inner = base.T @ base + precision
    scale = np.sqrt(np.diag(inner))
    factor = np.linalg.cholesky(inner / np.outer(scale, scale) + 1e-13 * np.eye(len(scale)))
    right = np.column_stack([base.T, base.T @ y + pull]) / scale[:, None]
    solved = np.asarray(solve_triangular(factor, right, lower=True))
    return solved[:, :-1], y - solved[:, :-1].T @ solved[:, -1]


def _steps(G: Array, b: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
    """(p,) the log evidence that joints gain, and (p, curves) which curves have a step there: one after the
    other, each of which gains more than it costs."""
    row, total, taken = np.arange(len(b)), np.zeros(len(b)), np.zeros(b.shape, bool)
    for _ in range(b.shape[1]):
        gain, size = _gains(G, b)
        k = np.argmax(np.where(taken, -np.inf, gain), axis=1)
        use = (gain[row, k] > _HALF) & ~taken[row, k]
        total += np.where(use, gain[row, k] - _HALF, 0.0)
        taken[row, k] |= use
        column = G[row, :, k]
        weight = np.where(use, 1.0 / (G[row, k, k] + size[row, k] ** -2.0), 0.0)[:, None]
        b = b - weight * column * b[row, k][:, None]
        G = G - weight[:, :, None] * column[:, :, None] * column[:, None]
    return total, taken


def _gains(G: Array, b: Array) -> tuple[Array, Array]:
    """(p, curves) the log evidence of each step alone, over all sizes, and the size that suits it best."""
    own = np.maximum(np.einsum("pii->pi", G), 0.0)
    square = SIZES[:, None, None] ** 2
    each = 0.5 * b**2 * square / (1.0 + square * own) - 0.5 * np.log1p(square * own)
    top = each.max(axis=0)
    return top + np.log(np.exp(each - top).mean(axis=0)), SIZES[np.argmax(each, axis=0)]


def _beside(one: Array, other: Array) -> Array:
    """The matrix of two blocks that nothing ties together."""
    n = len(one)
    whole = np.zeros((n + len(other),) * 2)
    whole[:n, :n], whole[n:, n:] = one, other
    return whole
