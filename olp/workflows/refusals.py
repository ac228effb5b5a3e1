"""A program read with all the reasons of a refusal, and these as findings and as data."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from olp.core.errors import ProgramError, Reason, Refused
from olp.core.machine import Setup
from olp.files.sources import Source, Sources
from olp.findings.catalogue import RULES, Finding
from olp.program.dialect import Dialect, Options
from olp.program.program import Program
from olp.program.survey import read_all
from olp.workflows.flatten import beside

#: Lines that a finding names.
_LINES = 10

REFUSALS = tuple(code for code, rule in RULES.items() if rule.topic == "refusal")


def read(
    sources: Sources, program: Source, setup: Setup, dialect: Dialect, options: Options | None = None
) -> Program:
    """Read a program. Raises Refused with all the reasons where there are several, ProgramError where there
    is one."""
    parsed = read_all(program.data, setup, dialect, options, subprograms=beside(sources, program))
    if not program.data.strip():
        raise ProgramError("the file is empty; expected a program of at least one block", code="OLP501")
    return parsed


def reasons_of(error: ProgramError) -> tuple[Reason, ...]:
    """All the reasons of a refusal."""
    if isinstance(error, Refused):
        return error.reasons
    return (Reason(error.line, error.code, error.message, ""),)


def findings_of(error: ProgramError) -> tuple[Finding, ...]:
    """The reasons of a refusal as findings; those that are alike are one."""
    alike: dict[tuple[str, str, bool], list[Reason]] = {}
    for reason in reasons_of(error):
        alike.setdefault(reason.kind, []).append(reason)
    return tuple(_finding(reasons) for reasons in alike.values())


def _finding(reasons: list[Reason]) -> Finding:
    first = reasons[0]
    lines = tuple(reason.line for reason in reasons if reason.line is not None)
    return Finding(first.code, first.sentence, first.line, lines[:_LINES], len(reasons))


def parts_of(error: ProgramError) -> dict[str, Any]:
    """The parts of a report on a refused program; `refused` are its reasons as data."""
    return {
        "refused": [row | {"remedy": RULES[row["code"]].remedy} for row in map(asdict, reasons_of(error))],
        "refused_complete": not isinstance(error, Refused) or error.complete,
        "findings": [finding.as_dict() for finding in findings_of(error)],
    }


def short(error: ProgramError) -> ProgramError:
    """The error of a verb that has listed all reasons: a single one, or the first with their number."""
    if not isinstance(error, Refused):
        return error
    count = f"{'' if error.complete else 'at least '}{len(error.reasons)}"
    return ProgramError(
        f"{error.message}; {count} statements are refused in all, and the report lists each with its reason",
        file=error.file,
        line=error.line,
        code=error.code,
    )
