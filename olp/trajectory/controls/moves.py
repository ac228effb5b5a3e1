"""The moves of a program as the planner of a control sees them: lengths, directions and curvature."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import PLANES, arc_points
from olp.core.machine import ControlTimes
from olp.core.toolpath import Toolpath
from olp.core.values import dataclass
from olp.program.feeds.timing import PathControl, Timing
from olp.program.program import Program
from olp.trajectory.controls.said import Said
from olp.trajectory.from_program import Steps, clock_of, directions


@dataclass(frozen=True, slots=True, eq=False)
class Moves:
    """A stretch of m moves, none of them without length.

    (m,) `length_mm`; `radius_mm`, inf for lines; `feed_mm_s`, inf for rapids; `line`; `own_mode`, a value of
    `PathControl`. (m, 3) `begin` and `leave`, the unit tangents at both ends; `most`, the largest share of
    each axis in the directions along the move. Of arcs, (m, 2, 3) `inward` from both ends to the centre,
    (m, 3) `normal` of their planes, and (m,) `sweep_rad`; 0 of lines.

    Of the m - 1 joints: `mode` is the stricter one of both sides, `blend_mm` the path tolerance, inf where
    only the moves limit it, and `rest` says whether the motion rests there. `dwell_s` is the time of all
    dwells. `said` has columns (m,) by name: what the program says to this control alone.
    """

    length_mm: Array
    radius_mm: Array
    feed_mm_s: Array
    line: Index
    begin: Array
    leave: Array
    most: Array
    inward: Array
    normal: Array
    sweep_rad: Array
    own_mode: npt.NDArray[np.uint8]
    mode: npt.NDArray[np.uint8]
    blend_mm: Array
    rest: Mask
    dwell_s: float
    said: Mapping[str, Array]

    def __len__(self) -> int:
        return len(self.length_mm)

    def least(self, limit: Array) -> Array:
        """(m,) what a limit (3,) of each axis allows along each move."""
        with np.errstate(divide="ignore"):
            return np.asarray((limit / self.most).min(axis=1))


def moves(
    program: Program, *, blend_mm: float, block_delete: bool = False, times: ControlTimes | None = None,
    override: float = 1.0, chord_mm: float | None = None, said: Said | None = None,
) -> tuple[Moves, ...]:  # fmt: skip
    """The stretches of a program, as `olp.trajectory.from_program.routes` has them.

    `blend_mm` is the path tolerance of a path mode without one, and may be inf; `override` is that of feeds.
    With `chord_mm` arcs are chords so far from them, as in controls that drive no arcs. `said` is
    what the program says to the control alone. Raises as `routes`.
    """
    path = program.toolpath
    clock = clock_of(program, blend_mm=blend_mm, block_delete=block_delete, times=times)
    if not len(path):
        return ()
    steps = Steps.of(path, clock)
    rows = np.arange(len(steps.move))
    begin, leave = directions(path, steps, rows, 0.0), directions(path, steps, rows, 1.0)
    length, radius, most = _shapes(path, steps, begin)
    inward, normal, sweep = _bends(path, steps)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], steps.driven, [False])).astype(np.int8)))
    result = []
    for first, stop in zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True):
        here = slice(first, stop)
        move = steps.move[here]
        mode, blend = _joints(clock, move)
        part = Moves(
            length[here], radius[here], clock.feed_mm_s[move] * override, path.line[move].astype(np.int64),
            begin[here], leave[here], most[here], inward[here], normal[here], sweep[here],
            clock.control[move], mode, blend, steps.rest[first + 1 : stop],
            float(steps.dwell_s[first : stop + 1].sum()),
            {} if said is None else said.columns(path.line[move].astype(np.int64)),
        )  # fmt: skip
        result.append(part if chord_mm is None else _in_chords(path, steps, part, first, chord_mm))
    return tuple(result)


def _joints(clock: Timing, move: Index) -> tuple[npt.NDArray[np.uint8], Array]:
    """The path mode and the path tolerance of the joints between moves: the stricter one of both sides."""
    control, blend = clock.control[move], clock.blend_mm[move]
    return np.maximum(control[:-1], control[1:]), np.minimum(blend[:-1], blend[1:])


def _shapes(path: Toolpath, steps: Steps, begin: Array) -> tuple[Array, Array, Array]:
    """(m,) lengths and radii, and (m, 3) the largest share of each axis along each move."""
    delta = path.end_mm[steps.move] - path.starts_mm()[steps.move]
    length, most = np.sqrt((delta * delta).sum(axis=1)), np.abs(begin)
    radius = np.full(len(length), np.inf)
    curved = np.flatnonzero((steps.arc >= 0) & steps.driven)
    if len(curved):
        arcs, picked, rows = path.arcs, steps.arc[curved], np.arange(len(curved))
        axes = np.array(PLANES)[arcs.plane[picked]]
        away = path.end_mm[steps.move[curved]] - arcs.centre_mm[picked]
        across = np.hypot(away[rows, axes[:, 0]], away[rows, axes[:, 1]])
        round_mm = across * np.abs(arcs.sweep_rad[picked])
        rise = np.abs(delta[curved][rows, axes[:, 2]])
        length[curved] = np.hypot(round_mm, rise)
        # a helix turns more slowly than the circle below it
        radius[curved] = across * (length[curved] / np.maximum(round_mm, 1e-300)) ** 2
        share = np.empty((len(curved), 3))
        share[rows[:, None], axes[:, :2]] = (round_mm / length[curved])[:, None]
        share[rows, axes[:, 2]] = rise / length[curved]
        most[curved] = share
    return length, radius, most


def _bends(path: Toolpath, steps: Steps) -> tuple[Array, Array, Array]:
    """(m, 2, 3) unit vectors from both ends of arcs to their centres, (m, 3) those across their planes, and
    (m,) how far they turn."""
    count = len(steps.move)
    inward, normal, sweep = np.zeros((count, 2, 3)), np.zeros((count, 3)), np.zeros(count)
    curved = np.flatnonzero((steps.arc >= 0) & steps.driven)
    if len(curved):
        arcs, picked, move = path.arcs, steps.arc[curved], steps.move[curved]
        third = np.array(PLANES)[arcs.plane[picked]][:, 2]
        for side, end in enumerate((path.starts_mm()[move], path.end_mm[move])):
            to = arcs.centre_mm[picked] - end
            to[np.arange(len(curved)), third] = 0.0
            inward[curved, side] = to / np.maximum(np.sqrt((to * to).sum(axis=1)), 1e-300)[:, None]
        normal[curved, third] = 1.0
        sweep[curved] = np.abs(arcs.sweep_rad[picked])
    return inward, normal, sweep


def _in_chords(path: Toolpath, steps: Steps, part: Moves, first: int, chord_mm: float) -> Moves:
    """The same moves with chords in place of arcs."""
    count = np.ones(len(part), np.int64)
    curved = np.flatnonzero(np.isfinite(part.radius_mm))
    if not len(curved):
        return part
    arc, move = steps.arc[first + curved], steps.move[first + curved]
    sweep = np.abs(path.arcs.sweep_rad[arc])
    turn = 4.0 * np.arcsin(np.sqrt(np.minimum(0.5 * chord_mm / part.radius_mm[curved], 0.5)))
    count[curved] = np.maximum(np.floor(sweep / turn), 1).astype(np.int64)
    owner = np.repeat(np.arange(len(part)), count)
    last = np.cumsum(count)
    ends = path.end_mm[steps.move[first : first + len(part)]]
    point = ends[owner]
    share = (np.arange(len(owner)) + 1 - np.repeat(last - count, count)) / count[owner]
    inner = np.flatnonzero((share < 1.0) & np.isfinite(part.radius_mm[owner]))
    of = np.searchsorted(curved, owner[inner])
    point[inner] = arc_points(
        path.starts_mm()[move[of]], path.end_mm[move[of]], path.arcs.centre_mm[arc[of]],
        path.arcs.plane[arc[of]], path.arcs.sweep_rad[arc[of]], share[inner],
    )  # fmt: skip
    start = path.starts_mm()[steps.move[first]]
    delta = np.diff(np.vstack((start, point)), axis=0)
    length = np.sqrt((delta * delta).sum(axis=1))
    unit = delta / np.maximum(length, 1e-300)[:, None]
    joint = owner[:-1]
    own = owner[1:] == joint
    at = np.minimum(joint, len(part) - 2)
    blends = part.mode.size > 0
    mode = np.where(own, np.uint8(PathControl.BLEND), part.mode[at] if blends else 0).astype(np.uint8)
    blend = np.where(own, np.inf, part.blend_mm[at] if blends else np.inf)
    rest = ~own & (part.rest[at] if blends else False)
    return Moves(
        length, np.full(len(length), np.inf), part.feed_mm_s[owner], part.line[owner], unit, unit,
        np.abs(unit), np.zeros((len(length), 2, 3)), np.zeros_like(unit), np.zeros(len(length)),
        part.own_mode[owner], mode, blend, rest, part.dwell_s,
        {name: column[owner] for name, column in part.said.items()},
    )  # fmt: skip
