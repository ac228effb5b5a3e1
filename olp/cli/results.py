"""`olp results`."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from olp.cli.common import (
    STREAM,
    default_output,
    diagnostic,
    exit_for,
    files_of,
    given,
    options_of,
    put,
    refuse_early,
    refuse_twice,
)
from olp.cli.layouts import layout_of, layout_options
from olp.cli.options import (
    Count,
    Range,
    doubt_options,
    fail_on_option,
    force_option,
    json_option,
    output_option,
    outside_box_option,
    quiet_option,
    report_option,
    setup_options,
    units_option,
)
from olp.cli.progress import progress
from olp.core.errors import UsageError
from olp.core.values import dataclass

if TYPE_CHECKING:
    from olp.workflows.session import Outside


@dataclass(frozen=True, slots=True)
class _Asked:
    """The options of the call."""

    profile: str | None
    columns: tuple[str, ...]
    unit: str | None
    frames: tuple[str, ...]
    tools: tuple[str, ...]
    tip_radius_mm: float | None
    decimals: int | None
    outside_box: Outside
    date: datetime.date | None
    accept: tuple[str, ...]
    output: str | None
    report_file: str | None
    as_json: bool
    fail_on: str
    quiet: bool
    force: bool


@click.command("results")
@click.argument("results")
@setup_options
@output_option("OUT", "Default: RESULTS.corrected.SUFFIX beside RESULTS.")
@layout_options("Layout of a table of points.", "Unit of X, Y and Z in a table.")
@click.option(
    "--frame", "frames", multiple=True, metavar="[NAME=]FRAME",
    help="Work offset that the results are stated in, or machine; may be repeated.",
)  # fmt: skip
@click.option("--tool", "tools", multiple=True, metavar="[NAME=]N", help="Stylus; may be repeated.")
@click.option("--tip-radius-mm", type=Range(min=0.0), help="Radius of the tip, 0 for centres.")
@click.option("--decimals", type=Count(0, 12), help="Fewest decimals of corrected results.")
@outside_box_option("refuse the results", "take the error at the box's face")
@doubt_options
@report_option()
@json_option()
@units_option
@fail_on_option
@quiet_option("No report and no progress; only the exit code.")
@force_option()
def command(results: str, machine: str | None, job: str | None, **words: Any) -> None:
    """Correct the points that a measuring machine reported.

    RESULTS is a table of points or DMIS output. The machine's error is added to the reported points, so that
    the corrected results are where the tip really was.
    """
    from olp.cli import joints

    joints.refuse_joints(
        machine, job,
        "a reported point does not state the values of all axes, on which its error depends; correct the "
        "program that measures with olp correct",
    )  # fmt: skip
    asked = options_of(_Asked, words)
    call = given(results, machine, job)
    output = asked.output or default_output(call.program)
    as_json = asked.as_json or asked.report_file == STREAM
    if as_json and output == STREAM:
        raise UsageError("JSON on stdout excludes -o -; write the report to a file with --report")
    inputs = (*call.inputs, *files_of(asked.profile))
    outputs = files_of(output, asked.report_file)
    refuse_early(outputs, inputs, force=asked.force)
    refuse_twice(outputs)

    from olp.files.write import Content, write_files
    from olp.reports import report
    from olp.workflows import results as workflow

    layout = layout_of(asked.profile, asked.columns, asked.unit, call.source, call.session.sources)
    options = workflow.ResultOptions(
        profile=layout, frame=_names("--frame", asked.frames), tool=_numbers(asked.tools),
        tip_radius_mm=asked.tip_radius_mm, decimals=asked.decimals, outside_box=asked.outside_box,
        date=asked.date, accept=asked.accept,
    )  # fmt: skip
    with progress(asked.quiet) as show:
        result = workflow.run(call.session, call.source, options, show)
    written: dict[Path, Content] = {Path(name): result.parts() for name in files_of(output)}
    for name in files_of(asked.report_file):
        from olp.workflows import report as report_files

        written[Path(name)] = report_files.results(result, name, asked.date)
    write_files(written, force=asked.force, inputs=inputs)
    on_stderr = output == STREAM
    if on_stderr:
        put(result.data)
    if as_json:
        put(report.to_json(result.report))
    elif not asked.quiet:
        put(result.to_text(), err=on_stderr)
    if not asked.quiet:
        for path in written:
            diagnostic(f"wrote {path}")
    exit_for(result.findings, asked.fail_on)


def _names(option: str, given: tuple[str, ...]) -> str | dict[str, str] | None:
    """One name for all, or a mapping of names in the file to those of machine and job."""
    if len(given) == 1 and "=" not in given[0]:
        return given[0]
    pairs = [item.partition("=") for item in given]
    wrong = next((item for item, (name, _, value) in zip(given, pairs, strict=True) if not value), None)
    if wrong is not None:
        why = "has nothing after =" if "=" in wrong else "is one of several"
        raise UsageError(f"{option} {wrong} {why}; expected {option} NAME_IN_FILE=NAME for each")
    return {name: value for name, _, value in pairs} or None


def _numbers(given: tuple[str, ...]) -> int | dict[str, int] | None:
    named = _names("--tool", given)
    values = named if isinstance(named, dict) else {"": named or "0"}
    wrong = next((value for value in values.values() if not value.isdigit()), None)
    if wrong is not None:
        raise UsageError(f"--tool {wrong} is not a tool number; expected the number of a table [tools.N]")
    numbers = {name: int(value) for name, value in values.items()}
    return numbers if isinstance(named, dict) else None if named is None else numbers[""]
