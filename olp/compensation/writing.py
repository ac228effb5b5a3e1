"""Writes a plan back into the text of its program, whatever the dialect."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from olp.compensation.block_writer import BlockWriter
from olp.compensation.digits import INT10
from olp.compensation.plan import Plan
from olp.compensation.tally import Tally
from olp.compensation.writer import Task, Writer
from olp.core.arrays import Index, distinct, is_in
from olp.core.progress import Progress, part, silent
from olp.core.spool import Spool
from olp.core.units import MM_PER_INCH
from olp.core.values import dataclass
from olp.program.bands import Band
from olp.program.program import Program
from olp.program.text.columns import Columns, Packed
from olp.program.text.numbers import Placing


@dataclass(frozen=True, slots=True, eq=False)
class Written:
    """The corrected text, None where nothing is changed, and what was changed. `uncorrected` are moves that
    are left so, (n,) `parts` how many moves the text has for each nominal one. `starts` as
    `Writer.starts`."""

    text: Spool | None
    uncorrected: Index
    parts: Packed
    tally: Tally
    starts: Index | None = None


def write(task: Task, plans: Iterable[tuple[Band, Plan]], tell: Progress = silent) -> Written:
    """Write the bands of a program, each with its plan, as they come; `tell` is told the second half of each.
    Raises ProgramError where a plan cannot be written in the dialect."""
    writer: Writer | None = None
    uncorrected, parts = [], Columns()
    for band, rows in plans:
        if writer is None:
            writer = _writer(band.program, rows)(task)
        writer.add(band, rows, part(tell, band.middle, band.until))
        uncorrected.append(band.first + rows.uncorrected)
        parts.put("parts", writer.parts, np.int32)
    assert writer is not None
    starts = writer.starts()
    return Written(writer.text(), np.concatenate(uncorrected), parts.packed("parts"), writer.tally, starts)


def _writer(program: Program, plan: Plan) -> type[Writer]:
    """What a program needs: a writer of blocks of words, of whole statements, of verbatim numbers, or of
    targets."""
    if program.statements is None:
        return BlockWriter
    if program.targets is not None:
        from olp.compensation.target_writer import TargetWriter

        return TargetWriter
    if program.in_blocks:
        from olp.compensation.conversational_writer import ConversationalWriter

        return ConversationalWriter
    if program.statements.decimal and not _plain(program, plan):
        from olp.compensation.verbatim_writer import VerbatimWriter

        return VerbatimWriter
    from olp.compensation.statement_writer import StatementWriter

    return StatementWriter


def _plain(program: Program, plan: Plan) -> bool:
    """Whether the writer of statements would write verbatim numbers the same: no column is padded, and no
    number has a needless sign or needless zeros or is shared. Nothing comes behind a move that is split."""
    words, statements = program.words, program.statements
    if words is None or statements is None or not len(words.start):
        return False
    split = distinct(plan.move[1:][plan.move[1:] == plan.move[:-1]])
    if not is_in(statements.end[split], program.line_end[:]).all():
        return False
    units = {frame.unit_mm for frame in program.toolpath.frames}
    if statements.decimal != b"." or not units <= {1.0, MM_PER_INCH}:
        return False
    slot = program.slot[program.slot >= 0]
    if len(slot) != program.slot.size or len(slot) != len(words.start):
        return False
    text = np.frombuffer(program.data, np.uint8)
    mantissa, begin, end = words.mantissa[:], words.number[:], words.end[:]
    size = np.abs(mantissa)
    whole = size // INT10[words.decimals]
    length = 1 + (whole[:, None] >= INT10[1:10]).sum(axis=1) + (mantissa < 0)
    length += np.where(words.decimals > 0, words.decimals + 1, 0)
    # zero behind a minus, which rounding leaves
    length += (size == 0) & (text[begin] == ord("-"))
    # a plus, zeros in front and exponents all show in the length
    if (end - begin != length).any() or (slot != np.arange(len(slot))).any():
        return False
    return not (Placing(program.data, begin, end).padded or (text[begin] == ord("+")).any())
