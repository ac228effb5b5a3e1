"""Doubts about the text of a program."""

from __future__ import annotations

import re

from olp.checks.base import finding
from olp.core.machine import Setup
from olp.core.patterns import pattern
from olp.findings.catalogue import Finding
from olp.program.program import Program

#: Comments of the controls on which the point decides.
_COMMENT = pattern(rb"\([^)\n]*\)?|;[^\n]*")
#: A word of a length with a decimal point.
_POINTED = pattern(rb"[XYZIJKRQ]\s*[+-]?\s*[0-9]*\.", re.IGNORECASE)


def program_doubts(program: Program, setup: Setup) -> list[Finding]:
    """Lengths without a decimal point, where the machine file does not say what they mean."""
    line = next((line for name, line, _ in program.remarks if name == "increments"), None)
    if line is None or setup.machine.decimal_point is not None:
        return []
    if _POINTED.search(_COMMENT.sub(b" ", program.data)):
        what = f"line {program.place(line)} has a length without a decimal point, read as least increments"
        return [finding("OLP302", what, [line])]
    what = "no length of the program has a decimal point: all are read as least increments, X100 as 0.1 mm"
    return [finding("OLP461", what, [line])]
