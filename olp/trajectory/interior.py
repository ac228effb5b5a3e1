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
#: products of the powers in pairs, and of the weights, at its points
_PAIRED = 0.75 * _WEIGHT * _POWERS[:, None] * _POWERS
#: coefficients of 1, t, t^2 from the Bernstein ones of a cell
_MONOMIAL = np.array([[1.0, 0.0, 0.0], [-2.0, 2.0, 0.0], [1.0, -2.0, 1.0]])
#: share of the distance to the boundary that one step may take
_NEAR = 0.98
#: share of its slack that a step leaves to every row
_LEAVE = 0.01
#: factor by which a step that leaves less is shortened
_BACK = 0.85
#: times that a step is shortened at most
_TRIES = 60
#: first barrier, over the mean time per row
_FIRST = 0.1
#: least barrier, over the mean time per row
_LEAST = 1e-9
#: (length, factor): the factor by which the barrier falls after a step longer than that
_FALL = ((0.9, 0.1), (0.7, 0.3), (0.5, 0.7), (-1.0, 1.0))
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
    `acceleration` (2, d, p) and `jerk` (3, d, p): of each of d axes what b, its slope and half its second
    derivative by t enter them with, over the limit."""

    knot: Array
    cell: Index
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
        acceleration = np.stack((q2 * of_a, 0.5 * q1 * of_a / h))
        jerk = np.stack((q3 * of_j, 1.5 * q2 * of_j / h, q1 * of_j / (h * h)))
        return Rows(knot, cell, t, (cap * share) ** 2, acceleration, jerk)

    def __len__(self) -> int:
        return len(self.t)

    def spread(self, c: Array) -> tuple[Array, Array, Array]:
        """b (p,), and the rows of acceleration and jerk (d, p) times c (3, m), the coefficients of cells."""
        c0, c1, c2 = c[:, self.cell]
        over = self.t * c2
        b, slope = c0 + self.t * (c1 + over), c1 + 2.0 * over
        a, j = self.acceleration, self.jerk
        return b, a[0] * b + a[1] * slope, j[0] * b + j[1] * slope + j[2] * c2

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
        gradient = (-0.5 * _WEIGHT * _POWERS) @ cube
        hessian = _PAIRED.reshape(9, 3) @ (cube * root * root)
        return self.h * gradient, self.h * hessian.reshape(3, 3, -1)


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


#: of b, its slope and half its second derivative: the pairs, and their entries in a symmetric 3 x 3 matrix
_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def _newton(
    rows: Rows, spline: Spline, here: _State, dual: _Dual, beta: Array, mu: float
) -> tuple[Array, Array]:
    """Gradient (n - 4,) and upper bands (3, n - 4) of Newton's system in the free coefficients."""
    gradient, hessian = np.zeros((3, len(rows))), np.zeros((6, len(rows)))
    a_above, a_below = 1.0 / (1.0 - here.a), 1.0 / (1.0 + here.a)
    u_above, u_below = 1.0 / (1.0 - here.u), 1.0 / (1.0 + here.u)
    # rows of jerk, 1/sqrt(b) -+ L over 1/sqrt(b): gradient of_root w -+ root J with w for b alone
    of_root = -0.5 / here.b
    high, low = dual.u[0] * u_above, dual.u[1] * u_below
    both = high + low
    for factor, weight, pull in (
        (rows.acceleration, dual.a[0] * a_above + dual.a[1] * a_below, a_above - a_below),
        (rows.jerk, both * here.b, (u_above - u_below) * here.root),
    ):
        weighted = weight * factor
        for i, row in enumerate(factor):
            gradient[i] += (pull * row).sum(axis=0)
        for k, (i, j) in enumerate(_PAIRS):
            if j < len(factor):
                hessian[k] += (weighted[i] * factor[j]).sum(axis=0)
    gradient[0] += 1.0 / (here.v * rows.most) - of_root * (u_above + u_below).sum(axis=0)
    cross = (low - high) * (of_root * here.root)
    for k, row in enumerate(rows.jerk):
        hessian[k] += (2.0 if k == 0 else 1.0) * (cross * row).sum(axis=0)
    hessian[0] += dual.v / (here.v * rows.most**2) + of_root**2 * both.sum(axis=0)
    return _banded(rows, spline, mu * gradient, hessian, dual, beta, mu)


def _by_powers(t: Array, gradient: Array, hessian: Array) -> tuple[Array, Array]:
    """Gradient (3, p) and matrix (6, p) in b, its slope and half its second derivative at `t` (p,), in the
    coefficients of 1, t, t^2."""
    g0, g1, g2 = gradient
    h00, h01, h02, h11, h12, h22 = hessian
    # by the columns of the matrix first, then by its rows
    k01, k11 = t * h00 + h01, t * h01 + h11
    k02, k12, k22 = (
        t * (t * h00 + 2.0 * h01) + h02,
        t * (t * h01 + 2.0 * h11) + h12,
        t * (t * h02 + 2.0 * h12) + h22,
    )
    return (
        np.stack((g0, t * g0 + g1, t * (t * g0 + 2.0 * g1) + g2)),
        np.stack((h00, k01, k02, t * k01 + k11, t * k02 + k12, t * (t * k02 + 2.0 * k12) + k22)),
    )


def _banded(
    rows: Rows, spline: Spline, gradient: Array, hessian: Array, dual: _Dual, beta: Array, mu: float
) -> tuple[Array, Array]:
    """Sums of the rows by cell, then by coefficient, with the objective and the rows beta > 0."""
    m = len(spline.h)
    by_point = np.concatenate(_by_powers(rows.t, gradient, hessian))
    by_cell = [np.bincount(rows.cell, of_point, m) for of_point in by_point]
    of_cell, full = spline.objective(spline.cells(beta))
    of_cell += by_cell[:3]
    for some, (i, j) in zip(by_cell[3:], _PAIRS, strict=True):
        full[i, j] += some
        if i != j:
            full[j, i] += some
    to = spline.map
    g3 = (to * of_cell[:, None]).sum(axis=0)
    half = (full[:, :, None] * to).sum(axis=1)
    h3 = (to[:, :, None] * half[:, None]).sum(axis=0)
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
