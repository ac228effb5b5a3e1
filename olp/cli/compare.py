"""`olp compare`."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from olp.cli.common import (
    STREAM,
    Length,
    contour_option,
    date_option,
    exit_for,
    fail_on_option,
    files_of,
    json_option,
    machine_given,
    put,
    refuse_early,
    refuse_stream,
    refuse_twice,
    report_ending,
    report_option,
    setup_options,
    source,
    talk,
)
from olp.cli.progress import progress
from olp.core.errors import UsageError

if TYPE_CHECKING:
    from olp.comparison.pairing import Order
    from olp.comparison.runs import Align
    from olp.files.point_profile import PointProfile


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
@click.option("-o", "--output", metavar="OUT.csv", help="Deviation of every point.")
@click.option(
    "--part-frame", metavar="FILE.toml", help="Work offset from three or more poses, for the job file."
)
@click.option("--frame-name", default="G54", show_default=True, help="Name of that work offset.")
@report_option
@contour_option
@date_option("measurement")
@json_option
@fail_on_option
@click.option("-q", "--quiet", is_flag=True, help="No report and no progress; the exit code tells.")
@click.option("--force", is_flag=True, help="Overwrite output files.")
def command(
    nominal: str,
    measured: tuple[str, ...],
    machine: str | None,
    job: str | None,
    before: tuple[str, ...],
    poses: bool,
    profile: str | None,
    columns: tuple[str, ...],
    unit: str | None,
    delimiter: str | None,
    positions: str | None,
    save_profile: str | None,
    align: Align,
    order: Order | None,
    reach_mm: float,
    tolerance_um: float | None,
    add_errors: bool,
    output: str | None,
    part_frame: str | None,
    frame_name: str,
    report_file: str | None,
    contour: bool,
    date: datetime.date | None,
    as_json: bool,
    fail_on: str,
    quiet: bool,
    force: bool,
) -> None:
    """Hold measured runs against a nominal path.

    NOMINAL is a program (with -m or -j) or a file of points; every MEASURED is one run. Files come from
    trackers, CMMs, logs of a control, or olp simulate.
    """
    setup, described = machine_given(machine, job) if machine or job else (None, ())
    inputs = (*files_of(nominal, *measured, *before), *described)
    refuse_stream(output=output, part_frame=part_frame, save_profile=save_profile)
    targets = files_of(output, part_frame, save_profile, report_file)
    refuse_early(targets, inputs, force=force)
    refuse_twice(targets)
    if part_frame and not poses:
        raise UsageError("--part-frame takes points of a part, a row each; add --poses")
    for name in files_of(report_file):
        report_ending(name)
    if output and poses:
        raise UsageError("-o writes deviations along a path; poses are in the report")

    from olp.files.write import Content, write_files
    from olp.reports import compare as report_compare
    from olp.reports.report import to_json
    from olp.workflows import report_files
    from olp.workflows.compare import compare

    layout = _layout(profile, columns, measured[0], unit=unit, delimiter=delimiter, positions=positions)
    with progress(quiet) as show:
        result = compare(
            source(nominal), measured, setup, before=before, poses=poses, profile=layout,
            align=align, order=order, reach_mm=reach_mm, tolerance_um=tolerance_um, add_errors=add_errors,
            part_frame=frame_name if part_frame else None, contour=contour, date=date, progress=show,
        )  # fmt: skip
        written: dict[Path, Content] = {Path(name): result.to_csv() for name in files_of(output)}
        if part_frame and result.part_frame:
            written[Path(part_frame)] = result.part_frame.encode()
        if save_profile:
            written[Path(save_profile)] = result.profile.to_toml().encode()
        if report_file and report_file != STREAM:
            written[Path(report_file)] = report_files.comparison(result, setup, report_file, date)
        write_files(written, force=force, inputs=inputs)
    if as_json or report_file == STREAM:
        put(to_json(result.report))
    elif not quiet:
        put(report_compare.to_text(result.report))
    if not quiet:
        for path in written:
            talk(f"wrote {path}")
    exit_for(result.findings, fail_on)


def _layout(
    profile: str | None, columns: tuple[str, ...], first: str, **values: str | None
) -> PointProfile | None:
    """The profile that the call asks for, None where files tell their own."""
    from olp.files.point_profile import BUILT_IN, load_profile, with_options
    from olp.files.points import layout_of
    from olp.files.write import read_bytes

    if profile is None and not columns and not any(values.values()):
        return None
    start = load_profile(profile) if profile else layout_of(read_bytes(first)) or BUILT_IN["olp"]
    if profile is None and columns and all(item.partition("=")[2].isdigit() for item in columns):
        start = start.model_copy(update={"header": False})
    return with_options(start, columns, **values)
