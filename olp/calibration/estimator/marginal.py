"""Marginal likelihood of the processes of a field, and the hyper-parameters that make it largest."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from olp.calibration.estimator.field import LONGEST, REACH, SHORTEST, Modes
from olp.calibration.estimator.widened import Reduced
from olp.core.arrays import Array
from olp.core.values import dataclass

Noise = Literal["learnt", "stated"]

#: Smallest size of a process, mm.
SMALLEST = 2e-4
#: Largest size of a process, mm.
LARGEST = 1.0
#: Smallest factor on stated noise.
QUIET = 0.5
#: Largest factor on stated noise.
LOUD = 10.0
#: A coefficient is left out where readings would reduce its variance by less than this share.
NEGLIGIBLE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Learnt:
    """The hyper-parameters of some coordinates and their log evidence; `log` holds size and three lengths of
    each."""

    coordinates: tuple[int, ...]
    log: Array
    noise: float
    evidence: float

    def log_variance(self, modes: Modes) -> Array:
        parts = [modes.log_variance(float(h[0]), h[1:])[0] for h in self.log]
        return np.concatenate([np.zeros(0), *parts])


def log_evidence(reduced: Reduced, modes: Modes, log: Array, log_noise: float) -> tuple[float, Array, float]:
    """The log evidence of processes (k, 4) for a reduced problem of as many coordinates, up to a constant,
    and its derivatives by their hyper-parameters and by the log of the noise."""
    from scipy.linalg import cho_solve

    s2 = math.exp(2.0 * log_noise)
    values, slopes = zip(*(modes.log_variance(float(h[0]), h[1:]) for h in log), strict=True)
    log_d = np.concatenate(values)
    # coefficients too small for any reading change nothing
    use = np.exp(log_d) * np.diag(reduced.G) / s2 > NEGLIGIBLE
    root, G, v = np.exp(0.5 * log_d[use]), reduced.G[np.ix_(use, use)] / s2, reduced.v[use] / s2
    # I + D^1/2 G D^1/2: well conditioned however small a variance is
    inner = root[:, None] * G * root + np.eye(len(root))
    factor = np.linalg.cholesky(inner)
    inverse = cho_solve((factor, True), np.eye(len(root)), check_finite=False)
    pull = root * v
    e = inverse @ pull
    value = (
        -0.5 * reduced.square / s2
        - reduced.freedom * log_noise
        + 0.5 * float(pull @ e)
        - float(np.log(np.diag(factor)).sum())
    )
    by_log_d = np.zeros(len(log_d))
    by_log_d[use] = 0.5 * (e**2 - 1.0 + np.diag(inverse))
    m = modes.size
    gradient = np.zeros(log.shape)
    for k, slope in enumerate(slopes):
        own = by_log_d[k * m : (k + 1) * m]
        gradient[k, 0] = 2.0 * own.sum()
        gradient[k, 1:] = own @ slope
    shrink = float(pull @ e) * -2.0 + float(e @ (inner @ e) - e @ e)
    by_noise = reduced.square / s2 - reduced.freedom + shrink + len(root) - float(np.trace(inverse))
    return value, gradient, by_noise


def part_of(reduced: Reduced, m: int, coordinates: Sequence[int]) -> Reduced:
    """Only these coordinates of the field, of m coefficients each; the others are zero."""
    use = np.concatenate([np.arange(i * m, (i + 1) * m) for i in coordinates])
    return dataclasses.replace(reduced, G=reduced.G[np.ix_(use, use)], v=reduced.v[use])


def alone_of(reduced: Reduced, noise: Noise) -> Learnt:
    """No field at all."""
    s = 1.0
    if noise == "learnt":
        s = float(np.clip(math.sqrt(reduced.square / reduced.freedom), QUIET, LOUD))
    value = -0.5 * reduced.square / s**2 - reduced.freedom * math.log(s)
    return Learnt((), np.zeros((0, 4)), s, value)


def learn(
    reduced: Reduced, modes: Modes, coordinates: tuple[int, ...], noise: Noise, start: Learnt | None = None
) -> Learnt:
    """The largest evidence over the hyper-parameters of these coordinates."""
    from scipy.optimize import minimize

    if not coordinates:
        return alone_of(reduced, noise)
    part = part_of(reduced, modes.size, coordinates)
    span = 2.0 * modes.reach_mm / REACH
    first = np.tile(np.concatenate([[math.log(0.01)], np.log(0.5 * span)]), (len(coordinates), 1))
    first_noise = 0.0
    if start is not None:
        first = start.log[[start.coordinates.index(i) for i in coordinates]]
        first_noise = math.log(start.noise)
    fixed = noise == "stated"
    bounds: list[tuple[float | None, float | None]] = [
        *[
            (math.log(SMALLEST), math.log(LARGEST)),
            *((math.log(SHORTEST * a), math.log(LONGEST * a)) for a in span.tolist()),
        ]
        * len(coordinates),
        (0.0, 0.0) if fixed else (math.log(QUIET), math.log(LOUD)),
    ]

    def cost(x: Array) -> tuple[float, Array]:
        value, slope, by_noise = log_evidence(part, modes, x[:-1].reshape(-1, 4), float(x[-1]))
        return -value, -np.append(slope.ravel(), 0.0 if fixed else by_noise)

    x0 = np.append(first.ravel(), 0.0 if fixed else first_noise)
    optimum = minimize(
        cost, x0, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 40, "ftol": 1e-6}
    )
    return Learnt(
        coordinates, optimum.x[:-1].reshape(-1, 4), math.exp(float(optimum.x[-1])), -float(optimum.fun)
    )
