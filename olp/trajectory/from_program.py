"""From a program to what is driven: moves to way-points, arcs to chords, path modes to tolerances.

A route never plans to leave the programmed path by more than the path mode allows: chords take a tenth of it,
the rounding of their corners the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import PLANES, arc_points
from olp.core.machine import Machine
from olp.core.toolpath import Toolpath
from olp.program.feeds.moves import lengths_mm
from olp.program.feeds.timing import BLEND_MM, PathControl, Timing, timing
from olp.program.program import Program
from olp.trajectory.route import AxisLimits, Route

#: What chords of arcs may take of a tolerance.
CHORD_SHARE = 0.1
#: Tolerance inside arcs, and at joints without a corner, where a program asks for the exact path.
EXACT_MM = 0.001
#: A joint of at most this angle has no corner.
TANGENT_RAD = 1e-3
#: Moves that are shorter are none.
SHORTEST_MM = 1e-9
#: Chords are not made for tolerances below this one.
_FINEST_MM = 1e-5
#: The largest turn of one chord, whatever its tolerance: an arc keeps its shape.
_LARGEST_TURN = np.pi / 8


def axis_limits(machine: Machine) -> AxisLimits:
    """The limits of X, Y and Z that the machine file states."""
    axes = [machine.axes[name] for name in "XYZ"]
    return AxisLimits(
        velocity=np.array([a.velocity_mm_s for a in axes]),
        acceleration=np.array([a.acceleration_mm_s2 for a in axes]),
        jerk=np.array([a.jerk_mm_s3 for a in axes]),
    )


def routes(program: Program, *, blend_mm: float = BLEND_MM, block_delete: bool = False) -> tuple[Route, ...]:
    """What a program that was read with its words drives, in order; nominal and corrected alike.

    A new route begins wherever the position is not known (tool changes, G28, after a probe). Dwells at such
    places count at the start of the next route. `blend_mm` is the tolerance of a path mode that states none.
    Raises as `olp.program.feeds.timing.timing`.
    """
    path = program.toolpath
    clock = timing(program, blend_mm=blend_mm, block_delete=block_delete)
    if not len(path):
        return ()
    steps = _Steps.of(path, clock)
    tolerance = _tolerances(path, clock, steps)
    return _cut(path, clock, steps, tolerance)


@dataclass(frozen=True, slots=True, eq=False)
class _Steps:
    """Way-points and the moves between them, moves without a length left out.

    Of m places: `place` (m,) index of the point of the path, `rest` and `dwell_s` (m,). Of the m - 1 ways
    between them: `move` (m - 1,), and whether it is `driven`, both ends being known. `arc` (m - 1,) is the
    arc's index, -1 for lines.
    """

    place: Index
    rest: Mask
    dwell_s: Array
    move: Index
    driven: Mask
    arc: Index

    @staticmethod
    def of(path: Toolpath, clock: Timing) -> _Steps:
        length = lengths_mm(path)
        # NaN compares as false: an unknown end is a way, but none that is driven
        move = np.flatnonzero(~(length <= SHORTEST_MM))
        place = np.concatenate(([0], move + 1))
        owner = np.zeros(len(path) + 1, np.int64)
        owner[move + 1] = 1
        owner = np.cumsum(owner)
        rest = np.bincount(owner, weights=clock.rest) > 0
        dwell = np.bincount(owner, weights=clock.dwell_s).astype(np.float64)
        arc = np.full(len(path), -1, np.int64)
        arc[path.arcs.move] = np.arange(len(path.arcs))
        return _Steps(place, rest | (dwell > 0), dwell, move, np.isfinite(length[move]), arc[move])


def _tolerances(path: Toolpath, clock: Timing, steps: _Steps) -> Array:
    """(m,) how far from each place the path may pass: what the moves on both sides allow, 0 for a rest."""
    out = np.zeros(len(steps.place))
    control = clock.control[steps.move]
    own = clock.blend_mm[steps.move]
    own[steps.arc >= 0] *= 1.0 - CHORD_SHARE
    exact = control == PathControl.EXACT_PATH
    own[exact] = EXACT_MM
    own[control == PathControl.EXACT_STOP] = 0.0
    out[1:-1] = np.minimum(own[:-1], own[1:])
    if exact.any():
        beside = np.flatnonzero(exact[:-1] | exact[1:])
        out[beside + 1] *= _smooth(path, steps, beside)
    out[steps.rest] = 0.0
    return out


def _smooth(path: Toolpath, steps: _Steps, before: Index) -> Mask:
    """Whether the joints between ways `before` and the next ones have no corner."""
    leave = _directions(path, steps, before, 1.0)
    begin = _directions(path, steps, before + 1, 0.0)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(((begin - leave) ** 2).sum(axis=1)) <= TANGENT_RAD)


def _directions(path: Toolpath, steps: _Steps, way: Index, share: float) -> Array:
    """(k, 3) unit tangents of ways at their start (share 0) or end (1)."""
    move, arc = steps.move[way], steps.arc[way]
    start = path.starts_mm()[move]
    out = path.end_mm[move] - start
    curved = np.flatnonzero(arc >= 0)
    if len(curved):
        arcs, picked = path.arcs, arc[curved]
        rows = np.arange(len(curved))
        axes = np.array(PLANES)[arcs.plane[picked]]
        first, second, third = axes[:, 0], axes[:, 1], axes[:, 2]
        centre, sweep = arcs.centre_mm[picked], arcs.sweep_rad[picked]
        at = path.end_mm[move[curved]] if share else start[curved]
        r0, r1 = at[rows, first] - centre[rows, first], at[rows, second] - centre[rows, second]
        rise = out[curved, third]
        tangent = np.zeros((len(curved), 3))
        tangent[rows, first], tangent[rows, second] = -r1 * sweep, r0 * sweep
        tangent[rows, third] = rise
        out[curved] = tangent
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(out / np.sqrt((out * out).sum(axis=1))[:, None], float)


def _chords(path: Toolpath, clock: Timing, steps: _Steps) -> Index:
    """(m - 1,) into how many chords each way goes."""
    count = np.ones(len(steps.move), np.int64)
    way = np.flatnonzero((steps.arc >= 0) & steps.driven)
    if not len(way):
        return count
    arcs, picked, move = path.arcs, steps.arc[way], steps.move[way]
    rows = np.arange(len(way))
    axes = np.array(PLANES)[arcs.plane[picked]]
    start = path.starts_mm()[move]
    away = [path.end_mm[move][rows, axes[:, i]] - arcs.centre_mm[picked][rows, axes[:, i]] for i in (0, 1)]
    begin = [start[rows, axes[:, i]] - arcs.centre_mm[picked][rows, axes[:, i]] for i in (0, 1)]
    radius = np.maximum(np.hypot(*away), np.hypot(*begin))
    sagitta = CHORD_SHARE * _inside(clock, move)
    turn = np.minimum(4.0 * np.arcsin(np.sqrt(np.minimum(0.5 * sagitta / radius, 0.5))), _LARGEST_TURN)
    count[way] = np.maximum(np.ceil(np.abs(arcs.sweep_rad[picked]) / turn - 1e-9), 1).astype(np.int64)
    return count


def _inside(clock: Timing, move: Index) -> Array:
    """Tolerance along moves, chords included."""
    blend = clock.control[move] == PathControl.BLEND
    return np.where(blend, np.maximum(clock.blend_mm[move], _FINEST_MM), EXACT_MM)


def _cut(path: Toolpath, clock: Timing, steps: _Steps, tolerance: Array) -> tuple[Route, ...]:
    """The routes: chords laid out for all ways at once, then one slice a run of driven ways."""
    count = np.where(steps.driven, _chords(path, clock, steps), 1)
    last = np.concatenate(([0], np.cumsum(count)))
    size = int(last[-1])
    way = np.repeat(np.arange(len(count)), count)
    point = np.empty((size + 1, 3))
    margin = np.empty(size + 1)
    point[last[0]] = path.start_mm
    point[1:] = path.end_mm[steps.move[way]]
    margin[last] = tolerance
    inner = np.ones(size + 1, bool)
    inner[last] = False
    at = np.flatnonzero(inner)
    if len(at):
        mine = way[at - 1]
        move, arc = steps.move[mine], steps.arc[mine]
        margin[at] = (1.0 - CHORD_SHARE) * _inside(clock, move)
        point[at] = arc_points(
            path.starts_mm()[move],
            path.end_mm[move],
            path.arcs.centre_mm[arc],
            path.arcs.plane[arc],
            path.arcs.sweep_rad[arc],
            (at - last[mine]) / count[mine],
        )
    feed = clock.feed_mm_s[steps.move]
    line = path.line[steps.move].astype(np.int64)
    dwell = np.zeros(size + 1)
    dwell[last] = steps.dwell_s
    out = []
    edges = np.flatnonzero(np.diff(np.concatenate(([False], steps.driven, [False])).astype(np.int8)))
    waiting = 0.0
    end = 0
    for first, stop in zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True):
        waiting += float(steps.dwell_s[end:first].sum())
        a, b = int(last[first]), int(last[stop]) + 1
        margin[a] = margin[b - 1] = 0.0
        wait = dwell[a:b].copy()
        wait[0] += waiting
        waiting, end = 0.0, stop + 1
        out.append(Route(point[a:b], feed[way[a : b - 1]], line[way[a : b - 1]], margin[a:b], wait))
    if out:
        out[-1].dwell_s[-1] += float(steps.dwell_s[end:].sum())
    return tuple(out)
