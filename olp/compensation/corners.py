"""Corners of contours under cutter compensation (G41, G42): what the control cuts off, and what it refuses.

The control goes along the contour at the distance of the cutter radius. At a concave corner it stops short of
the end of a move and begins the next one later. A move that is shorter than both together cannot be cut. Nor
can the inside of an arc with a smaller radius than the cutter, and the first move has to be longer than it.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import PLANES, arms
from olp.core.toolpath import CutterCompensation, Toolpath
from olp.core.values import dataclass

#: rad; LinuxCNC takes a smaller change of direction for none
_SMOOTH = 0.05
#: no part of a split move ends nearer to a concave corner than so many times what is cut off there
_AWAY = 2.0


def gouging(path: Toolpath, *, seen: bool = False) -> Mask:
    """(n,) moves under cutter compensation that cannot be cut; with `seen` only those where the path changes
    direction behind the move, which the control looks at in any case. Contours of unknown radius have none.
    """
    bad = np.zeros(len(path), bool)
    for elements in _contours(path):
        begin, end = elements.cut_off()
        wrong = begin + end >= elements.length_mm
        if seen:
            wrong &= np.append(np.abs(elements.turn_rad()) > _SMOOTH, False)
        wrong[0] = elements.chord_mm[0] <= elements.radius_mm
        bad[elements.move[wrong]] = True
    return bad


def away_from_corners(path: Toolpath, move: Index, share: Array) -> Mask:
    """Whether shares (k,) of moves (k,) are so far from concave corners that the control takes a block that
    ends there."""
    away = np.ones(len(move), bool)
    for elements in _contours(path):
        begin, end = elements.cut_off()
        index = np.minimum(np.searchsorted(elements.move, move), len(elements.move) - 1)
        mine = elements.move[index] == move
        # an arc may lose more than the lines along its tangents do
        more = np.where(elements.curved, elements.radius_mm, 0.0)
        first = share * elements.own_mm[index] < (_AWAY * begin + np.where(begin > 0, more, 0.0))[index]
        last = (1 - share) * elements.own_mm[index] < (_AWAY * end + np.where(end > 0, more, 0.0))[index]
        away &= ~(mine & (first | last))
    return away


@dataclass(frozen=True, slots=True, eq=False)
class _Elements:
    """Moves of one contour that go across its plane. (k,) `move` is their index, `begins` and `ends` their
    directions in rad at both ends, `own_mm` their length, `chord_mm` the distance of their ends. `length_mm`
    is the length of the path beside them, below 0 where the cutter does not fit into an arc (`curved`)."""

    left: bool
    radius_mm: float
    move: Index
    begins: Array
    ends: Array
    own_mm: Array
    length_mm: Array
    chord_mm: Array
    curved: Mask

    @staticmethod
    def of(path: Toolpath, a: int, b: int, compensation: CutterCompensation) -> _Elements:
        first, second, _ = PLANES[compensation.plane]
        start, end = path.starts_mm(a, b), path.end_mm[a:b]
        along, across = end[:, first] - start[:, first], end[:, second] - start[:, second]
        chord = np.hypot(along, across)
        direction = np.arctan2(across, along)
        begins, ends, own, length = direction.copy(), direction.copy(), chord.copy(), chord.copy()
        curved = np.zeros(b - a, bool)
        chosen = slice(*np.searchsorted(path.arcs.move, (a, b)))
        rows = path.arcs.move[chosen] - a
        if len(rows):
            arcs = path.arcs
            centre, plane, sweep = arcs.centre_mm[chosen], arcs.plane[chosen], arcs.sweep_rad[chosen]
            (x0, y0), (x1, y1) = arms(start[rows], centre, plane), arms(end[rows], centre, plane)
            quarter = np.copysign(np.pi / 2, sweep)
            begins[rows], ends[rows] = np.arctan2(y0, x0) + quarter, np.arctan2(y1, x1) + quarter
            within = (sweep > 0) == compensation.left
            radius = np.hypot(x1, y1)
            beside = radius - np.where(within, 1.0, -1.0) * compensation.radius_mm
            own[rows], length[rows] = np.abs(sweep) * radius, np.abs(sweep) * beside
            curved[rows] = True
        pick = np.flatnonzero((chord > 0) | curved)
        return _Elements(
            compensation.left, compensation.radius_mm, pick + a, begins[pick], ends[pick], own[pick],
            length[pick], chord[pick], curved[pick],
        )  # fmt: skip

    def turn_rad(self) -> Array:
        """(k - 1,) changes of direction between moves."""
        turn = self.begins[1:] - self.ends[:-1]
        return np.asarray((turn + np.pi) % (2 * np.pi) - np.pi, float)

    def cut_off(self) -> tuple[Array, Array]:
        """(k,) mm that each move loses at its begin and at its end; at arcs as along their tangents."""
        turn = self.turn_rad()
        inward = turn if self.left else -turn
        concave = (inward > _SMOOTH) & (inward < np.pi - _SMOOTH)
        end = np.where(concave, self.radius_mm * np.tan(np.where(concave, inward, 0.0) / 2), 0.0)
        # at a smooth corner the control begins the next move where it ended the last one
        smooth = (inward > 0) & (inward <= _SMOOTH)
        begin = np.where(smooth, self.radius_mm * np.sin(inward), end)
        return np.concatenate(([0.0], begin)), np.concatenate((end, [0.0]))


def _contours(path: Toolpath) -> Iterator[_Elements]:
    """The contours of a path whose cutter radius is known."""
    on = path.compensated()
    edges = np.flatnonzero(on != np.concatenate(([False], on[:-1])))
    for a, b in pairwise([*edges.tolist(), len(path)]):
        compensation = path.frames[int(path.frame[a])].compensation
        if on[a] and compensation is not None and compensation.radius_mm > 0:
            elements = _Elements.of(path, a, b, compensation)
            if len(elements.move):
                yield elements
