"""Findings about the stamps of corrected programs."""

from __future__ import annotations

from olp.checks.base import finding
from olp.compensation.stamp import find_stamp, is_of, line_of
from olp.core.spool import Text
from olp.findings.catalogue import Finding


def stamp_findings(data: Text, nominal: Text | None, digest: str) -> list[Finding]:
    """Findings where a program is corrected twice, or with another calibration than that with the hash
    `digest`. `nominal` is the nominal program that was given with it."""
    findings = []
    first = find_stamp(data)
    if first is not None and find_stamp(data[first.end() :]) is not None:
        findings.append(
            finding("OLP311", "the program has two stamps of a correction", [line_of(data, first)])
        )
    if nominal is not None and find_stamp(nominal) is not None:
        findings.append(finding("OLP311", "the program given as nominal has the stamp of a correction"))
    if first is not None and not is_of(first, digest):
        what = f"the program says `{first.group().decode()}`, the calibration in use is {digest[:12]}"
        findings.append(finding("OLP312", what, [line_of(data, first)]))
    return findings
