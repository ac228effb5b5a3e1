"""A calibration refined by a measured run: its numbers change within their covariance, and that shrinks. The
numbers are x + T xi with xi ~ N(0, I); the run reads the error at points, in an unknown instrument frame."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from olp.calibration.estimator.covariance import principal
from olp.calibration.estimator.curves import DIGITS
from olp.calibration.estimator.normal import Block, Chunk, Normal, residuals_of, solve
from olp.calibration.estimator.parameters import LEVER_ARM_MM, frame_columns
from olp.calibration.observations.base import OUTLIER, SHARE
from olp.calibration.observations.points import Points
from olp.core.arrays import Array
from olp.core.machine import Vector
from olp.core.rigid_fit import fit_frame
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Cyclic
from olp.errormodel.entry import Entry
from olp.errormodel.quality import Fitted, Quality
from olp.errormodel.sensitivity import Sensitivity, value_rows
from olp.errormodel.uncertainty import Uncertainty, fingerprint

Change = Mapping[tuple[str, str, float], tuple[Entry, Array]]


@dataclass(frozen=True, slots=True, eq=False)
class Refinement:
    """`calibration` and `uncertainty` after the run. Lengths in mm are rms values at the points, in the
    frame that fits best. `before_mm` is that of the residual with the old calibration, `after_mm` with the
    new one. `noise_mm` is that of the stated noise, `expected_mm` that from noise and the old covariance.

    `chi_square` / `freedom` is the reduced chi-square of the run with the old covariance; where it is above 1
    the new covariance is larger by it. `changes` is the largest change of each number by kind and name, in mm
    or rad, and in old standard deviations. `outliers` are rows left out, with their standard deviations.
    """

    calibration: Calibration
    uncertainty: Uncertainty
    before_mm: float
    after_mm: float
    noise_mm: float
    expected_mm: float
    chi_square: float
    freedom: float
    changes: Mapping[tuple[str, str], tuple[float, float]]
    outliers: tuple[tuple[int, float], ...]


def refine(
    calibration: Calibration,
    chain: str,
    uncertainty: Uncertainty,
    points: Points,
    *,
    frame_known: bool = False,
    skip: frozenset[str] = frozenset(),
    play: Array | None = None,
    along: Array | None = None,
) -> Refinement:
    """Update a calibration by points of a run (commanded axis positions and where the reflector was).

    `play` (n, 3) in [-1, 1] are the directions of approach; without it half of the backlash counts as noise.
    `skip` are errors that the control corrected. `along` (n, 3) are unit directions without information, such
    as those of a path. Raises CannotCompute where the points determine no frame.
    """
    model = build(calibration, chain, outside="hold", skip_components=skip)
    meant = points.axis_mm + points.tool_mm + model.error(points.axis_mm, points.tool_mm, play)
    measured = points.measured_mm if frame_known else fit_frame(points.measured_mm, meant)(points.measured_mm)
    sigma = np.full(meant.shape, points.sigma)
    backlash = model.backlash_at(points.axis_mm) if play is None else None
    if backlash is not None:
        sigma = np.hypot(sigma, 0.5 * np.abs(backlash))
    parts = Sensitivity.of(calibration, chain, uncertainty, skip=skip)
    rows = np.moveaxis(parts.rows(points.axis_mm, points.tool_mm, play), 0, 1).astype(float)
    misses = measured - meant
    blind = np.zeros((len(misses), 3)) if along is None else along
    use = np.ones(len(misses), bool)
    outliers: list[tuple[int, float]] = []
    while True:
        block = _block(rows[use], misses[use], sigma[use], blind[use], points, use, frame_known)
        normal = Normal.of(parts.columns)
        normal.add(block)
        solved = solve(normal, np.eye(parts.columns))
        _, residual, standardised = residuals_of(block, solved.theta)
        off = np.abs(standardised).reshape(-1, 3).max(axis=1)
        worst = int(np.argmax(off))
        if off[worst] <= OUTLIER or len(outliers) >= SHARE * len(misses):
            break
        k = int(np.flatnonzero(use)[worst])
        outliers.append((int(points.row[k]), float(off[worst])))
        use[k] = False
    chi = normal.square - float(normal.g @ solved.theta)
    freedom = float(max(normal.count - int(blind[use].any(axis=1).sum()) - normal.free, 1))
    covariance = solved.covariance * max(1.0, chi / freedom)
    change = _changes(uncertainty, parts, solved.theta)
    new = dataclasses.replace(
        _applied(calibration, change),
        quality=with_run(calibration.quality, Fitted(points.source or "run", chi, freedom)),
    )
    expected = float((_across(rows, blind)[use] ** 2).sum() + (sigma[use] ** 2).sum())
    return Refinement(
        new,
        _refined_uncertainty(uncertainty, parts, covariance, new),
        _rms(residuals_of(block, np.zeros(parts.columns))[1]),
        _rms(residual),
        float(np.sqrt((sigma[use] ** 2).sum(axis=1).mean())),
        float(np.sqrt(expected / max(int(use.sum()), 1))),
        chi,
        freedom,
        _sizes(change),
        tuple(outliers),
    )


def with_run(quality: Quality | None, run: Fitted) -> Quality:
    """The quality of a calibration with that of a run, whose residuals are those from the old calibration."""
    if quality is None:
        return Quality(Fitted("all readings", run.chi_square, run.freedom), (run,))
    total = quality.total
    return Quality(
        Fitted(total.source, total.chi_square + run.chi_square, total.freedom + run.freedom),
        (*quality.sources, run),
    )


def _block(
    rows: Array, misses: Array, sigma: Array, blind: Array, points: Points, use: Array, frame_known: bool
) -> Block:
    tip = (points.axis_mm + points.tool_mm)[use.astype(bool)]
    arm = tip - tip.mean(axis=0)
    scaled = points.sigma_scale > 0.0
    frame = frame_columns(arm, scale=scaled)
    local = _across(frame, blind).reshape(3 * len(arm), -1)
    precision = np.zeros(local.shape[1])
    if scaled:
        precision[6] = 1.0 / (points.sigma_scale * LEVER_ARM_MM) ** 2
    if frame_known:
        local, precision = local[:, 6:], precision[6:]
    rows, misses = _across(rows, blind), _across(misses[:, :, None], blind)
    chunk = Chunk(rows.reshape(len(local), -1), misses.reshape(-1), sigma.reshape(-1), local)
    return Block.of(chunk, np.arange(rows.shape[2]), precision, points.source)


def _across(values: Array, blind: Array) -> Array:
    """(n, 3, k) without their parts along `blind`."""
    return np.asarray(values - blind[:, :, None] * np.einsum("ni,nik->nk", blind, values)[:, None, :])


def _rms(residual: Array) -> float:
    return float(np.sqrt((residual.reshape(-1, 3) ** 2).sum(axis=1).mean()))


def _table(parts: Sensitivity, entry: Entry, q: Array) -> Array:
    """(n, columns) dependence of the value of an entry at q on the unknowns xi."""
    numbers = sum(len(e.rest) for e in parts.entries)
    own = value_rows(entry, q)
    rank = entry.factor.shape[1]
    table = np.zeros((len(own), parts.columns))
    table[:, :rank] = own[:, :rank]
    if entry in parts.entries:
        spare = parts.spare[parts.entries.index(entry)]
        if spare >= 0:
            first = rank + spare - numbers
            table[:, first : first + own.shape[1] - rank] = own[:, rank:]
    return table


def _numbers(parts: Sensitivity, entry: Entry) -> Array:
    """(m, columns) the same of the numbers of an entry themselves."""
    if entry.kind == "wave":
        quarter = 0.25 * entry.period_mm
        return _table(parts, entry, np.array([quarter, 0.0]))
    return _table(parts, entry, entry.position_mm if len(entry.position_mm) else np.zeros(1))


def _changes(uncertainty: Uncertainty, parts: Sensitivity, xi: Array) -> Change:
    """(entry, change of its numbers) by kind, name and period."""
    return {(e.kind, e.name, e.period_mm): (e, _numbers(parts, e) @ xi) for e in uncertainty.entries}


def _sizes(change: Change) -> dict[tuple[str, str], tuple[float, float]]:
    sizes = {}
    for (kind, name, _), (entry, moved) in change.items():
        sigma = float(np.sqrt(np.mean(entry.sigma**2)))
        largest = float(np.abs(moved).max())
        sizes[kind, name] = (largest, float(np.sqrt(np.mean(moved**2))) / sigma if sigma > 0.0 else 0.0)
    return sizes


def _refined_uncertainty(
    uncertainty: Uncertainty, parts: Sensitivity, covariance: Array, calibration: Calibration
) -> Uncertainty:
    """The uncertainty of the new numbers."""
    tables = [_numbers(parts, entry) for entry in uncertainty.entries]
    factor, dropped = principal(tables, covariance)
    entries, first = [], 0
    for entry, table in zip(uncertainty.entries, tables, strict=True):
        own = factor[first : first + len(table)]
        first += len(table)
        # what the control corrects is not observable here, so its uncertainty does not change
        rest = np.zeros(len(table)) if entry in parts.entries else entry.rest
        entries.append(dataclasses.replace(entry, factor=own, rest=rest))
    words = f"{uncertainty.source}; refined by a measured run"
    words = words if "refined by" not in uncertainty.source else uncertainty.source
    return dataclasses.replace(
        uncertainty,
        entries=tuple(entries),
        fingerprint=fingerprint(calibration),
        source=words,
        dropped=max(dropped, uncertainty.dropped),
    )


# -- the numbers of a calibration ------------------------------------------------------------------------


def _applied(calibration: Calibration, change: Change) -> Calibration:
    curves = [_curve(curve, change) for curve in calibration.curves]
    known = {name for curve in curves for name in curve.names}
    for (kind, name, _), (entry, moved) in change.items():
        # an angle that was not observable has no column yet; any curve of its axis may take it
        own = [k for k, curve in enumerate(curves) if curve.axis == name[-1]]
        if kind == "mean" and name not in known and name[1] in "ABC" and own and np.any(moved):
            curves[own[0]] = _with_column(curves[own[0]], name, entry, moved)
    square = dict(calibration.squareness)
    backlash = list(calibration.backlash_mm)
    cyclic = list(calibration.cyclic)
    for (kind, name, period), (_, moved) in change.items():
        if kind == "squareness":
            square[name] = round(square.get(name, 0.0) + float(moved[0]), DIGITS[1])
        elif kind == "backlash":
            k = AXES.index(name)
            backlash[k] = round(backlash[k] + float(moved[0]), DIGITS[0])
        elif kind == "half" and name == f"E{name[2]}{name[2]}" and backlash[AXES.index(name[2])] != 0.0:
            # a backlash of b adds -b / 2 in the direction of motion
            k = AXES.index(name[2])
            backlash[k] = round(backlash[k] - 2.0 * float(np.mean(moved)), DIGITS[0])
        elif kind == "wave":
            cyclic = [_wave(c, moved) if (c.component, c.period_mm) == (name, period) else c for c in cyclic]
    backlash_mm: Vector = (backlash[0], backlash[1], backlash[2])
    return dataclasses.replace(
        calibration, curves=tuple(curves), squareness=square, backlash_mm=backlash_mm, cyclic=tuple(cyclic)
    )


def _change_at(numbers: tuple[Entry, Array] | None, q: Array) -> Array:
    """(n,) change of a curve at q, straight between the numbers of its entry."""
    return np.zeros(len(q)) if numbers is None else np.interp(q, numbers[0].position_mm, numbers[1])


def _curve(curve: Curve, change: Change) -> Curve:
    q = curve.position_mm

    def moved(columns: Mapping[str, Array], side: float) -> dict[str, Array]:
        return {
            name: _rounded(
                name,
                values
                + _change_at(change.get(("mean", name, 0.0)), q)
                + side * _change_at(change.get(("half", name, 0.0)), q),
            )
            for name, values in columns.items()
        }

    return dataclasses.replace(
        curve,
        columns=moved(curve.columns, 0.0),
        forward=moved(curve.forward, 1.0),
        backward=moved(curve.backward, -1.0),
    )


def _with_column(curve: Curve, name: str, entry: Entry, moved: Array) -> Curve:
    column = {name: _rounded(name, _change_at((entry, moved), curve.position_mm))}
    if curve.columns:
        return dataclasses.replace(curve, columns={**curve.columns, **column})
    return dataclasses.replace(
        curve, forward={**curve.forward, **column}, backward={**curve.backward, **column}
    )


def _rounded(name: str, values: Array) -> Array:
    return np.asarray(np.round(values, DIGITS[name[1] in "ABC"]) + 0.0)


def _wave(term: Cyclic, moved: Sequence[float] | Array) -> Cyclic:
    """With the sine and cosine parts changed."""
    sine = term.amplitude * np.cos(term.phase_rad) + float(moved[0])
    cosine = term.amplitude * np.sin(term.phase_rad) + float(moved[1])
    size = round(float(np.hypot(sine, cosine)), DIGITS[term.component[1] in "ABC"])
    return dataclasses.replace(term, amplitude=size, phase_rad=round(float(np.arctan2(cosine, sine)), 6))
