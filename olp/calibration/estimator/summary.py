"""The results of an adjustment as data: sizes, uncertainties, what is not observable and its cost."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from olp.calibration.estimator.curves import half_of, joints_of, sigma_of
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.parameters import LEVER_ARM_MM, SHEAR
from olp.calibration.estimator.warming import temperature_rows
from olp.calibration.iso230.conventions import lean_words
from olp.calibration.observations.base import rms, unit_of
from olp.calibration.observations.references import error_name, form_at
from olp.core.arrays import Array
from olp.core.machine import COMPONENTS, SQUARENESS, ZERO, Vector
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.errormodel.calibration import Calibration

#: A curve is not observable where its standard uncertainty is above this share of the prior one.
UNOBSERVABLE = 0.7
#: Positions at which a curve is evaluated.
_POINTS = 41
#: Sums of every report, in their order.
TALLIES = ("readings", "points", "lengths")
#: Tables of every report, in their order; the frame only where some points were measured in it.
SECTIONS = (
    *("lines_of_lengths", "lines_of_angles", "frame", "sets_of_points", "stations", "sets_of_pods"),
    "diagonals_and_circles",
)


def grid_of(fit: Fit, name: str) -> Array:
    """Positions over the box along the axis of a component."""
    low, high = fit.box_mm[AXES.index(name[2])].tolist()
    return np.linspace(low, high, _POINTS)


def unobservable(fit: Fit) -> dict[str, float]:
    """Components that are not observable, with the standard deviation that they may have (mm or rad)."""
    sigmas: dict[str, float] = {}
    matrix, _ = fit.prior.precision()
    for name in COMPONENTS:
        if name in fit.prior.shapes:
            continue
        part = fit.parameters.slices[name]
        q = grid_of(fit, name)
        rows = fit.parameters.spaces[name].values(q)
        before = np.einsum("nk,kl,nl->n", rows, np.linalg.inv(matrix[part, part]), rows, optimize=True)
        after = np.einsum("nk,kl,nl->n", rows, fit.covariance[part, part], rows, optimize=True)
        if after.mean() > UNOBSERVABLE**2 * before.mean():
            sigmas[name] = math.sqrt(float(after.mean()))
    return sigmas


def scale_unobservable(fit: Fit) -> float | None:
    """Standard deviation of the common scale of all axes; None where the readings determine it."""
    prior = np.linalg.inv(fit.prior.precision()[0])
    row = np.zeros(fit.parameters.size)
    for axis, letter in enumerate(AXES):
        ends = fit.curve(f"E{letter}{letter}", fit.box_mm[axis])
        row += (ends[1] - ends[0]) / float(np.ptp(fit.box_mm, axis=1).sum())
    before, after = float(row @ prior @ row), float(row @ fit.covariance @ row)
    return math.sqrt(after) if after > UNOBSERVABLE**2 * before else None


def scales_open(fit: Fit) -> tuple[Array, Array]:
    """(k, 3) changes of the scales of X, Y, Z that are not observable, and (3 - k, 3) the combinations of
    them that are. Each has a largest part of 1. They follow from the prior and posterior covariance."""
    prior = np.linalg.inv(fit.prior.precision()[0])
    rows = np.zeros((3, fit.parameters.size))
    for axis, letter in enumerate(AXES):
        ends = fit.curve(f"E{letter}{letter}", fit.box_mm[axis])
        rows[axis] = (ends[1] - ends[0]) / float(np.ptp(fit.box_mm[axis]))
    values, vectors = np.linalg.eigh(rows @ prior @ rows.T)
    root = (vectors * np.sqrt(values)) @ vectors.T
    back = np.linalg.inv(root)
    share, parts = np.linalg.eigh(back @ rows @ fit.covariance @ rows.T @ back)
    unknown = share > UNOBSERVABLE**2
    changes, known = (root @ parts[:, unknown]).T, (back @ parts[:, ~unknown]).T
    return _largest_one(changes), _largest_one(known)


def _largest_one(rows: Array) -> Array:
    columns = np.argmax(np.abs(rows), axis=1)
    return np.asarray(rows / rows[np.arange(len(rows)), columns][:, None])


def squareness_unobservable(fit: Fit) -> dict[str, float]:
    """Values of squareness that are not observable, with their standard deviation in rad."""
    matrix, _ = fit.prior.precision()
    sigmas = {}
    for name in SQUARENESS:
        index = fit.parameters.slices[name].start
        if fit.covariance[index, index] * matrix[index, index] > UNOBSERVABLE**2:
            sigmas[name] = math.sqrt(float(fit.covariance[index, index]))
    return sigmas


def cost_um(fit: Fit, name: str, sigma: float, tools: Sequence[Vector]) -> float:
    """The error in um from a component of standard deviation sigma, at the longest lever arm in the box."""
    if name in SQUARENESS:
        _, axis, _ = SHEAR[name]
        return sigma * float(np.ptp(fit.box_mm[axis])) * UM_PER_MM
    if name[1] in AXES:
        return sigma * UM_PER_MM
    axis, turn = AXES.index(name[2]), "ABC".index(name[1])
    lever_arm = []
    for k in range(3):
        if k == turn:
            continue
        tool = max(
            (
                abs(t[k] - fit.parameters.measuring_lines[f"E{AXES[axis]}{AXES[axis]}"].tool_mm[k])
                for t in tools
            ),
            default=0.0,
        )
        lever_arm.append(tool + (float(np.ptp(fit.box_mm[k])) if k in fit.parameters.after(axis) else 0.0))
    return sigma * math.hypot(*lever_arm) * UM_PER_MM


def summary(fit: Fit, calibration: Calibration, tools: Sequence[Vector]) -> dict[str, Any]:
    """All results, with units in the keys."""
    hidden = unobservable(fit)
    return {
        "schema": "olp-fit-1",
        "machine": fit.measurements.machine,
        "chain": fit.parameters.chain,
        "measured": fit.measurements.measured,
        "temperature_degC": fit.measurements.temperature_degC,
        "datum_mm": list(fit.parameters.datum_mm),
        "box_mm": {axis: fit.box_mm[k].tolist() for k, axis in enumerate(AXES)},
        **_tallies(fit),
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
        **_sections(fit),
        **_artefacts(fit),
        **temperature_rows(fit),
        "not_observed": [
            {"name": name, "costs_um": cost_um(fit, name, sigma, tools)}
            for name, sigma in {**hidden, **squareness_unobservable(fit)}.items()
        ],
    }  # fmt: skip


def _row(fit: Fit, name: str, hidden: dict[str, float]) -> dict[str, Any]:
    unit, scale = unit_of(name)
    q = grid_of(fit, name)
    values = fit.curve(name, q) @ fit.theta
    sigma = sigma_of(fit, name, q)
    shape = fit.prior.shapes.get(name)
    residuals = [result.residual for result in fit.results if result.state.component == name]
    half = np.abs(half_of(fit, name, q))
    through = "points" if fit.scattered else "other lines"
    words = "not observed" if name in hidden else through if shape is None else "smooth"
    if shape is not None and shape.features:
        steps = len(joints_of(fit, name))
        kinks = len(shape.features) - steps
        words = ", ".join(f"{n} {what}{'s' * (n > 1)}" for n, what in ((steps, "step"), (kinks, "kink")) if n)
    return {
        "name": name,
        f"range_{unit}": float(np.ptp(values)) * scale,
        f"sigma_{unit}": float(np.sqrt(np.mean(sigma**2))) * scale,
        f"residual_{unit}": rms(np.concatenate(residuals)) * scale if residuals else None,
        f"half_reversal_{unit}": float(half.max()) * scale,
        "shape": words,
    }


def _tallies(fit: Fit) -> dict[str, int]:
    """How many readings, points and lengths were used."""
    tallies = Counter(dict.fromkeys(TALLIES, 0))
    for result in fit.results:
        if result.state.tally:
            tallies[result.state.tally] += result.state.count
    return dict(tallies)


def _sections(fit: Fit) -> dict[str, Any]:
    """The tables of observations; those of SECTIONS also where they are empty."""
    tables: dict[str, Any] = {}
    for section in SECTIONS:
        if section != "frame":
            tables[section] = []
        elif fit.parameters.framed:
            tables[section] = _frame_row(fit)
    for result in fit.results:
        if result.state.section:
            tables.setdefault(result.state.section, []).append(result.row())
    return tables


def _square_row(fit: Fit, name: str) -> dict[str, Any]:
    """A squareness in the gauge of the datum, as it is written; and that of lines through the middle of the
    box with the tool vector of most lines, where a square would be put."""
    lines = [line.tool_mm for line in fit.measurements.lines if line.quantity != "angle"]
    tool = np.array(max(lines, key=lines.count) if lines else ZERO)
    middle = fit.squareness_at(name, fit.box_mm.mean(axis=1), tool)
    values = {}
    for key, row in (("", fit.squareness(name)), ("mid_box_", middle)):
        values[f"{key}value_urad"] = float(row @ fit.theta) / RAD_PER_URAD
        values[f"{key}sigma_urad"] = math.sqrt(max(float(row @ fit.covariance @ row), 0.0)) / RAD_PER_URAD
    mid = (values[f"mid_box_{key}_urad"] * RAD_PER_URAD for key in ("value", "sigma"))
    return {"name": name, **values, "in_the_middle": lean_words(name, *mid)}


def _artefacts(fit: Fit) -> dict[str, Any]:
    """Tables of squares and straightedges that lines were read against: what the readings tell of them."""
    squares = [
        {
            "name": square.name,
            "error_urad": round(float(fit.theta[part][0]) / RAD_PER_URAD, 2) + 0.0,
            "sigma_urad": math.sqrt(float(fit.covariance[part, part][0, 0])) / RAD_PER_URAD,
        }
        for square in fit.measurements.squares
        if (part := fit.parameters.slices.get(error_name(square.name))) is not None
    ]
    edges = [row for one in fit.measurements.straightedges for row in _form_rows(fit, one.name)]
    tables = {"squares": squares, "straightedges": edges}
    return {key: rows for key, rows in tables.items() if rows}


def _form_rows(fit: Fit, name: str) -> list[dict[str, Any]]:
    """The form of a straightedge at its targets, less the straight line that fits best."""
    found = sorted(
        (at, fit.parameters.slices[key].start) for key in fit.parameters.shared
        if (at := form_at(name, key)) is not None
    )  # fmt: skip
    q, index = np.array([at for at, _ in found]), [start for _, start in found]
    lines = np.linalg.qr(np.stack([np.ones(len(q)), q], axis=1))[0]
    less = np.eye(len(q)) - lines @ lines.T
    form = less @ fit.theta[index] * UM_PER_MM
    sigma = np.sqrt(np.diag(less @ fit.covariance[np.ix_(index, index)] @ less)) * UM_PER_MM
    return [
        {"name": name, "target_mm": at, "form_um": value, "sigma_um": spread}
        for at, value, spread in zip(q.tolist(), form.tolist(), sigma.tolist(), strict=True)
    ]


def _frame_row(fit: Fit) -> dict[str, Any]:
    """The axes as a whole in the machine's frame, at the datum."""
    part = fit.parameters.slices["frame"]
    value, sigma = fit.theta[part], np.sqrt(np.diag(fit.covariance)[part])
    per_urad = 1.0 / LEVER_ARM_MM / RAD_PER_URAD
    return {
        "shift_um": (value[:3] * UM_PER_MM).tolist(),
        "sigma_shift_um": (sigma[:3] * UM_PER_MM).tolist(),
        "turn_urad": (value[3:6] * per_urad).tolist(),
        "sigma_turn_urad": (sigma[3:6] * per_urad).tolist(),
        "tool_turn_urad": (value[6:] * per_urad).tolist(),
        "sigma_tool_turn_urad": (sigma[6:] * per_urad).tolist(),
    }
