"""`olp calibrate compare-methods`."""

from __future__ import annotations

from typing import Any, cast

import click

from olp.cli.common import files_of, refuse_early
from olp.cli.instruments import end, ending_options, plot_kind
from olp.cli.options import instrument_options, machine_option, plot_option
from olp.cli.progress import progress


@click.command("compare-methods")
@click.argument("data", nargs=-1, required=True)
@click.option(
    "--check", "points", required=True, metavar="POINTS.csv",
    help="Independent points: commanded axis positions and measured ones, or deviations.",
)  # fmt: skip
@machine_option(required=True)
@instrument_options
@plot_option("Draw the residual of each method, as .svg or .png.")
@ending_options
def command(
    data: tuple[str, ...],
    points: str,
    machine: str,
    sigma_um: float | None,
    reflector: tuple[float, float, float] | None,
    plot: str | None,
    as_json: bool,
    fail_on: str,
    force: bool,
) -> None:
    """Equation (1), the map of two pods and the adjustment, on your own readings.

    DATA are plans (measurements.toml), folders and files as olp calibrate fit takes them. Each method makes a
    calibration of the lines, of the pods, or of both. The report says for each how far it is off at
    independent points, the uncertainty that it states, the time that its readings take, and which one to use.
    """
    from olp.files.measurements.reader import files_of_measurements
    from olp.reports.plots.methods import methods
    from olp.workflows.calibrate_compare_methods import compare_methods

    kind = plot_kind(plot)
    inputs = (*files_of_measurements([*data, points]), *files_of(machine))
    refuse_early(files_of(plot), inputs, force=force)
    with progress(as_json) as tell:
        compared = compare_methods(data, points, machine, sigma_um=sigma_um, tool_mm=reflector, progress=tell)
    result = compared.full_report()
    files: dict[str, bytes] = {}
    if plot is not None:
        noise = result["noise_of_points_um"]
        files[plot] = methods(result["methods"], result["use"], noise, cast(Any, kind))
    end(result, compared.to_text(), files, inputs, (), as_json=as_json, fail_on=fail_on, force=force)
