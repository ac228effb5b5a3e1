"""A machine file from a robot description in URDF: the joints from a root to a tip, all at zero.

URDF states each joint relative to the one before it, in m and rad (wiki.ros.org/urdf/XML/joint). Here each
becomes a line in machine coordinates. Fixed joints are folded into what follows them.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import InputError
from olp.core.geometry import rotation_matrix
from olp.core.rigid_fit import Rigid
from olp.files.kinematics.written import DIGITS, STEP, Parts, Written, machine_file, numbers
from olp.files.write import PathLike, read_bytes
from olp.kinematics.poses import STILL, Poses

#: mm per m.
_MM_PER_M = 1e3
#: Kinds of joints that move, and the kinds of ours.
_MOVING = {"revolute": "rotary", "continuous": "rotary", "prismatic": "linear"}
#: Travel of a joint without ends, in degrees.
_TURNING_DEG = 360.0


def machine_of_urdf(
    path: PathLike, tip: str | None = None, name: str | None = None, controller: str | None = None
) -> Written:
    """The machine file of a robot that a URDF file describes, from its root to the link `tip` (default: its
    only last link). It names no calibration. Raises InputError where the file cannot be
    read, or has joints that are not supported."""
    robot = _robot(path)
    joints = robot.findall("joint")
    links = [link.get("name", "") for link in robot.findall("link")]
    by_child = {_linked(joint, "child", path): joint for joint in joints}
    chain = _chain(by_child, _tip(joints, links, tip, path), path)
    axes, gauge = _lines(chain, path)
    if not axes:
        raise InputError("has no joint that moves between its root and its tip", file=str(path))
    return machine_file(
        Parts(("F", *axes), axes, gauge),
        name or robot.get("name") or "robot",
        controller,
        [f"URDF states no least increments; {STEP:g} mm and deg are written: give those of the control"],
    )


def _robot(path: PathLike) -> ET.Element:
    data = read_bytes(path)
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise InputError("declares entities, which URDF has no use for; take them out", file=str(path))
    try:
        robot = ET.fromstring(data)
    except ET.ParseError as error:
        raise InputError(f"is not XML ({error})", file=str(path), line=error.position[0]) from None
    if robot.tag != "robot":
        raise InputError(f"has the root <{robot.tag}>; expected <robot> of URDF", file=str(path))
    if any("xacro" in element.tag for element in robot.iter()):
        raise InputError("holds macros of xacro; expected what xacro writes from them", file=str(path))
    return robot


def _linked(joint: ET.Element, which: str, path: PathLike) -> str:
    element = joint.find(which)
    link = None if element is None else element.get("link")
    if link is None:
        raise InputError(f"joint {joint.get('name')} names no {which} link", file=str(path))
    return link


def _tip(joints: list[ET.Element], links: list[str], tip: str | None, path: PathLike) -> str:
    """The last link of the chain."""
    if tip is not None:
        if tip not in links:
            raise InputError(f"has no link {tip}; expected one of {', '.join(links)}", file=str(path))
        return tip
    parents = {_linked(joint, "parent", path) for joint in joints}
    last = [link for link in links if link not in parents]
    if len(last) != 1:
        raise InputError(
            f"ends in {len(last)} links ({', '.join(last)}); name that of the tool with --tip", file=str(path)
        )
    return last[0]


def _chain(by_child: Mapping[str, ET.Element], tip: str, path: PathLike) -> list[ET.Element]:
    """The joints from the root to the tip."""
    chain: list[ET.Element] = []
    link = tip
    while link in by_child:
        joint = by_child[link]
        if joint in chain:
            raise InputError(f"has a circle of joints at {joint.get('name')}", file=str(path))
        chain.append(joint)
        link = _linked(joint, "parent", path)
    return chain[::-1]


def _lines(chain: list[ET.Element], path: PathLike) -> tuple[dict[str, dict[str, object]], dict[str, object]]:
    """The table of each axis by name, and that of the gauge frame."""
    pose = STILL
    axes: dict[str, dict[str, object]] = {}
    for joint in chain:
        origin = joint.find("origin")
        shift = _three(origin, "xyz", joint, path) * _MM_PER_M
        turn = rotation_matrix(tuple(np.degrees(_three(origin, "rpy", joint, path)).tolist()))
        pose = pose @ Poses(turn, shift)
        kind = joint.get("type", "")
        if kind == "fixed":
            continue
        name = "_".join(joint.get("name", "").split())
        if kind not in _MOVING:
            raise InputError(
                f'joint {name} is of type "{kind}"; expected fixed, revolute, continuous or prismatic',
                file=str(path),
            )
        if joint.find("mimic") is not None:
            raise InputError(f"joint {name} follows another one (mimic), which is not built", file=str(path))
        if name in ("", "F", "gauge") or name in axes:
            raise InputError(f'the name "{name}" of a joint cannot be used; give it another', file=str(path))
        axes[name] = dict(_axis(joint, _MOVING[kind], pose, path))
    a, b, c = (_round(angle) for angle in _angles_deg(pose.rotation))
    gauge = {"point_mm": numbers(pose.position), "A_deg": a, "B_deg": b, "C_deg": c}
    return axes, gauge


def _axis(joint: ET.Element, kind: str, pose: Poses, path: PathLike) -> Iterator[tuple[str, object]]:
    """The keys of one axis."""
    stated = joint.find("axis")
    along = np.array((1.0, 0.0, 0.0)) if stated is None else _three(stated, "xyz", joint, path)
    size = float(np.linalg.norm(along))
    if not size > 0.0:
        raise InputError(f"joint {joint.get('name')} has an axis without direction", file=str(path))
    direction = pose.rotation @ (along / size)
    direction = np.where(np.abs(direction) < 10.0**-DIGITS, 0.0, direction)
    unit = "deg" if kind == "rotary" else "mm"
    scale = math.degrees(1.0) if kind == "rotary" else _MM_PER_M
    limit = joint.find("limit")
    low, high = (_number(limit, key, joint, path) * scale for key in ("lower", "upper"))
    if joint.get("type") == "continuous":
        low, high = 0.0 - _TURNING_DEG, _TURNING_DEG
    elif not low < high:
        raise InputError(f"joint {joint.get('name')} states no travel; give lower and upper", file=str(path))
    yield "kind", kind
    yield "direction", numbers(direction)
    yield "point_mm", numbers(pose.position)
    yield f"travel_{unit}", [_round(low), _round(high)]
    yield f"least_increment_{unit}", STEP
    velocity = _number(limit, "velocity", joint, path) * scale
    if velocity > 0.0:
        yield f"velocity_{unit}_s", _round(velocity)


def _three(element: ET.Element | None, key: str, joint: ET.Element, path: PathLike) -> Array:
    text = "0 0 0" if element is None else element.get(key, "0 0 0")
    try:
        numbers = np.array([float(part) for part in text.split()])
    except ValueError:
        numbers = np.zeros(0)
    if numbers.shape != (3,) or not np.all(np.isfinite(numbers)):
        raise InputError(
            f'joint {joint.get("name")} has {key} = "{text}"; expected three numbers', file=str(path)
        )
    return numbers


def _number(element: ET.Element | None, key: str, joint: ET.Element, path: PathLike) -> float:
    text = "0" if element is None else element.get(key, "0")
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f'joint {joint.get("name")} has {key} = "{text}"; expected a number', file=str(path))
    return number


def _angles_deg(rotation: Array) -> tuple[float, float, float]:
    """A, B, C of Rz Ry Rx."""
    return Rigid(rotation, np.zeros(3)).angles_deg


def _round(value: float) -> float:
    return round(value, DIGITS) + 0.0
