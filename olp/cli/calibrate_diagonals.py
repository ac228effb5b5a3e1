"""`olp calibrate diagonals`."""

from __future__ import annotations

from typing import Any

import click

from olp.cli.instruments import end, ending_options
from olp.cli.options import output_option
from olp.core.errors import UsageError
from olp.core.units import RAD_PER_URAD


@click.command("diagonals")
@click.argument("files", nargs=-1, required=True)
@click.option(
    "--known", multiple=True, metavar="NAME=VALUE,SIGMA",
    help="Result of another instrument: SX, SY, SZ in um/m, C0Y, B0Z, A0Z in urad, with uncertainty.",
)  # fmt: skip
@output_option("OUT.toml", "Write [[squareness]] for a plan of measurements.")
@ending_options
def command(
    files: tuple[str, ...],
    known: tuple[str, ...],
    output: str | None,
    as_json: bool,
    fail_on: str,
    force: bool,
) -> None:
    """Deviations along face and body diagonals (ISO 230-6), and the squareness and scales they determine.

    FILES are CSV: target_mm,run,direction,value_um (the distance from the start), below comments
    # start_mm, # end_mm, # tool_mm, # sense."""
    from olp.calibration.iso230.squareness import readings_toml
    from olp.reports.outline import outline
    from olp.workflows.calibrate_diagonals import fit_diagonals

    fitted = fit_diagonals(files, dict(_known(item) for item in known))
    findings = list(fitted.findings)
    result: dict[str, Any] = {
        "schema": "olp-diagonals-1",
        **fitted.as_dict(),
        "findings": [f.as_dict() for f in findings],
    }
    written = {} if output is None else {output: readings_toml(fitted.readings()).encode()}
    end(
        result,
        outline(_shown(result)),
        written,
        files,
        findings,
        as_json=as_json,
        fail_on=fail_on,
        force=force,
    )


def _shown(result: dict[str, Any]) -> dict[str, Any]:
    """The result as people read it: the main figures, and one column of values."""
    kept = ("name", "length_mm", "elongation_um_m", "sigma_um_m", "E_um", "R_um", "M_um", "B_mean_um")
    values = []
    for row in result["found"]:
        unit = "urad" if "value_urad" in row else "um_m"
        values.append({
            "name": row["name"], "value": row[f"value_{unit}"], "sigma": row[f"sigma_{unit}"],
            "unit": unit.replace("_", "/"),
        })  # fmt: skip
    fitted = {k: result[k] for k in ("chi_square", "degrees_of_freedom") if result["degrees_of_freedom"] > 0}
    return {
        **fitted,
        "diagonals": [{k: row[k] for k in kept if k in row} for row in result["diagonals"]],
        "found": values,
        "not_determined": result["not_determined"],
        "findings": result["findings"],
    }


def _known(item: str) -> tuple[str, tuple[float, float]]:
    name, _, values = item.partition("=")
    try:
        value, sigma = (float(v) * RAD_PER_URAD for v in values.split(","))
    except ValueError:
        expected = "expected a name, a value and its uncertainty, such as SX=12.5,0.5"
        raise UsageError(f"--known {item!r} is not understood; {expected}") from None
    return name.strip(), (value, sigma)
