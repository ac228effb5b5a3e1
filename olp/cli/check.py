"""`olp check`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

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
    source,
)
from olp.cli.endings import show_error
from olp.cli.options import (
    codes,
    confidence_options,
    doubt_options,
    fail_on_option,
    file_option,
    force_option,
    json_option,
    known_options,
    output_option,
    outside_box_option,
    program_options,
    quiet_option,
    tolerance_option,
    turn_tolerance_option,
    units_option,
)
from olp.cli.progress import progress
from olp.core.errors import OlpError, UsageError, naming


@click.command("check")
@click.argument("programs", nargs=-1, metavar="[PROGRAM]...")
@program_options
@known_options
@click.option("--nominal", metavar="NOMINAL", help="The nominal program, where PROGRAM is a corrected one.")
@click.option(
    "--select", multiple=True, callback=codes, metavar="CODES", help="Only these codes, such as OLP4,OLP701."
)
@click.option("--ignore", multiple=True, callback=codes, metavar="CODES", help="All codes but these.")
@fail_on_option
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json", "sarif", "junit"]),
    default="text",
    show_default=True,
    help="SARIF 2.1.0 and JUnit XML are for pipelines.",
)
@json_option("The same as --format json.")
@units_option
@output_option("OUT", "Default: stdout.", default=STREAM)
@doubt_options
@turn_tolerance_option
@tolerance_option
@outside_box_option("an error (OLP405)", "a warning (OLP403) and the error at the face")
@confidence_options
@file_option("--clearances", "FILE.csv", "Also write the clearance of every block as CSV.")
@quiet_option("No report and no progress; only the exit code.")
@force_option("the output file")
def command(programs: tuple[str, ...], machine: str | None, job: str | None, **words: Any) -> None:
    """May this program run on this machine? A gate before deployment.

    A nominal PROGRAM is corrected first, and the result is checked. A corrected PROGRAM is checked unchanged,
    and against NOMINAL where that is given. Several programs are checked one after the other; the exit code
    is the worst of them."""
    if words["as_json"] and words["form"] not in ("text", "json"):
        raise UsageError(f"--json and --format {words['form']} exclude each other; leave one of them out")
    form = "json" if words.pop("as_json") else words.pop("form")
    words |= {"form": form}
    from olp.cli import joints

    if joints.on_joints(machine, job, also=joints.CHECK):

        def one(program: str | None) -> None:
            joints.check(program, machine, job, words)
    else:

        def one(program: str | None) -> None:
            _one(given(program, machine, job), **words)

    if len(programs) < 2:
        one(programs[0] if programs else None)
        return
    alone = {"-o": words["output"] != STREAM, "--clearances": words["clearances"], "--nominal":
             words["nominal"], f"--format {form}": form != "text", "-": STREAM in programs}  # fmt: skip
    for name in (name for name, is_given in alone.items() if is_given):
        raise UsageError(f"{name} is for one program, and {len(programs)} are named; check them one by one")
    _several(programs, one, quiet=words["quiet"])


def _several(programs: Sequence[str], one: Callable[[str], None], *, quiet: bool) -> None:
    """Check all with `one`, also after one that is refused, and end with the worst exit code."""
    worst = 0
    for number, program in enumerate(programs):
        if number and not quiet:
            put("\n")
        try:
            one(program)
        except OlpError as error:
            show_error(str(error))
            worst = max(worst, error.exit_code)
        except click.exceptions.Exit as end:
            worst = max(worst, end.exit_code)
    click.get_current_context().exit(worst)


def _one(
    call: Given,
    nominal: str | None,
    form: str,
    fail_on: str,
    output: str,
    clearances: str | None,
    quiet: bool,
    force: bool,
    **words: Any,
) -> None:
    """Check one program."""
    if nominal == call.program == STREAM:
        raise UsageError("PROGRAM and NOMINAL cannot both come from stdin; name one of the files")
    inputs = (*call.inputs, *files_of(nominal))
    if clearances is not None and not call.setup.job.meshes:
        raise UsageError("--clearances needs meshes; add a table [[meshes]] for each mesh to the job file")
    if clearances == output == STREAM:
        raise UsageError("findings and --clearances cannot both go to stdout; name a file for one of them")
    refuse_early(files_of(output, clearances), inputs, force=force)
    refuse_twice(files_of(output, clearances))

    from olp.files.write import write_files
    from olp.reports.check import FORMATS, to_csv
    from olp.workflows import check, refusals

    options = options_of(check.CheckOptions, words)
    other = None if nominal is None else source(call.session.sources, nominal)
    with progress(quiet or form != "text") as show, naming(call.stream):
        result = check.examined(call.session, call.source, options, nominal=other, progress=show)
    parts = {output: FORMATS[form](result.report, fail_on).encode()}
    if clearances is not None and result.clearances is not None:
        parts[clearances] = to_csv(list(result.rows()))
    write_files({Path(name): parts[name] for name in files_of(*parts)}, force=force, inputs=inputs)
    if STREAM in parts and not (quiet and form == "text" and output == STREAM):
        # text for people is in the coding of the console, the other formats in their own
        put(parts[STREAM].decode() if form == "text" else parts[STREAM])
    if not quiet:
        for name in files_of(*parts):
            diagnostic(f"wrote {name}")
    if result.refused is not None:
        raise refusals.short(result.refused).in_file(call.stream or call.program)
    exit_for(result.findings, fail_on)
