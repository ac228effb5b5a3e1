"""`olp calibrate doctor`."""

from __future__ import annotations

import click

from olp.cli.common import STREAM, diagnostic, exit_for, files_of, put_result, refuse_early
from olp.cli.joints import on_joints
from olp.cli.options import (
    fail_on_option,
    force_option,
    instrument_options,
    json_option,
    machine_option,
    output_option,
    quiet_option,
    units_option,
)
from olp.core.errors import UsageError


@click.command("doctor")
@click.argument("calibration", metavar="CALIBRATION")
@click.argument("points", metavar="POINTS.csv")
@machine_option(required=True)
@output_option("NEW.toml", "Write the calibration with the decided mistakes corrected.")
@instrument_options
@json_option()
@units_option
@fail_on_option
@quiet_option("No table; only the exit code.")
@force_option("the new calibration and its curves")
def command(
    calibration: str,
    points: str,
    machine: str,
    output: str | None,
    sigma_um: float | None,
    reflector: tuple[float, float, float] | None,
    as_json: bool,
    fail_on: str,
    quiet: bool,
    force: bool,
) -> None:
    """Check the curves of a calibration with independent points.

    POINTS.csv holds commanded axis positions and measured positions (or deviations) of points that were not
    used for the calibration. The instrument frame may be unknown. For every curve and squareness, the report
    says: sign right, flipped or undecided; unit; swapped columns. It names points that would decide the rest.
    For a machine of any joints POINTS.csv is a plan of new readings, as for a fit.
    """
    if STREAM in (output, calibration, points):
        raise UsageError("a calibration is several files and cannot be -; name files")
    if on_joints(machine, None, also=("calibration", "points")):
        _of_joints(
            calibration, points, machine, output, as_json=as_json, fail_on=fail_on, quiet=quiet, force=force
        )
        return
    from olp.files.calibration.reader import files_beside
    from olp.files.measurements.reader import files_of_measurements

    stated = map(str, (calibration, *files_beside(calibration)))
    inputs = (*files_of(machine), *stated, *files_of_measurements([points]))
    refuse_early(files_of(output), inputs, force=force)

    from olp.files.write import write_files
    from olp.workflows.calibrate_doctor import diagnose_calibration

    diagnosis = diagnose_calibration(calibration, points, machine, sigma_um=sigma_um, tool_mm=reflector)
    if output is not None:
        files = diagnosis.files(output)
        write_files(files, force=force, inputs=inputs)
        diagnostic(f"wrote {output} and {len(files) - 1} files beside it")
    put_result(diagnosis, as_json=as_json, quiet=quiet)
    exit_for(diagnosis.findings, fail_on)


def _of_joints(
    calibration: str,
    data: str,
    machine: str,
    output: str | None,
    *,
    as_json: bool,
    fail_on: str,
    quiet: bool,
    force: bool,
) -> None:
    """The check of a calibration of any joints."""
    from olp.workflows.joints.doctor import diagnose_joint_calibration

    refuse_early(files_of(output), (calibration, data, *files_of(machine)), force=force)
    diagnosed = diagnose_joint_calibration(calibration, data, machine)
    if output is not None:
        for path in diagnosed.write(output, force=force):
            diagnostic(f"wrote {path}")
    put_result(diagnosed, as_json=as_json, quiet=quiet)
    exit_for(diagnosed.findings, fail_on)
