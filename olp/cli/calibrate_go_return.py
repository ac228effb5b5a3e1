"""`olp calibrate go-return`."""

from __future__ import annotations

from typing import Any, cast

import click
import numpy as np

from olp.cli.common import files_of
from olp.cli.instruments import end, ending_options, numbered, plot_kind
from olp.cli.options import Count, Length, file_option, machine_option, output_option, plot_option
from olp.core.errors import UsageError


@click.command("go-return")
@click.argument("data", nargs=-1)
@machine_option("Chain, and travel for --program.")
@output_option("OUT.toml", "Write [backlash] for calibration.toml.")
@plot_option("Draw the reversal along each axis, as FILE-reversal.svg or .png.")
@file_option("--program", "OUT.ngc", "Write the program of the test instead (-m, --axis).")
@click.option("--axis", type=click.Choice(["X", "Y", "Z"]), help="The axis of the program.")
@click.option("--count", type=Count(min=1), default=10, show_default=True, help="Number of targets.")
@click.option("--over-mm", type=Length(), default=2.0, show_default=True, help="Overtravel past each target.")
@click.option("--feed", type=Length(), default=1000.0, show_default=True, help="Feed in mm/min.")
@click.option("--runs", type=Count(min=1), default=5, show_default=True, help="Runs in each direction.")
@ending_options
def command(
    data: tuple[str, ...],
    machine: str | None,
    output: str | None,
    plot: str | None,
    program: str | None,
    axis: str | None,
    count: int,
    over_mm: float,
    feed: float,
    runs: int,
    as_json: bool,
    fail_on: str,
    force: bool,
) -> None:
    """Test B: backlash of each axis, from targets approached from both sides.

    DATA are plans, folders and files as olp calibrate fit takes them; only lines of positioning are used."""
    if program is not None:
        if data or machine is None or axis is None:
            raise UsageError("--program writes the test: give -m and --axis, and no DATA")
        text = _program(machine, axis, count, over_mm, feed, runs)
        end({}, "", {program: text.encode()}, (machine,), (), as_json=False, fail_on=fail_on, force=force)
        return
    if not data:
        raise UsageError("no DATA is given; name the readings, or write the test with --program")

    from olp.calibration.iso230.go_return import backlash_toml, findings_of
    from olp.files.measurements.reader import files_of_measurements
    from olp.reports.outline import outline
    from olp.reports.plots import calibration as plots_calibration
    from olp.workflows.calibrate_go_return import go_return

    kind = plot_kind(plot)
    reversals = go_return(data, machine)
    findings = [finding for reversal in reversals for finding in findings_of(reversal)]
    result: dict[str, Any] = {
        "schema": "olp-go-return-1",
        "axes": [reversal.as_dict() for reversal in reversals],
        "findings": [f.as_dict() for f in findings],
    }
    written = {} if output is None else {output: backlash_toml(reversals).encode()}
    if plot is not None:
        written |= numbered(plot, {"reversal": plots_calibration.reversals(reversals, cast(Any, kind))})
    rows = [
        {"name": a["component"]} | {k: v for k, v in a.items() if k not in ("component", "targets", "file")}
        for a in result["axes"]
    ]
    text = outline({"reversal": rows, "findings": result["findings"]})
    inputs = (*files_of_measurements(data), *files_of(machine))
    end(result, text, written, inputs, findings, as_json=as_json, fail_on=fail_on, force=force)


def _program(machine: str, axis: str, count: int, over_mm: float, feed: float, runs: int) -> str:
    from olp.calibration.iso230.go_return import program
    from olp.workflows.session import Session

    described = Session.start(machine).setup.machine
    low, high = described.axes[axis].travel_mm
    # inside the travel, and in unequal steps: equal ones can hide the pitch of a screw
    targets = np.linspace(low + 2.0 * over_mm, high - 2.0 * over_mm, count)
    step = float(np.diff(targets).mean()) if count > 1 else 0.0
    shift = 0.1 * step * np.sin(2.399963 * np.arange(count)) if count > 2 else np.zeros(count)
    shift[[0, -1]] = 0.0
    return program(
        described, axis, [round(float(v), 3) for v in targets + shift], over_mm=over_mm, feed_mm_min=feed,
        runs=runs,
    )  # fmt: skip
