"""What a worker of a batch does: one program corrected, or a released one judged, from bytes to bytes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from olp.core.errors import OlpError, ProgramError
from olp.core.version import __version__
from olp.files.sources import Parcel, Source, Wanted
from olp.findings.catalogue import Finding
from olp.workflows import correct, refusals, verify
from olp.workflows.batch_task import Config, Outcome, Task, counts, heading
from olp.workflows.session import Session
from olp.workflows.verify import VerifyOptions

#: Exit code of a program that no error of ours ended.
UNEXPECTED = 4
#: letters of the text of an exception that is not ours
_MOST_LETTERS = 200


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
        outcome = _outcome(config, parcel, task)
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


def _outcome(config: Config, parcel: Parcel, task: Task) -> Outcome:
    if config.joints:
        from olp.workflows import batch_joints

        return batch_joints.outcome(config, parcel, task)
    session = config.session().reading_from(parcel)
    source = session.sources.source(task.program)
    if task.released is not None:
        return _judged(session, source, task, session.sources.source(task.released, source))
    return _corrected(session, source, task)


def refused(error: OlpError, findings: Iterable[Finding] = ()) -> Outcome:
    """The outcome of a program that is refused with an error."""
    return _failed(str(error), error.exit_code, findings)


def lost(message: str) -> Outcome:
    """The outcome of a task whose workers ended, again and again."""
    return _failed(message, UNEXPECTED, lasting=False)


def _failed(
    message: str, exit_code: int, findings: Iterable[Finding] = (), *, lasting: bool = True
) -> Outcome:
    row = {"message": message, "exit_code": exit_code, "ok": False, "findings": counts(findings)}
    return Outcome(row, lasting=lasting)


def _corrected(session: Session, source: Source, task: Task) -> Outcome:
    options = task.options
    # a program that cannot be timed is corrected all the same
    result = correct.run(session, source, replace(options, times=False))
    if options.times:
        from olp.workflows.correct_time import with_time

        with_time(session, source, result, options, None, asked=True)
    filed = page = None
    if task.report:
        from olp.workflows import report

        nominal = source.holding(result.nominal)
        filed = report.correction(result, nominal, session, options, task.report, plots=task.plots)
    if task.page is not None:
        page = task.page.of_three(session, source, options, result, task.output)
    return Outcome(_row(result.report, result.findings), result.data, filed, page)


def _judged(session: Session, source: Source, task: Task, released: Source) -> Outcome:
    options = VerifyOptions(**task.options.proof(), outside_box="hold")
    result = verify.run(session, source, released, options)
    return Outcome(_row(result.report, result.findings))


def _row(stated: Mapping[str, Any], findings: Iterable[Finding]) -> dict[str, Any]:
    """The row of a summary: figures of a report, none of its own."""
    verdict, deviation = stated["verdict"], stated["deviation"]
    numerical, part = verdict["numerical"], verdict["part"]
    return {
        **heading(stated),
        "uncorrected_um": deviation["before"]["between"]["max_um"],
        "corrected_um": numerical["largest_um"],
        "allowed_um": numerical["allowed_um"],
        "holds": numerical["holds"],
        "part_tolerance_um": None if part is None else part["tolerance_um"],
        "part_ok": None if part is None else part["holds"],
        "ok": verdict["ok"],
        "sentences": list(verdict["sentences"]),
        "findings": counts(findings),
    }
