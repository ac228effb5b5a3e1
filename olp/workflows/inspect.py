"""`inspect`: what a program does, and the error of the machine at an axis position."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.checks import correction as checks
from olp.compensation.stamp import find_stamp
from olp.core.arrays import Array, read_only
from olp.core.errors import ConfigError, ProgramError, UsageError
from olp.core.machine import Setup
from olp.core.toolpath import Kind, carried
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.errormodel.base import ErrorModel
from olp.files.sources import Source
from olp.workflows import refusals
from olp.workflows.flatten import UnrollOptions
from olp.workflows.original import placed
from olp.workflows.session import Outside, PathLike, Session, opened


def inspect(
    program: PathLike | bytes,
    machine: PathLike | Setup,
    job: PathLike | None = None,
    *,
    flatten: bool = False,
    expand_cycles: bool = False,
    peck_clearance_mm: float | None = None,
) -> dict[str, Any]:
    """What a program does: moves by kind, ranges, tools, offsets, path modes, findings and the support
    matrix. `flatten`, `expand_cycles` and `peck_clearance_mm` are those of `correct`. Raises Refused with all
    the reasons where the program is refused for several, ProgramError for one."""
    session, source = opened(program, machine, job, "<program>")
    options = UnrollOptions(flatten=flatten, expand_cycles=expand_cycles, peck_clearance_mm=peck_clearance_mm)
    return run(session, source, options)


def examined(
    session: Session, program: Source, options: UnrollOptions
) -> tuple[dict[str, Any], ProgramError | None]:
    """As `run`. A program that is refused gives all the reasons, and the error."""
    program.load()
    try:
        return run(session, program, options), None
    except ProgramError as error:
        lines = program.data.count(b"\n") + (not program.data.endswith(b"\n"))
        return {"name": program.short, "lines": lines} | refusals.parts_of(
            error, program.name or "<program>"
        ), error


def run(session: Session, program: Source, options: UnrollOptions) -> dict[str, Any]:
    """As `inspect`, in a session."""
    with program.errors("<program>"):
        setup, dialect = session.reading(program)
        program, parsed = refusals.read(session.sources, program, setup, dialect, None, options)
        parsed = parsed.in_original()
    path = parsed.toolpath
    with np.errstate(all="ignore"):
        known = path.end_mm[np.isfinite(path.end_mm).all(axis=1)]
    ranges = {
        axis: [float(known[:, i].min()), float(known[:, i].max())] if len(known) else None
        for i, axis in enumerate("XYZ")
    }
    findings = checks.program_findings(parsed, setup)
    origin = parsed.origin
    return {
        "name": program.short,
        "dialect": dialect.name,
        "dialect_title": dialect.title,
        "lines": parsed.lines,
        "moves": {kind.name.lower(): int((path.kind == kind).sum()) for kind in Kind},
        "cycles": len(parsed.holes),
        "axis_range_mm": ranges,
        "tools": sorted({f.tool for f in path.frames if f.tool is not None}),
        "work_offsets": sorted({f.work_offset for f in path.frames}),
        "payloads_kg": list(dict.fromkeys(f.payload_kg for f in path.frames)),
        "path_modes": [
            placed({"line": m.line, "name": m.name, "tolerance_mm": m.tolerance_mm}, origin)
            for m in parsed.path_modes
        ],
        "stamped": find_stamp(program.data) is not None,
        "findings": [placed(f.as_dict(), origin) for f in findings],
        "support": dialect.support(),
    }


def error_at(
    machine: PathLike | Setup,
    position_mm: npt.ArrayLike,
    tool: int | Sequence[float] | None = None,
    job: PathLike | None = None,
    *,
    outside_box: Outside = "refuse",
) -> dict[str, Any]:
    """The error at axis positions: actual minus commanded at the tip, and its parts by source.

    `position_mm` is one position (3,) or many (n, 3), in the order X, Y, Z. `error_um` and `rotation_urad` of
    the result are read-only arrays of the same shape, and so is `error_um` of each of its `sources`. `tool`
    is a tool number or a tool vector in mm (gauge point to tip); the default is the tool in the spindle at
    the start. Outside the calibrated box it raises ConfigError; with `outside_box="hold"` the error is that
    at the face of the box. Raises UsageError for positions of another shape, or that are not finite.
    """
    return error_of(Session.start(machine, job), position_mm, tool, outside_box)


def error_of(
    session: Session,
    position_mm: npt.ArrayLike,
    tool: int | Sequence[float] | None = None,
    outside_box: Outside = "refuse",
) -> dict[str, Any]:
    """As `error_at`, in a session."""
    position = _positions(position_mm)
    rows = position.reshape(-1, 3)
    loaded = session.loaded(outside_box)
    if outside_box == "refuse":
        _refuse_outside(rows, loaded.model)
    vector = session.tool_vector(tool)
    payload = loaded.setup.job.payload_kg
    tool_vector = np.array(carried(vector, payload))

    def of_all(values: Array, unit: float) -> Array:
        return read_only((values * unit).reshape(position.shape))

    return {
        "position_mm": read_only(position),
        "tool_mm": [float(v) for v in vector],
        "payload_kg": payload,
        "error_um": of_all(loaded.model.error(rows, tool_vector), UM_PER_MM),
        "rotation_urad": of_all(loaded.model.rotation(rows, None, payload), 1.0 / RAD_PER_URAD),
        "sources": [
            {"name": source, "error_um": of_all(part, UM_PER_MM)}
            for source, part in loaded.model.contributions(rows, tool_vector)
        ],
    }


def _positions(position_mm: npt.ArrayLike) -> Array:
    """The positions as a copy. Raises UsageError where they are no positions."""
    try:
        position = np.array(position_mm, np.float64)
    except (TypeError, ValueError):
        raise UsageError("position_mm holds no numbers; expected X, Y, Z in mm, or rows of them") from None
    if position.ndim not in (1, 2) or position.shape[-1] != 3:
        raise UsageError(
            f"position_mm has the shape {position.shape}; expected (3,) for one position, or (n, 3) with X, "
            "Y, Z in each row"
        )
    if not np.isfinite(position).all():
        raise UsageError("position_mm has a value that is not finite; leave such rows out")
    return position


def _refuse_outside(rows: Array, model: ErrorModel) -> None:
    """Raise ConfigError for the first row outside the calibrated box."""
    inside = model.inside(rows)
    if inside.all():
        return
    row, axis = (int(k) for k in np.argwhere(~inside)[0])
    low, high = model.box_mm[axis]
    place = f" in row {row}" if len(rows) > 1 else ""
    raise ConfigError(
        f"{AXES[axis]} = {rows[row, axis]:g} mm{place} is outside the calibrated box, {low:g} to {high:g} "
        "mm; choose one inside"
    )
