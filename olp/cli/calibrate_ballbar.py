"""`olp calibrate ballbar`."""

from __future__ import annotations

from typing import Any, cast

import click

from olp.cli.instruments import end, ending_options, numbered, plot_kind
from olp.cli.options import Range, output_option, plot_option


@click.command("ballbar")
@click.argument("files", nargs=-1, required=True)
@output_option("OUT.toml", "Write [[squareness]] for a plan of measurements.")
@click.option(
    "--skip-deg", type=Range(0.0, 30.0), default=2.5, show_default=True,
    help="Leave out readings this near to the reversal of an axis.",
)  # fmt: skip
@plot_option("Draw every circle, as FILE-<plane>.svg or .png.")
@ending_options
def command(
    files: tuple[str, ...],
    output: str | None,
    skip_deg: float,
    plot: str | None,
    as_json: bool,
    fail_on: str,
    force: bool,
) -> None:
    """Squareness, scale and servo mismatch, and backlash from circles of a ball-bar (ISO 230-4).

    FILES are CSV: angle_deg,run,direction,deviation_um, below comments # plane = XY, # radius_mm,
    # centre_mm, # tool_mm. Squareness needs both directions of rotation."""
    from olp.calibration.iso230.ballbar import readings_of
    from olp.calibration.iso230.squareness import readings_toml
    from olp.reports.outline import outline
    from olp.reports.plots import calibration as plots_calibration
    from olp.workflows.calibrate_ballbar import fit_ballbar

    kind = plot_kind(plot)
    fits = fit_ballbar(files, skip_deg=skip_deg)
    findings = [finding for fit in fits for finding in fit.findings]
    result: dict[str, Any] = {
        "schema": "olp-ballbar-1",
        "circles": [fit.as_dict() for fit in fits],
        "findings": [f.as_dict() for f in findings],
    }
    written: dict[str, bytes] = {}
    if output is not None:
        written[output] = readings_toml(readings_of(fits)).encode()
    if plot is not None:
        plots: dict[str, bytes] = {}
        for fit in fits:
            name = fit.circles.plane
            name = name if name not in plots else f"{name}-{len(plots) + 1}"
            plots[name] = plots_calibration.circle(fit, cast(Any, kind))
        written |= numbered(plot, plots)
    text = "\n".join(outline(_shown(circle)) for circle in result["circles"])
    text += outline({"findings": result["findings"]}) if findings else ""
    end(result, text, written, files, findings, as_json=as_json, fail_on=fail_on, force=force)


def _shown(circle: dict[str, Any]) -> dict[str, Any]:
    """A circle as people read it: one column of values, with their units."""
    rows = []
    for row in circle["found"]:
        key = next(k for k in row if k.startswith("value_"))
        unit = key.removeprefix("value_")
        rows.append(
            {
                "name": row["name"],
                "value": row[key],
                "sigma": row[f"sigma_{unit}"],
                "unit": unit.replace("_", "/"),
            }
        )
    return {k: v for k, v in circle.items() if v != []} | {"found": rows}
