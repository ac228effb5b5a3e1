"""The library's front door: what the command line does, as functions on files or bytes."""

from __future__ import annotations

import datetime
import hashlib
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from olp import __version__, checks
from olp.compensation.plan import Limits, Plan, plan, zero_shifts
from olp.compensation.style import fewest_decimals
from olp.compensation.writer import Writer
from olp.errormodel import Calibration, ErrorModel, build
from olp.errormodel.base import Array
from olp.exceptions import AlreadyCorrected, ConfigError, OlpError, ProgramError
from olp.files.calibration import load_calibration
from olp.files.config import load_setup
from olp.files.write import read_bytes
from olp.findings import Finding
from olp.machine import Setup
from olp.program.profiles import PROFILES, Profile
from olp.program.program import Program
from olp.program.reader import Options, read
from olp.proof import Proof, prove
from olp.toolpath import Flag, Kind, Toolpath
from olp.units import MM_PER_UM

PathLike = str | Path
Progress = Callable[[str, float], None]

_STAMP = re.compile(rb"olp-corrected [0-9a-f]{12}")
_PROVES = (
    "the written text, read back from its bytes, commands what was computed (syntax, digits, modal words)",
    "the error model at those commands brings the tip to the nominal path, at and between the way-points",
)
_DOES_NOT_PROVE = (
    "that the calibration still describes the machine: measure a circle or a diagonal to see that",
    "what the control does between blocks (blending, following error) and what the process does to the part",
)


@dataclass(frozen=True, slots=True, eq=False)
class Correction:
    """A corrected program: its bytes, the report as a mapping ("olp-report-1"), and the findings."""

    data: bytes
    report: dict[str, Any]
    findings: tuple[Finding, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Verification:
    """The proof of a corrected program from two texts alone."""

    report: dict[str, Any]
    findings: tuple[Finding, ...]


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


@dataclass(frozen=True, slots=True, eq=False)
class _Job:
    """Everything loaded that a run needs."""

    setup: Setup
    profile: Profile
    calibration: Calibration
    model: ErrorModel
    digest: str


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
    date: datetime.date | None = None,
    progress: Progress | None = None,
) -> Correction:
    """Correct a program for a machine, and prove it.

    `program` is a path or the bytes of the text, `machine` the machine file or a Setup. The corrected text is
    in the program's own dialect; only coordinate words differ, and inserted words and blocks. With `flatten`
    loops, subprograms and expressions are unrolled first, with `expand_cycles` canned cycles are written out;
    on controls that keep it in a parameter, `peck_clearance_mm` is the clearance above the last peck. Raises
    InputError (ProgramError with its line, ConfigError, OutsideBox) and CannotCompute.
    """
    data, name = _source(program)
    try:
        return _correct(
            data, name, _load(machine, job, outside_box), tolerance_um=tolerance_um,
            hold=outside_box == "hold", unroll=flatten, expand=expand_cycles, clearance=peck_clearance_mm,
            contour=contour, rapids=split_rapids, date=date, tell=progress or _silent,
        )  # fmt: skip
    except OlpError as error:
        raise (error.in_file(name) if name and error.line is not None else error) from None


def verify(
    nominal: PathLike | bytes,
    corrected: PathLike | bytes,
    machine: PathLike | Setup,
    job: PathLike | None = None,
    *,
    tolerance_um: float = 1.0,
    outside_box: Literal["refuse", "hold"] = "hold",
    contour: bool = False,
    date: datetime.date | None = None,
    progress: Progress | None = None,
) -> Verification:
    """Hold a corrected program against the nominal one, from the two texts and the machine's files alone.

    Raises ProgramError where the second is no correction of the first.
    """
    loaded = _load(machine, job, outside_box)
    tell = progress or _silent
    options = Options(contour=contour)
    texts = [_source(p) for p in (nominal, corrected)]
    programs = []
    for data, name in texts:
        tell("read", 0.0)
        try:
            programs.append(read(data, loaded.setup, loaded.profile, options))
        except OlpError as error:
            raise error.in_file(name or "<program>") from None
    first, second = programs
    limits = Limits(tolerance_um * MM_PER_UM, refuse_outside=False)
    rows = plan(first.toolpath, loaded.model, limits)
    digit = _digit_mm(second, loaded.setup)
    try:
        proof = prove(
            first, second, loaded.model, tolerance_mm=limits.tolerance_mm, digit_mm=digit,
            passed=rows.passed,
        )  # fmt: skip
    except OlpError as error:
        raise error.in_file(texts[1][1] or "<corrected>") from None
    findings = (
        *checks.calibration_findings(loaded.calibration, date),
        *checks.proof_findings(proof, rows.passed),
        *checks.program_findings(first, loaded.setup, contour=contour),
    )
    report = _report(first, texts[0], loaded, proof, findings, tolerance_um)
    return Verification(report, findings)


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
    from olp.deviation import Tracer

    data, name = _source(program)
    loaded = _load(machine, job, outside_box)
    try:
        path = read(data, loaded.setup, loaded.profile, Options(contour=contour), words=False).toolpath
        shift = zero_shifts(path.frames, loaded.model)
    except OlpError as error:
        raise error.in_file(name or "<program>") from None
    if not len(path):
        return Simulation(np.zeros((0, 3)), np.zeros(0), "")
    actual, move = Tracer.trace(path, loaded.model, step_mm)
    home = path.frames[int(path.frame[0])]
    origin = np.array(home.offset_mm) - np.array(home.length_mm)
    lengths = path.per_frame([f.length_mm for f in path.frames])
    actual = actual - origin - shift[int(path.frame[0])] - (lengths if lengths.ndim == 1 else lengths[move])
    known = np.isfinite(actual).all(axis=1)
    return Simulation(actual[known], path.line[move[known]], home.work_offset)


def inspect(
    program: PathLike | bytes, machine: PathLike | Setup, job: PathLike | None = None
) -> dict[str, Any]:
    """What a program does: moves by kind, ranges, tools, offsets, path modes, findings and the support
    matrix."""
    data, name = _source(program)
    setup = _setup(machine, job)
    profile = _profile(setup)
    try:
        found = read(data, setup, profile)
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
        "dialect": profile.name,
        "dialect_title": profile.title,
        "lines": found.lines,
        "moves": {kind.name.lower(): int((path.kind == kind).sum()) for kind in Kind},
        "cycles": len(found.holes),
        "axis_range_mm": ranges,
        "tools": sorted({f.tool for f in path.frames if f.tool is not None}),
        "work_offsets": sorted({f.work_offset for f in path.frames}),
        "path_modes": [
            {"line": m.line, "name": m.name, "tolerance_mm": m.tolerance_mm} for m in found.path_modes
        ],
        "stamped": bool(_STAMP.search(data)),
        "findings": [f.as_dict() for f in findings],
        "support": profile.support(),
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
    loaded = _load(machine, job, "refuse")
    at = np.array([position_mm], float)
    inside = loaded.model.inside(at)
    if not inside.all():
        axis = "XYZ"[int(np.flatnonzero(~inside[0])[0])]
        raise ConfigError(
            f"{axis} = {at[0]['XYZ'.index(axis)]:g} mm is outside the calibrated box; choose a place in it"
        )
    lever = np.array(_lever(loaded.setup, tool))
    return {
        "position_mm": [float(v) for v in position_mm],
        "tool_mm": lever.tolist(),
        "error_um": (loaded.model.error(at, lever)[0] * 1e3).tolist(),
        "rotation_urad": (loaded.model.rotation(at)[0] * 1e6).tolist(),
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
    data, name = _source(program)
    try:
        return _unrolled(data, name, _profile(_setup(machine, job)), expand_cycles)
    except OlpError as error:
        raise error.in_file(name or "<program>") from None


# -- the work -----------------------------------------------------------------------------------------


def _correct(
    data: bytes,
    name: str,
    loaded: _Job,
    *,
    tolerance_um: float,
    hold: bool,
    unroll: bool,
    expand: bool,
    clearance: float | None,
    contour: bool,
    rapids: bool,
    date: datetime.date | None,
    tell: Progress,
) -> Correction:
    stamp = _STAMP.search(data)
    if stamp:
        raise AlreadyCorrected(
            f"the program carries the stamp `{stamp.group().decode()}`; correcting it again would apply the "
            "model twice; correct the nominal program",
            line=data.count(b"\n", 0, stamp.start()) + 1,
        )
    if unroll or expand:
        data = _unrolled(data, name, loaded.profile, expand, clearance)
    tell("read", 0.0)
    program = read(data, loaded.setup, loaded.profile, Options(contour=contour))
    tell("correct", 0.2)
    digit = _digit_mm(program, loaded.setup)
    limits = Limits(tolerance_um * MM_PER_UM, digit_mm=digit, split_rapids=rapids, refuse_outside=not hold)
    rows = plan(program.toolpath, loaded.model, limits)
    tell("write", 0.5)
    writer = Writer(
        program, rows, loaded.model, tolerance_mm=limits.tolerance_mm,
        increments_mm=loaded.setup.machine.least_increment_mm, stamp=_stamp(loaded),
    )  # fmt: skip
    text = writer.text()
    parts, tally, holes = writer.parts, writer.tally, writer.holes
    del writer
    tell("prove", 0.7)
    path = program.toolpath
    nominal = replace(program, words=None, slot=program.slot[:0])
    del program
    passed = rows.passed
    commands = _ends(rows, len(path))
    corrections = _largest_correction(path, commands)
    state = checks.state_findings(path, commands, loaded.model, loaded.setup, held=hold)
    del rows, commands
    corrected = read(text, loaded.setup, loaded.profile, Options(contour=contour), words=False)
    proof = prove(
        nominal,
        corrected,
        loaded.model,
        tolerance_mm=limits.tolerance_mm,
        digit_mm=digit,
        passed=passed,
        parts=parts,
    )
    _prove_without_deleted(nominal, text, loaded, contour, limits, digit)
    findings = (
        *checks.calibration_findings(loaded.calibration, date),
        *checks.proof_findings(proof, passed),
        *checks.hole_findings(holes, limits.tolerance_mm),
        *state,
        *checks.path_mode_findings(nominal, corrections),
        *checks.program_findings(nominal, loaded.setup, contour=contour),
    )
    report = _report(nominal, (data, name), loaded, proof, findings, tolerance_um)
    report["moves"] = checks.tally_moves(path, len(passed), parts) | {
        "inserted_blocks": tally.inserted_blocks,
        "inserted_words": tally.inserted_words,
        "changed_words": tally.changed_words,
    }
    report["corrected"] = {"sha256": hashlib.sha256(text).hexdigest(), "lines": text.count(b"\n")}
    report["largest_correction_um"] = corrections * 1e3
    return Correction(text, report, findings)


def _prove_without_deleted(
    program: Program, text: bytes, loaded: _Job, contour: bool, limits: Limits, digit_mm: float
) -> None:
    """With the block-delete switch on, the corrected program has to come out right too."""
    path = program.toolpath
    deleted = (path.flag & np.uint8(Flag.DELETED)) != 0
    if not deleted.any():
        return
    options = Options(block_delete=True, contour=contour)
    line = int(path.line[deleted][0])
    nominal = read(program.data, loaded.setup, loaded.profile, options, words=False)
    corrected = read(text, loaded.setup, loaded.profile, options, words=False)
    try:
        rows = plan(nominal.toolpath, loaded.model, replace(limits, refuse_outside=False))
        proof = prove(
            nominal,
            corrected,
            loaded.model,
            tolerance_mm=limits.tolerance_mm,
            digit_mm=digit_mm,
            passed=rows.passed,
        )
        good = proof.holds
    except ProgramError:
        good = False
    if not good:
        raise ProgramError(
            "later blocks depend on this block under block delete, so one correction cannot be right for "
            "both switch positions; remove the `/`, or give every axis in the first block after it",
            line=line,
        )


def _report(
    program: Program,
    source: tuple[bytes, str],
    loaded: _Job,
    proof: Proof,
    findings: tuple[Finding, ...],
    tolerance_um: float,
) -> dict[str, Any]:
    data, name = source
    machine, calibration = loaded.setup.machine, loaded.calibration
    size = proof.size_mm()
    bend = float(
        np.where(proof.after.judged & proof.cutting & ~proof.lean, proof.after.bend, 0.0).max(initial=0.0)
    )
    return {
        "schema": "olp-report-1",
        "program": {
            "name": Path(name).name if name else "",
            "sha256": hashlib.sha256(data).hexdigest(),
            "lines": program.lines,
            "dialect": loaded.profile.name,
            "moves": len(program.toolpath),
        },
        "machine": {"name": machine.name, "chain": machine.chain, "controller": machine.controller},
        "calibration": {
            "measured": calibration.measured,
            "valid_until": calibration.valid_until,
            "model": calibration.model,
            "temperature_degC": calibration.temperature_degC,
            "sha256": loaded.digest,
        },
        "tolerance_um": tolerance_um,
        "deviation": {
            "before": proof.before.summary(proof.cutting),
            "after": proof.after.summary(proof.cutting & ~proof.lean),
            "path_max_um": float(size.max(initial=0.0)) * 1e3,
            "allowed_um": proof.allowed_mm * 1e3,
            "holds": proof.holds,
        },
        "budget_um": {"model_and_chords": bend * 1e3, "rounding": 0.87 * proof.digit_mm * 1e3},
        "orientation": checks.orientation(program.toolpath, loaded.model),
        "sources": checks.sources(program.toolpath, loaded.model),
        "worst": checks.worst_blocks(program, proof),
        "findings": [f.as_dict() for f in findings],
        "proves": list(_PROVES),
        "does_not_prove": list(_DOES_NOT_PROVE),
    }


def _ends(rows: Plan, count: int) -> Array:
    """(n, 3) command at the end of each move."""
    if len(rows) == count:
        return rows.command_mm
    last = np.append(rows.move[1:] != rows.move[:-1], True)
    return np.asarray(rows.command_mm[last], float)


def _largest_correction(path: Toolpath, command_mm: Array) -> float:
    largest = 0.0
    for a in range(0, len(path), 1 << 16):
        away = np.nan_to_num(command_mm[a : a + (1 << 16)] - path.end_mm[a : a + (1 << 16)])
        largest = max(largest, float(np.einsum("ij,ij->i", away, away).max(initial=0.0)))
    return float(largest**0.5)


def _digit_mm(program: Program, setup: Setup) -> float:
    """The coarsest last digit that the corrected program is written with."""
    units = {f.unit_mm for f in program.toolpath.frames} or {1.0}
    inch = program.profile.inch_decimals
    return max(
        10.0 ** -fewest_decimals(least, unit, inch) * unit
        for least in setup.machine.least_increment_mm
        for unit in units
    )


def _stamp(loaded: _Job) -> bytes:
    before, after = loaded.profile.comment
    return before + f"olp-corrected {loaded.digest[:12]} olp {__version__}".encode() + after


def _unrolled(
    data: bytes, name: str, profile: Profile, expand: bool, clearance: float | None = None
) -> bytes:
    from olp.program.flatten import flatten as unroll

    folder = Path(name).parent if name else None

    def beside(wanted: str) -> bytes | None:
        if folder is None:
            return None
        for suffix in ("", ".ngc", ".nc"):
            candidate = folder / f"{wanted}{suffix}"
            if candidate.is_file():
                return read_bytes(candidate)
        return None

    return unroll(
        data, profile=profile.name, subprograms=beside, expand_cycles=expand, peck_clearance=clearance
    )


def _source(program: PathLike | bytes) -> tuple[bytes, str]:
    if isinstance(program, bytes):
        return program, ""
    return read_bytes(program), str(program)


def _setup(machine: PathLike | Setup, job: PathLike | None) -> Setup:
    return machine if isinstance(machine, Setup) else load_setup(machine, job)


def _profile(setup: Setup) -> Profile:
    profile = PROFILES.get(setup.machine.controller)
    if profile is None:
        raise ConfigError(
            f"controller {setup.machine.controller!r} has no profile; expected one of {', '.join(PROFILES)}"
        )
    return profile


def _load(machine: PathLike | Setup, job: PathLike | None, outside: Literal["refuse", "hold"]) -> _Job:
    setup = _setup(machine, job)
    described = setup.machine
    if described.calibration is None:
        raise ConfigError(
            f"machine {described.name!r} names no calibration; give the key calibration in its file"
        )
    if "all" in described.compensated_by_controller:
        raise ConfigError(
            'compensated_by_controller = "all": the control corrects everything already, a corrected program '
            "would be corrected twice; list the components that it corrects, or switch its tables off"
        )
    calibration = load_calibration(described.calibration, described, dict(setup.job.temperatures_degC))
    skip = described.compensated_by_controller - calibration.active_during_measurement
    model = build(calibration, described.chain, outside=outside, skip_components=frozenset(skip))
    return _Job(setup, _profile(setup), calibration, model, _digest(described.calibration, described))


def _digest(calibration: str, machine: object) -> str:
    """Hash of the calibration file, its curve files and the machine values that decide the model."""
    import tomllib

    raw = read_bytes(calibration)
    digest = hashlib.sha256(raw)
    for curve in tomllib.loads(raw.decode()).get("curves", []):
        digest.update(read_bytes(Path(calibration).parent / curve["file"]))
    digest.update(repr(getattr(machine, "chain", "")).encode())
    return digest.hexdigest()


def _lever(setup: Setup, tool: int | tuple[float, float, float] | None) -> tuple[float, float, float]:
    if isinstance(tool, tuple):
        return tool
    number = setup.machine.default_tool if tool is None else tool
    if not number:
        return (0.0, 0.0, 0.0)
    found = setup.tool(number)
    if found is None or found.lever_mm is None:
        raise ConfigError(
            f"tool {number} has no lever; give tools.{number}.Z_mm or gauge_to_tip_mm in the machine file"
        )
    return found.lever_mm


def _silent(what: str, share: float) -> None:
    return None


__all__ = [
    "Correction", "Simulation", "Verification", "correct", "error_at", "flatten", "inspect", "simulate",
    "verify",
]  # fmt: skip
