"""From a program to routes: moves become waypoints, arcs chords, path modes tolerances.

A route never leaves the programmed path by more than the path mode allows: chords take a tenth of that, the
rounding of their corners the rest.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.geometry import PLANES, arc_points
from olp.core.machine import ControlTimes, Machine
from olp.core.toolpath import BLEND_MM, Toolpath
from olp.core.values import dataclass
from olp.program.feeds.actions import actions
from olp.program.feeds.moves import lengths_mm
from olp.program.feeds.timing import PathControl, Timing, timing
from olp.program.program import Program
from olp.trajectory.route import AxisLimits, Route

#: Share of a path tolerance that the chords of arcs may take.
CHORD_SHARE = 0.1
#: Path tolerance in arcs, and at joints without a corner, where a program asks for the exact path.
EXACT_MM = 0.001
#: A joint of at most this angle has no corner.
TANGENT_RAD = 1e-3
#: Shorter moves are left out.
SHORTEST_MM = 1e-9
#: Chords are made for at least this path tolerance.
_FINEST_MM = 1e-5
#: The largest turn of one chord, whatever the tolerance, so that an arc keeps its shape.
_LARGEST_TURN = np.pi / 8


def axis_limits(machine: Machine) -> AxisLimits:
    """The limits of X, Y and Z that the machine file states. Raises ConfigError where it leaves one out."""
    stated = machine.motion_limits()
    velocity, acceleration, jerk = np.array([stated[name] for name in "XYZ"]).T
    return AxisLimits(velocity=velocity, acceleration=acceleration, jerk=jerk)


def routes(
    program: Program,
    *,
    blend_mm: float = BLEND_MM,
    block_delete: bool = False,
    times: ControlTimes | None = None,
) -> tuple[Route, ...]:
    """The routes of a program that was read with its words, in order; nominal or corrected.

    A new route begins wherever the position is not known (tool changes, G28, after a probe). Dwells at such
    positions count at the start of the next route, and so do the `times` of what the control does beside
    motion. `blend_mm` is the tolerance of a path mode without one.
    Raises as `olp.program.feeds.timing.timing`.
    """
    path = program.toolpath
    clock = clock_of(program, blend_mm=blend_mm, block_delete=block_delete, times=times)
    if not len(path):
        return ()
    steps = Steps.of(path, clock)
    tolerance = _tolerances(path, clock, steps)
    return _cut(path, clock, steps, tolerance)


def clock_of(program: Program, *, blend_mm: float, block_delete: bool, times: ControlTimes | None) -> Timing:
    """The timing of a program, with the `times` of what the control does beside motion as dwells. Raises as
    `routes`."""
    clock = timing(program, blend_mm=blend_mm, block_delete=block_delete)
    waits = None if times is None else actions(program, block_delete=block_delete)
    if times is None or waits is None or not len(program.toolpath):
        return clock
    wait = waits.waits(program.toolpath.line.astype(np.int64), times)
    return replace(clock, rest=clock.rest | (wait > 0.0), dwell_s=clock.dwell_s + wait)


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """Waypoints and the moves between them, without moves of no length.

    Of m waypoints: `waypoint` (m,) index of the point of the path, `rest` and `dwell_s` (m,). Of the m - 1
    steps between them: `move` (m - 1,), and whether it is `driven` (both ends are known). `arc` (m - 1,) is
    the arc's index, -1 for lines.
    """

    waypoint: Index
    rest: Mask
    dwell_s: Array
    move: Index
    driven: Mask
    arc: Index

    @staticmethod
    def of(path: Toolpath, clock: Timing) -> Steps:
        length = lengths_mm(path)
        # NaN compares as false: a move from or to an unknown point is a step that is not driven
        move = np.flatnonzero(~(length <= SHORTEST_MM))
        waypoint = np.concatenate(([0], move + 1))
        owner = np.zeros(len(path) + 1, np.int64)
        owner[move + 1] = 1
        owner = np.cumsum(owner)
        rest = np.bincount(owner, weights=clock.rest) > 0
        dwell = np.bincount(owner, weights=clock.dwell_s).astype(np.float64)
        arc = np.full(len(path), -1, np.int64)
        arc[path.arcs.move] = np.arange(len(path.arcs))
        return Steps(waypoint, rest | (dwell > 0), dwell, move, np.isfinite(length[move]), arc[move])


def _tolerances(path: Toolpath, clock: Timing, steps: Steps) -> Array:
    """(m,) how far from each waypoint the path may pass: what both moves allow; 0 at a rest."""
    tolerance = np.zeros(len(steps.waypoint))
    control = clock.control[steps.move]
    own = clock.blend_mm[steps.move]
    own[steps.arc >= 0] *= 1.0 - CHORD_SHARE
    exact = control == PathControl.EXACT_PATH
    own[exact] = EXACT_MM
    own[control == PathControl.EXACT_STOP] = 0.0
    tolerance[1:-1] = np.minimum(own[:-1], own[1:])
    if exact.any():
        beside = np.flatnonzero(exact[:-1] | exact[1:])
        tolerance[beside + 1] *= _smooth(path, steps, beside)
    tolerance[steps.rest] = 0.0
    return tolerance


def _smooth(path: Toolpath, steps: Steps, before: Index) -> Mask:
    """Whether the joints between steps `before` and the next ones have no corner."""
    leave = directions(path, steps, before, 1.0)
    begin = directions(path, steps, before + 1, 0.0)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(((begin - leave) ** 2).sum(axis=1)) <= TANGENT_RAD)


def directions(path: Toolpath, steps: Steps, step: Index, share: float) -> Array:
    """(k, 3) unit tangents of steps at their start (share 0) or end (1)."""
    move, arc = steps.move[step], steps.arc[step]
    start = path.starts_mm()[move]
    direction = path.end_mm[move] - start
    curved = np.flatnonzero(arc >= 0)
    if len(curved):
        arcs, picked = path.arcs, arc[curved]
        rows = np.arange(len(curved))
        axes = np.array(PLANES)[arcs.plane[picked]]
        first, second, third = axes[:, 0], axes[:, 1], axes[:, 2]
        centre, sweep = arcs.centre_mm[picked], arcs.sweep_rad[picked]
        point = path.end_mm[move[curved]] if share else start[curved]
        r0, r1 = point[rows, first] - centre[rows, first], point[rows, second] - centre[rows, second]
        rise = direction[curved, third]
        tangent = np.zeros((len(curved), 3))
        tangent[rows, first], tangent[rows, second] = -r1 * sweep, r0 * sweep
        tangent[rows, third] = rise
        direction[curved] = tangent
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(direction / np.sqrt((direction * direction).sum(axis=1))[:, None], float)


def _chords(path: Toolpath, clock: Timing, steps: Steps) -> Index:
    """(m - 1,) how many chords each step has."""
    count = np.ones(len(steps.move), np.int64)
    step = np.flatnonzero((steps.arc >= 0) & steps.driven)
    if not len(step):
        return count
    arcs, picked, move = path.arcs, steps.arc[step], steps.move[step]
    rows = np.arange(len(step))
    axes = np.array(PLANES)[arcs.plane[picked]]
    start = path.starts_mm()[move]
    away = [path.end_mm[move][rows, axes[:, i]] - arcs.centre_mm[picked][rows, axes[:, i]] for i in (0, 1)]
    begin = [start[rows, axes[:, i]] - arcs.centre_mm[picked][rows, axes[:, i]] for i in (0, 1)]
    radius = np.maximum(np.hypot(*away), np.hypot(*begin))
    sagitta = CHORD_SHARE * _inside(clock, move)
    turn = np.minimum(4.0 * np.arcsin(np.sqrt(np.minimum(0.5 * sagitta / radius, 0.5))), _LARGEST_TURN)
    count[step] = np.maximum(np.ceil(np.abs(arcs.sweep_rad[picked]) / turn - 1e-9), 1).astype(np.int64)
    return count


def _inside(clock: Timing, move: Index) -> Array:
    """Path tolerance along moves, chords included."""
    blend = clock.control[move] == PathControl.BLEND
    return np.where(blend, np.maximum(clock.blend_mm[move], _FINEST_MM), EXACT_MM)


def _cut(path: Toolpath, clock: Timing, steps: Steps, tolerance: Array) -> tuple[Route, ...]:
    """The routes: chords of all steps at once, then one slice per run of driven steps."""
    count = np.where(steps.driven, _chords(path, clock, steps), 1)
    last = np.concatenate(([0], np.cumsum(count)))
    size = int(last[-1])
    step = np.repeat(np.arange(len(count)), count)
    point = np.empty((size + 1, 3))
    margin = np.empty(size + 1)
    point[last[0]] = path.start_mm
    point[1:] = path.end_mm[steps.move[step]]
    margin[last] = tolerance
    inner = np.ones(size + 1, bool)
    inner[last] = False
    added = np.flatnonzero(inner)
    if len(added):
        mine = step[added - 1]
        move, arc = steps.move[mine], steps.arc[mine]
        margin[added] = (1.0 - CHORD_SHARE) * _inside(clock, move)
        point[added] = arc_points(
            path.starts_mm()[move],
            path.end_mm[move],
            path.arcs.centre_mm[arc],
            path.arcs.plane[arc],
            path.arcs.sweep_rad[arc],
            (added - last[mine]) / count[mine],
        )
    feed = clock.feed_mm_s[steps.move]
    line = path.line[steps.move].astype(np.int64)
    dwell = np.zeros(size + 1)
    dwell[last] = steps.dwell_s
    result = []
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
        result.append(Route(point[a:b], feed[step[a : b - 1]], line[step[a : b - 1]], margin[a:b], wait))
    if result:
        result[-1].dwell_s[-1] += float(steps.dwell_s[end:].sum())
    return tuple(result)
