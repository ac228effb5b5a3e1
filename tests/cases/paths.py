"""Toolpaths, programs and error models in a few words, and a slow judge of how far the tip is off."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.geometry import PLANES
from olp.core.toolpath import Arcs, Flag, Frame, Kind, Toolpath
from olp.program.dialect import Dialect
from olp.program.holes import Hole, Holes
from olp.program.program import ArcSlots, Program
from olp.program.registry import DIALECTS

NAN = float("nan")
#: of `Known`: what each mm of a tool vector adds to the error
PER_TOOL_MM = 1e-5


@dataclass(frozen=True)
class Move:
    kind: Kind
    end: tuple[float, ...]
    flag: int = 0
    frame: int = 0
    line: int | None = None
    centre: tuple[float, ...] | None = None
    sweep: float = 0.0
    plane: int = 0


def rapid(*end: float, **more: Any) -> Move:
    return Move(Kind.RAPID, end, **more)


def line(*end: float, **more: Any) -> Move:
    return Move(Kind.LINE, end, **more)


def arc(*end: float, centre: tuple[float, ...], sweep: float, **more: Any) -> Move:
    kind = Kind.ARC_CW if sweep < 0 else Kind.ARC_CCW
    return Move(kind, end, centre=centre, sweep=sweep, **more)


def toolpath(
    *moves: Move, start: tuple[float, float, float] = (0.0, 0.0, 0.0), frames: Sequence[Frame] = (Frame(),)
) -> Toolpath:
    """The lines are those of the moves, from 1 on, unless they say another one."""
    turned = [k for k, move in enumerate(moves) if move.centre is not None]
    return Toolpath(
        np.array([m.kind for m in moves], np.uint8),
        np.array([m.flag for m in moves], np.uint8),
        np.array([k + 1 if m.line is None else m.line for k, m in enumerate(moves)], np.int32),
        np.array([m.frame for m in moves], np.int32),
        np.array([m.end for m in moves], float).reshape(-1, 3),
        tuple(frames),
        Arcs(
            np.array(turned, np.int64), np.array([moves[k].centre for k in turned], float).reshape(-1, 3),
            np.array([moves[k].plane for k in turned], np.int8), np.array([moves[k].sweep for k in turned]),
        ),
        start,
    )  # fmt: skip


def hole(first: int, last: int, *, plane: int = 0, r: float, z: float, **more: Any) -> Hole:
    """A hole of the moves `first`..`last`, with what only its text says left out."""
    place = more.pop("place", (0.0, 0.0))
    return Hole(0, first, last, {}, -1, -1, plane, place, r, z, r, False, 0, 1, 0, 81, **more)


def columns(*holes: Hole) -> Holes:
    """Holes in columns."""
    if not holes:
        return Holes.none()
    none = np.full(len(holes), -1, np.int32)
    rests = [(k, *rest) for k, hole in enumerate(holes) for rest in hole.rests]
    of, after, seconds = np.array(rests, float).reshape(-1, 3).T
    own = {
        f.name: np.array([getattr(hole, f.name) for hole in holes])
        for f in fields(Holes)
        if f.name not in ("word", "rest_hole", "rest_after", "rest_s")
    }
    word = np.tile(none[:, None], (1, 4))
    return Holes(
        **own, word=word, rest_hole=of.astype(np.int64), rest_after=after.astype(np.int64), rest_s=seconds
    )


def program(path: Toolpath, *holes: Hole, dialect: Dialect = DIALECTS["linuxcnc"]) -> Program:
    """A program of a path without a text."""
    none = np.zeros(0, np.int32)
    slots = ArcSlots(np.zeros((0, 5), np.int32), np.zeros(0, bool))
    return Program(
        b"", dialect, path, None, np.full((len(path), 3), -1), slots, none, none, holes=columns(*holes)
    )


def drawn(seed: int, count: int = 9) -> tuple[Toolpath, Toolpath, list[int]]:
    """A path of lines, arcs and rapids, one whose moves are split and a little off, and its groups."""
    rng = np.random.default_rng(seed)
    tools = tuple(Frame(tool_mm=tuple(rng.uniform(-300, 300, 3).tolist())) for _ in range(3))
    mine: list[Move] = [rapid(0, 0, 0)]
    theirs: list[Move] = [rapid(0, 0, 0)]
    groups = [0]
    here, frame = np.zeros(3), 0
    for _ in range(count):
        kind = rng.choice(["rapid", "line", "line", "arc"])
        frame = int(rng.integers(3)) if kind == "rapid" else frame
        parts = 1 if kind == "rapid" or rng.random() < 0.5 else 3
        off = rng.uniform(-0.004, 0.004, (parts, 3)) * (np.arange(parts) < parts - 1)[:, None]
        if kind == "arc":
            plane, sweep = int(rng.integers(3)), float(rng.choice([-1, 1]) * rng.uniform(0.4, 5.0))
            first, second, third = ((0, 1, 2), (2, 0, 1), (1, 2, 0))[plane]
            arm = rng.uniform(5, 20, 2)
            centre = here.copy()
            centre[[first, second]] -= arm
            rise = rng.uniform(-4, 4)
            ends = []
            for share in np.arange(1, parts + 1) / parts:
                end = here + rise * share * np.eye(3)[third]
                c, s = math.cos(share * sweep), math.sin(share * sweep)
                turned = c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]
                end[[first, second]] = centre[[first, second]] + turned
                ends.append(end)
            mine.append(arc(*ends[-1], centre=tuple(centre), sweep=sweep, plane=plane, frame=frame))
            theirs += [
                arc(*end, centre=tuple(centre), sweep=sweep / parts, plane=plane, frame=frame) for end in ends
            ]
            here = ends[-1]
        else:
            there = rng.uniform(-60, 60, 3)
            move = rapid if kind == "rapid" else line
            mine.append(move(*there, frame=frame))
            shares = np.arange(1, parts + 1)[:, None] / parts
            theirs += [move(*end, frame=frame) for end in here + shares * (there - here) + off]
            here = there
        groups.append(groups[-1] + parts)
    return toolpath(*mine, frames=tools), toolpath(*theirs, frames=tools), groups


# -- models ----------------------------------------------------------------------------------------------


def exact(axis_mm: Array) -> Array:
    return np.zeros(axis_mm.shape)


@dataclass(eq=False)
class Known:
    """A model with the error `of` positions, and more by tool and play. Along a line the second derivative
    of the error by the length is at most `curvature`, in 1/mm. `asked` are the positions and tools asked
    for."""

    of: Callable[[Array], Array] = exact
    curvature: float = 0.0
    backlash_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    box_mm: Array = field(default_factory=lambda: np.tile([-100.0, 100.0], (3, 1)))
    asked: list[tuple[Array, Array]] = field(default_factory=list)

    def error(self, axis_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
        assert tool_mm.shape in ((3,), axis_mm.shape)
        self.asked.append((axis_mm.copy(), tool_mm.copy()))
        error = self.of(axis_mm) + PER_TOOL_MM * tool_mm
        return error if play is None else error - np.array(self.backlash_mm) / 2 * play

    def backlash_at(self, axis_mm: Array) -> Array | None:
        return np.tile(self.backlash_mm, (len(axis_mm), 1)) if any(self.backlash_mm) else None

    def chord_bound(self, delta_mm: Array, tool_mm: Array) -> Array:
        assert delta_mm.shape[1] == 3
        assert tool_mm.shape in ((3,), delta_mm.shape)
        return self.curvature * (delta_mm**2).sum(axis=1) / 8


def wave(component: int, of_axis: int, size: float, length: float, phase: float = 0.0) -> Known:
    """A sine of one axis' position, of so many mm."""
    rate = 2 * np.pi / length

    def of(axis_mm: Array) -> Array:
        error = np.zeros(axis_mm.shape)
        error[:, component] = size * np.sin(rate * axis_mm[:, of_axis] + phase)
        return error

    return Known(of, size * rate**2)


# -- the judge -------------------------------------------------------------------------------------------


def points_of(path: Toolpath, shift: Array, i: int, count: int) -> Array:
    """(m, 3) points of a move, its start first, all moved by `shift`: `count` of them at equal steps, and
    more of a straight one near its start, where backlash is taken up, and where an axis turns round."""
    start = np.array(path.start_mm) if i == 0 else path.end_mm[i - 1]
    end, share = path.end_mm[i], np.linspace(0.0, 1.0, count + 1)
    if i not in path.arcs.move:
        share = np.union1d(share, np.geomspace(1e-5, 1.0, count))
    for k in np.flatnonzero(path.arcs.move == i):
        first, second, _ = PLANES[path.arcs.plane[k]]
        arm = start - path.arcs.centre_mm[k]
        quarters = np.arange(-8, 9) * np.pi / 2 - np.arctan2(arm[second], arm[first])
        turns = quarters / path.arcs.sweep_rad[k]
        share = np.union1d(share, turns[(turns > 0) & (turns < 1)])
    share = share[:, None]
    points = start + share * (end - start)
    for k in np.flatnonzero(path.arcs.move == i):
        first, second, _ = PLANES[path.arcs.plane[k]]
        pair = [first, second]
        begin, stop = (some[pair] - path.arcs.centre_mm[k, pair] for some in (start, end))
        radius = np.linalg.norm(begin) + share[:, 0] * (np.linalg.norm(stop) - np.linalg.norm(begin))
        angle = np.arctan2(begin[1], begin[0]) + share[:, 0] * path.arcs.sweep_rad[k]
        points[:, pair] = path.arcs.centre_mm[k, pair]
        points[:, first] += radius * np.cos(angle)
        points[:, second] += radius * np.sin(angle)
    return points + shift


def tips(path: Toolpath, model: Known, count: int) -> Iterator[Array]:
    """(count + 1, 3) for each move: where the tip is along it. With backlash, how far each axis lags behind
    its command is followed point by point; at the end of the first move it is not known."""
    half = np.array(model.backlash_mm) / 2
    least, most = -half, half
    reached = np.zeros(3)
    table = path.tool_mm()
    for i in range(len(path)):
        points = points_of(path, np.zeros(3), i, count if i or not half.any() else 1)
        lag = np.zeros(points.shape)
        for k in range(len(points)):
            if i and k:
                moved = points[k] - points[k - 1]
                least, most = np.clip(least - moved, -half, half), np.clip(most - moved, -half, half)
            lag[k] = (least + most) / 2
        tip = points + model.of(points) + PER_TOOL_MM * (table if table.ndim == 1 else table[i]) + lag
        # a move begins where the one before it ended, whatever the tool
        tip[0] = tip[0] if i == 0 else reached
        reached = tip[-1]
        yield tip


def farthest(
    nominal: Toolpath, shift: Array, path: Toolpath, groups: Index, model: Known, count: int = 60
) -> Array:
    """(n,) how far the tip is from each nominal move, moved by `shift`: along it where it cuts, from where
    the moves before left it, and of a rapid at the ends of its parts."""
    result = np.zeros(len(nominal))
    tip = list(tips(path, model, count))
    first = 0
    for i, last in enumerate(groups.tolist()):
        mine = tip[first : last + 1]
        if nominal.kind[i] == Kind.RAPID:
            mine = [part[-1:] for part in mine]
        # a step between two moves is met at its ends
        line = points_of(nominal, shift, i, 1500 if i in nominal.arcs.move else 1)
        if mine:
            result[i] = max(_from_line(part, line).max() for part in mine)
        else:
            result[i] = np.linalg.norm(tip[last][-1] - line[-1])
        result[i] = max(result[i], np.linalg.norm(tip[last][-1] - line[-1]))
        first = last + 1
    return result


def _from_line(points: Array, line: Array) -> Array:
    """(m,) distances of points from a line of pieces."""
    begin, along = line[:-1], np.diff(line, axis=0)
    share = (points @ along.T - (begin * along).sum(axis=1)) / np.maximum((along**2).sum(axis=1), 1e-30)
    near = begin + np.clip(share, 0.0, 1.0)[..., None] * along
    return np.asarray(np.sqrt(((near - points[:, None]) ** 2).sum(axis=2).min(axis=1)))


PASS, CYCLE, WHOLE = int(Flag.PASS), int(Flag.CYCLE), int(Flag.WHOLE)
CONTROL, OF_MACHINE = int(Flag.CONTROL), int(Flag.MACHINE)
