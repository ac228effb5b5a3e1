"""What a set of measurements would determine about a machine, predicted before measuring: the covariance of
the adjustment for its geometry, with curves of the size and smoothness that machines have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.calibration.design.known import Known, judged_rows, lengths_of
from olp.calibration.estimator.basis import CurveSpace, Scales, Spline
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.model import artefacts_of
from olp.calibration.estimator.normal import Normal, solve
from olp.calibration.estimator.parameters import MeasuringLine, Parameters
from olp.calibration.estimator.prior import Prior
from olp.calibration.estimator.summary import squareness_unobservable, unobservable
from olp.calibration.observations.base import State
from olp.calibration.observations.lines import shared_names
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.references import Square
from olp.core.arrays import Array
from olp.core.machine import COMPONENTS, Vector
from olp.core.units import AXES
from olp.core.values import dataclass

#: Size and scales of curves of machines that are off by 0.1 mm or so (mm, rad).
TYPICAL = {
    "positioning": (0.03, Scales(0.0, 0.25, 0.0, 0.0)),
    "straightness": (0.012, Scales(0.0, 0.10, 0.0, 0.0)),
    "angle": (2e-5, Scales(0.0, 2e-4, 0.0, 0.0)),
}
#: Cells of the splines.
_CELLS = 12


@dataclass(frozen=True, slots=True, eq=False)
class Planned:
    """Observations with nominal readings, and where their stations and pods would be."""

    machine: str
    states: tuple[State, ...]
    squares: tuple[Square, ...] = ()
    periods_mm: tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]] = ((), (), ())

    @property
    def measurements(self) -> Measurements:
        """As they would be taken."""
        taken = tuple(state.observation for state in self.states)
        return Measurements(self.machine, taken, self.squares, self.periods_mm)


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """`rms_mm` is the predicted rms length of the residual after correction, at fresh positions with the
    given tools, in the frame that fits best; `worst_mm` is its largest value at one position. `hidden` are
    errors that would not be observable."""

    rms_mm: float
    worst_mm: float
    hidden: tuple[str, ...]


def predict(planned: Planned, chain: str, box_mm: Array, tools: Sequence[Vector]) -> Prediction:
    """The prediction for a box (3, 2) and tool vectors."""
    taken = planned.measurements
    parameters = _parameters(taken, chain, box_mm)
    prior = Prior(parameters, {}, artefacts_of(taken, parameters), TYPICAL)
    theta = np.zeros(parameters.size)
    normal = Normal.of(parameters.size)
    for state in planned.states:
        normal.add(state.block(parameters, theta))
    precision, logdet = prior.precision()
    solved = solve(normal, precision, logdet)
    predicted = Fit(taken, parameters, theta, solved.covariance, prior, (), (), box_mm, 0.0, 1.0, {})
    length = lengths_of(judged_rows(parameters, box_mm, tools), solved.covariance)
    rms, worst = float(np.sqrt((length**2).mean())), float(length.max())
    return Prediction(rms, worst, (*unobservable(predicted), *squareness_unobservable(predicted)))


def known_of_machines(chain: str, box_mm: Array) -> Known:
    """What is known of a machine of which nothing was measured yet."""
    parameters = parameters_of_machines(chain, box_mm)
    return Known.of_prior(parameters, Prior(parameters, {}, {}, dict(TYPICAL)).precision()[0])


def parameters_of_machines(chain: str, box_mm: Array) -> Parameters:
    """The unknowns of a machine of which nothing was measured yet."""
    return _parameters(Measurements(""), chain, box_mm)


def _parameters(taken: Measurements, chain: str, box_mm: Array) -> Parameters:
    x, y, z = (float(np.clip(0.0, *side)) for side in box_mm)
    datum = (x, y, z)
    spaces, measuring_lines = {}, {}
    for name in COMPONENTS:
        axis = AXES.index(name[2])
        spline = Spline(float(box_mm[axis, 0]), float(box_mm[axis, 1]), _CELLS)
        kind = "straight" if name[1] in AXES and name[1] != name[2] else "zero"
        spaces[name] = CurveSpace.of(spline, (), datum[axis], kind)
        if name[1] in AXES:
            own = [line for line in taken.lines if line.component == name]
            line_mm = list(own[0].line_mm if own else datum)
            line_mm[axis] = datum[axis]
            tool = own[0].tool_mm if own else (0.0, 0.0, 0.0)
            measuring_lines[name] = MeasuringLine((line_mm[0], line_mm[1], line_mm[2]), tool)
    shared = sorted({name for line in taken.lines for name in shared_names(line)})
    return Parameters(chain, datum, spaces, measuring_lines, shared=tuple(shared))
