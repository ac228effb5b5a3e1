"""What the time of a program leaves out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from olp.checks.base import beside_axes, finding, lines_of
from olp.core.toolpath import Toolpath
from olp.findings.catalogue import Finding


def control_findings(title: str, beside: Sequence[dict[str, Any]]) -> list[Finding]:
    """Words of the program (rows with `word` and `line`) that the time on a control leaves out."""
    lines: dict[str, list[int]] = {}
    for row in beside:
        lines.setdefault(row["word"], []).append(row["line"])
    return [finding("OLP210", f"the time on {title} leaves out {word}", at) for word, at in lines.items()]


def time_findings(path: Toolpath, control: Sequence[dict[str, Any]]) -> list[Finding]:
    """Moves of axes that are not timed, and what the program asks of the control (rows with `what`, `count`
    and `seconds`) without a stated time."""
    findings = []
    beside = beside_axes(path, slice(0, len(path)))
    if beside.any():
        lines = lines_of(path, beside)
        what = f"{len(lines)} blocks also move another axis; only X, Y and Z are timed there"
        findings.append(finding("OLP208", what, lines))
    unknown = [f"{row['count']} x {row['what']}" for row in control if row["seconds"] is None]
    if unknown:
        findings.append(finding("OLP209", f"no time is stated for {', '.join(unknown)}"))
    return findings
