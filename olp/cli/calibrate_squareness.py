"""`olp calibrate squareness`."""

from __future__ import annotations

from typing import Any

import click

from olp.cli.common import put
from olp.cli.options import json_option, renamed_option
from olp.core.errors import UsageError
from olp.core.units import RAD_PER_URAD


@click.command("squareness")
@click.argument("values", nargs=-1)
@click.option(
    "--from", "convention", metavar="NAME", default="iso", show_default=True,
    help="Convention of VALUES, as listed.",
)  # fmt: skip
@click.option(
    "--drawn-frame", "frames", multiple=True, metavar="NAME=PP,NP,SIDE",
    help="Diagonal that grows in both axes, the other one, and a side of a drawn frame, in mm.",
)  # fmt: skip
@renamed_option("--frame", "--drawn-frame")
@json_option("Print the result as JSON.")
def command(values: tuple[str, ...], convention: str, frames: tuple[str, ...], as_json: bool) -> None:
    """Squareness in the sign conventions of controls and instruments.

    VALUES such as C0Y=12.5 B0Z=-3 are in urad, in the convention of --from. --drawn-frame computes the
    squareness from the lengths of a drawn frame. Without either, the conventions are listed."""
    from olp.calibration.iso230.conventions import CONVENTIONS, angle_words, from_iso, to_iso
    from olp.calibration.iso230.squareness import from_frame
    from olp.reports.outline import outline
    from olp.reports.report import to_json

    given: dict[str, float] = {}
    for item in values:
        name, (value,) = _numbers(item, 1, "C0Y=12.5")
        given[name] = to_iso(name, value * RAD_PER_URAD, convention)
    for item in frames:
        name, (pp, other, side) = _numbers(item, 3, "C0Y=140.4,142.8,99.8")
        to_iso(name, 0.0, "iso")
        spans = ((0.0, side), (0.0, side))
        given[name] = from_frame(name, pp, other, side, line_mm=(0, 0, 0), span_mm=spans).value_rad
    rows: list[dict[str, Any]] = [
        {
            "name": key,
            **{
                f"{name}_urad": from_iso(name, value, key) / RAD_PER_URAD for name, value in given.items()
            },
            "positive": known.says,
        }
        for key, known in CONVENTIONS.items()
    ]  # fmt: skip
    angles = [{"name": name, "angle": angle_words(name, value)} for name, value in given.items()]
    result = {"schema": "olp-squareness-1", "angles": angles, "conventions": rows}
    put(to_json(result) if as_json else outline(result))


def _numbers(item: str, count: int, example: str) -> tuple[str, list[float]]:
    name, _, written = item.partition("=")
    try:
        numbers = [float(v) for v in written.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != count:
        raise UsageError(f"{item!r} is not understood; expected such as {example}")
    return name.strip(), numbers
