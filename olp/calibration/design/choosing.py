"""Which of many possible readings to take next: those that lower the uncertainty most, chosen one after the
other, and then exchanged while that helps (V. V. Fedorov, 1972)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from olp.calibration.design.known import lengths_of
from olp.calibration.estimator.normal import Block
from olp.core.arrays import Array
from olp.core.values import dataclass

#: A: the least mean square of the error over the box. D: the smallest volume of uncertainty of all unknowns.
Criterion = Literal["A", "D"]
#: Standard deviation of shared unknowns, such as the frame of an instrument that is aligned to the axes, mm.
_SHARED_MM = 1.0
#: Every reading is exchanged for a better one at most so often.
_ROUNDS = 3
#: Readings that leave less than this share of a variance are not given back by a change of the covariance:
#: rounding would count.
_SAFE = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Possible readings: `rows` (n, m, size) of standardised readings, m of each candidate, by independent
    unknowns of variance 1; `shared` (n, m, s) of unknowns that all candidates have in common."""

    rows: Array
    shared: Array

    def only(self, index: npt.NDArray[np.intp]) -> Candidates:
        return Candidates(self.rows[index], self.shared[index])


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """Indices of candidates, the most helpful first. `rms_mm` are the expected rms lengths of the error
    before the first of them and after each, `worst_mm` the largest length at one position in the end."""

    index: npt.NDArray[np.intp]
    rms_mm: Array
    worst_mm: float


class _Knowledge:
    """The covariance after the readings that are taken, and what every candidate would see of it."""

    def __init__(self, candidates: Candidates, judged: Array) -> None:
        size, shared = candidates.rows.shape[2], candidates.shared.shape[2]
        self.rows = np.concatenate([candidates.rows, candidates.shared], axis=2)
        self.shared = candidates.shared
        self.before = np.diag(np.concatenate([np.ones(size), np.full(shared, _SHARED_MM**2)]))
        self.judged = np.pad(judged, ((0, 0), (0, shared)))
        self.begin(())

    def begin(self, taken: Sequence[int]) -> None:
        """Begin with the readings of some candidates, and of no others."""
        self.free = np.ones(len(self.rows), bool)
        self.free[list(taken)] = False
        self.covariance = self.before
        self.shared_precision = np.eye(self.shared.shape[2]) / _SHARED_MM**2
        for one in taken:
            seen = self.covariance @ self.rows[one].T
            inner = np.eye(seen.shape[1]) + self.rows[one] @ seen
            self.covariance = self.covariance - seen @ np.linalg.solve(inner, seen.T)
            self.shared_precision = self.shared_precision + self.shared[one].T @ self.shared[one]
        seen = self.rows @ self.covariance
        self.spread = seen @ self.rows.transpose(0, 2, 1)
        self.across = seen @ self.judged.T

    @property
    def square(self) -> float:
        """The sum of the variances of what is judged."""
        return float(np.einsum("ij,jk,ik->", self.judged, self.covariance, self.judged, optimize=True))

    def best(self, criterion: Criterion) -> int:
        """The free candidate that gains most."""
        inner = np.eye(self.rows.shape[1]) + self.spread
        if criterion == "A":
            gain = (self.across * np.linalg.solve(inner, self.across)).sum(axis=(1, 2))
        else:
            # what is learnt of shared unknowns does not count
            known = self.shared @ np.linalg.solve(self.shared_precision, self.shared.transpose(0, 2, 1))
            gain = np.linalg.slogdet(inner)[1] - np.linalg.slogdet(np.eye(known.shape[1]) + known)[1]
        return int(np.argmax(np.where(self.free, gain, -np.inf)))

    def give_back(self, one: int, others: Sequence[int]) -> None:
        """Give back the readings of a candidate; those of others are kept."""
        left = np.linalg.eigvalsh(np.eye(self.spread.shape[1]) - self.spread[one])[0]
        if left > _SAFE:
            self.take(one, -1.0)
        else:
            self.begin(others)

    def take(self, one: int, sign: float = 1.0) -> None:
        """Take the readings of a candidate, or give them back with sign -1."""
        seen = self.covariance @ self.rows[one].T
        inner = np.eye(seen.shape[1]) + sign * self.spread[one]
        change = sign * np.linalg.solve(inner, seen.T)
        of_all = self.rows @ seen
        self.covariance = self.covariance - seen @ change
        self.spread = self.spread - of_all @ (change @ self.rows.transpose(0, 2, 1))
        self.across = self.across - of_all @ (change @ self.judged.T)
        self.shared_precision = self.shared_precision + sign * self.shared[one].T @ self.shared[one]
        self.free[one] = sign < 0.0


def choose(candidates: Candidates, judged: Array, count: int, criterion: Criterion) -> Choice:
    """`count` of the candidates. `judged` (tools, 3 n, size) is the error where it matters, by the same
    unknowns."""
    functionals = judged.reshape(-1, judged.shape[2])
    scale = 3.0 / len(functionals)
    small = np.asarray(np.linalg.qr(functionals)[1]) if len(functionals) > judged.shape[2] else functionals
    knowledge = _Knowledge(candidates, small)
    taken = [_took(knowledge, criterion) for _ in range(min(count, len(candidates.rows)))]
    for _ in range(_ROUNDS):
        before = list(taken)
        for k, one in enumerate(before):
            knowledge.give_back(one, [*taken[:k], *taken[k + 1 :]])
            taken[k] = _took(knowledge, criterion)
        if taken == before:
            break
    # in the order of what they gain; exchanges have mixed it
    index = np.array(taken)
    knowledge = _Knowledge(candidates.only(index), small)
    order, squares = [], [knowledge.square]
    for _ in taken:
        order.append(_took(knowledge, criterion))
        squares.append(knowledge.square)
    size = judged.shape[2]
    worst = float(lengths_of(judged, knowledge.covariance[:size, :size]).max())
    return Choice(index[order], np.sqrt(scale * np.array(squares)), worst)


def _took(knowledge: _Knowledge, criterion: Criterion) -> int:
    one = knowledge.best(criterion)
    knowledge.take(one)
    return one


def standardised(block: Block) -> tuple[Array, Array]:
    """(rows, local) of all readings of a block over their noise."""
    chunks = list(block.chunks())
    rows = np.concatenate([chunk.standardised(chunk.rows) for chunk in chunks])
    return rows, np.concatenate([chunk.standardised(chunk.local) for chunk in chunks])


def alone(rows: Array, local: Array, precision: Array) -> Array:
    """(n + l, size) standardised readings that say as much as `rows` (n, size) say beside their own unknowns
    `local` (n, l) of a prior precision."""
    stacked = np.concatenate([local, np.diag(np.sqrt(precision))])
    basis, _ = np.linalg.qr(stacked)
    padded = np.concatenate([rows, np.zeros((len(precision), rows.shape[1]))])
    return np.asarray(padded - basis @ (basis.T @ padded))
