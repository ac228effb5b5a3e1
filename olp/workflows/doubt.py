"""The hook of every verb that reads a program: doubts about its inputs, refused unless they are accepted."""

from __future__ import annotations

import datetime
from collections.abc import Iterable, Sequence

from olp.checks.doubt import Inputs, doubts
from olp.compensation.stamp import accepted_in
from olp.core.errors import Doubtful, InputError, UsageError
from olp.core.spool import Text
from olp.findings.catalogue import DOUBTS, RULES, Finding
from olp.findings.rule import Severity
from olp.program.origin import Origin
from olp.program.program import Program
from olp.workflows.original import placed_findings
from olp.workflows.session import Loaded, Session


def acceptable(codes: Sequence[str]) -> frozenset[str]:
    """The codes of --accept. Raises UsageError for a code that is no doubt."""
    accepted = frozenset(code.upper() for code in codes)
    for code in sorted(accepted - DOUBTS):
        what = "is no code of a finding" if code not in RULES else "is no doubt about the inputs"
        raise UsageError(f"--accept {code}: it {what}; expected one of {', '.join(sorted(DOUBTS))}")
    return accepted


def doubted(
    program: Program,
    loaded: Loaded,
    accept: Sequence[str],
    date: datetime.date | None,
    *,
    name: str = "",
    stamped: Text = b"",
    refuse: bool = True,
) -> tuple[Finding, ...]:
    """The doubts of a run; those that the call or the stamp of the text `stamped` accepts are less severe.
    With `refuse`, one that is an error and not accepted raises Doubtful; UsageError as `acceptable`. `name`
    is that of the program."""
    program = program.in_original()
    stated = loaded.stated
    inputs = Inputs(
        loaded.setup, program, loaded.calibration, loaded.model, date, loaded.uncertainty,
        assumed=stated.assumed if stated else (), by_height=stated is not None and stated.by_height,
    )  # fmt: skip
    accepted = acceptable(accept) | accepted_in(stamped, loaded.digest)
    return with_accepted(doubts(inputs), accepted, name=name, origin=program.origin, refuse=refuse)


def doubted_motion(
    program: Program, session: Session, accept: Sequence[str], date: datetime.date | None, name: str
) -> tuple[Finding, ...]:
    """The same for a verb that needs no calibration, of a program that may be corrected: a calibration that
    the machine names and that can be opened is doubted too."""
    if _calibrated(session):
        return doubted(program, session.loaded("hold"), accept, date, name=name, stamped=program.data)
    accepted = acceptable(accept) | accepted_in(program.data, None)
    inputs = Inputs(session.setup, program.in_original(), None, None, date, None)
    return with_accepted(doubts(inputs), accepted, name=name, origin=program.origin)


def with_accepted(
    findings: Iterable[Finding], accepted: frozenset[str], *, name: str = "", origin: Origin | None = None,
    refuse: bool = True,
) -> tuple[Finding, ...]:  # fmt: skip
    """Doubts with those that are `accepted` one step less severe. With `refuse`, another error raises
    Doubtful, which names its line in the program `name`, or in the file that `origin` has for it."""
    result = tuple(f.accept() if f.code in accepted else f for f in findings)
    errors = [finding for finding in result if finding.severity == Severity.ERROR]
    if refuse and errors:
        codes = tuple(dict.fromkeys(finding.code for finding in errors))
        placed = placed_findings(errors, origin)
        raise Doubtful(tuple(_sentence(finding, name) for finding in placed), codes)
    return result


def accepted_of(findings: Sequence[Finding]) -> list[str]:
    """The codes of doubts that were found and accepted, as reports and stamps state them."""
    return sorted({finding.code for finding in findings if finding.accepted})


def _calibrated(session: Session) -> bool:
    machine = session.setup.machine
    if session.stated is not None:
        return True
    if machine.calibration is None or "all" in machine.compensated_by_controller:
        return False
    try:
        session.sources.read(machine.calibration)
    except InputError:
        return False
    return True


def _sentence(finding: Finding, name: str) -> str:
    """What is wrong, where, what was expected, what to do, and how to go on all the same."""
    name = next(filter(None, finding.files[:1]), name)
    place = f"line {finding.line}" + (f" of {name}" if name else "")
    line = f"{place}: " if finding.line is not None else ""
    remedy = RULES[finding.code].remedy
    return f"{finding.code}: {line}{finding.message}. {remedy} --accept {finding.code} goes on all the same."
