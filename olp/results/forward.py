"""Reported points to true ones: true = reported + e(axis position at the touch, stylus vector).

A measuring machine reports where its scales say that the tip is. So the error of the machine is added
(error = actual - commanded): the model runs forward, and nothing is inverted.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import OutsideBox
from olp.core.machine import Vector
from olp.core.toolpath import Touch
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.results.reported import Reported

#: Directions of the touch from the centre of the tip that are tried where none is stated.
_ROUND = np.array([s * np.eye(3)[i] for i in range(3) for s in (1.0, -1.0)])
#: A direction out of the surface must have length 1 within this.
_UNIT = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class ReportFrame:
    """A frame of reported points: axis position = `rotation` @ point + `offset_mm`. `touched` is (axis
    position, tool vector and payload) where its zero was set on the uncompensated machine, None where it was
    set by other means."""

    name: str
    rotation: Array
    offset_mm: Vector
    touched: Touch | None


@dataclass(frozen=True, slots=True, eq=False)
class Stylus:
    """Length that enters axis positions, tool vector (gauge point to tip), radius of the tip, all in mm."""

    length_mm: Vector
    tool_vector_mm: Vector
    radius_mm: float


@dataclass(frozen=True, slots=True, eq=False)
class Forward:
    """(n, 3) `axis_mm` at the touches with their tool vectors `tool_vector_mm`, (3,) where all have the same.
    `added_mm` is what to add to the reported points in their own frame. `play` is that of the axes (n, 3),
    None where no axis has backlash.

    `doubt_mm` (n,) is how far the sum may differ because the side of the touch is not stated. `play_mm` (n,)
    is how far because the direction of the approach is not stated.
    """

    axis_mm: Array
    tool_vector_mm: Array
    added_mm: Array
    play: Array | None
    doubt_mm: Array
    play_mm: Array


def forward(
    reported: Reported,
    frames: Sequence[ReportFrame],
    styli: Sequence[Stylus],
    model: ErrorModel,
    *,
    axes: Literal["tip", "tool", "ram"],
    hold: bool,
    payload_kg: float = 0.0,
) -> Forward:
    """What has to be added to each point. `frames` and `styli` are those of `reported`. Axis positions count
    at the tip ("tip"), at the tip less the length of the tool ("tool"), or at the end of the ram, where the
    stylus begins ("ram").

    Raises OutsideBox, with the line, for a touch outside the calibrated box unless it is held at its face.
    """
    machine = _Machine(frames, styli, model, axes, hold, payload_kg)
    same = len(styli) == 1 and not reported.own_stylus.any()
    count = len(reported)
    axis, added = np.empty((count, 3)), np.empty((count, 3))
    tool_vector = np.zeros(3) if same else np.empty((count, 3))
    play: list[Array] = []
    # memory of zeros costs nothing until it is written
    doubt, play_doubt = np.zeros(count), np.zeros(count)
    for rows in reported.bands():
        part = machine.touches(reported.part(rows))
        axis[rows], added[rows] = part.axis_mm, part.added_mm
        if same:
            tool_vector = part.tool_vector_mm[0]
        else:
            tool_vector[rows] = part.tool_vector_mm
        if part.play is not None:
            play.append(part.play)
        for column, values in ((doubt, part.doubt_mm), (play_doubt, part.play_mm)):
            if values.any():
                column[rows] = values
    return Forward(axis, tool_vector, added, np.concatenate(play) if play else None, doubt, play_doubt)


class _Machine:
    """The machine at its touches: frames and styli by their index, and the model of its errors."""

    def __init__(
        self, frames: Sequence[ReportFrame], styli: Sequence[Stylus], model: ErrorModel,
        axes: Literal["tip", "tool", "ram"], hold: bool, payload_kg: float,
    ) -> None:  # fmt: skip
        self.model, self.axes, self.hold, self.payload_kg = model, axes, hold, payload_kg
        self.rotation = np.array([f.rotation for f in frames])
        self.offset_mm = np.array([f.offset_mm for f in frames])
        self.length_mm = np.array([s.length_mm for s in styli])
        self.tool_vector_mm = np.array([s.tool_vector_mm for s in styli], float)
        self.radius_mm = np.array([s.radius_mm for s in styli])
        #: (frames, 3) error where the zero of a frame was set on the uncompensated machine
        self.shift_mm = np.zeros((len(frames), 3))
        for k, frame in enumerate(frames):
            if frame.touched is not None:
                touched_mm, arm = frame.touched
                self.shift_mm[k] = model.error(np.array([touched_mm]), np.array(arm, float))[0]

    def touches(self, reported: Reported) -> Forward:
        """What has to be added to some points."""
        model = self.model
        rotation, offset = self.rotation[reported.frame], self.offset_mm[reported.frame]
        length, tool_vector = self.length_mm[reported.tool], self.tool_vector_mm[reported.tool]
        radius = self.radius_mm[reported.tool]
        own = reported.own_stylus
        # a row's own stylus vector replaces that of the tool; the length of a stylus is minus its vector
        length[own], tool_vector[own] = -reported.stylus_mm[own], reported.stylus_mm[own]
        if self.axes == "ram":
            length = -tool_vector
        elif self.axes == "tip":
            length[:] = 0.0
        if reported.tip_radius_mm is not None:
            radius = np.full(len(reported), reported.tip_radius_mm)
        normal = _unit(reported.normal)
        known = np.asarray(np.isfinite(normal).all(axis=1), bool)
        surface = reported.point != "centre"
        centre = reported.value_mm + np.where(known[:, None] & surface, normal * radius[:, None], 0.0)
        axis = np.einsum("nij,nj->ni", rotation, centre) + offset + length
        if not self.hold:
            _inside(reported, axis, model)
        toward = np.einsum("nij,nj->ni", rotation, normal)
        play, play_doubt = _play(model, axis, toward, reported.approach_mm)
        arms = tool_vector
        if self.payload_kg:
            arms = np.column_stack([tool_vector, np.full(len(tool_vector), self.payload_kg)])
        error = model.error(axis, arms, play)
        blind = np.flatnonzero((radius > 0) & surface & ~known)
        doubt = np.zeros(len(reported))
        doubt[blind] = _side_doubt(model, axis[blind], radius[blind], arms[blind])
        added = np.einsum("nji,nj->ni", rotation, error - self.shift_mm[reported.frame])
        return Forward(axis, tool_vector, added, play, doubt, play_doubt)


def _side_doubt(model: ErrorModel, axis: Array, radius: Array, arms: Array) -> Array:
    """(n,) centre or surface, and from which side: the error at other positions of the tip bounds the
    doubt."""
    doubt = np.zeros(len(axis))
    error = model.error(axis, arms, None)
    for direction in _ROUND:
        about = model.error(axis + direction * radius[:, None], arms, None)
        doubt = np.maximum(doubt, np.abs(about - error).max(axis=1, initial=0.0))
    return doubt


def _unit(normal: Array) -> Array:
    """Unit vectors; NaN where a row states none. DMIS writes 0, 0, 0 for none."""
    size = np.sqrt((normal * normal).sum(axis=1, keepdims=True))
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = np.where(np.abs(size - 1.0) <= _UNIT, normal / size, np.nan)
    return np.asarray(unit, float)


def _inside(reported: Reported, axis: Array, model: ErrorModel) -> None:
    inside = model.inside(axis)
    if inside.all():
        return
    i = int(np.flatnonzero(~inside.all(axis=1))[0])
    j = int(np.flatnonzero(~inside[i])[0])
    low, high = model.box_mm[j]
    raise OutsideBox(
        f"axis {'XYZ'[j]} was at {axis[i, j]:.3f} mm, outside the calibrated box {low:g} to {high:g} mm; "
        "check the frame, calibrate there, or accept the error at the box face with --outside-box hold",
        line=int(reported.line[i]),
    )


def _play(model: ErrorModel, axis: Array, toward: Array, approach: Array) -> tuple[Array | None, Array]:
    """Play of the axes at the touch, and half the backlash where the play is not known.

    A touch is made while the machine moves against the surface. So the approach decides on which side of its
    backlash an axis is, where the approach was long enough to take the backlash up.
    """
    backlash = model.backlash_at(axis)
    if backlash is None:
        return None, np.zeros(len(axis))
    away = np.nan_to_num(toward)
    reach = np.abs(away) * np.nan_to_num(approach)[:, None]
    known = np.asarray((reach > np.abs(backlash)) | (backlash == 0.0))
    play = np.asarray(np.where(known, -np.sign(away), 0.0), float)
    doubt = np.sqrt((np.where(known, 0.0, 0.5 * backlash) ** 2).sum(axis=1))
    return play, np.asarray(doubt, float)
