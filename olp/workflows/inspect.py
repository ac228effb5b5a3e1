"""`inspect`: what a program does, and the error of the machine at an axis position."""

from __future__ import annotations

from typing import Any

import numpy as np

from olp.checks import correction as checks
from olp.compensation.stamp import find_stamp
from olp.core.errors import ConfigError, ProgramError
from olp.core.machine import Setup
from olp.core.toolpath import Kind, carried
from olp.files.sources import Source
from olp.workflows import refusals
from olp.workflows.flatten import UnrollOptions
from olp.workflows.original import placed
from olp.workflows.session import PathLike, Session, opened


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
    findings = checks.program_findings(parsed, setup, contour=False)
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
    position_mm: tuple[float, float, float],
    tool: int | tuple[float, float, float] | None = None,
    job: PathLike | None = None,
) -> dict[str, Any]:
    """The error at one axis position: actual minus commanded at the tip, and its parts by source.

    `tool` is a tool number or a tool vector in mm (gauge point to tip); the default is the tool in the
    spindle at the start.
    """
    return error_of(Session.start(machine, job), position_mm, tool)


def error_of(
    session: Session,
    position_mm: tuple[float, float, float],
    tool: int | tuple[float, float, float] | None = None,
) -> dict[str, Any]:
    """As `error_at`, in a session."""
    loaded = session.loaded("refuse")
    position = np.array([position_mm], float)
    inside = loaded.model.inside(position)
    if not inside.all():
        axis = "XYZ"[int(np.flatnonzero(~inside[0])[0])]
        raise ConfigError(
            f"{axis} = {position[0]['XYZ'.index(axis)]:g} mm is outside the calibrated box; choose one inside"
        )
    vector = session.tool_vector(tool)
    payload = loaded.setup.job.payload_kg
    tool_vector = np.array(carried(vector, payload))
    return {
        "position_mm": [float(v) for v in position_mm],
        "tool_mm": [float(v) for v in vector],
        "payload_kg": payload,
        "error_um": (loaded.model.error(position, tool_vector)[0] * 1e3).tolist(),
        "rotation_urad": (loaded.model.rotation(position, None, payload)[0] * 1e6).tolist(),
        "sources": [
            {"name": source, "error_um": (part[0] * 1e3).tolist()}
            for source, part in loaded.model.contributions(position, tool_vector)
        ],
    }
