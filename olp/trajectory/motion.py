"""A motion in time, in pieces: positions and their derivatives at any time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.values import dataclass
from olp.trajectory.growing import Growing

#: coefficients of a cubic
CUBIC = 4
#: instants at a time: columns of so many stay in the cache
_BLOCK = 1 << 13


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Pieces of a path, each driven by a polynomial in time.

    Piece k lasts from `start_s[k]` to `start_s[k + 1]`. With u = t - start_s[k] the parameter is
    s = sum_i `time`[k, i] u^i, and the axis positions are sum_i `path`[`shape`[k], i] s^i in mm. `time` is
    (k, 4) for cubics, (k, 6) where a solver needs quintics; `path` (m, 4, 3), `shape` (k,). Where axes are
    cubics of time themselves, s = u. `line` (k,) is the program line of each piece.
    """

    start_s: Array
    time: Array
    path: Array
    shape: Index
    line: Index

    @property
    def duration_s(self) -> float:
        return float(self.start_s[-1] - self.start_s[0]) if len(self.start_s) else 0.0

    @property
    def cubic(self) -> bool:
        """Whether no piece has more than a cubic of time, so that axes may be cubics of time, too."""
        return bool(self.time.shape[1] == CUBIC)

    @property
    def axes(self) -> int:
        """How many axes move."""
        return int(self.path.shape[2])

    def __len__(self) -> int:
        return len(self.time)

    def piece_at(self, time_s: Array) -> Index:
        """(n,) index of the piece at each time; at a joint, of the later one."""
        index = np.searchsorted(self.start_s, time_s, side="right") - 1
        return np.clip(index, 0, max(len(self) - 1, 0))

    def at(self, time_s: Array) -> tuple[Array, Array, Array, Array]:
        """Position mm, velocity mm/s, acceleration mm/s^2 and jerk mm/s^3, (n, 3) each, at times (n,) s."""
        piece = self.piece_at(time_s)
        return self.of(piece, time_s - self.start_s[piece])

    def of(self, piece: Index, u: Array) -> tuple[Array, Array, Array, Array]:
        """The same at times `u` (n,) after the start of pieces (n,)."""
        position, velocity, acceleration, jerk = (np.empty((self.axes, len(piece))) for _ in range(4))
        for some in _blocks(len(piece)):
            s, s1, s2, s3 = derivatives(self.time[piece[some]], u[some])
            for axis, (p0, p1, p2, p3) in enumerate(self._coefficients(piece[some])):
                q1 = p1 + s * (2.0 * p2 + 3.0 * s * p3)
                q2 = 2.0 * p2 + 6.0 * s * p3
                q3 = 6.0 * p3
                position[axis, some] = p0 + s * (p1 + s * (p2 + s * p3))
                velocity[axis, some] = q1 * s1
                acceleration[axis, some] = q2 * s1 * s1 + q1 * s2
                jerk[axis, some] = q3 * s1 * s1 * s1 + 3.0 * q2 * s1 * s2 + q1 * s3
        return position.T, velocity.T, acceleration.T, jerk.T

    def positions(self, piece: Index, u: Array) -> Array:
        """The first of these alone."""
        position = np.empty((self.axes, len(piece)))
        for some in _blocks(len(piece)):
            c = self.time[piece[some]].T
            s = c[-1]
            for row in c[-2::-1]:
                s = s * u[some] + row
            for axis, (p0, p1, p2, p3) in enumerate(self._coefficients(piece[some])):
                position[axis, some] = p0 + s * (p1 + s * (p2 + s * p3))
        return position.T

    def _coefficients(self, piece: Index) -> Iterator[tuple[Array, Array, Array, Array]]:
        """Of each axis the four coefficients (n,) of the paths of pieces (n,): columns, which are several
        times as fast as rows of three."""
        shape = self.shape[piece]
        low, high = (int(shape.min()), int(shape.max()) + 1) if len(shape) else (0, 0)
        shape -= low
        columns = np.ascontiguousarray(self.path[low:high].transpose(2, 1, 0))
        for axis in range(self.axes):
            p0, p1, p2, p3 = (column.take(shape) for column in columns[axis])
            yield p0, p1, p2, p3

    def slowed(self, factor: float) -> Motion:
        """The same path in `factor` times the time: speeds shrink by it, accelerations by its square."""
        scale = factor ** -np.arange(float(self.time.shape[1]))
        begin = self.start_s[0] if len(self.start_s) else 0.0
        return Motion(
            begin + (self.start_s - begin) * factor, self.time * scale, self.path, self.shape, self.line
        )

    def part(self, pieces: slice) -> Motion:
        """Consecutive pieces, with the paths from the first to the last that they drive."""
        shape = self.shape[pieces]
        low, high = (int(shape.min()), int(shape.max()) + 1) if len(shape) else (0, 0)
        start = self.start_s[pieces.start : pieces.stop + 1]
        return Motion(start, self.time[pieces], self.path[low:high], shape - low, self.line[pieces])

    def shifted(self, by_s: float) -> Motion:
        return Motion(self.start_s + by_s, self.time, self.path, self.shape, self.line)

    @staticmethod
    def rest(at_mm: Array, seconds: float, line: int) -> Motion:
        """A motion that stands still."""
        path = np.zeros((1, 4, len(at_mm)))
        path[0, 0] = at_mm
        return Motion(
            np.array([0.0, seconds]),
            np.zeros((1, 4)),
            path,
            np.zeros(1, np.int64),
            np.array([line], np.int64),
        )

    @staticmethod
    def joined(parts: Iterable[Motion]) -> Motion:
        """Motions one after the other, from 0 s; a single one is not copied. `parts` is read one by one."""
        first: Motion | None = None
        whole: _Joined | None = None
        for part in parts:
            if first is None:
                first = part
                continue
            if whole is None:
                whole = _Joined(first.axes)
                whole.add(first)
            whole.add(part)
        if whole is not None:
            return whole.motion()
        if first is None:
            return _Joined(3).motion()
        return first if first.start_s[0] == 0.0 else first.shifted(-first.start_s[0])


def _blocks(count: int) -> Iterator[slice]:
    for a in range(0, count, _BLOCK):
        yield slice(a, a + _BLOCK)


class _Joined:
    """Motions one after the other."""

    def __init__(self, axes: int) -> None:
        self._start = Growing(np.zeros(0))
        self._time = Growing(np.zeros((0, 4)))
        self._path = Growing(np.zeros((0, 4, axes)))
        self._shape = Growing(np.zeros(0, np.int64))
        self._line = Growing(np.zeros(0, np.int64))
        self._wide = 4
        self._end_s = 0.0

    def add(self, part: Motion) -> None:
        wide = part.time.shape[1]
        if wide > self._wide:
            before = self._time.whole()
            self._time = Growing(np.zeros((0, wide)))
            self._time.append(np.pad(before, ((0, 0), (0, wide - self._wide))))
            self._wide = wide
        narrow = self._wide - wide
        self._time.append(np.pad(part.time, ((0, 0), (0, narrow))) if narrow else part.time)
        self._start.append(part.start_s[:-1] - part.start_s[0] + self._end_s)
        self._end_s += part.duration_s
        self._shape.append(part.shape + len(self._path))
        self._path.append(part.path)
        self._line.append(part.line)

    def motion(self) -> Motion:
        self._start.append(np.array([self._end_s]))
        return Motion(
            self._start.whole(),
            self._time.whole(),
            self._path.whole(),
            self._shape.whole(),
            self._line.whole(),
        )


def derivatives(coefficient: Array, u: Array) -> tuple[Array, Array, Array, Array]:
    """(n,) values and first three derivatives at `u` (n,) of polynomials `coefficient` (n, 4 or more)."""
    c = coefficient.T
    f, f1, f2, f3 = c[-1], np.zeros_like(u), np.zeros_like(u), np.zeros_like(u)
    for row in c[-2::-1]:
        # Horner for the value and, over their factorials, its derivatives
        f3 = f3 * u + f2
        f2 = f2 * u + f1
        f1 = f1 * u + f
        f = f * u + row
    return f, f1, 2.0 * f2, 6.0 * f3
