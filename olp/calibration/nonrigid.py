"""What rigid bodies do not describe: a smooth field of deviations beside the curves, from volumetric readings.

The field (a Gaussian process for each of DX, DY, DZ, see `olp.calibration.field`) joins the adjustment as
further unknowns. Size and lengths of each process, and by how much noise is larger than stated, are those of
the largest marginal likelihood. A process stays only where the evidence for it is strong and where it
foretells readings that it has not seen.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from olp.calibration.estimator import Fit
from olp.calibration.field import LONGEST, REACH, SHORTEST, Modes
from olp.calibration.lengths import lengths_block
from olp.calibration.lines import line_block, squareness_block
from olp.calibration.normal import Block, Chunk, Normal
from olp.calibration.observations import Index, Lengths, Pods, Points
from olp.calibration.parameters import Parameters
from olp.calibration.pods import CHUNK, pods_block
from olp.calibration.points import points_block
from olp.errormodel.base import Array
from olp.machine import SQUARENESS
from olp.progress import Progress, silent
from olp.units import AXES, MM_PER_UM

Noise = Literal["learnt", "stated"]

#: Parts into which the points fall for the held-out figure.
FOLDS = 5
#: A process is there where the log evidence for it is larger than this: chances of 1 to 3000, and what its
#: four free numbers gain from noise alone is far below.
EVIDENCE = 8.0
#: So many times that is beyond doubt.
CLEAR = 3.0
#: It has to make what it foretells better by this share.
FORETELLS = 0.02
#: Fewer volumetric points tell nothing of a field.
FEWEST_POINTS = 40
#: Sizes of a process in mm, from here to there.
SMALLEST, LARGEST = 2e-4, 1.0
#: The factor on stated noise is between these.
QUIET, LOUD = 0.5, 10.0
#: A coefficient of which readings would tell less than this share of its variance is left out.
NEGLIGIBLE = 1e-3
#: Places by which what curves can hold is taken out of the field, and how well they are to follow it, mm.
_PLACES, _CLOSE = 500, 1e-4


@dataclass(frozen=True, slots=True)
class Process:
    """One coordinate of the field: its standard deviation in mm, the lengths over which it changes in mm, and
    the log evidence for it."""

    coordinate: str
    size_mm: float
    lengths_mm: tuple[float, float, float]
    evidence: float


@dataclass(frozen=True, slots=True)
class Figures:
    """Root mean square of residuals in multiples of their stated standard uncertainty, and of readings that
    were held out, without the field and with it."""

    residual_before: float
    residual_after: float
    held_out_before: float
    held_out_after: float


@dataclass(frozen=True, slots=True, eq=False)
class NonRigid:
    """What was found. `fit` has the curves that go with the field; where there is no field (no `processes`)
    it is the fit that was given. `best` is the strongest candidate, `noise` the factor on stated noise,
    `tools_mm` (k, 3) the offsets of the reflector."""

    fit: Fit
    processes: tuple[Process, ...]
    best: Process | None
    figures: Figures | None
    noise: float
    points: int
    tools_mm: Array
    reason: str
    modes: Modes | None = None
    mean: Array | None = None
    joint: Array | None = None
    taken: Array | None = None

    def value(self, position: Array) -> Array:
        """(n, 3) the field in mm at axis positions (n, 3)."""
        if self.mean is None:
            return np.zeros(np.shape(position))
        return np.asarray(self._rows(np.asarray(position, float)) @ self.mean)

    def sigma(self, position: Array, tool: Array) -> Array:
        """(n, 3) standard uncertainty of curves and field together, with a tool vector, mm."""
        at = np.asarray(position, float)
        rows = self.fit.design(at, np.asarray(tool, float))
        if self.joint is not None:
            rows = np.concatenate([rows, self._rows(at)], axis=2)
        joint = self.fit.covariance if self.joint is None else self.joint
        variance = np.einsum("nik,kl,nil->ni", rows, joint, rows, optimize=True)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))

    def _rows(self, at: Array) -> Array:
        """(n, 3, 3 m) the field's dependence on its coefficients: the sines less what went to the curves."""
        assert self.modes is not None and self.taken is not None
        wide = _wide(self.modes, at)
        return np.asarray(wide - _straight(self.fit.parameters, at) @ self.taken)


@dataclass(frozen=True, slots=True, eq=False)
class _Both:
    """Curves and field together, as the blocks see them."""

    parameters: Parameters
    modes: Modes

    @property
    def size(self) -> int:
        return self.parameters.size + 3 * self.modes.size

    def design(self, position: Array, tool: Array, /) -> Array:
        return np.concatenate([self.parameters.design(position, tool), _wide(self.modes, position)], axis=2)


def _wide(modes: Modes, position: Array) -> Array:
    values, m = modes.values(position), modes.size
    out = np.zeros((len(position), 3, 3 * m))
    for i in range(3):
        out[:, i, i * m : (i + 1) * m] = values
    return out


def _straight(parameters: Parameters, position: Array) -> Array:
    """The design of what moves every tool alike: displacement curves and squareness, no angles."""
    out = parameters.design(position, np.zeros(3))
    keep = np.zeros(parameters.size, bool)
    for name, part in parameters.slices.items():
        keep[part] = name in SQUARENESS or (name in parameters.spaces and name[1] in AXES)
    out[:, :, ~keep] = 0.0
    return out


# -- the adjustment of curves, field, and what each set of readings has for itself -------------------------


@dataclass(slots=True, eq=False)
class _Sums:
    """Gram matrices of [curves, field, nuisances, y] of standardised readings: of what is never held out
    (first) and of each fold; `counts` the readings of each."""

    gram: Array
    counts: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Reduced:
    """What the readings say of the field alone: precision G and right side v with all else free, the weighted
    square that the curves leave, and the readings behind it."""

    G: Array
    v: Array
    square: float
    freedom: float


class _Adjustment:
    """The normal equations; `other` are lines and priors, which the field is no part of."""

    def __init__(self, fit: Fit, modes: Modes) -> None:
        self.fit, self.modes = fit, modes
        self.size, self.own = fit.parameters.size, 3 * modes.size
        both = _Both(fit.parameters, modes)
        theta = np.concatenate([fit.theta, np.zeros(self.own)])
        sets: list[tuple[Points | Lengths | Pods, Block]] = [
            *((r.points, points_block(r.points, both)) for r in fit.points),
            *((r.lengths, lengths_block(r.lengths, both, theta, r.station)) for r in fit.lengths),
            *((r.pods, pods_block(r.pods, both, theta, list(r.poses))) for r in fit.pods),
        ]
        local = [len(block.precision) for _, block in sets]
        self.total = both.size + sum(local)
        gram = np.zeros((FOLDS + 1, self.total + 1, self.total + 1))
        counts = np.zeros(FOLDS + 1)
        nuisance = np.zeros(self.total)
        at = both.size
        for (taken, block), count in zip(sets, local, strict=True):
            nuisance[at : at + count] = block.precision
            columns = [*range(both.size), *range(at, at + count), self.total]
            folds = _folds(taken)
            start = 0
            for chunk in block.chunks():
                part = folds[start : start + len(chunk.y)]
                start += len(chunk.y)
                for k in np.unique(part).tolist():
                    table = _table(chunk, part == k)
                    gram[k][np.ix_(columns, columns)] += table.T @ table
                    counts[k] += len(table)
            at += count
        self.sums = _Sums(gram, counts)
        self.free = int(np.sum(nuisance[both.size :] == 0.0))
        other = Normal.of(self.size)
        for result in fit.lines:
            other.add(line_block(result.line, fit.parameters, result.noise))
        for reading in fit.measurements.squareness:
            other.add(squareness_block(reading, fit.parameters))
        fit.prior.push(other)
        self.prior = np.diag(nuisance)
        self.prior[: self.size, : self.size] = other.H + fit.prior.precision()[0]
        self.right = np.zeros(self.total)
        self.right[: self.size] = other.g
        known = self.prior[: self.size, : self.size]
        self.constant = float(other.g @ np.linalg.solve(known, other.g))

    def normal(self, without: int | None = None) -> tuple[Array, Array, float, float]:
        """(H, g, weighted square, readings) of everything but one fold, without the field's prior."""
        use = [k for k in range(FOLDS + 1) if k != without]
        gram = self.sums.gram[use].sum(axis=0)
        n = self.total
        square = float(gram[n, n]) + self.constant
        return gram[:n, :n] + self.prior, gram[:n, n] + self.right, square, float(self.sums.counts[use].sum())

    def reduced(self) -> _Reduced:
        H, g, square, count = self.normal()
        field = self.columns((0, 1, 2))
        rest = np.setdiff1d(np.arange(self.total), field)
        factor = _solver(H[np.ix_(rest, rest)])
        across = H[np.ix_(field, rest)]
        solved = factor(np.column_stack([across.T, g[rest]]))
        G = H[np.ix_(field, field)] - across @ solved[:, :-1]
        v = g[field] - across @ solved[:, -1]
        left = square - float(g[rest] @ solved[:, -1])
        return _Reduced(0.5 * (G + G.T), v, left, count - self.free)

    def columns(self, coordinates: Sequence[int]) -> Index:
        m = self.modes.size
        parts = [np.arange(self.size + i * m, self.size + (i + 1) * m) for i in coordinates]
        return np.concatenate([np.zeros(0, np.int64), *parts])

    def solve(
        self, coordinates: Sequence[int], log_variance: Array, noise: float, without: int | None = None
    ) -> tuple[Array, Array, Index]:
        """(x, covariance, columns) of curves, the field's `coordinates` and nuisances."""
        H, g, _, _ = self.normal(without)
        field = self.columns(coordinates)
        keep = np.concatenate(
            [np.arange(self.size), field, np.arange(self.size + self.own, self.total)]
        )
        A, b = H[np.ix_(keep, keep)] / noise**2, g[keep] / noise**2
        inner = np.arange(self.size, self.size + len(field))
        A[inner, inner] += np.exp(-log_variance)
        inverse = _solver(A)(np.column_stack([np.eye(len(A)), b]))
        return inverse[:, -1], inverse[:, :-1], keep

    def misses(self, x: Array, keep: Index, folds: Sequence[int]) -> tuple[float, float]:
        """Weighted square of what x leaves of the readings of folds, and how many these are."""
        whole = np.zeros(self.total + 1)
        whole[keep], whole[-1] = x, -1.0
        gram = self.sums.gram[list(folds)].sum(axis=0)
        return max(float(whole @ gram @ whole), 0.0), float(self.sums.counts[list(folds)].sum())


def _table(chunk: Chunk, use: np.ndarray) -> Array:
    table = np.concatenate([chunk.rows, chunk.local, chunk.y[:, None]], axis=1)[use]
    return np.asarray(table / chunk.sigma[use, None])


def _folds(taken: Points | Lengths | Pods) -> Index:
    """The fold from 1 of every reading, in the order of its block; 0 is never held out. All readings of a
    point are in one fold."""
    n = len(taken.axis_mm)
    fold = 1 + np.random.default_rng(n).permutation(n) % FOLDS
    if isinstance(taken, Points):
        return np.repeat(fold, 3)
    if isinstance(taken, Lengths):
        return fold
    parts = [np.repeat(fold[start : start + CHUNK], 2) for start in range(0, n, CHUNK)]
    whole = [np.tile(part, taken.count) for part in parts]
    return np.concatenate([*whole, np.zeros(len(taken.baselines), np.int64)])


def _solver(matrix: Array):  # type: ignore[no-untyped-def]
    from scipy.linalg import cho_solve

    scale = np.sqrt(np.diag(matrix))
    factor = np.linalg.cholesky(matrix / np.outer(scale, scale) + 1e-13 * np.eye(len(scale)))

    def solved(right: Array) -> Array:
        return np.asarray(cho_solve((factor, True), right / scale[:, None]) / scale[:, None])

    return solved


# -- what the evidence prefers ---------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class _Learnt:
    """The hyper-parameters of some coordinates and their log evidence; `log` holds size and three lengths of
    each."""

    coordinates: tuple[int, ...]
    log: Array
    noise: float
    evidence: float

    def log_variance(self, modes: Modes) -> Array:
        parts = [modes.log_variance(float(h[0]), h[1:])[0] for h in self.log]
        return np.concatenate([np.zeros(0), *parts])


def _log_evidence(reduced: _Reduced, modes: Modes, log: Array, log_noise: float) -> tuple[float, Array, float]:
    """The log evidence of processes (k, 4) for a reduced problem of as many coordinates, up to a constant, and
    its derivatives by their hyper-parameters and by the log of the noise."""
    from scipy.linalg import cho_solve

    s2 = math.exp(2.0 * log_noise)
    values, slopes = zip(*(modes.log_variance(float(h[0]), h[1:]) for h in log), strict=True)
    log_d = np.concatenate(values)
    # coefficients too small for any reading change nothing
    use = np.exp(log_d) * np.diag(reduced.G) / s2 > NEGLIGIBLE
    root, G, v = np.exp(0.5 * log_d[use]), reduced.G[np.ix_(use, use)] / s2, reduced.v[use] / s2
    # I + D^1/2 G D^1/2: well conditioned however small a variance is
    inner = root[:, None] * G * root + np.eye(len(root))
    factor = np.linalg.cholesky(inner)
    inverse = cho_solve((factor, True), np.eye(len(root)), check_finite=False)
    pull = root * v
    e = inverse @ pull
    value = (
        -0.5 * reduced.square / s2
        - reduced.freedom * log_noise
        + 0.5 * float(pull @ e)
        - float(np.log(np.diag(factor)).sum())
    )
    by_log_d = np.zeros(len(log_d))
    by_log_d[use] = 0.5 * (e**2 - 1.0 + np.diag(inverse))
    m = modes.size
    gradient = np.zeros(log.shape)
    for k, slope in enumerate(slopes):
        own = by_log_d[k * m : (k + 1) * m]
        gradient[k, 0] = 2.0 * own.sum()
        gradient[k, 1:] = own @ slope
    shrink = float(pull @ e) * -2.0 + float(e @ (inner @ e) - e @ e)
    by_noise = reduced.square / s2 - reduced.freedom + shrink + len(root) - float(np.trace(inverse))
    return value, gradient, by_noise


def _part(reduced: _Reduced, m: int, coordinates: Sequence[int]) -> _Reduced:
    use = np.concatenate([np.arange(i * m, (i + 1) * m) for i in coordinates])
    return dataclasses.replace(reduced, G=reduced.G[np.ix_(use, use)], v=reduced.v[use])


def _alone(reduced: _Reduced, noise: Noise) -> _Learnt:
    """No field at all."""
    s = 1.0
    if noise == "learnt":
        s = float(np.clip(math.sqrt(reduced.square / reduced.freedom), QUIET, LOUD))
    value = -0.5 * reduced.square / s**2 - reduced.freedom * math.log(s)
    return _Learnt((), np.zeros((0, 4)), s, value)


def _learn(
    reduced: _Reduced, modes: Modes, coordinates: tuple[int, ...], noise: Noise, start: _Learnt | None = None
) -> _Learnt:
    """The largest evidence over the hyper-parameters of these coordinates."""
    from scipy.optimize import minimize

    if not coordinates:
        return _alone(reduced, noise)
    part = _part(reduced, modes.size, coordinates)
    span = 2.0 * modes.reach_mm / REACH
    first = np.tile(np.concatenate([[math.log(0.01)], np.log(0.5 * span)]), (len(coordinates), 1))
    first_noise = 0.0
    if start is not None:
        first = start.log[[start.coordinates.index(i) for i in coordinates]]
        first_noise = math.log(start.noise)
    low, high = math.log(QUIET), math.log(LOUD)
    fixed = noise == "stated"
    bounds = [
        *[
            (math.log(SMALLEST), math.log(LARGEST)),
            *((math.log(SHORTEST * a), math.log(LONGEST * a)) for a in span.tolist()),
        ]
        * len(coordinates),
        (0.0, 0.0) if fixed else (low, high),
    ]

    def cost(x: Array) -> tuple[float, Array]:
        value, slope, by_noise = _log_evidence(part, modes, x[:-1].reshape(-1, 4), float(x[-1]))
        return -value, -np.append(slope.ravel(), 0.0 if fixed else by_noise)

    x0 = np.append(first.ravel(), 0.0 if fixed else first_noise)
    found = minimize(cost, x0, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 40, "ftol": 1e-6})
    return _Learnt(coordinates, found.x[:-1].reshape(-1, 4), math.exp(float(found.x[-1])), -float(found.fun))


def nonrigid(fit: Fit, *, noise: Noise = "learnt", progress: Progress | None = None) -> NonRigid:
    """What volumetric readings of a fit hold beyond rigid bodies, or the reason why nothing is mapped.

    `noise` "stated" takes the stated uncertainties as they are; "learnt" lets the evidence scale them, and
    what is believed of the curves with them.
    """
    tell = progress or silent
    sets = [*(r.points for r in fit.points), *(r.lengths for r in fit.lengths), *(r.pods for r in fit.pods)]
    count = sum(len(taken.axis_mm) for taken in sets)
    tools = np.concatenate([np.zeros((0, 3)), *(taken.tool_mm for taken in sets)])
    tools = np.unique(np.round(tools, 3), axis=0)
    nothing = NonRigid(fit, (), None, None, 1.0, count, tools, "")
    if count < FEWEST_POINTS:
        reason = f"{count} volumetric points; expected at least {FEWEST_POINTS}: lines alone are one place each"
        return dataclasses.replace(nothing, reason=reason)
    at = np.concatenate([taken.axis_mm for taken in sets])
    box = np.stack([at.min(axis=0), at.max(axis=0)], axis=1)
    flat = [axis for axis, a, b in zip(AXES, np.ptp(box, axis=1), np.ptp(fit.box_mm, axis=1), strict=True) if a < 0.5 * b]
    if flat:
        reason = f"the points reach over less than half of the box along {' and '.join(flat)}"
        return dataclasses.replace(nothing, reason=reason)
    whole = np.stack([np.minimum(box[:, 0], fit.box_mm[:, 0]), np.maximum(box[:, 1], fit.box_mm[:, 1])], axis=1)
    modes = Modes.over(whole, count)
    tell("what is not rigid", 0.0)
    work = _Adjustment(fit, modes)
    reduced = work.reduced()
    alone = _alone(reduced, noise)
    learnt = _learn(reduced, modes, (0, 1, 2), noise)
    best: Process | None = None
    while True:
        tell("what is not rigid", 0.5)
        gains = {i: _gain(reduced, modes, learnt, i, noise) for i in learnt.coordinates}
        processes = tuple(_process(learnt, k, gains[i]) for k, i in enumerate(learnt.coordinates))
        best = best or max(processes, key=lambda p: p.evidence)
        weakest = min(gains, key=lambda i: gains[i], default=None)
        if weakest is None or gains[weakest] > EVIDENCE:
            break
        left = tuple(i for i in learnt.coordinates if i != weakest)
        learnt = _learn(reduced, modes, left, noise, learnt)
    figures = _figures(work, learnt, alone)
    found = dataclasses.replace(nothing, best=best, figures=figures, noise=learnt.noise)
    if not processes:
        reason = f"the evidence for a field is {best.evidence:.1f}, expected above {EVIDENCE:g}"
        return dataclasses.replace(found, reason=reason)
    if figures.held_out_after > (1.0 - FORETELLS) * figures.held_out_before:
        reason = (
            f"readings held out are foretold within {figures.held_out_after:.2f} sigma with a field, "
            f"{figures.held_out_before:.2f} without; expected {FORETELLS:.0%} better"
        )
        return dataclasses.replace(found, reason=reason)
    return _mapped(work, learnt, found, processes)


def _gain(reduced: _Reduced, modes: Modes, learnt: _Learnt, i: int, noise: Noise) -> float:
    """The log evidence for one coordinate beside the others. These and the noise are learnt anew without it
    only where that could decide: it makes the gain smaller."""
    left = tuple(k for k in learnt.coordinates if k != i)
    if left:
        own = _part(reduced, modes.size, left)
        log = learnt.log[[learnt.coordinates.index(k) for k in left]]
        gain = learnt.evidence - _log_evidence(own, modes, log, math.log(learnt.noise))[0]
        if not EVIDENCE < gain < CLEAR * EVIDENCE:
            return gain
    return learnt.evidence - _learn(reduced, modes, left, noise, learnt).evidence


def _process(learnt: _Learnt, k: int, gain: float) -> Process:
    size, x, y, z = np.exp(learnt.log[k]).tolist()
    return Process(f"D{AXES[learnt.coordinates[k]]}", size, (x, y, z), gain)


def _figures(work: _Adjustment, learnt: _Learnt, alone: _Learnt) -> Figures:
    def left(model: _Learnt, held_out: bool) -> float:
        log_variance = model.log_variance(work.modes)
        if not held_out:
            x, _, keep = work.solve(model.coordinates, log_variance, model.noise)
            square, count = work.misses(x, keep, range(FOLDS + 1))
            return math.sqrt(square / count)
        square = count = 0.0
        for fold in range(1, FOLDS + 1):
            x, _, keep = work.solve(model.coordinates, log_variance, model.noise, fold)
            some, n = work.misses(x, keep, (fold,))
            square, count = square + some, count + n
        return math.sqrt(square / count)

    return Figures(left(alone, False), left(learnt, False), left(alone, True), left(learnt, True))


def _mapped(work: _Adjustment, learnt: _Learnt, found: NonRigid, processes: tuple[Process, ...]) -> NonRigid:
    fit, modes, size = work.fit, work.modes, work.size
    x, covariance, keep = work.solve(learnt.coordinates, learnt.log_variance(modes), learnt.noise)
    whole = np.zeros(size + work.own)
    joint = np.zeros((len(whole), len(whole)))
    use = keep[keep < len(whole)]
    whole[use] = x[: len(use)]
    joint[np.ix_(use, use)] = covariance[: len(use), : len(use)]
    # what displacement curves can hold goes there, so that the field is what they cannot
    low, side = modes.centre_mm - modes.reach_mm / REACH, 2.0 * modes.reach_mm / REACH
    at = low + side * np.random.default_rng(1).random((_PLACES, 3))
    straight = _straight(fit.parameters, at).reshape(-1, size) / _CLOSE
    field = _wide(modes, at).reshape(len(straight), -1) / _CLOSE
    solver = _solver(straight.T @ straight + fit.prior.precision()[0])
    taken = solver(straight.T @ field)
    change = np.eye(len(whole))
    change[:size, size:] = taken
    whole, joint = change @ whole, change @ joint @ change.T
    moved = dataclasses.replace(fit, theta=whole[:size], covariance=joint[:size, :size])
    return dataclasses.replace(
        found, fit=moved, processes=processes, modes=modes, mean=whole[size:], joint=joint, taken=taken
    )
