"""`olp correct`."""

from __future__ import annotations

import datetime
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from olp.cli.common import (
    STREAM,
    confidence_options,
    exit_for,
    files_of,
    given,
    outside_box_option,
    proof_options,
    put,
    refuse_early,
    refuse_twice,
    report_ending,
    report_option,
    setup_options,
    source,
    talk,
    unroll_options,
)
from olp.cli.layouts import with_layout_of
from olp.cli.progress import progress
from olp.cli.results import Asked, default_output
from olp.cli.results import run as run_results
from olp.core.errors import ProgramError, UsageError

if TYPE_CHECKING:
    from olp.core.machine import Machine
    from olp.files.write import Content
    from olp.workflows.api import Correction

#: What rounding adds to a correction, at most.
LAST_DIGITS_UM = 10.0


@click.command("correct")
@click.argument("program", required=False)
@setup_options
@click.option("-o", "--output", metavar="OUT", help="Default: PROGRAM.corrected.SUFFIX beside PROGRAM.")
@proof_options
@confidence_options
@outside_box_option("refuse the program", "take the error at the box's face")
@unroll_options
@click.option("--split-rapids", is_flag=True, help="Split rapids like feed moves.")
@report_option
@click.option(
    "--review", "review_file", metavar="review.html", help="Also write a page to look at; see olp view."
)
@click.option("--results", is_flag=True, help="PROGRAM holds points that a measuring machine reported.")
@click.option("--profile", metavar="NAME|FILE", help="How a table of points is laid out.")
@click.option("--column", "columns", multiple=True, metavar="X=NAME", help="Column of X, Y, Z, I, J, K, ...")
@click.option("--unit", type=click.Choice(["mm", "um", "m", "inch"]), help="Unit of X, Y and Z in a table.")
@click.option(
    "--frame", "frames", multiple=True, metavar="[NAME=]FRAME",
    help="Work offset that results are stated in, or machine; may be repeated.",
)  # fmt: skip
@click.option(
    "--tool", "tools", multiple=True, metavar="[NAME=]N", help="Stylus of results; may be repeated."
)
@click.option(
    "--tip-radius-mm", type=click.FloatRange(min=0.0), help="Radius of the tip of results, 0 for centres."
)
@click.option("--decimals", type=click.IntRange(0, 12), help="Fewest decimals of corrected results.")
@click.option("--diff", "show_diff", is_flag=True, help="Print the changes, line by line.")
@click.option("-q", "--quiet", is_flag=True, help="No report and no progress; the exit code tells.")
@click.option("--force", is_flag=True, help="Overwrite output files.")
def command(
    program: str | None,
    machine: str | None,
    job: str | None,
    output: str | None,
    tolerance_um: float,
    outside_box: Literal["refuse", "hold"],
    contour: bool,
    within_um: float | None,
    only_sure_components: bool,
    date: datetime.date | None,
    as_json: bool,
    fail_on: str,
    flatten: bool,
    expand_cycles: bool,
    peck_clearance_mm: float | None,
    split_rapids: bool,
    report_file: str | None,
    review_file: str | None,
    results: bool,
    profile: str | None,
    columns: tuple[str, ...],
    unit: str | None,
    frames: tuple[str, ...],
    tools: tuple[str, ...],
    tip_radius_mm: float | None,
    decimals: int | None,
    show_diff: bool,
    quiet: bool,
    force: bool,
) -> None:
    """Correct a program with the machine's calibrated errors, and prove it.

    PROGRAM and the machine file may come from the job file; what the command line says wins. OUT is written
    also where the proof ends above the tolerance; the exit code is 1 then.

    With --results, PROGRAM is a table of points or DMIS output of a measuring machine, and the error is added
    to what it reported.
    """
    if results:
        for name in ("flatten", "expand_cycles", "split_rapids", "contour", "show_diff", "review_file"):
            if click.get_current_context().params[name]:
                raise UsageError(
                    f"--{name.removesuffix('_file').replace('show_', '').replace('_', '-')} is of "
                    "programs and does not go with --results"
                )
        run_results(program, machine, job, Asked(
            profile, columns, unit, frames, tools, tip_radius_mm, decimals, outside_box == "hold",
            date, output, report_file, as_json, fail_on, quiet, force,
        ))  # fmt: skip
        return
    if frames or tools or decimals is not None:
        raise UsageError("--frame, --tool and --decimals are of reported results; add --results")
    call = with_layout_of(given(program, machine, job), profile, columns, unit)
    output = output or default_output(call.program)
    as_json = as_json or report_file == STREAM
    if review_file == STREAM:
        raise UsageError("the page of --review goes to a file; olp view writes one to stdout")
    if as_json and (output == STREAM or show_diff):
        raise UsageError(
            "JSON on stdout goes with neither -o - nor --diff; write the report to a file with --report"
        )
    for name in files_of(report_file):
        report_ending(name)
    outputs = files_of(output, report_file, review_file)
    refuse_early(outputs, call.inputs, force=force)
    refuse_twice(outputs)

    from olp.files.write import write_files
    from olp.reports import report
    from olp.workflows import api

    nominal = source(call.program)
    with progress(quiet) as show:
        try:
            result = api.correct(
                nominal,
                call.setup,
                tolerance_um=tolerance_um,
                outside_box=outside_box,
                flatten=flatten,
                expand_cycles=expand_cycles,
                peck_clearance_mm=peck_clearance_mm,
                contour=contour,
                split_rapids=split_rapids,
                within_um=within_um,
                only_sure_components=only_sure_components,
                date=date,
                progress=show,
            )
            written: dict[Path, Content] = {Path(name): result.data for name in files_of(output)}
            if review_file is not None:
                from olp.review.job import view

                written[Path(review_file)] = view(
                    nominal, call.setup, correction=result, corrected_name="" if output == STREAM else output,
                    tolerance_um=tolerance_um, outside_box=outside_box, contour=contour, flatten=flatten,
                    expand_cycles=expand_cycles, peck_clearance_mm=peck_clearance_mm, within_um=within_um,
                    only_sure_components=only_sure_components, date=date, progress=show,
                ).parts()  # fmt: skip
        except ProgramError as error:
            raise error.in_file("<stdin>" if call.program == STREAM else call.program) from None

    for name in files_of(report_file):
        from olp.workflows import report_files
        from olp.workflows.session import reading, source_of, unrolled

        text, origin = source_of(nominal)
        if flatten or expand_cycles:
            dialect = reading(call.setup, text, origin)[1]
            text = unrolled(text, origin, call.setup, dialect, expand_cycles, peck_clearance_mm)
        filed = report_files.correction(result, text, call.setup, name, date, contour=contour)
        written[Path(name)] = filed
    write_files(written, force=force, inputs=call.inputs)
    on_stderr = output == STREAM
    if on_stderr:
        put(result.data)
    if show_diff:
        put(_diff(nominal, result, call.setup.machine, on_stderr), err=on_stderr)
    if as_json:
        put(report.to_json(result.report))
    elif not quiet:
        put(report.to_text(result.report), err=on_stderr)
    if not quiet:
        for path in written:
            talk(f"wrote {path}")
    exit_for(result.findings, fail_on)


def _diff(nominal: str | bytes, result: Correction, machine: Machine, on_stderr: bool) -> str:
    from olp.cli.diff import render
    from olp.files.write import read_bytes
    from olp.program.registry import find
    from olp.program.rs274.profiles.base import Profile

    dialect = find(result.report["program"]["dialect"])
    profile = dialect if isinstance(dialect, Profile) else None
    largest_um = float(result.report.get("largest_correction_um", 0.0))
    return render(
        nominal if isinstance(nominal, bytes) else read_bytes(nominal),
        result.data,
        near_um=1.1 * largest_um + LAST_DIGITS_UM,
        increments_mm=machine.least_increment_mm if profile and profile.increments_without_point else None,
        statements=profile is None,
        colour=(sys.stderr if on_stderr else sys.stdout).isatty(),
    )
