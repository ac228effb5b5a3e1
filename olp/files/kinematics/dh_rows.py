"""The lines and zeros of an arm as calibrated, as modified Denavit-Hartenberg rows (Craig 2005).

Row i is Rx(alpha) Tx(a) Rz(theta) Tz(d) from the frame of axis i-1 to that of axis i. The x of a frame goes
along the common normal to the next axis. With a base and a gauge frame the rows hold any lines exactly. Of
two axes that are nearly parallel the common normal is far away, so their d are long, and need all digits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from olp.core.arrays import Array
from olp.core.rigid_fit import Rigid
from olp.files.kinematics.control_kinematics import (
    Entered,
    KinematicTable,
    as_it_lies,
    left_zeros,
    refuse,
    without_zeros,
)
from olp.kinematics.errors import MachineErrors
from olp.kinematics.poses import Poses
from olp.kinematics.structure import FRAME, Joint, Structure

#: The sine of an angle below which two lines are parallel.
_PARALLEL = 1e-9
#: mm; a d beyond it is that of axes which are nearly parallel.
_FAR_MM = 1e4


def _enter(structure: Structure, errors: MachineErrors) -> Entered:
    refuse("rows of Denavit and Hartenberg", _problems(structure))
    lies = as_it_lies(structure, errors)
    zeros = left_zeros(structure, errors)
    names = lies.chain[1:]
    frames = _frames([lies.joints[name] for name in names])
    far: list[str] = []
    lines = ["a_mm,alpha_deg,d_mm,theta0_deg,min_deg,max_deg"]
    before = frames[0]
    for name, frame in zip(names, frames, strict=True):
        a, alpha, d, theta = _row(before, frame)
        cells = (a, alpha, d, theta + zeros.get(name, 0.0), *lies.joints[name].travel)
        lines.append(",".join(f"{cell + 0.0:.15g}" for cell in cells))
        before = frame
        if abs(d) > _FAR_MM:
            far.append(name)
    data = ("\n".join(lines) + "\n").encode("ascii")
    flange = frames[-1].inverse() @ lies.gauge.pose
    notes = [
        f"base frame of the rows in the machine: {_named(frames[0])}",
        f"gauge frame of the machine in the last row: {_named(flange)}",
    ]
    if far:
        notes.append(
            f"{' and '.join(far)} are nearly parallel, so their d are long: enter all digits, and only where "
            "the control keeps them"
        )
    return Entered(data, lies, without_zeros(errors), tuple(notes))


def _problems(structure: Structure) -> Iterator[str]:
    kinds = {joint.kind for joint in structure.joints.values()}
    if structure.platforms:
        yield "it has a platform on legs"
    elif structure.chain[0] != FRAME or kinds != {"rotary"} or len(structure.joints) < 2:
        yield "expected an arm of two or more rotary axes that all carry the tool"


def _frames(joints: Sequence[Joint]) -> list[Poses]:
    """The frame of each axis in the machine: z along the axis, x along the common normal to the next one. The
    last one has the x of the one before."""
    frames = []
    for joint, after in pairwise(joints):
        origin, normal = _normal(joint, after)
        frames.append(_frame(origin, np.array(joint.direction), normal))
    foot = _normal(joints[-1], joints[-2])[0]
    frames.append(_frame(foot, np.array(joints[-1].direction), frames[-1].rotation[:, 0]))
    return frames


def _frame(origin: Array, z: Array, x: Array) -> Poses:
    x = x - (x @ z) * z
    x = x / np.linalg.norm(x)
    return Poses(np.stack([x, np.cross(z, x), z], axis=1), origin)


def _normal(joint: Joint, other: Joint) -> tuple[Array, Array]:
    """The point of a line that is nearest to another one, and the direction to it."""
    u, v = np.array(joint.direction), np.array(other.direction)
    p, between = np.array(joint.point_mm), np.subtract(other.point_mm, joint.point_mm)
    across = np.cross(u, v)
    size = float(np.linalg.norm(across))
    if size > _PARALLEL:
        foot = p + float(np.cross(between, v) @ across) / size**2 * u
        return foot, across / size * (-1.0 if between @ across < 0.0 else 1.0)
    foot = p + (between @ u) * u
    away = np.array(other.point_mm) - foot
    if np.linalg.norm(away) > 0.0:
        return foot, away
    return foot, np.eye(3)[int(np.argmin(np.abs(u)))]


def _row(before: Poses, after: Poses) -> tuple[float, float, float, float]:
    """a, alpha, d and theta between two frames: x of the first one is along the common normal of their z."""
    step = before.inverse() @ after
    z, turn = step.rotation[:, 2], step.rotation
    alpha = math.atan2(-z[1], z[2])
    # undo the turn about x: what is left is a turn about z, and a shift along x and z
    cosine, sine = math.cos(alpha), math.sin(alpha)
    x, y, away = step.position
    return (
        float(x), math.degrees(alpha), float(cosine * away - sine * y),
        math.degrees(math.atan2(cosine * turn[1, 0] + sine * turn[2, 0], turn[0, 0])),
    )  # fmt: skip


def _named(pose: Poses) -> str:
    place = ", ".join(f"{axis} {_shown(value, 6)}" for axis, value in zip("XYZ", pose.position, strict=True))
    angles = Rigid(pose.rotation, np.zeros(3)).angles_deg
    turn = ", ".join(f"{axis} {_shown(value, 7)}" for axis, value in zip("ABC", angles, strict=True))
    return f"{place} mm, {turn} deg (Rz Ry Rx)"


def _shown(value: float, digits: int) -> str:
    return f"{round(float(value), digits) + 0.0:.{digits}f}"


TABLES = (
    KinematicTable(
        "dh", "Modified Denavit-Hartenberg rows of an arm, with its base and gauge frame", ".csv",
        "Craig, Introduction to Robotics (2005); read back by `olp init --mdh`",
        "lines and zeros of all joints of an arm, as calibrated; no weight, no error motions",
        _enter,
        "describe the arm once more (olp init --mdh {file}) and fit the calibration again",
    ),
)  # fmt: skip
