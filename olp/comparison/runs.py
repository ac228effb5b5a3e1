"""Places measured runs on the nominal path: frame, order, pairing, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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
from olp.findings.catalogue import Finding

Align = Literal["auto", "none", "fit", "each"]

#: Fewer points than that always fit: a rigid motion has six numbers, and each point says two across its path.
FEWEST = 4
#: More points off their place than this share, and the pairing is wrong.
MOST_OFF = 0.02
#: places looked at for nearer passes; how much nearer, and above what everyday distance, counts
_LOOKED, _NEARER, _USUAL = 4096, 10.0, 5.0
#: a fit that takes more than this share of what there is, hides it
_ABSORBED = 0.5
#: covered less than this, a path counts as not measured in part
_COVERED = 0.98


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """Runs in the nominal frame; `rigid` brought each into it, `fitted` tells whether it was fitted.
    `right` (one a run): whether its pairing is to be trusted."""

    runs: tuple[Run, ...]
    orders: tuple[Order, ...]
    rigid: tuple[Rigid, ...]
    fitted: bool
    loose: tuple[str, ...]
    candidate: bool
    right: tuple[bool, ...]


def place(
    path: Path,
    names: Sequence[str],
    points: Sequence[Array],
    how: Align,
    order: Order | None,
    reach_mm: float,
) -> Placed:
    """Place runs of points (m, 3) on a path.

    "none": they are in the nominal frame; "fit": one transform for all of them; "each": one for each; "auto":
    none where most points lie within reach as they are, else fit. `order` None finds it. Raises CannotCompute
    for a fit of fewer points than FEWEST.
    """
    found = None
    if how in ("auto", "none"):
        found = [paired(path, p, order, reach_mm) for p in points]
    if how == "auto" and found and float(np.median(found[0][1].distance_mm)) > reach_mm:
        found = None
    rigid = [Rigid.identity() for _ in points]
    loose: tuple[str, ...] = ()
    candidate = False
    fitted = found is None
    if found is None:
        for name, some in list(zip(names, points, strict=True))[: None if how == "each" else 1]:
            if len(some) < FEWEST:
                raise CannotCompute(
                    f"{name}: {len(some)} points make no best fit, which would leave nothing of any error; "
                    f"measure at least {FEWEST}, or state them in the nominal frame (--align none)"
                )
        fits = [align(path, p, reach_mm, order) for p in (points if how == "each" else points[:1])]
        if how != "each":
            fits = [_together(path, points, fits[0], order, reach_mm)] * len(points)
        rigid = [f.rigid for f in fits]
        loose = fits[0].loose
        candidate = any(f.candidate for f in fits)
        found = [paired(path, move(p), order, reach_mm) for move, p in zip(rigid, points, strict=True)]
    runs = [
        Run.of(name, path, move(p), pairing, reach_mm, one)
        for name, move, p, (one, pairing) in zip(names, rigid, points, found, strict=True)
    ]
    orders = [one for one, _ in found]
    right = [_right(path, run, one) for run, one in zip(runs, orders, strict=True)]
    return Placed(tuple(runs), tuple(orders), tuple(rigid), fitted, loose, candidate, tuple(right))


def _together(
    path: Path, points: Sequence[Array], first: Alignment, order: Order | None, reach_mm: float
) -> Alignment:
    """One transform for several runs: from the first, then refined with all of them."""
    if len(points) == 1:
        return first
    moved = [first.rigid(p) for p in points]
    step = refit(path, moved, [paired(path, p, order, reach_mm)[1] for p in moved], reach_mm)
    return Alignment(step.rigid.after(first.rigid), first.order, step.loose, first.candidate)


def _right(path: Path, run: Run, order: Order) -> bool:
    """Is the pairing to be trusted: points within reach, and not much nearer to another pass?"""
    inside = ~run.pairing.beyond
    if not inside.any() or not run.good.any():
        return False
    if (inside & ~run.good & ~run.pairing.doubtful).sum() > MOST_OFF * inside.sum():
        return False
    if order == "free":
        return True
    some = np.flatnonzero(run.good)[:: max(int(run.good.sum()) // _LOOKED, 1)]
    free = pair(path, run.points_mm[some], "free").distance_mm
    usual = _USUAL * float(np.median(free))
    nearer = run.pairing.distance_mm[some] > _NEARER * free + usual
    return bool(nearer.mean() <= MOST_OFF)


def findings(path: Path, placed: Placed) -> list[Finding]:
    """What a person should know about how the runs were placed."""
    out = []
    for run, order, right in zip(placed.runs, placed.orders, placed.right, strict=True):
        off = ~run.good & ~run.pairing.beyond & ~run.pairing.doubtful
        if not right:
            inside = max(int((~run.pairing.beyond).sum()), 1)
            out.append(Finding(
                "OLP601",
                f"{run.name}: {int(off.sum())} of {inside} points find no place within reach, or the order "
                f"of the points is not that of the path; median distance "
                f"{float(np.median(run.pairing.distance_mm)):.4g} mm; no figures are stated",
            ))  # fmt: skip
            continue
        if off.any():
            worst = float(run.pairing.distance_mm[off].max())
            out.append(Finding(
                "OLP602", f"{run.name}: {int(off.sum())} points are off the path by up to {worst:.4g} mm",
                count=int(off.sum()),
            ))  # fmt: skip
        doubtful = int(run.pairing.doubtful.sum())
        if doubtful:
            out.append(Finding(
                "OLP608", f"{run.name}: {doubtful} points lie as near to another pass", count=doubtful
            ))  # fmt: skip
        covered = run.covered(path)
        if covered < _COVERED:
            out.append(Finding(
                "OLP603", f"{run.name}: {covered * 100:.1f} % of the cutting path has measured points"
            ))  # fmt: skip
        if order != "forward":
            how = "run against the path" if order == "backward" else "come in no order along the path"
            out.append(Finding("OLP606", f"{run.name}: the points {how}"))
    if placed.fitted and all(placed.right):
        out += _frame_findings(placed)
    return out


def _frame_findings(placed: Placed) -> list[Finding]:
    run, rigid = placed.runs[0], placed.rigid[0]
    residual = rms_um(run)
    x, y, z = rigid.shift_mm.tolist()
    left = f"; rms residual across the path {residual:.3g} um" if run.counted.any() else ""
    turn = float(np.degrees(rigid.angle_rad))
    out = [Finding("OLP611", f"shift {x:.4f}, {y:.4f}, {z:.4f} mm, turn {turn:.6f} deg{left}")]
    if placed.loose:
        out.append(Finding("OLP605", f"the path does not determine: {', '.join(placed.loose)}"))
    if placed.candidate:
        out.append(Finding("OLP605", "the points fit the path in another place as well"))
    return out


def rms_um(run: Run) -> float:
    """Root mean square of the distance from the path in um, NaN where nothing counts."""
    size = run.deviation.across[run.counted]
    return float(np.sqrt(np.mean(size * size))) * UM_PER_MM if len(size) else float("nan")


def absorbed(path: Path, run: Run, rigid: Rigid) -> tuple[float, float]:
    """What the fit took: rms across the path in um of the deviations as stated and after the fit.

    It says something where points were stated in the nominal frame, or nearly so.
    """
    back = rigid.inverse()(run.points_mm)
    away = back - run.pairing.foot_mm
    along = path.axes(run.pairing.segment)[0]
    away -= np.einsum("ij,ij->i", away, along)[:, None] * along
    before = np.sqrt(np.mean(np.einsum("ij,ij->i", away[run.counted], away[run.counted])))
    return float(before) * UM_PER_MM, rms_um(run)


def absorbed_of_field(path: Path, run: Run, error_mm: Array) -> tuple[float, float]:
    """What a fit would take of a known field of errors (m, 3) at the feet of a run: rms across the path in um
    of the field, and of what the best fit leaves of it."""
    feet, along = run.pairing.foot_mm[run.counted], path.axes(run.pairing.segment[run.counted])[0]
    field = error_mm[run.counted]
    rigid, _ = fit_path(feet + field, feet, along)
    rest = rigid(feet + field) - feet
    sizes = []
    for part in (field, rest):
        part = part - np.einsum("ij,ij->i", part, along)[:, None] * along
        sizes.append(float(np.sqrt(np.mean(np.einsum("ij,ij->i", part, part)))) * UM_PER_MM)
    return sizes[0], sizes[1]


def absorbed_finding(before_um: float, after_um: float, whose: str) -> list[Finding]:
    """OLP604 where the fit took more than half of the mean square."""
    if not before_um > 0.0 or after_um**2 >= (1.0 - _ABSORBED) * before_um**2:
        return []
    return [Finding(
        "OLP604", f"of {before_um:.3g} um rms {whose}, a best fit leaves {after_um:.3g} um"
    )]  # fmt: skip
