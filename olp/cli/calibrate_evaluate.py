"""`olp calibrate evaluate`."""

from __future__ import annotations

import datetime
from typing import Any, cast

import click

from olp.cli.common import STREAM, files_of, refuse_early
from olp.cli.instruments import end, ending_options, numbered, plot_kind
from olp.cli.options import day_option, machine_option, plot_option, report_option


@click.command("evaluate")
@click.argument("data", nargs=-1, required=True)
@machine_option("Check what the files say of moving tables against its chain.")
@click.option(
    "--zone", type=click.Choice(["least-squares", "minimum-zone"]), default="least-squares",
    show_default=True, help="Reference line of straightness.",
)  # fmt: skip
@report_option()
@plot_option("Draw every line, as FILE-<plot>.svg or .png.")
@day_option("The day of the report.")
@ending_options
def command(
    data: tuple[str, ...],
    machine: str | None,
    zone: str,
    report_file: str | None,
    plot: str | None,
    date: datetime.date | None,
    as_json: bool,
    fail_on: str,
    force: bool,
) -> None:
    """ISO 230-2 figures, cyclic errors, reversal and squareness of measured lines.

    DATA are plans (measurements.toml), folders and files as olp calibrate fit takes them."""
    from olp.files.measurements.reader import files_of_measurements
    from olp.reports import evaluation as report_evaluation
    from olp.workflows import calibrate_report
    from olp.workflows.calibrate_evaluate import evaluate_lines

    kind = plot_kind(plot)
    inputs = (*files_of_measurements(data), *files_of(machine))
    refuse_early(files_of(report_file), inputs, force=force)
    evaluated = evaluate_lines(data, machine, zone=cast(Any, zone))
    result = evaluated.as_dict()
    files: dict[str, bytes] = {}
    if report_file is not None and report_file != STREAM:
        files[report_file] = calibrate_report.evaluation(evaluated, report_file, date)
    if plot is not None:
        files |= numbered(plot, report_evaluation.plots_of(evaluated, cast(Any, kind)))
    text = report_evaluation.to_text(evaluated)
    as_json = as_json or report_file == STREAM
    end(result, text, files, inputs, evaluated.findings, as_json=as_json, fail_on=fail_on, force=force)
