"""The best-fit rigid transform that brings measured points in another frame onto the nominal path."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from olp.comparison.pairing import FAR, Order, Pairing, coarse, pair, thinned
from olp.comparison.path import Path
from olp.core.arrays import Array
from olp.core.rigid_fit import Rigid, fit_path, fit_points
from olp.core.values import dataclass

#: points that the search uses
_FEW = 1536
#: points in its first steps
_FIRST = 400
#: rounds of pairing and fitting at most
_ROUNDS = 12
#: a step that moves no point by more than this share of the residual ends the search
_STILL = 1e-3
#: residuals within this factor are equally good; the first one is taken
_AS_GOOD = 1.5
#: points are in no order if their distance without order is below this share of that in order
_MUCH = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """The transform of measured points into the nominal frame, the order of the points, and the rigid motions
    that the path does not determine.

    `ambiguous`: another transform fits equally well, as on a symmetric path."""

    rigid: Rigid
    order: Order
    loose: tuple[str, ...]
    ambiguous: bool = False


def paired(path: Path, points_mm: Array, order: Order | None, reach_mm: float) -> tuple[Order, Pairing]:
    """Pair points (m, 3) in the nominal frame in their order, which is detected where it is None.

    The points run along or against the path, whichever costs less. They are in no order where an order puts
    many of them farther than `reach_mm` from the path, and the nearest points of the path do not.
    """
    if order is not None:
        return order, pair(path, points_mm, order)
    cheaper: Order = "forward" if _cost(path, points_mm) <= _cost(path.reversed(), points_mm) else "backward"
    pairing = pair(path, points_mm, cheaper)
    typical = float(np.quantile(pairing.distance_mm, 0.75))
    if typical > reach_mm:
        some = points_mm[:: max(len(points_mm) // _FEW, 1)]
        if _typical(path, some, "free") <= _MUCH * typical:
            return "free", pair(path, points_mm, "free")
    return cheaper, pairing


def _cost(path: Path, points: Array) -> float:
    return coarse(path, points, _FIRST, FAR)[3]


def _typical(path: Path, points: Array, order: Order) -> float:
    return float(np.quantile(pair(path, points, order).distance_mm, 0.75))


def align(path: Path, points_mm: Array, reach_mm: float, order: Order | None = None) -> Alignment:
    """The best fit of points (m, 3) in an unknown frame, in the given order or, with None, in any.

    The first fit pairs points at equal shares of both lengths; then pairing and fitting alternate. Where that
    fails, the first fit uses principal axes, and the points count as unordered. Residuals are distances
    across the path with equal weights, without points farther than `reach_mm`.
    """
    fits = []
    for one, start in _starts(path, points_mm):
        if order not in (None, one):
            continue
        rigid = start
        for _ in range(3):
            rigid = _match(path, points_mm, rigid, one)
        fits.append((_typical(path, _sample(rigid(points_mm), one, _FIRST), one), one, rigid))
        if one == "backward" and min(f[0] for f in fits) <= reach_mm:
            break  # an order fits, so no order need not be tried
    least = min(residual for residual, _, _ in fits)
    good = [f for f in fits if f[0] <= _AS_GOOD * least]
    _, order, rigid = good[0]
    some = points_mm[:: max(len(points_mm) // _FIRST, 1)]
    ambiguous = any(
        np.abs(other(some) - rigid(some)).max() > 10.0 * max(residual, least) + reach_mm
        for residual, _, other in good[1:]
    )
    loose: tuple[str, ...] = ()
    for _ in range(_ROUNDS):
        step, loose, residual = _step(path, rigid(_sample(points_mm, order, _FEW)), order, np.inf)
        rigid = step.after(rigid)
        if _moves(step, rigid(points_mm[:: max(len(points_mm) // _FEW, 1)])) <= _STILL * residual + 1e-9:
            break
    step, loose, _ = _step(path, rigid(points_mm), order, reach_mm)
    return Alignment(step.after(rigid), order, loose, ambiguous)


def refit(path: Path, runs: Sequence[Array], pairings: Sequence[Pairing], reach_mm: float) -> Alignment:
    """One best fit of several runs (m, 3) that are already near their positions on the path."""
    points, foot = np.concatenate(runs), np.concatenate([p.foot_mm for p in pairings])
    kept = np.concatenate([(p.distance_mm <= reach_mm) & ~p.beyond for p in pairings])
    along = path.axes(np.concatenate([p.segment for p in pairings]))[0]
    rigid, loose = fit_path(points[kept], foot[kept], along[kept])
    return Alignment(rigid, "forward", loose)


def _starts(path: Path, points: Array) -> Iterator[tuple[Order, Rigid]]:
    few, _ = thinned(points, _FIRST)
    arc_mm = np.append(0.0, np.cumsum(np.sqrt((np.diff(few, axis=0) ** 2).sum(axis=1))))
    share = arc_mm / max(arc_mm[-1], 1e-12) * path.length_mm
    yield "forward", fit_points(few, path.at(share)[0])
    yield "backward", fit_points(few, path.at(path.length_mm - share)[0])
    nodes = path.at(np.linspace(0.0, path.length_mm, _FEW))[0]
    a, b = points.mean(axis=0), nodes.mean(axis=0)
    u = np.linalg.svd(points - a, full_matrices=False)[2]
    v = np.linalg.svd(nodes - b, full_matrices=False)[2]
    for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        w = np.diag((*signs, 1.0)) @ u
        w[2] *= np.sign(np.linalg.det(w) * np.linalg.det(v))
        rotation = v.T @ w
        yield "free", Rigid(rotation, b - rotation @ a)


def _sample(points: Array, order: Order, count: int) -> Array:
    return points[:: max(len(points) // count, 1)] if order == "free" else thinned(points, count)[0]


def _match(path: Path, points: Array, rigid: Rigid, order: Order) -> Rigid:
    """One round of pairing and fitting that also works from far off."""
    few = _sample(points, order, _FIRST)
    if order == "free":
        return fit_points(few, pair(path, rigid(few), "free").foot_mm)
    along = path if order == "forward" else path.reversed()
    few, _, s, _ = coarse(along, rigid(few), _FIRST)
    return fit_points(few, along.at(s)[0]).after(rigid)


def _step(path: Path, points: Array, order: Order, reach: float) -> tuple[Rigid, tuple[str, ...], float]:
    pairing = pair(path, points, order)
    kept = (pairing.distance_mm <= reach) & ~pairing.beyond
    if kept.sum() < 6:
        kept[:] = True
    rigid, loose = fit_path(points[kept], pairing.foot_mm[kept], path.axes(pairing.segment[kept])[0])
    return rigid, loose, float(np.sqrt(np.mean(pairing.distance_mm[kept] ** 2)))


def _moves(step: Rigid, points: Array) -> float:
    return float(np.sqrt(((step(points) - points) ** 2).sum(axis=1)).max())
