"""A job as a page for reviewers: nominal, corrected and measured paths, with their errors, in one file."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from olp import api
from olp.correction import Progress
from olp.exceptions import ConfigError, OlpError
from olp.files.measured import read_measured
from olp.files.write import write_bytes
from olp.loading import Loaded, PathLike, load, source_of, unrolled
from olp.machine import Setup
from olp.program.program import Program
from olp.program.reader import Options, read
from olp.proof.matching import match as match_moves
from olp.compensation.plan import targets, zero_shifts
from olp.correction import last_digit_mm
from olp.retiming import retime
from olp.review.listing import aligned
from olp.review.manifest import manifest_of
from olp.review.measured import Matched, match
from olp.review.meshes import Body, of_job, of_machine
from olp.review.motion import MotionTable, by_feed, retimed, table
from olp.review.page import page
from olp.review.samples import Index, Samples, by_source, sample
from olp.review.scene import Frame, Scene
from olp.units import MM_PER_UM


@dataclass(frozen=True, slots=True, eq=False)
class Review:
    """A job ready to be looked at. `scene` is what the page shows, as plain arrays."""

    scene: Scene
    _packed: list[tuple[dict[str, Any], bytes]] = field(default_factory=list, init=False, repr=False)

    def parts(self, live: str | None = None) -> Iterator[bytes]:
        """The page in parts; `live` is the address, relative to the page, that answers with the digest of the inputs
        of the day."""
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
    tolerance_um: float = 1.0,
    outside_box: Literal["refuse", "hold"] = "refuse",
    contour: bool = False,
    flatten: bool = False,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
    time: bool = True,
    step_mm: float | None = None,
    progress: Progress | None = None,
) -> Review:
    """A program, its correction and measurements of it, to be looked at in a browser.

    `corrected` is the corrected program, which is proved as `verify` does; without it the program is corrected as
    `correct` does, or `correction` says what that gave. `measured` are CSV files of positions of the tip. Without
    `time` the motion is not planned: times are those of the programmed feed. `step_mm` is the distance between
    samples. Raises InputError (ProgramError with its line, ConfigError) and CannotCompute.
    """
    tell = progress or _silent
    data, name = source_of(program)
    held: Literal["refuse", "hold"] = "hold" if corrected is not None else outside_box
    loaded = load(machine, job, held)
    if flatten or expand_cycles:
        try:
            data = unrolled(data, name, loaded.profile, expand_cycles, peck_clearance_mm)
        except OlpError as error:
            raise error.in_file(name or "<program>") from None
    other, other_name, report = _judged(
        data, name, loaded, corrected, correction, tolerance_um, outside_box, contour, progress
    )
    try:
        nominal = read(data, loaded.setup, loaded.profile, Options(contour=contour))
    except OlpError as error:
        raise error.in_file(name or "<program>") from None
    try:
        second = read(other, loaded.setup, loaded.profile, Options(contour=contour))
        groups = _groups(nominal, second, loaded, tolerance_um)
    except OlpError as error:
        raise error.in_file(other_name or "<corrected>") from None
    tell("sample", 0.0)
    samples = sample(nominal, second, groups, loaded.model, step_mm)
    motion, moment, duration_s = _timed(other, other_name, nominal, second, samples, loaded, contour, time, progress)
    tell("pack", 0.0)
    frame = Frame.of(nominal.toolpath)
    position = frame.positions(nominal.toolpath, samples.move, samples.axis_mm)
    matched = tuple(_matched(path, frame, position, samples, loaded.setup) for path in measured)
    digest = hashlib.sha256(b"\0".join((data, other, loaded.digest.encode(), repr(loaded.setup).encode())))
    for path in measured:
        digest.update(source_of(path)[0])
    scene = Scene(
        name=Path(name).name if name else "program",
        corrected_name=Path(other_name).name if other_name else "",
        digest=digest.hexdigest()[:12],
        machine=loaded.setup.machine,
        nominal=nominal,
        frame=frame,
        samples=samples,
        position_mm=position,
        time_s=moment,
        motion=motion,
        duration_s=duration_s,
        sources=tuple(by_source(nominal.toolpath, samples, loaded.model)),
        listing=aligned(nominal, second, groups),
        bodies=tuple(_bodies(loaded.setup, nominal, samples, frame, position)),
        measured=matched,
        report=report,
        tolerance_um=tolerance_um,
        tool_radius_mm=_radius(loaded.setup, nominal),
    )
    return Review(scene)


def _judged(
    data: bytes, name: str, loaded: Loaded, corrected: PathLike | bytes | None, correction: api.Correction | None,
    tolerance_um: float, outside_box: Literal["refuse", "hold"], contour: bool, progress: Progress | None,
) -> tuple[bytes, str, dict[str, Any]]:  # fmt: skip
    """The corrected program, its name, and the report that stands for it."""
    if corrected is not None:
        other, other_name = source_of(corrected)
        proof = api.verify(
            data, other, loaded.setup, tolerance_um=tolerance_um, contour=contour, progress=progress
        )
        return other, other_name, proof.report
    if correction is None:
        try:
            correction = api.correct(
                data, loaded.setup, tolerance_um=tolerance_um, outside_box=outside_box, contour=contour,
                progress=progress,
            )  # fmt: skip
        except OlpError as error:
            raise (error.in_file(name or "<program>") if error.line is not None else error) from None
    return correction.data, "", correction.report


def _groups(nominal: Program, second: Program, loaded: Loaded, tolerance_um: float) -> Index:
    path = nominal.toolpath
    target = targets(path, zero_shifts(path.frames, loaded.model))
    near = tolerance_um * MM_PER_UM + last_digit_mm(second, loaded.setup)
    return match_moves(nominal, target, second, loaded.model, near)


def _timed(
    other: bytes, other_name: str, nominal: Program, second: Program, samples: Samples, loaded: Loaded,
    contour: bool, time: bool, progress: Progress | None,
) -> tuple[MotionTable | None, np.ndarray, float]:  # fmt: skip
    if not time:
        moment = by_feed(nominal, samples, loaded.setup.machine)
        return None, moment, float(moment[-1])
    try:
        found = retime(other, loaded.setup, contour=contour, progress=progress)
    except OlpError as error:
        raise (error.in_file(other_name or "<corrected>") if error.line is not None else error) from None
    moment = retimed(second.toolpath, samples, found.trajectories)
    return table(found.trajectories, found.routes), moment, found.duration_s


def _matched(
    path: PathLike, frame: Frame, position: np.ndarray, samples: Samples, setup: Setup
) -> Matched:
    measured = read_measured(path)
    origin = np.zeros(3)
    if measured.frame == frame.offset:
        origin = np.array(frame.origin_mm)
    elif measured.frame != "machine":
        offset = setup.work_offset(measured.frame)
        if offset is None or any(offset.rotation_deg):
            raise ConfigError(
                f"frame {measured.frame!r} is no work offset without rotation of machine or job; expected "
                f"{frame.offset!r} or \"machine\"",
                file=measured.file,
            )  # fmt: skip
        origin = np.array(offset.offset_mm)
    return match(measured, position, samples.joined, origin - np.array(frame.origin_mm))


def _bodies(
    setup: Setup, nominal: Program, samples: Samples, frame: Frame, position: np.ndarray
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


def _silent(what: str, share: float) -> None:
    return None


__all__ = ["Review", "view"]
