"""Readings of instruments as values, in the one sense of this package: actual minus commanded, of the tool
relative to the workpiece, right-handed, mm and rad, by axis position.

Readers turn units, senses and instruments' habits into these types; nothing after them knows another sense.
"""

from __future__ import annotations

import datetime
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, SQUARENESS, ZERO, Vector
from olp.core.units import AXES

if TYPE_CHECKING:
    from olp.calibration.iso230.ballbar import Circles
    from olp.calibration.iso230.diagonals import Diagonal

Reference = Literal["functional-point", "table"]
#: Points in the frame of the machine are nearer than this to where they were commanded.
FRAME_MM = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """One component error read at targets along one axis, rows in the order of time.

    `component` is an ISO 230-1 name such as EXX (positioning), EYX (straightness) or EBX (angle); the moving
    axis is its last letter. `target_mm` (n,) axis positions, `value` (n,) in mm or rad, `run` (n,) from 1,
    `direction` (n,) +1 or -1: from which side the target was approached. `line_mm` is where the other axes
    stood (the own entry is ignored) and `tool_mm` the tool vector to the reflector; with `reference` "table"
    the reflector stayed fixed on a moving table. The zero of the values is arbitrary, so is the slope of a
    straightness. Straightness lines that name the same `square` were read against its two legs.
    `sigma` is the standard uncertainty of one reading (mm or rad), `sigma_scale` that of the scale of
    all readings of a line (mm/mm, a laser's wavelength). A sigma of 0 is not known: the spread of the runs
    tells. `source` is the file and `row` (n,) the line of each reading in it. Raises ConfigError.
    """

    component: str
    target_mm: Array
    value: Array
    run: Index
    direction: Index
    line_mm: Vector
    tool_mm: Vector = ZERO
    reference: Reference = "functional-point"
    square: str | None = None
    sigma: float = 0.0
    sigma_scale: float = 0.0
    source: str = ""
    row: Index = field(default_factory=lambda: np.zeros(0, np.int64))
    instrument: str = ""

    def __post_init__(self) -> None:
        if not len(self.row):
            object.__setattr__(self, "row", np.arange(1, len(self.target_mm) + 1))
        for name, kind in (
            ("target_mm", float),
            ("value", float),
            ("run", np.int64),
            ("direction", np.int64),
            ("row", np.int64),
        ):
            column = np.array(getattr(self, name), dtype=kind)
            column.flags.writeable = False
            object.__setattr__(self, name, column)
        label = f"line {self.component}"
        n = len(self.target_mm)
        if self.component not in COMPONENTS:
            raise ConfigError(
                f"{label}: expected an ISO 230-1 name such as EXX, EYX or EBX", file=self.source
            )
        if n < 2 or any(len(c) != n for c in (self.value, self.run, self.direction, self.row)):
            raise ConfigError(
                f"{label}: {n} readings; expected at least 2, each with all columns", file=self.source
            )
        if not (np.isfinite(self.target_mm).all() and np.isfinite(self.value).all()):
            raise ConfigError(f"{label}: a reading is not finite; leave the row out", file=self.source)
        if not np.isin(self.direction, (-1, 1)).all():
            raise ConfigError(f"{label}: a direction is neither +1 nor -1", file=self.source)

    @property
    def axis(self) -> int:
        """0, 1, 2 for a line along X, Y, Z."""
        return AXES.index(self.component[2])

    @property
    def quantity(self) -> Literal["positioning", "straightness", "angle"]:
        if self.component[1] in "ABC":
            return "angle"
        return "positioning" if self.component[1] == self.component[2] else "straightness"


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Places of the reflector as one set-up of a tracker (or any instrument of coordinates) saw them.

    `axis_mm` (n, 3) are the commanded axis positions, `tool_mm` (n, 3) or (3,) the vectors from the gauge
    point to the reflector, `measured_mm` (n, 3) its places in the instrument's frame, which nobody knows, but
    which is the same for all of these points; with `known_frame` they are in the frame of the machine, that
    of the axis positions and tool vectors, as TCP points are against a simulation model. `sigma` is the
    standard uncertainty of a coordinate in mm, or `covariance_mm2` (n, 3, 3) that of the coordinates of each
    point, and `sigma` their root mean square; `sigma_scale` that of the instrument's scale (mm/mm). Raises
    ConfigError.
    """

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
                    f"a point is {off.max():.4g} mm off where it was commanded, row "
                    f"{columns['row'][int(off.argmax())]}; expected places in the machine's frame within "
                    f'{FRAME_MM:g} mm, or no frame = "known"',
                    file=self.source or None,
                )
        for name, column in columns.items():
            column.flags.writeable = False
            object.__setattr__(self, name, column)


@dataclass(frozen=True, slots=True, eq=False)
class Lengths:
    """Lengths that a tracking interferometer read from one station, whose place and dead length nobody knows.

    `axis_mm` (n, 3) are the commanded axis positions, `tool_mm` (n, 3) or (3,) the vectors from the gauge
    point to the reflector, `length_mm` (n,) the readings, `sigma_mm` (n,) or one number their standard
    uncertainty, `sigma_scale` that of their common scale (mm/mm). Raises ConfigError.
    """

    axis_mm: Array
    tool_mm: Array
    length_mm: Array
    sigma_mm: Array
    sigma_scale: float = 0.0
    source: str = ""
    row: Index = field(default_factory=lambda: np.zeros(0, np.int64))

    def __post_init__(self) -> None:
        axis = np.atleast_2d(np.array(self.axis_mm, float))
        length = np.array(self.length_mm, float)
        columns = {
            "axis_mm": axis,
            "tool_mm": np.array(np.broadcast_to(self.tool_mm, axis.shape), float),
            "length_mm": length,
            "sigma_mm": np.array(np.broadcast_to(self.sigma_mm, length.shape), float),
            "row": np.array(self.row, np.int64) if len(self.row) else np.arange(1, len(axis) + 1),
        }
        if length.shape != (len(axis),) or axis.shape[1:] != (3,) or len(axis) < 5:
            raise ConfigError(
                f"{length.size} lengths; expected at least 5 from a station, each with three axis positions",
                file=self.source or None,
            )
        if not all(np.isfinite(column).all() for column in columns.values()):
            raise ConfigError("a length is not finite; leave the row out", file=self.source or None)
        if not np.all(columns["sigma_mm"] > 0.0):
            raise ConfigError(
                "the uncertainty of the lengths is not stated; expected sigma_um", file=self.source or None
            )
        for name, column in columns.items():
            column.flags.writeable = False
            object.__setattr__(self, name, column)


@dataclass(frozen=True, slots=True, eq=False)
class Pods:
    """Directions in which pods or theodolites saw the reflector, each in its own frame that nobody knows.

    `axis_mm` (n, 3) and `tool_mm` (n, 3) or (3,) as for Points; `azimuth_rad` and `elevation_rad` (n, k) of k
    pods, `sigma` the standard uncertainty of an angle in rad. `baselines` are known distances: (pod, pod from
    0, mm, standard uncertainty in mm); without one nobody knows the scale. Raises ConfigError.
    """

    axis_mm: Array
    tool_mm: Array
    azimuth_rad: Array
    elevation_rad: Array
    sigma: float
    baselines: tuple[tuple[int, int, float, float], ...] = ()
    source: str = ""

    def __post_init__(self) -> None:
        axis = np.atleast_2d(np.array(self.axis_mm, float))
        columns = {
            "axis_mm": axis,
            "tool_mm": np.array(np.broadcast_to(self.tool_mm, axis.shape), float),
            "azimuth_rad": np.array(self.azimuth_rad, float),
            "elevation_rad": np.array(self.elevation_rad, float),
        }
        shape = columns["azimuth_rad"].shape
        if (
            len(shape) != 2
            or shape[0] != len(axis)
            or shape != columns["elevation_rad"].shape
            or len(axis) < 6
        ):
            raise ConfigError(
                f"{len(axis)} points of pods; expected at least 6, each with both angles of every pod",
                file=self.source or None,
            )
        if not all(np.isfinite(column).all() for column in columns.values()) or not self.sigma > 0.0:
            raise ConfigError(
                "an angle is not finite, or sigma is not above 0; leave such rows out",
                file=self.source or None,
            )
        for name, column in columns.items():
            column.flags.writeable = False
            object.__setattr__(self, name, column)

    @property
    def count(self) -> int:
        """How many pods."""
        return int(self.azimuth_rad.shape[1])


@dataclass(frozen=True, slots=True)
class Square:
    """An optical or mechanical square that two straightness lines share.

    `error_rad` is by how much the angle between its legs, both along + of their axes, differs from 90 degrees
    (more is +), as its certificate says; `sigma_rad` its standard uncertainty.
    """

    name: str
    error_rad: float = 0.0
    sigma_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class SquarenessReading:
    """The squareness of two axes as some instrument gave it, already in the contract's sense.

    `component` is C0Y, B0Z or A0Z; `value_rad` the lean of the mean line of the later axis against that of
    the earlier one, as at the axis positions `line_mm` with tool vector `tool_mm`, over the lengths
    `span_mm` (low, high) of the earlier and of the later axis. `sigma_rad` is its standard uncertainty.
    """

    component: str
    value_rad: float
    line_mm: Vector
    span_mm: tuple[tuple[float, float], tuple[float, float]]
    tool_mm: Vector = ZERO
    sigma_rad: float = 0.0
    source: str = ""

    def __post_init__(self) -> None:
        if self.component not in SQUARENESS:
            raise ConfigError(
                f"squareness {self.component}: expected one of {', '.join(SQUARENESS)}", file=self.source
            )
        if not np.isfinite(self.value_rad):
            raise ConfigError(f"squareness {self.component} is not finite", file=self.source)


@dataclass(frozen=True, slots=True)
class MapWish:
    """That errors which no rigid bodies make are to be mapped: whether the readings scale the stated noise,
    and what interpolation of the map may lose, in mm."""

    noise: Literal["learnt", "stated"] = "learnt"
    within_mm: float = 2e-4


@dataclass(frozen=True, slots=True)
class Measurements:
    """All readings of one calibration, as taken: what `fit` takes.

    `map` asks for a map of what is not rigid.
    `periods_mm` are the periods of screws and scales by axis, where cyclic errors are looked for;
    `active_during_measurement` are the errors that the control corrected then.
    """

    machine: str
    lines: tuple[Line, ...] = ()
    squares: tuple[Square, ...] = ()
    squareness: tuple[SquarenessReading, ...] = ()
    periods_mm: tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]] = ((), (), ())
    temperature_degC: float = 20.0
    active_during_measurement: frozenset[str] = frozenset()
    measured: datetime.date | None = None
    chain: str | None = None
    points: tuple[Points, ...] = ()
    lengths: tuple[Lengths, ...] = ()
    pods: tuple[Pods, ...] = ()
    map: MapWish | None = None
    diagonals: tuple[Diagonal, ...] = ()
    circles: tuple[Circles, ...] = ()
