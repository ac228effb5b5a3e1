"""The factor that each curve of a calibration needs, from independent points: all at once.

y = sum of s_i c_i + frame + scale + noise, with c_i what curve i adds at a point as it is stated. The sign of
s_i shows the sign convention of the curve, its size the unit. Estimates are least squares. A factor is
decided by the odds between the possible mistakes; once decided, it helps to determine the others.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from olp.calibration.estimator.normal import Block, Chunk, Normal, evidence, solve
from olp.calibration.estimator.parameters import LEVER_ARM_MM, frame_columns
from olp.calibration.observations.points import Points, deviations
from olp.core.arrays import Array
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel

#: Prior probability that a curve is as stated.
AS_STATED = 0.80
#: Prior probability that its sign is wrong.
FLIPPED = 0.10
#: Prior probability that it is absent.
ABSENT = 0.02
#: urad per arcsec.
ARCSEC = math.pi / 0.648
#: Wrong units of lengths: factor, words, prior probability.
UNITS = (
    (1000.0, "mm (or rad) stated as um (urad)", 0.005),
    (1e-3, "um (or urad) stated as mm (rad)", 0.005),
    (25.4, "thousandths of an inch stated as um", 0.0025),
    (1.0 / 25.4, "um stated as thousandths of an inch", 0.0005),
)
#: Wrong units of angles: the same.
ANGLE_UNITS = (
    *UNITS[:2],
    (ARCSEC, "arcsec stated as urad", 0.02),
    (1.0 / ARCSEC, "urad stated as arcsec", 0.02),
)
#: Prior probability of any other factor.
OTHER = 0.01
#: Standard deviation of any other factor.
OTHER_SIZE = 3.0
#: Change of curves since the day of measuring, as a share of a factor.
CHANGE = 0.1
#: The effect of a curve is not known better than this, mm.
KNOWN = 1e-3
#: A factor is decided only where it is more than so many standard deviations from zero.
DECIDED_Z = 3.0
#: A factor is decided at this probability.
DECIDED = 0.9995
#: That a curve is absent is decided at this probability, as then no sign can be wrong.
DECIDED_ABSENT = 0.95
#: Nothing is decided where a factor that is not listed is more probable than this.
UNLISTED = 0.05
#: Curves with an effect below the first number (mm) are less likely by the second.
NEXT_TO_NOTHING = 3e-4, 0.02
#: The standard deviation of an undecided factor is wider than its odds say by this factor.
WIDER = 1.5
#: Scale of the instrument against the machine's, mm/mm: half a kelvin of steel.
SCALE = 6e-6
#: Rounds of estimating and deciding, at most.
_ROUNDS = 8
#: A curve with a smaller effect (mm rms) is not judged.
NOTHING = 1e-9


@dataclass(frozen=True, slots=True)
class Candidate:
    """A factor that a curve may need, in words, with its prior probability."""

    factor: float
    words: str
    prior: float


def candidates(name: str, size: float) -> tuple[Candidate, ...]:
    """The possible factors of a component or squareness with an effect of `size` (mm rms) as stated. Curves
    with next to no effect are rarely measured, so a unit that makes it one is unlikely."""
    angle = name in SQUARENESS or name[1] in "ABC"
    listed = [Candidate(1.0, "", AS_STATED), Candidate(-1.0, "", FLIPPED), Candidate(0.0, "absent", ABSENT)]
    for factor, words, prior in ANGLE_UNITS if angle else UNITS:
        prior *= NEXT_TO_NOTHING[1] if factor * size < NEXT_TO_NOTHING[0] else 1.0
        listed += [Candidate(factor, words, 0.8 * prior), Candidate(-factor, words, 0.2 * prior)]
    return tuple(listed)


@dataclass(frozen=True, slots=True)
class Marginal:
    """The result for one factor: its estimate and standard deviation without its own prior, `odds` of the
    `known` candidates and, last, of any other factor, and the probability that it is above zero."""

    name: str
    factor: float
    sigma: float
    known: tuple[Candidate, ...]
    odds: tuple[float, ...]
    positive: float

    @property
    def z(self) -> float:
        return self.factor / self.sigma

    @property
    def candidate(self) -> Candidate | None:
        """The candidate that is decided, if one is."""
        listed = np.array(self.odds[:-1])
        best = int(np.argmax(listed))
        likeliest = self.known[best]
        needed = DECIDED if likeliest.factor != 0.0 else DECIDED_ABSENT
        if listed[best] < needed * listed.sum() or self.odds[-1] > UNLISTED:
            return None
        return likeliest if likeliest.factor == 0.0 or abs(self.z) > DECIDED_Z else None

    @property
    def sign(self) -> int:
        """+1, -1, or 0 where it is not decided."""
        if abs(self.z) <= DECIDED_Z:
            return 0
        return 1 if self.positive > DECIDED else -1 if self.positive < 1.0 - DECIDED else 0


@dataclass(frozen=True, slots=True, eq=False)
class Checkpoints:
    """Points of the diagnosis: the deviation of the machine there (n, 3) and its standard uncertainty (n, 3),
    in mm. As directions of approach are unknown, half of the backlash is part of it. `scale` is the standard
    uncertainty of the scale, mm/mm. With `frame_known` deviations are in the machine's frame."""

    points: Points
    deviation_mm: Array
    sigma_mm: Array
    frame_known: bool
    scale: float = SCALE

    @classmethod
    def of(
        cls, points: Points, model: ErrorModel, *, frame_known: bool = False, scale: float | None = None
    ) -> Checkpoints:
        """Raises CannotCompute where the frame is unknown and the points determine none."""
        deviation = (
            points.measured_mm - points.axis_mm - points.tool_mm if frame_known else deviations(points)
        )
        backlash = model.backlash_at(points.axis_mm)
        sigma = np.full(deviation.shape, points.sigma)
        if backlash is not None:
            sigma = np.hypot(sigma, 0.5 * np.abs(backlash))
        own = max(SCALE, points.sigma_scale) if scale is None else scale
        return cls(points, deviation, sigma, frame_known, own)

    @property
    def centre_mm(self) -> Array:
        return np.asarray((self.points.axis_mm + self.points.tool_mm).mean(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class Factors:
    """The joint estimate: `marginals` by name, and `theta` and `covariance` of factors (in the order of
    `names`), frame and scale with all decisions applied. `inflation` is that of the stated uncertainty;
    residuals (n, 3) and the standard uncertainty (n, 3) that was used are in mm. `evidence` is the logarithm
    of the probability of the points with what is decided, up to a constant."""

    names: tuple[str, ...]
    marginals: Mapping[str, Marginal]
    theta: Array
    covariance: Array
    inflation: float
    residual_mm: Array
    sigma_mm: Array
    evidence: float


def contributions_of(model: ErrorModel, axis_mm: Array, tool_mm: Array) -> dict[str, Array]:
    """(n, 3) in mm by component or squareness, cyclic terms with their curve; and the rest as "rest"."""
    columns: dict[str, Array] = {}
    for source, values in model.contributions(axis_mm, tool_mm):
        name = source.removeprefix("cyclic ")
        name = name if name in COMPONENTS or name in SQUARENESS else "rest"
        columns[name] = columns[name] + values if name in columns else values
    return {name: v for name, v in columns.items() if float(np.sqrt(np.mean(v**2))) > NOTHING}


def chi_square(seen: Checkpoints, columns: Mapping[str, Array]) -> tuple[float, float]:
    """Chi-square of the fit with every factor free, and its degrees of freedom."""
    names, normal = _normal(seen, columns, 1.0)
    precision = _precision(seen, _loosest(seen, columns, names))
    solved = solve(normal, np.diag(precision))
    used = float(np.trace(solved.covariance @ normal.H))
    return normal.square - float(normal.g @ solved.theta), normal.count - used


def factors_of(seen: Checkpoints, columns: Mapping[str, Array], inflation: float = 1.0) -> Factors:
    """The factors of all curves together; `columns` are from `contributions_of`, the points scatter
    `inflation` times as much as stated."""
    names, normal = _normal(seen, columns, inflation)
    n = len(names)
    loosest = _loosest(seen, columns, names)
    size = [float(np.sqrt(np.mean(columns[name] ** 2))) for name in names]
    mean, spread = np.zeros(n), loosest.copy()
    fixed = np.array([name == "rest" for name in names])
    mean[fixed], spread[fixed] = 1.0, CHANGE
    marginals: dict[str, Marginal] = {}
    for _ in range(_ROUNDS):
        precision = _precision(seen, spread)
        shifted = Normal(normal.H, normal.g + precision * np.pad(mean, (0, len(precision) - n)))
        solved = solve(shifted, np.diag(precision))
        before = mean.copy(), spread.copy()
        for i, name in enumerate(names):
            if fixed[i]:
                continue
            marginal = _marginal(
                name, (solved.theta[i], solved.covariance[i, i]), (mean[i], precision[i]), size[i]
            )
            marginals[name] = marginal
            mean[i], spread[i] = _believed(marginal, loosest[i], KNOWN / size[i])
        if np.allclose(before[0], mean) and np.allclose(before[1], spread):
            break
    centre = np.pad(mean, (0, len(precision) - n))
    square = normal.square - float((2.0 * normal.g - normal.H @ centre) @ centre)
    about = Normal(normal.H, normal.g - normal.H @ centre, square)
    known = [m.candidate for m in marginals.values()]
    log = evidence(about, np.diag(precision), float(np.log(precision).sum()))
    log += sum(math.log(c.prior) for c in known if c is not None)
    rest = seen.deviation_mm.reshape(-1) - _design(seen, columns, names) @ solved.theta
    return Factors(
        names, marginals, solved.theta, solved.covariance, inflation,
        rest.reshape(-1, 3), seen.sigma_mm * inflation, log,
    )  # fmt: skip


def design_of(
    axis_mm: Array, tool_mm: Array, centre_mm: Array, columns: Mapping[str, Array], names: tuple[str, ...]
) -> Array:
    """(n, 3, factors + 6 + 3) what factors, frame and scales add at points, in mm."""
    tip = axis_mm + tool_mm
    zero = np.zeros(tip.shape)
    curves = np.stack([columns.get(name, zero) for name in names], axis=2)
    scales = np.zeros((len(tip), 3, 3))
    for k in range(3):
        scales[:, k, k] = (tip[:, k] - centre_mm[k]) / LEVER_ARM_MM
    return np.concatenate([curves, frame_columns(tip - centre_mm), scales], axis=2)


def _design(seen: Checkpoints, columns: Mapping[str, Array], names: tuple[str, ...]) -> Array:
    points = seen.points
    table = design_of(points.axis_mm, points.tool_mm, seen.centre_mm, columns, names)
    return np.asarray(table.reshape(3 * len(table), -1))


def _normal(
    seen: Checkpoints, columns: Mapping[str, Array], inflation: float
) -> tuple[tuple[str, ...], Normal]:
    names = tuple(columns)
    rows = _design(seen, columns, names)
    n = rows.shape[1]
    normal = Normal.of(n)
    sigma = inflation * seen.sigma_mm.reshape(-1)
    chunk = Chunk(rows, seen.deviation_mm.reshape(-1), sigma, np.zeros((len(rows), 0)))
    normal.add(Block.of(chunk, np.arange(n), np.zeros(0), seen.points.source))
    return names, normal


def _precision(seen: Checkpoints, spread: Array) -> Array:
    """Prior precisions of factors, frame and scales."""
    # a frame that is known may still be off by a nanometre; one that is not, by metres
    frame = np.full(6, 1e12 if seen.frame_known else 1e-6)
    scales = np.full(3, 1.0 / max(seen.scale * LEVER_ARM_MM, 1e-9) ** 2)
    return np.concatenate([1.0 / np.square(spread), frame, scales])


def _loosest(seen: Checkpoints, columns: Mapping[str, Array], names: tuple[str, ...]) -> Array:
    """How large each factor may be at all: so that a curve explains three times what was measured."""
    size = float(np.sqrt(np.mean(seen.deviation_mm**2)))
    own = np.array([float(np.sqrt(np.mean(columns[name] ** 2))) for name in names])
    return np.maximum(OTHER_SIZE, 3.0 * size / own)


def _marginal(name: str, estimate: tuple[float, float], prior: tuple[float, float], size: float) -> Marginal:
    """The factor from the readings alone: its (mean, variance) without its own prior (mean, precision).
    `size` is the effect of the curve at the points as stated, mm rms."""
    own = max(1.0 / estimate[1] - prior[1], 1e-9 / estimate[1])
    factor = (estimate[0] / estimate[1] - prior[0] * prior[1]) / own
    sigma = 1.0 / math.sqrt(own)
    known, vague = candidates(name, size), KNOWN / size
    wide = [*(math.hypot(sigma, vague, CHANGE * c.factor) for c in known), math.hypot(sigma, OTHER_SIZE)]
    centres = [*(c.factor for c in known), 0.0]
    prior_of = [*(c.prior for c in known), OTHER]
    log = [
        math.log(p / w) - 0.5 * ((factor - h) / w) ** 2
        for p, w, h in zip(prior_of, wide, centres, strict=True)
    ]
    odds = np.exp(np.array(log) - max(log))
    odds /= odds.sum()
    sides = [
        float(sum(p for p, h in zip(odds, centres, strict=True) if side * h > 0.0)) for side in (1.0, -1.0)
    ]
    # a factor beyond the list has the sign that its estimate says; one of zero has none
    tail = 0.5 * math.erfc(-factor / sigma / math.sqrt(2.0))
    above, below = sides[0] + odds[-1] * tail, sides[1] + odds[-1] * (1.0 - tail)
    return Marginal(name, factor, sigma, known, tuple(odds.tolist()), float(above / (above + below)))


def _believed(marginal: Marginal, loosest: float, vague: float) -> tuple[float, float]:
    """Mean and standard deviation of a factor for the next round."""
    decided = marginal.candidate
    if decided is not None:
        return decided.factor, math.hypot(CHANGE * decided.factor, vague)
    square = sum(p * c.factor**2 for p, c in zip(marginal.odds, marginal.known, strict=False))
    square += marginal.odds[-1] * OTHER_SIZE**2
    return 0.0, min(loosest, WIDER * math.sqrt(max(1.0, square)))
