"""What a reader of lists and described languages took for granted, and what lies between places of a list."""

from __future__ import annotations

import numpy as np

from olp.checks.base import finding, lines_of
from olp.compensation.plan import targets, zero_shifts
from olp.core.geometry import segment_distance
from olp.errormodel.base import ErrorModel
from olp.findings.catalogue import Finding
from olp.program.program import Program
from olp.proof.proof import Proof

#: Where the way between two places is looked at.
_SHARES = np.linspace(0.0, 1.0, 18)[1:-1]
_CODES = {"told": "OLP331", "turning": "OLP332", "unmarked": "OLP626"}


def remark_findings(program: Program) -> list[Finding]:
    """What was told from the text rather than stated."""
    return [finding(_CODES[name], said, [line]) for name, line, said in program.remarks if name in _CODES]


def between_findings(program: Program, proof: Proof, model: ErrorModel) -> list[Finding]:
    """How far a straight way between places would leave the nominal one; nobody says that it is straight."""
    if not any(name == "joined" for name, _, _ in program.remarks) or len(proof.written) < 2:
        return []
    path, command = program.toolpath, proof.written.end_mm
    target = targets(path, zero_shifts(path.frames, model))
    tool, step = path.tool_mm(), np.diff(command, axis=0)
    away = np.zeros(len(path))
    # the ends are right but for rounding: only what the error may bend has to be looked at
    bound = model.chord_bound(step, tool if tool.ndim == 1 else tool[1:])
    some = np.flatnonzero(bound > proof.tolerance_mm)
    tool_vector = tool if tool.ndim == 1 else tool[some + 1]
    for share in _SHARES if some.size else ():
        at = command[some] + share * step[some]
        actual = at + model.error(at, tool_vector)
        away[some + 1] = np.fmax(away[some + 1], segment_distance(actual, target[some], target[some + 1]))
    far = away > proof.allowed_mm
    if not far.any():
        return []
    said = (
        f"between {int(far.sum())} places a straight way would leave the nominal one by up to "
        f"{away.max() * 1e3:.2g} um; no rows were inserted"
    )
    return [finding("OLP333", said, lines_of(path, far))]
