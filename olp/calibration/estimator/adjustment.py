"""One linear Gaussian adjustment of all readings of a machine.

theta holds the 18 curves, their half differences of directions, cyclic terms and squareness; every reading
is a linear functional of it and of nuisances (zeros, slopes, squares, drift, scale). The result carries the
covariance of all of it, so that it also shows what is not observable from these data.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from olp.calibration.estimator.basis import Wave
from olp.calibration.estimator.beside import block_of, shares_of
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.joint_search import found
from olp.calibration.estimator.lined import Lined
from olp.calibration.estimator.model import MOST, Model, artefacts_of
from olp.calibration.estimator.normal import Block, Normal, Solved, solve
from olp.calibration.estimator.parameters import Parameters
from olp.calibration.estimator.prior import Prior
from olp.calibration.estimator.unread import Readings, Unread
from olp.calibration.observations.base import Noise, Outlier, Result, ScatteredState, State
from olp.calibration.observations.lines import Line
from olp.calibration.observations.measurements import Measurements
from olp.core.arrays import Array
from olp.core.machine import Vector
from olp.core.progress import Progress, silent
from olp.core.units import AXES
from olp.core.values import dataclass

#: Cells of the curves of an axis that has points or lengths but no lines. They double while the fit is bad.
POINT_CELLS = 16
#: A fit is bad where chi-square is more than so many standard deviations above its expectation.
MISFIT = 5.0
#: Still finer cells are tried where the last ones raised the log evidence by so much.
WORTH = 60.0
#: So many readings are needed for each unknown of present cells before finer ones are tried.
READINGS = 2.0
#: Finer cells are tried where present ones hide a variance so many times that of the noise of readings.
HIDES = 0.5
#: The adjustment is repeated at most so often, after cyclic terms or points were left out.
PASSES = 8
#: Curves without lines are learnt in so many passes at most.
LEARNING = 2
#: A cyclic term below so many standard deviations is noise.
CYCLIC_SIGNIFICANT = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class _Start:
    """What the first pass begins with."""

    measurements: Measurements
    model: Model
    states: Sequence[State]
    outliers: Sequence[Outlier]


@dataclass(frozen=True, slots=True, eq=False)
class _Settled:
    """What the last pass ended with: the states of observations, their blocks, the solution."""

    states: Sequence[State]
    blocks: Sequence[Block]
    outliers: Sequence[Outlier]
    prior: Prior
    unread: Unread
    normal: Normal
    solved: Solved

    @property
    def coarse(self) -> bool:
        """Whether cells hide so much that readings of some instrument are worse for it than by their noise,
        and there are more readings than finer cells would have unknowns."""
        p, theta = self.prior.parameters, self.solved.theta
        if self.normal.count < READINGS * p.size:
            return False
        for state in self.states:
            if isinstance(state, ScatteredState):
                block, shares = shares_of(state, theta, p, self.prior.hidden)
                noise = np.concatenate([chunk.sigma for chunk in block.chunks()])
                if np.median(shares.sum(axis=1) / noise**2) > HIDES:
                    return True
        return False


def fit(
    measurements: Measurements,
    chain: str,
    *,
    travel_mm: Sequence[tuple[float, float]] | None = None,
    datum_mm: Vector | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Estimate the errors of a machine from all its readings.

    `travel_mm` bounds the box; the datum is the position in the box nearest to zero if left out. Where an
    axis has points or lengths only, and they do not fit, its curves get more cells. Raises ConfigError where
    a line cannot be used, CannotCompute where no reading depends on an axis.
    """
    tell = progress or silent

    def attempt(cells: int, before: _Settled | None = None) -> tuple[Fit, _Settled]:
        start = _start(measurements, chain, travel_mm, datum_mm, tell, cells)
        lined = Lined(start.model.shapes, start.model.hides)
        unread, learning = Unread(start.model.others, lined), LEARNING
        if before is not None:
            start = replace(start, states=before.states, outliers=before.outliers)
            unread, learning = before.unread, 1
        end = _iterate(start, unread, learning, tell)
        return _finish(start, end), end

    cells = POINT_CELLS
    best, end = attempt(cells)
    alone = {line.component[2] for line in measurements.lines} != set(AXES)
    while alone and cells < MOST and (best.misfit > MISFIT or end.coarse):
        cells *= 2
        finer, other = attempt(cells, end)
        gain = other.solved.evidence - end.solved.evidence
        if gain > 0.0:
            best, end = finer, other
        if gain < WORTH:
            break
    return best


def _start(
    measurements: Measurements,
    chain: str,
    travel_mm: Sequence[tuple[float, float]] | None,
    datum_mm: Vector | None,
    tell: Progress,
    cells: int,
) -> _Start:
    """Screens the readings, lays out the unknowns, and gives every observation its start."""
    tell("noise", 0.0)
    screened = [taken.screened() for taken in measurements.observations]
    kept = [one.observation for one in screened]
    lines: list[tuple[Line, Noise]] = [
        (one.observation, one.noise)
        for one in screened
        if isinstance(one.observation, Line) and one.noise is not None
    ]
    model = Model.of(measurements, kept, lines, chain, travel_mm, datum_mm, cells, tell)
    states = [one.observation.start(one.noise) for one in screened]
    return _Start(measurements, model, states, [slip for one in screened for slip in one.outliers])


def _iterate(start: _Start, unread: Unread, learning: int, tell: Progress) -> _Settled:
    """Solves, updates what is not linear, and leaves out noise terms and outliers, until nothing changes."""
    states, outliers, waves = start.states, [*start.outliers], start.model.waves
    theta = np.zeros(0)
    for turn in range(PASSES):
        prior = _prior(start, unread, waves)
        theta = _sized(theta, prior)
        if turn < learning:
            # before the first pass the places of instruments are only near
            readings = Readings.of(prior, states, theta)
            if readings is not None and unread.heard and _found(unread, readings):
                prior = _prior(start, unread, waves)
                theta = _sized(theta, prior)
                readings = Readings.of(prior, states, theta)
            if readings is not None and unread.learn(readings):
                prior = _prior(start, unread, waves)
        parameters = prior.parameters
        blocks = [block_of(state, theta, parameters, prior.hidden) for state in states]
        tell("adjustment", 0.5)
        normal, solved = _adjusted(blocks, prior)
        theta = solved.theta
        seen = _waves_seen(parameters, solved)
        steps = [state.step(block, theta) for state, block in zip(states, blocks, strict=True)]
        settled = all(step.small for step in steps)
        slips = [state.slips(block, theta, settled) for state, block in zip(states, blocks, strict=True)]
        if seen == waves and settled and not any(slips):
            break
        if any(slips) and unread.joints:
            # a reading that slipped is told best by a joint on either side of it: without it, look again
            unread.joints, learning = {}, turn + 2
        waves = seen
        outliers += [slip for some in slips for slip in some]
        states = [state.moved(step, some) for state, step, some in zip(states, steps, slips, strict=True)]
    return _Settled(states, blocks, outliers, prior, unread, normal, solved)


def _prior(start: _Start, unread: Unread, waves: Mapping[str, tuple[Wave, ...]]) -> Prior:
    """The unknowns with these cyclic terms and the joints found so far, and what is expected of them."""
    parameters = start.model.parameters(waves, unread.joints)
    squares = artefacts_of(start.measurements, parameters)
    return Prior(parameters, unread.lined.shapes(), squares, unread.classes, unread.joints)


def _sized(theta: Array, prior: Prior) -> Array:
    """theta, or zeros where it is that of other unknowns."""
    return theta if len(theta) == prior.parameters.size else np.zeros(prior.parameters.size)


def _found(unread: Unread, readings: Readings) -> bool:
    """Adds the joints of rails that readings show beside those that are known; whether there are any."""
    before = unread.joints
    unread.joints = found(readings, before)
    return unread.joints != before


def _finish(start: _Start, end: _Settled) -> Fit:
    """The results of every observation, and the covariance of all unknowns."""
    model, theta, normal = start.model, end.solved.theta, end.normal
    results = [
        Result.of(state, block, theta, end.solved.covariance)
        for state, block in zip(end.states, end.blocks, strict=True)
    ]
    chi_square = sum((result.chi_square for result in results), 0.0)
    # readings less what the fit used up of their freedom
    used = float(np.trace(end.solved.covariance @ normal.H))
    freedom = max(normal.count - used - normal.free, 1.0)
    # readings that fit worse than their noise show that the model is incomplete
    covariance = end.solved.covariance * max(1.0, chi_square / freedom)
    parameters = end.prior.parameters
    return Fit(
        start.measurements, parameters, theta, covariance, end.prior, tuple(results), tuple(end.outliers),
        model.box_mm, chi_square, freedom, model.unobservable,
    )  # fmt: skip


def _adjusted(blocks: Iterable[Block], prior: Prior) -> tuple[Normal, Solved]:
    """The readings' normal equations and their solution."""
    normal = Normal.of(prior.parameters.size)
    for block in blocks:
        normal.add(block)
    prior.push(normal)
    return normal, solve(normal, *prior.precision())


def _waves_seen(parameters: Parameters, solved: Solved) -> dict[str, tuple[Wave, ...]]:
    """Cyclic terms that stand out of their noise."""
    seen: dict[str, tuple[Wave, ...]] = {}
    for name, waves in parameters.waves.items():
        start = parameters.slices[f"wave {name}"].start
        for k, wave in enumerate(waves):
            pair = slice(start + 2 * k, start + 2 * k + 2)
            sigma = float(np.sqrt(np.trace(solved.covariance[pair, pair]) / 2.0))
            if float(np.hypot(*solved.theta[pair])) > CYCLIC_SIGNIFICANT * sigma:
                seen[name] = (*seen.get(name, ()), wave)
    return seen
