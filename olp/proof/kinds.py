"""What a correction never changes: a feed move remains a feed move, a rapid a rapid, and a hole a hole.

An axis that is known remains known, and what is left uncorrected is commanded as the nominal program has it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from olp.core.arrays import Index, Mask, any_in_row
from olp.core.errors import ProgramError
from olp.core.spool import unload
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.program.program import Program
from olp.proof.deviation import owner_of

#: Moves that the program or you leave as they are.
_AWAY = np.uint8(Flag.PASS | Flag.CONTROL | Flag.MACHINE)
#: Nominal moves that are looked at together.
_BLOCK = 1 << 14
#: Digits by which a command that is left alone may differ: offsets and inches may round otherwise.
_DIGITS = 0.6


def check_kinds(nominal: Program, corrected: Program, groups: Index, digit_mm: float) -> None:
    """Raise ProgramError with the line of the nominal program where a move of the corrected one is not what
    the nominal one has there. `groups` (n,) is the last corrected move of each nominal one, `digit_mm` the
    coarsest last digit of the corrected program."""
    # the strokes of a hole are compared as one where both programs have the same holes
    whole = len(nominal.holes) == len(corrected.holes)
    drilled = [p.holes.inside(len(p.toolpath)) & whole for p in (nominal, corrected)]
    begin = 0
    for a in range(0, len(groups), _BLOCK):
        here = groups[a : a + _BLOCK]
        end = int(here[-1]) + 1
        path, written = nominal.toolpath.part(a, a + len(here)), corrected.toolpath.part(begin, end)
        holes = drilled[0][a : a + len(here)], drilled[1][begin:end]
        for wrong, text in _changes(path, written, here - begin, *holes, digit_mm):
            if wrong.any():
                _refuse(path, written, here - begin, int(np.argmax(wrong)), text)
        begin = end
        unload()


def _refuse(path: Toolpath, written: Toolpath, groups: Index, move: int, text: str) -> None:
    raise ProgramError(
        f"line {int(written.line[move])} of the corrected program {text}; it is not a correction of this "
        "program; correct the nominal program again",
        line=int(path.line[np.searchsorted(groups, move)]),
        code="OLP562",
    )


def _changes(
    path: Toolpath, written: Toolpath, groups: Index, drilled: Mask, in_hole: Mask, digit_mm: float
) -> Iterator[tuple[Mask, str]]:
    """(m,) moves `written` that are not allowed, and what is wrong with them. (n,) `drilled` and (m,)
    `in_hole` are moves of holes that are compared as one."""
    owner = owner_of(groups, 0, len(written))
    of_hole = drilled[owner]
    yield in_hole & ~of_hole, "drills where the nominal program does not"
    rapid, was_rapid = written.kind == Kind.RAPID, path.kind[owner] == Kind.RAPID
    feed = "cuts or touches where the nominal program moves rapidly"
    yield ~rapid & ~in_hole & (was_rapid | of_hole), feed
    fast = "moves rapidly where the nominal program cuts or touches"
    yield rapid & ~in_hole & ~was_rapid & ~of_hole, fast
    touches = written.kind == Kind.PROBE
    yield touches & (path.kind[owner] != Kind.PROBE), "touches where the nominal program does not"
    last = np.zeros(len(written), bool)
    # one without moves ends with those before
    last[groups[groups >= 0]] = True
    known, was_known = np.isfinite(written.end_mm), np.isfinite(path.end_mm.take(owner, axis=0))
    # where an axis is after a move of the control alone depends on the words behind it
    own = (path.flag[owner] & np.uint8(Flag.CONTROL)) != 0
    unlike = any_in_row(known != was_known) & ~in_hole & ~own
    yield last & unlike, "ends where another axis is known than in the nominal program"
    moved = _moved(path, written, groups, owner, digit_mm)
    yield last & moved, "changes a move that is left uncorrected"


def _moved(path: Toolpath, written: Toolpath, groups: Index, owner: Index, digit_mm: float) -> Mask:
    """(m,) moves of the corrected program that command neither the end nor the distance that the nominal one
    has for an axis of a move that is never corrected."""
    away = np.asarray((path.flag[owner] & _AWAY) != 0)
    if not away.any():
        return away
    end = np.abs(written.end_mm - path.end_mm[owner])
    first = np.minimum(np.concatenate(([0], groups[:-1] + 1)), len(written) - 1)
    begin = written.starts_mm()[first][owner]
    distance = np.abs((written.end_mm - begin) - (path.end_mm - path.starts_mm())[owner])
    return np.asarray(away & any_in_row(np.fmin(end, distance) > _DIGITS * digit_mm))
