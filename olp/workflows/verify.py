"""`verify`: a corrected program proved from the nominal and the corrected text alone."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

from olp.core.arrays import Array, read_only
from olp.core.machine import Setup
from olp.core.progress import Progress, part, silent
from olp.core.values import dataclass
from olp.errormodel.known import KnownErrors
from olp.files.sources import Source
from olp.findings.catalogue import Finding
from olp.program.registry import Options
from olp.proof.judgement import Judgements
from olp.workflows import refusals
from olp.workflows.kept import unrolling_of_corrected
from olp.workflows.original import placed, placed_findings
from olp.workflows.proof import ProofOptions, verify_programs
from olp.workflows.session import Outside, PathLike, Session
from olp.workflows.shown import Judged

if TYPE_CHECKING:
    from olp.uncertainty.spread import Confidence


@dataclass(frozen=True, slots=True, kw_only=True)
class VerifyOptions(ProofOptions):
    """The options of `verify`; the nominal program is unrolled as in `correct`."""

    outside_box: Outside = "hold"


@dataclass(frozen=True, slots=True, eq=False)
class Verification(Judged):
    """The proof of a corrected program from two texts alone; `table`, `position_mm` and `confidence` as in
    Correction."""

    report: dict[str, Any]
    findings: tuple[Finding, ...]
    table: Judgements
    position_mm: Array
    confidence: Confidence | None = None

    def to_text(self) -> str:
        """The report as `olp verify` prints it."""
        from olp.reports.report import to_text

        return to_text(self.report)


def verify(
    nominal: PathLike | bytes,
    corrected: PathLike | bytes,
    machine: PathLike | Setup | KnownErrors,
    job: PathLike | None = None,
    *,
    tolerance_um: float = 1.0,
    outside_box: Literal["refuse", "hold"] = "hold",
    flatten: bool = False,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
    part_tolerance_um: float | None = None,
    only_sure_components: bool = False,
    date: datetime.date | None = None,
    accept: Sequence[str] = (),
    progress: Progress | None = None,
) -> Verification:
    """Compare a corrected program with the nominal one, from the two texts and the machine's files alone.

    `flatten`, `expand_cycles` and `peck_clearance_mm` are those with which the program was corrected: the
    nominal program is unrolled first, as there. Doubts about the inputs that `accept` or the stamp of the
    corrected program names are no error. `outside_box` is as in `correct`. Raises OutsideBox and ProgramError
    as that does, also ProgramError where the second is not a correction of the first, Doubtful where a doubt
    is not accepted.
    """
    session = Session.start(machine, job)
    options = VerifyOptions(
        tolerance_um=tolerance_um, outside_box=outside_box, flatten=flatten, expand_cycles=expand_cycles,
        peck_clearance_mm=peck_clearance_mm,
        part_tolerance_um=part_tolerance_um, only_sure_components=only_sure_components, date=date,
        accept=tuple(accept),
    )  # fmt: skip
    texts = session.sources.source(nominal), session.sources.source(corrected, nominal)
    return run(session, *texts, options, progress)


def run(
    session: Session,
    nominal: Source,
    corrected: Source,
    options: VerifyOptions,
    progress: Progress | None = None,
) -> Verification:
    """As `verify`, in a session."""
    tell = progress or silent
    loaded = session.loaded(options.outside_box, only_sure=options.only_sure_components)
    for source in (nominal, corrected):
        source.load()
    with nominal.errors():
        loaded = loaded.reading(nominal)
    read = partial(refusals.read, session.sources, setup=loaded.setup, dialect=loaded.dialect)
    tell("read", 0.0)
    with nominal.errors("<nominal>"):
        _, first = read(nominal, options=Options(tell=part(tell, 0.0, 0.25)), unrolling=options, kept=True)
    with corrected.errors("<corrected>"):
        reading = Options(tell=part(tell, 0.25, 0.4))
        _, second = read(corrected, options=reading, unrolling=unrolling_of_corrected(first))
    outside = "OLP403" if options.outside_box == "hold" else None
    done = verify_programs(
        (first, nominal.name), (second, corrected.name), loaded, options, outside=outside,
        tell=part(tell, 0.4, 1.0),
    )  # fmt: skip
    origin = done.nominal.origin
    report, findings = placed(done.report, origin), placed_findings(done.findings, origin)
    position_mm = read_only(done.proof.nominal.end_mm)
    return Verification(report, findings, done.table, position_mm, done.confidence)
