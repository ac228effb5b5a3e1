"""`olp compare`."""

from __future__ import annotations

import datetime
from collections.abc import Iterable
from functools import partial
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
    source,
    sources_of_call,
)
from olp.cli.layouts import layout_options
from olp.cli.options import (
    Length,
    doubt_options,
    fail_on_option,
    file_option,
    force_option,
    json_option,
    output_option,
    part_tolerance_option,
    program_options,
    quiet_option,
    renamed_option,
    report_option,
    units_option,
)
from olp.cli.progress import progress
from olp.core.errors import UsageError
from olp.core.values import dataclass

if TYPE_CHECKING:
    from olp.files.point_profile import PointProfile
    from olp.files.sources import Sources
    from olp.files.write import Content
    from olp.workflows.compare import Comparison
    from olp.workflows.session import Session

#: Options that say how files are laid out.
_LAYOUT = ("profile", "columns", "unit", "delimiter", "positions")
#: Words of a call that go with machines with rotary joints.
_ON_JOINTS = ("measured", "before", "poses", "align", "order", "reach_mm", "part_tolerance_um", "report_file",
              "save_profile", *_LAYOUT[:4])  # fmt: skip


@click.command("compare")
@click.argument("nominal")
@click.argument("measured", nargs=-1, required=True)
@program_options
@click.option("--before", multiple=True, metavar="FILE", help="A run without correction; may be repeated.")
@click.option("--poses", is_flag=True, help="Rows are poses, not points along a path.")
@layout_options(
    "How the files are laid out; see --save-profile.", "Unit of X, Y and Z.",
    "Name or number of the column of X, Y, Z, t, name or line.",
)  # fmt: skip
@click.option(
    "--delimiter", type=click.Choice(["comma", "semicolon", "tab", "space"]), help="Separator of columns."
)
@click.option(
    "--positions", type=click.Choice(["tip", "axes"]), help="Tip positions, or axis positions of a log."
)
@file_option("--save-profile", "FILE.toml", "Write the layout as a profile.")
@click.option(
    "--align", type=click.Choice(["auto", "none", "fit", "each"]), default="auto", show_default=True,
    help="Best-fit frame: only where points lie far off, never, one for all runs, or one per run.",
)  # fmt: skip
@click.option(
    "--order", type=click.Choice(["forward", "backward", "free"]),
    help="Order of the points along the path. Default: detected from them.",
)  # fmt: skip
@click.option(
    "--reach-mm", type=Length(), default=1.0, show_default=True,
    help="Leave points farther from the path out of all figures.",
)  # fmt: skip
@renamed_option("--tolerance-um", "--part-tolerance-um")
@part_tolerance_option("Exit with 1 where the measured path is farther off. Default: the job's.")
@click.option("--add-errors", is_flag=True, help="Add the machine's errors to the axis positions of a log.")
@output_option("OUT.csv", "Deviation of every point.")
@file_option("--part-frame", "FILE.toml", "Write the work offset from three or more poses, for the job file.")
@click.option("--frame-name", default="G54", show_default=True, help="Name of that work offset.")
@report_option()
@partial(doubt_options, of="measurement")
@json_option()
@units_option
@fail_on_option
@quiet_option("No report and no progress; only the exit code.")
@force_option()
def command(
    nominal: str, measured: tuple[str, ...], machine: str | None, job: str | None, **words: Any
) -> None:
    """Compare measured runs with a nominal path.

    NOMINAL is a program (with -m or -j) or a file of points; every MEASURED is one run. Files come from
    trackers, CMMs, logs of a control, or olp simulate.
    """
    from olp.cli import joints

    outputs = options_of(_Outputs, words)
    turning = (machine or job) is not None and joints.on_joints(machine, job, also=_ON_JOINTS)
    if turning:
        session, described = None, tuple(name for name in (machine, job) if name)
    else:
        session, described = machine_given(machine, job) if machine or job else (None, ())
    sources = sources_of_call() if session is None else session.sources
    inputs = (*files_of(nominal, *measured, *words["before"]), *described)
    _refuse(outputs, inputs, poses=words["poses"])

    from olp.files.write import write_files
    from olp.reports.report import to_json
    from olp.workflows import compare

    part_frame = words["frame_name"] if outputs.part_frame else None
    layout = _layout(measured[0], sources, **{key: words[key] for key in _LAYOUT})
    options = options_of(compare.CompareOptions, words | {"profile": layout, "part_frame": part_frame})
    with progress(outputs.quiet) as show:
        if turning:
            result = joints.compare(nominal, measured, machine, job, options)
        else:
            result = compare.run(sources, session, source(sources, nominal), measured, options, show)
        written = _files(result, outputs, session, options.date)
        write_files(written, force=outputs.force, inputs=inputs)
    if outputs.as_json or outputs.report_file == STREAM:
        put(to_json(result.report))
    elif not outputs.quiet:
        put(result.to_text())
    if not outputs.quiet:
        for path in written:
            diagnostic(f"wrote {path}")
    exit_for(result.findings, outputs.fail_on)


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


def _refuse(outputs: _Outputs, inputs: Iterable[str], *, poses: bool) -> None:
    """Raise UsageError for outputs that are impossible or exclude each other."""
    refuse_stream(output=outputs.output, part_frame=outputs.part_frame, save_profile=outputs.save_profile)
    targets = files_of(outputs.output, outputs.part_frame, outputs.save_profile, outputs.report_file)
    refuse_early(targets, inputs, force=outputs.force)
    refuse_twice(targets)
    if outputs.part_frame and not poses:
        raise UsageError("--part-frame takes points of a part, one row per point; add --poses")
    if outputs.output and poses:
        raise UsageError("-o writes deviations along a path, and --poses has none; use --report")


def _files(
    result: Comparison, outputs: _Outputs, session: Session | None, date: datetime.date | None
) -> dict[Path, Content]:
    """What the call writes to files, by path."""
    from olp.workflows import report

    written: dict[Path, Content] = {Path(name): result.to_csv() for name in files_of(outputs.output)}
    if outputs.part_frame and result.part_frame:
        written[Path(outputs.part_frame)] = result.part_frame.encode()
    if outputs.save_profile:
        written[Path(outputs.save_profile)] = result.profile.to_toml().encode()
    for name in files_of(outputs.report_file):
        written[Path(name)] = report.comparison(result, session, name, date)
    return written


def _layout(
    first: str, sources: Sources, profile: str | None, columns: tuple[str, ...], **values: str | None
) -> PointProfile | None:
    """The profile that the call asks for, None where it is detected from the files."""
    from olp.core.schema import copied
    from olp.files.point_profile import BUILT_IN, load_profile, with_options
    from olp.files.points import layout_of

    if profile is None and not columns and not any(values.values()):
        return None
    if profile:
        start = load_profile(profile, sources.read)
    else:
        start = layout_of(sources.read(first)) or BUILT_IN["olp"]
    if profile is None and columns and all(item.partition("=")[2].isdigit() for item in columns):
        start = copied(start, header=False)
    return with_options(start, columns, **values)
