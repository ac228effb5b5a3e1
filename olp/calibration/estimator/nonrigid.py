"""What rigid bodies do not describe: a smooth field of deviations beside the curves, from points.

The field (a Gaussian process for each of DX, DY, DZ, see `olp.calibration.estimator.field`) joins the
adjustment as further unknowns. Size and lengths of each process, and by how much noise is larger than stated,
are those of the largest marginal likelihood. A process stays only where the evidence for it is strong and
where it foretells readings that it has not seen.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from olp.calibration.estimator.field import REACH, Modes
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.marginal import Learnt, Noise, alone_of, learn, log_evidence, part_of
from olp.calibration.estimator.widened import FOLDS, Adjustment, Reduced, solver_of, straight, wide
from olp.core.arrays import Array
from olp.core.progress import Progress, silent
from olp.core.units import AXES

#: A process is there where the log evidence for it is larger than this: chances of 1 to 3000, and what its
#: four free numbers gain from noise alone is far below.
EVIDENCE = 8.0
#: So many times that is beyond doubt.
CLEAR = 3.0
#: It has to make what it foretells better by this share.
FORETELLS = 0.005
#: Fewer volumetric points tell nothing of a field.
FEWEST_POINTS = 40
#: Places by which what curves can hold is taken out of the field, and how closely they are to follow
#: it in mm: loosely, so that what is left stays smooth.
_PLACES, _CLOSE = 500, 0.02


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
        assert self.modes is not None and self.taken is not None
        at, parameters = np.asarray(position, float), self.fit.parameters
        own, curves = self.modes.values(at) @ self.mean.reshape(3, -1).T, self.taken @ self.mean
        for row, axis in product(range(3), range(3)):
            name = f"E{AXES[row]}{AXES[axis]}"
            own[:, row] -= parameters.spaces[name].values(at[:, axis]) @ curves[parameters.slices[name]]
        for row in range(3):
            for part, values in parameters.shear(row, at):
                own[:, row] -= values @ curves[part]
        return np.asarray(own)

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
        rows = wide(self.modes, at)
        return np.asarray(rows - straight(self.fit.parameters, at) @ self.taken)


def nonrigid(fit: Fit, *, noise: Noise = "learnt", progress: Progress | None = None) -> NonRigid:
    """What volumetric readings of a fit hold beyond rigid bodies, or the reason why nothing is mapped.

    `noise` "stated" takes the stated uncertainties as they are; "learnt" lets the evidence scale them, and
    what is believed of the curves with them.
    """
    tell = progress or silent
    sets = [result.state.observation for result in fit.scattered]
    count = sum(len(taken.axis_mm) for taken in sets)
    tools = np.concatenate([np.zeros((0, 3)), *(taken.tool_mm for taken in sets)])
    tools = np.unique(np.round(tools, 3), axis=0)
    nothing = NonRigid(fit, (), None, None, 1.0, count, tools, "")
    if count < FEWEST_POINTS:
        reason = (
            f"{count} volumetric points; expected at least {FEWEST_POINTS}: lines alone are one place each"
        )
        return dataclasses.replace(nothing, reason=reason)
    at = np.concatenate([taken.axis_mm for taken in sets])
    box = np.stack([at.min(axis=0), at.max(axis=0)], axis=1)
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
    tell("what is not rigid", 0.0)
    work = Adjustment(fit, modes)
    reduced = work.reduced()
    alone = alone_of(reduced, noise)
    learnt = learn(reduced, modes, (0, 1, 2), noise)
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
        learnt = learn(reduced, modes, left, noise, learnt)
    figures = _figures(work, learnt, alone)
    found = dataclasses.replace(nothing, best=best, figures=figures, noise=learnt.noise)
    if not processes:
        reason = f"the evidence for a field is {best.evidence:.1f}, expected above {EVIDENCE:g}"
        return dataclasses.replace(found, reason=reason)
    if figures.held_out_after > (1.0 - FORETELLS) * figures.held_out_before:
        reason = (
            f"readings held out are foretold within {figures.held_out_after:.2f} sigma with a field, "
            f"{figures.held_out_before:.2f} without; expected {FORETELLS:.1%} better"
        )
        return dataclasses.replace(found, reason=reason)
    return _mapped(work, learnt, found, processes)


def _gain(reduced: Reduced, modes: Modes, learnt: Learnt, i: int, noise: Noise) -> float:
    """The log evidence for one coordinate beside the others. These and the noise are learnt anew without it
    only where that could decide: it makes the gain smaller."""
    left = tuple(k for k in learnt.coordinates if k != i)
    if left:
        own = part_of(reduced, modes.size, left)
        log = learnt.log[[learnt.coordinates.index(k) for k in left]]
        gain = learnt.evidence - log_evidence(own, modes, log, math.log(learnt.noise))[0]
        if not EVIDENCE < gain < CLEAR * EVIDENCE:
            return gain
    return learnt.evidence - learn(reduced, modes, left, noise, learnt).evidence


def _process(learnt: Learnt, k: int, gain: float) -> Process:
    size, x, y, z = np.exp(learnt.log[k]).tolist()
    return Process(f"D{AXES[learnt.coordinates[k]]}", size, (x, y, z), gain)


def _figures(work: Adjustment, learnt: Learnt, alone: Learnt) -> Figures:
    def left(model: Learnt, held_out: bool) -> float:
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


def _mapped(work: Adjustment, learnt: Learnt, found: NonRigid, processes: tuple[Process, ...]) -> NonRigid:
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
    curves = straight(fit.parameters, at).reshape(-1, size) / _CLOSE
    field = wide(modes, at).reshape(len(curves), -1) / _CLOSE
    solver = solver_of(curves.T @ curves + fit.prior.precision()[0])
    taken = solver(curves.T @ field)
    change = np.eye(len(whole))
    change[:size, size:] = taken
    results, chi_square = work.left(whole)
    prior = work.believed(learnt.coordinates, learnt.log_variance(modes), learnt.noise)
    readings = sum(len(result.residual) for result in fit.results)
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
        found, fit=moved, processes=processes, modes=modes, mean=whole[size:], joint=joint, taken=taken
    )
