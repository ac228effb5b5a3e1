"""Blocks with vectors (LN): TX, TY and TZ state the direction of the tool in the workpiece, NX, NY and NZ the
normal of the surface.

Source: Heidenhain, User's Manual Conversational Programming, three-dimensional tool compensation.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Index, Mask
from olp.core.errors import ProgramError
from olp.program.heidenhain.chunk import Chunk
from olp.program.heidenhain.collector import Collected
from olp.program.heidenhain.columns import DIRECTION, NORMAL, Block
from olp.program.heidenhain.modes import Modes

_COMPONENTS = 3


def without_position(chunk: Chunk) -> Index:
    """The lines of LN that state no coordinate."""
    directed = np.flatnonzero(chunk.blocks.block == Block.DIRECTED)
    return np.setdiff1d(directed, chunk.rows.line)


def put_directions(modes: Modes, collector: Collected, chunk: Chunk, line: Index) -> None:
    """Put the directions of a stretch of moves, those of the blocks LN among its lines. Raises ProgramError
    for blocks that do not state where the tool points."""
    blocks = chunk.blocks
    rows = np.flatnonzero(blocks.block[line] == Block.DIRECTED)
    if not rows.size:
        return
    first, last = blocks.words.first_word[[line[0], line[-1] + 1]].tolist()
    letter, row_of = blocks.letter[first:last], np.full(len(blocks.block), -1, np.int64)
    row_of[line[rows]] = np.arange(len(rows))
    own = row_of[blocks.words.line[first:last]]
    slot, times = np.full((len(rows), _COMPONENTS), -1, np.int64), np.zeros((len(rows), _COMPONENTS))
    for column, name in enumerate(DIRECTION):
        index = np.flatnonzero((letter == name) & (own >= 0))
        slot[own[index], column] = index + first
        times[:, column] = np.bincount(own[index], minlength=len(rows))
    normals = np.bincount(own[(letter == NORMAL) & (own >= 0)], minlength=len(rows))
    number = line[rows] + blocks.words.first_line + 1
    stated = np.where(slot >= 0, blocks.value[slot], np.nan)
    _refuse(modes, number, stated, np.asarray((times == 1).all(axis=1)), normals)
    collector.towards.append((collector.moves + rows, stated, slot + chunk.base))


def _refuse(modes: Modes, number: Index, stated: np.ndarray, directed: Mask, normals: Index) -> None:
    """Refuse blocks that do not state the direction, and what the control makes of normals."""
    every = np.ones(len(number), bool)
    for wrong, why in (
        (
            every & (not modes.tip),
            "LN states vectors, which are read behind M128 or FUNCTION TCPM; switch it on before",
        ),
        (
            every & (modes.plane is not None),
            "LN is in a tilted plane, which is not read; cancel the plane by PLANE RESET before",
        ),
        (
            ~directed,
            "LN does not state the direction of the tool; expected TX, TY and TZ, each once",
        ),
        (
            ~np.isin(normals, (0, _COMPONENTS)),
            "LN states a part of the normal of the surface; expected NX, NY and NZ",
        ),
        (
            (normals > 0) & modes.oversize,
            "the control offsets the tool along the normal by DL and DR of TOOL CALL; post the path for this "
            "tool, and call it with DL and DR of 0",
        ),
        (
            (stated == 0.0).all(axis=1),
            "the direction of the tool has no length; expected a component other than 0",
        ),
    ):
        if wrong.any():
            raise ProgramError(why, line=int(number[np.argmax(wrong)]), code="OLP565")
