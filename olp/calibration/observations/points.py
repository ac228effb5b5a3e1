"""Points in space as rows of the adjustment: positions of the reflector in an unknown instrument frame.

The best-fit rigid transform brings them near the machine's frame. Six small motions of the frame, and the
instrument's scale, remain as unknowns of these points alone. Points in the machine's own frame have no such
unknowns: a shift or turn that they show is an error of the machine. Balls of an artefact that the machine
probed are such points too: commanded is where the machine touched them, measured is the certificate.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from typing import Any, ClassVar

import numpy as np

from olp.calibration.estimator.normal import Block, Chunk
from olp.calibration.estimator.parameters import LEVER_ARM_MM, Unknowns, frame_columns
from olp.calibration.observations.base import (
    OWN_SCALE,
    Advance,
    Alternative,
    Noise,
    Outlier,
    Scattered,
    ScatteredState,
    rms,
    slips_of,
    without,
)
from olp.core.arrays import Array, Index
from olp.core.errors import ConfigError
from olp.core.rigid_fit import Rigid, fit_frame
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass

#: Points in the frame of the machine are nearer than this to where they were commanded.
FRAME_MM = 10.0
#: Points whose rows are built at once: 30 MB with 600 parameters.
CHUNK = 2000
#: No coordinate is known better than this: 1 nm.
LEAST_MM = 1e-6
#: A mistake is evident where points without it are off by less than this share.
_EVIDENT = 0.02
#: Units that columns in mm may be in by mistake, and their size in mm.
_UNITS = {"inches": 25.4, "m": 1e3, "um": 1e-3}
#: The cosine of an elevation counts as no less than this, near the vertical of the instrument.
STEEP = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Points(Scattered):
    """Positions of the reflector from one set-up of a tracker, or of any instrument of coordinates.

    `axis_mm` (n, 3) are the commanded axis positions, `tool_mm` (n, 3) or (3,) the vectors from the gauge
    point to the reflector, `measured_mm` (n, 3) its positions in one unknown instrument frame. With
    `known_frame` they are in the frame of the machine, that of the axis positions and tool vectors; such as
    TCP points against a simulation model. `sigma` is the standard uncertainty of a coordinate in mm. With
    `covariance_mm2` (n, 3, 3), of the coordinates of each point, it is their root mean square. `sigma_scale`
    is the standard uncertainty of the instrument's scale (mm/mm). Raises ConfigError.
    """

    read_columns: ClassVar[tuple[str, ...]] = ("axis_mm", "measured_mm")

    axis_mm: Array
    tool_mm: Array
    measured_mm: Array
    sigma: float
    sigma_scale: float = 0.0
    source: str = ""
    row: Index = field(default_factory=lambda: np.zeros(0, np.int64))
    known_frame: bool = False
    covariance_mm2: Array | None = None

    def __post_init__(self) -> None:
        axis = np.atleast_2d(np.array(self.axis_mm, float))
        columns = {
            "axis_mm": axis,
            "tool_mm": np.array(np.broadcast_to(self.tool_mm, axis.shape), float),
            "measured_mm": np.atleast_2d(np.array(self.measured_mm, float)),
            "row": np.array(self.row, np.int64) if len(self.row) else np.arange(1, len(axis) + 1),
        }
        if columns["measured_mm"].shape != axis.shape or axis.shape[1:] != (3,) or len(axis) < 4:
            raise ConfigError(
                f"{len(axis)} points; expected at least 4, each with three axis positions and three "
                "coordinates",
                file=self.source or None,
            )
        if not all(np.isfinite(column).all() for column in columns.values()):
            raise ConfigError("a point is not finite; leave the row out", file=self.source or None)
        if not self.sigma > 0.0:
            raise ConfigError(
                "the uncertainty of the points is not stated; expected sigma_um", file=self.source or None
            )
        if self.covariance_mm2 is not None:
            columns["covariance_mm2"] = np.array(self.covariance_mm2, float)
            if columns["covariance_mm2"].shape != (len(axis), 3, 3):
                raise ConfigError("expected a 3 by 3 covariance of each point", file=self.source or None)
        if self.known_frame:
            off = np.linalg.norm(columns["measured_mm"] - axis - columns["tool_mm"], axis=1)
            if off.max() > FRAME_MM:
                raise ConfigError(
                    f"row {columns['row'][int(off.argmax())]}: the point is {off.max():.4g} mm from its "
                    f"commanded position; expected at most {FRAME_MM:g} mm in the machine's frame; check the "
                    'coordinates, or remove frame = "known"',
                    file=self.source or None,
                )
        for name, column in columns.items():
            column.flags.writeable = False
            object.__setattr__(self, name, column)

    @property
    def framed(self) -> bool:
        return self.known_frame

    def alternatives(self) -> Sequence[Alternative]:
        """A left-handed frame, a scale of its own, and swapped columns."""
        scaled = replace(self, sigma_scale=math.hypot(self.sigma_scale, OWN_SCALE))
        found = [
            Alternative(
                "scale", "it has a scale of its own (temperature, wavelength)", scaled, where_off=True
            )
        ]
        if not self.known_frame:
            mirror = np.array((1.0, 1.0, -1.0))
            turned = None if self.covariance_mm2 is None else self.covariance_mm2 * np.outer(mirror, mirror)
            other = replace(self, measured_mm=self.measured_mm * mirror, covariance_mm2=turned)
            words = "its coordinates are left-handed: one of them has the other sign"
            found += [Alternative("handedness", words, other), *self.swapped()]
        return found

    def evident_mistake(self) -> str:
        own = rms(deviations(self))
        named = [(one.words, one.observation) for one in self.alternatives()]
        for unit, size in _UNITS.items():
            wrong = f"its axis positions are in {unit}, or its measured ones are not"
            named.append((f"its measured positions are in {unit}", self._times(size)))
            named.append((wrong, self._times(1.0 / size)))
        for words, other in named:
            assert isinstance(other, Points)
            if rms(deviations(other)) < _EVIDENT * own:
                return words
        return ""

    def _times(self, factor: float) -> Points:
        return replace(self, measured_mm=self.measured_mm * factor)

    def start(self, noise: Noise | None = None) -> PointsState:
        return PointsState(self)


@dataclass(frozen=True, slots=True, eq=False)
class PointsState(ScatteredState):
    """Points in an adjustment: no unknowns but those that the rows eliminate. Three rows per point."""

    noun = "points"
    tally = "points"
    observation: Points

    @property
    def section(self) -> str:
        return "sets_of_points"

    def block(self, parameters: Unknowns, theta: Array) -> Block:
        return points_block(self.observation, parameters)

    def slips(self, block: Block, theta: Array, settled: bool) -> Sequence[Outlier]:
        return slips_of(block, theta, self.observation.source, self.observation.row, "point")

    def moved(self, step: Advance, slips: Sequence[Outlier]) -> PointsState:
        return PointsState(without(self.observation, self.observation.row, slips))

    def spread_over_rows(self, numbers: Index) -> Index:
        return np.repeat(numbers, 3)

    def row(self, residual: Array, chi_square: float) -> dict[str, Any]:
        return {
            "name": self.label,
            "points": self.count,
            "sigma_coordinate_um": self.observation.sigma * UM_PER_MM,
            "residual_um": rms(residual) * UM_PER_MM,
            "chi_square_per_coordinate": chi_square / (3 * self.count),
        }


def points_block(points: Points, parameters: Unknowns) -> Block:
    """The readings of one set-up: three rows per point, along the axes or, where the points have covariances,
    along the principal axes of each. Raises CannotCompute where they determine no frame."""
    nominal = points.axis_mm + points.tool_mm
    frame = _frame(points)
    deviation = frame(points.measured_mm) - nominal
    local = frame_columns(nominal - nominal.mean(axis=0), scale=points.sigma_scale > 0.0)
    local = local[:, :, 6:] if points.known_frame else local
    precision = np.zeros(local.shape[2])
    if points.sigma_scale > 0.0:
        precision[-1] = 1.0 / (points.sigma_scale * LEVER_ARM_MM) ** 2
    size = parameters.size
    sigma = np.full(nominal.shape, points.sigma)
    turn: Array | None = None
    if points.covariance_mm2 is not None:
        variance, across = np.linalg.eigh(points.covariance_mm2)
        sigma = np.sqrt(np.maximum(variance, LEAST_MM**2))
        turn = across.transpose(0, 2, 1) @ frame.rotation.T
        local = turn @ local
        deviation = np.einsum("nij,nj->ni", turn, deviation)

    def chunks() -> Iterator[Chunk]:
        for start in range(0, len(nominal), CHUNK):
            part = slice(start, start + CHUNK)
            rows = parameters.design(points.axis_mm[part], points.tool_mm[part])
            rows = rows if turn is None else turn[part] @ rows
            yield Chunk(
                rows.reshape(-1, size),
                deviation[part].reshape(-1),
                sigma[part].reshape(-1),
                local[part].reshape(sigma[part].size, local.shape[2]),
            )

    return Block(np.arange(size), precision, chunks, points.source or "points")


def deviations(points: Points) -> Array:
    """(n, 3) measured less commanded positions of the reflector in mm, in the frame that fits best, or in
    that of the machine where it is known. Raises CannotCompute where the points determine no frame."""
    return np.asarray(_frame(points)(points.measured_mm) - points.axis_mm - points.tool_mm)


def _frame(points: Points) -> Rigid:
    if points.known_frame:
        return Rigid.identity()
    return fit_frame(points.measured_mm, points.axis_mm + points.tool_mm)


def polar_points(
    axis_mm: Array, tool_mm: Array, distance_mm: Array, azimuth_rad: Array, elevation_rad: Array,
    *, sigma_mm: Array, sigma_rad: float, sigma_scale: float = 0.0, source: str = "",
    row: Index | None = None,
) -> Points:  # fmt: skip
    """Distances and two angles from one station of unknown pose, as points in its instrument frame:
    `sigma_mm` (n,) or one number of a distance, `sigma_rad` of an angle. Raises ConfigError."""
    distance = np.asarray(distance_mm, float)
    flat, up = np.cos(elevation_rad), np.sin(elevation_rad)
    c, s = np.cos(azimuth_rad), np.sin(azimuth_rad)
    ray = np.stack([flat * c, flat * s, up], axis=1)
    aside = np.stack([-s, c, np.zeros(len(s))], axis=1)
    above = np.stack([-up * c, -up * s, flat], axis=1)
    across = sigma_rad * distance
    # near the vertical of the instrument its axes, not their encoders, limit what is across
    sigmas = np.stack(
        [np.broadcast_to(sigma_mm, distance.shape), across * np.maximum(flat, STEEP), across], axis=1
    )
    axes = np.stack([ray, aside, above], axis=2)
    covariance = (axes * sigmas[:, None, :] ** 2) @ axes.transpose(0, 2, 1)
    return Points(
        axis_mm, tool_mm, ray * distance[:, None], float(np.sqrt(np.mean(sigmas**2))), sigma_scale, source,
        np.zeros(0, np.int64) if row is None else row, covariance_mm2=covariance,
    )  # fmt: skip
