"""`olp calibrate refine`."""

from __future__ import annotations

import datetime
from typing import Any

import click

from olp.cli.common import STREAM, diagnostic, exit_for, files_of, note_of_use, put_result, refuse_early
from olp.cli.joints import on_joints
from olp.cli.options import (
    Length,
    day_option,
    fail_on_option,
    force_option,
    instrument_options,
    json_option,
    output_option,
    program_options,
    quiet_option,
    units_option,
)
from olp.core.errors import UsageError


@click.command("refine")
@click.argument("calibration", metavar="CALIBRATION")
@click.argument("measured", metavar="MEASURED.csv")
@program_options
@output_option("NEW.toml", "Where to write; never over CALIBRATION.", required=True)
@click.option(
    "--program", metavar="NOMINAL", help="MEASURED are tip positions along a corrected run of this program."
)
@instrument_options
@day_option("Day of the run: the new calibration's date of measuring. Default: the old one's.")
@click.option(
    "--growth-per-year", type=click.FloatRange(min=0.0), metavar="SHARE",
    help="What is known fades by this share a year until the day of the run. Default: the calibration's.",
)  # fmt: skip
@click.option(
    "--uncertainty-um", type=Length(),
    help="Measure again when the uncertainty in the box (rms length, best-fit frame) is more. Default: 5 um; "
    "none for a machine of any joints.",
)  # fmt: skip
@json_option()
@units_option
@fail_on_option
@quiet_option("No table; only the exit code.")
@force_option("the new calibration and its files")
def command(
    calibration: str,
    measured: str,
    machine: str | None,
    job: str | None,
    output: str,
    program: str | None,
    sigma_um: float | None,
    reflector: tuple[float, float, float] | None,
    date: datetime.date | None,
    growth_per_year: float | None,
    uncertainty_um: float | None,
    as_json: bool,
    fail_on: str,
    quiet: bool,
    force: bool,
    **unrolling: Any,
) -> None:
    """Update a calibration by a measured run, within its covariance.

    MEASURED.csv holds commanded axis positions and measured positions of the reflector, in an unknown
    instrument frame. Every number of the calibration changes as far as its uncertainty allows and the run
    asks for. What the run does not determine stays unchanged. For a machine of any joints MEASURED.csv is a
    plan of new readings, as for a fit.
    """
    if STREAM in (output, calibration, measured):
        raise UsageError("a calibration is several files and cannot be -; name files")
    if machine is None:
        raise UsageError("no machine file is given; name it with -m")
    if on_joints(machine, job, also=("calibration", "measured", "growth_per_year", "uncertainty_um")):
        _of_joints(
            calibration, measured, machine, output, date, growth_per_year, uncertainty_um,
            as_json=as_json, fail_on=fail_on, quiet=quiet, force=force,
        )  # fmt: skip
        return
    from olp.files.calibration.reader import files_beside
    from olp.files.measurements.reader import files_of_measurements

    inputs = (
        *files_of(machine, job, program),
        *map(str, (calibration, *files_beside(calibration))),
        *files_of_measurements([measured]),
    )
    refuse_early(files_of(output), inputs, force=force)

    from olp.files.write import write_files
    from olp.workflows.calibrate_refine import refine_calibration

    wanted: dict[str, Any] = {} if uncertainty_um is None else {"uncertainty_um": uncertainty_um}
    refined = refine_calibration(
        calibration, measured, machine, job, program=program, sigma_um=sigma_um, tool_mm=reflector,
        date=date, growth_per_year=growth_per_year, **wanted, **unrolling,
    )  # fmt: skip
    files = refined.files(output)
    write_files(files, force=force, inputs=inputs)
    diagnostic(f"wrote {output} and {len(files) - 1} files beside it")
    if not quiet:
        note_of_use(machine, output)
    put_result(refined, as_json=as_json, quiet=quiet)
    exit_for(refined.findings, fail_on)


def _of_joints(
    calibration: str,
    data: str,
    machine: str,
    output: str,
    date: datetime.date | None,
    growth_per_year: float | None,
    uncertainty_um: float | None,
    *,
    as_json: bool,
    fail_on: str,
    quiet: bool,
    force: bool,
) -> None:
    """The refinement of a calibration of any joints."""
    from olp.workflows.joints.refine import refine_joint_calibration

    refuse_early(files_of(output), (calibration, data, *files_of(machine)), force=force)
    refined = refine_joint_calibration(
        calibration, data, machine, date=date, growth_per_year=growth_per_year, uncertainty_um=uncertainty_um
    )
    for path in refined.write(output, force=force):
        diagnostic(f"wrote {path}")
    if not quiet:
        note_of_use(machine, output)
    put_result(refined, as_json=as_json, quiet=quiet)
    exit_for(refined.findings, fail_on)
