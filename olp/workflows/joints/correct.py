"""`correct` on machines with rotary joints: a program corrected and proved in position and orientation."""

from __future__ import annotations

import datetime
import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from olp.compensation.joints.arm_path import ArmPath
from olp.compensation.joints.arm_writer import write_arm
from olp.compensation.joints.commanded import refuse_beyond
from olp.compensation.joints.list_writer import write_list
from olp.compensation.joints.path import JointPath
from olp.compensation.joints.planning import JointLimits, JointPlan
from olp.compensation.joints.writer import WrittenJoints
from olp.compensation.joints.writing import planned_words, write_joints
from olp.compensation.stamp import find_real_time, refuse_second, stamp_line, stamped
from olp.compensation.tally import Tally
from olp.compensation.wrapping import card_stamp
from olp.core.errors import OutsideBox
from olp.core.units import MM_PER_UM, RAD_PER_URAD
from olp.core.values import dataclass
from olp.files.sources import Source
from olp.files.write import write_bytes
from olp.findings.catalogue import Finding
from olp.kinematics.correction import beyond_travel
from olp.program.dialect import Dialect
from olp.program.program import Program
from olp.program.robots.dialect import RobotDialect
from olp.program.text.numbers import spliced
from olp.proof.joints import JointProof, prove_joints
from olp.workflows import real_time
from olp.workflows.doubt import accepted_of
from olp.workflows.flatten import UnrollOptions, above_zero
from olp.workflows.joints.along import Along
from olp.workflows.joints.doubt import doubted
from olp.workflows.joints.loaded import JointRun
from olp.workflows.joints.part import judge_part
from olp.workflows.joints.report import findings_of, last_digits, outside_box, report_of
from olp.workflows.joints.uncertain import uncertainty_of
from olp.workflows.original import placed, placed_findings
from olp.workflows.session import Outside, PathLike
from olp.workflows.shown import Shown


@dataclass(frozen=True, slots=True, kw_only=True)
class JointOptions(UnrollOptions):
    """The options of verbs that prove a correction on a machine with rotary joints: the numerical tolerances
    of position and orientation, and the part tolerance (`part_tolerance_um`, default: the job's). Then the
    day of the run, and the codes of doubts to accept. With `times` a correction states how long both programs
    take."""

    tolerance_um: float = 1.0
    tolerance_urad: float = 10.0
    outside_box: Outside = "refuse"
    part_tolerance_um: float | None = None
    date: datetime.date | None = None
    accept: tuple[str, ...] = ()
    times: bool = False

    def __post_init__(self) -> None:
        above_zero(self, "tolerance_um", "tolerance_urad", "part_tolerance_um")

    def limits(self) -> JointLimits:
        return JointLimits(self.tolerance_um * MM_PER_UM, self.tolerance_urad * RAD_PER_URAD)


@dataclass(frozen=True, slots=True, eq=False)
class ProvedJoints:
    """A nominal and a corrected program with the proof, its report ("olp-joints-1") and the findings.
    `source` is the nominal text, unrolled where the call asks for it."""

    source: Source
    nominal: JointPath
    plan: JointPlan
    corrected: JointPath
    proof: JointProof
    report: dict[str, Any]
    findings: tuple[Finding, ...]


@dataclass(frozen=True, slots=True, eq=False)
class JointCorrection(Shown):
    """A corrected program of a machine with rotary joints: its bytes, the text that was corrected, the proof,
    the report ("olp-joints-1") and the findings. `inputs` are the files that were read, which `write` never
    overwrites."""

    data: bytes
    nominal: bytes
    proof: JointProof
    report: dict[str, Any]
    findings: tuple[Finding, ...]
    inputs: tuple[str, ...] = ()

    @staticmethod
    def of(run: JointRun, done: ProvedJoints) -> JointCorrection:
        text, nominal = bytes(done.corrected.program.data), bytes(done.source.data)
        return JointCorrection(text, nominal, done.proof, done.report, done.findings, run.files)

    def to_text(self) -> str:
        """The report as the command line prints it."""
        from olp.reports.joints import to_text

        return to_text(self.report)

    def write(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the corrected program as `Correction.write` does."""
        write_bytes(path, self.data, force=force, inputs=self.inputs)
        return Path(path)


def correct_joints(
    program: PathLike | bytes,
    machine: PathLike,
    job: PathLike | None = None,
    *,
    tolerance_um: float = 1.0,
    tolerance_urad: float = 10.0,
    flatten: bool = False,
    expand_cycles: bool = False,
    outside_box: Literal["refuse", "hold"] = "refuse",
    part_tolerance_um: float | None = None,
    date: datetime.date | None = None,
    accept: Sequence[str] = (),
    times: bool = False,
) -> JointCorrection:
    """Correct a program for a machine of any joints, and prove it: G-code for X, Y, Z with rotary axes, or a
    list of axis values of any machine.

    The corrected text is in the program's own dialect; only coordinate words differ, and words, blocks and
    rows are inserted. Moves are split where the tip or the tool would leave its tolerance, in um and urad.
    With `part_tolerance_um` (default: the job's) the report says whether the part is good, as far as the
    calibration knows. With `times` it states how long both programs take, as `retime_joints` plans them.
    Raises InputError (ProgramError with its line, ConfigError), CannotCompute, and Doubtful where the
    calibration cannot be right, unless `accept` names the code of the doubt.
    """
    options = JointOptions(
        tolerance_um=tolerance_um, tolerance_urad=tolerance_urad, flatten=flatten,
        expand_cycles=expand_cycles, outside_box=outside_box, part_tolerance_um=part_tolerance_um, date=date,
        accept=tuple(accept), times=times,
    )  # fmt: skip
    return corrected(JointRun.of(program, machine, job), options)


def corrected(run: JointRun, options: JointOptions) -> JointCorrection:
    """As `correct_joints`, for a run that is loaded."""
    done = correction_of(run, options)
    if options.times:
        from olp.workflows.joints.correct_time import times

        done.report["time"] = times(run, done)
    return JointCorrection.of(run, done)


def correction_of(run: JointRun, options: JointOptions, *, refuse_doubts: bool = True) -> ProvedJoints:
    """A program corrected and proved. Raises as `correct_joints`; without `refuse_doubts` doubts are findings
    alone."""
    with run.program.errors():
        _refuse_stamped(run)
        source, nominal = run.read(run.program, options)
        dialect = run.dialect(run.program)
        doubts = doubted(run, nominal, options.accept, options.date, refuse=refuse_doubts)
        with nominal.program.errors():
            plan = planned_words(nominal, options.limits())
            if options.outside_box == "refuse" and run.calibration is not None:
                _refuse_outside(nominal, plan, run)
            written = _written(nominal, plan, options.limits())
        text = _stamped(run, dialect, nominal.program, written.text, accepted_of(doubts))
        corrected = run.again(text, dialect)
        done = proved(run, source, (nominal, plan), corrected, options, doubts, written.tally)
        with nominal.program.errors():
            _refuse_between(nominal, done)
        return done


def _written(nominal: JointPath, plan: JointPlan, limits: JointLimits) -> WrittenJoints:
    if isinstance(nominal, ArmPath):
        return write_arm(nominal, plan, limits)
    return write_joints(nominal, plan) if nominal.listed is None else write_list(nominal, plan)


def _refuse_between(nominal: JointPath, done: ProvedJoints) -> None:
    """Raises ProgramError with the line of a move along which an axis leaves its travel: at the waypoints all
    are within, and where the tip is led the axes may swing out between them."""
    along = Along.of(done.corrected)
    move = np.searchsorted(done.proof.groups, along.move)
    refuse_beyond(nominal, move, along.axes, beyond_travel(nominal.motion.structure, along.axes))


def _stamped(
    run: JointRun, dialect: Dialect, nominal: Program, written: bytes | None, accepted: Sequence[str]
) -> bytes:
    """The text with its stamp. One where nothing changed, None, has it only where the control corrects."""
    by_control = run.machine.real_time is not None
    text = bytes(nominal.data) if written is None else written
    told = written is None and (not by_control or find_real_time(text) is not None)
    if told or not dialect.marks:
        return text
    stamp = stamp_line(run.digest, dialect.comment, accepted, real_time=by_control)
    if isinstance(dialect, RobotDialect):
        program = replace(nominal, data=text)
        return spliced(text, [dialect.stamped(program, stamp), *dialect.counted(program, 1)])
    statements = nominal.statements
    if statements is not None and statements.cards:
        stamp = card_stamp(stamp, statements.width)
    return stamped(text, stamp, nominal.eol(1), dialect.first)


def proved(
    run: JointRun, source: Source, nominal: tuple[JointPath, JointPlan], corrected: JointPath,
    options: JointOptions, doubts: tuple[Finding, ...], tally: Tally | None = None,
) -> ProvedJoints:  # fmt: skip
    """The proof of two programs with its report and findings, behind the `doubts` about its inputs."""
    path, plan = nominal
    digit_mm, digit_deg = last_digits(path)
    proof = prove_joints(path, corrected, plan, options.limits(), digit_mm=digit_mm, digit_deg=digit_deg)
    tolerance = options.tolerance_um, options.tolerance_urad
    origin = path.program.origin
    findings = placed_findings((*doubts, *findings_of(path, plan, proof, run, tolerance)), origin)
    text = bytes(corrected.program.data)
    report = report_of(run, path, plan, proof, findings, tolerance)
    report["accepted"] = accepted_of(findings)
    report["worst"] = [placed(row, origin) for row in report["worst"]]
    part_um = run.part_tolerance_um(options.part_tolerance_um)
    known = uncertainty_of(run, (path, corrected), proof, options.date, part_um)
    if known is not None:
        report["uncertainty"] = known
    if part_um is not None and proof.judged.any():
        more = judge_part(report, path, proof, part_um)
        findings = (*findings, *placed_findings(more, origin))
        report["findings"] = [one.as_dict() for one in findings]
    report["corrected"] = {"sha256": hashlib.sha256(text).hexdigest(), "lines": text.count(b"\n")}
    if tally is not None:
        report["written"] = {
            "changed_words": tally.changed_words,
            "inserted_words": tally.inserted_words,
            "inserted_blocks": tally.inserted_blocks,
        }
    return ProvedJoints(source, path, plan, corrected, proof, report, findings)


def _refuse_stamped(run: JointRun) -> None:
    real_time.refuse_stamped(run.machine.real_time, run.digest, run.program)
    refuse_second(run.program.data)


def _refuse_outside(path: JointPath, plan: JointPlan, run: JointRun) -> None:
    out = outside_box(path, plan, run)
    if out:
        line, sentence = out[0]
        raise OutsideBox(
            f"{sentence}; measure there, move the part, or give --outside-box hold to "
            "take the error at the end",
            line=line,
        )
