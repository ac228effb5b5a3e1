"""`olp correct`."""

from __future__ import annotations

import datetime
from pathlib import Path

import click

from olp.cli.common import (
    STREAM,
    exit_for,
    needed,
    proof_options,
    put,
    refuse_early,
    setup_options,
    shown,
    source,
    talk,
)
from olp.cli.progress import progress
from olp.exceptions import ProgramError, UsageError


@click.command("correct")
@click.argument("program", required=False)
@setup_options
@click.option("-o", "--output", metavar="OUT", help="Default: PROGRAM.corrected.SUFFIX beside PROGRAM.")
@proof_options
@click.option("--flatten", is_flag=True, help="Write out loops, subprograms and expressions first.")
@click.option("--expand-cycles", is_flag=True, help="Write canned cycles out as plain moves.")
@click.option("--split-rapids", is_flag=True, help="Split rapids like feed moves.")
@click.option("--report", "report_file", metavar="report.json", help="Also write the report as JSON.")
@click.option("--diff", "show_diff", is_flag=True, help="Print the changes, line by line.")
@click.option("-q", "--quiet", is_flag=True, help="No report and no progress; the exit code tells.")
@click.option("--force", is_flag=True, help="Overwrite output files.")
def command(
    program: str | None,
    machine: str | None,
    job: str | None,
    output: str | None,
    tolerance_um: float,
    outside_box: str,
    contour: bool,
    date: datetime.datetime | None,
    as_json: bool,
    fail_on: str,
    flatten: bool,
    expand_cycles: bool,
    split_rapids: bool,
    report_file: str | None,
    show_diff: bool,
    quiet: bool,
    force: bool,
) -> None:
    """Correct a program with the machine's calibrated errors, and prove it.

    PROGRAM and the machine file may come from the job file; what the command line says wins. OUT is written
    also where the proof ends above the tolerance; the exit code is 1 then.
    """
    program, machine = needed(program, machine, job)
    output = output or _default_output(program)
    if output == STREAM and as_json:
        raise UsageError("stdout can take the program or the JSON report; name a file with -o or --report")
    if as_json and show_diff:
        raise UsageError("stdout can take the diff or the JSON report; use one of --diff and --json")
    targets = [name for name in (output, report_file) if name not in (None, STREAM)]
    inputs = [name for name in (program, machine, job) if name not in (None, STREAM)]
    refuse_early(targets, inputs, force=force)

    from olp import api, report
    from olp.files.write import write_files

    given = source(program)
    with progress(quiet) as show:
        try:
            result = api.correct(
                given,
                machine,
                job,
                tolerance_um=tolerance_um,
                outside_box=outside_box,
                flatten=flatten,
                expand_cycles=expand_cycles,
                contour=contour,
                split_rapids=split_rapids,
                date=date.date() if date else None,
                progress=show,
            )
        except ProgramError as error:
            raise error.in_file(shown(program)) from None
    as_bytes = {Path(name): data for name, data in ((output, result.data),) if name != STREAM}
    if report_file is not None and report_file != STREAM:
        as_bytes[Path(report_file)] = report.to_json(result.report)
    write_files(as_bytes, force=force, inputs=inputs)

    to_stderr = output == STREAM
    if to_stderr:
        put(result.data)
    if show_diff:
        put(_diff(given, result, machine, job, err=to_stderr), err=to_stderr)
    if as_json or report_file == STREAM:
        put(report.to_json(result.report))
    elif not quiet:
        put(report.to_text(result.report), err=to_stderr)
    if not quiet:
        for path in as_bytes:
            talk(f"wrote {path}")
    exit_for(result.findings, fail_on)
