"""The gate before deployment: all that speaks against running a program, as findings."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from olp.checks import correction as checks
from olp.checks import motion, state
from olp.checks.along import Along
from olp.checks.base import finding
from olp.checks.clearance import Clearances, Solid, clearances
from olp.checks.model import model_findings
from olp.checks.stamps import stamp_findings
from olp.compensation.stamp import find_stamp
from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.core.progress import Progress, part, silent
from olp.core.spool import Text
from olp.core.units import MM_PER_UM, RAD_PER_URAD
from olp.core.values import dataclass
from olp.errormodel.known import KnownErrors
from olp.files.meshes import read_mesh
from olp.files.sources import Source, Sources
from olp.findings.catalogue import RULES, Finding
from olp.findings.choice import chosen
from olp.findings.rule import Severity
from olp.program.origin import Origin
from olp.program.program import Program
from olp.program.registry import Options, read
from olp.proof.judgement import verdict
from olp.proof.proof import Proof, corrections_mm
from olp.workflows import refusals
from olp.workflows.correct import CorrectOptions, corrected
from olp.workflows.doubt import accepted_of, doubted
from olp.workflows.kept import unrolling_of_corrected
from olp.workflows.original import placed, placed_findings
from olp.workflows.proof import ProofOptions, Run, last_digit_mm, verify_programs
from olp.workflows.session import Loaded, Outside, PathLike, Session
from olp.workflows.shown import Shown

#: Number of blocks with the least clearance in a report.
_NEAREST = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckOptions(ProofOptions):
    """The options of `check`."""

    outside_box: Outside = "refuse"
    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()

    @property
    def outside_code(self) -> str:
        """The code of findings outside the calibrated box."""
        return "OLP405" if self.outside_box == "refuse" else "OLP403"


@dataclass(frozen=True, slots=True, eq=False)
class Check(Shown):
    """The findings of a gate, its report ("olp-check-1"), and the clearance of every block where the job has
    meshes. `refused` is the error of a program that is refused; the findings are its reasons then."""

    findings: tuple[Finding, ...]
    report: dict[str, Any]
    clearances: Clearances | None = None
    refused: ProgramError | None = None
    origin: Origin | None = None

    def to_text(self) -> str:
        """The report as `olp check` prints it."""
        from olp.reports.check import to_text

        return to_text(self.report, "error")

    def rows(self) -> Iterator[dict[str, Any]]:
        """The clearance of every block as plain data."""
        for row in self.clearances.rows() if self.clearances is not None else ():
            yield placed(row, self.origin)


@dataclass(frozen=True, slots=True, eq=False)
class _Case:
    """The program as it would run; `run` and `proof` where a nominal one is known. Lines of the proof are
    those of `data`, the given text: the corrected program, or the nominal one that is `corrected_here`."""

    name: str
    data: Text
    written: Program
    run: Run | None
    proof: Proof | None
    loaded: Loaded
    checked: str
    corrected_here: bool = False

    @property
    def origin(self) -> Origin | None:
        """Where the lines come from: those of the given program that was unrolled."""
        first = self.run.nominal if self.run is not None and self.corrected_here else self.written
        return first.origin

    def place(self, line: int) -> str:
        """A line of the given program in words."""
        return str(line) if self.origin is None else self.origin.place(line)

    def worded(self, program: Program) -> Program:
        """A program with its words; a correction drops them early."""
        if program.words is not None:
            return program
        return read(program.data, self.loaded.setup, self.loaded.dialect)


def check(
    program: PathLike | bytes,
    machine: PathLike | Setup | KnownErrors,
    job: PathLike | None = None,
    *,
    nominal: PathLike | bytes | None = None,
    tolerance_um: float = 1.0,
    outside_box: Literal["refuse", "hold"] = "refuse",
    flatten: bool = False,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
    part_tolerance_um: float | None = None,
    only_sure_components: bool = False,
    date: datetime.date | None = None,
    accept: Sequence[str] = (),
    select: Sequence[str] = (),
    ignore: Sequence[str] = (),
    progress: Progress | None = None,
) -> Check:
    """May this program run on this machine?

    With `nominal`, `program` is the corrected program, from any source, and is proved against it. Alone and
    without the stamp of a correction it is the nominal program: it is corrected here, and the result is
    checked. Alone and with a stamp it is checked unchanged, without the checks that need the nominal one.
    Lines are those of `program`. `flatten`, `expand_cycles` and `peck_clearance_mm` are those of `correct`,
    for the nominal program. `select` and `ignore` are codes or their beginnings (OLP4). A path outside
    the calibrated box is not refused: that is finding OLP405, or OLP403 with `outside_box` "hold". Doubts
    about the inputs are findings too; those that `accept` or the stamp names are one step less severe.

    Raises UsageError for a code that does not exist, InputError for input that cannot be read or corrected
    (ProgramError with its line), and CannotCompute.
    """
    options = CheckOptions(
        tolerance_um=tolerance_um, outside_box=outside_box, flatten=flatten,
        expand_cycles=expand_cycles, peck_clearance_mm=peck_clearance_mm,
        part_tolerance_um=part_tolerance_um, only_sure_components=only_sure_components,
        date=date, accept=tuple(accept), select=tuple(select), ignore=tuple(ignore),
    )  # fmt: skip
    chosen(options.select, options.ignore)
    session = Session.start(machine, job)
    other = None if nominal is None else session.sources.source(nominal)
    return run(session, session.sources.source(program, nominal), options, nominal=other, progress=progress)


def run(
    session: Session,
    program: Source,
    options: CheckOptions,
    *,
    nominal: Source | None = None,
    progress: Progress | None = None,
) -> Check:
    """As `check`, in a session."""
    result = examined(session, program, options, nominal=nominal, progress=progress)
    if result.refused is not None:
        raise result.refused
    return result


def examined(
    session: Session,
    program: Source,
    options: CheckOptions,
    *,
    nominal: Source | None = None,
    progress: Progress | None = None,
) -> Check:
    """As `run`. A program that is refused gives its reasons as findings, and the error."""
    codes = chosen(options.select, options.ignore)
    tell = progress or silent
    setup = session.setup
    everything = "all" in setup.machine.compensated_by_controller
    if everything:
        setup = replace(setup, machine=replace(setup.machine, compensated_by_controller=frozenset()))
        session = session.of(setup)
    loaded = session.loaded("hold", only_sure=options.only_sure_components)
    program.load()
    try:
        with program.errors():
            loaded = loaded.reading(program)
            case = _case(session.sources, program, nominal, loaded, options, tell)
    except ProgramError as error:
        return _refused(error, program, nominal, loaded, options)
    with program.errors():
        tell("check", 0.8)
        findings = _findings(case, options)
        around = _clearances(case, codes, session.sources, tell)
    if everything:
        findings.append(finding("OLP410", 'compensated_by_controller is "all"'))
    if around is not None:
        findings += around.findings(setup.machine.sanity.clearance_mm, case.place)
    ordered = sorted((f for f in findings if f.code in codes), key=lambda f: (f.code, f.line or 0))
    report = _report(case, tuple(ordered), codes, options)
    if around is not None:
        report["clearance"] = list(around.nearest(_NEAREST).rows())
    kept = placed_findings(ordered, case.origin)
    return Check(kept, placed(report, case.origin), around, origin=case.origin)


def _refused(
    error: ProgramError, program: Source, nominal: Source | None, loaded: Loaded, options: CheckOptions
) -> Check:
    """The findings of a program that is refused; no code is left out of them."""
    # the file of an error may be that of a subprogram too
    other = "" if nominal is None else nominal.name or "<nominal>"
    name = other if other and error.file == other else program.name
    report = {
        **_head(name, program.data, loaded, options),
        "checked": "nothing: the program is refused",
        "accepted": [],
        "rules": list(refusals.REFUSALS),
        "verdict": None,
        **refusals.parts_of(error, name),
    }
    return Check(refusals.findings_of(error, name), report, refused=error)


def _case(
    sources: Sources, program: Source, nominal: Source | None, loaded: Loaded, options: CheckOptions,
    tell: Progress,
) -> _Case:  # fmt: skip
    tell("read", 0.0)
    reading = Options(tell=part(tell, 0.0, 0.2))
    name, data = program.name, program.data
    if nominal is None and find_stamp(data) is None:
        correcting = CorrectOptions(**options.proof(), outside_box="hold")
        told = part(tell, 0.0, 0.8)
        run = corrected(sources, program, loaded, correcting, told, options.outside_code, refuse_doubts=False)
        what = "the result of olp correct on the program"
        path = replace(run.proof.written, line=run.proof.nominal.line[run.proof.owner()])
        proof = replace(run.proof, written=path)
        return _Case(name, data, run.corrected, run, proof, loaded, what, corrected_here=True)
    if nominal is None:
        program, written = refusals.read(
            sources, program, loaded.setup, loaded.dialect, reading, options, kept=True
        )
        what = "the corrected program; checks that need the nominal one are left out (give --nominal)"
        return _Case(name, data, written, None, None, loaded, what)
    nominal.load()
    with nominal.errors("<nominal>"):
        nominal, first = refusals.read(
            sources, nominal, loaded.setup, loaded.dialect, reading, options, kept=True
        )
    unrolling = unrolling_of_corrected(first)
    second = Options(tell=part(tell, 0.2, 0.4))
    program, written = refusals.read(sources, program, loaded.setup, loaded.dialect, second, unrolling)
    run = verify_programs(
        (first, nominal.name), (written, name), loaded, options,
        outside=options.outside_code, refuse_doubts=False, tell=part(tell, 0.4, 0.8),
    )  # fmt: skip
    what = f"the corrected program against the nominal one ({nominal.short or 'stdin'})"
    proof = replace(
        run.proof,
        nominal=replace(run.proof.nominal, line=written.in_original().toolpath.line[run.proof.groups]),
    )
    return _Case(name, data, written, run, proof, loaded, what)


def _findings(case: _Case, options: CheckOptions) -> list[Finding]:
    """All findings: those of the run that made the case, and those of the checks made here."""
    loaded, run, proof, date = case.loaded, case.run, case.proof, options.date
    tolerance_mm = options.tolerance_um * MM_PER_UM
    machine, sanity = loaded.setup.machine, loaded.setup.machine.sanity
    findings = [
        *_stamps(case),
        *state.temperature_findings(loaded.setup.job, loaded.calibration, sanity),
        *state.digit_findings(last_digit_mm(case.written, loaded.setup), tolerance_mm),
    ]
    if date is None:
        findings.append(finding("OLP408", "no date is given"))
    written = case.written.in_original()
    path = written.toolpath
    if run is not None and proof is not None and case.corrected_here:
        findings += run.findings
        path = proof.written
    else:
        findings += state.travel_findings(path, machine)
        findings += state.box_findings(path, loaded.model.box_mm, options.outside_code)
        if run is None:
            findings += doubted(case.written, loaded, options.accept, date, stamped=case.data, refuse=False)
        findings += checks.program_findings(written, loaded.setup)
        findings += model_findings(path, loaded.calibration, loaded.model, sanity, tolerance_mm)
        if run is not None and proof is not None:
            findings += checks.proof_findings(proof, run.uncorrected, run.nominal.dialect)
            findings += checks.between_findings(run.nominal, proof, loaded.model)
            findings += _in_lines_of_corrected(run)
    lean = checks.orientation(Along.of(path), loaded.model)["max_urad"] * RAD_PER_URAD
    findings += state.orientation_findings(path, lean, loaded.setup, tolerance_mm)
    findings += motion.reversal_findings(path, loaded.model)
    speeds = motion.Feeds.of(case.worded(case.written))
    before = None if run is None else motion.Feeds.of(case.worded(run.nominal))
    findings += (before if before is not None and case.corrected_here else speeds).findings()
    if speeds.mm_s is not None:
        findings += motion.demand_findings(path, speeds.mm_s, machine)
    if run is not None and proof is not None and before is not None:
        correction = corrections_mm(run.nominal, case.written, proof)
        findings += motion.low_findings(proof, loaded.model)
        if speeds.mm_s is not None and before.mm_s is not None:
            findings += motion.changed_findings(proof, before.mm_s, speeds.mm_s)
        if not case.corrected_here:
            largest = float(np.sqrt((correction * correction).sum(axis=1)).max(initial=0.0))
            findings += checks.path_mode_findings(case.written, largest)
    return findings


def _lines(run: Run) -> dict[int, int]:
    """The line of the corrected program for each line of the nominal one that moves, as the last of them."""
    proof = run.proof
    return dict(zip(proof.nominal.line.tolist(), proof.written.line[proof.groups].tolist(), strict=True))


def _in_lines_of_corrected(run: Run) -> list[Finding]:
    """Findings of a verification that are not made here: doubts about the inputs, the part, uncertainties.
    Lines are those of the corrected program; that of a nominal line without a move is not known."""
    there = _lines(run)
    result = []
    for one in run.findings:
        rule = RULES[one.code]
        if rule.doubt or rule.topic == "uncertainty" or one.code == "OLP108":
            lines = tuple(there[line] for line in one.lines if line in there)
            result.append(replace(one, line=lines[0] if lines else None, lines=lines))
    return result


def _clearances(case: _Case, codes: list[str], sources: Sources, tell: Progress) -> Clearances | None:
    """Clearances; None where the job has no meshes, or `codes` has none of clearances."""
    setup = case.loaded.setup
    if not setup.job.meshes or not any(RULES[code].topic == "clearance" for code in codes):
        return None
    tell("clearance", 0.9)
    read = ((mesh, *read_mesh(mesh.file, sources.read)) for mesh in setup.job.meshes)
    solids = [
        Solid(mesh, Path(mesh.file).name, vertices[faces] * mesh.unit_mm) for mesh, vertices, faces in read
    ]
    path = case.written.in_original().toolpath if case.proof is None else case.proof.written
    return clearances(path, case.loaded.model, setup, solids)


def _stamps(case: _Case) -> list[Finding]:
    """Findings where the program is corrected twice, or with another calibration."""
    nominal = None if case.run is None or case.corrected_here else case.run.nominal.data
    return stamp_findings(case.data, nominal, case.loaded.digest)


def _verdict(
    case: _Case, kept: tuple[Finding, ...], codes: list[str], options: CheckOptions
) -> dict[str, Any] | None:
    """The verdict of the proof and of all findings that are kept, with lines of the given program; None where
    no nominal program is known. What a code that is left out says does not count."""
    run = case.run
    if run is None:
        return None
    part_um = case.loaded.part_tolerance_um(options.part_tolerance_um)
    place = run.nominal.in_original().place
    result = verdict(run.table, part_um, run.report.get("uncertainty"), kept, place)
    line = result["numerical"]["line"]
    if not case.corrected_here and line is not None:
        result["numerical"]["line"] = _lines(run)[line]
    for side, code in (("numerical", "OLP101"), ("part", "OLP108")):
        if code not in codes and result[side] is not None and not result[side]["holds"]:
            result["sentences"].append(f"{code} is left out, so that does not count here.")
    return result | {"ok": not any(f.severity >= Severity.ERROR for f in kept)}


def _report(
    case: _Case, findings: tuple[Finding, ...], codes: list[str], options: CheckOptions
) -> dict[str, Any]:
    return {
        **_head(case.name, case.data, case.loaded, options),
        "checked": case.checked,
        "accepted": accepted_of(findings),
        "rules": codes,
        "verdict": _verdict(case, findings, codes, options),
        "findings": [f.as_dict() for f in findings],
    }


def _head(name: str, data: Text, loaded: Loaded, options: CheckOptions) -> dict[str, Any]:
    """The parts of a report that a refused program has too."""
    machine, calibration = loaded.setup.machine, loaded.calibration
    return {
        "schema": "olp-check-1",
        "program": {
            "name": Path(name).name if name else "",
            "path": name,
            "lines": data.count(b"\n") + (not data.endswith(b"\n")),
        },
        "machine": {"name": machine.name, "chain": machine.chain, "controller": machine.controller},
        "calibration": {
            "measured": calibration.measured,
            "valid_until": calibration.valid_until,
            "sha256": loaded.digest,
        },
        "date": options.date,
        "tolerance_um": options.tolerance_um,
    }
