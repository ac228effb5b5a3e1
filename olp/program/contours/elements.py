"""The moves of contours that go across their planes, in columns: directions, normals, circles."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import PLANES
from olp.core.toolpath import Toolpath
from olp.core.values import dataclass

#: (3, 3) axes of each plane: first, second, third.
AXES = np.array(PLANES)


def direction(angle: Array) -> Array:
    """(k, 2) vectors of length 1."""
    return np.column_stack((np.cos(angle), np.sin(angle)))


def wrapped(angle: Array) -> Array:
    """Angles in -pi to pi."""
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi, float)


@dataclass(frozen=True, slots=True, eq=False)
class Elements:
    """(k,) moves of contours of a known radius that go across their planes; coordinates (k, 2) are along the
    first and second axis of `plane`, mm.

    `move` is the index in the path. `first` moves enter a contour, and `next` ones have the element before in
    the same contour. `side` is 1 where the tool is left, else -1. `begin` and `end` are programmed points,
    `begins` and `ends` directions there in rad. Arcs have a `centre`, a `sweep` and a `size`, their radius at
    the end. `unit` is that of the program, mm.
    """

    move: Index
    first: Mask
    next: Mask
    side: Array
    radius: Array
    plane: npt.NDArray[np.int8]
    begin: Array
    end: Array
    begins: Array
    ends: Array
    arc: Mask
    centre: Array
    sweep: Array
    size: Array
    unit: Array

    def __len__(self) -> int:
        return len(self.move)

    @staticmethod
    def of(path: Toolpath) -> Elements:
        """The elements of all contours of a path."""
        table = [f.compensation for f in path.frames]
        radii = np.array([0.0 if c is None else c.radius_mm for c in table])
        numbers = np.array([-1 if c is None else c.number for c in table], np.int64)
        sides = np.array([1.0 if c is None or c.left else -1.0 for c in table])
        planes = np.array([0 if c is None else c.plane for c in table], np.int8)
        units = np.array([f.unit_mm for f in path.frames])
        move = np.flatnonzero(radii[path.frame] > 0) if len(table) else np.zeros(0, np.int64)
        frame = path.frame[move]
        plane = planes[frame]
        rows = np.arange(len(move))[:, None]
        start = np.where((move > 0)[:, None], path.end_mm[np.maximum(move - 1, 0)], np.array(path.start_mm))
        begin, end = start[rows, AXES[plane][:, :2]], path.end_mm[move][rows, AXES[plane][:, :2]]
        sweep, centre, is_arc = np.zeros(len(move)), np.zeros((len(move), 2)), np.zeros(len(move), bool)
        stated = np.searchsorted(move, path.arcs.move)
        arcs = np.flatnonzero(np.append(move, -1)[stated] == path.arcs.move)
        mine = stated[arcs]
        sweep[mine], is_arc[mine] = path.arcs.sweep_rad[arcs], True
        centre[mine] = path.arcs.centre_mm[arcs][np.arange(len(arcs))[:, None], AXES[plane[mine]][:, :2]]
        across = is_arc | ~(begin == end).all(axis=1)
        contour = numbers[frame]
        first = np.zeros(len(move), bool)
        kept = np.flatnonzero(across)
        first[kept] = np.concatenate(([True], contour[kept][1:] != contour[kept][:-1]))[: len(kept)]
        d = end - begin
        begins = np.arctan2(d[:, 1], d[:, 0])
        ends, size = begins.copy(), np.zeros(len(move))
        quarter = np.copysign(np.pi / 2, sweep[mine])
        a, b = begin[mine] - centre[mine], end[mine] - centre[mine]
        begins[mine] = np.arctan2(a[:, 1], a[:, 0]) + quarter
        ends[mine] = np.arctan2(b[:, 1], b[:, 0]) + quarter
        size[mine] = np.hypot(b[:, 0], b[:, 1])
        return Elements(
            move[kept], first[kept], ~first[kept], sides[frame[kept]], radii[frame[kept]], plane[kept],
            begin[kept], end[kept], begins[kept], ends[kept], is_arc[kept], centre[kept], sweep[kept],
            size[kept], units[frame[kept]],
        )  # fmt: skip

    def normal(self, angle: Array) -> Array:
        """(k, 2) vectors of the length of the radius towards the tool, across directions."""
        return direction(angle + self.side * np.pi / 2) * self.radius[:, None]

    @property
    def inside(self) -> Mask:
        """Arcs on whose inner side the tool is."""
        return np.asarray(self.arc & ((self.sweep > 0) == (self.side > 0)))

    @property
    def tool_size(self) -> Array:
        """(k,) radius of the tool's path along arcs, 0 or less where the cutter does not fit."""
        return self.size + np.where(self.inside, -self.radius, self.radius)
