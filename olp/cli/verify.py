"""`olp verify`."""

from __future__ import annotations

from typing import Any

import click

from olp.cli.common import STREAM, exit_for, given, options_of, put, source
from olp.cli.options import (
    confidence_options,
    known_options,
    outside_box_option,
    program_options,
    proof_options,
    quiet_option,
)
from olp.cli.progress import progress
from olp.core.errors import UsageError


@click.command("verify")
@click.argument("nominal")
@click.argument("corrected")
@program_options
@known_options
@proof_options
@confidence_options
@outside_box_option("refuse the program", "take the error at the box's face", default="hold")
@quiet_option("No report and no progress; only the exit code.")
def command(
    nominal: str, corrected: str, machine: str | None, job: str | None, as_json: bool, fail_on: str,
    quiet: bool, **words: Any,
) -> None:  # fmt: skip
    """Prove a corrected program from the nominal and the corrected text alone.

    CORRECTED may come from any source. It is read, run through the model of the machine's errors, and
    compared with the path of NOMINAL. Where it was corrected with --flatten or --expand-cycles, give the
    same options here.
    """
    if nominal == corrected == STREAM:
        raise UsageError("NOMINAL and CORRECTED cannot both come from stdin; name one of the files")
    from olp.cli import joints

    if joints.on_joints(machine, job):
        shown = {"as_json": as_json, "fail_on": fail_on, "quiet": quiet}
        joints.verify(nominal, corrected, machine, job, words | shown)
        return
    call = given(nominal, machine, job)

    from olp.reports import report
    from olp.workflows import verify

    options = options_of(verify.VerifyOptions, words)
    with progress(quiet or as_json) as show:
        result = verify.run(call.session, call.source, source(call.session.sources, corrected), options, show)
    if as_json:
        put(report.to_json(result.report))
    elif not quiet:
        put(result.to_text())
    exit_for(result.findings, fail_on)
