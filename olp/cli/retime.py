"""`olp retime`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from olp.cli.common import (
    STREAM,
    Length,
    contour_option,
    exit_for,
    fail_on_option,
    files_of,
    flatten_option,
    given,
    json_option,
    plot_ending,
    put,
    refuse_early,
    refuse_stream,
    refuse_twice,
    setup_options,
    silence_stdout,
    source,
    talk,
)
from olp.cli.progress import progress
from olp.core.errors import InputError, OlpError, UsageError, naming

if TYPE_CHECKING:
    from olp.files.write import Content
    from olp.program.feeds.words import Shared
    from olp.workflows.retime import Format, Retiming

FORMATS = ("csv", "npz", "parquet", "ros", "pvt")


@click.command("retime")
@click.argument("program", required=False)
@setup_options
@click.option("-o", "--output", metavar="OUT", help="The trajectory; - is stdout. Default: the report alone.")
@click.option(
    "--format",
    "kind",
    type=click.Choice(FORMATS),
    help="Of OUT. Default: by its suffix (.csv, .npz, .parquet, .json for ROS), else csv.",
)
@click.option("--cycle-ms", type=Length(), default=1.0, show_default=True, help="Time between samples.")
@click.option(
    "--stretch", type=click.IntRange(min=1), help="Which stretch OUT and --plot take. Default: a file each."
)
@click.option("--blend-mm", type=Length(), help="Path tolerance where the program names none.")
@click.option(
    "--max-inertial-um",
    type=Length(),
    help="Hold accelerations so low that the machine gives way by no more than this.",
)
@click.option("--blend-study", is_flag=True, help="Time and deviation at other path tolerances too.")
@click.option("--nominal", metavar="NOMINAL", help="Compare the times with those of another program.")
@click.option("--proof", metavar="report.json", help="Set the budget beside that of the correction's report.")
@click.option("--lines", metavar="FILE.csv", help="Write time, speed and limit of each line.")
@click.option("--slow", metavar="FILE.csv", help="Write the places below half of the feed.")
@click.option("--plot", metavar="FILE", help="Draw the motion and its limits over time, as .svg or .png.")
@click.option(
    "--plot-span", type=(float, float), metavar="FROM TO", help="Seconds of the motion that --plot draws."
)
@click.option("--write-feed", metavar="FILE", help="Write the program with the planned feeds in its F words.")
@click.option(
    "--shared-feed",
    type=click.Choice(["mean", "least"]),
    default="mean",
    show_default=True,
    help="What an F word takes that holds for several blocks: the feed that takes as long in all, or "
    "the least planned feed.",
)
@contour_option
@click.option("--block-delete", is_flag=True, help="Leave / blocks out; they count as executed otherwise.")
@flatten_option
@click.option("--report", "report_file", metavar="report.json", help="Also write the report as JSON.")
@json_option
@fail_on_option
@click.option("-q", "--quiet", is_flag=True, help="No report and no progress.")
@click.option("--force", is_flag=True, help="Overwrite output files.")
def command(
    program: str | None,
    machine: str | None,
    job: str | None,
    output: str | None,
    kind: Format | None,
    cycle_ms: float,
    stretch: int | None,
    blend_mm: float | None,
    max_inertial_um: float | None,
    blend_study: bool,
    nominal: str | None,
    proof: str | None,
    lines: str | None,
    slow: str | None,
    plot: str | None,
    plot_span: tuple[float, float] | None,
    write_feed: str | None,
    shared_feed: Shared,
    contour: bool,
    block_delete: bool,
    flatten: bool,
    report_file: str | None,
    as_json: bool,
    fail_on: str,
    quiet: bool,
    force: bool,
) -> None:
    """Re-time a program: every axis inside its limits of velocity, acceleration and jerk.

    OUT has axis positions, velocities and accelerations every --cycle-ms. Where the control moves by itself
    (tool changes, G28, probing) the motion is in several stretches, and OUT becomes OUT-1, OUT-2 ...
    """
    call = given(program, machine, job)
    if call.program == STREAM == nominal:
        raise UsageError("stdin can be one program only; name PROGRAM or NOMINAL as a file")
    on_stdout = [name for name in (output, write_feed) if name == STREAM]
    if len(on_stdout) + as_json > 1:
        raise UsageError("stdout takes one result; write the others to files (-o, --write-feed, --report)")
    if stretch is not None and output is None and plot is None:
        raise UsageError("--stretch chooses what OUT and the plot take; name one with -o or --plot")
    refuse_stream(lines=lines, slow=slow, report=report_file, plot=plot)
    if plot is not None:
        plot_ending(plot)
    if plot_span is not None and plot is None:
        raise UsageError("--plot-span says what --plot draws; name a file with --plot")
    inputs = (*call.inputs, *files_of(nominal, proof))
    outputs = files_of(output, lines, slow, plot, write_feed, report_file)
    refuse_early(outputs, inputs, force=force)
    refuse_twice(outputs)

    from olp.files import trajectory as tables
    from olp.files.write import write_files
    from olp.reports import report
    from olp.reports import retime as report_time
    from olp.workflows.retime import retime

    with progress(quiet) as show, naming("<stdin>" if STREAM in (call.program, nominal) else ""):
        result = retime(
            source(call.program), call.setup, nominal=None if nominal is None else source(nominal),
            proof=None if proof is None else _json(proof),
            blend_mm=blend_mm, study_blend=blend_study,
            max_inertial_um=max_inertial_um, contour=contour, block_delete=block_delete,
            flatten=flatten, progress=show,
        )  # fmt: skip
        feeds = None if write_feed is None else result.with_feeds(shared_feed, show)
        written: dict[Path, Content] = {}
        if output is not None and output != STREAM:
            written |= result.files(output, kind, cycle_ms * 1e-3, stretch, show)
        written |= {Path(name): tables.lines_csv(result.lines) for name in files_of(lines)}
        if feeds is not None:
            written |= {Path(name): feeds for name in files_of(write_feed)}
        written |= {Path(name): tables.slow_csv(result.slow) for name in files_of(slow)}
        if plot is not None:
            start, end = plot_span or (0.0, None)
            written |= result.plots(plot, stretch, from_s=start, to_s=end)
        written |= {Path(name): report.to_json(result.report) for name in files_of(report_file)}
        streamed = _of_one(result, kind, cycle_ms * 1e-3, stretch) if output == STREAM else ()
        write_files(written, force=force, inputs=inputs)
    if feeds is not None and write_feed == STREAM:
        put(feeds)
    if output == STREAM:
        _stream(streamed)
    if not quiet:
        for path in written:
            talk(f"wrote {path}")
    if as_json:
        put(report.to_json(result.report))
    elif not quiet:
        put(report_time.to_text(result.report), err=bool(on_stdout))
    exit_for(result.findings, fail_on)


def _json(name: str) -> dict[str, Any]:
    """The mapping in a JSON file. Raises InputError."""
    import json

    from olp.files.write import read_bytes

    try:
        found = json.loads(read_bytes(name))
    except ValueError as error:
        raise InputError(f"is no JSON ({error}); expected a report of olp correct", file=name) from None
    return found if isinstance(found, dict) else {}


def _of_one(result: Retiming, kind: Format | None, cycle_s: float, stretch: int | None) -> Iterable[bytes]:
    if stretch is None and len(result.trajectories) > 1:
        raise UsageError(
            f"the program has {len(result.trajectories)} stretches, and stdout takes one; choose it with "
            "--stretch, or name a file with -o"
        )
    return result.parts(kind or "csv", cycle_s, stretch)


def _stream(parts: Iterable[bytes]) -> None:
    """Write to stdout part by part. A reader that has gone is no error."""
    import sys

    try:
        for part in parts:
            sys.stdout.buffer.write(part)
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        silence_stdout()
    except OSError as error:
        raise OlpError(f"cannot be written ({error.strerror})", file="<stdout>") from error
