"""What a correction never changes: a feed move remains a feed move, a rapid a rapid, and a hole a hole.

An axis that is known remains known, and what is left uncorrected is commanded as the nominal program has it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from olp.core.arrays import Index, Mask
from olp.core.errors import ProgramError
from olp.core.toolpath import Flag, Kind
from olp.program.program import Program

#: Moves that the program or you leave as they are.
_AWAY = np.uint8(Flag.PASS | Flag.CONTROL | Flag.MACHINE)
#: Digits by which a command that is left alone may differ: offsets and inches may round otherwise.
_DIGITS = 0.6


def check_kinds(nominal: Program, corrected: Program, groups: Index, digit_mm: float) -> None:
    """Raise ProgramError with the line of the nominal program where a move of the corrected one is not what
    the nominal one has there. `groups` (n,) is the last corrected move of each nominal one, `digit_mm` the
    coarsest last digit of the corrected program."""
    for wrong, text in _changes(nominal, corrected, groups, digit_mm):
        if not wrong.any():
            continue
        other = int(np.argmax(wrong))
        move = int(np.searchsorted(groups, other))
        raise ProgramError(
            f"line {int(corrected.toolpath.line[other])} of the corrected program {text}; it is not a "
            "correction of this program; correct the nominal program again",
            line=int(nominal.toolpath.line[move]),
            code="OLP562",
        )


def _changes(
    nominal: Program, corrected: Program, groups: Index, digit_mm: float
) -> Iterator[tuple[Mask, str]]:
    """(m,) moves of the corrected program that are not allowed, and what is wrong with them."""
    path, written = nominal.toolpath, corrected.toolpath
    owner = np.searchsorted(groups, np.arange(len(written)))
    # the strokes of a hole are compared as one where both programs have the same holes
    whole = len(nominal.holes) == len(corrected.holes)
    in_hole = _in_holes(corrected) if whole else np.zeros(len(written), bool)
    of_hole = _in_holes(nominal)[owner] if whole else in_hole
    yield in_hole & ~of_hole, "drills where the nominal program does not"
    rapid, was_rapid = written.kind == Kind.RAPID, path.kind[owner] == Kind.RAPID
    feed = "cuts or touches where the nominal program moves rapidly"
    yield ~rapid & ~in_hole & (was_rapid | of_hole), feed
    fast = "moves rapidly where the nominal program cuts or touches"
    yield rapid & ~in_hole & ~was_rapid & ~of_hole, fast
    touches = written.kind == Kind.PROBE
    yield touches & (path.kind[owner] != Kind.PROBE), "touches where the nominal program does not"
    last = np.zeros(len(written), bool)
    last[groups] = True
    known, was_known = np.isfinite(written.end_mm), np.isfinite(path.end_mm[owner])
    # where an axis is after a move of the control alone depends on the words behind it
    own = (path.flag[owner] & np.uint8(Flag.CONTROL)) != 0
    unlike = (known != was_known).any(axis=1) & ~in_hole & ~own
    yield last & unlike, "ends where another axis is known than in the nominal program"
    moved = _moved(nominal, corrected, groups, owner, digit_mm)
    yield last & moved, "changes a move that is left uncorrected"


def _in_holes(program: Program) -> Mask:
    """(m,) the moves of canned cycles for holes."""
    inside = np.zeros(len(program.toolpath), bool)
    for hole in program.holes:
        inside[hole.first : hole.last] = True
    return inside


def _moved(nominal: Program, corrected: Program, groups: Index, owner: Index, digit_mm: float) -> Mask:
    """(m,) moves of the corrected program that command neither the end nor the distance that the nominal one
    has for an axis of a move that is never corrected."""
    path, written = nominal.toolpath, corrected.toolpath
    away = np.asarray((path.flag[owner] & _AWAY) != 0)
    if not away.any():
        return away
    end = np.abs(written.end_mm - path.end_mm[owner])
    begin = written.starts_mm()[np.concatenate(([0], groups[:-1] + 1))][owner]
    distance = np.abs((written.end_mm - begin) - (path.end_mm - path.starts_mm())[owner])
    return np.asarray(away & (np.fmin(end, distance) > _DIGITS * digit_mm).any(axis=1))
