"""`olp inspect`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from olp.cli.common import (
    files_of,
    needed_machine,
    put,
    refuse_early,
    setup_options,
    shown,
    source,
    talk,
)
from olp.exceptions import ProgramError, UsageError

if TYPE_CHECKING:
    from olp.errormodel import Calibration
    from olp.machine import Setup

_FORMATS = (".svg", ".png")


@click.command("inspect")
@click.argument("file", metavar="PROGRAM|machine.toml", required=False)
@setup_options
@click.option(
    "--at", type=(float, float, float), metavar="X Y Z", help="Say the error at an axis position in mm."
)
@click.option("--tool", type=int, help="Tool number for --at. Default: the tool at the start.")
@click.option("--plot", metavar="FILE", help="Draw the curves of the calibration, as .svg or .png.")
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
@click.option("--force", is_flag=True, help="Overwrite the plot.")
def command(
    file: str | None,
    machine: str | None,
    job: str | None,
    at: tuple[float, float, float] | None,
    tool: int | None,
    plot: str | None,
    as_json: bool,
    force: bool,
) -> None:
    """Say what a program does, or what a machine's calibration holds.

    A file that ends in .toml is a machine file. --at and --plot ask the machine, not the program.
    """
    if file is not None and Path(file).suffix.lower() == ".toml":
        if machine is not None:
            raise UsageError("the machine is given twice; name it once, as argument or with -m")
        file, machine = None, file
    machine, file = _from_job(machine, file, job, ask_machine=at is not None or plot is not None)
    if tool is not None and at is None:
        raise UsageError("--tool belongs to --at; give the axis position with --at X Y Z")
    if plot is not None and Path(plot).suffix.lower() not in _FORMATS:
        raise UsageError(f"the plot {plot!r} ends in no known format; expected .svg or .png")
    inputs = files_of(file, machine, job)
    refuse_early(files_of(plot), inputs, force=force)

    if plot is not None:
        _plot(machine, job, plot, inputs, force)
    if at is not None:
        from olp import api

        values = api.error_at(machine, at, tool, job)
    elif plot is not None:
        return
    elif file is None:
        values = machine_summary(machine, job)
    else:
        from olp import api

        try:
            values = api.inspect(source(file), machine, job)
        except ProgramError as error:
            raise error.in_file(shown(file)) from None
    from olp.cli.outline import outline
    from olp.report import to_json

    put(to_json(values) if as_json else outline(values))


def _from_job(
    machine: str | None, program: str | None, job: str | None, *, ask_machine: bool
) -> tuple[str, str | None]:
    """Machine and program; only a call that names neither and asks nothing takes the program of the job."""
    if job is not None and machine is None:
        from olp.files.config import load_job

        stated = load_job(job)
        machine = stated.machine
        if program is None and not ask_machine:
            program = stated.program
    return needed_machine(machine), None if ask_machine else program


def _plot(machine: str, job: str | None, name: str, inputs: Sequence[str], force: bool) -> None:
    from olp.files.write import write_bytes
    from olp.plots import calibration_curves

    _, calibration = _load(machine, job)
    data = calibration_curves(calibration, "png" if Path(name).suffix.lower() == ".png" else "svg")
    write_bytes(name, data, force=force, inputs=inputs)
    talk(f"wrote {name}")


def _load(machine: str, job: str | None) -> tuple[Setup, Calibration]:
    from olp.files.config import load_calibration, load_setup

    setup = load_setup(machine, job)
    if setup.machine.calibration is None:
        raise UsageError("names no calibration; set the key calibration of the machine file", file=machine)
    path = setup.machine.calibration
    return setup, load_calibration(path, setup.machine, setup.job.temperatures_degC)


def machine_summary(machine: str, job: str | None) -> dict[str, Any]:
    """Axes, chain, calibration and the size of each of the 21 errors, with units in the keys."""
    from olp.machine import COMPONENTS, SQUARENESS
    from olp.units import AXES, RAD_PER_URAD, UM_PER_MM

    setup, calibration = _load(machine, job)
    described = setup.machine
    position, angular = (
        [_size(calibration, name, unit, scale) for name in COMPONENTS if name[1] in senses]
        for senses, unit, scale in (("XYZ", "um", UM_PER_MM), ("ABC", "urad", 1.0 / RAD_PER_URAD))
    )
    cyclic_position, cyclic_angular = (
        [
            {"name": term.component, "period_mm": term.period_mm, f"amplitude_{unit}": term.amplitude * scale}
            for term in calibration.cyclic
            if term.component[1] in senses
        ]
        for senses, unit, scale in (("XYZ", "um", UM_PER_MM), ("ABC", "urad", 1.0 / RAD_PER_URAD))
    )
    return {
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
        "axes": {
            name: {
                "travel_mm": list(axis.travel_mm),
                "calibrated_mm": calibration.box_mm[AXES.index(name)].tolist(),
                "least_increment_mm": axis.least_increment_mm,
                "lost_motion_um": calibration.backlash_mm[AXES.index(name)] * UM_PER_MM,
            }
            for name, axis in described.axes.items()
        },
        "position_errors": position,
        "angular_errors": angular,
        "squareness": {
            f"{name}_urad": calibration.squareness.get(name, 0.0) / RAD_PER_URAD for name in SQUARENESS
        },
        "cyclic_position_errors": cyclic_position,
        "cyclic_angular_errors": cyclic_angular,
    }


def _size(calibration: Calibration, name: str, unit: str, scale: float) -> dict[str, Any]:
    """Largest absolute value and range; the points hold both, interpolation stays between them."""
    values = [
        value
        for curve in calibration.curves_of(name[2])
        if name in curve.names
        for value in (curve.mean(name) * scale).tolist()
    ] or [0.0]
    return {"name": name, f"max_{unit}": max(map(abs, values)), f"range_{unit}": max(values) - min(values)}
