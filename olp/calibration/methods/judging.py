"""How far a method of calibration is off at points that it was not made from, and which one to use."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.parameters import frame_columns
from olp.calibration.observations.points import Points, deviations
from olp.core.arrays import Array
from olp.core.values import dataclass

#: The error in mm (n, 3) of a machine at axis positions (n, 3) with tool vectors (n, 3).
Errors = Callable[[Array, Array], Array]
#: Residuals up to this share above the least one count as equally good: then time decides.
EQUAL = 1.1
#: Points at which the stated uncertainty is computed, at most.
_MOST = 200


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """A method at independent points, in mm.

    `residual_mm` is the rms length, `worst_mm` the largest one, both in the best-fit frame. `stated_mm` is
    the rms length that the method itself expects there, None where it states none. Times are in hours; None
    where the machine file does not state what they need.
    """

    name: str
    residual_mm: float
    worst_mm: float
    stated_mm: float | None = None
    machine_h: float | None = None
    set_up_h: float = 0.0

    @property
    def hours(self) -> float:
        return self.set_up_h + (self.machine_h or 0.0)


def judged(points: Points, errors: Errors) -> tuple[float, float]:
    """rms and largest length (mm) of what a method leaves at points, in the frame that fits best: a work
    offset absorbs it. Raises CannotCompute where the points determine no frame."""
    rest = deviations(points) - errors(points.axis_mm, points.tool_mm)
    length = np.linalg.norm(_unframed(points, rest.reshape(-1, 1)).reshape(-1, 3), axis=1)
    return float(np.sqrt(np.mean(length**2))), float(length.max())


def noise_of(points: Points) -> float:
    """rms length (mm) that the noise of the points alone leaves in the best-fit frame."""
    return points.sigma * float(np.sqrt(max(3.0 - 6.0 / len(points.axis_mm), 0.0)))


def beyond_noise(residual_mm: float, points: Points) -> float:
    """The rms length (mm) of a residual less what the noise of the points makes of it."""
    return float(np.sqrt(max(residual_mm**2 - noise_of(points) ** 2, 0.0)))


def stated(points: Points, fit: Fit) -> float:
    """rms length (mm) that a fit expects at the points, in the best-fit frame: its covariance, and what its
    curves do not show between targets."""
    rows = np.unique(np.linspace(0, len(points.axis_mm) - 1, _MOST).astype(int))
    part = Points(points.axis_mm[rows], points.tool_mm[rows], points.measured_mm[rows], points.sigma)
    design = fit.design(part.axis_mm, part.tool_mm)
    framed = _unframed(part, design.reshape(-1, design.shape[2]))
    variance = np.einsum("nk,kl,nl->n", framed, fit.covariance, framed, optimize=True)
    between = fit.hidden(part.axis_mm, part.tool_mm)
    return float(np.sqrt(max(variance.sum() + between.sum(), 0.0) / len(rows)))


def best(methods: Sequence[Judged]) -> Judged:
    """The method to use: of those that are equally good the quickest one to measure."""
    least = min(method.residual_mm for method in methods)
    good = [method for method in methods if method.residual_mm <= EQUAL * least]
    return min(
        good, key=lambda method: (round(method.hours, 3), method.stated_mm is None, method.residual_mm)
    )


def _unframed(points: Points, rows: Array) -> Array:
    """(3 n, k) columns less what shifts and turns of the frame do."""
    tip = points.axis_mm + points.tool_mm
    frame = frame_columns(tip - tip.mean(axis=0)).reshape(-1, 6)
    q = np.linalg.qr(frame)[0]
    return np.asarray(rows - q @ (q.T @ rows))
