"""LinuxCNC 2.8 and 2.9: blend arcs, parabolic blends, and corners that are nearly none.

At each corner the planner takes what is fastest of three. A corner that needs little acceleration in one
servo cycle is driven as it is. A blend arc touches both moves, takes at most half of each, and stays within
the path tolerance; half of the acceleration is kept for the speed along it. Or the end of one move overlaps
the start of the next one; both then have half of the acceleration.
Source: LinuxCNC's manual, chapter "Trajectory Control", and the rules and constants of its published planner
(src/emc/tp: tp.c, blendmath.c, tc.c); compared with runs of the control itself
(tests/trajectory/test_controls_in_linuxcnc.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.values import dataclass
from olp.program.feeds.timing import PathControl
from olp.trajectory.controls.base import AxisSpeeds, Control, Parameter
from olp.trajectory.controls.moves import Moves
from olp.trajectory.controls.naive import merged, said
from olp.trajectory.controls.planner import Pieces

#: of the acceleration: what remains along an arc
ALONG = 0.5
#: and across it
ACROSS = np.sqrt(1.0 - ALONG * ALONG)
#: of each move, at most, that a corner takes
SHARE = 0.5
#: of the acceleration, at most, in the cycle of a corner that is driven as it is
KINK = 0.1
#: of the turn of an arc, at most, that a blend arc behind it takes
ARC_BEHIND = 1.0 / 3.0
#: and one before it
ARC_BEFORE = 2.0 / 3.0
#: of the cosine between the normals of two planes that are one
FLAT = 1e-9
#: cycles; a piece takes longer than one
LEAST_CYCLES = 1.02
#: cycles; the rest of a line between two arcs that takes less becomes part of the second one
GAP_CYCLES = 4.0
#: rad; two moves within this angle of a reversal stop
REVERSAL_RAD = np.deg2rad(2.0)
_TINY = 1e-300


@dataclass(frozen=True, slots=True, eq=False)
class _Corners:
    """The m - 1 corners of a stretch, and what moves and limits allow there.

    `half` is half of the angle between both moves, `half_of_arc` the same where arcs bend towards each other;
    a blend arc takes `reach_mm` of both at most, where all is in one plane, `flat`."""

    before_mm_s: Array
    behind_mm_s: Array
    half: Array
    across: Array
    plane_mm_s2: Array
    plane_mm_s: Array
    reach_mm: Array
    half_of_arc: Array
    flat: Mask


def pieces(part: Moves, limits: AxisSpeeds, values: Mapping[str, float]) -> Pieces:
    """Moves, merged where they are nearly one line, and shortened by the blend arcs between them."""
    part, own = merged(part)
    cycle_s = values["servo_period_ms"] * 1e-3
    straight = np.isinf(part.radius_mm)
    acceleration = part.least(limits.acceleration)
    velocity = np.minimum(part.feed_mm_s, part.least(limits.velocity))
    round_mm2_s2 = ACROSS * acceleration * part.radius_mm
    velocity = np.minimum(velocity, np.sqrt(round_mm2_s2))
    corners = _corners(part, velocity, limits)
    blends = _choose(part, corners, acceleration, cycle_s, limits, straight)
    # a move in front of a rest waits for one that it would overlap
    lowered = np.where(np.append(part.rest, True) & (part.own_mode == PathControl.BLEND), 0.5, 1.0)
    for side in (slice(None, -1), slice(1, None)):
        np.minimum(lowered[side], blends.slower, out=lowered[side])
    along = acceleration * lowered * np.where(straight, 1.0, ALONG)
    velocity = np.minimum(velocity, np.sqrt(lowered * round_mm2_s2))
    joined = _joined(part, velocity, along, blends, cycle_s)
    return replace(joined, move=own[joined.move])


def _corners(part: Moves, velocity: Array, limits: AxisSpeeds) -> _Corners:
    before, behind = part.leave[:-1], part.begin[1:]
    cosine = np.clip((before * behind).sum(axis=1), -1.0, 1.0)
    normal = np.cross(before, behind)
    normal /= np.maximum(np.sqrt((normal * normal).sum(axis=1)), _TINY)[:, None]
    # the largest share of each axis among directions in the plane of both moves
    within = np.sqrt(np.maximum(1.0 - normal * normal, 1e-24))
    half = 0.5 * np.arccos(-cosine)
    sides = (
        _side(part, slice(None, -1), half, ARC_BEFORE, (part.inward[:-1, 1] * behind).sum(axis=1) > 0.0),
        _side(part, slice(1, None), half, ARC_BEHIND, (part.inward[1:, 0] * before).sum(axis=1) < 0.0),
    )
    flat = np.ones(len(half), bool)
    for plane in (part.normal[:-1], part.normal[1:]):
        flat &= ~plane.any(axis=1) | (np.abs((plane * normal).sum(axis=1)) > 1.0 - FLAT)
    return _Corners(
        velocity[:-1], velocity[1:], half, behind - before,
        (limits.acceleration / within).min(axis=1), (limits.velocity / within).min(axis=1),
        np.minimum(sides[0][0], sides[1][0]), half - sides[0][1] - sides[1][1], flat,
    )  # fmt: skip


def _side(part: Moves, which: slice, half: Array, share: float, towards: Mask) -> tuple[Array, Array]:
    """How much of the moves at one side a blend arc may take, and by how much arcs that bend `towards` the
    other side narrow the corner."""
    sweep, radius = part.sweep_rad[which], part.radius_mm[which]
    towards = towards & (sweep > 0.0)
    turn = np.minimum(share * sweep, np.where(towards, half, 0.5 * np.pi))
    radius = np.where(sweep > 0.0, radius, 0.0)
    reach = np.where(towards, np.sin(0.25 * turn), turn) * radius
    return np.where(sweep > 0.0, reach, SHARE * part.length_mm[which]), np.where(towards, 0.25 * turn, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Blends:
    """What the control does at the m - 1 corners. `joint_mm_s`: the speed of those that are driven as they
    are, 0 for others. `slower`: the share of the acceleration that both moves keep. `overlap_mm_s`. Of blend
    arcs, 0 elsewhere: `trim_mm` of each move, and `arc_mm`, `arc_mm_s`, `arc_mm_s2` of the arc."""

    joint_mm_s: Array
    slower: Array
    overlap_mm_s: Array
    trim_mm: Array
    arc_mm: Array
    arc_mm_s: Array
    arc_mm_s2: Array


def _choose(
    part: Moves, corners: _Corners, acceleration: Array, cycle_s: float, limits: AxisSpeeds, straight: Mask
) -> _Blends:
    least = np.minimum(corners.before_mm_s, corners.behind_mm_s)
    at_once = least / cycle_s + acceleration[1:]
    share = (np.abs(corners.across) / limits.acceleration).max(axis=1) * at_once
    share = np.where(straight[:-1] & straight[1:], share, share / ALONG)
    kink = least * np.minimum(KINK / np.maximum(share, _TINY), 1.0)
    stop = part.rest | (part.mode == PathControl.EXACT_STOP) | (corners.half < 0.5 * REVERSAL_RAD)
    smooth = ~stop & (share < KINK)
    blending = ~stop & ~smooth & (part.mode == PathControl.BLEND)
    trim, arc, arc_speed = _arcs(part, corners)
    overlap, middle = _overlaps(part, corners, acceleration * np.where(straight, 1.0, ALONG))
    arc_speed = np.minimum(arc_speed, arc / (cycle_s * LEAST_CYCLES))
    # both moves lose half of their acceleration, so half of the speed is counted
    net = 0.5 * middle
    by_arc = (
        blending
        & corners.flat
        & (corners.half_of_arc > 0.0)
        & (arc > 0.0)
        & (arc_speed >= np.maximum(kink, net))
    )
    by_overlap = blending & ~by_arc & (net > kink)
    as_is = smooth | (blending & ~by_arc & ~by_overlap)
    slower = np.where(
        as_is | (part.mode == PathControl.EXACT_PATH) & ~stop, 1.0 - np.minimum(share, KINK), 1.0
    )
    slower = np.where(by_overlap, 0.5, slower)
    return _Blends(
        np.where(as_is, kink, 0.0), slower, np.where(by_overlap, overlap, 0.0), np.where(by_arc, trim, 0.0),
        np.where(by_arc, arc, 0.0), np.where(by_arc, arc_speed, 0.0), ALONG * corners.plane_mm_s2,
    )  # fmt: skip


def _arcs(part: Moves, corners: _Corners) -> tuple[Array, Array, Array]:
    """Of blend arcs what they take of both moves, their lengths and speeds."""
    half = np.clip(corners.half_of_arc, 1e-9, 0.5 * np.pi - 1e-9)
    turn = np.pi - 2.0 * half
    by_tolerance = np.cos(half) * part.blend_mm / np.maximum(1.0 - np.sin(half), _TINY)
    reach = np.minimum(corners.reach_mm, by_tolerance)
    widest = np.tan(half) * reach
    normal = ACROSS * corners.plane_mm_s2
    goal = np.minimum(np.maximum(corners.before_mm_s, corners.behind_mm_s), corners.plane_mm_s)
    speed = np.minimum(np.sqrt(normal * widest), goal)
    # as long as an overlap of both moves would last at this speed
    along = ALONG * corners.plane_mm_s2
    lasting = np.minimum(np.sqrt(2.0 * along * reach), speed) / along * speed / turn
    radius = np.maximum(speed * speed / normal, np.minimum(lasting, widest))
    return radius / np.tan(half), radius * turn, speed


def _overlaps(part: Moves, corners: _Corners, along: Array) -> tuple[Array, Array]:
    """Of parabolic blends the speed at which the next move may begin, and that amid the corner."""
    own = 0.5 * along
    reach = np.sqrt(own * SHARE * part.length_mm)
    before = np.minimum(reach[:-1], corners.before_mm_s)
    behind = np.minimum(reach[1:], corners.behind_mm_s)
    half_s = np.minimum(part.length_mm[:-1] / before, part.length_mm[1:] / behind)
    blend_s = np.minimum(half_s, np.maximum(before / own[:-1], behind / own[1:]))
    cosine = np.maximum(np.cos(corners.half), 1e-12)
    within = 2.0 * np.sqrt(own[:-1] * part.blend_mm / cosine)
    before = np.minimum(np.minimum(before, blend_s * own[:-1]), within)
    behind = np.minimum(np.minimum(behind, blend_s * own[1:]), within)
    return before, 0.5 * np.sin(corners.half) * (before + behind)


def _joined(part: Moves, velocity: Array, along: Array, blends: _Blends, cycle_s: float) -> Pieces:
    """Moves and blend arcs in their order."""
    count = len(part)
    trim = np.zeros((2, count))
    trim[1, :-1], trim[0, 1:] = blends.trim_mm, blends.trim_mm
    line = np.maximum(part.length_mm - trim[0] - trim[1], 0.0)
    has_arc = blends.arc_mm > 0.0
    # a short rest of a line becomes part of the arc behind it
    goes = np.zeros(count, bool)
    goes[:-1] = has_arc & (line[:-1] < GAP_CYCLES * cycle_s * blends.arc_mm_s) & np.isinf(part.radius_mm[:-1])
    arc = blends.arc_mm + np.where(goes[:-1], line[:-1], 0.0)
    # columns: the rest of each move, and the arc behind it
    length = np.column_stack((np.where(goes, 0.0, line), np.append(arc * has_arc, 0.0))).ravel()
    speed = np.column_stack((velocity, np.append(blends.arc_mm_s, 0.0))).ravel()
    change = np.column_stack((along, np.append(blends.arc_mm_s2, 0.0))).ravel()
    joint = np.column_stack((np.append(blends.joint_mm_s, 0.0), np.append(blends.joint_mm_s, 0.0))).ravel()
    joint = np.where(np.repeat(np.append(has_arc, False), 2), np.inf, joint)
    overlap = np.repeat(np.append(blends.overlap_mm_s, 0.0), 2)
    kept = np.flatnonzero(length > 0.0)
    move = np.repeat(np.arange(count), 2)
    even = np.tile([False, True], count)
    speed = np.minimum(speed[kept], length[kept] / (cycle_s * LEAST_CYCLES))
    return Pieces(
        length[kept], speed, change[kept], move[kept], even[kept], joint[kept][:-1], overlap[kept][:-1]
    )


CONTROL = Control(
    key="linuxcnc",
    title="LinuxCNC 2.9",
    source="LinuxCNC documentation: Trajectory Control",
    parameters={"servo_period_ms": Parameter(1.0, "ms", "SERVO_PERIOD of [EMCMOT]")},
    pieces=pieces,
    ahead=50,
    cycle_s=1e-3,
    stop_cycles=1.0,
    bare_mm=np.inf,
    said=said,
)
