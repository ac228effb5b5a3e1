"""What a program may state at most, so that a short text makes no work without end."""

from __future__ import annotations

import numpy as np

from olp.core.errors import ProgramError
from olp.program.program import Program

#: further turns of all arcs: of a short program, and for each byte of a long one
_TURNS = 10_000
_TURNS_PER_BYTE = 0.25


def bounded(program: Program) -> Program:
    """The same program. Raises ProgramError with the line where its arcs have made too many turns."""
    path = program.toolpath
    turns = np.maximum(np.abs(path.arcs.sweep_rad) / (2 * np.pi) - 1, 0.0)
    limit = max(_TURNS, int(_TURNS_PER_BYTE * len(program.data)))
    past = np.flatnonzero(np.cumsum(turns) > limit)
    if past.size:
        raise ProgramError(
            f"the arcs up to here make more than {limit} further turns; divide the program",
            line=int(path.line[path.arcs.move[past[0]]]),
            code="OLP543",
        )
    return program
