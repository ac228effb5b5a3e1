"""What a worker of a batch does: one program corrected, or a released one judged, from bytes to bytes.

Nothing here reads or writes a file, and a task is the same wherever it is done.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from olp.core.errors import OlpError, ProgramError
from olp.core.values import dataclass
from olp.core.version import __version__
from olp.errormodel.known import KnownErrors
from olp.files.sources import Parcel, Source, Wanted
from olp.findings.catalogue import Finding
from olp.workflows import correct, refusals, verify
from olp.workflows.correct import Correction, CorrectOptions
from olp.workflows.session import Session
from olp.workflows.verify import VerifyOptions

#: Makes the review page of a correction: session, nominal program, options, correction, name of the output.
Page = Callable[[Session, Source, CorrectOptions, Correction, str], bytes]

#: Exit code of a program that no error of ours ended.
UNEXPECTED = 4
#: Setups that a worker keeps.
_KEPT = 16
#: letters of the text of an exception that is not ours
_MOST_LETTERS = 200

#: Sessions by the digest of their setup. A thread has its own, as a session is no shared value.
_SESSIONS = threading.local()


@dataclass(frozen=True, slots=True)
class Config:
    """Machine, job and calibration of tasks, as bytes: `files` by their names in a parcel, `there` are names
    of files that are there and are not sent, `digest` stands for all of this. `calibration` is another file
    than the machine names, where one is tried. `known` are errors that are stated in place of a machine."""

    machine: str | None
    job: str | None
    dialect: str | None
    files: Mapping[str, bytes | None]
    there: frozenset[str]
    digest: str
    calibration: str | None = None
    known: KnownErrors | None = None

    def session(self) -> Session:
        """A session of its own, with the calibration as far as it is loaded by then."""
        kept: dict[str, Session] = _SESSIONS.__dict__.setdefault("kept", {})
        if self.digest not in kept:
            sources = Parcel(self.files, self.there)
            machine = self.machine if self.known is None else self.known
            session = Session.start(machine, self.job, dialect=self.dialect, sources=sources)
            if self.calibration is not None:
                setup = session.setup
                other = replace(setup.machine, calibration=self.calibration)
                session = session.of(replace(setup, machine=other))
            while len(kept) >= _KEPT:
                del kept[next(iter(kept))]
            kept[self.digest] = session
        return kept[self.digest]


@dataclass(frozen=True, slots=True)
class Task:
    """A program to correct. `files` are those beside the setup, the program among them, by their names in a
    parcel. `output` is the name of the corrected program, `report` that of its report ("": none), with
    `plots` or without. `page` makes its review page. With `released`, the name of a corrected program among
    the files, that one is judged instead, and nothing is written."""

    program: str
    files: Mapping[str, bytes | None]
    options: CorrectOptions
    output: str
    report: str = ""
    plots: bool = False
    page: Page | None = None
    released: str | None = None
    version: str = __version__


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a task: a row of the summary, and the bytes to be written, None where there are none.
    `wanted` is a file that the task needs before it can be done; there is no row then. `used` are the names
    of the files that it asked for. `lasting`: the same inputs have the same outcome."""

    row: Mapping[str, Any] | None
    text: bytes | None = None
    report: bytes | None = None
    page: bytes | None = None
    used: tuple[str, ...] = ()
    wanted: str | None = None
    lasting: bool = True


def perform(config: Config, task: Task) -> Outcome:
    """Do a task. Errors are outcomes, too."""
    parcel = Parcel({**config.files, **task.files}, config.there)
    try:
        if task.version != __version__:
            sentence = (
                f"a worker has olp {__version__}, and this call is of olp {task.version}; install the same "
                "version on all workers"
            )
            return _failed(sentence, UNEXPECTED, lasting=False)
        session = config.session().reading_from(parcel)
        source = session.sources.source(task.program)
        if task.released is not None:
            outcome = _judged(session, source, task, session.sources.source(task.released))
        else:
            outcome = _corrected(session, source, task)
    except Wanted as lack:
        return Outcome(None, wanted=lack.path)
    except ProgramError as error:
        findings = refusals.findings_of(error, task.program)
        outcome = refused(error.in_file(task.program), findings)
    except OlpError as error:
        outcome = refused(error)
    except MemoryError:
        outcome = _failed(
            f"{task.program}: needs more memory than a worker has; use fewer", UNEXPECTED, lasting=False
        )
    except Exception as error:
        text = " ".join(f"{type(error).__name__}: {error}".split())[:_MOST_LETTERS]
        sentence = f"{task.program}: this is a defect of olp ({text}); olp correct says more"
        outcome = _failed(sentence, UNEXPECTED, lasting=False)
    return replace(outcome, used=tuple(sorted(parcel.used)))


def refused(error: OlpError, findings: Iterable[Finding] = ()) -> Outcome:
    """The outcome of a program that is refused with an error."""
    return _failed(str(error), error.exit_code, findings)


def lost(message: str) -> Outcome:
    """The outcome of a task whose workers ended, again and again."""
    return _failed(message, UNEXPECTED, lasting=False)


def _failed(
    message: str, exit_code: int, findings: Iterable[Finding] = (), *, lasting: bool = True
) -> Outcome:
    row = {"message": message, "exit_code": exit_code, "ok": False, "findings": _counts(findings)}
    return Outcome(row, lasting=lasting)


def _corrected(session: Session, source: Source, task: Task) -> Outcome:
    options = task.options
    result = correct.run(session, source, options)
    filed = page = None
    if task.report:
        from olp.workflows import report

        nominal = source.holding(result.nominal)
        filed = report.correction(result, nominal, session, options, task.report, plots=task.plots)
    if task.page is not None:
        page = task.page(session, source, options, result, task.output)
    return Outcome(_row(result.report, result.findings), result.data, filed, page)


def _judged(session: Session, source: Source, task: Task, released: Source) -> Outcome:
    options = VerifyOptions(**task.options.proof(), outside_box="hold")
    result = verify.run(session, source, released, options)
    return Outcome(_row(result.report, result.findings))


def _row(stated: Mapping[str, Any], findings: Iterable[Finding]) -> dict[str, Any]:
    """The row of a summary: figures of a report, none of its own."""
    verdict, deviation, program = stated["verdict"], stated["deviation"], stated["program"]
    numerical, part = verdict["numerical"], verdict["part"]
    calibration = stated["calibration"]
    measured = calibration.get("measured")
    return {
        "lines": program["lines"],
        "moves": program["moves"],
        "dialect": program["dialect"],
        "machine": stated["machine"]["name"],
        "calibration": {
            "measured": None if measured is None else measured.isoformat(),
            "sha256": calibration["sha256"],
        },
        "uncorrected_um": deviation["before"]["between"]["max_um"],
        "corrected_um": numerical["largest_um"],
        "allowed_um": numerical["allowed_um"],
        "holds": numerical["holds"],
        "part_tolerance_um": None if part is None else part["tolerance_um"],
        "part_ok": None if part is None else part["holds"],
        "ok": verdict["ok"],
        "sentences": list(verdict["sentences"]),
        "findings": _counts(findings),
    }


def _counts(findings: Iterable[Finding]) -> list[dict[str, Any]]:
    """Codes with severity and number, in the order in which they are found."""
    rows: dict[str, dict[str, Any]] = {}
    for finding in findings:
        severity = finding.severity.name.lower()
        row = rows.setdefault(finding.code, {"code": finding.code, "severity": severity, "count": 0})
        row["count"] += finding.count
    return list(rows.values())
