"""The first files of a new machine, written as text that loads, with comments that say what to replace."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from olp.core.errors import UsageError
from olp.core.machine import (
    CHAINS,
    COMPONENTS,
    ZERO,
    Axis,
    ControlTimes,
    Job,
    Machine,
    Tool,
    Vector,
    WorkOffset,
)  # fmt: skip
from olp.core.units import AXES, in_unit
from olp.errormodel.calibration import PLACEHOLDER_DATE, Calibration
from olp.files.calibration.writer import calibration_files
from olp.files.fields import CONTROLLER_NAMES, unknown_dialect
from olp.files.json_schema import json_schema_text
from olp.files.machine_settings.base import AxisSettings, Settings
from olp.files.toml_text import comment, toml_key, toml_lines, toml_value
from olp.files.write import PathLike, check_targets, make_folder, write_files

Travel = Mapping[str, tuple[float, float]]

#: Rows of each curve file.
_POINTS = 11
#: The folder of the schemas beside the files, so that editors check them without a network.
SCHEMAS = "schemas"
#: In mm: where no one states it.
_LEAST_INCREMENT_MM = 0.001
#: Of mm and mm/s: a change of inches or of mm/min makes more.
_DECIMALS = 6


def machine_toml(machine: Machine, notes: Iterable[str] = ()) -> str:
    """A machine as the text of an olp-machine-1 file, with notes as comments. An equal machine loads from
    it."""
    lines = [line for note in notes for line in comment(note)]
    compensated = sorted(machine.compensated_by_controller)
    lines += toml_lines({"schema": "olp-machine-1", "name": machine.name})
    lines += [
        f"{line}  # from workpiece to tool, F the frame" for line in toml_lines({"chain": machine.chain})
    ]
    lines += toml_lines({"controller": machine.controller, "calibration": machine.calibration})
    lines += comment("What the control corrects now and did not correct while measuring, by ISO 230-1 name.")
    lines += toml_lines({"compensated_by_controller": "all" if compensated == ["all"] else compensated})
    if machine.real_time is not None:
        lines += toml_lines({"real_time": machine.real_time})
    lines += _stands(machine)
    if machine.missing_limits:
        keys = "velocity_mm_s, acceleration_mm_s2 and jerk_mm_s3"
        lines += ["", *comment(f"Only a motion in time (olp retime) needs {keys} of each axis.")]
    for name in AXES:
        axis = machine.axes[name]
        lines += ["", f"[axes.{name}]"]
        stated = {key: getattr(axis, key) for key in (field.name for field in fields(Axis))}
        if axis.compliance_um_per_m_s2 == ZERO:
            del stated["compliance_um_per_m_s2"]
        lines += toml_lines(stated)
    if (machine.path_mode, machine.blend_mm) != ("blend", None):
        lines += ["", *comment("How the control moves from block to block where a program does not say.")]
        lines += ["[path]", *toml_lines({"mode": machine.path_mode, "blend_mm": machine.blend_mm})]
    if machine.times != ControlTimes():
        times = machine.times
        stated = {"tool_change_s": times.tool_change_s, "spindle_start_s": times.spindle_start_s}
        codes = ", ".join(f"M{code} = {seconds!r}" for code, seconds in times.m_codes_s.items())
        lines += ["", *comment("What the control takes beside motion.")]
        lines += ["[times]", *toml_lines(stated), *([f"m_codes_s = {{ {codes} }}"] if codes else [])]
    lines += ["", *comment("Axis position of the program's origin, without tool length.")]
    for offset in machine.work_offsets.values():
        lines += [f"[work_offsets.{toml_key(offset.name)}]", *_work_offset(offset)]
    lines += ["", *comment("The control's tool table: Z_mm is the tool length.")]
    for tool in machine.tools.values():
        lines += [f"[tools.{tool.number}]", *_tool(tool)]
    lines += ["", *comment("The state at the start of a program.")]
    lines += ["[job_defaults]"]
    lines += toml_lines(
        {
            "tool": machine.default_tool,
            "work_offset": machine.default_work_offset,
            "length_active": machine.length_active,
        }
    )
    return "\n".join(lines) + "\n"


def _stands(machine: Machine) -> Iterator[str]:
    """Where the control leaves the axes that it moves by itself; a comment where nothing is stated."""
    places = {"home_mm": machine.home_mm, "second_home_mm": machine.second_home_mm}
    places["tool_change_mm"] = machine.tool_change_mm
    stated = {
        key: {a: v for a, v in zip(AXES, place, strict=True) if v is not None}
        for key, place in places.items()
    }
    yield from comment("Axis positions where G28, G30 and M6 leave the axes, if they are known:")
    yield from toml_lines({key: place or None for key, place in stated.items()})
    if not any(stated.values()):
        yield "# home_mm = { X = 0.0, Y = 0.0, Z = 0.0 }"
    moves = machine.tool_change_moves
    if moves != frozenset(AXES):
        yield from toml_lines({"tool_change_moves": sorted(moves) if moves else False})


def _work_offset(offset: WorkOffset) -> Iterator[str]:
    rotation = zip(("A_deg", "B_deg", "C_deg"), offset.rotation_deg, strict=True)
    yield from toml_lines({f"{axis}_mm": value for axis, value in zip(AXES, offset.offset_mm, strict=True)})
    yield from toml_lines({key: value for key, value in rotation if value})
    other = '"true" if located by other means' if offset.set_by == "touch" else '"touch" if touched off'
    yield from (f"{line}  # {other}" for line in toml_lines({"set_by": offset.set_by}))
    touched = {axis: v for axis, v in zip(AXES, offset.touched_at_mm, strict=True) if v is not None}
    yield from toml_lines({"touched_at_mm": touched or None, "touch_tool": offset.touch_tool})


def _tool(tool: Tool) -> Iterator[str]:
    x, y, z = tool.length_mm
    yield from toml_lines({"X_mm": x or None, "Y_mm": y or None, "Z_mm": z, "radius_mm": tool.radius_mm})
    yield from toml_lines({"wear_mm": tool.wear_mm or None})
    yield from toml_lines({"gauge_to_tip_mm": tool.gauge_to_tip_mm})
    if tool.touched_at_mm is not None:
        touched = dict(zip(AXES, tool.touched_at_mm, strict=True))
        yield from toml_lines({"set_by": tool.set_by, "touched_at_mm": touched})
    constant_um = None if tool.constant_mm is None else in_unit(tool.constant_mm, -3)
    yield from toml_lines({"setter": tool.setter, "k_um": constant_um})


def starter_machine(
    name: str,
    chain: str,
    travel_mm: Travel,
    controller: str = "linuxcnc",
    *,
    settings: Settings | None = None,
    zero_mm: Vector | None = None,
) -> Machine:
    """A machine with what `settings` state, the program's zero (G54) at `zero_mm` or in the middle of the
    travel, and one tool where none is stated. Raises UsageError for a chain, a travel or a control that no
    machine has."""
    if controller not in CONTROLLER_NAMES:
        raise UsageError(f"controller {unknown_dialect(controller)}")
    if chain not in CHAINS:
        raise UsageError(f'"{chain}" is not a chain; expected an order of F, X, Y, Z from workpiece to tool')
    for axis in AXES:
        low, high = travel_mm.get(axis, (0.0, 0.0))
        if not (np.isfinite([low, high]).all() and low < high):
            raise UsageError(f"travel of {axis} is [{low:g}, {high:g}] mm; expected min below max")
    axes = {
        axis: _axis(travel_mm[axis], AxisSettings() if settings is None else settings.axes[axis])
        for axis in AXES
    }
    x, y, z = _plain(sum(axes[axis].travel_mm) / 2 for axis in AXES)
    offsets = {} if settings is None else {name: _offset(one) for name, one in settings.work_offsets.items()}
    if zero_mm is not None or not offsets:
        offsets["G54"] = WorkOffset("G54", offset_mm=zero_mm or (x, y, z))
    tools = {} if settings is None else {number: _held(one) for number, one in settings.tools.items()}
    named = settings is not None and settings.work_offset in offsets
    return Machine(
        name=name,
        chain=chain,
        controller=controller,
        axes=axes,
        calibration="calibration.toml",
        compensated_by_controller=frozenset() if settings is None else settings.compensated,
        work_offsets=offsets,
        tools=tools or {1: Tool(1, length_mm=(0.0, 0.0, 100.0), radius_mm=5.0)},
        default_tool=None if tools else 1,
        default_work_offset=settings.work_offset if settings is not None and named else "G54",
    )


def _plain(values: Iterable[float]) -> Iterator[float]:
    """Numbers without the digits that a change of units makes."""
    return (round(float(value), _DECIMALS) for value in values)


def _axis(travel_mm: tuple[float, float], stated: AxisSettings) -> Axis:
    low, high = _plain(travel_mm)
    limits = (stated.velocity_mm_s, stated.acceleration_mm_s2, stated.jerk_mm_s3)
    velocity, acceleration, jerk = (None if most is None else next(_plain([most])) for most in limits)
    return Axis(
        travel_mm=(low, high),
        least_increment_mm=stated.least_increment_mm or _LEAST_INCREMENT_MM,
        velocity_mm_s=velocity,
        acceleration_mm_s2=acceleration,
        jerk_mm_s3=jerk,
    )


def _offset(stated: WorkOffset) -> WorkOffset:
    x, y, z = _plain(stated.offset_mm)
    return replace(stated, offset_mm=(x, y, z))


def _held(stated: Tool) -> Tool:
    x, y, z, wear = _plain((*stated.length_mm, stated.wear_mm))
    radius = None if stated.radius_mm is None else next(_plain([stated.radius_mm]))
    return replace(stated, length_mm=(x, y, z), radius_mm=radius, wear_mm=wear)


#: What the head of a machine file says that is still to be completed.
NOTES = (
    "Replace travel, offsets and tools by those of your machine.",
    "G54 is the middle of the travel: put the offsets there that your control shows.",
)


def starter_set(
    machine: Machine, known: Calibration | None = None, notes: Iterable[str] = NOTES, program: str = "part.nc"
) -> dict[str, str]:
    """Texts by file name: machine, calibration, job, and the schemas of the three, which they name.

    Errors that are `known` as numbers become the calibration. Without them it has one curve file per axis,
    all errors are zero, and it has a date by which every verb knows that it is not completed.
    """
    if known is None:
        calibration = {"calibration.toml": _calibration_toml(machine)}
        calibration |= {f"{axis.lower()}.csv": _curve_csv(axis, machine.axes[axis]) for axis in AXES}
    else:
        calibration = _known(known)
    files = {"machine.toml": machine_toml(machine, [f"Machine {machine.name}.", *notes]), **calibration}
    files["job.toml"] = _job_toml(machine, program)
    for kind in ("machine", "calibration", "job"):
        files[f"{kind}.toml"] = f"#:schema ./{SCHEMAS}/{kind}.json\n" + files[f"{kind}.toml"]
        files[f"{SCHEMAS}/{kind}.json"] = json_schema_text(kind)
    return files


def write_starter(folder: PathLike, machine: Machine, *, force: bool = False) -> list[Path]:
    """Write the starter set of a machine that was not measured into a folder, all files or none. Raises as
    `write_files`."""
    files = {Path(folder) / name: text.encode() for name, text in starter_set(machine).items()}
    check_targets(files, force=force, new_folders=True)
    make_folder(Path(folder) / SCHEMAS)
    write_files(files, force=force)
    return list(files)


def _known(calibration: Calibration) -> dict[str, str]:
    notes = [
        "The errors that are known as single numbers: actual minus commanded, of the tool relative to the "
        "workpiece.",
        "temperature_degC is assumed; it counts only beside a table [thermal].",
    ]
    files = calibration_files(calibration, Path("calibration.toml"), notes=notes)
    return {path.name: data.decode() for path, data in files.items()}


def _calibration_toml(machine: Machine) -> str:
    box = [list(machine.axes[axis].travel_mm) for axis in AXES]
    lines = [
        *comment(
            "Errors of the machine: actual minus commanded, of the tool relative to the workpiece. The curves"
        ),
        *comment("hold zeros, which correct nothing. Put measured values there, then set dates and box."),
        *toml_lines({"schema": "olp-calibration-1", "machine": machine.name, "measured": PLACEHOLDER_DATE}),
        *toml_lines(
            {"valid_until": PLACEHOLDER_DATE, "temperature_degC": 20.0, "sign": "actual-minus-commanded"}
        ),
        *toml_lines({"model": "rigid-body", "datum_mm": ZERO}),
        *comment(
            "Calibrated axis positions [min, max] of X, Y, Z. A program that leaves the box is refused, or "
            "with --outside-box hold corrected by the error at its face."
        ),
        *toml_lines({"box_mm": box, "active_during_measurement": []}),
    ]
    for axis in AXES:
        others = {other: 0.0 for other in AXES if other != axis}
        lines += ["", "[[curves]]", *toml_lines({"file": f"{axis.lower()}.csv"})]
        lines += [f"{line}  # positions of the other axes" for line in toml_lines({"line_mm": others})]
        lines += [f"{line}  # tool while measuring" for line in toml_lines({"tool_mm": ZERO})]
        lines += toml_lines({"interpolation": "pchip"})
    lines += ["", *comment("Squareness, right-handed: Y to X about Z, Z to X about Y, Z to Y about X.")]
    lines += ["[squareness]", *toml_lines({"C0Y_urad": 0.0, "B0Z_urad": 0.0, "A0Z_urad": 0.0})]
    lines += ["", *comment("Constant backlash of each axis.")]
    lines += ["[backlash]", *toml_lines({f"{axis}_um": 0.0 for axis in AXES})]
    return "\n".join(lines) + "\n"


def _curve_csv(axis: str, limits: Axis) -> str:
    names = [name for name in COMPONENTS if name[2] == axis]
    columns = [f"{axis}_mm", *(f"{name}_{'um' if name[1] in AXES else 'urad'}" for name in names)]
    rows = [
        ",".join([repr(float(position)), *["0.0"] * len(names)])
        for position in np.linspace(*limits.travel_mm, _POINTS)
    ]
    title = (
        f"# Errors of axis {axis} by position: actual minus commanded; columns that are left out are zero."
    )
    return "\n".join([title, ",".join(columns), *rows]) + "\n"


def _job_toml(machine: Machine, program: str) -> str:
    job = Job(program=program, machine="machine.toml")
    lines = [
        *comment("What changes from job to job. Offsets and tools here override the machine's, one by one."),
        *toml_lines({"schema": "olp-job-1", "program": job.program, "machine": job.machine}),
        *comment("Axis positions at the start, if they are known:"),
        "# start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }",
        *toml_lines({"payload_kg": job.payload_kg}),
        "",
        *comment("Temperatures count only if the calibration has a table [thermal]:"),
        "# [temperatures_degC]",
        "# X_scale = 20.0",
        "# workpiece = 20.0",
    ]
    for name, offset in machine.work_offsets.items():
        value = toml_value(offset.offset_mm[0])
        lines += ["", f"# [work_offsets.{toml_key(name)}]", f"# X_mm = {value}"]
    return "\n".join(lines) + "\n"
