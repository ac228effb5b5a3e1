"""From the files of a job to its review."""

from __future__ import annotations

import datetime
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import naming
from olp.core.machine import Setup
from olp.core.progress import Progress, part, silent
from olp.core.spool import Text
from olp.core.units import MM_PER_UM
from olp.core.values import dataclass
from olp.errormodel.known import KnownErrors
from olp.files.points import read_points
from olp.files.sources import Source, Sources
from olp.files.write import write_bytes
from olp.program.program import Program
from olp.program.registry import Options, read
from olp.proof.judgement import Judgements
from olp.proof.proof import Counts
from olp.review.features.moves import digit_mm
from olp.review.listing import aligned
from olp.review.manifest import curve_um, manifest_of
from olp.review.measured import Matched, Matcher, from_frames, refuse_unplaced, with_measured
from olp.review.meshes import Body, nodes, of_job, of_machine
from olp.review.motion import by_feed, feed_seconds, retimed
from olp.review.motion import table as motion_table
from olp.review.page import page
from olp.review.samples import Samples, by_source, sample, waypoints, with_starts
from olp.review.scene import Figures, Frame, Scene, TipUncertainty
from olp.uncertainty.probability import within
from olp.uncertainty.spread import Points, bands, covariances
from olp.workflows import refusals
from olp.workflows.compare_runs import Ground, How, judged
from olp.workflows.confidence import unknowns_of
from olp.workflows.correct import Correction, CorrectOptions
from olp.workflows.correct import corrected as correct_program
from olp.workflows.kept import unrolling_of_corrected
from olp.workflows.original import placed, placed_findings
from olp.workflows.proof import ProofOptions, Run, verify_programs
from olp.workflows.session import Loaded, Outside, PathLike, Session, opened

if TYPE_CHECKING:
    from olp.trajectory.variants import Plan

#: Shortest rest at a sample that counts, in s.
_REST_S = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewOptions(ProofOptions):
    """The options of `view`."""

    outside_box: Outside = "refuse"
    time: bool = True
    step_mm: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Review:
    """A job ready for its page. `scene` has all that the page shows, as plain arrays."""

    scene: Scene
    _packed: list[tuple[dict[str, Any], bytes]] = field(default_factory=list, init=False, repr=False)

    def parts(
        self, live: Mapping[str, str] | None = None, progress: Progress | None = None
    ) -> Iterator[bytes]:
        """The page in parts. In `live`, `address`, relative to the page, answers with `proof`, a blank and
        the digest of the current inputs."""
        if not self._packed:
            manifest, arrays = manifest_of(self.scene, progress or silent)
            self._packed.append((manifest, arrays.encoded()))
        manifest, data = self._packed[0]
        return page(manifest | {"live": live}, data, live=live is not None)

    def html(self) -> bytes:
        """The page: one file, which needs no other file and no network."""
        return b"".join(self.parts())

    def write(self, path: PathLike, *, force: bool = False) -> None:
        """Write the page, whole or not at all. Raises as `olp.files.write.write_files`."""
        write_bytes(path, self.parts(), force=force)


def view(
    program: PathLike | bytes,
    machine: PathLike | Setup | KnownErrors,
    job: PathLike | None = None,
    *,
    corrected: PathLike | bytes | None = None,
    measured: Sequence[PathLike] = (),
    correction: Correction | None = None,
    corrected_name: str = "",
    tolerance_um: float = 1.0,
    outside_box: Literal["refuse", "hold"] = "refuse",
    flatten: bool = False,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
    part_tolerance_um: float | None = None,
    only_sure_components: bool = False,
    date: datetime.date | None = None,
    accept: Sequence[str] = (),
    time: bool = True,
    step_mm: float | None = None,
    progress: Progress | None = None,
) -> Review:
    """A program, its correction and measurements of it, for a browser.

    `corrected` is the corrected program, which is proved as in `verify`, against the nominal program unrolled
    where `flatten` or `expand_cycles` ask for it. Without it the program is corrected
    as in `correct`, or `correction` is the result of that, under the name `corrected_name`. `measured` are
    files of tip positions, read and placed on the path as in `olp.compare`; the findings of that are added
    to the others. Without `time`, or without limits of motion in the machine file, the motion is not
    planned: times are those of the programmed feed. `step_mm` is the distance between samples.
    `part_tolerance_um`, `only_sure_components`, `date` and `accept` are those of `correct`. Raises InputError
    (ProgramError with its line, ConfigError, Doubtful) and CannotCompute.
    """
    session, source = opened(program, machine, job)
    options = ViewOptions(
        tolerance_um=tolerance_um, outside_box=outside_box, flatten=flatten,
        expand_cycles=expand_cycles, peck_clearance_mm=peck_clearance_mm, part_tolerance_um=part_tolerance_um,
        only_sure_components=only_sure_components, date=date, accept=tuple(accept), time=time,
        step_mm=step_mm,
    )  # fmt: skip
    second = None if corrected is None else session.sources.source(corrected, program)
    return run(
        session, source, options, corrected=second, correction=correction, corrected_name=corrected_name,
        measured=measured, progress=progress,
    )  # fmt: skip


def run(
    session: Session,
    program: Source,
    options: ViewOptions,
    *,
    corrected: Source | None = None,
    correction: Correction | None = None,
    corrected_name: str = "",
    measured: Sequence[PathLike] = (),
    progress: Progress | None = None,
) -> Review:
    """As `view`, in a session."""
    tell = progress or silent
    outside = "hold" if corrected is not None else options.outside_box
    program.load()
    with program.errors():
        loaded = session.loaded(outside, only_sure=options.only_sure_components).reading(program)
        tell("read", 0.0)
        reading = Options(tell=tell)
        text, nominal = refusals.read(
            session.sources, program, loaded.setup, loaded.dialect, reading, options, kept=True
        )
        # the words of a long program are large: after this they are not needed
        planned = options.time and not loaded.setup.machine.missing_limits
        seconds = None if planned else feed_seconds(nominal, loaded.setup.machine)
        digit = digit_mm(nominal)
    if corrected is not None:
        corrected.load()
        second: Source | Correction | Run = corrected
        corrected_name = corrected.name
    elif correction is not None:
        second = correction
    else:
        # the correction reads the program itself
        del nominal
        with program.errors():
            done = _corrected(session, text.data, loaded, options, tell)
        second, nominal = done, done.nominal
        del done
    with naming(corrected_name or (f"{program.name} (corrected)" if program.name else "")):
        texts = _proved(session.sources, program, nominal, second, corrected_name, loaded, options, tell)
        del second, nominal
        shown = _shown(session, texts, seconds, loaded, options, progress)
    tell("pack", 0.0)
    return Review(_scene(session, texts, shown, loaded, options, measured, digit))


@dataclass(frozen=True, slots=True, eq=False)
class _Texts:
    """The nominal program as shown, unrolled where the call asks for it, and the corrected one, as read. Also
    what the correction or its verification says: report, table of judgements, and the last corrected move of
    each nominal one."""

    source: Source
    nominal: Program
    corrected_name: str
    second: Program
    report: dict[str, Any]
    table: Judgements
    groups: Index


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """Points along both paths, (n,) s at which they are reached, and the motion where it is planned."""

    samples: Samples
    moment: Array
    plan: Plan | None


def _corrected(session: Session, data: Text, loaded: Loaded, options: ViewOptions, tell: Progress) -> Run:
    correcting = CorrectOptions(**options.proof(), outside_box=options.outside_box)
    return correct_program(session.sources, session.sources.source(data), loaded, correcting, tell)


def _proved(
    sources: Sources, program: Source, nominal: Program, corrected: Source | Correction | Run, name: str,
    loaded: Loaded, options: ViewOptions, tell: Progress,
) -> _Texts:  # fmt: skip
    """Both programs with their correction, or with the verification of the corrected one, `name`."""
    if isinstance(corrected, Run):
        report = placed(corrected.report, nominal.origin)
        groups = corrected.proof.groups
        return _Texts(program, nominal, name, corrected.corrected, report, corrected.table, groups)
    reading = Options(tell=part(tell, 0.0, 0.25))
    if isinstance(corrected, Correction):
        second = read(corrected.plain, loaded.setup, loaded.dialect, reading)
        report, table, groups = corrected.report, corrected.table, corrected.groups
        return _Texts(program, nominal, name, second, report, table, groups)
    unrolling = unrolling_of_corrected(nominal)
    _, second = refusals.read(sources, corrected, loaded.setup, loaded.dialect, reading, unrolling)
    run = verify_programs(
        (nominal, program.name), (second, name), loaded, options, outside="OLP403", tell=part(tell, 0.25, 1.0)
    )
    report, groups = placed(run.report, nominal.origin), run.proof.groups
    return _Texts(program, nominal, name, second, report, run.table, groups)


def _shown(
    session: Session, texts: _Texts, seconds: Array | None, loaded: Loaded, options: ViewOptions,
    progress: Progress | None,
) -> _Shown:  # fmt: skip
    """Samples, with the motion, or with the times at the programmed feed of moves that take `seconds`."""
    tell = progress or silent
    tell("sample", 0.0)
    samples = sample(texts.nominal, texts.second, texts.groups, loaded.model, options.step_mm, tell)
    samples = with_starts(samples, texts.nominal, texts.table)
    if seconds is not None:
        return _Shown(samples, by_feed(seconds, samples), None)
    from olp.workflows.retime import RetimeOptions
    from olp.workflows.retime_motion import motion

    other = session.sources.source(texts.second.data)
    # what the proof accepts holds for the motion, also where its stamp is that of sure components alone
    accept = tuple(texts.report["accepted"])
    timing = RetimeOptions(date=options.date, accept=accept)
    plan = motion(session.of(loaded.setup), other, timing, progress)
    samples, moment = _resting(samples, *retimed(texts.second.toolpath, samples, plan.trajectories))
    return _Shown(samples, moment, plan)


def _scene(
    session: Session, texts: _Texts, shown: _Shown, loaded: Loaded, options: ViewOptions,
    measured: Sequence[PathLike], digit: float,
) -> Scene:  # fmt: skip
    setup, nominal, plan = loaded.setup, texts.nominal, shown.plan
    samples, moment = shown.samples, shown.moment
    frame = Frame.of(nominal.toolpath)
    position = frame.positions(nominal.toolpath, samples.move, samples.axis_mm)
    report = texts.report
    part_um = loaded.part_tolerance_um(options.part_tolerance_um)
    table = texts.table
    shown_runs: tuple[Matched, ...] = ()
    digests: tuple[str, ...] = ()
    if measured:
        files = [read_points(path, read=session.sources.read_last) for path in measured]
        digests = tuple(points.sha256 for points in files)
        ground = Ground.of_program(nominal.in_original(), loaded)
        how = How(part_tolerance_um=part_um)
        done = judged(ground, files, how)
        refuse_unplaced(files, done.placed, how.reach_mm)
        matcher = Matcher(ground, samples, from_frames(ground, setup, np.array(frame.origin_mm)))
        runs = zip(done.placed.runs, done.placed.orders, strict=True)
        shown_runs = tuple(matcher.match(run, order) for run, order in runs)
        layer = done.layers["after"]
        done = replace(done, findings=placed_findings(done.findings, nominal.origin))
        table = table.with_measured(replace(layer, line=table.line))
        report = with_measured(report, table, done)
    bodies = tuple(_bodies(session, setup, nominal, samples, frame, position))
    machine = setup.machine
    return Scene(
        name=texts.source.short or "program",
        corrected_name=Path(texts.corrected_name).name,
        digest=_digest(texts, loaded, digests, session.sources),
        machine=machine.name,
        nominal=nominal,
        frame=frame,
        samples=samples,
        position_mm=position,
        waypoint=waypoints(samples, texts.table),
        axes=samples.axis_mm,
        drawn_at=samples.axis_mm[0],
        nodes=nodes(machine),
        limits={} if plan is None else machine.motion_limits(),
        time_s=moment,
        planned=plan is not None,
        motion=None if plan is None else motion_table(plan.trajectories, plan.case.legs),
        duration_s=float(moment[-1]) if plan is None else plan.duration_s,
        sources=tuple(
            (name, curve_um(size)) for name, size in by_source(nominal.toolpath, samples, loaded.model)
        ),
        listing=aligned(nominal, texts.second, texts.groups, samples),
        bodies=bodies,
        measured=shown_runs,
        report=report,
        figures=_figures(report, table),
        table=_as_shown(table, nominal),
        tolerance_um=report["verdict"]["numerical"]["allowed_um"],
        tool_radius_mm=_radius(setup, nominal),
        tool_radii_mm=_radii(setup, nominal),
        digit_mm=digit,
        uncertainty=_uncertainty(loaded, nominal, samples, part_um, options.date),
    )


def _figures(report: dict[str, Any], table: Judgements) -> dict[str, Figures]:
    """What a report says of each layer. Points alone have nothing between them."""
    along = bool((table.judged & (table.counts != Counts.POINT)).any())
    sides = {"uncorrected": report["deviation"]["before"], "corrected": report["deviation"]["after"]}
    return {
        name: Figures(float(side["between"]["rms_um"]) if along else None, float(side["waypoints"]["max_um"]))
        for name, side in sides.items()
    }


def _as_shown(table: Judgements, nominal: Program) -> Judgements:
    """The table with the lines of the text that is shown."""
    line = nominal.toolpath.line.astype(np.int64)
    runs = table.measured
    return replace(table, line=line, measured=None if runs is None else replace(runs, line=line))


def _uncertainty(
    loaded: Loaded, nominal: Program, samples: Samples, part_tolerance_um: float | None,
    date: datetime.date | None,
) -> TipUncertainty | None:  # fmt: skip
    """Bands of samples and, where a part tolerance is stated, probabilities, as `olp.workflows.confidence`
    gives them for waypoints."""
    if loaded.uncertainty is None:
        return None
    unknowns, _, _ = unknowns_of(loaded, loaded.uncertainty, date)
    before, after = samples.uncorrected.astype(float), samples.corrected.astype(float)
    points = Points(samples.move, samples.axis_mm, before, after, samples.play)
    covariance = covariances(unknowns, nominal.toolpath, points)
    band = bands(covariance).astype(np.float32)
    if part_tolerance_um is None:
        return TipUncertainty(None, band, {})
    radius = part_tolerance_um * MM_PER_UM
    beyond = {
        name: np.asarray(1.0 - within(covariance, deviation, radius), np.float32)
        for name, deviation in (("uncorrected", points.before_mm), ("corrected", points.after_mm))
    }
    return TipUncertainty(radius, band, beyond)


def _resting(samples: Samples, arrival: Array, leaving: Array) -> tuple[Samples, Array]:
    """Samples and their times; a sample at which the motion rests is repeated, for arrival and departure."""
    rests = np.flatnonzero(leaving - arrival > _REST_S)
    order = np.sort(np.concatenate((np.arange(len(samples)), rests)), kind="stable")
    again = np.diff(order, prepend=-1) == 0
    samples.become(order)
    samples.joined[again] = True
    return samples, np.where(again, leaving[order], arrival[order])


def _digest(texts: _Texts, loaded: Loaded, measured: Sequence[str], sources: Sources) -> str:
    """12 digits that change with every input of the page; `measured` are the digests of those files."""
    combined = hashlib.sha256(texts.nominal.data)
    for text in (texts.second.data, loaded.digest.encode(), _stated(loaded.setup).encode()):
        combined.update(b"\0")
        combined.update(text)
    for digest in measured:
        combined.update(bytes.fromhex(digest))
    for mesh in loaded.setup.job.meshes:
        combined.update(sources.digest(mesh.file))
    return combined.hexdigest()[:12]


def _stated(setup: Setup) -> str:
    """All that a setup states, the same in every process: the order of sets is not, as `repr` has them."""

    def plain(some: Any) -> Any:
        if isinstance(some, frozenset):
            return sorted(some)
        return {f.name: getattr(some, f.name) for f in fields(some)} if is_dataclass(some) else repr(some)

    return json.dumps(setup, default=plain)


def _bodies(
    session: Session, setup: Setup, nominal: Program, samples: Samples, frame: Frame, position: Array
) -> Iterator[Body]:
    yield from of_job(setup.job, setup, np.array(frame.origin_mm), session.sources.read)
    first = nominal.toolpath.frames[int(nominal.toolpath.frame[samples.move[0]])]
    tip = position[0]
    gauge = tip - np.array(first.tool_mm)
    same = len({f.tool_mm for f in nominal.toolpath.frames}) == 1
    radius = _radius(setup, nominal) if same else 0.0
    yield from of_machine(setup.machine, samples.axis_mm[0], gauge, tip, radius)


def _radius(setup: Setup, nominal: Program) -> float:
    return max(_radii(setup, nominal).values(), default=0.0)


def _radii(setup: Setup, nominal: Program) -> dict[int, float]:
    """The radii of the tools of a program in mm, of those that have one."""
    numbers = {f.tool for f in nominal.toolpath.frames if f.tool is not None}
    tools = {number: setup.tool(number) for number in sorted(numbers)}
    radii = {k: tool.radius_mm or 0.0 for k, tool in tools.items() if tool is not None}
    return {k: radius for k, radius in radii.items() if radius > 0.0}
