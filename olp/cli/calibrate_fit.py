"""`olp calibrate fit`."""

from __future__ import annotations

import datetime
from pathlib import Path

import click

from olp.cli.common import STREAM, diagnostic, exit_for, files_of, note_of_use, put_result, refuse_early
from olp.cli.options import (
    MM,
    day_option,
    fail_on_option,
    file_option,
    force_option,
    json_option,
    machine_option,
    output_option,
    quiet_option,
    report_option,
    units_option,
)
from olp.cli.progress import progress
from olp.core.errors import UsageError


@click.command("fit")
@click.argument("data", nargs=-1, required=True)
@output_option("calibration.toml", "Where to write; curves go beside it.")
@machine_option("The machine file: chain, travel, tools.")
@click.option(
    "--datum", type=(MM, MM, MM), metavar="X Y Z",
    help="Axis position where the curves are zero. Default: the position in the box nearest to zero.",
)  # fmt: skip
@day_option("The last day of the calibration's validity.", "--valid-until")
@click.option(
    "--map/--no-map", "map_", default=None,
    help="Also map errors that rigid bodies cannot make, where points show them. Default: [map] of the plan.",
)  # fmt: skip
@file_option(
    "--propose",
    "PLAN.toml",
    "Only write a plan for the files of a folder: what they say by name and header, and what is asked for.",
)
@report_option()
@json_option("Print the result as JSON.")
@units_option
@fail_on_option
@quiet_option("No table and no progress.")
@force_option("the calibration and its curves")
def command(
    data: tuple[str, ...],
    output: str | None,
    machine: str | None,
    datum: tuple[float, float, float] | None,
    valid_until: datetime.date | None,
    map_: bool | None,
    propose: str | None,
    report_file: str | None,
    as_json: bool,
    fail_on: str,
    quiet: bool,
    force: bool,
) -> None:
    """Make a calibration from measurements.

    DATA are plans (olp-measurements-1), folders with measurements.toml, or folders and files of readings that
    describe themselves. One adjustment takes all readings. It gives curves, squareness, backlash and cyclic
    errors with their uncertainties. For a machine of any joints it gives where its lines really are.
    """
    if propose is not None:
        _propose(data, machine, propose, force=force)
        return
    if STREAM in (output, report_file, *data):
        raise UsageError("a calibration is several files and cannot be -; name files")
    if machine is not None and _is_of_joints(machine):
        if datum is not None or map_ is not None:
            raise UsageError("--datum and --map are of three linear axes; leave them out", file=machine)
        _of_joints(
            data,
            output,
            machine,
            valid_until,
            report_file,
            as_json=as_json,
            fail_on=fail_on,
            quiet=quiet,
            force=force,
        )
        return
    from olp.files.measurements.reader import files_of_measurements

    inputs = (*files_of_measurements(data), *files_of(machine))
    refuse_early(files_of(output, report_file), inputs, force=force)

    from olp.files.write import write_files
    from olp.workflows.calibrate_fit import fit_calibration

    with progress(quiet) as show:
        fitted = fit_calibration(
            [Path(name) for name in data],
            machine,
            datum_mm=datum,
            valid_until=valid_until,
            map=map_,
            progress=show,
        )
    files: dict[Path, bytes] = {} if output is None else fitted.files(output)
    curves = len(files) - 1
    if report_file is not None:
        from olp.workflows.calibrate_report import fit as fit_report

        files[Path(report_file)] = fit_report(fitted, report_file, None)
    write_files(files, force=force, inputs=inputs)
    if output is not None:
        kinds = "curves, map and covariance" if fitted.calibration.maps else "curves and covariance"
        diagnostic(f"wrote {output} and {curves} files of {kinds} beside it")
        if machine is not None and not quiet:
            note_of_use(machine, output)
    if report_file is not None:
        diagnostic(f"wrote {report_file}")
    put_result(fitted, as_json=as_json, quiet=quiet)
    exit_for(fitted.findings, fail_on)


def _is_of_joints(machine: str) -> bool:
    from olp.files.kinematics.load import is_of_joints

    return is_of_joints(machine)


def _of_joints(
    data: tuple[str, ...],
    output: str | None,
    machine: str,
    valid_until: datetime.date | None,
    report_file: str | None,
    *,
    as_json: bool,
    fail_on: str,
    quiet: bool,
    force: bool,
) -> None:
    """The calibration of a machine of any joints. Raises UsageError and as `fit_joint_calibration`."""
    if len(data) != 1:
        raise UsageError("the readings of a machine of any joints are in one plan; name it as DATA")
    refuse_early(files_of(output, report_file), (*data, *files_of(machine)), force=force)

    from olp.files.write import write_files
    from olp.workflows.calibrate_joints import fit_joint_calibration

    with progress(quiet):
        fitted = fit_joint_calibration(data[0], machine, valid_until=valid_until)
    files: dict[Path, bytes] = {} if output is None else fitted.files(output)
    if report_file is not None:
        from olp.workflows.calibrate_report import joint_fit

        files[Path(report_file)] = joint_fit(fitted, report_file, None)
    write_files(files, force=force, inputs=fitted.inputs)
    for path in files:
        diagnostic(f"wrote {path}")
    if output is not None and not quiet:
        note_of_use(machine, output)
    put_result(fitted, as_json=as_json, quiet=quiet)
    exit_for(fitted.findings, fail_on)


def _propose(data: tuple[str, ...], machine: str | None, target: str, *, force: bool) -> None:
    """Write the plan that the files of a folder propose, and say what is asked for."""
    from olp.files.config import load_machine
    from olp.files.measurements.line_profile import WITHOUT_GRAMMAR
    from olp.files.measurements.proposal import propose
    from olp.files.write import write_files

    if len(data) != 1 or not Path(data[0]).is_dir():
        raise UsageError("--propose looks at the files of one folder; name it as DATA")
    if Path(target).absolute().parent.resolve() != Path(data[0]).absolute().resolve():
        raise UsageError(
            f"names of files in a plan are relative to it; expected a file in {data[0]}", file=target
        )
    proposal = propose(Path(data[0]), None if machine is None else load_machine(machine))
    files = {Path(target): proposal.text.encode()}
    files |= {Path(target).parent / name: text.encode() for name, text in proposal.layouts.items()}
    write_files(files, force=force, inputs=files_of(machine))
    for path in files:
        diagnostic(f"wrote {path}")
    for question in proposal.asked:
        diagnostic(f"asked for {question}")
    for name in proposal.unknown:
        format_ = WITHOUT_GRAMMAR.get(Path(name).suffix.lower())
        what = f"it is {format_} by its name, which is not public; export text, and " if format_ else ""
        diagnostic(f"not known: {name}; {what}describe its columns with a profile, and name it in the plan")
