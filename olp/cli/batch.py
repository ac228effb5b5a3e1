"""`olp batch`."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from olp.cli.common import (
    DIALECT,
    STREAM,
    diagnostic,
    files_of,
    known_errors,
    options_of,
    put,
    refuse_early,
)
from olp.cli.options import (
    Count,
    confidence_options,
    force_option,
    known_options,
    output_option,
    outside_box_option,
    program_options,
    proof_options,
    quiet_option,
    report_option,
)
from olp.cli.progress import progress
from olp.core.errors import UsageError
from olp.core.values import dataclass

if TYPE_CHECKING:
    from olp.workflows.batch import Batch, BatchOptions
    from olp.workflows.batch_find import Where
    from olp.workflows.batch_pool import Opener
    from olp.workflows.batch_task import Page


@click.command("batch")
@click.argument("folders", nargs=-1, metavar="[FOLDER]...")
@program_options
@known_options
@output_option("OUT", "The folder of the corrected programs.", page=True, required=True)
@proof_options
@confidence_options
@outside_box_option("refuse the program", "take the error at the box's face")
@click.option("--split-rapids", is_flag=True, help="Split rapids like feed moves.")
@click.option(
    "--times", is_flag=True, help="State how long the programs take, each and all, as olp retime plans."
)
@click.option("--include", multiple=True, metavar="PATTERN", help="Also files of such names, such as 'O*'.")
@click.option("--exclude", multiple=True, metavar="PATTERN", help="No files of such names or paths.")
@click.option("--keep-going", is_flag=True, help="Go on after a program that is refused.")
@click.option("--workers", type=Count(min=1), metavar="N", help="Processes; default: one for each processor.")
@click.option("--cluster", metavar="ADDRESS", help="Use this Dask cluster, such as tcp://192.168.0.5:8786.")
@click.option(
    "--reports",
    type=click.Choice(["html", "json", "md", "none"]),
    default="html",
    show_default=True,
    help="The form of the report beside each program.",
)
@click.option("--plots", is_flag=True, help="Draw the plots of these reports, which takes longer.")
@click.option("--pages", is_flag=True, help="Also write the page of olp view beside each program.")
@report_option()
@click.option("--watch", is_flag=True, help="Go on, and do again what changes, until you interrupt it.")
@click.option("--release", metavar="NAME", help="Mark what is in OUT as released; no FOLDER is read.")
@click.option(
    "--what-if", "what_if", metavar="calibration.toml",
    help="Say what this calibration changes about all released programs of OUT; nothing is written.",
)  # fmt: skip
@quiet_option("No summary and no progress; only the exit code.")
@force_option("files that olp batch did not write")
def command(folders: tuple[str, ...], output: str, **words: Any) -> None:
    """Correct all programs of folders, and prove each of them.

    OUT keeps the tree of the folders. Job files in the folders name programs and machines; -m is the machine
    of the others, and -j their job. What is unchanged is not done again. The exit code is the largest one of
    all programs.

    With --release or --what-if the programs in OUT are marked or judged, and none is corrected.
    """
    call = options_of(_Call, words)
    _refuse(call, folders, output)
    dialect = click.get_current_context().meta.get(DIALECT)
    if call.release is not None:
        _release(call, output)
    elif call.what_if is not None:
        _what_if(call, output)
    else:
        _correct(call, folders, output, dialect, words)


@dataclass(frozen=True, slots=True)
class _Call:
    """The options of a call that are no options of `correct`."""

    machine: str | None
    job: str | None
    include: tuple[str, ...]
    exclude: tuple[str, ...]
    keep_going: bool
    workers: int | None
    cluster: str | None
    reports: str
    plots: bool
    pages: bool
    report_file: str | None
    watch: bool
    release: str | None
    what_if: str | None
    as_json: bool
    fail_on: str
    quiet: bool
    force: bool
    date: datetime.date | None
    part_tolerance_um: float | None


def _refuse(call: _Call, folders: tuple[str, ...], output: str) -> None:
    """Raise UsageError for options that exclude each other."""
    if output == STREAM:
        raise UsageError("-o is a folder and cannot be -; name a folder")
    asked = {"--watch": call.watch, "--release": call.release, "--what-if": call.what_if}
    given = [name for name, value in asked.items() if value]
    if len(given) > 1:
        raise UsageError(f"{given[0]} and {given[1]} exclude each other; call olp batch once for each")
    if folders and given and not call.watch:
        raise UsageError(
            f"{given[0]} is about what is written in {output}; leave the folders of programs out"
        )
    if given and not call.watch and (call.machine or call.job):
        raise UsageError(
            f"{given[0]} takes machine and job from the history of {output}; leave -m and -j out"
        )
    if call.watch and (call.as_json or call.report_file):
        raise UsageError(
            "--watch goes on, and excludes --json and --report; index.html in OUT is its summary"
        )
    if call.workers is not None and call.cluster is not None:
        raise UsageError("--workers and --cluster exclude each other; leave one of them out")
    if call.plots and call.reports != "html":
        raise UsageError(
            f"--plots goes with --reports html, and not with {call.reports}; leave one of them out"
        )
    refuse_early(files_of(call.report_file), (), force=call.force)


def _correct(
    call: _Call, folders: tuple[str, ...], output: str, dialect: str | None, words: Mapping[str, Any]
) -> None:
    from olp.workflows.batch import BatchOptions, run
    from olp.workflows.batch_find import Where
    from olp.workflows.correct import CorrectOptions

    page: Page | None = None
    if call.pages:
        from olp.review import batch as review

        page = review.Pages()
    options = BatchOptions(
        correct=options_of(CorrectOptions, words), dialect=dialect,
        reports="" if call.reports == "none" else call.reports, plots=call.plots, page=page,
        keep_going=call.keep_going, force=call.force, fail_on=call.fail_on,
    )  # fmt: skip
    where = Where(
        folders=folders, output=output, machine=call.machine, job=call.job,
        known=known_errors(call.machine, call.job), include=call.include, exclude=call.exclude,
    )  # fmt: skip
    if call.watch:
        _watch(call, where, options)
        return
    try:
        with progress(call.quiet) as show:
            result = run(where, options, _opener(call), show)
    except KeyboardInterrupt:
        diagnostic("olp: what is done stays, and the same call goes on")
        raise
    from olp.reports.batch import to_text
    from olp.workflows.batch_report import in_form

    _put(call, result.report, to_text, lambda name: in_form(result.report, Path(name), Path(output)))


def _opener(call: _Call) -> Opener:
    from olp.workflows.batch_pool import opened

    return partial(opened, call.workers, call.cluster)


def _watch(call: _Call, where: Where, options: BatchOptions) -> None:
    """Run until an interrupt, which is the end of the call and no error."""
    from olp.workflows.batch_watch import watch

    def passed(result: Batch) -> None:
        if call.quiet:
            return
        from olp.reports.batch import to_text

        put(to_text(result.report, news=True))
        diagnostic("olp: waiting for changes; end with Ctrl-C")

    try:
        watch(where, options, _opener(call), passed)
    except KeyboardInterrupt:
        diagnostic("olp: ended")


def _release(call: _Call, output: str) -> None:
    from olp.reports import batch_release as texts
    from olp.workflows.batch_release import release

    assert call.release is not None
    report = release(output, call.release, call.date, keep_going=call.keep_going)
    _put(call, report, texts.released, partial(texts.in_form, report))


def _what_if(call: _Call, output: str) -> None:
    from olp.reports import batch_release as texts
    from olp.workflows.batch_release import what_if

    assert call.what_if is not None
    with progress(call.quiet) as show:
        report = what_if(
            output, call.what_if, _opener(call), part_tolerance_um=call.part_tolerance_um, date=call.date,
            progress=show,
        )  # fmt: skip
    _put(call, report, texts.changed, partial(texts.in_form, report))


def _put(
    call: _Call, report: Mapping[str, Any], text: Callable[..., str], form: Callable[[str], bytes]
) -> None:
    """A report on stdout as `text` or as JSON, and in the file of --report in its `form`; the exit code."""
    from olp.files.write import write_files
    from olp.reports.report import to_json

    files = {Path(name): form(name) for name in files_of(call.report_file)}
    write_files(files, force=call.force)
    if call.as_json or call.report_file == STREAM:
        put(to_json(report))
    elif not call.quiet:
        put(text(report))
    for path in () if call.quiet else files:
        diagnostic(f"wrote {path}")
    click.get_current_context().exit(report["exit_code"])
