"""Steps of Newton's method at regular postures: there the axes move the tool in all ways that are asked for.

There the least change of the axes follows from the products of the rows of a Jacobian with each other. They
are factored as L D L^T in columns. Postures that are nearly singular show in the trace of the inverse.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.values import dataclass

#: The least share by which axes move the tool at a regular posture: scaled mm per scaled mm.
_MOVES = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class RegularSteps:
    """Of rows of Jacobians (m, k, n): `lower` (m, m) columns of the inverse of L, `pivots` (m, n) of D, and
    which postures are `regular` (n,)."""

    rows: Array
    lower: tuple[tuple[Array, ...], ...]
    pivots: Array
    regular: Mask

    @staticmethod
    def of(rows: Array) -> RegularSteps:
        count, least = len(rows), _MOVES**2
        pivots = np.empty((count, rows.shape[2]))
        factors: list[list[Array]] = []
        regular = np.ones(rows.shape[2], bool)
        for i in range(count):
            products: list[Array] = []
            factors.append([])
            for j in range(i + 1):
                product = np.einsum("kn,kn->n", rows[i], rows[j])
                for p in range(j):
                    product -= products[p] * factors[j][p]
                products.append(product)
                if j < i:
                    factors[i].append(product / pivots[j])
            regular &= products[i] > least
            pivots[i] = np.where(regular, products[i], 1.0)
        lower: list[tuple[Array, ...]] = []
        trace = np.zeros(rows.shape[2])
        for i in range(count):
            own = []
            for c in range(i):
                entry = -factors[i][c]
                for p in range(c + 1, i):
                    entry -= factors[i][p] * lower[p][c]
                own.append(entry)
            trace += (1.0 + sum(np.square(entry) for entry in own)) / pivots[i]
            lower.append(tuple(own))
        return RegularSteps(rows, tuple(lower), pivots, regular & (trace < 1.0 / least))

    def __call__(self, miss: Array) -> Array:
        """(k, n) the least changes of the axes by what is missing (m, n)."""
        count = len(miss)
        shares = np.empty(miss.shape)
        for i in range(count):
            np.add(miss[i], sum(self.lower[i][c] * miss[c] for c in range(i)), out=shares[i])
        shares /= self.pivots
        for c in range(count):
            for i in range(c + 1, count):
                shares[c] += self.lower[i][c] * shares[i]
        step = self.rows[0] * shares[0]
        for i in range(1, count):
            step += self.rows[i] * shares[i]
        return np.asarray(step)
