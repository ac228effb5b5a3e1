"""`olp flatten`."""

from __future__ import annotations

from typing import Any

import click

from olp.cli.common import STREAM, diagnostic, files_of, given, options_of, put, refuse_early
from olp.cli.options import cycle_options, force_option, output_option, quiet_option, setup_options


@click.command("flatten")
@click.argument("program", required=False)
@setup_options
@cycle_options
@output_option("OUT", "Default: stdout.", default=STREAM)
@quiet_option("No messages.")
@force_option("the output file")
def command(
    program: str | None,
    machine: str | None,
    job: str | None,
    output: str,
    quiet: bool,
    force: bool,
    **words: Any,
) -> None:
    """Write a program with its loops, subprograms and expressions unrolled, for the same control.

    It is the text that --flatten of the other verbs reads. Nothing is corrected.
    """
    call = given(program, machine, job)
    refuse_early(files_of(output), call.inputs, force=force)

    from olp.files.write import write_bytes
    from olp.workflows import flatten

    options = options_of(flatten.UnrollOptions, words | {"flatten": True})
    text = flatten.run(call.session, call.source, options)
    if output == STREAM:
        put(text)
        return
    write_bytes(output, text, force=force, inputs=call.inputs)
    if not quiet:
        diagnostic(f"wrote {output}: {len(text.splitlines())} lines")
