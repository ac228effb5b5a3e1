"""`olp retime`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
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
    source,
)
from olp.cli.options import (
    NUMBER,
    Count,
    Length,
    Range,
    doubt_options,
    fail_on_option,
    file_option,
    force_option,
    json_option,
    output_option,
    plot_option,
    program_options,
    quiet_option,
    report_option,
    units_option,
)
from olp.cli.progress import Report, progress
from olp.core.errors import InputError, UsageError, naming
from olp.core.values import dataclass

if TYPE_CHECKING:
    from olp.files.sources import Sources
    from olp.files.write import Content
    from olp.program.feeds.words import Shared
    from olp.workflows.joints.retime import JointRetiming
    from olp.workflows.retime import Retiming
    from olp.workflows.retime_files import Format

    Planned = Retiming | JointRetiming

#: Formats of a trajectory.
FORMATS = ("csv", "npz", "parquet", "ros", "pvt")


@click.command("retime")
@click.argument("program", required=False)
@program_options
@output_option("OUT", "The trajectory; - is stdout. Default: the report alone.")
@click.option(
    "--format",
    "kind",
    type=click.Choice(FORMATS),
    help="Format of OUT. Default: by its ending (.csv, .npz, .parquet, .json for ROS); csv on stdout.",
)
@click.option("--cycle-ms", type=Length(), default=1.0, show_default=True, help="Time between samples.")
@click.option(
    "--stretch", type=Count(min=1),
    help="Stretch of the motion for OUT and --plot. Default: one file per stretch.",
)  # fmt: skip
@click.option("--blend-mm", type=Length(), help="Path tolerance where the program names none.")
@click.option(
    "--max-inertial-um",
    type=Length(),
    help="Limit accelerations so that the machine deflects by no more than this.",
)
@click.option("--blend-study", is_flag=True, help="Also report time and deviation at other path tolerances.")
@click.option(
    "--feed-override", type=Range(min=0.0, min_open=True, max=200.0), default=100.0, show_default=True,
    metavar="PERCENT", help="The override of feeds at the control; rapids keep their speed.",
)  # fmt: skip
@click.option("--gains", is_flag=True, help="Also list lines on which more tolerance or feed saves most.")
@click.option(
    "--controller",
    metavar="NAME",
    help="Also estimate the time on this control: linuxcnc, grbl, sinumerik, heidenhain or fanuc.",
)
@click.option(
    "--setting", "settings", metavar="NAME=VALUE", multiple=True,
    help="A setting of that control, such as junction_deviation_mm=0.02; may be repeated.",
)  # fmt: skip
@click.option(
    "--log", metavar="run.csv", help="Learn limits and corners from a log of this run on that control."
)
@click.option("--log-profile", metavar="NAME|FILE", help="Layout of the log, as --profile of olp compare.")
@click.option("--nominal", metavar="NOMINAL", help="Compare the times with those of another program.")
@click.option("--proof", metavar="report.json", help="Also show the error budget of a report of olp correct.")
@file_option("--lines", "FILE.csv", "Write time, speed and limit of each line.")
@file_option("--slow", "FILE.csv", "Write where the motion is below half of the feed.")
@plot_option("Draw the motion and its limits over time, as .svg or .png.")
@click.option(
    "--plot-span", type=(NUMBER, NUMBER), metavar="FROM TO", help="Seconds of the motion that --plot draws."
)
@file_option("--write-feed", "FILE", "Write the program with the planned feeds in its F words.")
@click.option(
    "--shared-feed",
    type=click.Choice(["mean", "least"]),
    default="mean",
    show_default=True,
    help="Value of an F word for several blocks: the mean (same total time) or the least planned feed.",
)
@doubt_options
@click.option("--block-delete", is_flag=True, help="Leave / blocks out; they count as executed otherwise.")
@report_option((".json",))
@json_option()
@units_option
@fail_on_option
@quiet_option("No report and no progress.")
@force_option()
def command(program: str | None, machine: str | None, job: str | None, **words: Any) -> None:
    """Re-time a program: every axis inside its limits of velocity, acceleration and jerk.

    OUT has axis positions, velocities and accelerations every --cycle-ms. Moves of the control itself (tool
    changes, G28, probing) divide the motion into stretches, and OUT becomes OUT-1, OUT-2 ...
    """
    from olp.cli import joints

    outputs, nominal = options_of(_Outputs, words), words["nominal"]
    of_joints = joints.on_joints(machine, job, also=joints.RETIME)
    if program == STREAM == nominal:
        raise UsageError("stdin can be one program only; name PROGRAM or NOMINAL as a file")
    _refuse(outputs)
    make: Callable[[Report | None], Planned]
    make, inputs = (joints.retime if of_joints else _of_three)(program, machine, job, words)
    targets = files_of(
        outputs.output, outputs.lines, outputs.slow, outputs.plot, outputs.write_feed, outputs.report_file
    )
    refuse_early(targets, inputs, force=outputs.force)
    refuse_twice(targets)

    from olp.files.write import write_files
    from olp.workflows.retime_files import format_of

    for target in files_of(outputs.output):
        format_of(target, outputs.kind)
    with progress(outputs.quiet) as show, naming("<stdin>" if STREAM in (program, nominal) else ""):
        result = make(show)
        feeds = None if outputs.write_feed is None else result.with_feeds(outputs.shared_feed, show)
        written = _files(result, outputs, feeds, show)
        streamed = _of_one(result, outputs) if outputs.output == STREAM else ()
        write_files(written, force=outputs.force, inputs=inputs)
    if feeds is not None and outputs.write_feed == STREAM:
        put(feeds)
    if outputs.output == STREAM:
        put(streamed)
    _say(result, outputs, written)
    exit_for(result.findings, outputs.fail_on)


def _of_three(
    program: str | None, machine: str | None, job: str | None, words: dict[str, Any]
) -> tuple[Callable[[Report | None], Retiming], tuple[str, ...]]:
    """What plans the motion of three linear axes, and the files that it reads."""
    call, nominal, proof = given(program, machine, job), words["nominal"], words["proof"]
    sources = call.session.sources

    def make(show: Report | None) -> Retiming:
        from olp.workflows import retime

        stated = {"study_blend": words["blend_study"], "settings": _settings(words["settings"])}
        second = None if nominal is None else source(sources, nominal)
        return retime.run(
            call.session, call.source, options_of(retime.RetimeOptions, words | stated), nominal=second,
            proof=None if proof is None else _json(proof, sources), progress=show,
        )  # fmt: skip

    return make, (*call.inputs, *files_of(nominal, proof, words["log"]))


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


def _settings(stated: tuple[str, ...]) -> dict[str, float]:
    """Settings of a control by name. Raises UsageError for what is no number."""
    values = {}
    for item in stated:
        name, _, value = item.partition("=")
        try:
            values[name] = float(value)
        except ValueError:
            raise UsageError(f"--setting {item!r} is not NAME=VALUE with a number") from None
    return values


def _refuse(outputs: _Outputs) -> None:
    """Raise UsageError for outputs that do not go together."""
    if len(outputs.on_stdout) + outputs.as_json > 1:
        raise UsageError("stdout takes one result; write the others to files (-o, --write-feed, --report)")
    if outputs.stretch is not None and outputs.output is None and outputs.plot is None:
        raise UsageError("--stretch is for -o and --plot; add one of them")
    refuse_stream(lines=outputs.lines, slow=outputs.slow, report=outputs.report_file, plot=outputs.plot)
    if outputs.plot is not None:
        plot_ending(outputs.plot)
    if outputs.plot_span is not None and outputs.plot is None:
        raise UsageError("--plot-span is for --plot; name a file with --plot")


def _files(
    result: Planned, outputs: _Outputs, feeds: bytes | None, show: Report | None
) -> dict[Path, Content]:
    """What the call writes to files, by path."""
    from olp.files import trajectory as tables
    from olp.reports import report

    written: dict[Path, Content] = {}
    if outputs.output is not None and outputs.output != STREAM:
        written |= result.files(outputs.output, outputs.kind, outputs.cycle_s, outputs.stretch, show)
    of_lines, of_slow = files_of(outputs.lines), files_of(outputs.slow)
    written |= {Path(n): tables.lines_csv(result.lines, result.origin, result.limits) for n in of_lines}
    if feeds is not None:
        written |= {Path(name): feeds for name in files_of(outputs.write_feed)}
    written |= {Path(n): tables.slow_csv(result.slow, result.origin, result.limits) for n in of_slow}
    if outputs.plot is not None:
        start, end = outputs.plot_span or (0.0, None)
        written |= result.plots(outputs.plot, outputs.stretch, from_s=start, to_s=end)
    return written | {Path(name): report.to_json(result.report) for name in files_of(outputs.report_file)}


def _say(result: Planned, outputs: _Outputs, written: Iterable[Path]) -> None:
    from olp.reports import report

    if not outputs.quiet:
        for path in written:
            diagnostic(f"wrote {path}")
    if outputs.as_json:
        put(report.to_json(result.report))
    elif not outputs.quiet:
        put(result.to_text(), err=bool(outputs.on_stdout))


def _json(name: str, sources: Sources) -> dict[str, Any]:
    """The mapping in a JSON file. Raises InputError."""
    import json

    try:
        values = json.loads(sources.read(name))
    except ValueError as error:
        raise InputError(f"is not JSON ({error}); expected a report of olp correct", file=name) from None
    return values if isinstance(values, dict) else {}


def _of_one(result: Planned, outputs: _Outputs) -> Iterable[bytes]:
    if outputs.stretch is None and len(result.trajectories) > 1:
        raise UsageError(
            f"the program has {len(result.trajectories)} stretches, and stdout takes one; choose it with "
            "--stretch, or name a file with -o"
        )
    return result.parts(outputs.kind or "csv", outputs.cycle_s, outputs.stretch)
