"""Least time along one window of a smooth path: an interior-point method on the square of the speed.

The unknown is b = (dl/dt)^2 over the arc length l, a quadratic B-spline with simple knots (b and b' are
continuous). With l'' = b'/2 and l''' = b''/2 sqrt(b) the axes have

    velocity |q'| sqrt(b),   acceleration q' b'/2 + q'' b,   jerk (q' b''/2 + 3/2 q'' b' + q''' b) sqrt(b),

the first two linear in b, the third linear over 1/sqrt(b). The time, the integral of 1/sqrt(b), is convex.
Every row involves three neighbouring coefficients of the spline, so Newton's matrix is pentadiagonal.
Multipliers follow the primal-dual method (Boyd and Vandenberghe, Convex Optimization, 11.7). Of the rows of
jerk only the part that keeps the matrix positive enters it.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, solveh_banded

from olp.core.arrays import Array, Index
from olp.core.values import dataclass
from olp.trajectory.route import AxisLimits

#: three-point Gauss rule on [0, 1] for the time of a cell
_GAUSS = 0.5 + 0.5 * np.array([-np.sqrt(0.6), 0.0, np.sqrt(0.6)])
#: its weights
_WEIGHT = np.array([5.0, 8.0, 5.0]) / 18.0
#: 1, t, t^2 at its points
_POWERS = np.stack((np.ones(3), _GAUSS, _GAUSS**2))
#: coefficients of 1, t, t^2 from the Bernstein ones of a cell
_MONOMIAL = np.array([[1.0, 0.0, 0.0], [-2.0, 2.0, 0.0], [1.0, -2.0, 1.0]])
#: share of the distance to the boundary that one step may take
_NEAR = 0.98
#: share of its slack that a step leaves to every row
_LEAVE = 0.03
#: factor by which a step that leaves less is shortened
_BACK = 0.7
#: times that a step is shortened at most
_TRIES = 30
#: first barrier, over the mean time per row
_FIRST = 0.1
#: least barrier, over the mean time per row
_LEAST = 1e-9
#: (length, factor): the factor by which the barrier falls after a step longer than that
_FALL = ((0.8, 0.1), (0.5, 0.35), (0.2, 0.7), (-1.0, 1.0))
#: change of the time, relative, below which it counts as still
_DONE = 1e-4
#: gap that the barrier leaves, relative to the time, below which the search may end
_GAP = 3e-2
#: Newton steps at most
_STEPS = 80
#: additions to the unit diagonal that are tried where the matrix cannot be factored
_RIDGES = (1e-13, 1e-9, 1e-6, 1e-3)


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """What bounds b at p points of m cells, in order.

    `cell` (p,), `t` (p,) the position in it from 0 to 1, `most` (p,) the square of the allowed speed.
    `acceleration` and `jerk` (3, d, p): the row of each of d axes over the coefficients of 1, t, t^2 of its
    cell, over the limit."""

    knot: Array
    cell: Index
    first: Index
    t: Array
    most: Array
    acceleration: Array
    jerk: Array

    @staticmethod
    def of(
        knot: Array, cell: Index, place: Array, derivatives: tuple[Array, Array, Array], cap: Array,
        limits: AxisLimits, share: Array,
    ) -> Rows:  # fmt: skip
        """Rows at arc lengths `place` (p,) in cells `cell` (p,) between the `knot`s (m + 1,).

        The path has the `derivatives` q', q'', q''' (p, 3) there, the speed is at most `cap` (p,), and
        `share` (p,) of the limits may be used."""
        h = np.diff(knot)[cell]
        t = (place - knot[cell]) / h
        moves = np.flatnonzero(np.any([np.any(q, axis=0) for q in derivatives], axis=0))
        q1, q2, q3 = (q[:, moves].T for q in derivatives)
        of_a, of_j = (1.0 / (limit[moves, None] * share) for limit in (limits.acceleration, limits.jerk))
        b, b1 = q2 * of_a, 0.5 * q1 * of_a / h
        acceleration = np.stack((b, b * t + b1, t * (b * t + 2.0 * b1)))
        b, b1, b2 = q3 * of_j, 1.5 * q2 * of_j / h, q1 * of_j / (h * h)
        jerk = np.stack((b, b * t + b1, t * (b * t + 2.0 * b1) + b2))
        first = np.searchsorted(cell, np.arange(len(knot) - 1))
        return Rows(knot, cell, first, t, (cap * share) ** 2, acceleration, jerk)

    def __len__(self) -> int:
        return len(self.t)

    def spread(self, c: Array) -> tuple[Array, Array, Array]:
        """b (p,), and the rows of acceleration and jerk (d, p) times c (3, m), the coefficients of cells."""
        c0, c1, c2 = (e[self.cell] for e in c)
        b = c0 + self.t * (c1 + self.t * c2)
        a, j = self.acceleration, self.jerk
        return b, a[0] * c0 + a[1] * c1 + a[2] * c2, j[0] * c0 + j[1] * c1 + j[2] * c2

    def usage(self, c: Array) -> Array:
        """(p,) the largest of the ratios: speed, and those of acceleration and jerk, to their bounds."""
        b, a, j = self.spread(c)
        worst = np.maximum(np.abs(a).max(axis=0), np.abs(j).max(axis=0) * np.sqrt(np.maximum(b, 0.0)))
        return np.asarray(np.maximum(np.sqrt(np.maximum(b, 0.0) / self.most), worst))


class Spline:
    """A quadratic B-spline over m cells with m + 2 coefficients, and its polynomials per cell."""

    def __init__(self, knot: Array) -> None:
        self.h = np.diff(knot)
        m = len(self.h)
        before, behind = np.concatenate((self.h[:1], self.h)), np.concatenate((self.h, self.h[-1:]))
        share = behind / (before + behind)
        bernstein = np.zeros((3, 3, m))
        bernstein[0, 0], bernstein[0, 1] = share[:-1], 1.0 - share[:-1]
        bernstein[1, 1] = 1.0
        bernstein[2, 1], bernstein[2, 2] = share[1:], 1.0 - share[1:]
        self.map = np.einsum("ij,jkm->ikm", _MONOMIAL, bernstein)

    def cells(self, beta: Array) -> Array:
        """(3, m) coefficients of 1, t, t^2 in each cell."""
        m = len(self.h)
        return np.asarray(sum(self.map[:, k] * beta[k : m + k] for k in range(3)))

    def fitted(self, b: Array, slope: Array) -> Array:
        """(m + 2,) coefficients that approximate values b and slopes db/dl (m + 1,) at the knots; both ends
        are exact."""
        h = self.h
        beta = np.empty(len(h) + 2)
        beta[1:-1] = 0.5 * (b[:-1] + b[1:] + 0.5 * h * (slope[:-1] - slope[1:]))
        beta[1] = b[0] + 0.5 * slope[0] * h[0]
        beta[-2] = b[-1] - 0.5 * slope[-1] * h[-1]
        beta[0] = 2.0 * b[0] - beta[1]
        beta[-1] = 2.0 * b[-1] - beta[-2]
        return beta

    def seconds(self, c: Array) -> Array:
        """(m,) time of each cell; inf where b is not above 0."""
        b = np.einsum("ig,im->gm", _POWERS, c)
        if not (b > 0.0).all():
            return np.full(len(self.h), np.inf)
        return np.asarray(self.h * (_WEIGHT @ (1.0 / np.sqrt(b))))

    def objective(self, c: Array) -> tuple[Array, Array]:
        """Gradient (3, m) and Hessian (3, 3, m) of the time in the coefficients of the cells."""
        root = 1.0 / np.sqrt(np.einsum("ig,im->gm", _POWERS, c))
        cube = root**3
        gradient = -0.5 * self.h * np.einsum("g,ig,gm->im", _WEIGHT, _POWERS, cube)
        hessian = 0.75 * self.h * np.einsum("g,ig,jg,gm->ijm", _WEIGHT, _POWERS, _POWERS, cube * root * root)
        return gradient, hessian


class _State:
    """Values of all rows at some coefficients: b, its root, accelerations `a`, jerks over sqrt(b) `j`, jerks
    `u`, and the slack `v` of the speed."""

    __slots__ = ("a", "b", "j", "root", "u", "v")

    def __init__(self, rows: Rows, b: Array, a: Array, j: Array) -> None:
        self.b, self.a, self.j = b, a, j
        self.root = np.sqrt(np.maximum(b, 0.0))
        self.u = j * self.root
        self.v = 1.0 - b / rows.most

    def inside(self) -> bool:
        return bool(
            (self.b > 0.0).all()
            and (self.v > 0.0).all()
            and (np.abs(self.a) < 1.0).all()
            and (np.abs(self.u) < 1.0).all()
        )

    def toward(self, rows: Rows, change: tuple[Array, Array, Array], most: float) -> tuple[_State, float]:
        """The state after a step of at most `most` times `change` that leaves every row part of its slack,
        and the length of the step, 0 if there is none."""
        db, da, dj = change
        fall = max(
            float((-db / self.b).max()),
            float((db / rows.most / self.v).max()),
            float((np.abs(da) / (1.0 - np.copysign(1.0, da) * self.a)).max(initial=0.0)),
        )
        length = min(most, (1.0 - _LEAVE) / fall) if fall > 0.0 else most
        above, below = _LEAVE * (1.0 - self.u), _LEAVE * (1.0 + self.u)
        for _ in range(_TRIES):
            u = (self.j + length * dj) * np.sqrt(self.b + length * db)
            if (1.0 - u >= above).all() and (1.0 + u >= below).all():
                there = (self.b + length * db, self.a + length * da, self.j + length * dj)
                return _State(rows, *there), length
            length *= _BACK
        return self, 0.0


def fits(rows: Rows, spline: Spline, beta: Array) -> bool:
    """Whether the coefficients are strictly within every bound."""
    return bool((beta[2:-2] > 0.0).all() and _State(rows, *rows.spread(spline.cells(beta))).inside())


def least_time(rows: Rows, spline: Spline, beta: Array) -> Array:
    """The coefficients of least time, from ones strictly within every bound; the first two and the last two
    are kept.

    Raises LinAlgError where Newton's matrix cannot be factored.
    """
    beta = beta.copy()
    here = _State(rows, *rows.spread(spline.cells(beta)))
    whole = float(spline.seconds(spline.cells(beta)).sum())
    count = len(rows) * (1 + 4 * rows.jerk.shape[1]) + len(beta) - 4
    mu = _FIRST * whole / count
    dual = _Dual(here, beta, mu)
    calm = 0
    for _ in range(_STEPS):
        gradient, band = _newton(rows, spline, here, dual, beta, mu)
        step = np.zeros_like(beta)
        step[2:-2] = _solved(band, gradient)
        change = rows.spread(spline.cells(step))
        fall = float((-step[2:-2] / beta[2:-2]).max())
        there, length = here.toward(rows, change, min(1.0, _NEAR / fall) if fall > 0.0 else 1.0)
        if not length:
            break
        dual_length = dual.advance(rows, here, change, beta, step, mu)
        beta += length * step
        here = there
        before, whole = whole, float(spline.seconds(spline.cells(beta)).sum())
        still = abs(whole - before) < _DONE * whole and mu * count < _GAP * whole and length > 0.5
        calm = calm + 1 if still else 0
        if calm >= 2:
            break
        mu *= next(fall for least, fall in _FALL if min(length, dual_length) > least)
        mu = max(mu, _LEAST * whole / count)
    return beta


class _Dual:
    """Multipliers of the rows: speed (p,), acceleration and jerk from above and below (d, p), beta > 0."""

    __slots__ = ("a", "beta", "u", "v")

    def __init__(self, here: _State, beta: Array, mu: float) -> None:
        self.v = mu / here.v
        self.a = [mu / (1.0 - here.a), mu / (1.0 + here.a)]
        self.u = [mu / (1.0 - here.u), mu / (1.0 + here.u)]
        self.beta = mu / beta[2:-2]

    def advance(
        self, rows: Rows, here: _State, change: tuple[Array, Array, Array], beta: Array, step: Array,
        mu: float,
    ) -> float:  # fmt: skip
        """Step along Newton's direction for the rows' `change` while all multipliers remain positive."""
        db, da, dj = change
        of_root = -0.5 * db / here.b
        du = here.root * dj
        moves: list[tuple[Array, Array]] = []

        def take(value: Array, slack: Array, gain: Array) -> None:
            """`gain` is how much the slack grows."""
            moves.append((value, (mu - value * gain) / slack - value))

        take(self.v, here.v, -db / rows.most)
        take(self.a[0], 1.0 - here.a, -da)
        take(self.a[1], 1.0 + here.a, da)
        take(self.u[0], 1.0 - here.u, of_root - du)
        take(self.u[1], 1.0 + here.u, of_root + du)
        take(self.beta, beta[2:-2], step[2:-2])
        fall = max(float((-move / value).max()) for value, move in moves)
        length = min(1.0, _NEAR / fall) if fall > 0.0 else 1.0
        for value, move in moves:
            value += length * move
        return length


#: entries of a symmetric 3 x 3 matrix
_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def _newton(
    rows: Rows, spline: Spline, here: _State, dual: _Dual, beta: Array, mu: float
) -> tuple[Array, Array]:
    """Gradient (n - 4,) and upper bands (3, n - 4) of Newton's system in the free coefficients."""
    p = len(rows)
    powers = (np.ones(p), rows.t, rows.t * rows.t)
    gradient, hessian = np.zeros((3, p)), np.zeros((6, p))
    ab, au = (1.0 - here.a, 1.0 + here.a), (1.0 - here.u, 1.0 + here.u)
    pull = mu * (1.0 / ab[0] - 1.0 / ab[1])
    weight = dual.a[0] / ab[0] + dual.a[1] / ab[1]
    for i in range(3):
        gradient[i] = (pull * rows.acceleration[i]).sum(axis=0)
    for k, (i, j) in enumerate(_PAIRS):
        hessian[k] = (weight * rows.acceleration[i] * rows.acceleration[j]).sum(axis=0)
    # rows of jerk, 1/sqrt(b) -+ L over 1/sqrt(b): gradient of_root w -+ root J with w = 1, t, t^2
    of_root = -0.5 / here.b
    high, low = dual.u[0] / au[0], dual.u[1] / au[1]
    weight = (high + low) * here.b
    pull = mu * (1.0 / au[0] - 1.0 / au[1]) * here.root
    cross = (low - high) * (of_root * here.root)
    mixed = [(cross * row).sum(axis=0) for row in rows.jerk]
    for i in range(3):
        gradient[i] += (pull * rows.jerk[i]).sum(axis=0)
    for k, (i, j) in enumerate(_PAIRS):
        hessian[k] += (weight * rows.jerk[i] * rows.jerk[j]).sum(axis=0)
        hessian[k] += powers[i] * mixed[j] + powers[j] * mixed[i]
    along = mu / (here.v * rows.most) - mu * of_root * (1.0 / au[0] + 1.0 / au[1]).sum(axis=0)
    square = dual.v / (here.v * rows.most**2) + of_root**2 * (high + low).sum(axis=0)
    for i in range(3):
        gradient[i] += along * powers[i]
    for k, (i, j) in enumerate(_PAIRS):
        hessian[k] += square * powers[i] * powers[j]
    return _banded(rows, spline, gradient, hessian, dual, beta, mu)


def _banded(
    rows: Rows, spline: Spline, gradient: Array, hessian: Array, dual: _Dual, beta: Array, mu: float
) -> tuple[Array, Array]:
    """Sums of the rows by cell, then by coefficient, with the objective and the rows beta > 0."""
    m = len(spline.h)
    of_cell = np.add.reduceat(gradient, rows.first, axis=1)
    by_cell = np.add.reduceat(hessian, rows.first, axis=1)
    time_gradient, time_hessian = spline.objective(spline.cells(beta))
    of_cell += time_gradient
    full = time_hessian
    for k, (i, j) in enumerate(_PAIRS):
        full[i, j] += by_cell[k]
        if i != j:
            full[j, i] += by_cell[k]
    g3 = np.einsum("ikm,im->km", spline.map, of_cell)
    h3 = np.einsum("ikm,ijm,jlm->klm", spline.map, full, spline.map, optimize=True)
    g, band = np.zeros(m + 2), np.zeros((3, m + 2))
    for k in range(3):
        g[k : k + m] += g3[k]
        for j in range(k, 3):
            band[2 - (j - k), j : j + m] += h3[k, j]
    g[2:-2] -= mu / beta[2:-2]
    band[2, 2:-2] += dual.beta / beta[2:-2]
    return g[2:-2], band[:, 2:-2]


def _solved(band: Array, gradient: Array) -> Array:
    """Newton's step, from the matrix scaled to a unit diagonal."""
    if not (band[2] > 0.0).all():
        raise LinAlgError("the matrix of a window is not positive")
    scale = 1.0 / np.sqrt(band[2])
    matrix = band.copy()
    matrix[2] = 1.0
    matrix[1, 1:] *= scale[1:] * scale[:-1]
    matrix[0, 2:] *= scale[2:] * scale[:-2]
    matrix[1, 0] = 0.0
    matrix[0, :2] = 0.0
    for ridge in _RIDGES:
        matrix[2] = 1.0 + ridge
        try:
            step: Array = -scale * solveh_banded(matrix, scale * gradient, check_finite=False)
        except LinAlgError:
            continue
        return step
    raise LinAlgError("the matrix of a window is not positive")
