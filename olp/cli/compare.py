"""`olp compare`."""

from __future__ import annotations

import datetime
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
    machine_given,
    options_of,
    put,
    refuse_early,
    refuse_stream,
    refuse_twice,
    report_ending,
    source,
)
from olp.cli.options import (
    Length,
    contour_option,
    date_option,
    fail_on_option,
    force_option,
    json_option,
    output_option,
    quiet_option,
    report_option,
    setup_options,
)
from olp.cli.progress import progress
from olp.core.errors import UsageError

if TYPE_CHECKING:
    from olp.files.point_profile import PointProfile
    from olp.files.sources import Sources
    from olp.files.write import Content
    from olp.workflows.compare import Comparison
    from olp.workflows.session import Session

#: Options that say how files are laid out.
_LAYOUT = ("profile", "columns", "unit", "delimiter", "positions")


@click.command("compare")
@click.argument("nominal")
@click.argument("measured", nargs=-1, required=True)
@setup_options
@click.option("--before", multiple=True, metavar="FILE", help="A run without correction; may be repeated.")
@click.option("--poses", is_flag=True, help="Rows are poses, not places along a path.")
@click.option("--profile", metavar="NAME|FILE", help="How the files are laid out; see --save-profile.")
@click.option(
    "--column", "columns", multiple=True, metavar="X=NAME", help="Column of X, Y, Z, t, name or line."
)
@click.option("--unit", type=click.Choice(["mm", "um", "m", "inch"]), help="Unit of X, Y and Z.")
@click.option(
    "--delimiter", type=click.Choice(["comma", "semicolon", "tab", "space"]), help="What separates columns."
)
@click.option(
    "--positions", type=click.Choice(["tip", "axes"]), help="Places of the tip, or axis positions of a log."
)
@click.option("--save-profile", metavar="FILE.toml", help="Write the layout as a profile for next time.")
@click.option(
    "--align", type=click.Choice(["auto", "none", "fit", "each"]), default="auto", show_default=True,
    help="Best-fit frame: only where points lie far off, never, one for all runs, or one a run.",
)  # fmt: skip
@click.option(
    "--order", type=click.Choice(["forward", "backward", "free"]),
    help="Order of the points along the path; told from them if left out.",
)  # fmt: skip
@click.option(
    "--reach-mm", type=Length(), default=1.0, show_default=True, help="Farther points are in no figure."
)
@click.option("--tolerance-um", type=Length(), help="Exit with 1 where the measured path is farther off.")
@click.option("--add-errors", is_flag=True, help="Move axis positions of a log by the machine's errors.")
@output_option("OUT.csv", "Deviation of every point.")
@click.option(
    "--part-frame", metavar="FILE.toml", help="Work offset from three or more poses, for the job file."
)
@click.option("--frame-name", default="G54", show_default=True, help="Name of that work offset.")
@report_option()
@contour_option
@date_option("measurement")
@json_option()
@fail_on_option
@quiet_option("No report and no progress; the exit code tells.")
@force_option()
def command(
    nominal: str, measured: tuple[str, ...], machine: str | None, job: str | None, **words: Any
) -> None:
    """Hold measured runs against a nominal path.

    NOMINAL is a program (with -m or -j) or a file of points; every MEASURED is one run. Files come from
    trackers, CMMs, logs of a control, or olp simulate.
    """
    from olp.files.sources import Sources

    out = options_of(_Outputs, words)
    session, described = machine_given(machine, job) if machine or job else (None, ())
    sources = Sources() if session is None else session.sources
    inputs = (*files_of(nominal, *measured, *words["before"]), *described)
    _refuse(out, inputs, poses=words["poses"])

    from olp.files.write import write_files
    from olp.reports import compare as report_compare
    from olp.reports.report import to_json
    from olp.workflows import compare

    part_frame = words["frame_name"] if out.part_frame else None
    layout = _layout(measured[0], sources, **{key: words[key] for key in _LAYOUT})
    options = options_of(compare.CompareOptions, words | {"profile": layout, "part_frame": part_frame})
    with progress(out.quiet) as show:
        result = compare.run(sources, session, source(sources, nominal), measured, options, show)
        written = _files(result, out, session, options.date)
        write_files(written, force=out.force, inputs=inputs)
    if out.as_json or out.report_file == STREAM:
        put(to_json(result.report))
    elif not out.quiet:
        put(report_compare.to_text(result.report))
    if not out.quiet:
        for path in written:
            diagnostic(f"wrote {path}")
    exit_for(result.findings, out.fail_on)


@dataclass(frozen=True, slots=True)
class _Outputs:
    """Where the results of a call go."""

    output: str | None
    part_frame: str | None
    save_profile: str | None
    report_file: str | None
    as_json: bool
    fail_on: str
    quiet: bool
    force: bool


def _refuse(out: _Outputs, inputs: Iterable[str], *, poses: bool) -> None:
    """Raise UsageError for outputs that cannot be, or do not go together."""
    refuse_stream(output=out.output, part_frame=out.part_frame, save_profile=out.save_profile)
    targets = files_of(out.output, out.part_frame, out.save_profile, out.report_file)
    refuse_early(targets, inputs, force=out.force)
    refuse_twice(targets)
    if out.part_frame and not poses:
        raise UsageError("--part-frame takes points of a part, a row each; add --poses")
    for name in files_of(out.report_file):
        report_ending(name)
    if out.output and poses:
        raise UsageError("-o writes deviations along a path; poses are in the report")


def _files(
    result: Comparison, out: _Outputs, session: Session | None, date: datetime.date | None
) -> dict[Path, Content]:
    """What the call writes to files, by path."""
    from olp.workflows import report

    written: dict[Path, Content] = {Path(name): result.to_csv() for name in files_of(out.output)}
    if out.part_frame and result.part_frame:
        written[Path(out.part_frame)] = result.part_frame.encode()
    if out.save_profile:
        written[Path(out.save_profile)] = result.profile.to_toml().encode()
    for name in files_of(out.report_file):
        written[Path(name)] = report.comparison(result, session, name, date)
    return written


def _layout(
    first: str, sources: Sources, profile: str | None, columns: tuple[str, ...], **values: str | None
) -> PointProfile | None:
    """The profile that the call asks for, None where files tell their own."""
    from olp.files.point_profile import BUILT_IN, load_profile, with_options
    from olp.files.points import layout_of

    if profile is None and not columns and not any(values.values()):
        return None
    if profile:
        start = load_profile(profile, sources.read)
    else:
        start = layout_of(sources.read(first)) or BUILT_IN["olp"]
    if profile is None and columns and all(item.partition("=")[2].isdigit() for item in columns):
        start = start.model_copy(update={"header": False})
    return with_options(start, columns, **values)
