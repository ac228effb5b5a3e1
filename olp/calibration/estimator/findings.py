"""The findings about an adjustment: what is not observable, readings left out, misfits."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from olp.calibration.estimator.adjustment import MISFIT
from olp.calibration.estimator.beside import block_of
from olp.calibration.estimator.character import class_of
from olp.calibration.estimator.curves import joints_of
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.prior import ROUGHER
from olp.calibration.estimator.summary import (
    cost_um,
    scale_unobservable,
    scales_open,
    squareness_unobservable,
    unobservable,
)
from olp.calibration.observations.base import ScatteredState, residual_and_chi_square, unit_of
from olp.calibration.observations.radial import AlongState
from olp.core.arrays import Array
from olp.core.machine import COMPONENTS, SQUARENESS, Vector
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.errormodel.quality import Fitted
from olp.findings.catalogue import Finding

#: Correlations above this are reported.
STRONG = 0.9
#: At most so many correlations are reported, the strongest.
MOST_PAIRS = 8
#: The error of a square agrees with the stated one up to so many standard deviations.
SQUARE_OFF = 4.0
#: Offsets of the reflector that differ by less than this are one.
ONE_OFFSET_MM = 1.0
#: A negative backlash is told where it is so many standard deviations below zero.
REVERSED = 4.0
#: A smaller negative backlash than this harms no part (0.2 um).
REVERSED_MM = 2e-4
#: Positions over which the mean backlash of an axis is taken.
_REVERSALS = 9
#: Readings that one finding lists, at most.
_LISTED = 10


def findings_of(
    fit: Fit, tools: Sequence[Vector], travel_mm: Sequence[tuple[float, float]] | None
) -> tuple[Finding, ...]:
    """All findings about an adjustment."""
    return (
        *_unobservable_findings(fit, tools),
        *_scale_findings(fit),
        *_outlier_findings(fit),
        *_scatter_findings(fit),
        *_step_findings(fit),
        *_reversal_findings(fit),
        *_correlation_findings(fit),
        *_box_findings(fit, travel_mm),
        *_misfit_findings(fit),
        *(
            Finding("OLP853", f"{name}, period {period:g} mm: {reason}")
            for (name, period), reason in fit.cyclic_unobservable.items()
        ),
    )


def _unobservable_findings(fit: Fit, tools: Sequence[Vector]) -> Iterator[Finding]:
    """One finding for all errors of a class that no reading shows for one reason; the report lists each."""
    hidden = unobservable(fit)
    reasons = {name: (class_of(name), _why(fit, name)) for name in hidden}
    for reason in dict.fromkeys(reasons.values()):
        names = [name for name in hidden if reasons[name] == reason]
        unit, scale = unit_of(names[0])
        sigma = [hidden[name] for name in names]
        cost = max(cost_um(fit, name, hidden[name], tools) for name in names)
        angles = reason[0] == "angle"
        arm = f", plus {max(sigma) * 1e5:.2g} um per 100 mm of tool" if angles else ""
        yield Finding(
            "OLP801",
            f"{_zero(names)}: as large as other {'angles' if angles else reason[0]} of this machine "
            f"({_span(sigma, scale)} {unit}) {'they cost up to' if names[1:] else 'it costs'} {cost:.2g} um "
            f"at the longest lever arm in the box{arm}{reason[1]}",
        )
    square = list(squareness_unobservable(fit))
    if square:
        cost = max(cost_um(fit, name, 1e-4, tools) for name in square)
        yield Finding("OLP806", f"{_zero(square)}: 100 urad cost up to {cost:.3g} um")


def _zero(names: Sequence[str]) -> str:
    return f"{', '.join(names)} {'are' if len(names) > 1 else 'is'} taken as zero"


def _span(values: Sequence[float], scale: float) -> str:
    """The range of some values in another unit, or the one that they are when rounded."""
    low, high = (f"{value * scale:.2g}" for value in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"


def _scale_findings(fit: Fit) -> Iterator[Finding]:
    scale = scale_unobservable(fit)
    if scale is not None:
        yield Finding(
            "OLP809", f"the common scale of all axes has a standard uncertainty of {scale * 1e6:.2g} um/m"
        )
        return
    changes, known = scales_open(fit)
    if len(changes) == 1:
        yield Finding("OLP809", f"a change of the scales by {_of_scales(changes[0])} changes no reading")
    elif len(changes) == 2:
        words = _of_scales(known[0])
        yield Finding("OLP809", f"of the scales of X, Y and Z only one combination is observable: {words}")


def _of_scales(row: Array) -> str:
    return ", ".join(f"{part:+.2f} {axis}" for axis, part in zip(AXES, row.tolist(), strict=True))


def _why(fit: Fit, name: str) -> str:
    """Why points with too few offsets of the reflector do not determine an angle."""
    offsets = [result.state.observation.tool_mm for result in fit.scattered]
    if not offsets or name[1] in AXES:
        return ""
    tools = np.concatenate(offsets)
    size = np.linalg.svd(tools - tools.mean(axis=0), compute_uv=False)
    if size[0] < ONE_OFFSET_MM * math.sqrt(len(tools)):
        return "; the points have one offset of the reflector"
    if size[1] < ONE_OFFSET_MM * math.sqrt(len(tools)):
        return "; the offsets of the reflector lie on one line, and the turn about that line moves no point"
    return ""


def _outlier_findings(fit: Fit) -> Iterator[Finding]:
    files = dict.fromkeys((o.source, o.component) for o in fit.outliers)
    for source, component in files:
        own = [o for o in fit.outliers if (o.source, o.component) == (source, component)]
        unit, scale = unit_of(component) if component in COMPONENTS else ("um", UM_PER_MM)
        rows = ", ".join(f"row {o.row} ({o.value * scale:.2f} {unit})" for o in own[:_LISTED])
        more = f" and {len(own) - _LISTED} more" if len(own) > _LISTED else ""
        yield Finding(
            "OLP802",
            f"{source or component}: {rows}{more}, up to {max(o.deviations for o in own):.0f} sigma off",
            own[0].row, tuple(o.row for o in own[:_LISTED]), len(own),
        )  # fmt: skip


def _scatter_findings(fit: Fit) -> Iterator[Finding]:
    for result in fit.results:
        words = result.state.scatter()
        if words is not None:
            yield Finding("OLP803", words)


def _step_findings(fit: Fit) -> Iterator[Finding]:
    for name in COMPONENTS:
        unit, scale = unit_of(name)
        for step, height in joints_of(fit, name):
            yield Finding(
                "OLP804",
                f"{name} jumps by {height * scale:+.1f} {unit} between {name[2]} {step.low_mm:g} and "
                f"{step.high_mm:g} mm",
            )


def _reversal_findings(fit: Fit) -> Iterator[Finding]:
    """Axes that go farther where they reverse, which no backlash does."""
    for axis, letter in enumerate(AXES):
        name = f"E{letter}{letter}"
        space = fit.parameters.halves.get(name)
        if space is None:
            continue
        low, high = fit.box_mm[axis].tolist()
        rows = space.values(np.linspace(low, high, _REVERSALS)).mean(axis=0)
        part = fit.parameters.slices[f"half {name}"]
        backlash = -2.0 * float(rows @ fit.theta[part])
        sigma = 2.0 * math.sqrt(max(float(rows @ fit.covariance[part, part] @ rows), 0.0))
        if backlash < -max(REVERSED * sigma, REVERSED_MM):
            yield Finding(
                "OLP855",
                f"{letter}: {backlash * UM_PER_MM:.2f} +- {sigma * UM_PER_MM:.2g} um in the mean; after a "
                "reversal the axis goes farther, not less far",
            )


def _correlation_findings(fit: Fit) -> Iterator[Finding]:
    """Correlations of squareness, and of the change of each curve from one end of the box to the other."""
    functionals = {name: fit.squareness(name) for name in SQUARENESS}
    hidden = {**unobservable(fit), **squareness_unobservable(fit)}
    for name in COMPONENTS:
        if name not in hidden:
            ends = fit.curve(name, fit.box_mm[AXES.index(name[2])])
            functionals[name] = ends[1] - ends[0]
    names = [name for name in functionals if name not in hidden]
    if not names:
        # readings that cannot be those of one machine determine nothing; the misfit says so
        return
    rows = np.stack([functionals[name] for name in names])
    joint = rows @ fit.covariance @ rows.T
    size = np.sqrt(np.maximum(np.diag(joint), 1e-300))
    pairs = [
        (float(joint[i, j] / size[i] / size[j]), names[i], names[j])
        for i, j in combinations(range(len(names)), 2)
    ]
    strong = sorted((p for p in pairs if abs(p[0]) > STRONG), key=lambda p: -abs(p[0]))[:MOST_PAIRS]
    for value, first, second in strong:
        yield Finding("OLP805", f"{first} and {second}: correlation {value:+.2f}")


def _box_findings(fit: Fit, travel_mm: Sequence[tuple[float, float]] | None) -> Iterator[Finding]:
    for axis, letter in enumerate(AXES if travel_mm is not None else ""):
        assert travel_mm is not None
        low, high = fit.box_mm[axis]
        if low > travel_mm[axis][0] + 1e-6 or high < travel_mm[axis][1] - 1e-6:
            yield Finding(
                "OLP807",
                f"{letter} {low:g} to {high:g} mm of the travel, {travel_mm[axis][0]:g} to "
                f"{travel_mm[axis][1]:g} mm",
            )


def _misfit_findings(fit: Fit) -> Iterator[Finding]:
    # one wrong square among thousands of readings hardly changes chi-square
    for square in fit.measurements.squares:
        part = fit.parameters.slices.get(f"error of square {square.name}")
        if part is None:
            continue
        value, variance = float(fit.theta[part][0]), float(fit.covariance[part, part][0, 0])
        off = abs(value - square.error_rad)
        if off > SQUARE_OFF * math.sqrt(max(square.sigma_rad**2 - variance, 0.01 * square.sigma_rad**2)):
            yield Finding(
                "OLP808",
                f"the error of square {square.name} is estimated as {value / RAD_PER_URAD:.1f} urad, stated "
                f"as {square.error_rad / RAD_PER_URAD:.1f} +- {square.sigma_rad / RAD_PER_URAD:.2g} urad",
            )
    if fit.misfit > MISFIT and _rougher(fit).deviations > MISFIT:
        named = [result for result in fit.results if result.state.noun]
        parts = [(result.chi_square / len(result.residual), result.state.label) for result in named]
        value, source = max(parts)
        yield Finding(
            "OLP808",
            f"reduced chi-square is {fit.chi_square / fit.freedom:.2f}, {value:.2f} per reading of {source}",
        )


def _rougher(fit: Fit) -> Fitted:
    """How well all readings fit where curves are as rough beside targets as may still be."""
    hidden = {
        name: replace(one, variance=ROUGHER**2 * one.variance) for name, one in fit.prior.hidden.items()
    }
    chi_square = 0.0
    for result in fit.results:
        if isinstance(result.state, ScatteredState | AlongState):
            block = block_of(result.state, fit.theta, fit.parameters, hidden)
            chi_square += residual_and_chi_square(block, fit.theta)[1]
        else:
            chi_square += result.chi_square
    return Fitted("all readings", chi_square, fit.freedom)
