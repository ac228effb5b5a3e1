"""Where a curve has a kink or a step, and whether it depends on direction: by evidence.

Every choice maximises the marginal likelihood of the readings of that curve's own lines (D. J. C. MacKay,
Neural Computation 4, 1992): one more feature must explain more than its freedom costs.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Literal

import numpy as np

from olp.calibration.estimator.basis import Feature, Kink, Scales, Spline, Step, Wave
from olp.calibration.estimator.between import Hidden
from olp.calibration.estimator.character import Evidence, candidates, characters, class_of, expected, fewer
from olp.calibration.estimator.normal import Block, Chunk, Normal
from olp.calibration.observations.base import Noise
from olp.calibration.observations.lines import Line, drift_ramps, targets_of
from olp.calibration.observations.sensors import own_columns, per_kelvin
from olp.core.arrays import Array
from olp.core.values import dataclass

#: Candidates for the standard deviation of second differences of a half difference (mm, rad).
ROUGHNESS = np.geomspace(1e-7, 1e-1, 37), np.geomspace(1e-10, 1e-4, 37)
#: Standard deviation of the coefficients of a straight line (mm, rad).
AMPLITUDE = 0.3, 3e-4
#: Standard deviation of a step or kink (mm, rad).
FEATURE = 0.02, 20e-6
#: Standard deviation of a half difference (mm, rad).
HALF = 0.02, 20e-6
#: What one more feature must gain beyond its own cost, nats.
GAIN = 2.0
#: The same of a step where another error of the axis has one, nats.
SHARED_GAIN = 0.0
#: Features of a curve, at most.
MOST = 8
#: Steps and kinks are tried between so many targets at most.
FINEST = 80

Half = Literal["none", "constant", "curve"]
#: What cells hide of a curve of some scales, by its name.
Hides = Callable[[str, Scales], Hidden]


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """The shape of a curve from its lines: probabilities of its character and the scales to be expected,
    features, dependence on direction and its roughness, and what the cells of its spline hide."""

    table: Array
    scales: Scales
    features: tuple[Feature, ...]
    half: Half
    half_roughness: float
    hidden: Hidden


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """What is chosen of a curve, and the log evidence (n,) of all candidates of its scales with it."""

    features: tuple[Feature, ...]
    half: Half
    half_roughness: float
    values: Array


def features_of(
    lines: Sequence[tuple[Line, Noise]],
    spline: Spline,
    half_spline: Spline,
    waves: Sequence[Wave] = (),
    joints: Sequence[Step] = (),
    turns: Sequence[Step] = (),
) -> Features:
    """The features of the curve that all these lines read, beside what repeats with `waves`. At `joints`
    other errors of the axis have a step. At `turns` an angle has one that lines on the table read with their
    lever arm: so the curve may have one, too, that they do not show."""
    kind = lines[0][0].quantity
    angle = kind == "angle"
    inside = [line for line, _ in lines if np.ptp(line.target_mm) > 0.2 * (spline.high_mm - spline.low_mm)]
    targets = np.unique(np.concatenate([targets_of(line) for line in inside] or [np.zeros(0)]))
    if len(targets) > FINEST:
        targets = targets[np.unique(np.linspace(0, len(targets) - 1, FINEST).round().astype(int))]
    tried: list[Feature] = [Step(float(a), float(b)) for a, b in itertools.pairwise(targets) if b - a > 1.0]
    tried += [Kink(float(start), spline.high_mm - spline.low_mm) for start in targets[1:-1]]
    two_way = all(len(np.unique(line.direction)) == 2 for line, _ in lines)
    halves = half_spline.count if two_way else 0
    normal = Normal.of(spline.count + len(tried) + halves)
    for line, noise in lines:
        q = line.target_mm
        table = [spline.values(q), *(f.values(q)[:, None] for f in tried)]
        if halves:
            table.append(line.direction[:, None] * half_spline.values(q))
        normal.add(_block(np.concatenate(table, axis=1), line, noise, waves, FEATURE[angle]))
    evidence = Evidence(normal, spline, AMPLITUDE[angle], FEATURE[angle])
    chosen = [i for i in range(len(tried)) if _is_joint(tried[i], turns)][:MOST]
    while len(chosen) < min(MOST, len(tried)):
        rest = [i for i in range(len(tried)) if i not in chosen]
        at_joint = np.array([_is_joint(tried[i], joints) for i in rest])
        gains = evidence.gains(fewer(kind), chosen, rest)
        gains -= np.where(at_joint, SHARED_GAIN, GAIN + np.log(len(rest)))
        pick = int(np.argmax(gains))
        if gains[pick] < 0.0:
            break
        chosen.append(rest[pick])
    covariance = evidence.covariance(candidates(kind), chosen)
    values = evidence.values(covariance)
    half: Half = "none"
    half_roughness = 0.0
    if halves:
        best = int(np.argmax(values))
        half, half_roughness = _direction(evidence, covariance[best], half_spline, angle)
    return Features(tuple(tried[i] for i in sorted(chosen)), half, half_roughness, values)


def shapes_of(features: Mapping[str, Features], hides: Hides) -> dict[str, Shape]:
    """The shapes of all curves with lines, as they are alike; `hides` is what cells hide of each."""
    shapes = {}
    for name, table in characters({name: own.values for name, own in features.items()}).items():
        scales, own = expected(table, class_of(name)), features[name]
        shapes[name] = Shape(table, scales, own.features, own.half, own.half_roughness, hides(name, scales))
    return shapes


def _direction(evidence: Evidence, covariance: Array, half: Spline, angle: bool) -> tuple[Half, float]:
    """Whether the half difference, the last columns of the evidence, is zero, constant or a curve."""
    rows = evidence.rows[:, -half.count :]
    flat = HALF[angle] * rows.sum(axis=1)
    values, vectors = np.linalg.eigh(half.roughness())
    turned = rows @ vectors
    curves = [
        (turned / (np.maximum(values, 0.0) / rough**2 + 1.0 / HALF[angle] ** 2)) @ turned.T
        for rough in ROUGHNESS[angle]
    ]
    more = np.stack([np.zeros_like(covariance), np.outer(flat, flat), *curves])
    plain, constant, *full = evidence.values(covariance + more).tolist()
    best = int(np.argmax(full))
    if full[best] > max(constant, plain) + GAIN:
        return "curve", float(ROUGHNESS[angle][best])
    return ("constant", 0.0) if constant > plain + GAIN else ("none", 0.0)


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
    local += list(own_columns(line.target_mm, line.sensors_degC).T)
    precision += (per_kelvin(line.component, len(line.sensors_degC)) ** -2.0).tolist()
    chunk = Chunk(rows, line.value, np.full(n, noise.sigma), np.stack(local, axis=1))
    return Block.of(chunk, np.arange(rows.shape[1]), np.array(precision))
