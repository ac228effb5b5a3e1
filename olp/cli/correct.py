"""`olp correct`."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from olp.cli.common import (
    STREAM,
    Given,
    default_output,
    diagnostic,
    exit_for,
    files_of,
    given,
    options_of,
    put,
    refuse_early,
    refuse_twice,
    takes_colour,
)
from olp.cli.layouts import layout_options, with_layout_of
from olp.cli.options import (
    confidence_options,
    contour_option,
    force_option,
    known_options,
    output_option,
    outside_box_option,
    program_options,
    proof_options,
    quiet_option,
    renamed_option,
    report_option,
)
from olp.cli.progress import Report, progress
from olp.core.errors import ProgramError, UsageError
from olp.core.spool import in_parts
from olp.core.values import dataclass

if TYPE_CHECKING:
    from olp.core.machine import Machine
    from olp.files.write import Content
    from olp.workflows.correct import Correction, CorrectOptions

#: Most that rounding adds to a correction, in um.
LAST_DIGITS_UM = 10.0


@click.command("correct")
@click.argument("program", required=False)
@program_options
@known_options
@output_option("OUT", "Default: PROGRAM.corrected.SUFFIX beside PROGRAM.")
@proof_options
@confidence_options
@outside_box_option("refuse the program", "take the error at the box's face")
@contour_option
@click.option("--split-rapids", is_flag=True, help="Split rapids like feed moves.")
@click.option(
    "--times",
    is_flag=True,
    help="State how long both programs take, as olp retime plans; --report and --review always do, unless "
    "programs are long.",
)
@report_option()
@click.option("--review", "review_file", metavar="review.html", help="Also write the page of olp view.")
@layout_options("Layout of the columns of a list of positions.", "Unit of X, Y and Z in a list.")
@renamed_option("--results", "the verb olp results", flag=True)
@renamed_option("--frame", "an option of olp results")
@renamed_option("--tool", "an option of olp results")
@renamed_option("--tip-radius-mm", "an option of olp results")
@renamed_option("--decimals", "an option of olp results")
@click.option("--diff", "show_diff", is_flag=True, help="Print the changes, line by line.")
@quiet_option("No report and no progress; only the exit code.")
@force_option()
def command(program: str | None, machine: str | None, job: str | None, **words: Any) -> None:
    """Correct a program with the machine's calibrated errors, and prove it.

    PROGRAM and the machine file may come from the job file; the command line has priority. OUT is also
    written where the deviation exceeds the tolerance; the exit code is 1 then.

    For points that a measuring machine reported, use olp results.
    """
    from olp.cli import joints

    if joints.on_joints(machine, job, also=joints.CORRECT):
        joints.correct(program, machine, job, words)
        return
    layout = (words["profile"], words["columns"], words["unit"])
    call = with_layout_of(given(program, machine, job), *layout)
    outputs = options_of(_Outputs, words)
    outputs = replace(
        outputs,
        output=outputs.output or default_output(call.program),
        as_json=outputs.as_json or outputs.report_file == STREAM,
    )
    _refuse(outputs, call.inputs)

    from olp.files.write import write_files
    from olp.workflows import correct

    options = options_of(correct.CorrectOptions, words)
    with progress(outputs.quiet) as show:
        try:
            result = correct.run(call.session, call.source, options, show)
            if outputs.report_file is not None:
                from olp.workflows.correct_time import with_time

                with_time(call.session, call.source, result, options, show)
            written: dict[Path, Content] = {Path(name): result.text for name in files_of(outputs.output)}
            if outputs.review_file is not None:
                written[Path(outputs.review_file)] = _review(call, result, options, outputs, show)
        except ProgramError as error:
            raise error.in_file(call.stream or call.program) from None
        for name in files_of(outputs.report_file):
            written[Path(name)] = _report(call, result, options, name, show)
    write_files(written, force=outputs.force, inputs=call.inputs)
    _say(call, result, outputs, written)
    exit_for(result.findings, outputs.fail_on)


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


def _refuse(outputs: _Outputs, inputs: Iterable[str]) -> None:
    """Raise UsageError for outputs that are impossible or exclude each other."""
    if outputs.review_file == STREAM:
        raise UsageError("--review writes a file and cannot be -; name a file, or use olp view -o -")
    if outputs.as_json and (outputs.output == STREAM or outputs.show_diff):
        raise UsageError("JSON on stdout excludes -o - and --diff; write the report to a file with --report")
    targets = files_of(outputs.output, outputs.report_file, outputs.review_file)
    refuse_early(targets, inputs, force=outputs.force)
    refuse_twice(targets)


def _review(
    call: Given, result: Correction, options: CorrectOptions, outputs: _Outputs, show: Report | None
) -> Iterator[bytes]:
    """The page of --review, in parts."""
    from olp.review import job as review
    from olp.workflows.correct_time import timed

    name = "" if outputs.output == STREAM else outputs.output
    time = timed(result.report["moves"]["total"], asked=options.times)
    viewed = options_of(review.ViewOptions, asdict(options) | {"time": time})
    return review.run(
        call.session, call.source, viewed, correction=result, corrected_name=name, progress=show
    ).parts(progress=show)


def _report(
    call: Given, result: Correction, options: CorrectOptions, name: str, show: Report | None
) -> bytes:
    """The report as a file, on the program that was corrected: unrolled where the call asks for it."""
    from olp.workflows import report

    nominal = call.source.holding(result.nominal)
    return report.correction(result, nominal, call.session, options, name, progress=show)


def _say(call: Given, result: Correction, outputs: _Outputs, written: Iterable[Path]) -> None:
    """Write to stdout and stderr."""
    on_stderr = outputs.output == STREAM
    if on_stderr:
        put(in_parts(result.text))
    if outputs.show_diff:
        put(_diff(result, call.setup.machine, on_stderr), err=on_stderr)
    if outputs.as_json:
        from olp.reports.report import to_json

        put(to_json(result.report))
    elif not outputs.quiet:
        put(result.to_text(), err=on_stderr)
    if not outputs.quiet:
        for path in written:
            diagnostic(f"wrote {path}")


def _diff(result: Correction, machine: Machine, on_stderr: bool) -> str:
    from olp.cli.diff import render
    from olp.program.origin import origin_of
    from olp.program.registry import find
    from olp.program.rs274.profiles.base import Profile

    dialect = find(result.report["program"]["dialect"])
    profile = dialect if isinstance(dialect, Profile) else None
    largest_um = float(result.report.get("largest_correction_um", 0.0))
    origin = origin_of(result.nominal)
    return render(
        result.nominal,
        result.plain,
        near_um=1.1 * largest_um + LAST_DIGITS_UM,
        bare_mm=partial(profile.bare_mm, machine) if profile else None,
        statements=profile is None,
        place=str if origin is None else lambda line: origin.place(origin.line_of(line)),
        colour=takes_colour(sys.stderr if on_stderr else sys.stdout),
    )
