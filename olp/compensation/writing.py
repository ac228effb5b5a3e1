"""Writes a plan back into the text of its program, whatever the dialect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from olp.compensation.block_writer import BlockWriter
from olp.compensation.digits import INT10
from olp.compensation.plan import Plan
from olp.compensation.statement_writer import StatementWriter
from olp.compensation.tally import Tally
from olp.compensation.verbatim_writer import VerbatimWriter
from olp.compensation.writer import Task, Writer
from olp.core.machine import Vector
from olp.core.units import MM_PER_INCH
from olp.errormodel.base import ErrorModel
from olp.program.program import Program
from olp.program.text.numbers import Placing


@dataclass(frozen=True, slots=True, eq=False)
class Written:
    """The corrected bytes, and whether anything is `changed`; (n,) `parts`, how many moves
    they have for each nominal one; and what was changed."""

    text: bytes
    changed: bool
    parts: npt.NDArray[np.int32]
    tally: Tally


def write(
    program: Program,
    plan: Plan,
    model: ErrorModel,
    *,
    tolerance_mm: float,
    increments_mm: Vector,
    stamp: bytes,
    stamp_always: bool = False,
) -> Written:
    """Write a plan. The program is one that was read with its words; with `stamp_always` it is stamped also
    where nothing changes. Raises ProgramError where the plan cannot be written in the dialect."""
    task = Task(program, plan, model, tolerance_mm, increments_mm, stamp, stamp_always)
    writer = _writer(program, plan)(task)
    text = writer.text()
    return Written(text, text is not program.data, writer.parts, writer.tally)


def _writer(program: Program, plan: Plan) -> type[Writer]:
    """What a program needs: a writer of blocks of words, of whole statements, or of verbatim numbers."""
    if program.statements is None:
        return BlockWriter
    if program.statements.decimal and not _plain(program, plan):
        return VerbatimWriter
    return StatementWriter


def _plain(program: Program, plan: Plan) -> bool:
    """Whether the writer of statements would write verbatim numbers the same: no column is padded, and no
    number has a needless sign or needless zeros or is shared. Nothing comes behind a move that is split."""
    words, statements = program.words, program.statements
    if words is None or statements is None or not len(words.start):
        return False
    split = np.unique(plan.move[1:][plan.move[1:] == plan.move[:-1]])
    if not np.isin(statements.end[split], program.line_end).all():
        return False
    units = {frame.unit_mm for frame in program.toolpath.frames}
    if statements.decimal != b"." or not units <= {1.0, MM_PER_INCH}:
        return False
    slot = program.slot[program.slot >= 0]
    if len(slot) != program.slot.size or len(slot) != len(words.start):
        return False
    text = np.frombuffer(program.data, np.uint8)
    size = np.abs(words.mantissa)
    whole = size // INT10[words.decimals]
    length = 1 + (whole[:, None] >= INT10[1:10]).sum(axis=1) + (words.mantissa < 0)
    length += np.where(words.decimals > 0, words.decimals + 1, 0)
    # zero behind a minus, which rounding leaves
    length += (size == 0) & (text[words.number] == ord("-"))
    # a plus, zeros in front and exponents all show in the length
    if (words.end - words.number != length).any() or (slot != np.arange(len(slot))).any():
        return False
    return (
        not Placing(program.data, words.number, words.end).padded
        and not (text[words.number] == ord("+")).any()
    )
