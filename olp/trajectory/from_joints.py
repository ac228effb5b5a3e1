"""From a program of a machine with rotary joints to routes in all its axes.

The planner sees the axes as lengths: each counts by the largest way of the tip that it makes along the
program, so that a deviation in this space bounds that of the tip. Moves whose axes curve, as with tool centre
point control, become chords. The feed is that of the tip in the workpiece.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.compensation.joints.motion import Motion
from olp.compensation.joints.path import JointPath
from olp.compensation.joints.sampling import spread
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ConfigError
from olp.core.toolpath import Arcs, Flag, Kind
from olp.core.values import dataclass
from olp.kinematics.pose_axes import led_in_order, led_on
from olp.kinematics.structure import Structure
from olp.program.feeds.timing import PathControl, Timing, timing
from olp.trajectory.from_program import CHORD_SHARE, EXACT_MM, TANGENT_RAD
from olp.trajectory.route import AxisLimits, Route

#: An axis that moves the tip less counts as if it moved it so far: mm per mm, and mm per deg.
_LEAST_MM = 0.01
_LEAST_DEG = 0.1
#: Parts of a move at least at which its curve is looked at, and those of a chord at which its speed is.
_FEWEST = 4
_PARTS = 4
#: Places at which the ways of the tip are looked at, at most.
_PLACES = 2000
#: Chords of a move at most.
_MOST = 4096
#: Chords are made for at least this path tolerance, in mm.
_FINEST_MM = 1e-5
#: A move of which all axes go less is none: mm or deg.
_STILL = 1e-9
#: A way of the tip that is shorter, in mm, is none.
_SHORTEST_MM = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class JointRoute:
    """A route from rest to rest: `point_mm` of the route are axis values times `scale` (axes,), in mm per mm
    or deg. The route's lines number its segments: (m,) `line` of the program, `tool` in the motion, and
    `feed_mm_s` at the tip (inf: none). A segment ends at a `share` (m,) of its `move` (m,). The tip is off by
    at most `widest` times what the motion is off in this space."""

    route: Route
    scale: Array
    line: Index
    tool: Index
    feed_mm_s: Array
    move: Index
    share: Array
    widest: float

    def slower(self, factor: Array) -> JointRoute:
        """The same with the feeds of segments divided by (m,)."""
        route = self.route
        slowed = Route(
            route.point_mm, route.feed_mm_s / factor, route.line, route.tolerance_mm, route.dwell_s
        )
        return replace(self, route=slowed)


@dataclass(frozen=True, slots=True, eq=False)
class _Steps:
    """The moves that go somewhere: (m,) `move`, how they are led, and at the m + 1 points around them where
    the motion `rest`s and for how long."""

    move: Index
    blend_mm: Array
    exact: Mask
    stop: Mask
    rest: Mask
    dwell_s: Array


def missing_limits(structure: Structure) -> list[str]:
    """The keys of limits of motion that the machine file does not state."""
    words = ("velocity", "acceleration", "jerk")
    return [
        f"axes.{name}.{word}_{joint.unit}_s{'' if power == 1 else power}"
        for name, joint in structure.joints.items()
        for power, (word, value) in enumerate(zip(words, joint.most, strict=True), 1)
        if value is None
    ]


def limits_of(structure: Structure) -> AxisLimits:
    """The limits of all axes in mm and deg. Raises ConfigError where the machine file leaves one out."""
    missing = missing_limits(structure)
    if missing:
        raise ConfigError(
            f"the machine file does not state {', '.join(missing)}, which a motion in time needs; give them"
        )
    velocity, acceleration, jerk = np.array([joint.most for joint in structure.joints.values()], float).T
    return AxisLimits(velocity, acceleration, jerk)


def clock_of(path: JointPath, blend_mm: float, *, block_delete: bool = False) -> Timing:
    """Feeds, path tolerances and rests of a program; `blend_mm` is the tolerance of a path mode without one,
    and of lists, `block_delete` as in the reading. Raises ProgramError as
    `olp.program.feeds.timing.timing`."""
    if path.listed is not None:
        return _of_list(path, blend_mm)
    return _of_program(path, blend_mm, block_delete=block_delete)


def routes_of(
    path: JointPath, clock: Timing, tolerance: float = 1.0, feed: float = 1.0
) -> tuple[JointRoute, ...]:
    """The routes of a program, in order: a new one begins where the position is not known. Path tolerances
    and feeds of the clock count times these factors; rapids have no feed."""
    clock = replace(clock, blend_mm=tolerance * clock.blend_mm, feed_mm_s=feed * clock.feed_mm_s)
    known = np.isfinite(path.start).all(axis=1) & np.isfinite(path.end).all(axis=1)
    motion, moved = path.motion, np.zeros(len(path), bool)
    rows = np.flatnonzero(known)
    ends = [motion.axes(at[rows], path.tool[rows], path.tip[rows]) for at in (path.start, path.end)]
    moved[rows] = np.abs(ends[1] - ends[0]).max(axis=1, initial=0.0) > _STILL
    # a full circle ends where it began
    moved |= known & path.curves.mask
    routes = []
    edges = np.flatnonzero(np.diff(np.concatenate(([False], known, [False])).astype(np.int8)))
    for first, stop in zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True):
        steps = _steps(path, clock, moved, first, stop)
        if len(steps.move):
            routes.append(_route(path, clock, steps))
    return tuple(routes)


def _of_program(path: JointPath, blend_mm: float, *, block_delete: bool) -> Timing:
    """The timing of a program as if each move were 1 mm long, so that a time of a move (G93) is one over its
    feed, also where the rotary axes move alone."""
    toolpath = path.program.toolpath
    end = np.zeros((len(path), 3))
    end[:, 0] = np.arange(1.0, len(path) + 1.0)
    even = replace(toolpath, end_mm=end, start_mm=(0.0, 0.0, 0.0), arcs=Arcs.none())
    return timing(replace(path.program, toolpath=even), blend_mm=blend_mm, block_delete=block_delete)


def _of_list(path: JointPath, blend_mm: float) -> Timing:
    """Rows that are joined are blended, others are stops; none has a feed."""
    count, joined = len(path), path.listed is not None and path.listed.joined
    control = np.full(count, PathControl.BLEND if joined else PathControl.EXACT_STOP, np.uint8)
    none = np.zeros(count + 1)
    blend = np.full(count, blend_mm if joined else 0.0)
    return Timing(np.full(count, np.inf), control, blend, none > 0.0, none)


def _steps(path: JointPath, clock: Timing, moved: Mask, first: int, stop: int) -> _Steps:
    """The moves of a run whose positions are known; the rests of moves that stay count at the next point."""
    move = first + np.flatnonzero(moved[first:stop])
    point = np.searchsorted(move, np.arange(first, stop + 1))
    rest, dwell = np.zeros(len(move) + 1, bool), np.zeros(len(move) + 1)
    np.logical_or.at(rest, point, clock.rest[first : stop + 1])
    np.add.at(dwell, point, clock.dwell_s[first : stop + 1])
    control = clock.control[move]
    return _Steps(
        move, clock.blend_mm[move], control == PathControl.EXACT_PATH, control == PathControl.EXACT_STOP,
        rest | (dwell > 0.0), dwell,
    )  # fmt: skip


def _route(path: JointPath, clock: Timing, steps: _Steps) -> JointRoute:
    inside = np.where(steps.exact | steps.stop, EXACT_MM, np.maximum(steps.blend_mm, _FINEST_MM))
    count = _chords(path, steps.move, CHORD_SHARE * inside)
    owner, number = spread(count)
    move = steps.move[owner]
    share = (number + 1) / count[owner]
    axes = np.vstack((_axes(path, steps.move[:1], np.zeros(1)), _axes(path, move, share)))
    axes = led_in_order(path.motion.structure, axes)
    tool = path.tool[move]
    scale, widest = _scale(path.motion, axes, np.append(tool[:1], tool))
    point = axes * scale
    last = np.append(0, np.cumsum(count))
    tolerance = np.empty(len(point))
    tolerance[1:] = (1.0 - CHORD_SHARE) * inside[owner]
    tolerance[last] = _corners(steps, point, last)
    feed = _feeds(path, clock, steps, owner, point, share, count)
    dwell = np.zeros(len(point))
    dwell[last] = steps.dwell_s
    route = Route(point, feed, np.arange(len(feed)), tolerance / widest, dwell)
    stated = np.where(path.program.toolpath.kind[move] == Kind.RAPID, np.inf, clock.feed_mm_s[move])
    timed = (path.program.toolpath.flag[move] & np.uint8(Flag.INVERSE_TIME)) != 0
    line, feed = path.line[move].astype(np.int64), np.where(timed, np.inf, stated)
    return JointRoute(route, scale, line, tool, feed, move, share, widest)


def _axes(path: JointPath, move: Index, share: Array) -> Array:
    """(r, axes) axis values at shares of moves."""
    return path.motion.axes(path.at(move, share), path.tool[move], path.tip[move])


def _tips(path: JointPath, move: Index, axes: Array) -> Array:
    return path.motion.nominal(axes, path.tool[move]).position


def _chords(path: JointPath, move: Index, sagitta_mm: Array) -> Index:
    """(m,) into how many straight parts in the axes each move is cut, so that the tip is within (m,) mm, by
    how much short parts at its begin, its middle and its end bend."""
    few = np.maximum(path.curves.samples(move, 1.0), _FEWEST)
    away = np.zeros(len(move))
    for place in (0.0, 0.5, 1.0):
        begin = place * (1.0 - 1.0 / few)
        ends = [_axes(path, move, begin + part / few) for part in (0.0, 1.0)]
        middle = _axes(path, move, begin + 0.5 / few)
        straight = 0.5 * (ends[0] + led_on(path.motion.structure, ends[1], ends[0]))
        off = np.linalg.norm(_tips(path, move, straight) - _tips(path, move, middle), axis=1)
        away = np.maximum(away, off)
    # of a whole turn of an axis the ends alone tell nothing
    least = few if path.motion.structure.endless else np.ones(len(move))
    return np.asarray(np.clip(np.ceil(few * np.sqrt(away / sagitta_mm)), least, _MOST), np.int64)


def _scale(motion: Motion, axes: Array, tool: Index) -> tuple[Array, float]:
    """(axes,) the largest ways of the tip by axis, in mm per mm or deg, and by how much more the axes that
    move bring it together than a length in these."""
    some = np.unique(np.linspace(0, len(axes) - 1, min(len(axes), _PLACES)).astype(np.int64))
    rotary = np.array([unit == "deg" for unit in motion.structure.units])
    slopes = motion.slopes(axes[some], tool[some])[:, :3]
    slopes = np.where(rotary, np.radians(slopes), slopes) * (np.ptp(axes, axis=0) > _STILL)
    most = np.linalg.norm(slopes, axis=1).max(axis=0)
    scale = np.maximum(most, np.where(rotary, _LEAST_DEG, _LEAST_MM))
    return scale, max(float(np.linalg.norm(slopes / scale, ord=2, axis=(1, 2)).max()), 1.0)


def _corners(steps: _Steps, point: Array, last: Index) -> Array:
    """(m + 1,) how far the tip may pass from the ends of moves: what both allow, 0 at a rest."""
    own = np.where(steps.stop, 0.0, np.where(steps.exact, EXACT_MM, steps.blend_mm))
    tolerance = np.zeros(len(own) + 1)
    tolerance[1:-1] = np.minimum(own[:-1], own[1:])
    beside = np.flatnonzero(steps.exact[:-1] | steps.exact[1:])
    if beside.size:
        at = last[beside + 1]
        leave, begin = point[at] - point[at - 1], point[at + 1] - point[at]
        leave, begin = (way / np.linalg.norm(way, axis=1)[:, None] for way in (leave, begin))
        tolerance[beside + 1] *= np.linalg.norm(begin - leave, axis=1) <= TANGENT_RAD
    tolerance[steps.rest] = 0.0
    return tolerance


def _feeds(
    path: JointPath, clock: Timing, steps: _Steps, owner: Index, point: Array, share: Array, count: Index
) -> Array:
    """(k,) the largest speed of each chord in the space of the route: that at which the tip has its feed
    where it goes farthest. A time of a move (G93) is shared out evenly."""
    move, toolpath = steps.move[owner], path.program.toolpath
    length = np.linalg.norm(np.diff(point, axis=0), axis=1)
    feed = np.where(toolpath.kind[move] == Kind.RAPID, np.inf, clock.feed_mm_s[move])
    timed = (toolpath.flag[move] & np.uint8(Flag.INVERSE_TIME)) != 0
    way = np.zeros(len(length))
    before = _tips(path, move, _axes(path, move, share - 1.0 / count[owner]))
    for part in range(1, _PARTS + 1):
        here = _tips(path, move, _axes(path, move, share - (1.0 - part / _PARTS) / count[owner]))
        way = np.maximum(way, _PARTS * np.linalg.norm(here - before, axis=1))
        before = here
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = np.where(way > _SHORTEST_MM, feed * length / way, np.inf)
        if timed.any():
            speed = np.where(timed, feed * np.bincount(owner, length)[owner], speed)
    return np.asarray(speed, float)
