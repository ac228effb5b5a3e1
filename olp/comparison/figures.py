"""Figures of a measured run: paired points, deviations, along the path and by line."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from olp.comparison.pairing import Order, Pairing
from olp.comparison.path import Path, Split, split
from olp.core.arrays import Array, Index, Mask
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass

#: stations along the path at which runs are compared
STATIONS = 2000
#: a distance between points of more than this many usual ones is a gap
_GAP = 8.0
#: distance from an end, in reaches, beyond which the path has left that end
_AWAY = 10.0
#: a point is about where a cut begins within so many times its own distance from the path
_ABOUT = 3.0
#: mm; the same of points on the path
_AT_MM = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A measured run in the nominal frame: points (m, 3) in mm and their pairing with the path.

    (m, 3) `nominal_mm` is the nominal point of each: the nearest one of the path, or the stop that it was
    measured at, whose index is (m,) `stop` (-1: none). `deviation` is from there, and (m,) `size_mm` its
    size. `good` (m,) are points within reach, and those `counted` give the figures.
    """

    name: str
    points_mm: Array
    pairing: Pairing
    nominal_mm: Array
    stop: Index
    deviation: Split
    size_mm: Array
    good: Mask
    counted: Mask

    @staticmethod
    def of(
        name: str, path: Path, points_mm: Array, pairing: Pairing, reach_mm: float, order: Order = "forward"
    ) -> Run:
        """`counted` are good points on moves that cut, and the nearest one to each stop. Before the start of
        the first of them the tool comes from elsewhere, which is no cut."""
        if order != "free":
            pairing = replace(pairing, beyond=_off_the_ends(path, points_mm, pairing, reach_mm, order))
        good = (pairing.distance_mm <= reach_mm) & ~pairing.beyond & ~pairing.doubtful
        stop = _at_stops(path, points_mm, pairing, reach_mm)
        nominal_mm = pairing.foot_mm.copy()
        nominal_mm[stop >= 0] = path.vertex_mm[path.stops.vertex[stop[stop >= 0]]]
        away = points_mm - nominal_mm
        size_mm = np.sqrt(np.einsum("ij,ij->i", away, away))
        good |= stop >= 0
        cuts = path.cutting[pairing.segment] & ~_comes(path, pairing)
        counted = good & (cuts | (stop >= 0))
        deviation = split(path, pairing.segment, away)
        return Run(name, points_mm, pairing, nominal_mm, stop, deviation, size_mm, good, counted)

    def line(self, path: Path) -> Index:
        """(m,) the line of the program or file that each point belongs to."""
        line = path.line[self.pairing.segment]
        line[self.stop >= 0] = path.stops.line[self.stop[self.stop >= 0]]
        return line

    def figures(self, path: Path) -> dict[str, Any]:
        """Counts and deviations in um, of points that count only."""
        size = self.size_mm[self.counted] * UM_PER_MM
        report: dict[str, Any] = {
            "name": self.name,
            "points": len(self.points_mm),
            "counted": int(self.counted.sum()),
            "left_out": int((~self.good & ~self.pairing.beyond).sum()),
            "beyond_the_ends": int(self.pairing.beyond.sum()),
            "covered": self.covered(path),
        }
        if not len(size):
            return report | {"across_um": None, "normal_um": None, "binormal_um": None}
        report["across_um"] = {
            "max": float(size.max()),
            "rms": float(np.sqrt(np.mean(size * size))),
            "mean": float(size.mean()),
            "q95": float(np.quantile(size, 0.95)),
        }
        for name in ("normal", "binormal"):
            value = getattr(self.deviation, name)[self.counted] * UM_PER_MM
            report[f"{name}_um"] = {
                "min": float(value.min()), "max": float(value.max()), "mean": float(value.mean()),
                "rms": float(np.sqrt(np.mean(value * value))),
            }  # fmt: skip
        return report

    def covered(self, path: Path) -> float:
        """Share of the cutting path that lies between neighbouring measured points; where nothing cuts, share
        of the stops that were measured."""
        if not path.cutting.any():
            return float((self.stop >= 0).sum() / max(len(path.stops), 1))
        s = np.unique(self.pairing.s_mm[self.good])
        if len(s) < 2:
            return 0.0
        arc_mm, _, cutting = _stations(path)
        inside = self._near(arc_mm, s)
        return float(inside[cutting].mean()) if cutting.any() else 0.0

    def _near(self, arc_mm: Array, s: Array) -> Mask:
        """Which arc lengths `arc_mm` lie in no gap between sorted arc lengths `s`."""
        gap = np.diff(s)
        wide = _GAP * float(np.quantile(gap, 0.9))
        after = np.clip(np.searchsorted(s, arc_mm), 1, len(s) - 1)
        inside = (gap[after - 1] <= wide) & (arc_mm >= s[0] - wide) & (arc_mm <= s[-1] + wide)
        return np.asarray(inside, bool)

    def at(self, path: Path, arc_mm: Array) -> Array:
        """(k, 3) attained positions at arc lengths (k,), in the normal planes there; NaN in gaps."""
        order = np.argsort(self.pairing.s_mm[self.good], kind="stable")
        s = self.pairing.s_mm[self.good][order]
        away = (self.points_mm - self.pairing.foot_mm)[self.good][order]
        attained = np.full((len(arc_mm), 3), np.nan)
        if len(s) < 2:
            return attained
        s, first, count = np.unique(s, return_index=True, return_counts=True)
        away = np.add.reduceat(away, first, axis=0) / count[:, None]
        if len(s) < 2:
            return attained
        place, segment = path.at(arc_mm)
        along = path.axes(segment)[0]
        between = np.column_stack([np.interp(arc_mm, s, away[:, i]) for i in range(3)])
        between -= np.einsum("ij,ij->i", between, along)[:, None] * along
        near = self._near(arc_mm, s)
        attained[near] = (place + between)[near]
        return attained


def _comes(path: Path, pairing: Pairing) -> Mask:
    """(m,) points about where a cut begins after a move that does not cut: a rapid that takes up backlash
    goes past that place and comes back."""
    first = path.cutting & ~np.concatenate(([False], path.cutting[:-1]))
    since_mm = pairing.s_mm - path.s_mm[pairing.segment]
    about = since_mm <= _ABOUT * pairing.distance_mm + _AT_MM
    return np.asarray(first[pairing.segment] & about & (pairing.segment > 0), bool)


def _at_stops(path: Path, points: Array, pairing: Pairing, reach: float) -> Index:
    """(m,) the stop that each point was measured at, -1 for others: of the points nearer along the path to a
    stop than to others, the nearest one in space, within reach."""
    stop = np.full(len(points), -1, np.int64)
    if not len(path.stops):
        return stop
    arc_mm = path.s_mm[path.stops.vertex]
    after = np.clip(np.searchsorted(arc_mm, pairing.s_mm), 1, max(len(arc_mm) - 1, 1))
    first = after - 1
    after = np.minimum(after, len(arc_mm) - 1)
    which = np.where(pairing.s_mm - arc_mm[first] <= arc_mm[after] - pairing.s_mm, first, after)
    away = points - path.vertex_mm[path.stops.vertex[which]]
    distance = np.sqrt(np.einsum("ij,ij->i", away, away))
    order = np.lexsort((distance, which))
    nearest = order[np.diff(which[order], prepend=-1) != 0]
    nearest = nearest[distance[nearest] <= reach]
    stop[nearest] = which[nearest]
    return stop


def _off_the_ends(path: Path, points: Array, pairing: Pairing, reach: float, order: Order) -> Mask:
    """(m,) `beyond`, and points measured before the start of the path is reached, or after its end is left.

    There are such points where the measurement begins out of reach; the one nearest to the start ends them.
    """
    beyond = pairing.beyond.copy()
    ends = path.vertex_mm[[0, -1]] if order == "forward" else path.vertex_mm[[-1, 0]]
    arc_ends = (0.0, path.length_mm) if order == "forward" else (path.length_mm, 0.0)
    for end, s, turn in ((ends[0], arc_ends[0], slice(None)), (ends[1], arc_ends[1], slice(None, None, -1))):
        distance, mask = pairing.distance_mm[turn], beyond[turn]
        inside = np.flatnonzero(distance <= reach)
        if not len(inside) or inside[0] == 0:
            continue
        # up to where the path is away from this end
        gone = np.flatnonzero(np.abs(pairing.s_mm[turn][inside[0] :] - s) > _AWAY * reach)
        last = inside[0] + (gone[0] if len(gone) else len(distance) - inside[0])
        away = points[turn][: last + 1] - end
        size = np.einsum("ij,ij->i", away, away)
        arrival = int(size.argmin())
        mask[: arrival if size[arrival] <= reach * reach else inside[0]] = True
    return beyond


def _stations(path: Path) -> tuple[Array, Index, Mask]:
    """Arc lengths of equidistant stations along the path, their segments, and which are on cutting moves."""
    arc_mm = (np.arange(STATIONS, dtype=float) + 0.5) * (path.length_mm / STATIONS)
    segment = path.at(arc_mm)[1]
    return arc_mm, segment, path.cutting[segment]


def stations(path: Path) -> Array:
    """Arc lengths (k,) of equidistant stations along the path, on its cutting moves only."""
    arc_mm, _, cutting = _stations(path)
    return arc_mm[cutting]
