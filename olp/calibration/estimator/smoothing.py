"""How smooth a curve is, where it has a kink or a step, and whether it depends on direction: by evidence.

Every choice maximises the marginal likelihood of the readings of that curve's own lines (D. J. C. MacKay,
Neural Computation 4, 1992): a rougher curve or one more feature must explain more than its freedom costs.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Literal

import numpy as np

from olp.calibration.estimator.basis import Feature, Kink, Spline, Step, Wave
from olp.calibration.estimator.normal import Block, Chunk, Normal
from olp.calibration.observations.base import Noise
from olp.calibration.observations.lines import Line, drift_ramps, targets_of
from olp.core.arrays import Array
from olp.core.values import dataclass

#: Candidates for the standard deviation of second differences (mm, rad).
ROUGHNESS = np.geomspace(1e-7, 1e-1, 37), np.geomspace(1e-10, 1e-4, 37)
#: Standard deviation of the coefficients of a curve (mm, rad).
AMPLITUDE = 0.3, 3e-4
#: Standard deviation of a step or kink (mm, rad).
FEATURE = 0.02, 20e-6
#: Standard deviation of a half difference (mm, rad).
HALF = 0.02, 20e-6
#: What one more feature must gain beyond its own cost, nats.
GAIN = 2.0
#: The same of a step where another error of the axis has one, nats.
SHARED_GAIN = 0.0
#: Nats below the best evidence at which a roughness is excluded: odds of 20 to 1.
EXCLUDED = 3.0
#: Features of a curve, at most.
MOST = 8
#: Steps and kinks are tried between so many targets at most.
FINEST = 80

Half = Literal["none", "constant", "curve"]


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """The shape of a curve from its lines: standard deviation of second differences, features, dependence on
    direction and its roughness. `roughest` is the largest roughness that the readings do not exclude."""

    roughness: float
    features: tuple[Feature, ...]
    half: Half
    half_roughness: float
    roughest: float


def shape_of(
    lines: Sequence[tuple[Line, Noise]],
    spline: Spline,
    half_spline: Spline,
    waves: Sequence[Wave] = (),
    joints: Sequence[Step] = (),
) -> Shape:
    """The shape of the curve that all these lines read, beside what repeats with `waves`. At `joints` other
    errors of the axis have a step."""
    angle = lines[0][0].quantity == "angle"
    inside = [line for line, _ in lines if np.ptp(line.target_mm) > 0.2 * (spline.high_mm - spline.low_mm)]
    targets = np.unique(np.concatenate([targets_of(line) for line in inside] or [np.zeros(0)]))
    if len(targets) > FINEST:
        targets = targets[np.unique(np.linspace(0, len(targets) - 1, FINEST).round().astype(int))]
    candidates: list[Feature] = [
        Step(float(a), float(b)) for a, b in itertools.pairwise(targets) if b - a > 1.0
    ]
    candidates += [Kink(float(start), spline.high_mm - spline.low_mm) for start in targets[1:-1]]
    two_way = all(len(np.unique(line.direction)) == 2 for line, _ in lines)
    halves = half_spline.count if two_way else 0
    m, c = spline.count, len(candidates)
    normal = Normal.of(m + c + halves)
    for line, noise in lines:
        q = line.target_mm
        table = [spline.values(q), *(f.values(q)[:, None] for f in candidates)]
        if halves:
            table.append(line.direction[:, None] * half_spline.values(q))
        normal.add(_block(np.concatenate(table, axis=1), line, noise, waves, FEATURE[angle]))
    choice = _Choice(normal, spline, angle)
    chosen: list[int] = []
    best, roughness = choice.smooth(chosen)
    while len(chosen) < MOST and c:
        rest = [i for i in range(c) if i not in chosen]
        at_joint = np.array([_is_joint(candidates[i], joints) for i in rest])
        needed = np.where(at_joint, SHARED_GAIN, GAIN + np.log(len(rest)))
        gains = choice.with_one_more(chosen, rest, roughness) - needed
        pick = int(np.argmax(gains))
        new = [*chosen, rest[pick]]
        value, rough = choice.smooth(new)
        if value - best < needed[pick]:
            break
        chosen, best, roughness = new, value, rough
    half: Half = "none"
    half_roughness = 0.0
    if halves:
        half, half_roughness = choice.direction(chosen, roughness, best, half_spline, m + c)
    features = tuple(candidates[i] for i in sorted(chosen))
    return Shape(roughness, features, half, half_roughness, choice.roughest(chosen))


def _is_joint(feature: Feature, joints: Sequence[Step]) -> bool:
    return isinstance(feature, Step) and any(
        feature.low_mm < joint.high_mm and joint.low_mm < feature.high_mm for joint in joints
    )


def _block(rows: Array, line: Line, noise: Noise, waves: Sequence[Wave], amplitude: float) -> Block:
    """As `lines.line_block`, for one curve alone: its level and slope belong to the line."""
    n = len(line.value)
    local = [np.ones(n)]
    precision = [0.0]
    if line.quantity == "straightness":
        local.append((line.target_mm - line.target_mm.mean()) / 1000.0)
        precision.append(0.0)
    for wave in waves:
        local += list(wave.values(line.target_mm).T)
        precision += [1.0 / amplitude**2] * 2
    if noise.drift > 0.0:
        ramps = drift_ramps(line)
        local += list(ramps.T)
        precision += [1.0 / noise.drift**2] * ramps.shape[1]
    chunk = Chunk(rows, line.value, np.full(n, noise.sigma), np.stack(local, axis=1))
    return Block.of(chunk, np.arange(rows.shape[1]), np.array(precision))


class _Choice:
    """Evidence of subsets of columns: splines first, then candidates, then halves."""

    def __init__(self, normal: Normal, spline: Spline, angle: bool) -> None:
        self.normal = normal
        self.spline = spline
        self.roughness = ROUGHNESS[angle]
        self.amplitude = AMPLITUDE[angle]
        self.feature = FEATURE[angle]
        self.half = HALF[angle]
        self.penalty = spline.roughness()
        self.eigen = np.maximum(np.linalg.eigvalsh(self.penalty), 0.0)

    def smooth(self, chosen: Sequence[int]) -> tuple[float, float]:
        """Best evidence and its roughness."""
        values = self._values([chosen] * len(self.roughness), self.roughness)
        k = int(np.argmax(values))
        return float(values[k]), float(self.roughness[k])

    def roughest(self, chosen: Sequence[int]) -> float:
        """The largest roughness whose evidence is not much below the best."""
        values = self._values([chosen] * len(self.roughness), self.roughness)
        return float(self.roughness[np.flatnonzero(values > values.max() - EXCLUDED)[-1]])

    def with_one_more(self, chosen: Sequence[int], rest: Sequence[int], roughness: float) -> Array:
        """(len(rest),) best evidence with each of `rest` in addition, at this roughness or a lower one."""
        tries = [roughness * factor for factor in (1.0, 0.3, 0.1, 0.03)]
        sets = [[*chosen, extra] for extra in rest]
        values = [self._values(sets, np.full(len(sets), rough)) for rough in tries]
        return np.asarray(np.max(values, axis=0))

    def direction(
        self, chosen: Sequence[int], roughness: float, plain: float, half: Spline, start: int
    ) -> tuple[Half, float]:
        """Whether the half difference is zero, constant or a curve."""
        base = [*range(self.spline.count), *(self.spline.count + i for i in chosen)]
        prior = self._prior(len(chosen), np.array([roughness]))[0]
        columns = [*base, *range(start, start + half.count)]
        H = self.normal.H[np.ix_(columns, columns)]
        g = self.normal.g[columns]
        k = len(base)
        one = np.zeros((len(columns), k + 1))
        one[:k, :k] = np.eye(k)
        one[k:, k] = 1.0
        flat = np.zeros((k + 1, k + 1))
        flat[:k, :k] = prior
        flat[k, k] = 1.0 / self.half**2
        constant = _evidence(one.T @ H @ one, one.T @ g, self.normal.square, flat)
        penalty = half.roughness()
        full = []
        for rough in self.roughness:
            whole = np.zeros(H.shape)
            whole[:k, :k] = prior
            whole[k:, k:] = penalty / rough**2 + np.eye(half.count) / self.half**2
            full.append(_evidence(H, g, self.normal.square, whole))
        best = int(np.argmax(full))
        if full[best] > max(constant, plain) + GAIN:
            return "curve", float(self.roughness[best])
        return ("constant", 0.0) if constant > plain + GAIN else ("none", 0.0)

    def _prior(self, features: int, roughness: Array) -> Array:
        """(r, k, k) precisions."""
        m = self.spline.count
        precision = np.zeros((len(roughness), m + features, m + features))
        precision[:, :m, :m] = self.penalty / roughness[:, None, None] ** 2 + np.eye(m) / self.amplitude**2
        precision[:, m:, m:] = np.eye(features) / self.feature**2
        return precision

    def _values(self, sets: Sequence[Sequence[int]], roughness: Array) -> Array:
        """(r,) evidences of one set of features each, all of one size."""
        m = self.spline.count
        index = np.array([[*range(m), *(m + i for i in chosen)] for chosen in sets])
        H = self.normal.H[index[:, :, None], index[:, None, :]]
        g = self.normal.g[index]
        features = index.shape[1] - m
        A = H + self._prior(features, roughness)
        scale = np.sqrt(np.diagonal(A, axis1=1, axis2=2))
        scaled = A / (scale[:, :, None] * scale[:, None, :]) + 1e-13 * np.eye(A.shape[1])
        factor = np.linalg.cholesky(scaled)
        half = np.linalg.solve(factor, (g / scale)[:, :, None])[:, :, 0]
        logdet = 2.0 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1) + 2.0 * np.log(scale).sum(
            axis=1
        )
        prior = np.log(self.eigen[None, :] / roughness[:, None] ** 2 + 1.0 / self.amplitude**2).sum(axis=1)
        prior = prior - 2.0 * features * np.log(self.feature)
        return np.asarray(-0.5 * (self.normal.square - (half**2).sum(axis=1)) - 0.5 * logdet + 0.5 * prior)


def _evidence(H: Array, g: Array, square: float, prior: Array) -> float:
    A = H + prior
    _, logdet = np.linalg.slogdet(A)
    _, before = np.linalg.slogdet(prior)
    return float(-0.5 * (square - g @ np.linalg.solve(A, g)) - 0.5 * logdet + 0.5 * before)
