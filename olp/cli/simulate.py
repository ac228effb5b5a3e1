"""`olp simulate`."""

from __future__ import annotations

from typing import Any

import click

from olp.cli.common import STREAM, diagnostic, files_of, given, options_of, put, refuse_early
from olp.cli.options import (
    Length,
    doubt_options,
    force_option,
    json_option,
    known_options,
    output_option,
    program_options,
    quiet_option,
)
from olp.cli.progress import progress
from olp.core.errors import UsageError
from olp.findings.rule import Severity


@click.command("simulate")
@click.argument("program", required=False)
@program_options
@known_options
@output_option("measured.csv", "Default: stdout; with --json no points.")
@click.option(
    "--step-mm", type=Length(), default=1.0, show_default=True, help="Distance between points on a move."
)
@doubt_options
@json_option()
@quiet_option("No messages and no progress.")
@force_option("the output file")
def command(
    program: str | None,
    machine: str | None,
    job: str | None,
    output: str | None,
    as_json: bool,
    quiet: bool,
    force: bool,
    **words: Any,
) -> None:
    """Write the path that the machine would take with its errors, as CSV.

    The points are those of the tool tip, in the first work frame of the program.
    """
    if as_json and output == STREAM:
        raise UsageError("stdout takes one result; write the points to a file (-o), or leave --json out")
    from olp.cli import joints

    if joints.on_joints(machine, job):
        shown = {"as_json": as_json, "quiet": quiet, "force": force}
        joints.simulate(program, machine, job, output, words.pop("step_mm"), words | shown)
        return
    call = given(program, machine, job)
    refuse_early(files_of(output), call.inputs, force=force)

    from olp.files.write import write_bytes
    from olp.reports.report import to_json
    from olp.workflows import simulate

    options = options_of(simulate.SimulateOptions, words)
    with progress(quiet) as show:
        result = simulate.run(call.session, call.source, options, show)
    if not quiet:
        for finding in result.findings:
            if finding.severity > Severity.INFO:
                diagnostic(f"olp: warning: {finding.code}: {finding.message}")
    if output not in (None, STREAM):
        with progress(quiet) as show:
            write_bytes(output, result.parts(show), force=force, inputs=call.inputs)
        if not quiet:
            diagnostic(f"wrote {output}: {len(result.points_mm)} points in frame {result.frame}")
    if as_json:
        put(to_json(result.report))
    elif output in (None, STREAM):
        put(result.parts())
