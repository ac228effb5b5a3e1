"""Writes a plan back into the text of its program, whatever the dialect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from olp.compensation.holes import HolePlan
from olp.compensation.plan import Plan
from olp.compensation.statements import StatementWriter
from olp.compensation.tally import Tally
from olp.compensation.writer import Writer
from olp.errormodel import ErrorModel
from olp.machine import Vector
from olp.program.program import Program


@dataclass(frozen=True, slots=True, eq=False)
class Written:
    """The corrected bytes; (n,) `parts`, how many moves they have for each nominal one; what was changed, and
    the holes of canned cycles."""

    text: bytes
    parts: npt.NDArray[np.int32]
    tally: Tally
    holes: HolePlan


def write(
    program: Program,
    rows: Plan,
    model: ErrorModel,
    *,
    tolerance_mm: float,
    increments_mm: Vector,
    stamp: bytes,
) -> Written:
    """Write a plan. The program is one that was read with its words. Raises ProgramError where it cannot be
    said in its dialect."""
    if program.statements is not None:
        made = StatementWriter(
            program, rows, model, tolerance_mm=tolerance_mm, increments_mm=increments_mm, stamp=stamp
        )
        return Written(made.text(), made.parts, made.tally, HolePlan.of(program, rows, model))
    writer = Writer(program, rows, model, tolerance_mm=tolerance_mm, increments_mm=increments_mm, stamp=stamp)
    return Written(writer.text(), writer.parts, writer.tally, writer.holes)
