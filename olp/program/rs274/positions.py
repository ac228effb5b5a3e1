"""Programs that go from position to position and wait there, for one control."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import CannotCompute
from olp.core.units import AXES
from olp.program.rs274.codes import MACHINE
from olp.program.rs274.profiles.base import Act, Profile

#: Characters of a comment line at most: some controls take no more.
COMMENT_WIDTH = 68


def positions_program(
    profile: Profile, positions_mm: Array, dwell_s: Sequence[float], digits: int, notes: Sequence[str]
) -> bytes:
    """Rapids in machine coordinates (G53) through axis positions (n, 3), each with a dwell after it.

    A position is followed by no dwell where `dwell_s` (n,) is 0. `digits` are the decimals of words, `notes`
    become comments. At first Z alone goes to the height of the first position, which has to be a clear one.
    Raises CannotCompute for a control that is not of this family.
    """
    if profile.codes.get(MACHINE) != Act.EVENT or MACHINE in profile.aliases:
        raise CannotCompute(f"{profile.title} has no G53; take the points from the CSV file")
    opening, closing = (mark.decode() for mark in profile.comment)
    lines = [
        f"{opening}{line}{closing}"
        for note in notes
        for line in textwrap.wrap(plain_note(note), COMMENT_WIDTH)
    ]
    lines.append(f"{profile.metric} G90 G94 {profile.cleared}")
    before: list[str] = []
    for position, wait in zip(np.round(positions_mm, digits).tolist(), dwell_s, strict=True):
        words = [f"{axis}{value + 0.0:.{digits}f}" for axis, value in zip(AXES, position, strict=True)]
        if not before:
            lines.append(f"G53 G0 {words[2]}")
        if words != before:
            lines.append(f"G53 G0 {' '.join(words)}")
        before = words
        if wait > 0.0:
            count = profile.dwell_s(1000.0, pointed=False) == 1.0
            lines.append(f"G4 {profile.dwell}" + (f"{round(1000.0 * wait)}" if count else f"{wait:.3f}"))
    lines.append("M30")
    return ("\n".join(lines) + "\n").encode()


def plain_note(note: str) -> str:
    """The note without marks that would end a comment."""
    return note.replace("(", "[").replace(")", "]").encode("ascii", "replace").decode()
