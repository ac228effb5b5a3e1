"""One linear Gaussian adjustment of all readings of a machine.

theta holds the 18 curves, their half differences of directions, cyclic terms and squareness; every reading
is a linear functional of it and of nuisances (zeros, slopes, squares, drift, scale). The result carries the
covariance of all of it, so that it also shows what is not observable from these data.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from olp.calibration.estimator.basis import Wave
from olp.calibration.estimator.beside import block_of
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.model import MOST, Model, artefacts_of
from olp.calibration.estimator.normal import Block, Normal, Solved, solve
from olp.calibration.estimator.parameters import Parameters
from olp.calibration.estimator.prior import Class, Prior
from olp.calibration.observations.base import Noise, Outlier, Result, State
from olp.calibration.observations.lines import Line
from olp.calibration.observations.measurements import Measurements
from olp.core.machine import Vector
from olp.core.progress import Progress, silent
from olp.core.units import AXES
from olp.core.values import dataclass

#: Cells of the curves of an axis that has points or lengths but no lines. They double while the fit is bad.
POINT_CELLS = 16
#: A fit is bad where chi-square is more than so many standard deviations above its expectation.
MISFIT = 5.0
#: More cells are kept where they lower reduced chi-square to less than this share.
BETTER = 0.8
#: The adjustment is repeated at most so often, after cyclic terms or points were left out.
PASSES = 8
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
    normal: Normal
    solved: Solved


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

    def attempt(cells: int) -> Fit:
        start = _start(measurements, chain, travel_mm, datum_mm, tell, cells)
        return _finish(start, _iterate(start, tell))

    cells = POINT_CELLS
    best = attempt(cells)
    alone = {line.component[2] for line in measurements.lines} != set(AXES)
    while alone and best.misfit > MISFIT and cells < MOST:
        cells *= 2
        finer = attempt(cells)
        if finer.chi_square / finer.freedom > BETTER * best.chi_square / best.freedom:
            break
        best = finer
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


def _iterate(start: _Start, tell: Progress) -> _Settled:
    """Solves, updates what is not linear, and leaves out noise terms and outliers, until nothing changes."""
    states, outliers, waves = start.states, [*start.outliers], start.model.waves
    theta = np.zeros(0)
    learnt: dict[str, Class] | None = None
    for _ in range(PASSES):
        parameters = start.model.parameters(waves)
        prior = Prior(parameters, start.model.shapes, artefacts_of(start.measurements, parameters))
        if learnt is not None:
            prior.classes = learnt
        theta = theta if len(theta) == parameters.size else np.zeros(parameters.size)
        blocks = [block_of(state, theta, parameters, start.model.shapes) for state in states]
        tell("adjustment", 0.5)
        normal, solved = _adjusted(blocks, prior, learnt is None)
        learnt, theta = prior.classes, solved.theta
        seen = _waves_seen(parameters, solved)
        steps = [state.step(block, theta) for state, block in zip(states, blocks, strict=True)]
        settled = all(step.small for step in steps)
        slips = [state.slips(block, theta, settled) for state, block in zip(states, blocks, strict=True)]
        if seen == waves and settled and not any(slips):
            break
        waves = seen
        outliers += [slip for some in slips for slip in some]
        states = [state.moved(step, some) for state, step, some in zip(states, steps, slips, strict=True)]
    return _Settled(states, blocks, outliers, prior, normal, solved)


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


def _adjusted(blocks: Iterable[Block], prior: Prior, learn: bool) -> tuple[Normal, Solved]:
    """The readings' normal equations and their solution, with what the prior is to learn from them."""
    normal = Normal.of(prior.parameters.size)
    for block in blocks:
        normal.add(block)
    prior.push(normal)
    if learn:
        prior.learn(normal)
    solved = solve(normal, *prior.precision())
    if learn and prior.size_from(solved.theta):
        solved = solve(normal, *prior.precision())
    return normal, solved


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
