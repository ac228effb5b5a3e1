"""Contours beside which the control keeps the tool (RL, RR), written out as the path of the tool's centre.

As on the control, the first block of a contour leads to a point across the beginning of the next one. On
an inside corner both paths end where they meet, and round an outside corner the tool goes on an arc about it.
The block behind the contour, with R0, leads to where it says.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from olp.core.errors import ProgramError
from olp.program.contours.meeting import meeting
from olp.program.heidenhain.plain.moves import Entry
from olp.program.heidenhain.plain.path import Piece, Point, turn_between

#: rad; at a smaller turn there is no arc about an outside corner: 0.5 um at a radius of 10 mm
_SMOOTH_RAD = 0.02
#: mm; the tool's ends on two pieces that are closer are one point
_SAME_POINT = 1e-9
#: by which the order of ends on a piece may be off, as a share of it
_OFF = 1e-9
#: what changes the corners of a contour
_CORNERS = frozenset({97, 98})
_SIDE = re.compile(rb"(?<![A-Z])R[LR](?![.\d])")


def beside(entries: Sequence[Entry]) -> list[Entry]:
    """The statements with contours as the path of the tool. Raises ProgramError where it does not fit."""
    done: list[Entry] = []
    contour: list[Entry] = []
    for entry in (each for whole in entries for each in (*whole.before, whole)):
        entry.before = []
        if contour and entry.block is None and _ends(entry):
            raise _refused("a tool or a cycle is called beside a contour; end it with R0 before", contour[-1])
        if contour and entry.block is not None and entry.pole is None and not entry.side:
            done += _followed(contour, None if entry.centre else entry)
            contour = []
        if entry.side or contour:
            contour.append(entry)
        else:
            done.append(entry)
    if contour:
        raise _refused("the contour has no end; give a block with R0 behind it", contour[-1])
    return done


def _ends(entry: Entry) -> bool:
    upper = entry.lines[0].upper() if entry.lines else b""
    return re.search(rb"TOOL[ \t]+CALL|CYCL", upper) is not None


def _refused(why: str, entry: Entry) -> ProgramError:
    return ProgramError(why, line=entry.block.line if entry.block is not None else 1, code="OLP528")


def _followed(contour: list[Entry], behind: Entry | None) -> list[Entry]:
    """The statements of one contour, whose pieces become those of the tool; `behind` is the block after it,
    where that does not begin beside the contour."""
    moves = [e for e in contour if e.piece is not None and e.piece.heading(last=True) is not None]
    if behind is not None and (behind.piece is None or behind.piece.sweep):
        raise _refused("the block behind a contour has no straight move in X and Y; leave it by one", behind)
    if contour[0] not in moves:
        raise _refused("the block that enters a contour has no move in X and Y; give it one", contour[0])
    if len(moves) < 2:
        raise _refused("a contour has one move alone; it needs one that leads to it", contour[0])
    for entry in contour:
        block = entry.block
        if block is not None and (99 in block.functions or _CORNERS.intersection(block.functions)):
            raise _refused("M97, M98 and M99 are not read beside a contour; end it with R0 before", entry)
        if entry.side and (entry.side, entry.radius) != (contour[0].side, contour[0].radius):
            raise _refused("the side or the tool changes in a contour; end it with R0 before", entry)
    pieces, corners = _pieces(moves)
    end: Point | None = None
    written: list[Entry] = []
    for entry in contour:
        entry.rest = _SIDE.sub(b"R0", entry.rest)
        if entry in moves:
            k = moves.index(entry)
            entry.piece, entry.changed = pieces[k], True
            entry.axes = b"XY" + (b"Z" if b"Z" in entry.axes else b"")
            end = pieces[k].end
            if (about := corners[k]) is not None:
                written.append(_corner(entry, about))
        elif entry.block is not None and entry.pole is None:
            # it moves along Z alone, or nowhere
            entry.piece = None
            entry.axes = entry.axes.replace(b"X", b"").replace(b"Y", b"")
            entry.changed |= entry.rest != entry.block.rest or entry.block.stated(b"XY")
        written.append(entry)
    assert end is not None
    if behind is not None and behind.piece is not None:
        behind.piece, behind.changed = Piece(end, behind.piece.end), True
        behind.axes = b"XY" + (b"Z" if b"Z" in behind.axes else b"")
    return written


def _corner(entry: Entry, about: Piece) -> Entry:
    assert entry.block is not None
    return Entry([], entry.source[:1], entry.block, about, entry.z, b"XY", True, b"", entry.shift)


def _pieces(moves: list[Entry]) -> tuple[list[Piece], list[Piece | None]]:
    """The pieces of the tool, and the arc about the corner before each."""
    given = [e.piece for e in moves if e.piece is not None]
    off = moves[0].side * moves[0].radius
    if given[0].sweep and not moves[0].centre:
        raise _refused("an arc is the first move of a contour; expected a straight move", moves[0])
    for entry, piece in zip(moves[1:], given[1:], strict=True):
        if piece.sweep and piece.size - math.copysign(off, piece.sweep * off) <= 0:
            raise _refused(f"a cutter radius of {abs(off):g} does not fit into this arc", entry)
    begins = [piece.across(off, last=False) for piece in given]
    ends = [piece.across(off, last=True) for piece in given]
    begins[0], ends[0] = given[0].start, begins[1]
    corners: list[Piece | None] = [None] * len(given)
    for k in range(1, len(given) - 1):
        a, b = given[k], given[k + 1]
        turn = turn_between(a, b)
        if abs(turn) >= _SMOOTH_RAD and turn * off < 0:
            corners[k + 1] = Piece(ends[k], begins[k + 1], a.end, turn)
            continue
        gap = math.dist(ends[k], begins[k + 1])
        middle = (np.array(ends[k]) + np.array(begins[k + 1])) / 2
        found = middle
        if gap > _SAME_POINT:
            found = meeting(a.carrier(off, last=True), b.carrier(off), np.array([a.end]))[0]
        # digits alone may put the place where two smooth pieces meet far away, or nowhere
        if abs(turn) < _SMOOTH_RAD and not math.dist(found, middle) <= gap:
            found = middle
        if not np.isfinite(found).all():
            raise _not_fitting(off, moves[k + 1])
        ends[k] = begins[k + 1] = (float(found[0]), float(found[1]))
    made = [given[0] if moves[0].centre else Piece(begins[0], ends[0])]
    for entry, piece, begin, end in zip(moves[1:], given[1:], begins[1:], ends[1:], strict=True):
        made.append(_between(piece, begin, end, off, entry))
    return made, corners


def _not_fitting(off: float, entry: Entry) -> ProgramError:
    return _refused(f"a cutter radius of {abs(off):g} does not fit into the corners of this move", entry)


def _between(piece: Piece, begin: Point, end: Point, off: float, entry: Entry) -> Piece:
    """The piece of the tool beside a piece, between two points; refused where they are in the wrong order."""
    if not piece.sweep:
        along = (piece.end[0] - piece.start[0], piece.end[1] - piece.start[1])
        if (end[0] - begin[0]) * along[0] + (end[1] - begin[1]) * along[1] < -_OFF * piece.size**2:
            raise _not_fitting(off, entry)
        return Piece(begin, end)
    gone = 0.0
    for sign, own, tool in ((-1, piece.start, begin), (1, piece.end, end)):
        a, b = (math.atan2(p[1] - piece.centre[1], p[0] - piece.centre[0]) for p in (own, tool))
        gone += sign * ((b - a + math.pi) % (2 * math.pi) - math.pi)
    sweep = piece.sweep + gone
    if sweep * piece.sweep < 0:
        raise _not_fitting(off, entry)
    return Piece(begin, end, piece.centre, sweep)
