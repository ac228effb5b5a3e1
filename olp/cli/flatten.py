"""`olp flatten`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from olp.cli.common import STREAM, diagnostic, files_of, given, options_of, put, refuse_early
from olp.cli.options import cycle_options, force_option, output_option, quiet_option, setup_options
from olp.cli.progress import progress


@click.command("flatten")
@click.argument("program", required=False)
@setup_options
@cycle_options
@output_option("OUT", "Default: stdout.", default=STREAM)
@quiet_option("No messages and no progress.")
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
    from olp.cli import joints

    words |= {"flatten": True}
    if joints.on_joints(machine, job):
        make, inputs = joints.flatten(program, machine, job, words)
    else:
        make, inputs = _of_three(program, machine, job, words, quiet)
    refuse_early(files_of(output), inputs, force=force)

    from olp.files.write import write_bytes

    text = make()
    if output == STREAM:
        put(text)
        return
    write_bytes(output, text, force=force, inputs=inputs)
    if not quiet:
        diagnostic(f"wrote {output}: {len(text.splitlines())} lines")


def _of_three(
    program: str | None, machine: str | None, job: str | None, words: dict[str, Any], quiet: bool
) -> tuple[Callable[[], bytes], tuple[str, ...]]:
    """What unrolls a program for three linear axes, and the files that it reads."""
    call = given(program, machine, job)

    def make() -> bytes:
        from olp.workflows import flatten

        with progress(quiet) as show:
            return flatten.run(call.session, call.source, options_of(flatten.UnrollOptions, words), show)

    return make, call.inputs
