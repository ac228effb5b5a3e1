"""What instruments read of a machine of any joints, each as a prediction from poses of the gauge frame.

Every kind of reading has unknowns of its own: the frame of a tracker, the centre of a ball, the plane that
was touched. The instrument stands still relative to the workpiece. Poses are in workpiece coordinates.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from dataclasses import field
from typing import ClassVar, TypeVar

import numpy as np

from olp.calibration.joints.candidates import Priors
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ConfigError
from olp.core.machine import Vector
from olp.core.rigid_fit import Rigid, fit_frame, rotation_of
from olp.core.values import dataclass
from olp.kinematics.errors import Payload
from olp.kinematics.motion import nominal_motion
from olp.kinematics.poses import Poses, rotation_vector
from olp.kinematics.structure import FRAME, Structure

#: Standard deviation of the rotation of the whole machine, in those of the tilt of an axis.
_LEANS = 2.0
#: An unknown without a prior.
FREE = np.inf

S = TypeVar("S", bound="Start")


@dataclass(frozen=True, slots=True, eq=False)
class Reading(ABC):
    """Readings of one instrument in one set-up at commanded axis values (n, axes), mm and deg. `row` (n,) are
    lines of the file. `tool_mm` runs from the gauge point to what is read, in the gauge frame; it is known
    within `tool_sigma` (mm, of each coordinate, the same error in all rows). `which` (n,) is the index of a
    nest, ball, centre, plane or point in `names`. `read_back` (n, axes) is what the control showed there,
    None where it was not noted: it has no part in a fit. `columns` are more fields with a row for each
    reading.
    """

    kind: ClassVar[str] = ""
    columns: ClassVar[tuple[str, ...]] = ("measured_mm",)
    source: str
    values: Array
    row: Index
    tool_mm: Vector
    sigma: float
    names: tuple[str, ...]
    which: Index
    tool_sigma: float = 0.0
    payload: Payload = Payload()
    read_back: Array | None = None

    @property
    def count(self) -> int:
        return len(self.values)

    @abstractmethod
    def start(self, pose: Poses, structure: Structure) -> Start:
        """What the adjustment begins with, from nominal poses of the gauge frame. Raises ConfigError and
        CannotCompute where the readings cannot be used."""

    def tips(self, pose: Poses, own: Array) -> Array:
        """(n, 3) where what is read is, mm. The last three of `own` are the error of the tool vector where it
        is not exact."""
        tool = np.array(self.tool_mm) + (own[-3:] if self.tool_sigma else 0.0)
        return pose.at(tool)

    def own(self, sizes: list[float]) -> Array:
        """(l,) standard deviations of the own unknowns: those of a kind, then the tool vector."""
        return np.array([*sizes, *([self.tool_sigma] * 3 if self.tool_sigma else [])])


@dataclass(frozen=True, slots=True, eq=False)
class Start(ABC):
    """A reading within an adjustment. `prior` (l,) are the standard deviations of its own unknowns, whose
    start is 0; `turns` are the places of angles among them. `measured` (n, m) is what was read and `sigma`
    (m,) how well, in mm or rad. `columns` are fields with a row for each reading."""

    columns: ClassVar[tuple[str, ...]] = ()
    turns: ClassVar[tuple[int, ...]] = ()
    reading: Reading
    prior: Array
    measured: Array
    sigma: Array

    def only(self: S, rows: Mask) -> S:
        """The same instrument with some of its readings."""
        reading = self.reading
        taken = {name: getattr(reading, name)[rows] for name in ("values", "row", "which", *reading.columns)}
        if reading.read_back is not None:
            taken["read_back"] = reading.read_back[rows]
        own = {name: getattr(self, name)[rows] for name in ("measured", *self.columns)}
        return dataclasses.replace(self, reading=dataclasses.replace(reading, **taken), **own)

    @abstractmethod
    def predicted(self, pose: Poses, own: Array) -> Array:
        """(n, m) what the instrument would read at poses of the gauge frame."""

    def off_mm(self, residual: Array) -> Array:
        """(n,) mm by which readings are off, from residuals (n, m)."""
        return np.asarray(np.linalg.norm(residual[:, :3], axis=1))


# -- trackers --------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Points(Reading):
    """Coordinates of reflectors `measured_mm` (n, 3) in the unknown frame of a tracker. `nests_mm` (nests, 3)
    are the vectors of the nests from `tool_mm`; each is known within `nest_sigma`."""

    kind: ClassVar[str] = "points"
    measured_mm: Array = field(default_factory=lambda: np.zeros((0, 3)))
    nests_mm: Array = field(default_factory=lambda: np.zeros((1, 3)))
    nest_sigma: float = 0.0

    def start(self, pose: Poses, structure: Structure) -> Start:
        nominal = pose.at(np.array(self.tool_mm) + self.nests_mm[self.which])
        frame = fit_frame(nominal, self.measured_mm)
        nests = [self.nest_sigma] * (3 * len(self.nests_mm) if self.nest_sigma else 0)
        return _InFrame(self, self.own([FREE] * 6 + nests), self.measured_mm, np.full(3, self.sigma), frame)


@dataclass(frozen=True, slots=True, eq=False)
class _InFrame(Start):
    """Points: `frame` leads from workpiece coordinates to those of the instrument."""

    turns: ClassVar[tuple[int, ...]] = (3, 4, 5)
    frame: Rigid

    def predicted(self, pose: Poses, own: Array) -> Array:
        reading = self.reading
        assert isinstance(reading, Points)
        nests = reading.nests_mm
        if reading.nest_sigma:
            nests = nests + own[6 : 6 + nests.size].reshape(-1, 3)
        tool = np.array(reading.tool_mm) + (own[-3:] if reading.tool_sigma else 0.0)
        return self.frame(pose.at(tool + nests[reading.which])) @ rotation_of(own[3:6]).T + own[:3]


@dataclass(frozen=True, slots=True, eq=False)
class SixD(Reading):
    """Poses of a target in the unknown frame of a tracker: positions (n, 3) mm and rotations (n, 3, 3). The
    target sits at `tool_mm` turned by `tool_turn` (3, 3), which is known within `turn_sigma` rad."""

    kind: ClassVar[str] = "poses"
    columns: ClassVar[tuple[str, ...]] = ("measured_mm", "measured_turn")
    measured_mm: Array = field(default_factory=lambda: np.zeros((0, 3)))
    measured_turn: Array = field(default_factory=lambda: np.zeros((0, 3, 3)))
    tool_turn: Array = field(default_factory=lambda: np.eye(3))
    sigma_rad: float = 0.0
    turn_sigma: float = 0.0

    def start(self, pose: Poses, structure: Structure) -> Start:
        nominal = pose.at(np.array(self.tool_mm))
        frame = fit_frame(nominal, self.measured_mm)
        own = self.own([FREE] * 6 + ([self.turn_sigma] * 3 if self.turn_sigma else []))
        measured = np.concatenate((self.measured_mm, np.zeros((self.count, 3))), axis=1)
        sigma = np.array([self.sigma] * 3 + [self.sigma_rad] * 3)
        return _PoseInFrame(self, own, measured, sigma, frame)


@dataclass(frozen=True, slots=True, eq=False)
class _PoseInFrame(Start):
    """Poses: the last three columns are the rotation vector from the pose that was read."""

    turns: ClassVar[tuple[int, ...]] = (3, 4, 5, 6, 7, 8)
    frame: Rigid

    def predicted(self, pose: Poses, own: Array) -> Array:
        reading = self.reading
        assert isinstance(reading, SixD)
        turn = rotation_of(own[3:6])
        place = self.frame(reading.tips(pose, own)) @ turn.T + own[:3]
        tool = reading.tool_turn
        if reading.turn_sigma:
            tool = tool @ rotation_of(own[6:9])
        turned = turn @ self.frame.rotation @ pose.rotation @ tool
        away = rotation_vector(turned @ np.swapaxes(reading.measured_turn, -1, -2))
        return np.concatenate((place, away), axis=1)


# -- balls, points and planes ----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class Ball(Reading):
    """The tip against balls that stand still in the workpiece, while the nominal tip stays on the ball.
    `measured_mm` (n, 3) is the tip minus the ball, along the axes of the workpiece or of the machine. Zero
    everywhere where a person brought the tip to one point."""

    kind: ClassVar[str] = "ball"
    measured_mm: Array = field(default_factory=lambda: np.zeros((0, 3)))
    in_machine: bool = False

    def start(self, pose: Poses, structure: Structure) -> Start:
        nominal = self.tips(pose, np.zeros(3))
        centres = np.stack([nominal[self.which == k].mean(axis=0) for k in range(len(self.names))])
        turn = np.broadcast_to(np.eye(3), (self.count, 3, 3))
        if self.in_machine:
            turn = _workpiece_in_machine(structure, self.values)
        sizes = [FREE] * (3 * len(self.names))
        if not np.any(self.measured_mm):
            return _AtBall(self, self.own(sizes), self.measured_mm, np.full(3, self.sigma), centres, turn)
        # the rotation of its base, which a structure does not show beside a frame, turns what a ball reads
        leans = [_LEANS * Priors.of(structure).tilt_rad] * 3
        own = self.own([*leans, *sizes])
        return _AtBallLeaning(self, own, self.measured_mm, np.full(3, self.sigma), centres, turn)


@dataclass(frozen=True, slots=True, eq=False)
class _AtBall(Start):
    """`centres` (balls, 3) mm of the balls at first; `turn` (n, 3, 3) leads to the axes of the readings."""

    columns: ClassVar[tuple[str, ...]] = ("turn",)
    centres: Array
    turn: Array

    def predicted(self, pose: Poses, own: Array) -> Array:
        centres = self.centres + own[: self.centres.size].reshape(-1, 3)
        away = self.reading.tips(pose, own) - centres[self.reading.which]
        return np.asarray((self.turn @ away[..., None])[..., 0])


@dataclass(frozen=True, slots=True, eq=False)
class _AtBallLeaning(_AtBall):
    """The same, with axes of the readings that lean by a rotation vector, the first three of the unknowns."""

    turns: ClassVar[tuple[int, ...]] = (0, 1, 2)

    def predicted(self, pose: Poses, own: Array) -> Array:
        away = _AtBall.predicted(self, pose, own[3:])
        lean = np.swapaxes(self.turn, -1, -2)
        upright = (lean @ away[..., None])[..., 0] @ rotation_of(own[:3]).T
        return np.asarray((self.turn @ upright[..., None])[..., 0])


@dataclass(frozen=True, slots=True, eq=False)
class Lengths(Reading):
    """Distances `measured_mm` (n, 1) of the tip from centres that stand still in the workpiece, about at
    `centres_mm`; the length is off by the same amount in all rows, known within `length_sigma`."""

    kind: ClassVar[str] = "lengths"
    measured_mm: Array = field(default_factory=lambda: np.zeros((0, 1)))
    centres_mm: Array = field(default_factory=lambda: np.zeros((1, 3)))
    length_sigma: float = 0.0

    def start(self, pose: Poses, structure: Structure) -> Start:
        sizes = [FREE] * self.centres_mm.size + ([self.length_sigma] if self.length_sigma else [])
        return _Distances(self, self.own(sizes), self.measured_mm, np.array([self.sigma]))


@dataclass(frozen=True, slots=True, eq=False)
class _Distances(Start):
    def predicted(self, pose: Poses, own: Array) -> Array:
        reading = self.reading
        assert isinstance(reading, Lengths)
        size = reading.centres_mm.size
        centres = reading.centres_mm + own[:size].reshape(-1, 3)
        length = np.linalg.norm(reading.tips(pose, own) - centres[reading.which], axis=1)
        return np.asarray(length + (own[size] if reading.length_sigma else 0.0))[:, None]


@dataclass(frozen=True, slots=True, eq=False)
class Planes(Reading):
    """The tip touched planes that stand still in the workpiece."""

    kind: ClassVar[str] = "planes"
    columns: ClassVar[tuple[str, ...]] = ()

    def start(self, pose: Poses, structure: Structure) -> Start:
        tips = self.tips(pose, np.zeros(3))
        frames = []
        for k, name in enumerate(self.names):
            own = tips[self.which == k]
            if len(own) < 4:
                raise ConfigError(f"plane {name} was touched {len(own)} times; expected 4 or more")
            middle = own.mean(axis=0)
            frames.append((middle, np.linalg.svd(own - middle)[2]))
        middles, axes = (np.stack(parts) for parts in zip(*frames, strict=True))
        sizes = [FREE] * (3 * len(self.names))
        measured = np.zeros((self.count, 1))
        return _OnPlanes(self, self.own(sizes), measured, np.array([self.sigma]), middles, axes)


@dataclass(frozen=True, slots=True, eq=False)
class _OnPlanes(Start):
    """`middles` (planes, 3) mm; `axes` (planes, 3, 3): two directions in each plane, and its normal."""

    middles: Array
    axes: Array

    def predicted(self, pose: Poses, own: Array) -> Array:
        changes = own[: self.middles.size].reshape(-1, 3)[self.reading.which]
        arm = self.reading.tips(pose, own) - self.middles[self.reading.which]
        inside = (self.axes[self.reading.which] @ arm[..., None])[..., 0]
        away = inside[:, 2] - np.sum(inside[:, :2] * changes[:, :2], axis=1) - changes[:, 2]
        return np.asarray(away)[:, None]


def _workpiece_in_machine(structure: Structure, values: Array) -> Array:
    """(n, 3, 3) nominal rotations from the axes of the workpiece to those of the machine."""
    turn = np.broadcast_to(np.eye(3), (len(values), 3, 3))
    for name in structure.chain[: structure.chain.index(FRAME)]:
        column = values[:, structure.order.index(name)]
        turn = turn @ nominal_motion(structure.joints[name], column).rows(len(values)).rotation
    return np.asarray(np.swapaxes(turn, -1, -2))
