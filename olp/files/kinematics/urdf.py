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
#: Links that a message names at most.
_NAMED = 12
#: Travel of a joint without ends, in degrees.
_TURNING_DEG = 360.0


def machine_of_urdf(
    path: PathLike, tip: str | None = None, name: str | None = None, controller: str | None = None
) -> Written:
    """The machine file of a robot that a URDF file describes, from its root to the link `tip` (default: its
    only last link that moves). It names no calibration. Raises InputError where the file cannot be
    read, or has joints that are not supported."""
    robot = _robot(path)
    joints = robot.findall("joint")
    links = [link.get("name", "") for link in robot.findall("link")]
    by_child = _by_child(joints, path)
    ends = [tip] if tip is not None else _ends(by_child, links, path)
    last = ends[0] if len(ends) == 1 else _tip(by_child, ends, path)
    if last not in links:
        raise InputError(f"has no link {last}; expected one of {_some(links)}", file=str(path))
    chain = _chain(by_child, last, path)
    axes, gauge = _lines(chain, path)
    if not axes:
        raise InputError(
            f"has no joint that moves between its root and its tip {last}; name the link of the tool with "
            "--tip",
            file=str(path),
        )
    notes = [f"URDF states no least increments; {STEP:g} mm and deg are written: give those of the control"]
    if len(ends) > 1:
        notes.append(f"The tool sits on the link {last}: name another one with --tip")
    return machine_file(
        Parts(("F", *axes), axes, gauge),
        name or robot.get("name") or "robot",
        controller,
        notes,
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
        raise InputError(
            "holds macros of xacro; run xacro on it, and give the URDF that it writes", file=str(path)
        )
    return robot


def _linked(joint: ET.Element, which: str, path: PathLike) -> str:
    element = joint.find(which)
    link = None if element is None else element.get("link")
    if link is None:
        raise InputError(f"joint {joint.get('name')} names no {which} link", file=str(path))
    return link


def _by_child(joints: list[ET.Element], path: PathLike) -> dict[str, ET.Element]:
    """The joint that holds each link."""
    by_child: dict[str, ET.Element] = {}
    for joint in joints:
        link = _linked(joint, "child", path)
        if link in by_child:
            both = f"{by_child[link].get('name')} and {joint.get('name')}"
            raise InputError(f"the joints {both} hold the same link {link}; expected one", file=str(path))
        by_child[link] = joint
    return by_child


def _ends(by_child: Mapping[str, ET.Element], links: list[str], path: PathLike) -> list[str]:
    """The links that hold no other."""
    parents = {_linked(joint, "parent", path) for joint in by_child.values()}
    return [link for link in links if link not in parents]


def _tip(by_child: Mapping[str, ET.Element], ends: list[str], path: PathLike) -> str:
    """The only one of several last links that joints move: others stand still, as the base of a robot."""
    moving = [link for link in ends if any(j.get("type") != "fixed" for j in _chain(by_child, link, path))]
    if len(moving) != 1:
        named = moving or ends
        raise InputError(
            f"ends in {len(named)} links ({_some(named)}); name that of the tool with --tip", file=str(path)
        )
    return moving[0]


def _some(names: list[str]) -> str:
    """The first names, and how many more there are."""
    more = len(names) - _NAMED
    return ", ".join(names[:_NAMED]) + (f" and {more} more" if more > 0 else "")


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
            raise InputError(
                f"joint {name} follows another one (mimic), which is not built; name a link before it with "
                "--tip, or write its file by hand",
                file=str(path),
            )
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
