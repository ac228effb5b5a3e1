"""`check` on machines with rotary joints: all that speaks against running a program, as findings."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from olp.checks.base import finding
from olp.checks.stamps import stamp_findings
from olp.compensation.stamp import find_stamp, line_of
from olp.core.errors import AlreadyCorrected, ProgramError
from olp.core.spool import Text
from olp.core.values import dataclass
from olp.files.sources import Source
from olp.findings.catalogue import Finding
from olp.findings.choice import chosen
from olp.findings.rule import Severity
from olp.reports.joints import verdict_of
from olp.workflows import refusals
from olp.workflows.joints.correct import JointOptions, ProvedJoints, correction_of
from olp.workflows.joints.loaded import JointRun
from olp.workflows.joints.verify import verification_of
from olp.workflows.session import Outside, PathLike
from olp.workflows.shown import Shown

#: What is looked for on such a machine, in the order of codes.
CODES = (
    "OLP101", "OLP102", "OLP103", "OLP105", "OLP106", "OLP107", "OLP111", "OLP311", "OLP312", "OLP331",
    "OLP332", "OLP401", "OLP403", "OLP405", "OLP408", "OLP422",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class JointCheckOptions(JointOptions):
    """The options of `check` on such machines."""

    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class JointCheck(Shown):
    """The findings of a gate and its report ("olp-check-1"), with the proof ("olp-joints-1") as its part
    `proof`. `refused` is the error of a program that is refused; the findings are its reasons then."""

    findings: tuple[Finding, ...]
    report: dict[str, Any]
    refused: ProgramError | None = None

    def to_text(self) -> str:
        """The report as `olp check` prints it."""
        from olp.reports.check import to_text

        return to_text(self.report, "error")


def check_joints(
    program: PathLike | bytes,
    machine: PathLike,
    job: PathLike | None = None,
    *,
    nominal: PathLike | bytes | None = None,
    tolerance_um: float = 1.0,
    tolerance_urad: float = 10.0,
    outside_box: Outside = "refuse",
    flatten: bool = False,
    expand_cycles: bool = False,
    date: datetime.date | None = None,
    select: Sequence[str] = (),
    ignore: Sequence[str] = (),
) -> JointCheck:
    """May this program run on this machine with rotary joints? As `check`, with the options of
    `correct_joints`: without `nominal` the program is corrected in memory, else it is proved against that
    one. Raises as `correct_joints`, and UsageError for codes that are not looked for."""
    options = JointCheckOptions(
        tolerance_um=tolerance_um, tolerance_urad=tolerance_urad, outside_box=outside_box, flatten=flatten,
        expand_cycles=expand_cycles, date=date, select=tuple(select), ignore=tuple(ignore),
    )  # fmt: skip
    run = JointRun.of(program if nominal is None else nominal, machine, job)
    result = examined(run, None if nominal is None else run.sources.source(program, nominal), options)
    if result.refused is not None:
        raise result.refused
    return result


def examined(run: JointRun, corrected: Source | None, options: JointCheckOptions) -> JointCheck:
    """May a program run? Without `corrected` the program of `run` is corrected in memory, else that of `run`
    is the nominal one. Lines are those of the program that is checked. A program that is refused gives its
    reasons as findings, and the error. Raises UsageError for codes that are not looked for, and as
    `correct_joints`."""
    codes = chosen(options.select, options.ignore, CODES)
    program = run.program if corrected is None else corrected
    program.load()
    # a command outside is a finding, not the end
    hold = replace(options, outside_box="hold")
    try:
        if corrected is None:
            _refuse_stamped(program)
            done, what = correction_of(run, hold), "the result of olp correct on the program"
        else:
            done = verification_of(run, corrected, hold)
            what = f"the corrected program against the nominal one ({run.program.short or 'stdin'})"
    except ProgramError as error:
        return _refused(error, run, program, options)
    findings = _findings(done, run, None if corrected is None else corrected.data, options)
    kept = tuple(sorted((f for f in findings if f.code in codes), key=lambda f: (f.code, f.line or 0)))
    report = {
        **_head(run, program, options),
        "checked": what,
        "accepted": [],
        "rules": codes,
        "verdict": _verdict(done, kept, codes),
        "findings": [f.as_dict() for f in kept],
        "proof": {name: part for name, part in done.report.items() if name not in ("findings", "verdict")},
    }
    return JointCheck(kept, report)


def _refuse_stamped(program: Source) -> None:
    stamp = find_stamp(program.data)
    if stamp is not None:
        raise AlreadyCorrected(
            "the program is corrected already; name its nominal program with --nominal, and it is proved "
            "against that one",
            line=line_of(program.data, stamp),
            code="OLP560",
        )


def _refused(error: ProgramError, run: JointRun, program: Source, options: JointCheckOptions) -> JointCheck:
    """The findings of a program that is refused; no code is left out of them."""
    nominal = run.program
    # the file of an error may be that of a subprogram too
    about = nominal if nominal.name and error.file == nominal.name else program
    name = about.name
    report = {
        **_head(run, about, options),
        "checked": "nothing: the program is refused",
        "accepted": [],
        "rules": list(refusals.REFUSALS),
        "verdict": None,
        **refusals.parts_of(error, name),
    }
    return JointCheck(refusals.findings_of(error, name), report, error)


def _findings(
    done: ProvedJoints, run: JointRun, corrected: Text | None, options: JointCheckOptions
) -> list[Finding]:
    """All findings, at lines of the program that is checked: those of the proof, and those of the gate."""
    found = list(done.findings)
    if corrected is not None:
        found = [_in_corrected(one, done) for one in found]
        found += stamp_findings(corrected, run.program.data, run.digest)
    if options.outside_box == "refuse":
        found = [replace(one, code="OLP405") if one.code == "OLP403" else one for one in found]
    if options.date is None and run.calibration is not None:
        found.append(finding("OLP408", "no date is given"))
    return found


def _in_corrected(one: Finding, done: ProvedJoints) -> Finding:
    """A finding at the lines of the corrected program that the nominal moves end with."""
    line = done.nominal.program.original_lines(done.nominal.line)
    there = dict(zip(line.tolist(), done.corrected.line[done.proof.groups].tolist(), strict=True))
    lines = tuple(there[number] for number in one.lines if number in there)
    return replace(one, line=lines[0] if lines else None, lines=lines, files=())


def _verdict(done: ProvedJoints, kept: tuple[Finding, ...], codes: list[str]) -> dict[str, Any]:
    """The verdict of the proof and of the findings that are kept. What a code that is left out says does not
    count."""
    sentences = [verdict_of(done.report).replace("\n", " ")]
    if "OLP101" not in codes and not done.proof.holds:
        sentences.append("OLP101 is left out, so that does not count here.")
    return {"ok": not any(f.severity >= Severity.ERROR for f in kept), "sentences": sentences}


def _head(run: JointRun, program: Source, options: JointCheckOptions) -> dict[str, Any]:
    """The parts of a report that a refused program has too."""
    name, data = program.name, program.data
    return {
        "schema": "olp-check-1",
        "program": {
            "name": Path(name).name if name else "",
            "path": name,
            "lines": data.count(b"\n") + (not data.endswith(b"\n")),
        },
        **run.heads(),
        "date": options.date,
        "tolerance_um": options.tolerance_um,
        "tolerance_urad": options.tolerance_urad,
    }
