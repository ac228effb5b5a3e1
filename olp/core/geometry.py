"""Points of circular and helical moves, distances to straight and circular paths, rotations. Rows (n, 3),
mm."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask, distinct
from olp.core.values import dataclass

Plane = npt.NDArray[np.int8] | npt.NDArray[np.int64]

#: Plane number to (first, second, third) axis, right-handed: G17, G18, G19.
PLANES = ((0, 1, 2), (2, 0, 1), (1, 2, 0))
#: rad; a whole turn.
_TURN = 2.0 * np.pi
#: Points at a time, so that their columns stay in the cache.
_POINTS = 1 << 13
#: PLANES as an array, to be indexed by columns of planes.
_AXES = np.array(PLANES)


@dataclass(frozen=True, slots=True, eq=False)
class ArcShapes:
    """(m,) arcs by what does not change along them, so that many points of each are cheap.

    `centre_first` and `centre_second` are along the first and second axis of `plane`. From the start the
    `angle` goes by `sweep`, the `radius` by `wider` and the position along the third axis, `level`, by
    `rise`. Where the radii at both ends differ the radius goes linearly with the angle, as LinuxCNC
    interpolates; the third axis goes linearly too.
    """

    plane: Plane
    centre_first: Array
    centre_second: Array
    radius: Array
    wider: Array
    angle: Array
    sweep: Array
    level: Array
    rise: Array

    @staticmethod
    def of(start: Array, end: Array, centre: Array, plane: Plane, sweep: Array) -> ArcShapes:
        """Arcs from `start` (m, 3) to `end` about `centre`."""
        c0, c1, _ = in_planes(centre, plane)
        (s0, s1, s2), (e0, e1, e2) = in_planes(start, plane), in_planes(end, plane)
        s0, s1 = s0 - c0, s1 - c1
        radius = np.hypot(s0, s1)
        wider = np.hypot(e0 - c0, e1 - c1) - radius
        return ArcShapes(plane, c0, c1, radius, wider, np.arctan2(s1, s0), sweep, s2, e2 - s2)

    def at(self, which: Index, share: Array) -> Array:
        """(n, 3) points at shares (n,) of arcs `which` (n,); (n, s, 3) at shares (n, s) of arcs (n, 1). They
        lie in memory column by column."""
        points = np.moveaxis(np.empty((3, *share.shape)), 0, -1)
        rows, planes = max(_POINTS // int(np.prod(share.shape[1:])), 1), distinct(self.plane).tolist()
        for a in range(0, len(share), rows):
            self._put(points[a : a + rows], which[a : a + rows], share[a : a + rows], planes)
        return points

    def _put(self, points: Array, which: Index, share: Array, planes: list[int]) -> None:
        """The same of some, put into `points`."""
        radius = self.radius.take(which) + self.wider.take(which) * share
        angle = self.angle.take(which) + share * self.sweep.take(which)
        columns = (
            self.centre_first.take(which) + radius * np.cos(angle),
            self.centre_second.take(which) + radius * np.sin(angle),
            self.level.take(which) + share * self.rise.take(which),
        )
        for plane, mine in _by_plane(self.plane, which, planes):
            for axis, column in zip(PLANES[plane], columns, strict=True):
                points[mine, ..., axis] = column[mine]

    def distance(self, point: Array, which: Index, near: Array) -> Array:
        """(n,) distances of points (n, 3) from arcs `which` (n,), across the path and beyond its ends, for
        points that lie near share `near` of it."""
        distance = np.empty(len(point))
        per_rad = 1.0 / np.abs(self.sweep)
        for a in range(0, len(point), _POINTS):
            part = slice(a, a + _POINTS)
            distance[part] = self._away(point[part], which[part], near[part], per_rad)
        return distance

    def _away(self, point: Array, which: Index, near: Array, per_rad: Array) -> Array:
        """The same of some points; `per_rad` (m,) are arcs per radian."""
        reach, level, turned = self._polar(point, which, near)
        size = np.abs(self.sweep.take(which))
        place = np.clip(turned, 0.0, size)
        beyond = _beyond(turned, place, size)
        wider = (self.wider * per_rad).take(which)
        mean = self.radius.take(which) + wider * place
        across = reach - mean
        along = beyond * mean
        rising = np.flatnonzero(self.rise.take(which))
        if rising.size:
            of = which[rising]
            lead = self.rise[of] * per_rad[of]
            some, radius, here = level[rising], mean[rising], place[rising]
            # a helix rises by `lead` per radian: the nearest point is a little ahead, unless it ends before
            ahead = (beyond[rising] * radius**2 + (some - here * lead) * lead) / np.maximum(
                radius**2 + lead**2, 1e-24
            )
            nearest = np.clip(here + ahead, 0.0, size[rising])
            across[rising] -= wider[rising] * (nearest - here)
            along[rising] = (here + beyond[rising] - nearest) * radius
            level[rising] -= nearest * lead
        return np.asarray(np.sqrt(across * across + along * along + level * level), float)

    def across(self, point: Array, which: Index, near: Array) -> tuple[Array, Array, Mask]:
        """(n,) how far points as in `distance` are off in the two directions across arcs that go on beyond
        their ends: away from the axis, and along it. Then (n,) whether they lie beyond an end."""
        columns = np.empty(len(point)), np.empty(len(point)), np.empty(len(point), bool)
        per_rad = 1.0 / np.abs(self.sweep)
        for a in range(0, len(point), _POINTS):
            part = slice(a, a + _POINTS)
            for column, some in zip(
                columns, self._across(point[part], which[part], near[part], per_rad), strict=True
            ):
                column[part] = some
        return columns

    def _across(self, point: Array, which: Index, near: Array, per_rad: Array) -> tuple[Array, Array, Mask]:
        """The same of some points."""
        radial, level, place = self._polar(point, which, near)
        mean = self.radius.take(which) + (self.wider * per_rad).take(which) * place
        radial -= mean
        rising = np.flatnonzero(self.rise.take(which))
        if rising.size:
            of = which[rising]
            lead, radius = self.rise[of] * per_rad[of], mean[rising]
            over = level[rising] - place[rising] * lead
            square = np.maximum(radius**2 + lead**2, 1e-24)
            place[rising] += over * lead / square
            level[rising] = over * radius / np.sqrt(square)
        return radial, level, (place < 0.0) | (place > np.abs(self.sweep.take(which)))

    def _polar(self, point: Array, which: Index, near: Array) -> tuple[Array, Array, Array]:
        """(n,) distances of points from the axes of arcs, positions along these from the start, and angles
        from the start in the direction of the sweep, which lie on the turn of share `near`."""
        p0, p1, p2 = in_planes(point, self.plane.take(which))
        p0, p1 = p0 - self.centre_first.take(which), p1 - self.centre_second.take(which)
        sweep = self.sweep.take(which)
        angle = np.arctan2(p1, p0) - self.angle.take(which)
        angle += _TURN * np.rint((near * sweep - angle) * (1.0 / _TURN))
        reach = np.sqrt(p0 * p0 + p1 * p1)
        return reach, p2 - self.level.take(which), np.where(sweep < 0.0, -angle, angle)


def _beyond(turned: Array, place: Array, size: Array) -> Array:
    """(n,) signed angles of points at angles `turned` along arcs of `size` from their `place` on these: from
    the end that is nearer, whatever the turn."""
    beyond = np.zeros(len(turned))
    off = np.flatnonzero(turned != place)
    turned, place, size = turned[off], place[off], size[off]
    wrapped = np.mod(turned, _TURN)
    away = np.maximum(np.minimum(wrapped - size, _TURN - wrapped), 0.0)
    beyond[off] = np.where(size >= _TURN, np.abs(turned - place), away) * np.sign(turned - place)
    return beyond


def _by_plane(plane: Plane, which: Index, present: list[int]) -> Iterator[tuple[int, slice | Index]]:
    """Each plane that is present, and its arcs among `which`; mostly there is one."""
    for one in present:
        yield one, slice(None) if len(present) == 1 else np.flatnonzero(plane[which] == one)


def in_planes(point: Array, plane: Plane) -> tuple[Array, Array, Array]:
    """(m,) coordinates of points (m, 3) along the first, second and third axis of their planes; (m, s) of
    points (m, s, 3)."""
    if len(plane) and (plane == plane[0]).all():
        first, second, third = PLANES[int(plane[0])]
        return point[..., first], point[..., second], point[..., third]
    rows, axes = np.arange(len(point)), _AXES[plane]
    return point[rows, ..., axes[:, 0]], point[rows, ..., axes[:, 1]], point[rows, ..., axes[:, 2]]


def put_in_planes(point: Array, plane: Plane, first: Array, second: Array) -> None:
    """Put (m,) coordinates along the first and second axis of their planes into points (m, 3)."""
    for one, mine in _by_plane(plane, np.arange(len(plane)), distinct(plane).tolist()):
        axes = PLANES[one]
        point[mine, axes[0]], point[mine, axes[1]] = first[mine], second[mine]


def arc_points(start: Array, end: Array, centre: Array, plane: Plane, sweep: Array, share: Array) -> Array:
    """(n, 3) points at shares (n,) of arcs (n,) as in `ArcShapes`."""
    return ArcShapes.of(start, end, centre, plane, sweep).at(np.arange(len(start)), share)


def arms(point: Array, centre: Array, plane: Plane) -> tuple[Array, Array]:
    """(n,) coordinates of points (n, 3) along the first and the second axis of their planes, from centres."""
    (p0, p1, _), (c0, c1, _) = in_planes(point, plane), in_planes(centre, plane)
    return p0 - c0, p1 - c1


def quarter_shares(start: Array, centre: Array, plane: Plane, sweep: Array, quarter: int) -> Array:
    """(n,) share of each arc at which it first passes the angle of `quarter` right angles, and whole turns;
    NaN where it does not."""
    along, across = arms(start, centre, plane)
    begin = np.arctan2(across, along)
    turn = np.mod((quarter * np.pi / 2 - begin) * np.sign(sweep), 2 * np.pi)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = turn / np.abs(sweep)
    return np.where(share <= 1.0, share, np.nan)


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """(m,) segments by columns, so that distances of many points from each are cheap: where they `begin` and
    how far they go `along` each axis. `inverse` is 1 over the square of their length, 0 of one without length
    or to an unknown end."""

    begin: list[Array]
    along: list[Array]
    inverse: Array

    @staticmethod
    def of(start: Array, end: Array) -> Segments:
        """Segments from `start` (m, 3) to `end`, or in the plane from (m, 2)."""
        begin, along = (list(np.ascontiguousarray(rows.T)) for rows in (start, end - start))
        square = np.zeros(len(start))
        for column in along:
            square += column * column
        return Segments(begin, along, np.divide(1.0, square, out=np.zeros_like(square), where=square > 0))

    def distance(self, point: Array, which: Index | None = None) -> Array:
        """(n,) distances of points (n, 3) from segments, or from those `which` (n,)."""
        distance = np.empty(len(point))
        for a in range(0, len(point), _POINTS):
            part = slice(a, a + _POINTS)
            of = np.arange(a, min(a + _POINTS, len(point))) if which is None else which[part]
            away = [point[part, axis] - column.take(of) for axis, column in enumerate(self.begin)]
            way = [column.take(of) for column in self.along]
            share = np.zeros(len(of))
            for there, ahead in zip(away, way, strict=True):
                share += there * ahead
            share *= self.inverse.take(of)
            np.clip(share, 0.0, 1.0, out=share)
            square = np.zeros(len(share))
            for there, ahead in zip(away, way, strict=True):
                ahead *= share
                there -= ahead
                there *= there
                square += there
            np.sqrt(square, out=distance[part])
        return distance


def segment_distance(point: Array, start: Array, end: Array, which: Index | None = None) -> Array:
    """(n,) distances of points from segments, or from those `which` (n,), in the plane or in space; a segment
    without length is a point."""
    return Segments.of(start, end).distance(point, which)


def arc_directions(
    start: Array, end: Array, centre: Array, plane: Plane, sweep: Array, share: Array
) -> Array:
    """(n, 3) sign of each axis' motion at shares (n,) of arcs."""
    rows = np.arange(len(start))
    first, second, third = (_AXES[plane][:, i] for i in range(3))
    along, across = arms(start, centre, plane)
    angle = np.arctan2(across, along) + share * sweep
    motion = np.zeros((len(start), 3))
    motion[rows, first] = -np.sin(angle) * np.sign(sweep)
    motion[rows, second] = np.cos(angle) * np.sign(sweep)
    motion[rows, third] = end[rows, third] - start[rows, third]
    return np.asarray(np.sign(np.where(np.abs(motion) < 1e-9, 0.0, motion)), float)


def rotation_matrix(angles_deg: tuple[float, float, float]) -> Array:
    """(3, 3) rotation by A about X first, then B about Y, then C about Z, of fixed axes: Rz Ry Rx."""
    (sa, sb, sc), (ca, cb, cc) = np.sin(np.radians(angles_deg)), np.cos(np.radians(angles_deg))
    about_x = np.array(((1.0, 0.0, 0.0), (0.0, ca, -sa), (0.0, sa, ca)))
    about_y = np.array(((cb, 0.0, sb), (0.0, 1.0, 0.0), (-sb, 0.0, cb)))
    about_z = np.array(((cc, -sc, 0.0), (sc, cc, 0.0), (0.0, 0.0, 1.0)))
    return np.asarray(about_z @ about_y @ about_x, float)
