"""What a reader of lists and described languages took for granted, and what lies between places of a list."""

from __future__ import annotations

import numpy as np

from olp.checks.base import finding, lines_of
from olp.findings import Finding
from olp.program.program import Program
from olp.proof import Proof
from olp.toolpath import Kind

_CODES = {"told": "OLP331", "turning": "OLP332"}


def told_findings(program: Program) -> list[Finding]:
    """What was told from the text rather than stated."""
    return [finding(_CODES[name], said, [line]) for name, line, said in program.remarks if name in _CODES]


def between_findings(program: Program, proof: Proof) -> list[Finding]:
    """How far a straight way between places would leave the nominal one; nobody says that it is straight."""
    if not any(name == "joined" for name, _, _ in program.remarks):
        return []
    path = program.toolpath
    away = np.where(proof.after.judged & (path.kind == Kind.RAPID), np.nan_to_num(proof.after.path), 0.0)
    away[:1] = 0.0
    far = away > proof.allowed_mm
    if not far.any():
        return []
    said = (
        f"between {int(far.sum())} places a straight way would leave the nominal one by up to "
        f"{away.max() * 1e3:.2g} um; no rows were inserted"
    )
    return [finding("OLP333", said, lines_of(path, far))]
