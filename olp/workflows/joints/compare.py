"""`compare` on machines with rotary joints: measured poses and paths of the tool in workpiece coordinates."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from olp.comparison.pairing import Order
from olp.comparison.path import Path
from olp.comparison.runs import Align
from olp.compensation.joints.path import JointPath
from olp.core.arrays import Array, Index
from olp.core.errors import InputError, UsageError
from olp.files.point_profile import PointProfile
from olp.files.points import Points, read_points
from olp.kinematics.coordinates import Coordinates
from olp.kinematics.poses import Poses
from olp.kinematics.programmed import stated_tips
from olp.program.pointlist.axis_list import names_of
from olp.proof.judgement import groups_of
from olp.uncertainty.spread import COVERAGE
from olp.workflows.compare import CompareOptions, Comparison, Side, compared
from olp.workflows.compare_runs import Ground
from olp.workflows.joints.along import Along
from olp.workflows.joints.doubt import doubted
from olp.workflows.joints.loaded import JointRun
from olp.workflows.joints.uncertain import NOT_INCLUDED, figures, known_of
from olp.workflows.session import PathLike

#: How files name the coordinates of the workpiece with all axes at zero, as `simulate` states them.
_WORKPIECE = "workpiece"
#: Nominal paths are sampled at least so often, mm.
_STEP_MM = 0.5


def compare_joints(
    program: PathLike | bytes,
    measured: Sequence[PathLike],
    machine: PathLike,
    job: PathLike | None = None,
    *,
    before: Sequence[PathLike] = (),
    poses: bool = False,
    profile: PointProfile | None = None,
    align: Align = "auto",
    order: Order | None = None,
    reach_mm: float = 1.0,
    part_tolerance_um: float | None = None,
    flatten: bool = False,
    expand_cycles: bool = False,
    date: datetime.date | None = None,
) -> Comparison:
    """As `compare`, on a machine with rotary joints: measured tips in workpiece coordinates against those of
    the nominal machine. The report states how well the calibration knows these poses, where it has a
    covariance. Raises InputError, UsageError and CannotCompute."""
    options = CompareOptions(
        before=tuple(before), poses=poses, profile=profile, align=align, order=order, reach_mm=reach_mm,
        part_tolerance_um=part_tolerance_um, flatten=flatten, expand_cycles=expand_cycles, date=date,
    )  # fmt: skip
    return compare_with(JointRun.of(program, machine, job), measured, options)


def compare_with(run: JointRun, measured: Sequence[PathLike], options: CompareOptions) -> Comparison:
    """Measured runs against the poses or the path that the nominal machine takes. Raises InputError,
    UsageError and CannotCompute."""
    if not measured:
        raise UsageError("no measured file is given; name at least one")
    options = replace(options, part_tolerance_um=run.part_tolerance_um(options.part_tolerance_um))
    with run.program.errors():
        _, path = run.read(run.program, options)
    sets = [
        [measured_points(name, run, path, options.profile, oriented=options.poses) for name in names]
        for names in (measured, options.before)
    ]
    side = Side(
        run.program, _poses(path, run.program.short) if options.poses else None,
        None if options.poses else path.program.in_original(), None,
        None if options.poses else ground_of(path), run.heads(), run.machine.structure.symmetric_tool,
    )  # fmt: skip
    done = compared(side, sets, options)
    known = _uncertainty(run, path, done, options.date)
    findings = (*done.findings, *doubted(run, path, options.accept, options.date, refuse=False))
    report = done.report | {"findings": [one.as_dict() for one in findings]}
    report |= {} if known is None else {"uncertainty": known}
    return replace(done, report=report, findings=findings, inputs=(*run.files, *run.sources.files))


def _uncertainty(
    run: JointRun, path: JointPath, done: Comparison, date: datetime.date | None
) -> dict[str, Any] | None:
    """How well the calibration knows the tips of what is compared, and how many of the measured points are
    within that; None where it states no covariance."""
    known, rows = known_of(run, date), _known(path)
    rows = rows if done.path is None else rows[path.judged[rows]]
    if known is None or not len(rows):
        return None
    line, tip, turn = known.bands_um_urad(run, path, rows)
    result = {
        "coverage_factor": COVERAGE,
        "source": known.source,
        "growth_by_age": known.growth,
        "band_um": figures(tip, "um"),
        "band_urad": figures(turn, "urad"),
        "not_included": list(NOT_INCLUDED),
    }
    if done.path is None or not done.counted.any():
        return result
    lines = np.unique(line)
    band = np.zeros(len(lines))
    np.maximum.at(band, np.searchsorted(lines, line), tip)
    counted = done.counted & np.isin(done.line, lines)
    own = band[np.searchsorted(lines, done.line[counted])]
    share = float(np.mean(done.deviation_um[counted] <= own)) if counted.any() else None
    return result | {"measured_within": share}


def _known(path: JointPath) -> Index:
    return np.flatnonzero(np.isfinite(path.end).all(axis=1))


def _nominal(path: JointPath, row: Index, places: Array) -> Poses:
    """Nominal poses at programmed coordinates (r, axes) of moves."""
    axes = path.motion.axes(places, path.tool[row], path.tip[row])
    return path.motion.nominal(axes, path.tool[row])


def _poses(path: JointPath, file: str) -> Points:
    """The poses at the ends of moves, with the names of a list."""
    rows = _known(path)
    poses = _nominal(path, rows, path.end[rows]).rows(len(rows))
    names = None if path.listed is None else names_of(path.listed)
    return Points(
        file, poses.position, None, names, path.line[rows].astype(np.int64), _WORKPIECE, PointProfile(), "",
        np.array(poses.rotation),
    )  # fmt: skip


def ground_of(path: JointPath) -> Ground:
    """The path of the nominal tip in workpiece coordinates, by chords."""
    along = Along.of(path, _STEP_MM).begun()
    places, move = along.nominal().position, along.move
    first = move[:1]
    begin = path.motion.axes(path.start[first], path.tool[first], path.tip[first])
    start = path.motion.nominal(begin, path.tool[first]).position
    points, move = np.vstack((start, places)), np.append(first, move)
    feed = path.feed if path.feed.any() else path.judged
    through = Path.through(points, move, feed[move])
    line = path.program.in_original().toolpath.line.astype(np.int64)
    numbers, operation = groups_of(path.program.toolpath)
    none = np.zeros(0, np.int64)
    return Ground(replace(through, line=line[through.line]), through.line, none, line, numbers, operation)


def measured_points(
    name: PathLike, run: JointRun, path: JointPath, profile: PointProfile | None = None, *,
    oriented: bool = False,
) -> Points:  # fmt: skip
    """The points of a file in workpiece coordinates; poses where they are `oriented`. Raises InputError."""
    return _in_workpiece(read_points(name, profile, run.sources.read_last, oriented=oriented), run, path)


def _in_workpiece(points: Points, run: JointRun, path: JointPath) -> Points:
    """Measured points in workpiece coordinates. Raises InputError for a frame that is not known."""
    if points.frame in (None, _WORKPIECE):
        return points
    offset = None if run.setup is None else run.setup.work_offset(points.frame)
    if offset is None or any(offset.rotation_deg) or any(run.turned.get(points.frame, {}).values()):
        raise InputError(
            f"states the frame {points.frame}, no work offset of this machine without rotary values; "
            f"expected {_WORKPIECE} or such an offset",
            file=points.file,
        )
    words = Coordinates.of_words(path.motion.structure)
    values = np.zeros((len(points), len(words.names)))
    values[:, words.linear] = points.points_mm + np.array(offset.offset_mm)
    return replace(points, points_mm=stated_tips(path.motion.machines[0], values), frame=_WORKPIECE)
