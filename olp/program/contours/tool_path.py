"""The path of the tool's centre along contours under cutter compensation, as the control makes it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.core.arrays import Index, Mask
from olp.core.errors import ProgramError
from olp.core.toolpath import Arcs, Flag, Frame, Kind, Toolpath
from olp.core.values import dataclass
from olp.program.contours.elements import AXES, Elements, direction
from olp.program.contours.entries import entry_arcs
from olp.program.contours.joints import Corner, Joints, joints, refuse, sweeps
from olp.program.contours.rules import ContourRules

#: moves that are inserted at an outside corner
_INSERTED = {"arc": 1, "extended": 3}
#: by which the turn of a frame may differ from a rotation
_RIGID = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """The `path` of the tool. (m,) `block` is the move of the contour that each of its moves belongs to, and
    `corner` marks those that the control inserts before that move. `elements` and `joints` are those of the
    contour."""

    path: Toolpath
    block: Index
    corner: Mask
    elements: Elements
    joints: Joints


def follow(path: Toolpath, rules: ContourRules) -> Followed:
    """The path of the tool where `path` is programmed. Raises ProgramError, with all lines, where a control
    refuses the contour."""
    elements = Elements.of(path)
    _refuse_frames(path, elements)
    _refuse_unknown(path, elements)
    if rules.entry == "own":
        _refuse_along_tool(path, elements)
    beside = _Beside(path, elements, rules)
    found = joints(elements, rules)
    refuse(elements, found, rules, path.line[elements.move])
    beside.put(found)
    inserted = np.where(found.corner == Corner.OUTSIDE, _INSERTED[rules.outside], 0)
    count = np.ones(len(path), np.int64)
    count[elements.move] += inserted
    block = np.repeat(np.arange(len(path)), count)
    last = np.cumsum(count) - 1
    corner = np.ones(len(block), bool)
    corner[last] = False
    frames, twins = _with_corners(path.frames)
    kind, flag = path.kind[block], path.flag[block]
    end = np.empty((len(block), 3))
    end[last] = beside.end_mm
    whole = Toolpath(
        kind, flag, path.line[block], np.where(corner, twins[path.frame[block]], path.frame[block]), end,
        frames, Arcs.none(), path.start_mm,
    )  # fmt: skip
    about = _round_corners(whole, elements, found, rules, last)
    arcs = _arcs(path, elements, found, last)
    return Followed(replace(whole, arcs=_joined(arcs, about)), block, corner, elements, found)


class _Beside:
    """The ends of programmed moves as the tool's path has them: beside the contour."""

    def __init__(self, path: Toolpath, elements: Elements, rules: ContourRules) -> None:
        self.path, self.elements = path, elements
        self.end_mm = path.end_mm.copy()
        on = path.compensated_radius_mm() > 0
        move = np.arange(len(path))
        #: the last element up to each move, -1 before any
        last = np.searchsorted(elements.move, move, "right") - 1
        contour = path.contour_number()
        mine = last >= 0
        mine[mine] = contour[elements.move[last[mine]]] == contour[move[mine]]
        #: moves that end where an element ends, and that element
        self.held = np.flatnonzero(on & mine)
        self.of = last[self.held]
        if not rules.returns:
            # a contour without an element has nothing to stay beside
            self._stay(path, on, last, np.flatnonzero((on & mine)[:-1] & ~on[1:]) + 1)

    def _stay(self, path: Toolpath, on: Mask, last: Index, ends: Index) -> None:
        """Behind contours, at the moves `ends`, the tool stays beside them until a move goes across the
        plane."""
        held, of = [self.held], [self.of]
        for k in ends.tolist():
            axes = AXES[self.elements.plane[last[k]]][:2]
            end = k
            still = (path.end_mm[k:, axes] == path.end_mm[k - 1, axes]).all(axis=1) & ~on[k:]
            end += len(still) if still.all() else int(still.argmin())
            holes = k + np.flatnonzero(path.flag[k:end] & np.uint8(Flag.CYCLE))
            if holes.size:
                raise ProgramError(
                    "a canned cycle drills where the contour ended, and whether the control goes there from "
                    "beside the contour is not known; move across the plane between G40 and the cycle",
                    line=int(path.line[holes[0]]),
                    code="OLP528",
                )
            held.append(np.arange(k, end))
            of.append(np.full(end - k, last[k]))
        order = np.argsort(np.concatenate(held), kind="stable")
        self.held, self.of = np.concatenate(held)[order], np.concatenate(of)[order]

    def put(self, found: Joints) -> None:
        """Move the ends to where the tool's path along their elements ends."""
        axes = AXES[self.elements.plane[self.of]]
        for i in (0, 1):
            self.end_mm[self.held, axes[:, i]] = found.end[self.of, i]


def _refuse_frames(path: Toolpath, elements: Elements) -> None:
    """Refuse contours in frames that are scaled, mirrored or turned out of their plane."""
    for k, frame in enumerate(path.frames):
        of = frame.compensation
        if of is None or frame.turn is None or not of.radius_mm:
            continue
        turn, third = np.array(frame.turn), AXES[of.plane][2]
        rigid = np.abs(turn @ turn.T - np.eye(3)).max() < _RIGID and np.linalg.det(turn) > 0
        mine = np.flatnonzero(path.frame[elements.move] == k)
        if mine.size and not (rigid and abs(turn[third, third] - 1.0) < _RIGID):
            raise ProgramError(
                "cutter compensation is on in a frame that is scaled, mirrored or turned out of its plane, "
                "and what the control makes of it is not known; program the path of the tool",
                line=int(path.line[elements.move[mine[0]]]),
                code="OLP528",
            )


def _refuse_unknown(path: Toolpath, elements: Elements) -> None:
    unknown = np.isnan(elements.begin).any(axis=1) | np.isnan(elements.end).any(axis=1)
    # the move behind a contour begins beside it
    behind = np.flatnonzero(path.compensated()[:-1] & ~path.compensated()[1:]) + 1
    arcs = behind[np.isin(path.kind[behind], (Kind.ARC_CW, Kind.ARC_CCW))]
    arcs = arcs[path.compensated_radius_mm()[arcs - 1] > 0]
    errors = [
        ProgramError(
            "a contour under cutter compensation begins where an axis has not been commanded yet; command "
            "X, Y and Z first, or give a machine file and a job file with start_mm",
            line=int(path.line[elements.move[i]]),
            code="OLP524",
        )
        for i in np.flatnonzero(unknown).tolist()
    ]
    errors += [
        ProgramError(
            "the move behind a contour under cutter compensation is an arc, which no control takes; leave "
            "the contour by a straight move",
            line=int(path.line[i]),
            code="OLP528",
        )
        for i in arcs.tolist()
    ]
    if errors:
        raise ProgramError.together(errors)


def _refuse_along_tool(path: Toolpath, elements: Elements) -> None:
    """Refuse contours whose first move does not go across the plane."""
    contour = path.contour_number()
    on = np.flatnonzero(path.compensated_radius_mm() > 0)
    first = on[np.concatenate(([True], contour[on][1:] != contour[on][:-1]))[: len(on)]]
    errors = [
        ProgramError(
            "the first move of a contour does not go across its plane; enter the contour by a straight move "
            "that is longer than the cutter radius",
            line=int(path.line[i]),
            code="OLP528",
        )
        for i in first[~np.isin(first, elements.move)].tolist()
    ]
    if errors:
        raise ProgramError.together(errors)


def _with_corners(frames: tuple[Frame, ...]) -> tuple[tuple[Frame, ...], Index]:
    """The frames and those of the moves that a control inserts at corners, and the index of each one's."""
    twins, more = np.arange(len(frames)), list(frames)
    for i, frame in enumerate(frames):
        if frame.compensation is not None and frame.compensation.radius_mm > 0:
            twins[i] = len(more)
            more.append(replace(frame, compensation=replace(frame.compensation, corner=True)))
    return tuple(more), twins


def _round_corners(
    path: Toolpath, elements: Elements, found: Joints, rules: ContourRules, last: Index
) -> Arcs:
    """Put the ends of the moves round outside corners into a path; their arcs."""
    some = np.flatnonzero(found.corner == Corner.OUTSIDE)
    end, axes, before = path.end_mm, AXES[elements.plane[some]], np.maximum(some - 1, 0)
    move, turn, radius = last[elements.move[some]], found.turn[some], elements.radius[some]
    first = move - _INSERTED[rules.outside]
    level = np.where((first > 0)[:, None], end[np.maximum(first - 1, 0)], np.array(path.start_mm))
    along, onward = direction(elements.ends[before]), direction(elements.begins[some])
    # the sides are extended until they meet, at most by the radius
    more = (radius * np.tan(np.minimum(turn, np.pi / 2) / 2))[:, None]
    points = [found.end[before] + along * more, found.begin[some] - onward * more, found.begin[some]]
    fed = path.kind[move] != Kind.RAPID
    for k, point in enumerate(points[-_INSERTED[rules.outside] :]):
        end[first + k] = level
        for i in (0, 1):
            end[first + k, axes[:, i]] = point[:, i]
        path.kind[first + k] = np.where(fed, Kind.LINE, Kind.RAPID)
    if rules.outside != "arc":
        return Arcs.none()
    left = elements.side[some] > 0
    path.kind[first[fed]] = np.where(left, Kind.ARC_CW, Kind.ARC_CCW)[fed]
    centre = level.copy()
    for i in (0, 1):
        centre[np.arange(len(some)), axes[:, i]] = elements.begin[some, i]
    sweep = np.where(left, -turn, turn)
    return Arcs(first[fed], centre[fed], elements.plane[some][fed], sweep[fed])


def _arcs(path: Toolpath, elements: Elements, found: Joints, last: Index) -> Arcs:
    """The arcs of a path as the tool goes along them."""
    arcs = path.arcs
    sweep = arcs.sweep_rad.copy()
    mine = np.flatnonzero(elements.arc)
    sweep[np.searchsorted(arcs.move, elements.move[mine])] = sweeps(elements, found)[mine]
    entry, centre, _ = entry_arcs(elements, found.begin, found.end)
    if not entry.size:
        return Arcs(last[arcs.move], arcs.centre_mm, arcs.plane, sweep)
    at, axes = np.searchsorted(arcs.move, elements.move[entry]), AXES[elements.plane[entry]]
    centre_mm = arcs.centre_mm.copy()
    for i in (0, 1):
        centre_mm[at, axes[:, i]] = centre[:, i]
    return Arcs(last[arcs.move], centre_mm, arcs.plane, sweep)


def _joined(a: Arcs, b: Arcs) -> Arcs:
    order = np.argsort(np.concatenate((a.move, b.move)), kind="stable")
    return Arcs(*(np.concatenate((getattr(a, n), getattr(b, n)))[order] for n in Arcs.__slots__))
