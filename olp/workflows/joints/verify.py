"""`verify` on machines with rotary joints: a corrected program proved from both texts alone."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from typing import Any

from olp.compensation.joints.writing import planned_words
from olp.compensation.stamp import find_stamp
from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.files.sources import Source
from olp.findings.catalogue import Finding
from olp.proof.joints import JointProof
from olp.workflows.flatten import AS_IT_IS
from olp.workflows.joints.correct import JointOptions, ProvedJoints, proved
from olp.workflows.joints.doubt import doubted
from olp.workflows.joints.loaded import JointRun
from olp.workflows.session import PathLike
from olp.workflows.shown import Shown


@dataclass(frozen=True, slots=True, eq=False)
class JointVerification(Shown):
    """The proof of a corrected program of a machine with rotary joints, its report ("olp-joints-1") and the
    findings."""

    proof: JointProof
    report: dict[str, Any]
    findings: tuple[Finding, ...]

    def to_text(self) -> str:
        """The report as the command line prints it."""
        from olp.reports.joints import to_text

        return to_text(self.report)


def verify_joints(
    nominal: PathLike | bytes,
    corrected: PathLike | bytes,
    machine: PathLike,
    job: PathLike | None = None,
    *,
    tolerance_um: float = 1.0,
    tolerance_urad: float = 10.0,
    flatten: bool = False,
    expand_cycles: bool = False,
    part_tolerance_um: float | None = None,
    date: datetime.date | None = None,
    accept: Sequence[str] = (),
) -> JointVerification:
    """Prove a corrected program from the nominal and the corrected text alone. Raises as `correct_joints`,
    and ProgramError where the second is not a correction of the first."""
    options = JointOptions(
        tolerance_um=tolerance_um, tolerance_urad=tolerance_urad, flatten=flatten,
        expand_cycles=expand_cycles, part_tolerance_um=part_tolerance_um, date=date,
        accept=tuple(accept),
    )  # fmt: skip
    run = JointRun.of(nominal, machine, job)
    return verified(run, run.sources.source(corrected, nominal), options)


def verified(run: JointRun, corrected: Source, options: JointOptions) -> JointVerification:
    """As `verify_joints`, for a run that is loaded."""
    done = verification_of(run, corrected, options)
    return JointVerification(done.proof, done.report, done.findings)


def verification_of(
    run: JointRun, corrected: Source, options: JointOptions, *, refuse_doubts: bool = True
) -> ProvedJoints:
    """Two texts with the proof. Raises as `verify_joints`; without `refuse_doubts` doubts are findings
    alone."""
    with run.program.errors():
        if find_stamp(run.program.data) is not None and find_stamp(corrected.data) is None:
            raise ProgramError(
                "the program given as nominal has the stamp of a correction, and the corrected one has none; "
                "exchange the two",
                code="OLP562",
            )
        source, nominal = run.read(run.program, options)
        doubts = doubted(
            run, nominal, options.accept, options.date, stamped=corrected.data, refuse=refuse_doubts
        )
        with nominal.program.errors():
            plan = planned_words(nominal, options.limits())
    with corrected.errors():
        _, written = run.read(corrected, AS_IT_IS)
    with run.program.errors():
        return proved(run, source, (nominal, plan), written, options, doubts)
