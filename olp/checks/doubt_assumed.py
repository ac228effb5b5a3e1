"""What is assumed where the call states the errors of a machine in place of files."""

from __future__ import annotations

from collections.abc import Sequence

from olp.checks.base import finding, lines_of
from olp.core.arrays import distinct
from olp.core.toolpath import Toolpath
from olp.findings.catalogue import Finding


def assumption_findings(path: Toolpath, assumed: Sequence[str], *, by_height: bool) -> list[Finding]:
    """Each assumption; and with errors that depend on Z `by_height`, tools whose lengths would count."""
    findings = [finding("OLP470", sentence) for sentence in assumed]
    used = distinct(path.frame).tolist() if len(path) else []
    tools = {path.frames[i].tool: i for i in reversed(used) if path.frames[i].tool is not None}
    if by_height and len(tools) > 1:
        names = ", ".join(str(number) for number in sorted(tools)[:5])
        what = f"the error depends on Z, and the program uses {len(tools)} tools ({names}) of unknown lengths"
        findings.append(finding("OLP471", what, lines_of(path, path.frame == max(tools.values()))[:1]))
    return findings
