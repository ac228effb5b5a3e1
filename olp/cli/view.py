"""`olp view`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from olp.cli.common import STREAM, diagnostic, files_of, given, options_of, put, refuse_early, source
from olp.cli.options import (
    Count,
    Length,
    confidence_options,
    doubt_options,
    force_option,
    known_options,
    output_option,
    outside_box_option,
    program_options,
    quiet_option,
    tolerance_option,
)
from olp.cli.progress import progress
from olp.core.errors import UsageError, naming

if TYPE_CHECKING:
    from olp.review.job import Review


@click.command("view")
@click.argument("program", required=False)
@program_options
@known_options
@click.option("--corrected", metavar="FILE", help="The corrected program. Default: correct PROGRAM.")
@click.option(
    "--measured", multiple=True, metavar="FILE.csv", help="Measured positions of the tip; may be repeated."
)
@output_option("review.html", "Default: PROGRAM.review.html beside PROGRAM.", page=True)
@click.option(
    "--live", is_flag=True, help="Serve the page on this computer until Ctrl-C, and keep it up to date."
)
@click.option("--port", type=Count(0, 65535), default=0, help="Port of --live. Default: a free one.")
@tolerance_option
@outside_box_option("refuse the program", "take the error at the box's face")
@doubt_options
@confidence_options
@click.option("--no-time", is_flag=True, help="Do not plan the motion; times come from the programmed feed.")
@click.option(
    "--step-mm",
    type=Length(),
    help="Distance between points of the path. Default: about 100,000 points in all.",
)
@quiet_option("No progress and no messages.")
@force_option("the output file")
def command(
    program: str | None,
    machine: str | None,
    job: str | None,
    corrected: str | None,
    measured: tuple[str, ...],
    output: str | None,
    live: bool,
    port: int,
    no_time: bool,
    quiet: bool,
    force: bool,
    **words: Any,
) -> None:
    """Show a job in the browser: nominal, corrected and measured path, their errors enlarged.

    The page is one file that needs no network. PROGRAM and the machine file may come from the job file.
    """
    from olp.cli import joints

    if port and not live:
        raise UsageError("--port is for --live; add --live")
    if STREAM in (corrected, *measured):
        raise UsageError("stdin can be PROGRAM only; name the corrected program and measurements as files")
    if joints.on_joints(machine, job, also=joints.VIEW):
        make, inputs, name = joints.view(program, machine, job, corrected, measured, words, time=not no_time)
    else:
        make, inputs, name = _viewed(program, machine, job, corrected, measured, words, no_time, quiet)
    if live and (output is not None or name == STREAM):
        raise UsageError("--live serves files: leave out -o, and name PROGRAM as a file")
    output = output or _default_output(name)
    if not live:
        refuse_early(files_of(output), inputs, force=force)
    if live:
        _serve(make, inputs, port, quiet)
        return
    page = make()
    with progress(quiet) as show:
        parts = page.parts(progress=show)
    if output == STREAM:
        put(parts)
        return
    from olp.files.write import write_bytes

    write_bytes(output, parts, force=force, inputs=inputs)
    if not quiet:
        diagnostic(
            f"wrote {output}: {len(page.scene.samples)} points, {Path(output).stat().st_size / 1e6:.1f} MB"
        )


def _viewed(
    program: str | None, machine: str | None, job: str | None, corrected: str | None,
    measured: tuple[str, ...], words: dict[str, Any], no_time: bool, quiet: bool,
) -> tuple[Callable[[], Review], tuple[str, ...], str]:  # fmt: skip
    """What makes the page of a machine with three linear axes, its inputs, and the name of the program."""
    calls = [given(program, machine, job)]
    call = calls[0]
    missing = call.setup.machine.missing_limits
    if missing and not no_time and not quiet:
        diagnostic(
            f"note: without {', '.join(missing)} the motion is not planned; times are those of the feed"
        )

    def make() -> Review:
        from olp.review import job as review

        options = options_of(review.ViewOptions, words | {"time": not no_time})
        # files may have changed since the last call
        now = calls.pop() if calls else given(program, machine, job)
        second = None if corrected is None else source(now.session.sources, corrected)
        with progress(quiet) as show, naming(call.stream):
            return review.run(
                now.session, now.source, options, corrected=second, measured=measured, progress=show
            )

    return make, (*call.inputs, *files_of(corrected, *measured)), call.program


def _default_output(program: str) -> str:
    return STREAM if program == STREAM else str(Path(program).with_suffix(".review.html"))


def _serve(make: Callable[[], Review], inputs: tuple[str, ...], port: int, quiet: bool) -> None:
    from olp.review.live import Server

    server = Server(make, inputs, (lambda message: None) if quiet else diagnostic, port)
    try:
        diagnostic(f"serving {server.address} until Ctrl-C")
        server.run()
    except KeyboardInterrupt:
        # the regular end of --live
        diagnostic("ended")
