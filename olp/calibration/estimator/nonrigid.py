"""What rigid bodies do not describe: a smooth field of deviations beside the curves, from points.

The field (a Gaussian process for each of DX, DY, DZ, see `olp.calibration.estimator.field`) joins the
adjustment as further unknowns. Size and lengths of each process, and by how much noise is larger than stated,
are those of the largest marginal likelihood. A process is kept only where the evidence for it is strong, and
where it predicts held-out readings better.
"""

from __future__ import annotations

import dataclasses
import math
from itertools import product

import numpy as np

from olp.calibration.estimator.field import REACH, Modes
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.marginal import Learnt, Noise, alone_of, learn, log_evidence, part_of
from olp.calibration.estimator.widened import FOLDS, Adjustment, Reduced, solver_of, straight, wide
from olp.core.arrays import Array
from olp.core.progress import Progress, silent
from olp.core.units import AXES
from olp.core.values import dataclass

#: A process is accepted where its log evidence is above this: odds of 3000 to 1, far above what its four free
#: numbers gain from noise alone.
EVIDENCE = 8.0
#: A gain of so many times EVIDENCE is not checked further.
CLEAR = 3.0
#: A field has to predict held-out readings better by this share.
PREDICTION_GAIN = 0.005
#: A field needs so many volumetric points.
FEWEST_POINTS = 40
#: Positions at which the part of the field that curves can hold is removed from it.
_POSITIONS = 500
#: How closely the curves follow the field there, mm: loosely, so that the field remains smooth.
_CLOSE = 0.02


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
    """The result. `fit` has the curves that go with the field; where there is no field (no `processes`)
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
        assert self.modes is not None and self.taken is not None
        points, parameters = np.asarray(position, float), self.fit.parameters
        own, curves = self.modes.values(points) @ self.mean.reshape(3, -1).T, self.taken @ self.mean
        for row, axis in product(range(3), range(3)):
            name = f"E{AXES[row]}{AXES[axis]}"
            own[:, row] -= parameters.spaces[name].values(points[:, axis]) @ curves[parameters.slices[name]]
        for row in range(3):
            for part, values in parameters.shear(row, points):
                own[:, row] -= values @ curves[part]
        return np.asarray(own)

    def sigma(self, position: Array, tool: Array) -> Array:
        """(n, 3) standard uncertainty of curves and field together, with a tool vector, mm."""
        points = np.asarray(position, float)
        rows = self.fit.design(points, np.asarray(tool, float))
        if self.joint is not None:
            rows = np.concatenate([rows, self._rows(points)], axis=2)
        joint = self.fit.covariance if self.joint is None else self.joint
        variance = np.einsum("nik,kl,nil->ni", rows, joint, rows, optimize=True)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))

    def _rows(self, points: Array) -> Array:
        """(n, 3, 3 m) the field's dependence on its coefficients: the sines less the part in the curves."""
        assert self.modes is not None and self.taken is not None
        rows = wide(self.modes, points)
        return np.asarray(rows - straight(self.fit.parameters, points) @ self.taken)


def nonrigid(fit: Fit, *, noise: Noise = "learnt", progress: Progress | None = None) -> NonRigid:
    """The field that volumetric readings of a fit show beyond rigid bodies, or the reason why there is none.

    `noise` "stated" takes the stated uncertainties as they are; "learnt" lets the evidence scale them, and
    the prior of the curves with them.
    """
    tell = progress or silent
    sets = [one.state.observation for one in fit.scattered]
    count = sum(len(taken.axis_mm) for taken in sets)
    tools = np.concatenate([np.zeros((0, 3)), *(taken.tool_mm for taken in sets)])
    tools = np.unique(np.round(tools, 3), axis=0)
    nothing = NonRigid(fit, (), None, None, 1.0, count, tools, "")
    if count < FEWEST_POINTS:
        reason = (
            f"{count} volumetric points; expected at least {FEWEST_POINTS}, as lines alone do not fill the "
            "volume"
        )
        return dataclasses.replace(nothing, reason=reason)
    positions = np.concatenate([taken.axis_mm for taken in sets])
    box = np.stack([positions.min(axis=0), positions.max(axis=0)], axis=1)
    flat = [
        axis
        for axis, a, b in zip(AXES, np.ptp(box, axis=1), np.ptp(fit.box_mm, axis=1), strict=True)
        if a < 0.5 * b
    ]
    if flat:
        reason = f"the points reach over less than half of the box along {' and '.join(flat)}"
        return dataclasses.replace(nothing, reason=reason)
    whole = np.stack(
        [np.minimum(box[:, 0], fit.box_mm[:, 0]), np.maximum(box[:, 1], fit.box_mm[:, 1])], axis=1
    )
    modes = Modes.over(whole, count)
    tell("non-rigid field", 0.0)
    work = Adjustment(fit, modes)
    reduced = work.reduced()
    alone = alone_of(reduced, noise)
    learnt = learn(reduced, modes, (0, 1, 2), noise)
    best: Process | None = None
    while True:
        tell("non-rigid field", 0.5)
        gains = {i: _gain(reduced, modes, learnt, i, noise) for i in learnt.coordinates}
        processes = tuple(_process(learnt, k, gains[i]) for k, i in enumerate(learnt.coordinates))
        best = best or max(processes, key=lambda p: p.evidence)
        weakest = min(gains, key=lambda i: gains[i], default=None)
        if weakest is None or gains[weakest] > EVIDENCE:
            break
        kept = tuple(i for i in learnt.coordinates if i != weakest)
        learnt = learn(reduced, modes, kept, noise, learnt)
    figures = _figures(work, learnt, alone)
    result = dataclasses.replace(nothing, best=best, figures=figures, noise=learnt.noise)
    if not processes:
        reason = f"the evidence for a field is {best.evidence:.1f}, expected above {EVIDENCE:g}"
        return dataclasses.replace(result, reason=reason)
    if figures.held_out_after > (1.0 - PREDICTION_GAIN) * figures.held_out_before:
        reason = (
            f"held-out readings are predicted within {figures.held_out_after:.2f} sigma with a field, "
            f"{figures.held_out_before:.2f} without; expected {PREDICTION_GAIN:.1%} better"
        )
        return dataclasses.replace(result, reason=reason)
    return _mapped(work, learnt, result, processes)


def _gain(reduced: Reduced, modes: Modes, learnt: Learnt, i: int, noise: Noise) -> float:
    """The log evidence for one coordinate beside the others. These and the noise are learnt again without it
    only where that could decide, as it makes the gain smaller."""
    others = tuple(k for k in learnt.coordinates if k != i)
    if others:
        own = part_of(reduced, modes.size, others)
        log = learnt.log[[learnt.coordinates.index(k) for k in others]]
        gain = learnt.evidence - log_evidence(own, modes, log, math.log(learnt.noise))[0]
        if not EVIDENCE < gain < CLEAR * EVIDENCE:
            return gain
    return learnt.evidence - learn(reduced, modes, others, noise, learnt).evidence


def _process(learnt: Learnt, k: int, gain: float) -> Process:
    size, x, y, z = np.exp(learnt.log[k]).tolist()
    return Process(f"D{AXES[learnt.coordinates[k]]}", size, (x, y, z), gain)


def _figures(work: Adjustment, learnt: Learnt, alone: Learnt) -> Figures:
    def misfit(model: Learnt, held_out: bool) -> float:
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

    return Figures(misfit(alone, False), misfit(learnt, False), misfit(alone, True), misfit(learnt, True))


def _mapped(work: Adjustment, learnt: Learnt, result: NonRigid, processes: tuple[Process, ...]) -> NonRigid:
    fit, modes, size = work.fit, work.modes, work.size
    x, covariance, keep = work.solve(learnt.coordinates, learnt.log_variance(modes), learnt.noise)
    whole = np.zeros(size + work.own)
    joint = np.zeros((len(whole), len(whole)))
    use = keep[keep < len(whole)]
    whole[use] = x[: len(use)]
    joint[np.ix_(use, use)] = covariance[: len(use), : len(use)]
    # what displacement curves can hold is moved to them, so that the field holds only the other part
    low, side = modes.centre_mm - modes.reach_mm / REACH, 2.0 * modes.reach_mm / REACH
    positions = low + side * np.random.default_rng(1).random((_POSITIONS, 3))
    curves = straight(fit.parameters, positions).reshape(-1, size) / _CLOSE
    field = wide(modes, positions).reshape(len(curves), -1) / _CLOSE
    solver = solver_of(curves.T @ curves + fit.prior.precision()[0])
    taken = solver(curves.T @ field)
    change = np.eye(len(whole))
    change[:size, size:] = taken
    results, chi_square = work.results_of(whole)
    prior = work.believed(learnt.coordinates, learnt.log_variance(modes), learnt.noise)
    readings = sum(len(one.residual) for one in fit.results)
    used = len(x) - float(np.einsum("ij,ji->", covariance, prior))
    whole, joint = change @ whole, change @ joint @ change.T
    moved = dataclasses.replace(
        fit,
        theta=whole[:size],
        covariance=joint[:size, :size],
        results=results,
        chi_square=chi_square,
        freedom=max(readings - used, 1.0),
    )
    return dataclasses.replace(
        result, fit=moved, processes=processes, modes=modes, mean=whole[size:], joint=joint, taken=taken
    )
