"""The library's front door: what the command line does, as functions on files or bytes."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from olp.checks import correction as checks
from olp.compensation.plan import zero_shifts
from olp.compensation.stamp import find_stamp
from olp.core.arrays import Array
from olp.core.errors import ConfigError, OlpError, naming
from olp.core.machine import Setup
from olp.core.progress import Progress, silent
from olp.core.toolpath import Kind, carried
from olp.files.config import load_setup as load_setup
from olp.findings.catalogue import Finding
from olp.program.registry import Options, read
from olp.uncertainty.spread import Confidence
from olp.workflows.correct import correct_bytes, verify_programs
from olp.workflows.session import PathLike, lever_of, load, reading, setup_of, source_of, unrolled


@dataclass(frozen=True, slots=True, eq=False)
class Correction:
    """A corrected program: its bytes, the report as a mapping ("olp-report-1"), and the findings;
    `confidence` has bands and probabilities by way-point where the calibration states uncertainties."""

    data: bytes
    report: dict[str, Any]
    findings: tuple[Finding, ...]
    confidence: Confidence | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Verification:
    """The proof of a corrected program from two texts alone; `confidence` as in Correction."""

    report: dict[str, Any]
    findings: tuple[Finding, ...]
    confidence: Confidence | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Simulation:
    """(n, 3) tip positions of the real machine in the program's first work frame, and the line of each."""

    points_mm: Array
    line: Array
    frame: str

    def to_csv(self) -> bytes:
        """`X_mm,Y_mm,Z_mm,line` with the frame named in a comment."""
        rows = [f"# frame={self.frame}", "X_mm,Y_mm,Z_mm,line"]
        rows += [
            f"{x:.6f},{y:.6f},{z:.6f},{int(n)}"
            for (x, y, z), n in zip(self.points_mm.tolist(), self.line.tolist(), strict=True)
        ]
        return ("\n".join(rows) + "\n").encode()


def correct(
    program: PathLike | bytes,
    machine: PathLike | Setup,
    job: PathLike | None = None,
    *,
    tolerance_um: float = 1.0,
    outside_box: Literal["refuse", "hold"] = "refuse",
    flatten: bool = False,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
    contour: bool = False,
    split_rapids: bool = False,
    within_um: float | None = None,
    only_sure_components: bool = False,
    date: datetime.date | None = None,
    progress: Progress | None = None,
) -> Correction:
    """Correct a program for a machine, and prove it.

    `program` is a path or the bytes of the text, `machine` the machine file or a Setup. The corrected text is
    in the program's own dialect; only coordinate words differ, and inserted words and blocks. With `flatten`
    loops, subprograms and expressions are unrolled first, with `expand_cycles` canned cycles are written out;
    on controls that keep it in a parameter, `peck_clearance_mm` is the clearance above the last peck.

    Where the calibration states uncertainties, the report says how probable it is that the tip stays within
    `within_um` (default: `tolerance_um`). With `only_sure_components` components within their own
    uncertainty are not corrected. Raises InputError (ProgramError with its line, ConfigError, OutsideBox) and
    CannotCompute.
    """
    data, name = source_of(program)
    with naming(name):
        run = correct_bytes(
            data, name, load(machine, job, outside_box, only_sure=only_sure_components),
            tolerance_um=tolerance_um, within_um=within_um,
            hold=outside_box == "hold", unroll=flatten, expand=expand_cycles, clearance=peck_clearance_mm,
            contour=contour, rapids=split_rapids, date=date, tell=progress or silent,
        )  # fmt: skip
    return Correction(run.text, run.report, run.findings, run.confidence)


def verify(
    nominal: PathLike | bytes,
    corrected: PathLike | bytes,
    machine: PathLike | Setup,
    job: PathLike | None = None,
    *,
    tolerance_um: float = 1.0,
    outside_box: Literal["refuse", "hold"] = "hold",
    contour: bool = False,
    within_um: float | None = None,
    only_sure_components: bool = False,
    date: datetime.date | None = None,
    progress: Progress | None = None,
) -> Verification:
    """Hold a corrected program against the nominal one, from the two texts and the machine's files alone.

    Raises ProgramError where the second is no correction of the first.
    """
    loaded = load(machine, job, outside_box, only_sure=only_sure_components)
    tell = progress or silent
    options = Options(contour=contour)
    texts = [source_of(p) for p in (nominal, corrected)]
    with naming(texts[0][1]):
        loaded = loaded.reading(*texts[0])
    programs = []
    for data, name in texts:
        tell("read", 0.0)
        try:
            programs.append((read(data, loaded.setup, loaded.dialect, options), name))
        except OlpError as error:
            raise error.in_file(name or "<program>") from None
    run = verify_programs(
        programs[0], programs[1], loaded, tolerance_um=tolerance_um, contour=contour, date=date,
        within_um=within_um,
    )  # fmt: skip
    return Verification(run.report, run.findings, run.confidence)


def simulate(
    program: PathLike | bytes,
    machine: PathLike | Setup,
    job: PathLike | None = None,
    *,
    step_mm: float = 1.0,
    outside_box: Literal["refuse", "hold"] = "hold",
    contour: bool = False,
) -> Simulation:
    """The path of the tip that the uncompensated machine would really take, in the program's first work
    frame."""
    from olp.proof.deviation import Tracer

    data, name = source_of(program)
    try:
        loaded = load(machine, job, outside_box).reading(data, name)
        path = read(data, loaded.setup, loaded.dialect, Options(contour=contour), words=False).toolpath
        shift = zero_shifts(path.frames, loaded.model)
    except OlpError as error:
        raise error.in_file(name or "<program>") from None
    if not len(path):
        return Simulation(np.zeros((0, 3)), np.zeros(0), "")
    actual, move = Tracer.trace(path, loaded.model, step_mm)
    home = path.frames[int(path.frame[0])]
    lengths = path.per_frame([f.length_mm for f in path.frames])
    tip = actual - shift[int(path.frame[0])] - (lengths if lengths.ndim == 1 else lengths[move])
    actual = home.tip_mm(tip)
    known = np.isfinite(actual).all(axis=1)
    return Simulation(actual[known], path.line[move[known]].astype(np.float64), home.work_offset)


def inspect(
    program: PathLike | bytes, machine: PathLike | Setup, job: PathLike | None = None
) -> dict[str, Any]:
    """What a program does: moves by kind, ranges, tools, offsets, path modes, findings and the support
    matrix."""
    data, name = source_of(program)
    try:
        setup, dialect = reading(setup_of(machine, job), data, name)
        found = read(data, setup, dialect)
    except OlpError as error:
        raise error.in_file(name or "<program>") from None
    path = found.toolpath
    with np.errstate(all="ignore"):
        known = path.end_mm[np.isfinite(path.end_mm).all(axis=1)]
    ranges = {
        axis: [float(known[:, i].min()), float(known[:, i].max())] if len(known) else None
        for i, axis in enumerate("XYZ")
    }
    findings = checks.program_findings(found, setup, contour=False)
    return {
        "name": Path(name).name if name else "",
        "dialect": dialect.name,
        "dialect_title": dialect.title,
        "lines": found.lines,
        "moves": {kind.name.lower(): int((path.kind == kind).sum()) for kind in Kind},
        "cycles": len(found.holes),
        "axis_range_mm": ranges,
        "tools": sorted({f.tool for f in path.frames if f.tool is not None}),
        "work_offsets": sorted({f.work_offset for f in path.frames}),
        "payloads_kg": list(dict.fromkeys(f.payload_kg for f in path.frames)),
        "path_modes": [
            {"line": m.line, "name": m.name, "tolerance_mm": m.tolerance_mm} for m in found.path_modes
        ],
        "stamped": find_stamp(data) is not None,
        "findings": [f.as_dict() for f in findings],
        "support": dialect.support(),
    }


def error_at(
    machine: PathLike | Setup,
    position_mm: tuple[float, float, float],
    tool: int | tuple[float, float, float] | None = None,
    job: PathLike | None = None,
) -> dict[str, Any]:
    """The error at one axis position: actual minus commanded at the tip, and what it is made of.

    `tool` is a tool number or a tool vector in mm (gauge point to tip); the default is the tool in the
    spindle at the start.
    """
    loaded = load(machine, job, "refuse")
    at = np.array([position_mm], float)
    inside = loaded.model.inside(at)
    if not inside.all():
        axis = "XYZ"[int(np.flatnonzero(~inside[0])[0])]
        raise ConfigError(
            f"{axis} = {at[0]['XYZ'.index(axis)]:g} mm is outside the calibrated box; choose a place in it"
        )
    vector = lever_of(loaded.setup, tool)
    payload = loaded.setup.job.payload_kg
    lever = np.array(carried(vector, payload))
    return {
        "position_mm": [float(v) for v in position_mm],
        "tool_mm": [float(v) for v in vector],
        "payload_kg": payload,
        "error_um": (loaded.model.error(at, lever)[0] * 1e3).tolist(),
        "rotation_urad": (loaded.model.rotation(at, None, payload)[0] * 1e6).tolist(),
        "sources": [
            {"name": source, "error_um": (part[0] * 1e3).tolist()}
            for source, part in loaded.model.contributions(at, lever)
        ],
    }


def flatten(
    program: PathLike | bytes,
    machine: PathLike | Setup,
    job: PathLike | None = None,
    *,
    expand_cycles: bool = False,
) -> bytes:
    """Unroll loops, subprograms, expressions and, if asked, canned cycles into plain blocks. Not lossless."""
    data, name = source_of(program)
    try:
        setup = setup_of(machine, job)
        return unrolled(data, name, setup, reading(setup, data, name)[1], expand_cycles)
    except OlpError as error:
        raise error.in_file(name or "<program>") from None


__all__ = [
    "Correction", "Simulation", "Verification", "correct", "error_at", "flatten", "inspect", "simulate",
    "verify",
]  # fmt: skip
