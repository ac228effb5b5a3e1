"""Clearance of tool and holder along a path, against the meshes of a job.

Positions are relative to the workpiece. A mesh of a work offset is in program coordinates: there the tip is
at the axis position less the active tool length. A mesh of the frame "machine" is in axis positions: there
the tip is at the axis position plus its tool vector. A mesh of role machine stands still while axes before F
carry the workpiece.

The cutting part may touch the workpiece in feed moves. In a rapid beside a feed move it leaves or reaches the
surface that it cuts. There it is taken smaller by `SLACK_MM`, and only contact counts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from olp.checks.base import finding
from olp.clearance.parts import Part, parts_of
from olp.clearance.search import CONTACT_MM, Best, search
from olp.clearance.sweep import CHORD_MM, Segments, segments_of
from olp.clearance.tree import Tree
from olp.compensation.plan import zero_shifts
from olp.core.arrays import Array, Index, Mask, distinct
from olp.core.geometry import rotation_matrix
from olp.core.machine import Mesh, Setup, WorkOffset
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.reversal import plays
from olp.findings.catalogue import Finding

#: mm; how far a mesh of the workpiece may be from the path that cuts it (chords of both, allowances)
SLACK_MM = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A mesh of the job: (m, 3, 3) `triangle` in mm in its own frame."""

    mesh: Mesh
    name: str
    triangle: Array

    def offset(self, setup: Setup) -> WorkOffset | None:
        return None if self.mesh.frame == "machine" else setup.work_offset(self.mesh.frame)


@dataclass(frozen=True, slots=True, eq=False)
class Clearances:
    """Of b blocks: (b,) `line`, `clearance_mm` (0: contact), (b, 3) the nearest `point_mm` of a mesh in the
    mesh's frame; (b,) the nearest `part` and `solid`, as indices of `parts` and `solids`. `unknown` are lines
    that could not be checked."""

    line: Index
    clearance_mm: Array
    point_mm: Array
    part: Index
    solid: Index
    parts: tuple[str, ...]
    solids: tuple[Solid, ...]
    unknown: tuple[int, ...]

    def rows(self) -> Iterator[dict[str, object]]:
        """One mapping per block."""
        for k in range(len(self.line)):
            solid = self.solids[self.solid[k]]
            yield {
                "line": int(self.line[k]),
                "clearance_mm": float(self.clearance_mm[k]),
                "part": self.parts[self.part[k]],
                "mesh": solid.name,
                "role": solid.mesh.role,
                "frame": solid.mesh.frame,
                "point_mm": self.point_mm[k].tolist(),
            }

    def nearest(self, most: int) -> Clearances:
        """The `most` blocks of least clearance, in order."""
        order = np.argsort(self.clearance_mm, kind="stable")[:most]
        return Clearances(
            self.line[order], self.clearance_mm[order], self.point_mm[order], self.part[order],
            self.solid[order], self.parts, self.solids, self.unknown,
        )  # fmt: skip

    def findings(self, limit_mm: float, place_of: Callable[[int], str] = str) -> list[Finding]:
        """Contacts, clearances below the limit, and blocks that were not checked; `place_of` puts a line into
        words."""
        findings = []
        touching = self.clearance_mm <= 0.0
        for code, rows, what in (
            ("OLP701", touching, "touches"),
            ("OLP702", ~touching & (self.clearance_mm < limit_mm), "comes near"),
        ):
            if not rows.any():
                continue
            first = int(np.flatnonzero(rows)[self.clearance_mm[rows].argmin()])
            solid = self.solids[self.solid[first]]
            place = ", ".join(f"{v:.3f}" for v in self.point_mm[first].tolist())
            text = (
                f"the {self.parts[self.part[first]]} {what} {solid.name} at ({place}) in {solid.mesh.frame}"
            )
            if code == "OLP702":
                text += f": {self.clearance_mm[first]:.4g} mm, expected {limit_mm:g} mm"
            text += f", line {place_of(int(self.line[first]))}"
            findings.append(finding(code, text, self.line[rows].tolist()))
        if self.unknown:
            text = (
                f"{len(self.unknown)} blocks move from or to unknown positions, or with a tool without length"
            )
            findings.append(finding("OLP703", text, self.unknown))
        return findings


def clearances(path: Toolpath, model: ErrorModel, setup: Setup, solids: Sequence[Solid]) -> Clearances:
    """The least clearance of each block of a path, with its position.

    Distances are exact to `CLOSE_MM` along straight segments between waypoints and along arcs (`CHORD_MM`),
    for the tip positions that the error model gives at the waypoints."""
    names: list[str] = []
    best = Best.of(len(path))
    checked = np.zeros(len(path), bool)
    tips = _Tips.of(path, model, setup)
    tools = _tools(path, setup)
    for number, solid in enumerate(solids):
        tree = Tree.of(_placed(solid, setup))
        start, end = tips.of_solid(solid)
        segments = segments_of(path, start, end)
        known = np.isfinite(start).all(axis=1) & np.isfinite(end).all(axis=1)
        for parts, moves in tools:
            checked |= moves & known
            for part in parts:
                names.append(part.name)
                tag = number + len(solids) * (len(names) - 1)
                _measure(path, tree, segments, part, moves, solid.mesh.role == "workpiece", best, tag)
    return _by_line(path, best, names, setup, solids, checked)


def _measure(
    path: Toolpath,
    tree: Tree,
    segments: Segments,
    part: Part,
    moves: Mask,
    workpiece: bool,
    best: Best,
    tag: int,
) -> None:
    """One part of a tool against one mesh, on the moves with that tool."""
    if not (workpiece and part.cuts):
        mine = segments.of_moves(moves)
        search(tree, mine.swept(part), mine.move, best, tag)
        return
    rapid = path.kind == Kind.RAPID
    beside = np.zeros(len(path), bool)
    beside[1:] |= ~rapid[:-1]
    beside[:-1] |= ~rapid[1:]
    mine = segments.of_moves(moves & rapid & ~beside)
    search(tree, mine.swept(part), mine.move, best, tag)
    mine = segments.of_moves(moves & rapid & beside)
    touch = Best.of(len(path), 2 * CONTACT_MM)
    search(tree, mine.swept(part.shrunk(SLACK_MM)), mine.move, touch, tag)
    hit = np.flatnonzero((touch.tag == tag) & (best.distance_mm > 0.0))
    for mine_, theirs in (
        (best.distance_mm, touch.distance_mm), (best.point_mm, touch.point_mm), (best.away, touch.away),
        (best.triangle, touch.triangle), (best.tag, touch.tag),
    ):  # fmt: skip
        mine_[hit] = theirs[hit]


def _tools(path: Toolpath, setup: Setup) -> list[tuple[tuple[Part, ...], Mask]]:
    """The tools of a path with the moves of each; tools without length are left out."""
    by_tool: dict[int, list[int]] = {}
    for number, frame in enumerate(path.frames):
        if frame.tool is not None:
            by_tool.setdefault(frame.tool, []).append(number)
    result = []
    for tool, frames in by_tool.items():
        described = setup.tool(tool)
        parts = parts_of(described) if described is not None else ()
        if parts:
            result.append((parts, np.isin(path.frame, frames)))
    return result


@dataclass(frozen=True, slots=True, eq=False)
class _Tips:
    """Where the tip really is, relative to the workpiece: (n, 3) at the start and the end of each move, in
    axis positions; and the offsets of each move into the coordinates of meshes."""

    start: Array
    end: Array
    in_program: Array
    in_machine: Array
    carried: Mask

    @staticmethod
    def of(path: Toolpath, model: ErrorModel, setup: Setup) -> _Tips:
        play = plays(model, path.end_mm) if len(path) else None
        end = path.end_mm + model.error(path.end_mm, path.tool_mm(), play)
        origin = np.array(path.start_mm)[None]
        start = np.concatenate((origin + model.error(origin, path.tools_mm()[:1][0]), end[:-1]))
        frames = path.frames
        shift = zero_shifts(frames, model)
        length = np.array([f.length_mm for f in frames]).reshape(-1, 3)
        chain = setup.machine.chain
        carried = np.array([chain.index(axis) < chain.index("F") for axis in "XYZ"])
        return _Tips(start, end, (-shift - length)[path.frame], path.tools_mm()[path.frame, :3], carried)

    def of_solid(self, solid: Solid) -> tuple[Array, Array]:
        """(n, 3) the tip at start and end of each move, in the coordinates of a mesh."""
        start, end = self.start, self.end
        if solid.mesh.frame != "machine":
            return start + self.in_program, end + self.in_program
        if solid.mesh.role == "machine":
            # positions of axes that carry the workpiece do not matter here
            start, end = (np.where(self.carried, 0.0, p) for p in (start, end))
        return start + self.in_machine, end + self.in_machine


def _placed(solid: Solid, setup: Setup) -> Array:
    """(m, 3, 3) triangles in axis positions."""
    offset = solid.offset(setup)
    if offset is None:
        return solid.triangle
    return np.asarray(
        solid.triangle @ rotation_matrix(offset.rotation_deg).T + np.array(offset.offset_mm), float
    )


def _by_line(
    path: Toolpath, best: Best, names: list[str], setup: Setup, solids: Sequence[Solid], checked: Mask
) -> Clearances:
    """The least clearance of the moves of each line."""
    distance = best.distance_mm.copy()
    distance[path.arcs.move] -= CHORD_MM
    distance[distance <= CONTACT_MM] = 0.0
    measured = np.flatnonzero(best.tag >= 0)
    order = measured[np.lexsort((distance[measured], path.line[measured]))]
    first = order[np.flatnonzero(np.diff(path.line[order], prepend=-1))]
    solid, part = best.tag[first] % max(len(solids), 1), best.tag[first] // max(len(solids), 1)
    point = best.point_mm[first].copy()
    for number, each in enumerate(solids):
        offset = each.offset(setup)
        if offset is not None:
            rows = solid == number
            point[rows] = (point[rows] - np.array(offset.offset_mm)) @ rotation_matrix(offset.rotation_deg)
    labels = tuple(dict.fromkeys(names))
    index = np.array([labels.index(name) for name in names] or [0])
    moving = (path.flag & np.uint8(Flag.CONTROL)) == 0
    unknown = distinct(path.line[moving & ~checked]).tolist() if solids else []
    return Clearances(
        path.line[first].astype(np.int64), distance[first], point, index[part], solid, labels, tuple(solids),
        tuple(int(line) for line in unknown),
    )  # fmt: skip
