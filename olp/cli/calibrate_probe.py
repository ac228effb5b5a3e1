"""`olp calibrate probe`."""

from __future__ import annotations

import datetime

import click

from olp.cli.common import diagnostic, exit_for, files_of, put_result, refuse_early
from olp.cli.options import (
    day_option,
    fail_on_option,
    force_option,
    json_option,
    machine_option,
    output_option,
    quiet_option,
    units_option,
)
from olp.core.errors import UsageError


@click.command("probe")
@click.argument("artefact", metavar="ARTEFACT.toml")
@machine_option(required=True)
@click.option(
    "--touches", "logs", multiple=True, metavar="LOG",
    help="What the program of a pose wrote; repeat it, one for each pose in order.",
)  # fmt: skip
@output_option("FOLDER", "Write the programs or, with --touches, what olp calibrate fit reads.")
@day_option("Day of measuring, for the plan.")
@json_option()
@units_option
@fail_on_option
@quiet_option("No table.")
@force_option("files in FOLDER")
def command(
    artefact: str,
    machine: str,
    logs: tuple[str, ...],
    output: str | None,
    date: datetime.date | None,
    as_json: bool,
    fail_on: str,
    quiet: bool,
    force: bool,
) -> None:
    """Touch an artefact with the probe of the machine.

    ARTEFACT.toml (olp-artefact-1) states spheres, holes and faces, how the artefact lies, and the probe.
    FOLDER gets a program for each pose: G38.2 for LinuxCNC and Grbl, points for DMIS.

    With --touches the logs of these programs become centres of spheres and holes with their covariances, and
    lines of faces: a source for olp calibrate fit.
    """
    from pathlib import Path

    from olp.files.write import write_files
    from olp.workflows.calibrate_probe import probe_artefact

    if output is not None and not Path(output).is_dir():
        raise UsageError("is not a folder; create it first", file=output)
    probed = probe_artefact(artefact, machine, logs=logs)
    if output is not None:
        inputs = (*probed.inputs, *files_of(machine))
        files = probed.files(output, date)
        refuse_early([str(name) for name in files], inputs, force=force)
        write_files(files, force=force, inputs=inputs)
        diagnostic(f"wrote {len(files)} files to {output}")
    put_result(probed, as_json=as_json, quiet=quiet)
    exit_for(probed.findings, fail_on)
