"""`olp retime`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from olp.cli.common import (
    STREAM,
    diagnostic,
    exit_for,
    files_of,
    given,
    options_of,
    plot_ending,
    put,
    refuse_early,
    refuse_stream,
    refuse_twice,
    silence_stdout,
    source,
)
from olp.cli.options import (
    Length,
    contour_option,
    fail_on_option,
    flatten_option,
    force_option,
    json_option,
    output_option,
    plot_option,
    quiet_option,
    report_option,
    setup_options,
)
from olp.cli.progress import Report, progress
from olp.core.errors import InputError, OlpError, UsageError, naming

if TYPE_CHECKING:
    from olp.files.sources import Sources
    from olp.files.write import Content
    from olp.program.feeds.words import Shared
    from olp.workflows.retime import Format, Retiming

FORMATS = ("csv", "npz", "parquet", "ros", "pvt")


@click.command("retime")
@click.argument("program", required=False)
@setup_options
@output_option("OUT", "The trajectory; - is stdout. Default: the report alone.")
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
@plot_option("Draw the motion and its limits over time, as .svg or .png.")
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
@report_option("report.json", 'Also write the report as JSON.')
@json_option()
@fail_on_option
@quiet_option("No report and no progress.")
@force_option()
def command(program: str | None, machine: str | None, job: str | None, **words: Any) -> None:
    """Re-time a program: every axis inside its limits of velocity, acceleration and jerk.

    OUT has axis positions, velocities and accelerations every --cycle-ms. Where the control moves by itself
    (tool changes, G28, probing) the motion is in several stretches, and OUT becomes OUT-1, OUT-2 ...
    """
    call, out = given(program, machine, job), options_of(_Outputs, words)
    nominal, proof = words["nominal"], words["proof"]
    if call.program == STREAM == nominal:
        raise UsageError("stdin can be one program only; name PROGRAM or NOMINAL as a file")
    _refuse(out)
    inputs = (*call.inputs, *files_of(nominal, proof))
    outputs = files_of(out.output, out.lines, out.slow, out.plot, out.write_feed, out.report_file)
    refuse_early(outputs, inputs, force=out.force)
    refuse_twice(outputs)

    from olp.files.write import write_files
    from olp.workflows import retime

    options = options_of(retime.RetimeOptions, words | {"study_blend": words["blend_study"]})
    sources = call.session.sources
    second = None if nominal is None else source(sources, nominal)
    with progress(out.quiet) as show, naming("<stdin>" if STREAM in (call.program, nominal) else ""):
        result = retime.run(
            call.session, call.source, options, nominal=second,
            proof=None if proof is None else _json(proof, sources), progress=show,
        )  # fmt: skip
        feeds = None if out.write_feed is None else result.with_feeds(out.shared_feed, show)
        written = _files(result, out, feeds, show)
        streamed = _of_one(result, out) if out.output == STREAM else ()
        write_files(written, force=out.force, inputs=inputs)
    if feeds is not None and out.write_feed == STREAM:
        put(feeds)
    if out.output == STREAM:
        _stream(streamed)
    _say(result, out, written)
    exit_for(result.findings, out.fail_on)


@dataclass(frozen=True, slots=True)
class _Outputs:
    """Where the results of a call go."""

    output: str | None
    kind: Format | None
    cycle_ms: float
    stretch: int | None
    lines: str | None
    slow: str | None
    plot: str | None
    plot_span: tuple[float, float] | None
    write_feed: str | None
    shared_feed: Shared
    report_file: str | None
    as_json: bool
    fail_on: str
    quiet: bool
    force: bool

    @property
    def on_stdout(self) -> list[str]:
        return [name for name in (self.output, self.write_feed) if name == STREAM]

    @property
    def cycle_s(self) -> float:
        return self.cycle_ms * 1e-3


def _refuse(out: _Outputs) -> None:
    """Raise UsageError for outputs that do not go together."""
    if len(out.on_stdout) + out.as_json > 1:
        raise UsageError("stdout takes one result; write the others to files (-o, --write-feed, --report)")
    if out.stretch is not None and out.output is None and out.plot is None:
        raise UsageError("--stretch chooses what OUT and the plot take; name one with -o or --plot")
    refuse_stream(lines=out.lines, slow=out.slow, report=out.report_file, plot=out.plot)
    if out.plot is not None:
        plot_ending(out.plot)
    if out.plot_span is not None and out.plot is None:
        raise UsageError("--plot-span says what --plot draws; name a file with --plot")


def _files(
    result: Retiming, out: _Outputs, feeds: bytes | None, show: Report | None
) -> dict[Path, Content]:
    """What the call writes to files, by path."""
    from olp.files import trajectory as tables
    from olp.reports import report

    written: dict[Path, Content] = {}
    if out.output is not None and out.output != STREAM:
        written |= result.files(out.output, out.kind, out.cycle_s, out.stretch, show)
    written |= {Path(name): tables.lines_csv(result.lines) for name in files_of(out.lines)}
    if feeds is not None:
        written |= {Path(name): feeds for name in files_of(out.write_feed)}
    written |= {Path(name): tables.slow_csv(result.slow) for name in files_of(out.slow)}
    if out.plot is not None:
        start, end = out.plot_span or (0.0, None)
        written |= result.plots(out.plot, out.stretch, from_s=start, to_s=end)
    return written | {Path(name): report.to_json(result.report) for name in files_of(out.report_file)}


def _say(result: Retiming, out: _Outputs, written: Iterable[Path]) -> None:
    from olp.reports import report
    from olp.reports import retime as report_time

    if not out.quiet:
        for path in written:
            diagnostic(f"wrote {path}")
    if out.as_json:
        put(report.to_json(result.report))
    elif not out.quiet:
        put(report_time.to_text(result.report), err=bool(out.on_stdout))


def _json(name: str, sources: Sources) -> dict[str, Any]:
    """The mapping in a JSON file. Raises InputError."""
    import json

    try:
        found = json.loads(sources.read(name))
    except ValueError as error:
        raise InputError(f"is no JSON ({error}); expected a report of olp correct", file=name) from None
    return found if isinstance(found, dict) else {}


def _of_one(result: Retiming, out: _Outputs) -> Iterable[bytes]:
    if out.stretch is None and len(result.trajectories) > 1:
        raise UsageError(
            f"the program has {len(result.trajectories)} stretches, and stdout takes one; choose it with "
            "--stretch, or name a file with -o"
        )
    return result.parts(out.kind or "csv", out.cycle_s, out.stretch)


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
