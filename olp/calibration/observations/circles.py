"""Circles of a ball-bar as rows of the adjustment.

A ball-bar has an unknown centre and radius, and servo mismatch and backlash of both axes. In one direction
servo mismatch and squareness are one column, so squareness is then not observable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from olp.calibration.estimator.normal import Block
from olp.calibration.estimator.parameters import Unknowns
from olp.calibration.observations.base import Alternative, Noise, Observation
from olp.calibration.observations.lines import REVERSED, UNITS
from olp.calibration.observations.radial import AlongState, along_block
from olp.core.arrays import Array, Index
from olp.core.errors import ConfigError
from olp.core.machine import ZERO, Vector
from olp.core.units import AXES
from olp.core.values import dataclass

#: First and second axis of each plane, counter-clockwise seen from + of the third, and its squareness.
PLANES = {"XY": (0, 1, "C0Y"), "YZ": (1, 2, "A0Z"), "ZX": (2, 0, "B0Z")}
UNKNOWNS = ("radius", "centre_1", "centre_2", "scale", "square", "servo", "backlash_1", "backlash_2")
#: Readings this near to the reversal of an axis are left out of the fit: friction makes spikes there.
SKIP_DEG = 2.5
#: A circle needs so many readings.
_FEWEST = 8

#: All of UNKNOWNS of a circle but scale and square, which the machine's errors explain.
_NUISANCE = [k for k, name in enumerate(UNKNOWNS) if name not in ("scale", "square")]


@dataclass(frozen=True, slots=True, eq=False)
class Circles(Observation):
    """Radial readings of circles about one centre, in one set-up.

    `angle_rad` (n,) from the first axis of `plane` toward the second, `value` (n,) radius less `radius_mm`
    in mm, `direction` (n,) +1 counter-clockwise or -1, `run` (n,). `centre_mm` are axis positions, `tool_mm`
    the tool vector; `feed_mm_s` along the circle, 0 where not known; `sigma` of one reading in mm. Raises
    ConfigError.
    """

    read_columns: ClassVar[tuple[str, ...]] = ("angle_rad", "value")

    plane: str
    radius_mm: float
    centre_mm: Vector
    angle_rad: Array
    value: Array
    run: Index
    direction: Index
    tool_mm: Vector = ZERO
    feed_mm_s: float = 0.0
    sigma: float = 0.0
    source: str = ""

    def __post_init__(self) -> None:
        if self.plane not in PLANES:
            raise ConfigError(f"plane {self.plane!r}; expected XY, YZ or ZX", file=self.source)
        n = len(self.angle_rad)
        if (
            not self.radius_mm > 0.0
            or n < _FEWEST
            or any(len(c) != n for c in (self.value, self.run, self.direction))
        ):
            raise ConfigError(
                f"circle of radius {self.radius_mm:g} mm with {n} readings; expected a radius above 0 and at "
                f"least {_FEWEST} readings",
                file=self.source,
            )
        if not np.isin(self.direction, (-1, 1)).all():
            raise ConfigError("a direction is neither +1 (counter-clockwise) nor -1", file=self.source)

    @property
    def names(self) -> tuple[str, str]:
        first, second, _ = PLANES[self.plane]
        return AXES[first], AXES[second]

    def reach(self, axis: int) -> Array:
        return np.asarray(circle_positions(self)[:, axis])

    def alternatives(self) -> Sequence[Alternative]:
        """Sign, unit, and angles that count clockwise."""
        found = [
            Alternative(
                kind, words, replace(self, value=factor * self.value, sigma=abs(factor) * self.sigma), factor
            )
            for kind, factor, words in (REVERSED, *UNITS[0])
        ]
        turned = replace(self, angle_rad=-self.angle_rad, direction=-self.direction)
        return [*found, Alternative("order", "its angles count clockwise", turned)]

    def start(self, noise: Noise | None = None) -> CirclesState:
        return CirclesState(self, Noise(self.sigma, 0.0, None))


@dataclass(frozen=True, slots=True, eq=False)
class CirclesState(AlongState):
    """Circles in an adjustment. One row per reading away from the reversals."""

    observation: Circles
    noise: Noise

    @property
    def name(self) -> str:
        return f"circle {self.observation.plane}"

    @property
    def count(self) -> int:
        return int(circle_used(self.observation).sum())

    def positions(self) -> Array:
        return np.asarray(circle_positions(self.observation)[circle_used(self.observation)])

    def block(self, parameters: Unknowns, theta: Array) -> Block:
        return circle_block(self.observation, parameters)


def columns(circles: Circles) -> Array:
    """(n, 8) change of a reading for 1 mm of each of UNKNOWNS."""
    t, d = circles.angle_rad, circles.direction.astype(float)
    c, s = np.cos(t), np.sin(t)
    return np.column_stack((
        np.ones(len(t)), c, s, np.cos(2 * t), np.sin(2 * t), d * np.sin(2 * t),
        0.5 * d * np.sign(s) * c, -0.5 * d * np.sign(c) * s,
    ))  # fmt: skip


def circle_positions(circles: Circles) -> Array:
    """(n, 3) commanded axis positions."""
    return np.asarray(np.array(circles.centre_mm) + circles.radius_mm * _outward(circles))


def _outward(circles: Circles) -> Array:
    first, second, _ = PLANES[circles.plane]
    outward = np.zeros((len(circles.angle_rad), 3))
    outward[:, first], outward[:, second] = np.cos(circles.angle_rad), np.sin(circles.angle_rad)
    return outward


def circle_used(circles: Circles) -> np.ndarray:
    """(n,) whether a reading is away from the reversals, where friction makes spikes."""
    quarter = np.abs((circles.angle_rad + np.pi / 4) % (np.pi / 2) - np.pi / 4)
    return np.asarray(quarter > np.radians(SKIP_DEG))


def circle_block(circles: Circles, parameters: Unknowns) -> Block:
    """The readings of all circles about one centre, one row each. Raises ConfigError."""
    if circles.sigma <= 0.0:
        raise ConfigError(
            f"circle {circles.plane}: no uncertainty is stated; add a comment such as # sigma_um = 0.2, the "
            "standard uncertainty of one reading",
            file=circles.source,
        )
    used = circle_used(circles)
    if used.sum() < 2 * len(UNKNOWNS):
        raise ConfigError(
            f"circle {circles.plane}: {int(used.sum())} readings away from the reversals; expected at least "
            f"{2 * len(UNKNOWNS)}",
            file=circles.source,
        )
    free = columns(circles)[:, _NUISANCE]
    return along_block(
        circle_positions(circles)[used], _outward(circles)[used], circles.tool_mm, circles.value[used],
        circles.sigma, free[used], [], parameters, circles.source or f"circle {circles.plane}",
    )  # fmt: skip
