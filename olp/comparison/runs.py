"""Measured runs on the nominal path: frame, order, pairing, and findings about them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from olp.comparison.aligning import Alignment, align, paired, refit
from olp.comparison.figures import Run
from olp.comparison.pairing import Order, pair
from olp.comparison.path import Path
from olp.core.arrays import Array
from olp.core.errors import CannotCompute
from olp.core.rigid_fit import Rigid, fit_path
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass
from olp.findings.catalogue import Finding

Align = Literal["auto", "none", "fit", "each"]

#: Fewest points of a fit: a rigid motion has six parameters, each point gives two equations across its path.
FEWEST = 4
#: Share of points off the path above which the pairing is wrong.
MOST_OFF = 0.02
#: points at most that are checked for nearer passes
_CHECKED = 4096
#: factor between both distances above which a pass counts as nearer
_NEARER = 10.0
#: and the distance beyond that, in medians of the distances
_USUAL = 5.0
#: share of the mean square above which a fit that absorbs it is reported
_ABSORBED = 0.5
#: covered share of a path below which a part counts as not measured
_COVERED = 0.98


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """Runs in the nominal frame; `rigid` brought each into it, `fitted`: whether it was fitted.

    `ambiguous`: another transform fits equally well. `right`: whether each pairing is credible."""

    runs: tuple[Run, ...]
    orders: tuple[Order, ...]
    rigid: tuple[Rigid, ...]
    fitted: bool
    loose: tuple[str, ...]
    ambiguous: bool
    right: tuple[bool, ...]


def place(
    path: Path,
    names: Sequence[str],
    points: Sequence[Array],
    how: Align,
    order: Order | None,
    reach_mm: float,
) -> Placed:
    """Bring runs of points (m, 3) into the frame of a path and pair them with it.

    "none": they are in the nominal frame; "fit": one transform for all; "each": one per run; "auto": none
    where most points are within reach unchanged, else fit. The order is detected where `order` is None.
    Raises CannotCompute for a fit of fewer points than FEWEST.
    """
    ordered = None
    if how in ("auto", "none"):
        ordered = [paired(path, p, order, reach_mm) for p in points]
    if how == "auto" and ordered and float(np.median(ordered[0][1].distance_mm)) > reach_mm:
        ordered = None
    rigid = [Rigid.identity() for _ in points]
    loose: tuple[str, ...] = ()
    ambiguous = False
    fitted = ordered is None
    if ordered is None:
        for name, some in list(zip(names, points, strict=True))[: None if how == "each" else 1]:
            if len(some) < FEWEST:
                raise CannotCompute(
                    f"{name}: {len(some)} points are too few for a best fit, which would absorb any error; "
                    f"measure at least {FEWEST}, or state them in the nominal frame (--align none)"
                )
        fits = [align(path, p, reach_mm, order) for p in (points if how == "each" else points[:1])]
        if how != "each":
            fits = [_together(path, points, fits[0], order, reach_mm)] * len(points)
        rigid = [f.rigid for f in fits]
        loose = fits[0].loose
        ambiguous = any(f.ambiguous for f in fits)
        ordered = [paired(path, move(p), order, reach_mm) for move, p in zip(rigid, points, strict=True)]
    runs = [
        Run.of(name, path, move(p), pairing, reach_mm, one)
        for name, move, p, (one, pairing) in zip(names, rigid, points, ordered, strict=True)
    ]
    orders = [one for one, _ in ordered]
    right = [_right(path, run, one) for run, one in zip(runs, orders, strict=True)]
    return Placed(tuple(runs), tuple(orders), tuple(rigid), fitted, loose, ambiguous, tuple(right))


def _together(
    path: Path, points: Sequence[Array], first: Alignment, order: Order | None, reach_mm: float
) -> Alignment:
    """One transform for several runs: from the first run, then refined with all."""
    if len(points) == 1:
        return first
    moved = [first.rigid(p) for p in points]
    step = refit(path, moved, [paired(path, p, order, reach_mm)[1] for p in moved], reach_mm)
    return Alignment(step.rigid.after(first.rigid), first.order, step.loose, first.ambiguous)


def _right(path: Path, run: Run, order: Order) -> bool:
    """Is the pairing credible: points within reach, and not much nearer to another pass?"""
    inside = ~run.pairing.beyond
    if not inside.any() or not run.good.any():
        return False
    if (inside & ~run.good & ~run.pairing.doubtful).sum() > MOST_OFF * inside.sum():
        return False
    if order == "free":
        return True
    some = np.flatnonzero(run.good)[:: max(int(run.good.sum()) // _CHECKED, 1)]
    free = pair(path, run.points_mm[some], "free").distance_mm
    usual = _USUAL * float(np.median(free))
    nearer = run.pairing.distance_mm[some] > _NEARER * free + usual
    return bool(nearer.mean() <= MOST_OFF)


def findings(path: Path, placed: Placed) -> list[Finding]:
    """Findings about frame, order and pairing of the runs."""
    result = []
    for run, order, right in zip(placed.runs, placed.orders, placed.right, strict=True):
        off = ~run.good & ~run.pairing.beyond & ~run.pairing.doubtful
        if not right:
            inside = max(int((~run.pairing.beyond).sum()), 1)
            result.append(Finding(
                "OLP601",
                f"{run.name}: {int(off.sum())} of {inside} points are not within reach of the path, or their "
                f"order is not that of the path; median distance "
                f"{float(np.median(run.pairing.distance_mm)):.4g} mm; no figures are stated",
            ))  # fmt: skip
            continue
        if off.any():
            worst = float(run.pairing.distance_mm[off].max())
            result.append(Finding(
                "OLP602", f"{run.name}: {int(off.sum())} points are off the path by up to {worst:.4g} mm",
                count=int(off.sum()),
            ))  # fmt: skip
        doubtful = int(run.pairing.doubtful.sum())
        if doubtful:
            result.append(Finding(
                "OLP608", f"{run.name}: {doubtful} points are equally near to another pass", count=doubtful
            ))  # fmt: skip
        covered = run.covered(path)
        what = "cutting path has measured points" if path.cutting.any() else "points that count are measured"
        if not run.counted.any():
            result.append(Finding("OLP603", f"{run.name}: no measured point counts"))
        elif covered < _COVERED:
            result.append(Finding("OLP603", f"{run.name}: {covered * 100:.1f} % of the {what}"))
        if order != "forward":
            how = "run against the path" if order == "backward" else "are in no order along the path"
            result.append(Finding("OLP606", f"{run.name}: the points {how}"))
    if placed.fitted and all(placed.right):
        result += _frame_findings(placed)
    return result


def _frame_findings(placed: Placed) -> list[Finding]:
    run, rigid = placed.runs[0], placed.rigid[0]
    residual = rms_um(run)
    x, y, z = rigid.shift_mm.tolist()
    residual_text = f"; rms residual across the path {residual:.3g} um" if run.counted.any() else ""
    turn = float(np.degrees(rigid.angle_rad))
    result = [Finding("OLP611", f"shift {x:.4f}, {y:.4f}, {z:.4f} mm, turn {turn:.6f} deg{residual_text}")]
    if placed.loose:
        result.append(Finding("OLP605", f"the path does not determine: {', '.join(placed.loose)}"))
    if placed.ambiguous:
        result.append(Finding("OLP605", "the points fit the path equally well with another transform"))
    return result


def rms_um(run: Run) -> float:
    """Root mean square of the distance from the path in um, NaN where nothing counts."""
    size = run.deviation.across[run.counted]
    return float(np.sqrt(np.mean(size * size))) * UM_PER_MM if len(size) else float("nan")


def absorbed(path: Path, run: Run, rigid: Rigid) -> tuple[float, float]:
    """What the fit absorbed: rms across the path in um of the deviations as stated and after the fit.

    It is meaningful where points were stated in the nominal frame, or nearly so.
    """
    back = rigid.inverse()(run.points_mm)
    away = back - run.pairing.foot_mm
    along = path.axes(run.pairing.segment)[0]
    away -= np.einsum("ij,ij->i", away, along)[:, None] * along
    stated = np.sqrt(np.mean(np.einsum("ij,ij->i", away[run.counted], away[run.counted])))
    return float(stated) * UM_PER_MM, rms_um(run)


def absorbed_of_field(path: Path, run: Run, error_mm: Array) -> tuple[float, float]:
    """What a fit would absorb of a known field of errors (m, 3) at the feet of a run. Gives the rms across
    the path in um of the field, and of its residual after the best fit."""
    feet, along = run.pairing.foot_mm[run.counted], path.axes(run.pairing.segment[run.counted])[0]
    field = error_mm[run.counted]
    rigid, _ = fit_path(feet + field, feet, along)
    rest = rigid(feet + field) - feet
    sizes = []
    for part in (field, rest):
        part = part - np.einsum("ij,ij->i", part, along)[:, None] * along
        sizes.append(float(np.sqrt(np.mean(np.einsum("ij,ij->i", part, part)))) * UM_PER_MM)
    return sizes[0], sizes[1]


def absorbed_finding(stated_um: float, residual_um: float, whose: str) -> list[Finding]:
    """OLP604 where the fit absorbed more than half of the mean square."""
    if not stated_um > 0.0 or residual_um**2 >= (1.0 - _ABSORBED) * stated_um**2:
        return []
    return [Finding(
        "OLP604", f"a best fit reduces {stated_um:.3g} um rms {whose} to {residual_um:.3g} um"
    )]  # fmt: skip
