"""A program read with all the reasons of a refusal, and these as findings and as data."""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from olp.core.errors import ProgramError, Reason, Refused
from olp.core.machine import Setup
from olp.core.progress import part
from olp.core.spool import in_parts
from olp.files.sources import Source, Sources
from olp.findings.catalogue import RULES, Finding
from olp.program.dialect import Dialect, Options
from olp.program.program import Program
from olp.program.survey import read_all
from olp.workflows.flatten import AS_IT_IS, UnrollOptions, as_asked, beside, unroller

#: Lines that a finding names.
_LINES = 10
#: What of a reason names a file.
_FILES = ("file", "follows_file")
#: The share of reading that unrolling takes.
_UNROLLED = 0.5

#: The code of refused statements that a control may have and another not.
_NO_SUCH_CODE = "OLP512"
REFUSALS = tuple(code for code, rule in RULES.items() if rule.topic == "refusal")


def read(
    sources: Sources,
    program: Source,
    setup: Setup,
    dialect: Dialect,
    options: Options | None = None,
    unrolling: UnrollOptions = AS_IT_IS,
    *,
    words: bool = True,
    block_delete: bool | None = None,
    kept: bool = False,
) -> tuple[Source, Program]:
    """Read a program, unrolled where that is asked for; the text that was read, and what it says.
    `block_delete` as in `as_asked`. With `kept` a program that needs it is unrolled unasked. Raises Refused
    with all the reasons where there are several, ProgramError where there is one; lines are those of the
    original."""
    options = options or Options()
    unroll = unroller(
        sources, program, setup, dialect, unrolling, block_delete=block_delete,
        tell=part(options.tell, 0.0, _UNROLLED),
    )  # fmt: skip
    if unroll is not None:
        options = replace(options, tell=part(options.tell, _UNROLLED, 1.0))
    survey = partial(
        read_all, program.data, setup, dialect, options, words=words, subprograms=beside(sources, program),
        unroll=unroll, expands=unrolling.expand_cycles,
    )  # fmt: skip
    try:
        try:
            parsed = survey(early=kept)
        except ProgramError as error:
            if not kept:
                raise
            if error.hinted and _can_be_unrolled(sources, program, setup, dialect):
                flat = replace(unrolling, flatten=True)
                return read(
                    sources, program, setup, dialect, options, flat, words=words, block_delete=block_delete
                )
            parsed = survey()
    except ProgramError as error:
        raise _with_control(error, dialect) if setup.machine.assumed else error from None
    if all(some.isspace() for some in in_parts(program.data)):
        raise ProgramError("the file is empty; expected a program of at least one block", code="OLP501")
    return program if unroll is None else program.holding(parsed.data), parsed


def _can_be_unrolled(sources: Sources, program: Source, setup: Setup, dialect: Dialect) -> bool:
    if dialect.unroller is None or dialect.keeper is None:
        return False
    try:
        as_asked(sources, program, setup, dialect, UnrollOptions(flatten=True))
    except ProgramError:
        return False
    return True


def _with_control(error: ProgramError, dialect: Dialect) -> ProgramError:
    """The refusal of a program whose control nothing states: with that of the first code, how to name it."""
    way_on = f"; no file says which control this is for, {dialect.name} is taken: name yours with --dialect"
    if isinstance(error, Refused):
        for i, reason in enumerate(error.reasons):
            if reason.code == _NO_SUCH_CODE:
                named = replace(reason, message=reason.message + way_on)
                return Refused((*error.reasons[:i], named, *error.reasons[i + 1 :]), complete=error.complete)
    elif error.code == _NO_SUCH_CODE:
        error.message += way_on
    return error


def reasons_of(error: ProgramError, name: str) -> tuple[Reason, ...]:
    """All the reasons of a refusal of the program `name`."""
    if isinstance(error, Refused):
        return error.reasons
    file = None if error.file == name else error.file
    return (Reason(error.line, error.code, error.message, "", file=file),)


def findings_of(error: ProgramError, name: str) -> tuple[Finding, ...]:
    """The reasons of a refusal of the program `name` as findings; those that are alike are one."""
    alike: dict[tuple[str | None, str, str, bool], list[Reason]] = {}
    for reason in reasons_of(error, name):
        alike.setdefault(reason.kind, []).append(reason)
    return tuple(_finding(reasons) for reasons in alike.values())


def _finding(reasons: list[Reason]) -> Finding:
    first = reasons[0]
    lines = tuple(reason.line for reason in reasons if reason.line is not None)[:_LINES]
    files = () if first.file is None else (Path(first.file).name,) * len(lines)
    return Finding(first.code, first.sentence, first.line, lines, len(reasons), files=files)


def parts_of(error: ProgramError, name: str) -> dict[str, Any]:
    """The parts of a report on the refused program `name`; `refused` are its reasons as data."""
    return {
        "refused": [_row(reason) for reason in reasons_of(error, name)],
        "refused_complete": not isinstance(error, Refused) or error.complete,
        "findings": [finding.as_dict() for finding in findings_of(error, name)],
    }


def _row(reason: Reason) -> dict[str, Any]:
    """A reason as data, with the names of files where they are not the program's."""
    files = {name: Path(file).name for name in _FILES if (file := getattr(reason, name)) is not None}
    row = {name: value for name, value in asdict(reason).items() if name not in _FILES}
    return row | files | {"remedy": RULES[reason.code].remedy}


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
