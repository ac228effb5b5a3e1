"""Findings: what you should know about a run, as data with stable codes.

Every code is a row in `olp.findings.codes`, so that the report, `--select`, `--fail-on` and `olp explain`
agree. The catalogue finds every module there that holds RULES.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Iterable, Iterator
from dataclasses import replace
from importlib import import_module

from olp.core.values import dataclass
from olp.findings import codes
from olp.findings.rule import Rule, Severity


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding; `line` counts from 1 in the program, `lines` are the first few of all lines concerned.
    `files` are their files where some are not the program's (""); the first is that of `line`. A doubt that
    is `accepted` is one step less severe."""

    code: str
    message: str
    line: int | None = None
    lines: tuple[int, ...] = ()
    count: int = 1
    accepted: bool = False
    files: tuple[str, ...] = ()

    @property
    def severity(self) -> Severity:
        severity = RULES[self.code].severity
        return Severity(max(severity - 1, Severity.INFO)) if self.accepted else severity

    def accept(self) -> Finding:
        """The same finding, accepted."""
        return replace(self, accepted=True)

    def as_dict(self) -> dict[str, object]:
        stated: dict[str, object] = {
            "code": self.code,
            "severity": self.severity.name.lower(),
            "message": self.message,
            "line": self.line,
            "lines": list(self.lines),
            "count": self.count,
        }
        if self.files:
            stated |= ({"file": self.files[0]} if self.files[0] else {}) | {"files": list(self.files)}
        return stated | ({"accepted": True} if self.accepted else {})


def rows() -> Iterator[Rule]:
    """The rules of all modules of `olp.findings.codes`."""
    for module in pkgutil.iter_modules(codes.__path__, f"{codes.__name__}."):
        yield from import_module(module.name).RULES


#: Every rule by its code, in the order of codes.
RULES: dict[str, Rule] = {rule.code: rule for rule in sorted(rows(), key=lambda rule: rule.code)}

#: The codes that `olp check` looks for.
GATE_CODES = tuple(code for code, rule in RULES.items() if rule.gate)

#: The codes that --accept takes.
DOUBTS = frozenset(code for code, rule in RULES.items() if rule.doubt)


def worst(findings: Iterable[Finding]) -> Severity | None:
    """The highest severity among findings, None where there are none."""
    return max((finding.severity for finding in findings), default=None)
