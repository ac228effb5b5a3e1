"""`olp retime`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from olp.cli.common import (
    STREAM,
    Length,
    files_of,
    given,
    put,
    refuse_early,
    setup_options,
    source,
    talk,
)
from olp.cli.progress import progress

if TYPE_CHECKING:
    from olp.retiming import Retiming

FORMATS = ("csv", "npz", "parquet", "ros", "pvt")
_SUFFIX = {".csv": "csv", ".npz": "npz", ".parquet": "parquet", ".json": "ros"}


@click.command("retime")
@click.argument("program", required=False)
@setup_options
@click.option("-o", "--output", metavar="OUT", help="The trajectory; - is stdout. Default: the report alone.")
@click.option(
    "--format",
    "kind",
    type=click.Choice(FORMATS),
    help="Of OUT; default: by its suffix (.csv, .npz, .parquet, .json), else csv.",
)
@click.option("--cycle-ms", type=Length(), default=1.0, show_default=True, help="Time between samples.")
@click.option("--blend-mm", type=Length(), help="Path tolerance where the program names none.")
@click.option("--nominal", metavar="NOMINAL", help="Compare the cycle time with that of another program.")
@click.option("--contour", is_flag=True, help="Take a contour under G41/G42 as the path of the tool.")
@click.option("--json", "as_json", is_flag=True, help="Print the report as JSON.")
@click.option("--force", is_flag=True, help="Overwrite the output file.")
def command(
    program: str | None,
    machine: str | None,
    job: str | None,
    output: str | None,
    kind: str | None,
    cycle_ms: float,
    blend_mm: float | None,
    nominal: str | None,
    contour: bool,
    as_json: bool,
    force: bool,
) -> None:
    """Re-time a program: every axis inside its limits of velocity, acceleration and jerk.

    OUT has axis positions, velocities and accelerations every --cycle-ms.
    """
    call = given(program, machine, job)
    inputs = (*call.inputs, *files_of(nominal))
    refuse_early(files_of(output), inputs, force=force)

    from olp import report, report_time
    from olp.files.write import write_bytes
    from olp.retiming import retime

    with progress(quiet=False) as show:
        result = retime(source(call.program), call.setup, blend_mm=blend_mm, contour=contour, progress=show)
        other = retime(source(nominal), call.setup, blend_mm=blend_mm, contour=contour) if nominal else None
    if other is not None:
        result.report["nominal"] = {"program": nominal, "duration_s": other.duration_s}
    if output is not None:
        chosen = kind or _SUFFIX.get(Path(output).suffix.lower(), "csv")
        data = _written(result, chosen, cycle_ms * 1e-3)
        if output == STREAM:
            put(data if isinstance(data, bytes) else b"".join(data))
        else:
            write_bytes(output, data, force=force, inputs=inputs)
            talk(f"wrote {output}")
    put(
        report.to_json(result.report) if as_json else report_time.to_text(result.report), err=output == STREAM
    )


def _written(result: Retiming, kind: str, cycle_s: float) -> bytes | Iterable[bytes]:
    writers: dict[str, Callable[[float], bytes | Iterable[bytes]]] = {
        "csv": result.to_csv, "npz": result.to_npz, "parquet": result.to_parquet,
        "ros": result.to_ros, "pvt": result.to_pvt,
    }  # fmt: skip
    return writers[kind](cycle_s)
