"""What a measured run says: paired points, deviations, figures along the path and by line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from olp.measured.pairing import Pairing
from olp.measured.path import Array, Index, Mask, Path, Split, split

#: places along the path at which runs are compared
STATIONS = 2000
_WORST = 10
#: a gap between points of so many usual ones is no path any more
_GAP = 8.0
UM = 1e3


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A measured run in the nominal frame: points (m, 3) in mm, where they belong, and their deviation.

    `good` (m,) are those with a place on the path within reach, from which all figures come.
    """

    name: str
    points_mm: Array
    pairing: Pairing
    deviation: Split
    good: Mask
    counted: Mask

    @staticmethod
    def of(name: str, path: Path, points_mm: Array, pairing: Pairing, reach_mm: float) -> Run:
        """`counted` are good points on moves that cut."""
        good = (pairing.distance_mm <= reach_mm) & ~pairing.beyond & ~pairing.doubtful
        deviation = split(path, pairing.segment, points_mm - pairing.foot_mm)
        return Run(name, points_mm, pairing, deviation, good, good & path.cutting[pairing.segment])

    def figures(self, path: Path) -> dict[str, Any]:
        """Counts and deviations in um, of cutting moves only."""
        size = self.deviation.across[self.counted] * UM
        out: dict[str, Any] = {
            "name": self.name,
            "points": len(self.points_mm),
            "counted": int(self.counted.sum()),
            "left_out": int((~self.good & ~self.pairing.beyond).sum()),
            "beyond_the_ends": int(self.pairing.beyond.sum()),
            "covered": self.covered(path),
        }
        if not len(size):
            return out | {"across_um": None, "normal_um": None, "binormal_um": None}
        out["across_um"] = {
            "max": float(size.max()),
            "rms": float(np.sqrt(np.mean(size * size))),
            "mean": float(size.mean()),
            "q95": float(np.quantile(size, 0.95)),
        }
        for name in ("normal", "binormal"):
            value = getattr(self.deviation, name)[self.counted] * UM
            out[f"{name}_um"] = {
                "min": float(value.min()), "max": float(value.max()), "mean": float(value.mean()),
                "rms": float(np.sqrt(np.mean(value * value))),
            }  # fmt: skip
        return out

    def covered(self, path: Path) -> float:
        """Share of the cutting path that lies between neighbouring measured points."""
        s = np.unique(self.pairing.s_mm[self.good])
        if len(s) < 2:
            return 0.0
        places, _, cutting = _cutting_places(path)
        inside = self._near(places, s)
        return float(inside[cutting].mean()) if cutting.any() else 0.0

    def _near(self, places: Array, s: Array) -> Mask:
        """Which places lie in no gap between sorted arc lengths."""
        gap = np.diff(s)
        wide = _GAP * float(np.quantile(gap, 0.9))
        after = np.clip(np.searchsorted(s, places), 1, len(s) - 1)
        inside = (gap[after - 1] <= wide) & (places >= s[0] - wide) & (places <= s[-1] + wide)
        return np.asarray(inside, bool)

    def at(self, path: Path, places_mm: Array) -> Array:
        """(k, 3) attained positions at arc lengths (k,), in the normal planes there; NaN in gaps."""
        order = np.argsort(self.pairing.s_mm[self.good], kind="stable")
        s = self.pairing.s_mm[self.good][order]
        away = (self.points_mm - self.pairing.foot_mm)[self.good][order]
        out = np.full((len(places_mm), 3), np.nan)
        if len(s) < 2:
            return out
        s, first, count = np.unique(s, return_index=True, return_counts=True)
        away = np.add.reduceat(away, first, axis=0) / count[:, None]
        if len(s) < 2:
            return out
        place, segment = path.at(places_mm)
        along = path.axes(segment)[0]
        between = np.column_stack([np.interp(places_mm, s, away[:, i]) for i in range(3)])
        between -= np.einsum("ij,ij->i", between, along)[:, None] * along
        near = self._near(places_mm, s)
        out[near] = (place + between)[near]
        return out

    def worst_lines(self, path: Path) -> list[dict[str, Any]]:
        """The lines with the largest deviations, in um."""
        if not self.counted.any():
            return []
        line = path.line[self.pairing.segment[self.counted]]
        size = self.deviation.across[self.counted]
        names, which = np.unique(line, return_inverse=True)
        most = np.zeros(len(names))
        np.maximum.at(most, which, size)
        top = np.argsort(-most, kind="stable")[:_WORST]
        return [{"line": int(names[i]), "max_um": float(most[i]) * UM} for i in top.tolist()]


def _cutting_places(path: Path) -> tuple[Array, Index, Mask]:
    """Arc lengths of places even along the path, their segments, and which of them cut."""
    places = (np.arange(STATIONS) + 0.5) * (path.length_mm / STATIONS)
    segment = path.at(places)[1]
    return places, segment, path.cutting[segment]


def stations(path: Path) -> Array:
    """Arc lengths (k,) of places even along the cutting moves of the path, clear of its corners' double
    meaning by being fixed before anything is measured."""
    places, _, cutting = _cutting_places(path)
    return places[cutting]
