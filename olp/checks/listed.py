"""Findings about lists: what their reader assumed, and the path between their positions."""

from __future__ import annotations

import numpy as np

from olp.checks.base import finding, lines_of
from olp.compensation.plan import targets, zero_shifts
from olp.core.geometry import segment_distance
from olp.errormodel.base import ErrorModel
from olp.findings.catalogue import Finding
from olp.program.program import Program
from olp.proof.proof import Proof

#: Where the segment between two positions is sampled.
_SHARES = np.linspace(0.0, 1.0, 18)[1:-1]
_CODES = {"told": "OLP331", "turning": "OLP332", "unmarked": "OLP626"}


def remark_findings(program: Program) -> list[Finding]:
    """What the reader detected in the text because the file does not state it."""
    return [finding(_CODES[name], text, [line]) for name, line, text in program.remarks if name in _CODES]


def between_findings(program: Program, proof: Proof, model: ErrorModel) -> list[Finding]:
    """How far straight moves between positions would leave the nominal path; a list does not state moves."""
    if not any(name == "joined" for name, _, _ in program.remarks) or len(proof.written) < 2:
        return []
    path, command = program.toolpath, proof.written.end_mm
    target = targets(path, zero_shifts(path.frames, model))
    tool, step = path.tool_mm(), np.diff(command, axis=0)
    away = np.zeros(len(path))
    # the ends are right up to rounding: only segments that the error may bend are sampled
    bound = model.chord_bound(step, tool if tool.ndim == 1 else tool[1:])
    some = np.flatnonzero(bound > proof.tolerance_mm)
    tool_vector = tool if tool.ndim == 1 else tool[some + 1]
    for share in _SHARES if some.size else ():
        point = command[some] + share * step[some]
        actual = point + model.error(point, tool_vector)
        away[some + 1] = np.fmax(away[some + 1], segment_distance(actual, target[some], target[some + 1]))
    far = away > proof.allowed_mm
    if not far.any():
        return []
    what = (
        f"straight moves to {int(far.sum())} positions would leave the nominal path by up to "
        f"{away.max() * 1e3:.2g} um; no rows were inserted"
    )
    return [finding("OLP333", what, lines_of(path, far))]
