"""`olp correct`."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from olp.cli.common import (
    STREAM,
    Given,
    diagnostic,
    exit_for,
    files_of,
    given,
    options_of,
    put,
    refuse_early,
    refuse_twice,
    report_ending,
)
from olp.cli.layouts import with_layout_of
from olp.cli.options import (
    confidence_options,
    force_option,
    output_option,
    outside_box_option,
    proof_options,
    quiet_option,
    report_option,
    setup_options,
    unroll_options,
)
from olp.cli.progress import Report, progress
from olp.cli.results import Asked, default_output
from olp.cli.results import run as run_results
from olp.core.errors import ProgramError, UsageError

if TYPE_CHECKING:
    from olp.core.machine import Machine
    from olp.files.write import Content
    from olp.workflows.correct import Correction, CorrectOptions

#: What does not go with --results.
_OF_PROGRAMS = ("flatten", "expand_cycles", "split_rapids", "contour", "show_diff", "review_file")
#: What rounding adds to a correction, at most.
LAST_DIGITS_UM = 10.0


@click.command("correct")
@click.argument("program", required=False)
@setup_options
@output_option("OUT", "Default: PROGRAM.corrected.SUFFIX beside PROGRAM.")
@proof_options
@confidence_options
@outside_box_option("refuse the program", "take the error at the box's face")
@unroll_options
@click.option("--split-rapids", is_flag=True, help="Split rapids like feed moves.")
@report_option()
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
@quiet_option("No report and no progress; the exit code tells.")
@force_option()
def command(program: str | None, machine: str | None, job: str | None, **words: Any) -> None:
    """Correct a program with the machine's calibrated errors, and prove it.

    PROGRAM and the machine file may come from the job file; what the command line says wins. OUT is written
    also where the proof ends above the tolerance; the exit code is 1 then.

    With --results, PROGRAM is a table of points or DMIS output of a measuring machine, and the error is added
    to what it reported.
    """
    if words["results"]:
        for name in _OF_PROGRAMS:
            if words[name]:
                raise UsageError(
                    f"--{name.removesuffix('_file').replace('show_', '').replace('_', '-')} is of "
                    "programs and does not go with --results"
                )
        run_results(program, machine, job, options_of(Asked, words))
        return
    if words["frames"] or words["tools"] or words["decimals"] is not None:
        raise UsageError("--frame, --tool and --decimals are of reported results; add --results")
    layout = (words["profile"], words["columns"], words["unit"])
    call = with_layout_of(given(program, machine, job), *layout)
    out = options_of(_Outputs, words)
    out = replace(
        out,
        output=out.output or default_output(call.program),
        as_json=out.as_json or out.report_file == STREAM,
    )
    _refuse(out, call.inputs)

    from olp.files.write import write_files
    from olp.workflows import correct

    options = options_of(correct.CorrectOptions, words)
    with progress(out.quiet) as show:
        try:
            result = correct.run(call.session, call.source, options, show)
            written: dict[Path, Content] = {Path(name): result.data for name in files_of(out.output)}
            if out.review_file is not None:
                written[Path(out.review_file)] = _review(call, result, options, out, show)
        except ProgramError as error:
            raise error.in_file(call.stream or call.program) from None
    for name in files_of(out.report_file):
        written[Path(name)] = _report(call, result, options, name)
    write_files(written, force=out.force, inputs=call.inputs)
    _say(call, result, out, written)
    exit_for(result.findings, out.fail_on)


@dataclass(frozen=True, slots=True)
class _Outputs:
    """Where the results of a call go."""

    output: str
    report_file: str | None
    review_file: str | None
    show_diff: bool
    as_json: bool
    fail_on: str
    quiet: bool
    force: bool


def _refuse(out: _Outputs, inputs: Iterable[str]) -> None:
    """Raise UsageError for outputs that cannot be, or do not go together."""
    if out.review_file == STREAM:
        raise UsageError("the page of --review goes to a file; olp view writes one to stdout")
    if out.as_json and (out.output == STREAM or out.show_diff):
        raise UsageError(
            "JSON on stdout goes with neither -o - nor --diff; write the report to a file with --report"
        )
    for name in files_of(out.report_file):
        report_ending(name)
    outputs = files_of(out.output, out.report_file, out.review_file)
    refuse_early(outputs, inputs, force=out.force)
    refuse_twice(outputs)


def _review(
    call: Given, result: Correction, options: CorrectOptions, out: _Outputs, show: Report | None
) -> Iterator[bytes]:
    """The page of --review, in parts."""
    from olp.review import job as review

    name = "" if out.output == STREAM else out.output
    viewed = options_of(review.ViewOptions, asdict(options))
    return review.run(
        call.session, call.source, viewed, correction=result, corrected_name=name, progress=show
    ).parts()


def _report(call: Given, result: Correction, options: CorrectOptions, name: str) -> bytes:
    """The report as a file, about the program as it was corrected, unrolled where that was asked for."""
    from olp.workflows import report
    from olp.workflows.flatten import unrolled

    program = call.source
    if options.flatten or options.expand_cycles:
        setup, dialect = call.session.reading(program)
        program = program.holding(unrolled(
            call.session.sources, program, setup, dialect, expand_cycles=options.expand_cycles,
            peck_clearance_mm=options.peck_clearance_mm,
        ))  # fmt: skip
    return report.correction(result, program, call.session, options, name)


def _say(call: Given, result: Correction, out: _Outputs, written: Iterable[Path]) -> None:
    """What goes to stdout and stderr."""
    from olp.reports import report

    on_stderr = out.output == STREAM
    if on_stderr:
        put(result.data)
    if out.show_diff:
        put(_diff(call.source.data, result, call.setup.machine, on_stderr), err=on_stderr)
    if out.as_json:
        put(report.to_json(result.report))
    elif not out.quiet:
        put(report.to_text(result.report), err=on_stderr)
    if not out.quiet:
        for path in written:
            diagnostic(f"wrote {path}")


def _diff(nominal: bytes, result: Correction, machine: Machine, on_stderr: bool) -> str:
    from olp.cli.diff import render
    from olp.program.registry import find
    from olp.program.rs274.profiles.base import Profile

    dialect = find(result.report["program"]["dialect"])
    profile = dialect if isinstance(dialect, Profile) else None
    largest_um = float(result.report.get("largest_correction_um", 0.0))
    return render(
        nominal,
        result.data,
        near_um=1.1 * largest_um + LAST_DIGITS_UM,
        increments_mm=machine.least_increment_mm if profile and profile.increments_without_point else None,
        statements=profile is None,
        colour=(sys.stderr if on_stderr else sys.stdout).isatty(),
    )
