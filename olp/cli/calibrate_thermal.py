"""`olp calibrate thermal`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from olp.cli.common import STREAM, diagnostic, exit_for, files_of, machine_given, put, refuse_early
from olp.cli.options import (
    fail_on_option,
    force_option,
    json_option,
    machine_option,
    output_option,
    units_option,
)
from olp.core.errors import UsageError


@click.command("thermal")
@click.argument("logs", metavar="LOG.csv ...", nargs=-1, required=True)
@machine_option(required=True)
@output_option("thermal.toml", "Where to write the thermal structure. Default: stdout.")
@click.option(
    "--reference-degC", "reference", multiple=True, metavar="[SENSOR=]degC",
    help="Sensor reading at the calibration: one for all, or one each. Default: its temperature_degC.",
)  # fmt: skip
@click.option("--sensor", "sensors", multiple=True, metavar="NAME", help="Take only these sensors.")
@fail_on_option
@json_option()
@units_option
@force_option("the output")
def command(
    logs: tuple[str, ...], machine: str, output: str | None, reference: tuple[str, ...],
    sensors: tuple[str, ...], fail_on: str, as_json: bool, force: bool,
) -> None:  # fmt: skip
    """Identify how the structure of a machine distorts with the temperatures of its sensors.

    A LOG holds columns t_s, NAME_degC for each sensor, and EXX@500_um for each reading of drift (a component
    at an axis position; empty where nothing was read). To test the model, a first fit leaves out the last
    log, or the last quarter of a single log.
    """
    target = None if output in (None, STREAM) else output
    if target is None and as_json:
        raise UsageError("the structure and --json cannot both go to stdout; name a file with -o")
    session, inputs = machine_given(machine, None)
    refuse_early(files_of(target), (*inputs, *logs), force=force)
    from olp.files.write import write_bytes
    from olp.workflows.calibrate_thermal import fit_thermal

    result = fit_thermal(logs, session.setup, reference_degC=_reference(reference), sensors=sensors)
    if target is None:
        put(result.data)
    else:
        write_bytes(target, result.data, force=force, inputs=(*inputs, *logs))
    if as_json:
        from olp.reports.report import to_json

        put(to_json(result.report))
    for line in _shown(result.report):
        diagnostic(line)
    for finding in result.findings:
        diagnostic(f"{finding.severity.name.lower()} {finding.code}: {finding.message}")
    if target is not None:
        diagnostic(f"wrote {Path(target)}")
    exit_for(result.findings, fail_on)


def _reference(stated: tuple[str, ...]) -> float | dict[str, float] | None:
    if not stated:
        return None
    try:
        if len(stated) == 1 and "=" not in stated[0]:
            return float(stated[0])
        return {name: float(value) for name, _, value in (item.partition("=") for item in stated)}
    except ValueError:
        raise UsageError(
            "--reference-degC is not understood; expected a temperature for all sensors, or SENSOR=degC each"
        ) from None


def _shown(report: dict[str, Any]) -> list[str]:
    """The report for people."""
    lines = []
    for s in report["sensors"]:
        low, high = s["range_degC"]
        lag = f"lags by {s['lag_s']:.0f} s" if s["lag_s"] >= 0 else f"leads by {-s['lag_s']:.0f} s"
        lines.append(f"{s['name']}: the structure {lag}, identified from {low:.2f} to {high:.2f} degC")
    for c in report["components"]:
        unit = "urad" if "drift_rms_urad" in c else "um"
        drift, residual = c[f"drift_rms_{unit}"], c[f"left_rms_{unit}"]
        text = f"{c['component']}: drift {drift:.2f} {unit} rms, residual {residual:.2f}"
        if c[f"held_out_left_rms_{unit}"] is not None:
            drift, residual = c[f"held_out_drift_rms_{unit}"], c[f"held_out_left_rms_{unit}"]
            text += f"; held out: {drift:.2f}, residual {residual:.2f}"
        lines.append(text)
    lines.append(f"condition of the sensors {report['condition']:.3g} (refused above 1000)")
    removed = report["held_out_removed_share"]
    if removed is not None:
        lines.append(f"removed where it was not fitted ({report['held_out']}): {removed:.1%}")
    return lines
