"""A nominal path as a polyline with arc length, and the local frame in which deviations are stated."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.errors import CannotCompute
from olp.core.values import dataclass
from olp.program.text.columns import Columns

#: Above this share of Z in its direction, a segment counts as upright: it has no left and right.
_UPRIGHT = 0.999


@dataclass(frozen=True, slots=True, eq=False)
class Stops:
    """The k points of a path that count as points: their `vertex` and `line` (k,), in order."""

    vertex: Index
    line: Index

    def __len__(self) -> int:
        return len(self.vertex)


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A polyline in mm: `vertex_mm` (n, 3), no two neighbours equal; per segment (n-1,) the `line` of the
    program or file it comes from and whether it is `cutting`, so that all of it counts. `s_mm` (n,) is arc
    length. `stops` are the points that count where the way to them does not."""

    vertex_mm: Array
    line: Index
    cutting: Mask
    s_mm: Array
    stops: Stops

    @staticmethod
    def through(
        points_mm: Array, line: Index | None = None, cutting: Mask | None = None, stop: Mask | None = None
    ) -> Path:
        """A path through points (n, 3); `line` and `cutting` (n,) belong to the segment that ends there, and
        `stop` (n,) are points that count.

        Repeated points are merged. Raises CannotCompute for fewer than two different points.
        """
        points = np.asarray(points_mm, float)
        line = np.arange(1, len(points) + 1) if line is None else np.asarray(line, np.int64)
        cutting = np.ones(len(points), bool) if cutting is None else np.asarray(cutting, bool)
        parts = PathParts()
        parts.put(points, line, cutting, np.zeros(len(points), bool) if stop is None else stop)
        return parts.path()

    def __len__(self) -> int:
        """Number of segments."""
        return len(self.line)

    @property
    def length_mm(self) -> float:
        return float(self.s_mm[-1])

    def reversed(self) -> Path:
        """The same path in the opposite direction."""
        return Path(
            self.vertex_mm[::-1].copy(), self.line[::-1].copy(), self.cutting[::-1].copy(),
            self.s_mm[-1] - self.s_mm[::-1],
            Stops(len(self.vertex_mm) - 1 - self.stops.vertex[::-1], self.stops.line[::-1]),
        )  # fmt: skip

    def at(self, s_mm: Array) -> tuple[Array, Index]:
        """(m, 3) points at arc lengths (m,), and the segment of each."""
        segment = np.clip(np.searchsorted(self.s_mm, s_mm, side="right") - 1, 0, len(self) - 1)
        begin = self.s_mm[segment]
        share = (s_mm - begin) / (self.s_mm[segment + 1] - begin)
        a = self.vertex_mm[segment]
        return a + share[:, None] * (self.vertex_mm[segment + 1] - a), segment

    def axes(self, segment: Index) -> tuple[Array, Array, Array]:
        """Unit vectors (m, 3) along, normal and binormal of segments.

        The normal is level and points to the left of travel seen from +Z, the binormal completes the
        right-handed triple, so that on a level path it points up. Where the path is upright, the normal is
        +Y.
        """
        along = self.vertex_mm[segment + 1] - self.vertex_mm[segment]
        along = along / np.sqrt((along * along).sum(axis=1))[:, None]
        normal = np.column_stack((-along[:, 1], along[:, 0], np.zeros(len(along))))
        upright = np.abs(along[:, 2]) > _UPRIGHT
        if upright.any():
            t = along[upright]
            normal[upright] = np.array((0.0, 1.0, 0.0)) - t[:, 1:2] * t
        normal /= np.sqrt((normal * normal).sum(axis=1))[:, None]
        return along, normal, np.cross(along, normal)


class PathParts:
    """A path through points that come part by part; in memory is what is looked at."""

    def __init__(self) -> None:
        self._columns = Columns()
        self._last = np.zeros((0, 3))
        self._vertices, self._s_mm = 0, 0.0

    def put(self, points: Array, line: Index, cutting: Mask, stop: Mask) -> None:
        """Go on through points (n, 3); the others (n,) as of `Path.through`."""
        if not len(points):
            return
        columns, begins = self._columns, not len(self._last)
        step = np.diff(np.concatenate((self._last, points)), axis=0)
        length = np.sqrt((step**2).sum(axis=1))
        kept = np.append(True, length > 0.0) if begins else length > 0.0
        counts = np.flatnonzero(stop)
        columns.put("stop", (self._vertices + np.cumsum(kept) - 1)[counts], np.int64)
        columns.put("stop line", line[counts], np.int64)
        columns.put("vertex", points[kept], np.float64)
        # from the arc length before on, so that the sum is that of all at once
        s_mm = np.cumsum(np.append(self._s_mm, length[length > 0.0]))
        columns.put("s", s_mm if begins else s_mm[1:], np.float64)
        kept[0] &= not begins
        columns.put("line", line[kept], np.int64)
        columns.put("cutting", cutting[kept], np.bool_)
        self._last, self._s_mm = points[-1:], s_mm[-1]
        self._vertices += int(kept.sum()) + begins

    def path(self) -> Path:
        """The whole path. Raises CannotCompute for fewer than two different points."""
        if self._vertices < 2:
            raise CannotCompute(
                "the nominal path has fewer than two different points, so there is nothing to compare with"
            )
        take = self._columns.take
        stops = Stops(take("stop", np.int64), take("stop line", np.int64))
        line, cutting = take("line", np.int64), take("cutting", np.bool_)
        return Path(take("vertex", np.float64, 3), line, cutting, take("s", np.float64), stops)


@dataclass(frozen=True, slots=True, eq=False)
class Split:
    """Deviations (m,) in mm, measured minus nominal: along the path, normal and binormal to it."""

    along: Array
    normal: Array
    binormal: Array

    @property
    def across(self) -> Array:
        """(m,) distance from the path in its normal plane."""
        return np.asarray(np.hypot(self.normal, self.binormal), float)


def split(path: Path, segment: Index, difference_mm: Array) -> Split:
    """Differences (m, 3) measured minus nominal in the local frame of the segments (m,)."""
    along, normal, binormal = path.axes(segment)
    parts = [np.einsum("ij,ij->i", difference_mm, axis) for axis in (along, normal, binormal)]
    return Split(*parts)
