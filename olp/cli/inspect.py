"""`olp inspect`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from olp.cli.common import (
    diagnostic,
    files_of,
    machine_given,
    options_of,
    plot_ending,
    put,
    refuse_early,
    source,
)
from olp.cli.options import MM, Integer, force_option, json_option, plot_option, program_options, units_option
from olp.core.errors import UsageError
from olp.core.values import dataclass

if TYPE_CHECKING:
    from olp.errormodel.calibration import Calibration
    from olp.reports.plots.base import Format
    from olp.workflows.flatten import UnrollOptions
    from olp.workflows.session import Session


#: A number as it is given for an axis.
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)")


@click.command("inspect")
@click.argument("file", metavar="PROGRAM|machine.toml", required=False)
@program_options
@click.option("--at", type=(MM, MM, MM), metavar="X Y Z", help="Show the error at an axis position in mm.")
@click.option(
    "--axes",
    multiple=True,
    metavar="NAME=VALUE",
    help="Show pose and error of a machine with rotary joints, in mm and deg, such as --axes C=30.",
)
@click.option("--tool", type=Integer(), help="Tool number for --at or --axes. Default: that at the start.")
@plot_option("Draw the curves of the calibration, as .svg or .png.")
@json_option("Print as JSON.")
@units_option
@force_option("the plot")
def command(
    file: str | None,
    machine: str | None,
    job: str | None,
    at: tuple[float, float, float] | None,
    axes: tuple[str, ...],
    tool: int | None,
    plot: str | None,
    as_json: bool,
    force: bool,
    **words: Any,
) -> None:
    """Show what a program does, or what a machine's calibration holds.

    A file that ends in .toml is a machine file. --at and --plot are about the machine, not the program.
    """
    ask_program = False
    if file is not None and Path(file).suffix.lower() == ".toml":
        if machine is not None:
            raise UsageError("the machine is given twice; name it once, as argument or with -m")
        file, machine = None, file
    elif file is None and machine is None:
        ask_program = at is None and plot is None
    about_machine = file is None and machine is not None
    asked = _Asked(axes, tool, plot, as_json=as_json, force=force)
    if about_machine and _of_joints(machine or "", job, asked, at):
        return
    if axes:
        raise UsageError("--axes is for machine files with rotary joints; give the axis position with --at")
    from olp.cli import joints

    if not about_machine and joints.on_joints(machine, job, also=("file",)):
        joints.inspect(file, machine, job, words | {"as_json": as_json})
        return
    session, inputs = machine_given(machine, job)
    setup = session.setup
    if ask_program:
        file = setup.job.program
    if tool is not None and at is None:
        raise UsageError("--tool belongs to --at; give the axis position with --at X Y Z")
    if plot is not None:
        plot_ending(plot)
    refuse_early(files_of(plot), (*inputs, *files_of(file)), force=force)

    if plot is not None:
        _plot(session, plot, inputs, force)
    if at is not None:
        from olp.reports.report import plain
        from olp.workflows.inspect import error_of

        values = shown = plain(error_of(session, at, tool))
    elif plot is not None:
        return
    elif file is None:
        values = shown = machine_summary(session)
    else:
        from olp.workflows.flatten import UnrollOptions

        values = _program(session, file, options_of(UnrollOptions, words), as_json=as_json)
        shown = values | {"support": _by_support(values.get("support") or ())}
    from olp.reports.outline import outline
    from olp.reports.report import to_json

    put(to_json(values) if as_json else outline(shown))


@dataclass(frozen=True, slots=True)
class _Asked:
    """What a call asks of a machine with rotary joints."""

    axes: tuple[str, ...]
    tool: int | None
    plot: str | None
    as_json: bool
    force: bool


def _of_joints(machine: str, job: str | None, asked: _Asked, at: tuple[float, float, float] | None) -> bool:
    """Show a machine with other joints than three linear axes; False where the file is of no such machine."""
    from olp.files.kinematics.load import is_of_joints

    if not is_of_joints(machine):
        return False
    if at is not None:
        raise UsageError("--at is for three linear axes; give axis values such as --axes C=30")
    if asked.tool is not None and not asked.axes:
        raise UsageError("--tool belongs to --axes; give axis values such as --axes C=30")
    if asked.plot is not None:
        _plot_joints(machine, job, asked.plot, force=asked.force)
        if not asked.axes:
            return True
    from olp.reports.outline import outline
    from olp.reports.report import plain, to_json
    from olp.workflows.inspect_joints import joint_error_at, joint_summary

    axes = asked.axes
    values = joint_error_at(machine, _values(axes), job, asked.tool) if axes else joint_summary(machine, job)
    put(to_json(values) if asked.as_json else outline(plain(values)))
    return True


def _plot_joints(machine: str, job: str | None, name: str, *, force: bool) -> None:
    plot_ending(name)
    from olp.files.calibration.reader import files_beside
    from olp.files.kinematics.load import load_joint_setup
    from olp.files.write import write_bytes
    from olp.reports.plots.joint_curves import joint_curves

    setup = load_joint_setup(machine, job)
    own = setup.machine.calibration
    if setup.calibration is None or own is None:
        raise UsageError("names no calibration; set the key calibration in it", file=machine)
    inputs = (*files_of(machine, job, own), *map(str, files_beside(own)))
    refuse_early(files_of(name), inputs, force=force)
    data = joint_curves(setup.machine.structure, setup.calibration, _kind_of(name))
    write_bytes(name, data, force=force, inputs=inputs)
    diagnostic(f"wrote {name}")


def _values(stated: Sequence[str]) -> dict[str, float]:
    """Axis values of texts such as "C=30". Raises UsageError."""
    values: dict[str, float] = {}
    for text in stated:
        name, mark, number = text.partition("=")
        value = float(number) if _NUMBER.fullmatch(number) else None
        if not mark or value is None or name in values:
            raise UsageError(f"--axes {text}; expected NAME=VALUE in mm or deg, each axis once, such as C=30")
        values[name] = value
    return values


def _program(session: Session, file: str, options: UnrollOptions, *, as_json: bool) -> dict[str, Any]:
    """What a program does. One that is refused is reported with all the reasons, and the error is raised."""
    from olp.reports.refusals import refusals_text
    from olp.reports.report import to_json
    from olp.workflows import inspect, refusals

    values, error = inspect.examined(session, source(session.sources, file), options)
    if error is None:
        return values
    text = refusals_text(values["refused"], complete=values["refused_complete"])
    put(to_json(values) if as_json else "\n".join(text) + "\n")
    raise refusals.short(error)


def _plot(session: Session, name: str, inputs: Sequence[str], force: bool) -> None:
    from olp.files.write import write_bytes
    from olp.reports.plots.base import calibration_curves

    data = calibration_curves(_calibration(session), _kind_of(name))
    write_bytes(name, data, force=force, inputs=inputs)
    diagnostic(f"wrote {name}")


def _kind_of(picture: str) -> Format:
    """The format that the name of a picture ends in."""
    return "png" if Path(picture).suffix.lower() == ".png" else "svg"


def _by_support(matrix: Sequence[Mapping[str, str]]) -> dict[str, str]:
    """The statements of a support matrix, by kind of support; the JSON holds the reasons too."""
    from olp.program.dialect import Support

    kinds = dict.fromkeys(row["support"] for row in matrix)
    return {
        Support(kind).title: " ".join(row["statement"] for row in matrix if row["support"] == kind)
        for kind in kinds
    }


def _calibration(session: Session) -> Calibration:
    machine = session.setup.machine
    if machine.calibration is None:
        raise UsageError(
            f"machine {machine.name!r} names no calibration; set the key calibration in its file"
        )
    return session.calibration()


def machine_summary(session: Session) -> dict[str, Any]:
    """Axes, chain, calibration and each of its error sources, with units in the keys."""
    from olp.core.units import AXES

    setup = session.setup
    calibration, described = _calibration(session), setup.machine
    axes: dict[str, dict[str, Any]] = {
        name: {
            "travel_mm": list(axis.travel_mm),
            "calibrated_mm": calibration.box_mm[AXES.index(name)].tolist(),
            "least_increment_mm": axis.least_increment_mm,
        }
        for name, axis in described.axes.items()
    }
    summary: dict[str, Any] = {
        "machine": {
            "name": described.name,
            "chain": described.chain,
            "controller": described.controller,
            "compensated_by_controller": sorted(described.compensated_by_controller),
            "work_offsets": sorted(described.work_offsets.keys() | setup.job.work_offsets.keys()),
            "tools": sorted(described.tools.keys() | setup.job.tools.keys()),
        },
        "calibration": {
            "model": calibration.model,
            "measured": calibration.measured,
            "valid_until": calibration.valid_until,
            "temperature_degC": calibration.temperature_degC,
            "datum_mm": list(calibration.datum_mm),
        },
        "axes": axes,
    }
    frame = calibration.frame(described.chain)
    # errors that no correction removes come last
    for kind, values in sorted(calibration.sources(), key=lambda pair: not pair[0].correctable):
        for name, axis in axes.items():
            axis |= kind.inspect_axis(values, name)
        summary |= kind.inspect(values, frame)
    return summary
