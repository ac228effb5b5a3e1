"""`check` on machines with rotary joints: all that speaks against running a program, as findings."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from olp.checks.base import finding
from olp.checks.stamps import stamp_findings
from olp.compensation.stamp import find_stamp
from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.files.sources import Source
from olp.findings.catalogue import Finding
from olp.findings.choice import chosen
from olp.findings.rule import Severity
from olp.reports.joints import verdict_of
from olp.workflows import refusals
from olp.workflows.doubt import accepted_of
from olp.workflows.joints.alone import alone, travel_findings
from olp.workflows.joints.along import Along
from olp.workflows.joints.correct import JointOptions, ProvedJoints, correction_of
from olp.workflows.joints.doubt import doubted
from olp.workflows.joints.loaded import JointRun
from olp.workflows.joints.verify import verification_of
from olp.workflows.original import placed_findings
from olp.workflows.session import Outside, PathLike
from olp.workflows.shown import Shown

#: What is looked for on such a machine, in the order of codes.
CODES = (
    "OLP101", "OLP102", "OLP103", "OLP105", "OLP106", "OLP107", "OLP108", "OLP111", "OLP311", "OLP312",
    "OLP331", "OLP332", "OLP401", "OLP402", "OLP403", "OLP405", "OLP408", "OLP409", "OLP422", "OLP433",
    "OLP445", "OLP446", "OLP447", "OLP448", "OLP449", "OLP450", "OLP451", "OLP452", "OLP460",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class JointCheckOptions(JointOptions):
    """The options of `check` on such machines."""

    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class JointCheck(Shown):
    """The findings of a gate and its report ("olp-check-1"), with the proof ("olp-joints-1") as its part
    `proof` where a nominal program is known. `refused` is the error of a program that is refused; the
    findings are its reasons then."""

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
    part_tolerance_um: float | None = None,
    date: datetime.date | None = None,
    accept: Sequence[str] = (),
    select: Sequence[str] = (),
    ignore: Sequence[str] = (),
) -> JointCheck:
    """May this program run on this machine with rotary joints? As `check`, with the options of
    `correct_joints`: with `nominal` the program is proved against that one. A corrected program alone is
    checked unchanged, without what needs the nominal one; any other is corrected in memory. Raises as
    `correct_joints`, and UsageError for codes that are not looked for."""
    options = JointCheckOptions(
        tolerance_um=tolerance_um, tolerance_urad=tolerance_urad, outside_box=outside_box, flatten=flatten,
        expand_cycles=expand_cycles, part_tolerance_um=part_tolerance_um, date=date,
        accept=tuple(accept), select=tuple(select), ignore=tuple(ignore),
    )  # fmt: skip
    run = JointRun.of(program if nominal is None else nominal, machine, job)
    result = examined(run, None if nominal is None else run.sources.source(program, nominal), options)
    if result.refused is not None:
        raise result.refused
    return result


def examined(run: JointRun, corrected: Source | None, options: JointCheckOptions) -> JointCheck:
    """May a program run? With `corrected` the program of `run` is the nominal one. Without it that of `run`
    is corrected in memory, or checked unchanged where it is corrected already. Lines are those of the program
    that is checked. A program that is refused gives its reasons as findings, and the error. Raises UsageError
    for codes that are not looked for, and as `correct_joints`."""
    codes = chosen(options.select, options.ignore, CODES)
    program = run.program if corrected is None else corrected
    program.load()
    # a command outside is a finding, not the end
    hold = replace(options, outside_box="hold")
    try:
        checked = _checked(run, corrected, hold)
    except ProgramError as error:
        return _refused(error, run, program, options)
    findings = list(checked.findings)
    if options.date is None and run.calibration is not None:
        findings.append(finding("OLP408", "no date is given"))
    if options.outside_box == "refuse":
        findings = [replace(one, code="OLP405") if one.code == "OLP403" else one for one in findings]
    kept = tuple(sorted((f for f in findings if f.code in codes), key=lambda f: (f.code, f.line or 0)))
    report = {
        **_head(run, program, options),
        "checked": checked.what,
        "accepted": accepted_of(findings),
        "rules": codes,
        "verdict": None if checked.done is None else _verdict(checked.done, kept, codes),
        "findings": [f.as_dict() for f in kept],
    }
    if checked.done is not None:
        proof = checked.done.report
        report["proof"] = {name: proof[name] for name in proof if name not in ("findings", "verdict")}
    return JointCheck(kept, report)


@dataclass(frozen=True, slots=True, eq=False)
class _Checked:
    """What was checked in words, the findings at lines of the program that is checked, and the proof, None
    where no nominal program is known."""

    what: str
    findings: Sequence[Finding]
    done: ProvedJoints | None = None


def _checked(run: JointRun, corrected: Source | None, options: JointOptions) -> _Checked:
    """A corrected program is proved against that of `run`; a program alone with a stamp is checked unchanged,
    others are corrected here. Raises ProgramError."""
    if corrected is not None:
        done = verification_of(run, corrected, options, refuse_doubts=False)
        what = f"the corrected program against the nominal one ({run.program.short or 'stdin'})"
        found = [_in_corrected(one, done) for one in done.findings]
        found += stamp_findings(corrected.data, run.program.data, run.digest)
        found += placed_findings(travel_findings(Along.of(done.corrected)), done.corrected.program.origin)
        return _Checked(what, found, done)
    data = run.program.data
    if find_stamp(data) is None:
        done = correction_of(run, options, refuse_doubts=False)
        what = "the result of olp correct on the program"
        return _Checked(what, done.findings, done)
    with run.program.errors():
        path = run.read(run.program, options)[1]
        found = [
            *doubted(run, path, options.accept, options.date, stamped=data, refuse=False),
            *alone(run, path),
        ]
    what = "the corrected program; checks that need the nominal one are left out (give --nominal)"
    return _Checked(
        what, [*placed_findings(found, path.program.origin), *stamp_findings(data, None, run.digest)]
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
    part = done.report.get("part")
    for code, holds in (("OLP101", done.proof.holds), ("OLP108", part is None or part["holds"])):
        if code not in codes and not holds:
            sentences.append(f"{code} is left out, so that does not count here.")
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
