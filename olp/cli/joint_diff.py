"""What a correction on a machine with rotary joints changed, line by line.

The moves of both programs belong together by the proof, and so do their lines. Lines between these are
partners in their order.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from difflib import SequenceMatcher

import numpy as np

from olp.cli.diff import Pair, listed
from olp.core.spool import whole
from olp.core.units import RAD_PER_URAD, UM_PER_MM
from olp.program.text.line_ends import LINE_END_TEXT
from olp.workflows.joints.correct import ProvedJoints

#: A number that is no part of a name.
_NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)")
#: A change of a coordinate below this is none, um or urad.
_NONE = 0.05


def render(done: ProvedJoints, *, colour: bool = False) -> str:
    """The changed lines as text: line in the nominal program, nominal, corrected, and the change of the
    coordinates in um and urad: corrected command minus nominal command."""
    nominal, corrected = (
        LINE_END_TEXT.split(whole(path.program.data).decode("latin-1"))
        for path in (done.nominal, done.corrected)
    )
    partners, last = _partners(done)
    words = done.nominal.coordinates
    scale = np.where(words.rotary, np.radians(1.0) / RAD_PER_URAD, UM_PER_MM)
    change = (done.corrected.end[done.proof.groups] - done.nominal.end) * scale

    def changes(i: int, j: int) -> str:
        if partners.get(i) != j:
            return ""
        row = change[last[i]].tolist()
        return "  ".join(
            f"{name}{by:+.1f}" for name, by in zip(words.names, row, strict=True) if abs(by) >= _NONE
        )

    origin = done.nominal.program.origin
    return listed(
        nominal, corrected, _pairs(nominal, corrected, partners), changes,
        place=str if origin is None else lambda line: origin.place(origin.line_of(line)),
        colour=colour, unit="um, urad",
    )  # fmt: skip


def _partners(done: ProvedJoints) -> tuple[dict[int, int], dict[int, int]]:
    """Lines, counted from 0, of nominal moves with those that the corrected ones end in, both ascending; and
    the last move of each nominal line."""
    partners: dict[int, int] = {}
    lines = done.nominal.line.tolist(), done.corrected.line[done.proof.groups].tolist()
    last = {line - 1: row for row, line in enumerate(lines[0])}
    for i, row in sorted(last.items()):
        j = lines[1][row] - 1
        if not partners or j > next(reversed(partners.values())):
            partners[i] = j
    return partners, last


def _pairs(nominal: list[str], corrected: list[str], partners: dict[int, int]) -> Iterator[Pair]:
    """All lines in the order of the texts; None where a line has no partner."""
    i = j = 0
    for here, there in (*partners.items(), (len(nominal), len(corrected))):
        yield from _between(nominal, corrected, (i, here), (j, there))
        if here < len(nominal):
            yield here, there
        i, j = here + 1, there + 1


def _between(
    nominal: list[str], corrected: list[str], here: tuple[int, int], there: tuple[int, int]
) -> Iterator[Pair]:
    """The lines from a move to the next: partners where there are as many, else where they are alike but for
    their numbers."""
    if here[1] - here[0] == there[1] - there[0]:
        yield from zip(range(*here), range(*there), strict=True)
        return
    before, after = (
        [_NUMBER.sub("", line) for line in lines]
        for lines in (nominal[slice(*here)], corrected[slice(*there)])
    )
    for _, a, b, c, d in SequenceMatcher(None, before, after, autojunk=False).get_opcodes():
        rows, others = range(here[0] + a, here[0] + b), range(there[0] + c, there[0] + d)
        if len(rows) == len(others):
            yield from zip(rows, others, strict=True)
        else:
            yield from ((i, None) for i in rows)
            yield from ((None, k) for k in others)
