"""`olp calibrate postures`."""

from __future__ import annotations

from typing import Any

import click

from olp.cli.common import files_of
from olp.cli.instruments import end, ending_options
from olp.cli.options import Length, file_option, machine_option
from olp.core.errors import UsageError


@click.command("postures")
@click.argument("file", required=False)
@machine_option("Machine file: its tools, and its calibration, whose errors are removed first.")
@click.option("--reference", metavar="TOOL", help="The tool whose vector is known.")
@file_option("--program", "OUT.ngc", "Write the program of the test instead (--tools, --point).")
@click.option("--tools", metavar="1,2,3", help="Tool numbers of the program.")
@click.option("--point", metavar="X,Y,Z", help="The point, in the active work offset, in mm.")
@click.option("--clearance-mm", type=Length(), default=50.0, show_default=True, help="Retract between tools.")
@click.option("--feed", type=Length(), default=300.0, show_default=True, help="mm/min down to the point.")
@ending_options
def command(
    file: str | None,
    machine: str | None,
    reference: str | None,
    program: str | None,
    tools: str | None,
    point: str | None,
    clearance_mm: float,
    feed: float,
    as_json: bool,
    fail_on: str,
    force: bool,
) -> None:
    """Test A: errors of tool vectors, from one point that the tool holds in several postures.

    FILE is CSV: X_mm,Y_mm,Z_mm,tool[,TX_mm,TY_mm,TZ_mm][,A_deg,B_deg,C_deg], axis positions with the tool
    point on the one point, one row per posture."""
    from olp.calibration.iso230 import postures
    from olp.reports.outline import outline
    from olp.workflows.calibrate_postures import fit_postures

    if program is not None:
        if file is not None or tools is None or point is None:
            raise UsageError("--program writes the test: give --tools and --point, and no FILE")
        text = postures.program(
            [int(v) for v in _numbers(tools, "--tools")], _point(point), clearance_mm=clearance_mm,
            feed_mm_min=feed,
        )  # fmt: skip
        end({}, "", {program: text.encode()}, (), (), as_json=False, fail_on=fail_on, force=force)
        return
    if file is None:
        raise UsageError("no FILE is given; name the readings, or write the test with --program")
    fitted = fit_postures(file, machine, reference=reference)
    findings = list(fitted.findings)
    result: dict[str, Any] = {
        "schema": "olp-postures-1",
        **fitted.as_dict(),
        "findings": [f.as_dict() for f in findings],
    }
    inputs = files_of(file, machine)
    end(result, outline(result), {}, inputs, findings, as_json=as_json, fail_on=fail_on, force=force)


def _numbers(text: str, name: str) -> list[float]:
    try:
        return [float(v) for v in text.split(",")]
    except ValueError:
        raise UsageError(f"{name} {text!r} is not understood; expected numbers between commas") from None


def _point(text: str) -> tuple[float, float, float]:
    values = _numbers(text, "--point")
    if len(values) != 3:
        raise UsageError(f"--point {text!r} is not understood; expected X,Y,Z in mm")
    return values[0], values[1], values[2]
