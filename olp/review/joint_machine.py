"""A simple machine of any joints, drawn from its chain, with the nodes that move it.

All is shown in the frame of the workpiece. Along the chain from workpiece to tool every joint moves all that
follows it, about or along its own line with all axes at zero. Only lines, travels and the tool are to scale.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from olp.compensation.joints.motion import Motion
from olp.core.arrays import Array
from olp.core.machine import Vector
from olp.kinematics.structure import FRAME, Joint, Structure
from olp.review.meshes import Body, Node

#: The name of the node of all that is drawn of a machine.
_ROOT = "machine"
#: The thickness of parts: a share of the machine, and its bounds.
_THICK = 0.05
_THINNEST_MM = 8.0
_THICKEST_MM = 120.0
#: Sides of what is round.
_SECTIONS = 24
#: A tool without a radius is drawn so thick: to its length, and at least to the path.
_SLIM = 0.04
_SMALL = 0.01

Drawn = tuple[tuple[Node, ...], tuple[Body, ...], Array, Array]


def drawn(
    structure: Structure, motion: Motion, axes: Array, tool: tuple[int, float], frame: tuple[Array, float]
) -> Drawn:
    """Nodes, bodies, (n, k) values that move the nodes, and those (k,) at which the bodies are drawn. `tool`
    is its place in `motion`, and its radius in mm; `frame` the zero of the frame shown, and the size of the
    path in mm."""
    origin_mm, size_mm = frame
    slim = max(_SLIM * float(np.linalg.norm(motion.machines[tool[0]].tool_mm)), _SMALL * size_mm)
    radius_mm = tool[1] or slim
    if structure.platforms:
        return _held(motion, axes, (tool[0], radius_mm), origin_mm)
    parts = [name for name in structure.chain if name != FRAME]
    nodes = tuple(
        Node(
            (_ROOT, *parts[: k + 1]), structure.order.index(name), _kind(structure.joints[name]),
            structure.joints[name].direction, _less(structure.joints[name].point_mm, origin_mm),
        )
        for k, name in enumerate(parts)
    )  # fmt: skip
    zero = motion.nominal(np.zeros((1, axes.shape[1])), np.array([tool[0]]))
    gauge, tip = np.array(structure.gauge.point_mm), zero.position[0]
    bodies = [*_machine(structure, parts, gauge), _tool(gauge, tip, radius_mm, (_ROOT, *parts))]
    shifted = tuple(Body(b.name, b.label, b.role, b.vertices - origin_mm, b.faces, b.path) for b in bodies)
    return nodes, shifted, axes, np.zeros(axes.shape[1])


def _held(motion: Motion, axes: Array, tool: tuple[int, float], origin_mm: Array) -> Drawn:
    """The tool of a platform on legs, which six values move: shifts in mm along X, Y and Z after turns in
    degrees about them, against the first pose."""
    from scipy.spatial.transform import Rotation

    poses = motion.nominal(axes, np.full(len(axes), tool[0]))
    first = poses.rotation[0]
    turn = Rotation.from_matrix(poses.rotation @ first.T)
    shift = poses.position - turn.apply(poses.position[0])
    euler = turn.as_euler("xyz", degrees=True)
    euler = np.degrees(np.unwrap(np.radians(euler), axis=0))
    values = np.hstack((shift, euler))
    unit = np.eye(3).tolist()
    nodes: list[Node] = []
    path: tuple[str, ...] = (_ROOT,)
    zero = _less((0.0, 0.0, 0.0), origin_mm)
    for column, letter in ((0, "X"), (1, "Y"), (2, "Z"), (5, "C"), (4, "B"), (3, "A")):
        path = (*path, letter)
        x, y, z = unit[column % 3]
        nodes.append(Node(path, column, "linear" if column < 3 else "rotary", (x, y, z), zero))
    tip, vector = poses.position[0], np.array(motion.machines[tool[0]].tool_mm)
    body = _tool(tip - first @ vector, tip, tool[1], path)
    shifted = Body(body.name, body.label, body.role, body.vertices - origin_mm, body.faces, body.path)
    return tuple(nodes), (shifted,), values, np.zeros(6)


def _kind(joint: Joint) -> Any:
    return "rotary" if joint.kind == "rotary" else "linear"


def _less(point: Vector, origin_mm: Array) -> Vector:
    x, y, z = (np.array(point) - origin_mm).tolist()
    return x, y, z


def _machine(structure: Structure, parts: list[str], gauge: Array) -> Iterator[Body]:
    """A hub for each rotary joint and a guide with its carriage for each linear one, with beams between."""
    places = _places(structure, parts, gauge)
    reach = np.ptp(np.array([*places, gauge]), axis=0).max()
    spans = [j.travel[1] - j.travel[0] for j in structure.joints.values() if j.kind == "linear"]
    span = max([reach, *(s for s in spans if np.isfinite(s))], default=reach)
    thick = float(np.clip(_THICK * span, _THINNEST_MM, _THICKEST_MM))
    for k, name in enumerate(parts):
        joint, path, here = structure.joints[name], (_ROOT, *parts[: k + 1]), places[k]
        along = np.array(joint.direction)
        if joint.kind == "rotary":
            yield _rod(f"{name}-hub", "machine", here - 0.6 * thick * along, here + 0.6 * thick * along,
                       thick, path)  # fmt: skip
        else:
            low, high = np.clip(joint.travel, -span, span)
            aside = _aside(along) * 1.5 * thick
            yield _rod(f"{name}-guide", "machine", here + aside + low * along, here + aside + high * along,
                       0.35 * thick, path[:-1])  # fmt: skip
            yield _rod(f"{name}-carriage", "machine", here + aside - 0.7 * thick * along,
                       here + aside + 0.7 * thick * along, 0.7 * thick, path)  # fmt: skip
        ahead = gauge if k + 1 == len(parts) else places[k + 1]
        if np.linalg.norm(ahead - here) > thick:
            yield _rod(f"{name}-beam", "machine", here, ahead, 0.4 * thick, path)


def _places(structure: Structure, parts: list[str], gauge: Array) -> list[Array]:
    """Where each joint is drawn: rotary ones on their lines. Linear ones are at the rotary one before them on
    the side of the workpiece, behind them on that of the tool, or at the gauge point."""
    frame = structure.chain.index(FRAME)
    rotary = {k for k, name in enumerate(parts) if structure.joints[name].kind == "rotary"}
    places = []
    for k in range(len(parts)):
        near = [i for i in rotary if (i <= k < frame) or (i >= k >= frame)]
        nearest = min(near, key=lambda i: abs(i - k), default=None)
        places.append(gauge if nearest is None else np.array(structure.joints[parts[nearest]].point_mm))
    return places


def _aside(along: Array) -> Array:
    """A direction across another: upwards, or along X."""
    up = np.array((0.0, 0.0, 1.0))
    across = up - along * float(along @ up)
    length = float(np.linalg.norm(across))
    return across / length if length > 0.1 else np.array((1.0, 0.0, 0.0))


def _tool(gauge: Array, tip: Array, radius_mm: float, path: tuple[str, ...]) -> Body:
    """The tool from its holder to the tip; one without length is as long as it is thick."""
    length = float(np.linalg.norm(gauge - tip))
    begin = gauge if length > radius_mm else tip + np.array((0.0, 0.0, 2.0 * radius_mm))
    return _rod("tool", "tool", tip, begin, radius_mm, path)


def _rod(name: str, role: str, begin: Array, end: Array, radius: float, path: tuple[str, ...]) -> Body:
    import trimesh

    made = trimesh.creation.cylinder(radius=radius, segment=np.array([begin, end]), sections=_SECTIONS)
    vertices, faces = np.asarray(made.vertices, float), np.asarray(made.faces, np.int64)
    return Body(name, name.replace("-", " "), role, vertices, faces, path)
