"""Which moves of a corrected program belong to which move of the nominal one, from the two programs alone.

A correction keeps all moves in their order. It splits some, puts steps that take up backlash before others,
and may change the number of pecks of a hole. So the two sequences are aligned: every nominal move ends with
one move of the corrected program, and those between two such ends lie along the later move.
"""

from __future__ import annotations

import numpy as np

from olp.compensation.plan import TargetRows
from olp.core.arrays import Array, Index, all_in_row, distinct, most_in_row
from olp.core.errors import ProgramError
from olp.core.progress import Progress, silent
from olp.core.spool import unload
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.program.program import Program
from olp.program.text.columns import apart
from olp.proof.alignment import FAR_MM, FREE, Alignment, off_mm
from olp.proof.pages import Page, Tips, Units

#: Share of waypoints that may be far off before the programs count as different jobs.
_MOST_FAR = 0.5
#: Strokes by which the first one of a hole is found.
_STROKES = 2
#: Nominal units that are matched at once.
_PAGE = 1 << 14


def match(
    program: Program, target_mm: TargetRows, corrected: Program, model: ErrorModel, near_mm: float,
    tell: Progress = silent,
) -> Index:  # fmt: skip
    """(n,) index of the last move of `corrected` for each move of `program`, whose waypoints are
    `target_mm` (n, 3).

    Within `near_mm` of its waypoint a move counts as found. Raises ProgramError where the two programs are
    not the same job: fewer moves, or most waypoints farther off than 1 mm.
    """
    holes = len(program.holes) == len(corrected.holes)
    mine, theirs = Units.of(program, holes=holes), Units.of(corrected, holes=holes)
    if len(theirs) < len(mine) or (len(theirs) and not len(mine)):
        word = "fewer than" if len(mine) else "not"
        raise ProgramError(
            f"the corrected program has {len(theirs)} moves and holes, {word} the {len(mine)} of the "
            "nominal one, so it is not a correction of it; give the two programs of one job",
            code="OLP562",
        )
    groups = apart((len(program.toolpath),), np.int64)
    tips, others = Tips(corrected.toolpath, model), _Others()
    i = j = tries = 0
    width = 2 * _PAGE
    while i < len(mine):
        ends = np.arange(i, min(i + _PAGE, len(mine)))
        if len(mine) < len(theirs):
            page = Page.of(mine, i, min(i + _PAGE, len(mine)))
            other = Page.of(theirs, j, min(j + width, len(theirs)))
            alignment = Alignment(page, target_mm, other, tips, near_mm, tries)
            ends, tries = j + alignment.ends(), alignment.tries
            # the page of the other program was too short
            width = width if 2 * len(ends) > len(page) else 2 * width
            if not len(ends):
                continue
        pair = _Pair.of(mine, i, theirs, ends)
        base = int(theirs.first(j, j + 1)[0])
        tip = tips.of(base, int(pair.end[-1]) + 1)
        others.add(program, target_mm, pair.last, tip.take(pair.end - base, axis=0))
        groups[pair.first[0] : pair.last[-1] + 1] = _groups(target_mm, pair, tip, base)
        i, j = i + len(ends), int(ends[-1]) + 1
        tell("prove", i / len(mine))
        unload()
    others.refuse(program)
    return groups


@dataclass(frozen=True, slots=True, eq=False)
class _Pair:
    """(u,) `first` and `last` moves of nominal units, and `begin` and `end`: those of the unit of the
    corrected program at which each ends."""

    first: Index
    last: Index
    begin: Index
    end: Index

    @staticmethod
    def of(mine: Units, i: int, theirs: Units, ends: Index) -> _Pair:
        """Nominal units from `i` on that end at units `ends` (u,)."""
        j, last, some = int(ends[0]), int(ends[-1]) + 1, i + len(ends)
        begin, end = theirs.first(j, last)[ends - j], theirs.last(j, last)[ends - j]
        return _Pair(mine.first(i, some), mine.last(i, some), begin, end)


@dataclass(slots=True)
class _Others:
    """Counts of waypoints, of those that are far off, and the move of the first of these."""

    counted: int = 0
    far: int = 0
    first: int = 0

    def add(self, program: Program, target: TargetRows, move: Index, tip: Array) -> None:
        """Count the ends of units, which are moves (u,) and reach tips (u, 3)."""
        nominal, goal = program.toolpath, target[move]
        counted = ((nominal.flag[move] & FREE) == 0) & ~all_in_row(np.isnan(goal))
        far = counted & ~(most_in_row(off_mm(tip, goal)) < FAR_MM)
        if far.any() and not self.far:
            self.first = int(move[np.argmax(far)])
        self.counted += int(counted.sum())
        self.far += int(far.sum())

    def refuse(self, program: Program) -> None:
        """Raise ProgramError where most waypoints are far off: this is another job."""
        if self.far > _MOST_FAR * self.counted:
            stated = program.in_original()
            line = stated.place(int(stated.toolpath.line[self.first]))
            raise ProgramError(
                f"{self.far} of {self.counted} waypoints are farther than {FAR_MM:g} mm from those "
                f"of the nominal program, the first at its line {line}; it is not a "
                "correction of this program for this machine",
                code="OLP562",
            )


def _groups(target: TargetRows, units: _Pair, tip: Array, base: int) -> Index:
    """(m,) the last move of the corrected program for each nominal move of units. `tip` are those of its
    moves from `base` on."""
    # of a hole: the strokes one by one; one peck more belongs to the last stroke
    first, last, begin, end = units.first, units.last, units.begin.copy(), units.end
    extra = (end - begin) - (last - first)
    longer = np.flatnonzero((last > first) & (extra > 0))
    for more in distinct(extra[longer]).tolist():
        some = longer[extra[longer] == more]
        strokes = [target[first[some] + k] for k in range(_STROKES)]
        begin[some] += _first_strokes(strokes, tip, begin[some] - base, more)
    unit = np.repeat(np.arange(len(first)), last - first + 1)
    move = first[0] + np.arange(len(unit))
    groups: Index = np.minimum(begin[unit] + move - first[unit], end[unit])
    groups[last - first[0]] = end
    return groups


def _first_strokes(strokes: list[Array], tip: Array, begin: Index, more: int) -> Index:
    """(m,) with how many of its `more` moves each corrected hole begins before the first of the nominal one:
    rapids to the hole that the nominal program does not need. `strokes` (m, 3) are the first moves of the
    nominal holes, `begin` (m,) the first ones of the corrected holes."""
    away = np.zeros((more + 1, len(begin)))
    for k, size in enumerate(away):
        for stroke, goal in enumerate(strokes):
            off = np.abs(tip.take(begin + (k + stroke), axis=0) - goal)
            for column in off.T:
                size += column
    return np.asarray(away.argmin(axis=0))
