"""Where the tool's path goes over from one element of a contour to the next, and what a control refuses.

Measured on LinuxCNC's interpreter, and as its documentation has it: on an inside corner both paths end where
they meet, on an outside one an arc goes about the corner.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Mask
from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.contours.elements import Elements, direction, wrapped
from olp.program.contours.entries import entry_arcs
from olp.program.contours.meeting import Carriers, meeting
from olp.program.contours.rules import ContourRules

#: rad by which an arc of the tool may be longer than the programmed one, times the unit of the program, mm
_LONGER_MM = 0.0254
#: rad; a control takes a smaller arc for a whole circle
_NO_ARC = 1e-6


class Corner(IntEnum):
    """What is before an element: nothing (it enters the contour), a smooth joint, an inside or an outside
    corner, or the end of an entry that goes to the next element by itself."""

    ENTRY = 0
    SMOOTH = 1
    INSIDE = 2
    OUTSIDE = 3
    ENTERED = 4


@dataclass(frozen=True, slots=True, eq=False)
class Joints:
    """(k,) of elements: the `corner` before each and the angle `turn` of an outside one in rad. (k, 2)
    `begin` and `end` of the tool's path along it."""

    corner: npt.NDArray[np.int8]
    turn: Array
    begin: Array
    end: Array


def carriers(elements: Elements) -> Carriers:
    """What the tool's path along elements lies on."""
    beside = elements.end + elements.normal(elements.ends)
    return Carriers(
        elements.arc, beside, direction(elements.ends), elements.centre, np.maximum(elements.tool_size, 0.0)
    )


def corners(elements: Elements, rules: ContourRules) -> tuple[npt.NDArray[np.int8], Array]:
    """(k,) the corner before each element, and its angle, above 0 where it is outside."""
    before = np.maximum(np.arange(len(elements)) - 1, 0)
    turn = -elements.side * wrapped(elements.begins - elements.ends[before])
    kind = np.where(np.abs(turn) <= rules.smooth_rad, Corner.SMOOTH, Corner.OUTSIDE)
    back = np.abs(turn) >= np.pi - rules.smooth_rad
    kind[(turn < -rules.smooth_rad) & ~back] = Corner.INSIDE
    # at an arc whose outer side is cut the tool stays on that side instead of going round
    outer = elements.arc & ~elements.inside
    kind[back & np.where(elements.arc, outer, outer[before])] = Corner.INSIDE
    # about a point where the path turns back the tool always goes on the outside
    turn = np.where(back & (turn < 0), turn + 2 * np.pi, turn)
    if rules.entry == "next":
        kind[elements.first[before] & elements.next] = Corner.ENTERED
    kind[elements.first] = Corner.ENTRY
    return kind.astype(np.int8), turn


def joints(elements: Elements, rules: ContourRules) -> Joints:
    """The joints of elements; those that enter a contour begin as programmed."""
    count = len(elements)
    before = np.maximum(np.arange(count) - 1, 0)
    corner, turn = corners(elements, rules)
    begin = elements.begin + elements.normal(elements.begins)
    end = elements.end + elements.normal(elements.ends)
    inside = np.flatnonzero(corner == Corner.INSIDE)
    if inside.size:
        every = carriers(elements)
        one, other = _pick(every, before[inside]), _pick(every, inside)
        # rounded words put the begin of an arc beside its circle: the line counts as if it ended on it
        arms = elements.begin[inside] - other.centre
        off = (elements.size[inside] / np.maximum(np.hypot(*arms.T), 1e-12) - 1.0)[:, None] * arms
        one.point[other.arc & ~one.arc] += off[other.arc & ~one.arc]
        begin[inside] = meeting(one, other, elements.begin[inside])
        end[before[inside]] = begin[inside]
    smooth = np.flatnonzero(corner == Corner.SMOOTH)
    begin[smooth] = end[before[smooth]]
    entered = np.flatnonzero(corner == Corner.ENTERED)
    end[before[entered]] = begin[entered]
    begin[elements.first] = elements.begin[elements.first]
    return Joints(corner, turn, begin, end)


def sweeps(elements: Elements, found: Joints) -> Array:
    """(k,) rad along the tool's path of arcs, whole turns included; 0 of lines."""
    gone = np.zeros(len(elements))
    for sign, own, tool in ((-1.0, elements.begin, found.begin), (1.0, elements.end, found.end)):
        a, b = own - elements.centre, tool - elements.centre
        gone += sign * wrapped(np.arctan2(b[:, 1], b[:, 0]) - np.arctan2(a[:, 1], a[:, 0]))
    swept = np.where(elements.arc, elements.sweep + gone, 0.0)
    entry, _, entered = entry_arcs(elements, found.begin, found.end)
    swept[entry] = entered
    return swept


def refusals(elements: Elements, found: Joints, rules: ContourRules) -> list[tuple[Mask, str]]:
    """(k,) elements that a control refuses, each with the reason."""
    radius = elements.radius
    length = np.hypot(*(elements.end - elements.begin).T)
    corner = found.corner
    # a control looks at a move when it meets the corner behind it, not at the one about which an arc goes
    seen = (corner == Corner.INSIDE) | ((corner == Corner.OUTSIDE) & ~elements.arc)
    inner = np.append(seen[1:], False)
    inner |= np.append(elements.first[1:], True)
    moved = ((found.end - found.begin) * direction(elements.begins)).sum(axis=1)
    swept = sweeps(elements, found)
    gone = swept * np.sign(elements.sweep)
    long = gone > np.abs(elements.sweep) + _LONGER_MM / elements.unit
    back = np.where(elements.arc, long, moved < 0)
    turns = np.ceil((np.abs(elements.sweep) - _NO_ARC) / (2 * np.pi))
    beyond = np.ceil((gone - _NO_ARC) / (2 * np.pi)) > turns
    return [
        (
            elements.first & elements.arc & (not rules.enters_by_arc),
            "an arc is the first move of a contour; enter it by a straight move",
        ),
        (
            elements.first & (length <= radius) & (rules.entry == "own"),
            "the first move of a contour is not longer than the cutter radius of {r:g} mm",
        ),
        (
            _without_arc(elements, found),
            "no arc leads a cutter of {r:g} mm to the end of the arc that enters the contour",
        ),
        (
            elements.first & elements.arc & np.append(corner[1:] == Corner.INSIDE, False),
            "the contour turns inward behind the arc that enters it, and where the tool goes is not known",
        ),
        (
            elements.inside & (elements.size <= radius),
            "a cutter radius of {r:g} mm does not fit into this arc",
        ),
        (
            np.isnan(found.begin).any(axis=1),
            "a cutter radius of {r:g} mm does not fit into the inside corner before this move",
        ),
        (
            elements.arc & beyond & rules.circles_by_ends,
            "beside the contour this circle ends beyond its begin, so the control goes on from there alone; "
            "write two arcs",
        ),
        (
            (inner & back & ~elements.first) | (elements.arc & (gone <= 0)),
            "a cutter radius of {r:g} mm does not fit into the corners of this move",
        ),
    ]


def _without_arc(elements: Elements, found: Joints) -> Mask:
    """(k,) arcs that enter a contour and have no centre for the tool."""
    some, centre, _ = entry_arcs(elements, found.begin, found.end)
    lacks = np.zeros(len(elements), bool)
    lacks[some] = np.isnan(centre).any(axis=1)
    return lacks


def refuse(elements: Elements, found: Joints, rules: ContourRules, line: npt.NDArray[np.int32]) -> None:
    """Raise ProgramError, all together, for moves that the control refuses; (k,) `line` are theirs."""
    errors, done = [], np.zeros(len(elements), bool)
    for wrong, text in refusals(elements, found, rules):
        for i in np.flatnonzero(wrong & ~done).tolist():
            what = text.format(r=elements.radius[i])
            hint = "" if ";" in what else "; make the move longer, or use a smaller cutter"
            errors.append(ProgramError(what + hint, line=int(line[i]), code="OLP528"))
        done |= wrong
    if errors:
        raise ProgramError.together(errors)


def _pick(every: Carriers, which: npt.NDArray[np.int64]) -> Carriers:
    return Carriers(*(getattr(every, name)[which] for name in Carriers.__slots__))
