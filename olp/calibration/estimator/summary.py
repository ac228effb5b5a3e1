"""What an adjustment found, as data and as findings: sizes, uncertainties, what was not seen and its cost."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from olp.calibration.estimator.adjustment import (
    MISFIT,
    Fit,
    LengthsResult,
    LineResult,
    PointsResult,
    RadialResult,
    misfit,
)
from olp.calibration.estimator.curves import half_of, joints_of, sigma_of
from olp.calibration.estimator.parameters import LEVER_MM, SHEAR
from olp.calibration.estimator.prior import class_of
from olp.calibration.estimator.screening import LENGTH, POINT
from olp.calibration.observations.diagonals import Diagonal
from olp.core.arrays import Array
from olp.core.machine import COMPONENTS, SQUARENESS, Vector
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.errormodel.calibration import Calibration
from olp.findings.catalogue import Finding

#: A curve whose uncertainty the readings lowered by less than this factor was not seen.
UNSEEN = 0.7
#: Correlations from here on are told, the strongest of them.
STRONG, MOST_PAIRS = 0.9, 8
#: The runs may spread by so much more than stated.
SCATTER = 1.5
#: A square is as stated up to so many standard deviations.
SQUARE_OFF = 4.0
#: Offsets of the reflector that differ by less than this are one.
ONE_OFFSET_MM = 1.0
_POINTS = 41
_LISTED = 10


def unit_of(name: str) -> tuple[str, float]:
    """The unit in which people read a component, and the factor to it."""
    return ("urad", 1.0 / RAD_PER_URAD) if name[1] in "ABC" else ("um", UM_PER_MM)


def grid_of(fit: Fit, name: str) -> Array:
    """Positions over the box along the axis of a component."""
    low, high = fit.box_mm[AXES.index(name[2])].tolist()
    return np.linspace(low, high, _POINTS)


def unseen(fit: Fit) -> dict[str, float]:
    """Components that no reading tells of, with the standard deviation that they may have (mm or rad)."""
    found: dict[str, float] = {}
    matrix, _ = fit.prior.precision()
    for name in COMPONENTS:
        if name in fit.prior.shapes:
            continue
        at = fit.parameters.slices[name]
        q = grid_of(fit, name)
        rows = fit.parameters.spaces[name].values(q)
        before = np.einsum("nk,kl,nl->n", rows, np.linalg.inv(matrix[at, at]), rows, optimize=True)
        after = np.einsum("nk,kl,nl->n", rows, fit.covariance[at, at], rows, optimize=True)
        if after.mean() > UNSEEN**2 * before.mean():
            found[name] = math.sqrt(float(after.mean()))
    return found


def scale_unseen(fit: Fit) -> float | None:
    """Standard deviation of the common scale of all axes, where no reading tells of it."""
    prior = np.linalg.inv(fit.prior.precision()[0])
    row = np.zeros(fit.parameters.size)
    for axis, letter in enumerate(AXES):
        ends = fit.curve(f"E{letter}{letter}", fit.box_mm[axis])
        row += (ends[1] - ends[0]) / float(np.ptp(fit.box_mm, axis=1).sum())
    before, after = float(row @ prior @ row), float(row @ fit.covariance @ row)
    return math.sqrt(after) if after > UNSEEN**2 * before else None


def scales_open(fit: Fit) -> tuple[Array, Array]:
    """(k, 3) changes of the scales of X, Y, Z that no reading tells of, and (3 - k, 3) the combinations of
    them that are known, each with a largest part of 1: what the readings left of the prior covariance."""
    prior = np.linalg.inv(fit.prior.precision()[0])
    rows = np.zeros((3, fit.parameters.size))
    for axis, letter in enumerate(AXES):
        ends = fit.curve(f"E{letter}{letter}", fit.box_mm[axis])
        rows[axis] = (ends[1] - ends[0]) / float(np.ptp(fit.box_mm[axis]))
    values, vectors = np.linalg.eigh(rows @ prior @ rows.T)
    root = (vectors * np.sqrt(values)) @ vectors.T
    back = np.linalg.inv(root)
    share, parts = np.linalg.eigh(back @ rows @ fit.covariance @ rows.T @ back)
    unknown = share > UNSEEN**2
    changes, known = (root @ parts[:, unknown]).T, (back @ parts[:, ~unknown]).T
    return _largest_one(changes), _largest_one(known)


def _largest_one(rows: Array) -> Array:
    at = np.argmax(np.abs(rows), axis=1)
    return np.asarray(rows / rows[np.arange(len(rows)), at][:, None])


def squareness_unseen(fit: Fit) -> dict[str, float]:
    """Values of squareness that no reading tells of, with their standard deviation in rad."""
    matrix, _ = fit.prior.precision()
    found = {}
    for name in SQUARENESS:
        at = fit.parameters.slices[name].start
        if fit.covariance[at, at] * matrix[at, at] > UNSEEN**2:
            found[name] = math.sqrt(float(fit.covariance[at, at]))
    return found


def cost_um(fit: Fit, name: str, sigma: float, tools: Sequence[Vector]) -> float:
    """What a component of standard deviation sigma costs at the longest lever in the box, in um."""
    if name in SQUARENESS:
        _, axis, _ = SHEAR[name]
        return sigma * float(np.ptp(fit.box_mm[axis])) * UM_PER_MM
    if name[1] in AXES:
        return sigma * UM_PER_MM
    axis, turn = AXES.index(name[2]), "ABC".index(name[1])
    lever = []
    for k in range(3):
        if k == turn:
            continue
        tool = max(
            (abs(t[k] - fit.parameters.places[f"E{AXES[axis]}{AXES[axis]}"].tool_mm[k]) for t in tools),
            default=0.0,
        )
        lever.append(tool + (float(np.ptp(fit.box_mm[k])) if k in fit.parameters.after(axis) else 0.0))
    return sigma * math.hypot(*lever) * UM_PER_MM


def summary(fit: Fit, calibration: Calibration, tools: Sequence[Vector]) -> dict[str, Any]:
    """Everything that was found, with units in the keys."""
    hidden = unseen(fit)
    return {
        "schema": "olp-fit-1",
        "machine": fit.measurements.machine,
        "chain": fit.parameters.chain,
        "measured": fit.measurements.measured,
        "temperature_degC": fit.measurements.temperature_degC,
        "datum_mm": list(fit.parameters.datum_mm),
        "box_mm": {axis: fit.box_mm[k].tolist() for k, axis in enumerate(AXES)},
        "readings": sum(len(result.line.value) for result in fit.lines)
        + len(fit.measurements.squareness)
        + sum(len(result.residual) for result in fit.radial),
        "points": sum(len(result.points.axis_mm) for result in fit.points),
        "lengths": sum(len(result.residual) for result in fit.lengths),
        "left_out": len(fit.outliers),
        "chi_square_per_freedom": fit.chi_square / fit.freedom,
        "degrees_of_freedom": fit.freedom,
        "position_errors": [_row(fit, n, hidden) for n in COMPONENTS if n[1] in AXES],
        "angular_errors": [_row(fit, n, hidden) for n in COMPONENTS if n[1] not in AXES],
        "squareness": [_square_row(fit, name) for name in SQUARENESS],
        "lost_motion_um": {
            axis: calibration.backlash_mm[k] * UM_PER_MM for k, axis in enumerate(AXES)
        },
        "cyclic": [
            {
                "name": term.component,
                "period_mm": term.period_mm,
                f"amplitude_{unit_of(term.component)[0]}": term.amplitude * unit_of(term.component)[1],
            }
            for term in calibration.cyclic
        ],
        "lines_of_lengths": [_line_row(r) for r in fit.lines if r.line.quantity != "angle"],
        "lines_of_angles": [_line_row(r) for r in fit.lines if r.line.quantity == "angle"],
        **({"frame": _frame_row(fit)} if fit.parameters.framed else {}),
        "sets_of_points": [_points_row(result) for result in fit.points],
        "stations": [_station_row(result) for result in fit.lengths],
        "sets_of_pods": [
            {
                "name": result.pods.source or "pods",
                "directions": 2 * result.pods.azimuth_rad.size,
                "sigma_urad": result.pods.sigma / RAD_PER_URAD,
                "chi_square_per_reading": result.chi_square / len(result.residual),
            }
            for result in fit.pods
        ],
        "diagonals_and_circles": [_radial_row(result) for result in fit.radial],
        "not_observed": [
            {"name": name, "costs_um": cost_um(fit, name, sigma, tools)}
            for name, sigma in {**hidden, **squareness_unseen(fit)}.items()
        ],
    }  # fmt: skip


def _row(fit: Fit, name: str, hidden: dict[str, float]) -> dict[str, Any]:
    unit, scale = unit_of(name)
    q = grid_of(fit, name)
    values = fit.curve(name, q) @ fit.theta
    sigma = sigma_of(fit, name, q)
    shape = fit.prior.shapes.get(name)
    residuals = [result.residual for result in fit.lines if result.line.component == name]
    half = np.abs(half_of(fit, name, q))
    through = "points" if fit.points or fit.lengths or fit.pods else "other lines"
    words = "not observed" if name in hidden else through if shape is None else "smooth"
    if shape is not None and shape.features:
        steps = len(joints_of(fit, name))
        kinks = len(shape.features) - steps
        words = ", ".join(f"{n} {what}{'s' * (n > 1)}" for n, what in ((steps, "step"), (kinks, "kink")) if n)
    return {
        "name": name,
        f"range_{unit}": float(np.ptp(values)) * scale,
        f"sigma_{unit}": float(np.sqrt(np.mean(sigma**2))) * scale,
        f"residual_{unit}": _rms(residuals) * scale if residuals else None,
        f"half_reversal_{unit}": float(half.max()) * scale,
        "shape": words,
    }


def _square_row(fit: Fit, name: str) -> dict[str, Any]:
    row = fit.squareness(name)
    return {
        "name": name,
        "value_urad": float(row @ fit.theta) / RAD_PER_URAD,
        "sigma_urad": math.sqrt(float(row @ fit.covariance @ row)) / RAD_PER_URAD,
    }


def _line_row(result: LineResult) -> dict[str, Any]:
    line, (unit, scale) = result.line, unit_of(result.line.component)
    return {
        "name": line.component,
        "file": line.source,
        "readings": len(line.value),
        f"sigma_reading_{unit}": result.noise.sigma * scale,
        f"drift_a_run_{unit}": result.noise.drift * scale,
        f"residual_{unit}": _rms([result.residual]) * scale,
        "chi_square_per_reading": result.chi_square / len(line.value),
    }


def _points_row(result: PointsResult) -> dict[str, Any]:
    n = len(result.points.axis_mm)
    return {
        "name": result.points.source or "points",
        "points": n,
        "sigma_coordinate_um": result.points.sigma * UM_PER_MM,
        "residual_um": float(np.sqrt(np.mean(result.residual**2))) * UM_PER_MM,
        "chi_square_per_coordinate": result.chi_square / (3 * n),
    }


def _radial_row(result: RadialResult) -> dict[str, Any]:
    taken = result.taken
    words = f"diagonal {taken.name}" if isinstance(taken, Diagonal) else f"circle {taken.plane}"
    return {
        "name": words,
        "file": taken.source,
        "readings": len(result.residual),
        "sigma_reading_um": result.noise.sigma * UM_PER_MM,
        "residual_um": _rms([result.residual]) * UM_PER_MM,
        "chi_square_per_reading": result.chi_square / len(result.residual),
    }


def _frame_row(fit: Fit) -> dict[str, Any]:
    """The axes as a whole in the machine's frame, at the datum."""
    part = fit.parameters.slices["frame"]
    value, sigma = fit.theta[part], np.sqrt(np.diag(fit.covariance)[part])
    per_urad = 1.0 / LEVER_MM / RAD_PER_URAD
    return {
        "shift_um": (value[:3] * UM_PER_MM).tolist(),
        "sigma_shift_um": (sigma[:3] * UM_PER_MM).tolist(),
        "turn_urad": (value[3:6] * per_urad).tolist(),
        "sigma_turn_urad": (sigma[3:6] * per_urad).tolist(),
        "tool_turn_urad": (value[6:] * per_urad).tolist(),
        "sigma_tool_turn_urad": (sigma[6:] * per_urad).tolist(),
    }


def _station_row(result: LengthsResult) -> dict[str, Any]:
    return {
        "name": result.lengths.source or "station",
        "lengths": len(result.residual),
        "place_mm": result.station.place_mm.tolist(),
        "residual_um": _rms([result.residual]) * UM_PER_MM,
        "chi_square_per_length": result.chi_square / len(result.residual),
    }


def _rms(parts: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


# -- findings --------------------------------------------------------------------------------------------


def findings_of(
    fit: Fit, tools: Sequence[Vector], travel_mm: Sequence[tuple[float, float]] | None
) -> tuple[Finding, ...]:
    """What a person should know about an adjustment."""
    return (
        *_unseen_findings(fit, tools),
        *_scale_findings(fit),
        *_outlier_findings(fit),
        *_scatter_findings(fit),
        *_step_findings(fit),
        *_correlation_findings(fit),
        *_box_findings(fit, travel_mm),
        *_misfit_findings(fit),
        *(
            Finding("OLP853", f"{name}, period {period:g} mm: {reason}")
            for (name, period), reason in fit.cyclic_unseen.items()
        ),
    )


def _unseen_findings(fit: Fit, tools: Sequence[Vector]) -> Iterator[Finding]:
    for name, sigma in unseen(fit).items():
        unit, scale = unit_of(name)
        arm = f", and {sigma * 1e5:.2g} um more for 100 mm of tool" if name[1] in "ABC" else ""
        like = {"angle": "angles", "straightness": "straightness", "positioning": "positioning"}[
            class_of(name)
        ]
        yield Finding(
            "OLP801",
            f"{name} stands as zero: as large as other {like} of this machine ({sigma * scale:.2g} {unit}) "
            f"it costs {cost_um(fit, name, sigma, tools):.2g} um at the longest lever in the box{arm}"
            + _why(fit, name),
        )
    for name in squareness_unseen(fit):
        yield Finding(
            "OLP806",
            f"{name} stands as zero: 100 urad of it cost {cost_um(fit, name, 1e-4, tools):.3g} um",
        )


def _scale_findings(fit: Fit) -> Iterator[Finding]:
    scale = scale_unseen(fit)
    if scale is not None:
        yield Finding("OLP809", f"the scale of all axes together is known to {scale * 1e6:.2g} um/m only")
        return
    changes, known = scales_open(fit)
    if len(changes) == 1:
        yield Finding("OLP809", f"scales that change by {_of_scales(changes[0])} change no reading")
    elif len(changes) == 2:
        words = _of_scales(known[0])
        yield Finding("OLP809", f"of the scales of X, Y and Z one combination is known alone: {words}")


def _of_scales(row: Array) -> str:
    return ", ".join(f"{part:+.2f} {axis}" for axis, part in zip(AXES, row.tolist(), strict=True))


def _why(fit: Fit, name: str) -> str:
    """What points with too few offsets of the reflector have to do with an angle that they do not see."""
    seen = [*(r.points.tool_mm for r in fit.points), *(r.lengths.tool_mm for r in fit.lengths)]
    seen += [r.pods.tool_mm for r in fit.pods]
    if not seen or name[1] in AXES:
        return ""
    tools = np.concatenate(seen)
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
        unit, scale = ("um", UM_PER_MM) if component in (POINT, LENGTH) else unit_of(component)
        rows = ", ".join(f"row {o.row} ({o.value * scale:.2f} {unit})" for o in own[:_LISTED])
        more = f" and {len(own) - _LISTED} more" if len(own) > _LISTED else ""
        yield Finding(
            "OLP802",
            f"{source or component}: {rows}{more}, up to {max(o.deviations for o in own):.0f} sigma off",
            own[0].row, tuple(o.row for o in own[:_LISTED]), len(own),
        )  # fmt: skip


def _scatter_findings(fit: Fit) -> Iterator[Finding]:
    for result in fit.lines:
        line, noise = result.line, result.noise
        if noise.spread is not None and line.sigma > 0.0 and noise.spread > SCATTER * line.sigma:
            unit, scale = unit_of(line.component)
            yield Finding(
                "OLP803",
                f"{line.source or line.component}: runs spread by {noise.spread * scale:.2g} {unit}, sigma "
                f"is stated as {line.sigma * scale:.2g} {unit}",
            )
    for taken, noise in ((r.taken, r.noise) for r in fit.radial):
        if noise.spread is not None and taken.sigma > 0.0 and noise.spread > SCATTER * taken.sigma:
            yield Finding(
                "OLP803",
                f"{taken.source or 'diagonal'}: runs spread by {noise.spread * UM_PER_MM:.2g} um, sigma is "
                f"stated as {taken.sigma * UM_PER_MM:.2g} um",
            )


def _step_findings(fit: Fit) -> Iterator[Finding]:
    for name in COMPONENTS:
        unit, scale = unit_of(name)
        for step, height in joints_of(fit, name):
            yield Finding(
                "OLP804",
                f"{name} jumps by {height * scale:+.1f} {unit} between {name[2]} {step.low_mm:g} and "
                f"{step.high_mm:g} mm",
            )


def _correlation_findings(fit: Fit) -> Iterator[Finding]:
    """Of squareness, and of what each curve does from one end of the box to the other."""
    functionals = {name: fit.squareness(name) for name in SQUARENESS}
    hidden = {**unseen(fit), **squareness_unseen(fit)}
    for name in COMPONENTS:
        if name not in hidden:
            ends = fit.curve(name, fit.box_mm[AXES.index(name[2])])
            functionals[name] = ends[1] - ends[0]
    names = [name for name in functionals if name not in hidden]
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
    # one square among thousands of readings is nothing to chi-square as a whole
    for square in fit.measurements.squares:
        part = fit.parameters.slices.get(f"error of square {square.name}")
        if part is None:
            continue
        value, variance = float(fit.theta[part][0]), float(fit.covariance[part, part][0, 0])
        off = abs(value - square.error_rad)
        if off > SQUARE_OFF * math.sqrt(max(square.sigma_rad**2 - variance, 0.01 * square.sigma_rad**2)):
            yield Finding(
                "OLP808",
                f"the error of square {square.name} comes out as {value / RAD_PER_URAD:.1f} urad, "
                f"{square.error_rad / RAD_PER_URAD:.1f} +- {square.sigma_rad / RAD_PER_URAD:.2g} is stated",
            )
    if misfit(fit) > MISFIT:
        parts = [(r.chi_square / len(r.line.value), r.line.source or r.line.component) for r in fit.lines]
        parts += [(r.chi_square / r.residual.size, r.points.source or "points") for r in fit.points]
        parts += [(r.chi_square / len(r.residual), r.lengths.source or "lengths") for r in fit.lengths]
        parts += [(r.chi_square / len(r.residual), r.pods.source or "pods") for r in fit.pods]
        parts += [(r.chi_square / len(r.residual), r.taken.source or "diagonals") for r in fit.radial]
        value, source = max(parts)
        yield Finding(
            "OLP808",
            f"chi-square is {fit.chi_square / fit.freedom:.2f} a degree of freedom, {value:.2f} in {source}",
        )
