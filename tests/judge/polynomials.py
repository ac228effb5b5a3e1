"""What pieces of motion do, from their coefficients alone: written without the project's own evaluation.

Path and drive of a piece are composed into one polynomial of time for each axis. Its control points in
Bernstein form bound what it can reach; where they do not decide, the piece is halved. So a limit is kept
everywhere, between all samples, or a time is known at which it is not. Times of joints are
floats, so the last digits of both ends do not count to a piece.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from math import comb

import numpy as np

#: halvings of a piece after which its control points are taken for its values
_DEPTH = 40


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """Of n pieces: `axis` (n, d + 1, 3) coefficients of positions by time in s after the piece's start,
    lowest first. The degree is `plain` where the piece is not `bent` (n,). `start_s`, `lasts_s` and `line`
    are (n,)."""

    axis: np.ndarray
    start_s: np.ndarray
    lasts_s: np.ndarray
    bent: np.ndarray
    line: np.ndarray
    plain: int
    _rates: dict[int, np.ndarray] = field(default_factory=dict)

    @staticmethod
    def of(motion) -> Pieces:
        """From the arrays of a motion: times of joints, drives, shapes, and which shape each piece has."""
        drive, shape = np.asarray(motion.time, float), np.asarray(motion.path, float)[motion.shape]
        degree = 3 * (drive.shape[1] - 1)
        axis = np.zeros((len(drive), degree + 1, 3))
        axis[:, 0] = shape[:, 3]
        filled = 1
        for i in (2, 1, 0):
            grown = np.zeros((len(drive), filled + drive.shape[1] - 1, 3))
            for k in range(drive.shape[1]):
                grown[:, k : k + filled] += axis[:, :filled] * drive[:, k, None, None]
            filled = grown.shape[1]
            axis[:, :filled] = grown
            axis[:, 0] += shape[:, i]
        used = np.flatnonzero(axis.any(axis=(0, 2)))
        axis = axis[:, : max(int(used.max(initial=0)), 3) + 1]
        bent = shape[:, 2:].any(axis=(1, 2)) & drive[:, 1:].any(axis=1)
        start = np.asarray(motion.start_s, float)
        return Pieces(axis, start[:-1], np.diff(start), bent, np.asarray(motion.line), drive.shape[1] - 1)

    def __len__(self) -> int:
        return len(self.axis)

    def derivative(self, order: int) -> np.ndarray:
        """(n, d + 1 - order, 3) coefficients."""
        if order not in self._rates:
            powers = np.arange(self.axis.shape[1])
            factor = np.prod([powers - i for i in range(order)], axis=0) if order else np.ones(len(powers))
            self._rates[order] = (self.axis * factor[:, None])[:, order:]
        return self._rates[order]

    def at(self, piece: np.ndarray, u: np.ndarray, order: int = 0) -> np.ndarray:
        """(m, 3) positions or derivatives of pieces (m,) at times (m,) after their starts."""
        rows = self.derivative(order)
        values = np.empty((len(piece), 3))
        bent = self.bent[piece]
        for chosen, degree in ((bent, rows.shape[1] - 1), (~bent, self.plain - order)):
            some = np.flatnonzero(chosen)
            mine, time = piece[some], u[some, None]
            value = rows[mine, degree]
            for i in range(degree - 1, -1, -1):
                value = value * time + rows[mine, i]
            values[some] = value
        return values

    def position(self, time_s: np.ndarray) -> np.ndarray:
        """(m, 3) at any times."""
        piece = np.clip(np.searchsorted(self.start_s, time_s, side="right") - 1, 0, len(self) - 1)
        return self.at(piece, time_s - self.start_s[piece])

    def largest(self, order: int, limit: np.ndarray) -> np.ndarray:
        """(n, 3) largest absolute value of a derivative over `limit` (3,), wherever that is above 1, or a
        bound of it below."""
        scaled = self.derivative(order) / limit
        return np.column_stack([_bounded(self._control(scaled[:, :, i])) for i in range(3)])

    def fastest(self, feed: np.ndarray) -> np.ndarray:
        """(n,) the same of the speed along the path over the feed of each piece (n,)."""
        velocity = self.derivative(1) / feed[:, None, None]
        size = velocity.shape[1]
        square = np.zeros((len(self), 2 * size - 1))
        for i in range(size):
            square[:, i : i + size] += (velocity * velocity[:, i, None]).sum(axis=2)
        return np.sqrt(_bounded(self._control(square)))

    def _control(self, rows: np.ndarray) -> np.ndarray:
        """(n, d + 1) control points over the piece of polynomials in time."""
        lasts = np.maximum(self.lasts_s - 2 * np.spacing(self.start_s + self.lasts_s), 0.0)
        powers = lasts[:, None] ** np.arange(rows.shape[1])
        return np.asarray((rows * powers) @ _to_bernstein(rows.shape[1] - 1))


@cache
def _to_bernstein(degree: int) -> np.ndarray:
    return np.array([[comb(i, j) / comb(degree, j) for i in range(degree + 1)] for j in range(degree + 1)])


@cache
def _halves(degree: int) -> tuple[np.ndarray, np.ndarray]:
    first = np.array(
        [[comb(i, j) / 2.0**i if j <= i else 0.0 for j in range(degree + 1)] for i in range(degree + 1)]
    )
    return first, first[::-1, ::-1]


def _bounded(control: np.ndarray) -> np.ndarray:
    """(n,) largest absolute value of polynomials given by control points (n, d + 1): to 1e-7 where it is
    above 1, else any bound of it that is not."""
    known = np.abs(control[:, [0, -1]]).max(axis=1)
    hull = np.abs(control).max(axis=1)
    bound = np.maximum(known, np.where(hull <= 1.0, hull, 0.0))
    owner = np.flatnonzero(hull > 1.0)
    control = control[owner]
    first, second = _halves(control.shape[1] - 1)
    for depth in range(_DEPTH + 1):
        hull = np.abs(control).max(axis=1)
        np.maximum.at(bound, owner, np.abs(control[:, [0, -1]]).max(axis=1, initial=0.0))
        decided = hull <= np.maximum(1.0, bound[owner] * (1.0 + 1e-7))
        if depth == _DEPTH:
            decided[:] = True
        np.maximum.at(bound, owner[decided], hull[decided])
        owner, control = owner[~decided], control[~decided]
        if not len(owner):
            break
        control = np.concatenate((control @ first.T, control @ second.T))
        owner = np.concatenate((owner, owner))
    return bound
