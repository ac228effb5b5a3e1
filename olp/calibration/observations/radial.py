"""Diagonals and circles as rows of the adjustment: displacements along one known direction at every reading.

A laser along a diagonal has an unknown zero, drift and scale, and the lost motion of the diagonal as a whole.
A ball-bar has an unknown centre and radius, servo mismatch and lost motion of both axes: in one direction
servo mismatch and squareness are one column, so squareness stays unseen then.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from olp.calibration.estimator.normal import Block, Chunk
from olp.calibration.estimator.parameters import Unknowns
from olp.calibration.iso230 import ballbar
from olp.calibration.iso230.ballbar import PLANES, SKIP_DEG, Circles
from olp.calibration.iso230.diagonals import Diagonal
from olp.calibration.observations.lines import Noise, drift_ramps, noise_of
from olp.calibration.observations.readings import Line
from olp.core.arrays import Array
from olp.core.errors import ConfigError

CHUNK = 2000
#: Columns of nuisances whose part of its own is below this share of the largest are combinations of others.
_RANK = 1e-7
#: All of UNKNOWNS of a circle but scale and square, which the machine's errors explain.
_NUISANCE = [k for k, name in enumerate(ballbar.UNKNOWNS) if name not in ("scale", "square")]


def diagonal_places(diagonal: Diagonal) -> Array:
    """(n, 3) commanded axis positions."""
    return np.asarray(np.array(diagonal.start_mm) + diagonal.distance_mm[:, None] * diagonal.unit)


def circle_places(circles: Circles) -> Array:
    """(n, 3) commanded axis positions."""
    return np.asarray(np.array(circles.centre_mm) + circles.radius_mm * _outward(circles))


def _outward(circles: Circles) -> Array:
    first, second, _ = PLANES[circles.plane]
    out = np.zeros((len(circles.angle_rad), 3))
    out[:, first], out[:, second] = np.cos(circles.angle_rad), np.sin(circles.angle_rad)
    return out


def noise_of_diagonal(diagonal: Diagonal) -> Noise:
    """From repeated runs and what is stated, as of a line. Raises ConfigError where neither tells."""
    if diagonal.sigma <= 0.0 and len(np.unique(diagonal.run)) < 2:
        raise ConfigError(
            f"diagonal {diagonal.name} has no repeated readings and states no sigma; expected at least two "
            "runs or sigma_um",
            file=diagonal.source,
        )
    as_line = Line(
        "EXX", diagonal.distance_mm, diagonal.value, diagonal.run, diagonal.direction, diagonal.start_mm,
        sigma=diagonal.sigma, source=diagonal.source,
    )  # fmt: skip
    return noise_of(as_line)


def diagonal_block(diagonal: Diagonal, parameters: Unknowns, noise: Noise) -> Block:
    """The readings along one diagonal, one row each. Raises ConfigError."""
    n = len(diagonal.value)
    free = [np.ones(n), diagonal.direction.astype(float)]
    believed: list[tuple[Array, float]] = []
    if diagonal.sigma_scale > 0.0:
        believed.append((diagonal.distance_mm, diagonal.sigma_scale))
    if noise.drift > 0.0:
        as_line = Line(
            "EXX", diagonal.distance_mm, diagonal.value, diagonal.run, diagonal.direction, diagonal.start_mm,
            sigma=noise.sigma,
        )  # fmt: skip
        believed += [(ramp, noise.drift) for ramp in drift_ramps(as_line).T]
    along = np.tile(diagonal.unit, (n, 1))
    return _block(
        diagonal_places(diagonal), along, diagonal.tool_mm, diagonal.value, noise.sigma,
        np.stack(free, axis=1), believed, parameters, diagonal.source or f"diagonal {diagonal.name}",
    )  # fmt: skip


def circle_used(circles: Circles) -> np.ndarray:
    """(n,) readings away from where an axis turns round: there friction makes spikes."""
    quarter = np.abs((circles.angle_rad + np.pi / 4) % (np.pi / 2) - np.pi / 4)
    return np.asarray(quarter > np.radians(SKIP_DEG))


def circle_block(circles: Circles, parameters: Unknowns) -> Block:
    """The readings of all circles about one centre, one row each. Raises ConfigError."""
    if circles.sigma <= 0.0:
        raise ConfigError(
            f"circle {circles.plane} states no uncertainty; expected sigma_um", file=circles.source
        )
    used = circle_used(circles)
    if used.sum() < 2 * len(ballbar.UNKNOWNS):
        raise ConfigError(
            f"circle {circles.plane}: {int(used.sum())} readings away from the reversals; expected at least "
            f"{2 * len(ballbar.UNKNOWNS)}",
            file=circles.source,
        )
    free = ballbar.columns(circles)[:, _NUISANCE]
    return _block(
        circle_places(circles)[used], _outward(circles)[used], circles.tool_mm, circles.value[used],
        circles.sigma, free[used], [], parameters, circles.source or f"circle {circles.plane}",
    )  # fmt: skip


def radial_block(taken: Diagonal | Circles, parameters: Unknowns, noise: Noise) -> Block:
    """The readings of a diagonal or of circles. Raises ConfigError."""
    if isinstance(taken, Diagonal):
        return diagonal_block(taken, parameters, noise)
    return circle_block(taken, parameters)


def _block(
    position: Array, along: Array, tool_mm: tuple[float, float, float], value: Array, sigma: float,
    free: Array, believed: list[tuple[Array, float]], parameters: Unknowns, label: str,
) -> Block:  # fmt: skip
    """Rows `along` . error = value, with free nuisances and such of a believed standard deviation."""
    # a part of a circle, or one direction, cannot tell all nuisances apart: what they span is what counts
    basis, size, _ = np.linalg.svd(free, full_matrices=False)
    local = [basis[:, size > _RANK * size[0]] * np.sqrt(len(value))]
    local += [column[:, None] for column, _ in believed]
    table = np.concatenate(local, axis=1)
    precision = np.concatenate([np.zeros(local[0].shape[1]), [1.0 / s**2 for _, s in believed]])

    def chunks() -> Iterator[Chunk]:
        for start in range(0, len(value), CHUNK):
            part = slice(start, start + CHUNK)
            design = parameters.design(position[part], np.array(tool_mm))
            rows = np.einsum("ni,nik->nk", along[part], design)
            yield Chunk(rows, value[part], np.full(len(rows), sigma), table[part])

    return Block(np.arange(parameters.size), precision, chunks, label)
