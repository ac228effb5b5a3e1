"""`olp simulate`."""

from __future__ import annotations

import click

from olp.cli.common import (
    STREAM,
    Length,
    files_of,
    needed,
    put,
    refuse_early,
    setup_options,
    shown,
    source,
    talk,
)
from olp.exceptions import ProgramError


@click.command("simulate")
@click.argument("program", required=False)
@setup_options
@click.option("-o", "--output", metavar="measured.csv", default=STREAM, help="Default: stdout.")
@click.option(
    "--step-mm", type=Length(), default=1.0, show_default=True, help="Distance between points on a move."
)
@click.option("--force", is_flag=True, help="Overwrite the output file.")
def command(
    program: str | None, machine: str | None, job: str | None, output: str, step_mm: float, force: bool
) -> None:
    """Write the path that the machine would really take, as CSV.

    The points are those of the tool tip, in the first work frame of the program.
    """
    program, machine = needed(program, machine, job)
    inputs = files_of(program, machine, job)
    refuse_early(files_of(output), inputs, force=force)

    from olp import api
    from olp.files.write import write_bytes

    try:
        result = api.simulate(source(program), machine, job, step_mm=step_mm)
    except ProgramError as error:
        raise error.in_file(shown(program)) from None
    data = result.to_csv()
    if output == STREAM:
        put(data)
        return
    write_bytes(output, data, force=force, inputs=inputs)
    talk(f"wrote {output}: {len(result.points_mm)} points in frame {result.frame}")
