"""From the files of a job to its review."""

from __future__ import annotations

import datetime
import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from olp.compensation.plan import targets, zero_shifts
from olp.core.arrays import Array, Index
from olp.core.errors import naming
from olp.core.machine import Setup
from olp.core.progress import Progress, silent
from olp.core.units import MM_PER_UM
from olp.files.points import read_points
from olp.files.write import read_bytes, write_bytes
from olp.program.program import Program
from olp.program.registry import Options, read
from olp.proof.matching import match as match_moves
from olp.review.listing import aligned
from olp.review.manifest import manifest_of
from olp.review.measured import Matched, Matcher
from olp.review.meshes import Body, of_job, of_machine
from olp.review.motion import by_feed, retimed, table
from olp.review.page import page
from olp.review.samples import Samples, by_source, sample
from olp.review.scene import Frame, Scene, Sureness
from olp.uncertainty.probability import within
from olp.uncertainty.spread import Points, bands, covariances
from olp.workflows import api
from olp.workflows.correct import last_digit_mm, verify_programs
from olp.workflows.retime import retime
from olp.workflows.session import Loaded, PathLike, load, source_of, unrolled
from olp.workflows.uncertainty import unknowns_of

#: shorter stays at a sample are none
_REST_S = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Review:
    """A job ready to be looked at. `scene` is what the page shows, as plain arrays."""

    scene: Scene
    _packed: list[tuple[dict[str, Any], bytes]] = field(default_factory=list, init=False, repr=False)

    def parts(self, live: str | None = None) -> Iterator[bytes]:
        """The page in parts; `live` is the address, relative to the page, that answers with the digest of the
        inputs of the day."""
        if not self._packed:
            manifest, arrays = manifest_of(self.scene)
            self._packed.append((manifest, arrays.encoded()))
        manifest, data = self._packed[0]
        return page(manifest | {"live": live}, data, live=live is not None)

    def html(self) -> bytes:
        """The page: one file, which needs nothing else and asks no network."""
        return b"".join(self.parts())

    def write(self, path: PathLike, *, force: bool = False) -> None:
        """Write the page, whole or not at all. Raises as `olp.files.write.write_files`."""
        write_bytes(path, self.parts(), force=force)


def view(
    program: PathLike | bytes,
    machine: PathLike | Setup,
    job: PathLike | None = None,
    *,
    corrected: PathLike | bytes | None = None,
    measured: Sequence[PathLike] = (),
    correction: api.Correction | None = None,
    corrected_name: str = "",
    tolerance_um: float = 1.0,
    outside_box: Literal["refuse", "hold"] = "refuse",
    contour: bool = False,
    flatten: bool = False,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
    within_um: float | None = None,
    only_sure_components: bool = False,
    date: datetime.date | None = None,
    time: bool = True,
    step_mm: float | None = None,
    progress: Progress | None = None,
) -> Review:
    """A program, its correction and measurements of it, to be looked at in a browser.

    `corrected` is the corrected program, which is proved as `verify` does; without it the program is
    corrected as `correct` does, or `correction` is what that gave, to be called `corrected_name`. `measured`
    are files of positions of the tip, read and placed on the path as `olp.compare` does; what that finds
    stands beside the other findings. Without `time` the motion is not planned: times are those of the
    programmed feed. `step_mm` is the distance between samples. `within_um`,
    `only_sure_components` and `date` are those of `correct`. Raises InputError (ProgramError with its line,
    ConfigError) and CannotCompute.
    """
    tell = progress or silent
    data, name = source_of(program)
    outside = "hold" if corrected is not None else outside_box
    with naming(name):
        loaded = load(machine, job, outside, only_sure=only_sure_components).reading(data, name)
    setup, options = loaded.setup, Options(contour=contour)
    if flatten or expand_cycles:
        with naming(name):
            data = unrolled(data, name, setup, loaded.dialect, expand_cycles, peck_clearance_mm)
    if corrected is not None:
        other, corrected_name = source_of(corrected)
    else:
        if correction is None:
            with naming(name):
                correction = api.correct(
                    data, setup, tolerance_um=tolerance_um, outside_box=outside_box, contour=contour,
                    progress=progress, within_um=within_um, only_sure_components=only_sure_components,
                    date=date,
                )  # fmt: skip
        other = correction.data
    tell("read", 0.0)
    with naming(name):
        nominal = read(data, setup, loaded.dialect, options)
    with naming(corrected_name or (f"{name} (corrected)" if name else "")):
        second = read(other, setup, loaded.dialect, options)
        if correction is not None:
            report = correction.report
        else:
            report = verify_programs(
                (nominal, name), (second, corrected_name), loaded, tolerance_um=tolerance_um,
                contour=contour, date=date, within_um=within_um,
            ).report  # fmt: skip
        groups = _groups(nominal, second, loaded, tolerance_um)
        tell("sample", 0.0)
        samples = sample(nominal, second, groups, loaded.model, step_mm)
        plan = retime(other, setup, contour=contour, progress=progress) if time else None
    tell("pack", 0.0)
    if plan is None:
        moment = by_feed(nominal, samples, setup.machine)
    else:
        samples, moment = _resting(samples, *retimed(second.toolpath, samples, plan.trajectories))
    frame = Frame.of(nominal.toolpath)
    position = frame.positions(nominal.toolpath, samples.move, samples.axis_mm)
    seen: tuple[Matched, ...] = ()
    if measured:
        matcher = Matcher(nominal.toolpath, samples, loaded.model, setup, np.array(frame.origin_mm))
        seen = tuple(matcher.match(read_points(path)) for path in measured)
        more = [finding.as_dict() for found in seen for finding in found.findings]
        report = report | {"findings": [*report["findings"], *more]}
    scene = Scene(
        name=Path(name).name or "program",
        corrected_name=Path(corrected_name).name,
        digest=_digest(data, other, loaded, (*measured, *(mesh.file for mesh in setup.job.meshes))),
        machine=setup.machine,
        nominal=nominal,
        frame=frame,
        samples=samples,
        position_mm=position,
        time_s=moment,
        motion=None if plan is None else table(plan.trajectories, plan.routes),
        duration_s=float(moment[-1]) if plan is None else plan.duration_s,
        sources=tuple(by_source(nominal.toolpath, samples, loaded.model)),
        listing=aligned(nominal, second, groups),
        bodies=tuple(_bodies(setup, nominal, samples, frame, position)),
        measured=seen,
        report=report,
        tolerance_um=tolerance_um,
        tool_radius_mm=_radius(setup, nominal),
        sureness=_sureness(loaded, nominal, samples, within_um or tolerance_um, date),
    )
    return Review(scene)


def _sureness(
    loaded: Loaded, nominal: Program, samples: Samples, within_um: float, date: datetime.date | None
) -> Sureness | None:
    """Of samples, as `olp.workflows.uncertainty` of way-points."""
    if loaded.uncertainty is None:
        return None
    unknowns, _, _ = unknowns_of(loaded, loaded.uncertainty, date)
    points = Points(samples.move, samples.axis_mm, samples.uncorrected, samples.result, samples.play)
    covariance = covariances(unknowns, nominal.toolpath, points)
    radius = within_um * MM_PER_UM
    beyond = {
        name: np.asarray(1.0 - within(covariance, deviation, radius), np.float32)
        for name, deviation in (("uncorrected", points.before_mm), ("result", points.after_mm))
    }
    return Sureness(radius, bands(covariance).astype(np.float32), beyond)


def _resting(samples: Samples, arrival: Array, leaving: Array) -> tuple[Samples, Array]:
    """Samples at which the motion rests are there twice, when it comes and when it leaves; and the times."""
    rests = np.flatnonzero(leaving - arrival > _REST_S)
    order = np.sort(np.concatenate((np.arange(len(samples)), rests)), kind="stable")
    again = np.diff(order, prepend=-1) == 0
    twice = samples.take(order)
    twice.joined[again] = True
    return twice, np.where(again, leaving[order], arrival[order])


def _digest(data: bytes, other: bytes, loaded: Loaded, files: Sequence[PathLike]) -> str:
    """12 digits that change with whatever the page is made of."""
    found = hashlib.sha256(b"\0".join((data, other, loaded.digest.encode(), repr(loaded.setup).encode())))
    for path in files:
        found.update(hashlib.sha256(read_bytes(path)).digest())
    return found.hexdigest()[:12]


def _groups(nominal: Program, second: Program, loaded: Loaded, tolerance_um: float) -> Index:
    path = nominal.toolpath
    target = targets(path, zero_shifts(path.frames, loaded.model))
    near = tolerance_um * MM_PER_UM + last_digit_mm(second, loaded.setup)
    return match_moves(nominal, target, second, loaded.model, near)


def _bodies(
    setup: Setup, nominal: Program, samples: Samples, frame: Frame, position: Array
) -> Iterator[Body]:
    yield from of_job(setup, np.array(frame.origin_mm))
    first = nominal.toolpath.frames[int(nominal.toolpath.frame[samples.move[0]])]
    tip = position[0]
    gauge = tip - np.array(first.tool_mm)
    same = len({f.tool_mm for f in nominal.toolpath.frames}) == 1
    radius = _radius(setup, nominal) if same else 0.0
    yield from of_machine(setup.machine, samples.axis_mm[0], gauge, tip, radius)


def _radius(setup: Setup, nominal: Program) -> float:
    numbers = [f.tool for f in nominal.toolpath.frames if f.tool is not None]
    tools = [setup.tool(number) for number in numbers]
    return max((tool.radius_mm for tool in tools if tool is not None), default=0.0)
