"""Bodies of the page: meshes that the job file names, and a simple machine drawn from the machine file.

All is shown in the frame of the workpiece. Along the chain from workpiece to tool every axis moves all that
follows it, whether it moves the workpiece or the tool. So the machine is a tree of nodes that follow the axis
positions.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.geometry import rotation_matrix
from olp.core.machine import ZERO, Job, Machine, Mesh, Setup, Vector
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.files.meshes import read_mesh
from olp.files.write import Reader

#: Most faces of a mesh; a larger one is drawn coarser.
MOST_FACES = 150_000
#: Colour by role.
_COLOURS = {"workpiece": "#9aa7b5", "fixture": "#7d8f69", "machine": "#5f7a96", "tool": "#b0803a"}
_UNIT: dict[str, Vector] = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
#: Opacity by role.
_OPACITY = {"workpiece": 0.55, "fixture": 0.5, "machine": 0.25, "tool": 0.4}
#: Triangles of a box, by the indices of its corners.
_FACES = np.array(
    [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2],
     [2, 4, 6], [1, 3, 5], [3, 7, 5]], np.int64,
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """(v, 3) `vertices` in mm in the frame shown, (f, 3) `faces`; `path` names its nodes in the tree."""

    name: str
    label: str
    role: str
    vertices: Array
    faces: npt.NDArray[np.int64]
    path: tuple[str, ...] = ()

    @property
    def colour(self) -> str:
        return _COLOURS[self.role]

    @property
    def opacity(self) -> float:
        return _OPACITY[self.role]


@dataclass(frozen=True, slots=True)
class Node:
    """A part of the drawn machine: it moves all that is below it in the tree, whose names are `path`. By the
    column `axis` of axis values it goes along `direction`, or turns about the line through `point_mm`."""

    path: tuple[str, ...]
    axis: int
    kind: Literal["linear", "rotary"] = "linear"
    direction: Vector = ZERO
    point_mm: Vector = ZERO

    def placed(self, value: Array) -> tuple[Array, Array]:
        """(n, 3) shifts and (n, 4) unit quaternions x, y, z, w of the node at axis values (n,)."""
        shift = np.outer(value, self.direction)
        if self.kind == "linear":
            return shift, np.tile([0.0, 0.0, 0.0, 1.0], (len(value), 1))
        from scipy.spatial.transform import Rotation

        rotation = Rotation.from_rotvec(np.radians(shift))
        return self.point_mm - rotation.apply(self.point_mm), rotation.as_quat()


def of_job(job: Job, setup: Setup | None, origin_mm: Array, read: Reader) -> list[Body]:
    """The meshes of the job, placed by their frames; `origin_mm` is the zero of the frame shown on the
    machine, `read` opens their files. Without a `setup` the machine has no work offsets.

    Raises InputError for a file that is not a mesh.
    """
    return [_placed(mesh, k, setup, origin_mm, read) for k, mesh in enumerate(job.meshes, 1)]


def _placed(mesh: Mesh, number: int, setup: Setup | None, origin_mm: Array, read: Reader) -> Body:
    vertices, faces = coarser(*read_mesh(mesh.file, read))
    vertices = vertices * mesh.unit_mm
    if setup is None and mesh.frame != "machine":
        raise ConfigError(
            f"the mesh {mesh.file} lies in the frame {mesh.frame}; this machine has no work offsets, so "
            'expected frame = "machine"'
        )
    offset = None if setup is None or mesh.frame == "machine" else setup.work_offset(mesh.frame)
    if offset is not None:
        vertices = vertices @ rotation_matrix(offset.rotation_deg).T + np.array(offset.offset_mm)
    name = Path(mesh.file).stem
    return Body(f"mesh-{number}", name, mesh.role, vertices - origin_mm, faces)


def coarser(vertices: Array, faces: npt.NDArray[np.int64]) -> tuple[Array, npt.NDArray[np.int64]]:
    """A mesh of no more than MOST_FACES: vertices in one cell of a grid become their mean."""
    size = float((vertices.max(axis=0) - vertices.min(axis=0)).max())
    cells = 1024
    small, few = vertices, faces
    while len(few) > MOST_FACES:
        cell = np.floor((vertices - vertices.min(axis=0)) / (size / cells)).astype(np.int64)
        _, which, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
        which = which.ravel()
        small = np.stack([np.bincount(which, vertices[:, i]) / count for i in range(3)], axis=1)
        few = which[faces]
        few = few[(few[:, 0] != few[:, 1]) & (few[:, 1] != few[:, 2]) & (few[:, 0] != few[:, 2])]
        few = few[np.unique(np.sort(few, axis=1), axis=0, return_index=True)[1]]
        cells //= 2
    return small, few


def nodes(machine: Machine) -> tuple[Node, ...]:
    """The nodes of a machine, each inside the one before it."""
    order = machine.chain.replace("F", "")
    return tuple(
        Node(("machine", *order[: k + 1]), AXES.index(axis), direction=_UNIT[axis])
        for k, axis in enumerate(order)
    )


def of_machine(
    machine: Machine, axes_mm: Array, gauge_mm: Array, tip_mm: Array, radius_mm: float
) -> Iterator[Body]:
    """A machine of boxes with its axes at `axes_mm`; `gauge_mm` and `tip_mm` (3,) are the gauge point and the
    tip of the tool there, in the frame shown. Only the travels are to scale."""
    travel = np.array([machine.axes[axis].travel_mm for axis in AXES])
    # the gauge point at both ends of all axes, in the frame shown
    low, high = gauge_mm + (travel[:, 0] - axes_mm), gauge_mm + (travel[:, 1] - axes_mm)
    span = high - low
    thick = float(np.clip(0.06 * span.max(), 20.0, 150.0))
    order = machine.chain.replace("F", "")
    frame = machine.chain.index("F")
    floor = low[2] - thick - abs(tip_mm[2] - gauge_mm[2])
    table_low = np.array([low[0] - thick, low[1] - thick, floor - thick])
    table_high = np.array([high[0] + thick, high[1] + thick, floor])
    yield _box("table", "machine", table_low, table_high, ())
    for depth, axis in enumerate(order):
        path = ("machine", *order[: depth + 1])
        after = order[depth + 1] if depth + 1 < len(order) else None
        yield from _carrier(axis, after, path, low, high, gauge_mm, thick, floor, on_floor=depth == frame)
    if radius_mm > 0.0:
        reach = np.array([radius_mm, radius_mm, 0.0])
        ends = np.sort([gauge_mm[2], tip_mm[2]])
        begin, end = (np.array([*tip_mm[:2], height]) for height in ends)
        yield _box("tool", "tool", begin - reach, end + reach, ("machine", *order))


def _carrier(
    axis: str, after: str | None, path: tuple[str, ...], low: Array, high: Array, gauge: Array, thick: float,
    floor: float, *, on_floor: bool,
) -> Iterator[Body]:  # fmt: skip
    """The bodies that an axis moves: a ram at the end of the chain, else the guide of the axis after it."""
    top = high[2] + 2 * thick
    if after is None:
        i = AXES.index(axis)
        half = np.full(3, 0.3 * thick)
        begin, end = gauge - half, gauge + half
        if axis == "Z":
            begin[2], end[2] = gauge[2], top + thick - (high[2] - gauge[2])
        else:
            end[i] = gauge[i] + (high[i] - low[i])
            begin[2], end[2] = gauge[2], gauge[2] + thick
        yield _box(f"{axis}-ram", "machine", begin, end, path)
        return
    guide = AXES.index(after)
    if after == "Z":
        half = np.array([0.6, 0.6, 0.0]) * thick
        begin, end = gauge - half, gauge + half
        begin[2], end[2] = high[2] + 0.5 * thick, top + 0.5 * thick
        yield _box(f"{axis}-carriage", "machine", begin, end, path)
        return
    begin, end = gauge - 0.4 * thick, gauge + 0.4 * thick
    begin[guide], end[guide] = low[guide] - thick, high[guide] + thick
    begin[2], end[2] = top - thick, top
    yield _box(f"{axis}-beam", "machine", begin, end, path)
    if on_floor:
        for side, (a, b) in enumerate(
            ((begin[guide], begin[guide] + 0.6 * thick), (end[guide] - 0.6 * thick, end[guide]))
        ):
            leg_low, leg_high = begin.copy(), end.copy()
            leg_low[guide], leg_high[guide] = a, b
            leg_low[2], leg_high[2] = floor, top - thick
            yield _box(f"{axis}-leg-{side + 1}", "machine", leg_low, leg_high, path)


def _box(name: str, role: str, low: Array, high: Array, path: tuple[str, ...]) -> Body:
    corner = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
    return Body(name, name.replace("-", " "), role, np.where(corner == 1, high, low), _FACES, path)
