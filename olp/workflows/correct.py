"""`correct`: a program corrected and proved. Read, plan, write, prove, report."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from olp.checks import correction as checks
from olp.compensation.planning import written_plans
from olp.compensation.stamp import find_real_time, find_stamp, refuse_second, stamped
from olp.compensation.tally import Tally
from olp.compensation.writer import Task
from olp.compensation.writing import write
from olp.core.arrays import Array, Index, read_only
from olp.core.errors import ProgramError, UsageError
from olp.core.machine import Setup
from olp.core.progress import Progress, part, silent
from olp.core.spool import Spool, Text, whole
from olp.core.values import dataclass
from olp.errormodel.known import KnownErrors
from olp.files.sources import Source, Sources
from olp.files.write import write_bytes
from olp.findings.catalogue import Finding
from olp.program.origin import Unrolled, origin_of
from olp.program.program import Program
from olp.program.registry import Options, read
from olp.program.text.columns import Packed
from olp.proof.judgement import Judgements
from olp.workflows import refusals
from olp.workflows.doubt import accepted_of, doubted
from olp.workflows.kept import (
    NOT_PROVED,
    Flow,
    findings_of,
    provably_kept,
    refused,
    through,
    unrolled_again,
    unrolled_unasked,
    with_flow,
)
from olp.workflows.original import placed, placed_findings
from olp.workflows.proof import Pair, ProofOptions, Run, digest_of, limits_of, proved
from olp.workflows.session import Loaded, Outside, PathLike, Session, opened
from olp.workflows.shown import Judged

if TYPE_CHECKING:
    from olp.uncertainty.spread import Confidence


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectOptions(ProofOptions):
    """The options of `correct`. Under cutter compensation a `contour` is written as one, or as the path of
    the tool without compensation. With `times` both programs are planned in time."""

    outside_box: Outside = "refuse"
    split_rapids: bool = False
    contour: Literal["contour", "path"] = "contour"
    times: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Correction(Judged):
    """A corrected program: its bytes, the report as a mapping ("olp-report-1"), and the findings;
    `confidence` has bands and probabilities by waypoint where a part tolerance is stated and the calibration
    states uncertainties. `table` has the judgement of every nominal move, and (n,) `groups` the last move of
    the corrected program that belongs to each. `nominal` is the text that was corrected, unrolled where the
    call asks for it, or where its loops and subprograms are kept. Lines of the table are then those of its
    original, which count through its files. `plain` is the corrected text, unrolled where those are kept.
    (n, 3) `position_mm` are the nominal axis positions at the ends of the moves, NaN where unknown. `inputs`
    are the files that were read, which `write` never overwrites."""

    _data: Source
    _plain: Program
    report: dict[str, Any]
    findings: tuple[Finding, ...]
    table: Judgements
    groups: Index
    _nominal: Program
    position_mm: Array
    confidence: Confidence | None = None
    inputs: tuple[str, ...] = ()

    @staticmethod
    def of(run: Run, inputs: tuple[str, ...] = ()) -> Correction:
        origin = run.nominal.origin
        return Correction(
            run.text, run.corrected, placed(run.report, origin), placed_findings(run.findings, origin),
            run.table, read_only(run.proof.groups), run.nominal, read_only(run.proof.nominal.end_mm),
            run.confidence, inputs,
        )  # fmt: skip

    @property
    def data(self) -> bytes:
        """The corrected text."""
        return whole(self.text)

    @property
    def text(self) -> Text:
        """The corrected text, which is in a temporary file where it is long."""
        return self._data.data

    @property
    def plain(self) -> bytes:
        """The corrected text, unrolled where its loops and subprograms are kept."""
        return whole(self._plain.data)

    @property
    def nominal(self) -> bytes:
        """The text that was corrected."""
        return whole(self._nominal.data)

    def to_text(self) -> str:
        """The report as `olp correct` prints it."""
        from olp.reports.report import to_text

        return to_text(self.report)

    def write(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the corrected program, whole or not at all, also where it is above tolerance: look at
        `report["verdict"]["ok"]` first. An existing file is overwritten with `force` only, an input never.
        Returns the path. Raises as `olp.files.write.write_files`."""
        write_bytes(path, self.text, force=force, inputs=self.inputs)
        return Path(path)


def correct(
    program: PathLike | bytes,
    machine: PathLike | Setup | KnownErrors,
    job: PathLike | None = None,
    *,
    tolerance_um: float = 1.0,
    outside_box: Literal["refuse", "hold"] = "refuse",
    flatten: bool = False,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
    contour: Literal["contour", "path"] = "contour",
    split_rapids: bool = False,
    times: bool = False,
    part_tolerance_um: float | None = None,
    only_sure_components: bool = False,
    date: datetime.date | None = None,
    accept: Sequence[str] = (),
    progress: Progress | None = None,
) -> Correction:
    """Correct a program for a machine, and prove it.

    `program` is a path or the bytes of the text, `machine` the machine file or a Setup. The corrected text is
    in the program's own dialect; only coordinate words differ, and words and blocks are inserted. With
    `flatten` loops, subprograms and expressions are unrolled first, with `expand_cycles` canned cycles are
    written out. `peck_clearance_mm` is the clearance above the last peck, for controls where it is a
    parameter. Under cutter compensation (G41, G42) a contour is written from which the control makes the
    corrected path of the tool; with `contour` "path" that path is written, without compensation. With `times`
    the report states how long both programs take, as `retime` plans them, with a simpler plan of long ones.

    Where the calibration states uncertainties, the report gives the probability that the tip is within
    `part_tolerance_um` (default: the job's; without any there is no probability). With
    `only_sure_components` components within their own uncertainty are not corrected. `accept` are codes of
    doubts about the inputs that are no error here; the stamp states them. Raises InputError (ProgramError
    with its line, ConfigError, OutsideBox, Doubtful) and CannotCompute.
    """
    session, source = opened(program, machine, job)
    options = CorrectOptions(
        tolerance_um=tolerance_um, outside_box=outside_box, flatten=flatten, expand_cycles=expand_cycles,
        peck_clearance_mm=peck_clearance_mm, contour=contour, split_rapids=split_rapids, times=times,
        part_tolerance_um=part_tolerance_um, only_sure_components=only_sure_components, date=date,
        accept=tuple(accept),
    )  # fmt: skip
    return run(session, source, options, progress)


def run(
    session: Session, program: Source, options: CorrectOptions, progress: Progress | None = None
) -> Correction:
    """As `correct`, in a session."""
    with program.errors():
        loaded = session.loaded(options.outside_box, only_sure=options.only_sure_components)
        done = corrected(session.sources, program, loaded, options, progress or silent)
    result = Correction.of(done, session.inputs())
    if options.times:
        from olp.workflows.correct_time import times

        result.report["time"] = times(session, program, result, options, progress)
    return result


def corrected(
    sources: Sources, program: Source, loaded: Loaded, options: CorrectOptions, tell: Progress,
    outside: str = "OLP403", refuse_doubts: bool = True,
) -> Run:  # fmt: skip
    """Correct a program and prove it; `outside` is the code of findings outside the box, whose error is that
    at its face. Without `refuse_doubts` they are findings alone. Raises as `correct`."""
    refuse_second(program.data)
    loaded = loaded.reading(program)
    done = _rewritten(sources, program, loaded, options, refuse_doubts, tell)
    try:
        return _proved(sources, program, loaded, options, tell, outside, done)
    except ProgramError as error:
        kept = None if done.flow is None or done.flow.outer is not None else done.flow.kept
        if error.code != NOT_PROVED or kept is None or kept.apart is None:
            raise
        failure = error
    done = _rewritten(sources, program, loaded, options, refuse_doubts, tell, failure)
    return _proved(sources, program, loaded, options, tell, outside, done)


def _proved(
    sources: Sources, program: Source, loaded: Loaded, options: CorrectOptions, tell: Progress,
    outside: str, done: _Rewritten,
) -> Run:  # fmt: skip
    """Prove a program that was written with its corrections."""
    digest = digest_of(done.source.data)
    tell("prove", 0.7)
    reading = Options(tell=part(tell, 0.7, 0.78, "prove"))
    held = outside if options.outside_box == "hold" else None
    told = part(tell, 0.78, 1.0)

    def prove(text: Source, notes: tuple[Finding, ...] = ()) -> Run:
        assert done.text is not None
        try:
            second = read(text.data, loaded.setup, loaded.dialect, reading, words=False)
        except ProgramError as error:
            if error.code != "OLP528":
                raise
            with done.nominal.errors():
                raise _refused_contour(error, done, text.data) from None
        pair = Pair(done.nominal, done.source, digest, second, done.text, done.uncorrected)
        return proved(pair, loaded.held(), options, done.doubts, outside=held, notes=notes, tell=told)

    assert done.text is not None
    if done.flow is None:
        run = prove(done.text)
    else:
        with provably_kept():
            text = unrolled_again(sources, program, done.text.data, loaded, part(tell, 0.7, 0.74))
            run = prove(text, findings_of(done.flow))
            # where the unrolled program is no better, its flow is not the reason, nor where none was kept
            flat = done.unrolled
            kept = run.proof.holds or flat is None
            if not kept and not _as_good(run, prove(done.source.holding(flat or b""))):
                raise ProgramError("it is above the tolerance then", code=NOT_PROVED)
    return replace(run, report=run.report | _written_report(done))


def _as_good(kept: Run, unrolled: Run) -> bool:
    """Whether a program that kept its flow is as near to the nominal path as unrolled, but for rounding."""
    digit_mm = kept.proof.digit_mm
    return not unrolled.proof.holds and kept.proof.largest_mm <= unrolled.proof.largest_mm + 2 * digit_mm


@dataclass(frozen=True, slots=True, eq=False)
class _Rewritten:
    """A program written with its corrections. `source` is the text that was read, `nominal` what it says,
    without its words. `uncorrected` are moves that are left so, (n,) `parts` the number of moves of each
    nominal one. `flow` is there where the text keeps the flow of a program that was unrolled to be read; the
    text is None where it cannot, and `unrolled` is the corrected one without its flow."""

    source: Source
    nominal: Program
    text: Source | None
    uncorrected: Index
    parts: Packed
    tally: Tally
    doubts: tuple[Finding, ...]
    flow: Flow | None = None
    unrolled: bytes | None = None


def _rewritten(
    sources: Sources, source: Source, loaded: Loaded, options: CorrectOptions, refuse_doubts: bool,
    tell: Progress, failure: ProgramError | None = None,
) -> _Rewritten:  # fmt: skip
    """Read, plan and write. Where a program cannot keep its flow, calls whose passes need other numbers are
    written out, and it is read again. So are all of them where `failure` says that it is not proved as it
    is."""
    read_kept = partial(
        refusals.read, sources, setup=loaded.setup, dialect=loaded.dialect,
        options=Options(tell=part(tell, 0.0, 0.2)), unrolling=options, kept=True,
    )  # fmt: skip
    tell("read", 0.0)
    source, program = read_kept(source)
    if options.split_rapids and (program.verbatim or program.targets is not None):
        raise UsageError(
            "--split-rapids does not go with this dialect: it does not state the path between its points; "
            'set joined = "lines" and insert = true in the profile'
        )
    inner = unrolled_unasked(source, options)
    if options.contour == "path" and program.toolpath.compensated().any():
        # the path of the tool is made from what is unrolled
        source, program = _as_path(source, program, loaded, Options(tell=part(tell, 0.0, 0.2)))
        inner = None
    done = _written(source, program, inner, loaded, options, refuse_doubts, tell)
    if done.text is not None and failure is None:
        return done
    assert inner is not None
    assert done.flow is not None
    first = done.flow.kept
    assert first is not None
    refusal, outer = failure or refused(first, inner.origin), first.apart
    if outer is None:
        raise refusal
    del done, program
    source, program = read_kept(source.holding(bytes(outer)))
    inner = unrolled_unasked(source, options)
    data = outer if inner is None else through(inner, outer)
    program = replace(program, data=data)
    done = _written(source.holding(data), program, inner, loaded, options, refuse_doubts, tell)
    if done.text is None:
        raise refusal
    kept = None if done.flow is None else done.flow.kept
    return replace(done, flow=Flow(kept, outer, first.calls))


def _written(
    source: Source, program: Program, unrolled: Unrolled | None, loaded: Loaded, options: CorrectOptions,
    refuse_doubts: bool, tell: Progress,
) -> _Rewritten:  # fmt: skip
    """Plan and write a program that was read; with `unrolled`, a text that was unrolled only to be read, into
    the program that it was made from. Words and plan of a long program are large: this function releases
    them."""
    doubts = doubted(program, loaded, options.accept, options.date, name=source.name, refuse=refuse_doubts)
    accepted = accepted_of(doubts)
    tell("correct", 0.2)
    told = part(tell, 0.2, 0.7)
    with program.errors():
        limits = limits_of(
            program, loaded, options, refuse_outside=options.outside_box == "refuse",
            split_rapids=options.split_rapids,
        )  # fmt: skip
        marked = find_real_time(source.data) is not None
        stamp = loaded.stamp(accepted) if loaded.dialect.marks and not marked else b""
        always = bool(accepted) or loaded.setup.machine.real_time is not None
        increments_mm = loaded.setup.machine.least_increment_mm
        task = Task(
            program.programmed or program, loaded.model, limits.tolerance_mm, increments_mm,
            b"" if unrolled is not None else stamp, always, located=unrolled is not None,
        )  # fmt: skip
        written = write(task, written_plans(program, loaded.model, limits, increments_mm, told), told)
    nominal = replace(program, words=None, slot=np.zeros((0, 3), np.int32), programmed=None, blocks=None)
    # the corrected text has lines of its own
    text: Spool | None = written.text or Spool(source.data)
    flow, flat = None, None
    if unrolled is not None:
        assert text is not None
        assert written.starts is not None
        flat = text.read()
        kept = with_flow(unrolled, flat, written.starts, loaded)
        whole = kept.text
        if whole is not None and stamp and (kept.changed or always):
            whole = stamped(whole, stamp, program.eol(1), loaded.dialect.first)
        flow, text = Flow(kept), None if whole is None else Spool(whole)
    parts = written.parts if program.blocks is None else Packed.of(written.parts[program.blocks])
    made = None if text is None else Source.made(text)
    return _Rewritten(source, nominal, made, written.uncorrected, parts, written.tally, doubts, flow, flat)


def _refused_contour(error: ProgramError, done: _Rewritten, text: Text) -> ProgramError:
    """The refusal of a contour that the control would take but for the digits of its correction, from that of
    the corrected `text`."""
    path, line, origin = done.nominal.toolpath, error.line or 1, origin_of(text)
    if origin is not None:
        # the error states a line of what was unrolled
        line = int(np.argmax(origin.line == line)) + 1
    own = np.array([(c := f.compensation) is None or not c.corner for f in path.frames], bool)[path.frame]
    move = np.flatnonzero(own)
    behind = path.line[move] + np.cumsum(done.parts[move] - 1)
    stamp = int(find_stamp(text) is not None)
    at = min(int(np.searchsorted(behind + stamp, line)), len(move) - 1)
    return ProgramError(
        "the control would refuse this block once corrected and rounded to its digits: "
        f"{error.message.partition(';')[0]}; have the path of the tool written with --contour path",
        line=int(path.line[move[at]]),
        code="OLP561",
    )


def _as_path(source: Source, program: Program, loaded: Loaded, reading: Options) -> tuple[Source, Program]:
    """The program with its contours written as the path of the tool. Raises UsageError
    for programs that are not written in blocks."""
    if program.statements is not None:
        raise UsageError(
            "--contour path goes with programs of blocks (G41, G42) only; points under CUTCOM are corrected "
            "where they are stated"
        )
    from olp.compensation.tool_path_text import as_tool_path, with_exact_path

    with program.errors():
        text, has_block = as_tool_path(program, loaded.setup.machine.least_increment_mm)
        try:
            written = read(text, loaded.setup, loaded.dialect, reading)
        except ProgramError as error:
            error.message = (
                f"the path of the tool cannot be written as blocks of this program: {error.message}"
            )
            raise
        return source.holding(text), with_exact_path(written, program, has_block)


def _written_report(done: _Rewritten) -> dict[str, Any]:
    """The parts of the report on the corrected text that are not in its proof."""
    tally = done.tally
    return {
        "moves": checks.tally_moves(done.nominal.toolpath, len(done.uncorrected), done.parts.small)
        | {
            "inserted_blocks": tally.inserted_blocks,
            "inserted_words": tally.inserted_words,
            "changed_words": tally.changed_words,
        },
    }  # fmt: skip
