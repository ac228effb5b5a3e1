"""From the files of a job on a machine with rotary joints to its review: tips in workpiece coordinates, and
the direction of the tool beside them."""

from __future__ import annotations

import datetime
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from olp.compensation.joints.path import JointPath
from olp.core.arrays import Array, Index
from olp.core.errors import CannotCompute
from olp.core.machine import ZERO
from olp.core.toolpath import Arcs, Kind, Toolpath
from olp.core.units import AXES, MM_PER_UM, RAD_PER_URAD
from olp.core.values import dataclass
from olp.files.points import Points
from olp.files.sources import Source
from olp.kinematics.correction import deviations
from olp.proof.joint_places import Places, visited
from olp.proof.joint_sides import Sides
from olp.proof.judgement import Judgements, every, groups_of, part_answer, question
from olp.proof.proof import Counts
from olp.reports.joints import verdict_of
from olp.review.features.moves import digit_mm
from olp.review.job import Review
from olp.review.joint_machine import drawn
from olp.review.joint_motion import joint_limits, joint_table
from olp.review.listing import aligned
from olp.review.measured import Matched, Matcher, refuse_unplaced, with_measured
from olp.review.meshes import of_job
from olp.review.motion import by_feed, feed_seconds, filled
from olp.review.samples import Samples
from olp.review.scene import Figures, Frame, Scene, TipUncertainty
from olp.trajectory.from_joints import missing_limits
from olp.uncertainty.probability import within
from olp.uncertainty.spread import bands
from olp.workflows.compare_runs import How, judged
from olp.workflows.joints.compare import ground_of, measured_points
from olp.workflows.joints.correct import JointOptions, ProvedJoints, correction_of
from olp.workflows.joints.loaded import JointRun
from olp.workflows.joints.retime import JointRetimeOptions, motion_of
from olp.workflows.joints.uncertain import Known, known_of
from olp.workflows.joints.verify import verification_of
from olp.workflows.session import PathLike

#: Places along a corrected move, to one of those that the plan looked at.
_FINER = 2
#: Programmed tips are those of the frame of their words within this, in mm.
_SAME_MM = 1e-6
#: The speed that is shown where a list states none, in mm/s.
_SHOWN_MM_S = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """The n samples: `places` on the corrected path, nominal tips, axis values. `command_mm` are tips where
    the corrected program would bring an exact machine. By layer: deviations in mm (n, 3) and rad (n,)."""

    places: Places
    tip_mm: Array
    axes: Array
    command_mm: Array
    off_mm: Mapping[str, Array]
    off_rad: Mapping[str, Array]


def view_joints(
    program: PathLike | bytes,
    machine: PathLike,
    job: PathLike | None = None,
    *,
    corrected: PathLike | bytes | None = None,
    tolerance_um: float = 1.0,
    tolerance_urad: float = 10.0,
    flatten: bool = False,
    expand_cycles: bool = False,
    outside_box: Literal["refuse", "hold"] = "refuse",
    date: datetime.date | None = None,
    time: bool = True,
    measured: Sequence[PathLike] = (),
    part_tolerance_um: float | None = None,
) -> Review:
    """A program of a machine with rotary joints and its correction, for a browser.

    `corrected` is the corrected program, which is proved as in `verify_joints`. Without it the program is
    corrected as in `correct_joints`. Without `time`, or without limits of motion in the machine file, the
    motion is not planned: times are those of the programmed feed. `measured` are files of measured tips, one
    run each, as `compare` takes them; `part_tolerance_um` is what these and the part are judged by, that of
    the job where it is None. Raises as these, and InputError for points that are not on the path.
    """
    options = JointOptions(
        tolerance_um=tolerance_um, tolerance_urad=tolerance_urad, flatten=flatten,
        expand_cycles=expand_cycles, outside_box=outside_box, part_tolerance_um=part_tolerance_um, date=date,
    )  # fmt: skip
    run = JointRun.of(program, machine, job)
    second = None if corrected is None else run.sources.source(corrected, program)
    return reviewed(run, options, second, measured, time=time)


def reviewed(
    run: JointRun,
    options: JointOptions,
    corrected: Source | None,
    measured: Sequence[PathLike],
    *,
    time: bool,
) -> Review:
    """As `view_joints`, for a run that is loaded."""
    if corrected is None:
        return page_of(run, correction_of(run, options), options, "", measured, time=time)
    return page_of(
        run, verification_of(run, corrected, options), options, corrected.name, measured, time=time
    )


def page_of(
    run: JointRun, done: ProvedJoints, options: JointOptions, corrected_name: str,
    measured: Sequence[PathLike] = (), *, time: bool,
) -> Review:  # fmt: skip
    """The review of two programs that are proved. Raises CannotCompute where no position is known."""
    path, second = done.nominal, done.corrected
    seen = _seen(done)
    frame = _frame(path, seen)
    origin = np.array(frame.origin_mm)
    nominal = replace(path.program, toolpath=_tips(path, seen, origin))
    position = seen.tip_mm - origin
    samples = _samples(path, seen, position, origin)
    machine, tool = run.machine, _tool(run, path)
    nodes, bodies, axes, drawn_at = drawn(
        machine.structure, path.motion, seen.axes, tool, (origin, float(np.ptp(position, axis=0).max()))
    )
    planned = time and not missing_limits(machine.structure)
    motion = None
    if planned:
        timing = motion_of(run, second, JointRetimeOptions())
        moment, motion = filled(timing.seconds(samples.part, samples.within)), joint_table(timing.stretches)
    else:
        moment = by_feed(_seconds(run, nominal, samples), samples)
    known, part_um = known_of(run, options.date), run.part_tolerance_um(options.part_tolerance_um)
    table, report = _table(done, options), done.report | {"verdict": _verdict(done)}
    matched: tuple[Matched, ...] = ()
    digests: tuple[str, ...] = ()
    if measured:
        files = [measured_points(name, run, path) for name in measured]
        matched, table, report = _with_runs(part_um, path, samples, origin, files, (table, report))
        digests = tuple(points.sha256 for points in files)
    return Review(
        Scene(
            name=done.source.short or "program",
            corrected_name=Path(corrected_name).name,
            digest=_digest(run, done, digests),
            machine=machine.structure.name,
            nominal=nominal,
            frame=frame,
            samples=samples,
            position_mm=position,
            waypoint=np.ones(len(samples), bool),
            axes=axes,
            drawn_at=drawn_at,
            nodes=nodes,
            limits={} if motion is None else joint_limits(machine.structure),
            time_s=moment,
            motion=motion,
            duration_s=float(moment[-1]),
            sources=(),
            listing=aligned(nominal, second.program, done.proof.groups, samples),
            bodies=(*of_job(run.job, run.setup, origin, run.sources.read), *bodies),
            measured=matched,
            report=report,
            figures=_figures(done),
            table=table,
            tolerance_um=done.report["deviation"]["allowed_um"],
            tool_radius_mm=tool[1],
            tool_radii_mm={},
            digit_mm=digit_mm(path.program),
            turn_urad={name: angle / RAD_PER_URAD for name, angle in seen.off_rad.items()},
            units=dict(zip(machine.structure.order, machine.structure.units, strict=True)),
            straight=False,
            uncertainty=None if known is None else _uncertainty(run, path, seen, known, part_um),
            planned=planned,
        )
    )


def _uncertainty(
    run: JointRun, path: JointPath, seen: _Seen, known: Known, part_um: float | None
) -> TipUncertainty:
    """Bands of tips at the samples and, where a part tolerance is stated, probabilities of being beyond."""
    covariance = known.spread(run, path, seen.axes, path.tool[seen.places.move]).tip
    band = bands(covariance).astype(np.float32)
    if part_um is None:
        return TipUncertainty(None, band, {})
    radius = part_um * MM_PER_UM
    beyond = {
        name: np.asarray(1.0 - within(covariance, seen.off_mm[name], radius), np.float32)
        for name in ("uncorrected", "corrected")
    }
    return TipUncertainty(radius, band, beyond)


def _with_runs(
    part_um: float | None, path: JointPath, samples: Samples, origin: Array, files: Sequence[Points],
    shown: tuple[Judgements, dict[str, Any]],
) -> tuple[tuple[Matched, ...], Judgements, dict[str, Any]]:  # fmt: skip
    """Measured runs among the samples, and the table and the report with them."""
    table, report = shown
    ground, how = ground_of(path), How(part_tolerance_um=part_um)
    done = judged(ground, files, how)
    refuse_unplaced(files, done.placed, how.reach_mm)
    matcher = Matcher(ground, samples, lambda points, _: points - origin)
    matched = tuple(
        matcher.match(one, order) for one, order in zip(done.placed.runs, done.placed.orders, strict=True)
    )
    table = table.with_measured(replace(done.layers["after"], line=table.line))
    return matched, table, with_measured(report, table, done)


def _seen(done: ProvedJoints) -> _Seen:
    """Places along the corrected path, as the proof looks at them and along rapids too."""
    path, second = done.nominal, done.corrected
    every = np.ones(len(path), bool)
    parts = list(visited(path, second, done.proof.groups, done.plan, every, every, _FINER))
    columns = [
        np.concatenate([getattr(p, name) for p in parts]) for name in ("move", "rows", "part", "share")
    ]
    order = np.lexsort((columns[2], columns[1]))
    if not len(order):
        raise CannotCompute(
            "no position of the program is known, so there is nothing to show; command all axes first"
        )
    move, rows, part, share = (column[order] for column in columns)
    side, unknown = (np.concatenate([getattr(p, name) for p in parts])[order] for name in ("side", "unknown"))
    places = Places(move, rows, part, share, side, unknown)
    target = places.targets(path)
    own = Places(move, move, share, share, *_own_sides(path, move, share))
    axes, before = own.poses(path)
    commanded, after = places.poses(second)
    command = second.motion.nominal(commanded, second.tool[rows])
    structure, poses = path.motion.structure, {"uncorrected": before, "corrected": after}
    return _Seen(
        places, target.position, axes, command.position,
        {name: pose.position - target.position for name, pose in poses.items()},
        {name: deviations(structure, pose, target)[1] for name, pose in poses.items()},
    )  # fmt: skip


def _own_sides(path: JointPath, move: Index, share: Array) -> tuple[Array, Array]:
    """(n, axes) the sides of the backlash of the uncorrected program, as `Sides.at`."""
    sides = Sides.of(path)
    return sides.at(move, np.where(np.isfinite(sides.start[move]).all(axis=1), share, 1.0))


def _frame(path: JointPath, seen: _Seen) -> Frame:
    """The work offset of a program with only one whose words state these tips, else the workpiece with all
    axes at zero."""
    used = {(path.program.toolpath.frames[k].work_offset) for k in np.unique(path.program.toolpath.frame)}
    move = seen.places.move
    columns = [
        path.motion.structure.order.index(name) for name in AXES if name in path.motion.structure.order
    ]
    if len(used) == 1 and path.tip.any() and len(columns) == len(AXES):
        own = path.tip[move] & (seen.places.share == 1.0)
        offsets = {tuple(row) for row in path.offset[path.tip][:, columns].tolist()}
        stated = path.end[move[own]][:, columns]
        if len(offsets) == 1 and (np.abs(stated - seen.tip_mm[own]) < _SAME_MM).all():
            (name,), (x, y, z) = used, offsets.pop()
            return Frame(f"{name}, as programmed", name, (x, y, z))
    return Frame("workpiece, all axes at zero", "workpiece", ZERO)


def _tips(path: JointPath, seen: _Seen, origin: Array) -> Toolpath:
    """The moves as straight ways of the tip."""
    toolpath, end = path.program.toolpath, np.full((len(path), 3), np.nan)
    end[seen.places.move] = seen.tip_mm - origin
    frames = tuple(
        replace(frame, offset_mm=ZERO, length_mm=ZERO, turn=None, compensation=None)
        for frame in toolpath.frames
    )
    nowhere = (float("nan"),) * 3
    return replace(toolpath, end_mm=end, frames=frames, arcs=Arcs.none(), start_mm=nowhere)


def _samples(path: JointPath, seen: _Seen, position: Array, origin: Array) -> Samples:
    """The samples of a page, with tips for axis positions."""
    places = seen.places
    joined = np.asarray(np.isfinite(path.start).all(axis=1))[places.move]
    joined[0] = False
    step = np.linalg.norm(np.diff(position, axis=0, prepend=position[:1]), axis=1)
    return Samples(
        places.move, places.share, places.rows, places.part, position, seen.command_mm - origin,
        seen.off_mm["uncorrected"].astype(np.float32), seen.off_mm["corrected"].astype(np.float32), joined,
        np.cumsum(np.where(joined, step, 0.0)), None,
    )  # fmt: skip


def _seconds(run: JointRun, nominal: Any, samples: Samples) -> Array:
    """(n,) s that each move takes, at the feed of its tip; of a list at a speed of our own."""
    if run.setup is not None and nominal.words is not None:
        return feed_seconds(nominal, run.setup.machine)
    length = np.zeros(len(nominal.toolpath))
    way = np.diff(samples.arc_mm, prepend=0.0)
    np.add.at(length, samples.move, way)
    return length / _SHOWN_MM_S


def _table(done: ProvedJoints, options: JointOptions) -> Judgements:
    """The judgements of the proof, of positions."""
    proof, path = done.proof, done.nominal
    toolpath = path.program.toolpath
    tool, operation = groups_of(toolpath)
    counts = np.full(len(path), Counts.UNKNOWN, np.uint8)
    counts[np.isfinite(proof.after.distance_mm)] = Counts.UNCORRECTED
    counts[(counts == Counts.UNCORRECTED) & (toolpath.kind == Kind.RAPID)] = Counts.RAPID
    counts[proof.judged] = np.where(path.feed, Counts.FEED, Counts.POINT)[proof.judged]
    return Judgements(
        path.line, tool, operation, counts, proof.before.distance_mm.astype(np.float32),
        proof.after.distance_mm.astype(np.float32), options.tolerance_um * MM_PER_UM, proof.allowed_mm,
    )  # fmt: skip


def _figures(done: ProvedJoints) -> dict[str, Figures]:
    sides = {"uncorrected": "before", "corrected": "after"}
    stated = {name: done.report["deviation"][side] for name, side in sides.items()}
    return {
        name: Figures(side["position_rms_um"], None, side["orientation_max_urad"])
        for name, side in stated.items()
    }


def _verdict(done: ProvedJoints) -> dict[str, Any]:
    """What the report says, as answers to the questions of the program and of the part."""
    holds = done.proof.holds if done.proof.judged.any() else None
    part, sentences = done.report.get("part"), verdict_of(done.report).split("\n")
    about = [question("program", holds, " ".join(sentences[:2]))]
    if part is not None:
        about.append(question("part", part_answer(part), part["sentence"]))
    return {
        "ok": every(one["ok"] for one in about), "part": part, "questions": about,
        "sentences": [one["sentence"] for one in about],
    }  # fmt: skip


def _tool(run: JointRun, path: JointPath) -> tuple[int, float]:
    """The place of the tool in the motion, and its radius in mm, 0 where it has none."""
    used = np.unique(path.tool)
    tools = {**run.machine.tools, **run.job.tools}
    vector = path.motion.machines[int(used[0])].tool_mm
    radii = [tool.radius_mm or 0.0 for tool in tools.values() if tool.tool_vector_mm == vector]
    return int(used[0]), max(radii, default=0.0) if len(used) == 1 else 0.0


def _digest(run: JointRun, done: ProvedJoints, measured: Sequence[str]) -> str:
    """12 digits that change with every input of the page; `measured` are the digests of those files."""
    combined = hashlib.sha256(done.nominal.program.data)
    for part in (
        done.corrected.program.data,
        run.digest.encode(),
        repr((run.machine, run.job, measured)).encode(),
    ):
        combined.update(b"\0")
        combined.update(part)
    for mesh in run.job.meshes:
        combined.update(run.sources.digest(mesh.file))
    for digest in measured:
        combined.update(digest.encode())
    return combined.hexdigest()[:12]
