"""`olp calibrate read`."""

from __future__ import annotations

import click

from olp.cli.common import diagnostic, put
from olp.cli.options import json_option


@click.command("read")
@click.argument("file")
@click.option("--profile", metavar="FILE.toml", help="How the file is laid out (olp-line-profile-1).")
@json_option("Print the readings as JSON.")
def command(file: str, profile: str | None, as_json: bool) -> None:
    """Show what the program reads in an instrument's FILE: one row per reading, and what it assumed.

    Without --profile the file is native CSV: target_mm,run,direction,value_um or value_urad.
    """
    from olp.files.measurements.line_profile import load_line_profile, read_line

    readings = read_line(file, None if profile is None else load_line_profile(profile))
    unit, scale = ("urad", 1e6) if readings.angular else ("um", 1e3)
    rows = list(
        zip(readings.line.tolist(), readings.target_mm.tolist(), readings.run.tolist(),
            readings.direction.tolist(), (readings.value * scale).tolist(), strict=True)
    )  # fmt: skip
    if as_json:
        import json

        names = ("line", "target_mm", "run", "direction", f"value_{unit}")
        listed = {
            "file": readings.file,
            "component": readings.component,
            "notes": list(readings.notes),
            "readings": [dict(zip(names, row, strict=True)) for row in rows],
        }
        put(json.dumps(listed, indent=1) + "\n")
        return
    lines = [f"{'line':>6} {'target_mm':>12} {'run':>4} {'dir':>4} {'value_' + unit:>12}\n"]
    lines += [f"{n:6d} {q:12.4f} {run:4d} {sign:+4d} {value:12.3f}\n" for n, q, run, sign, value in rows]
    put("".join(lines))
    runs = len(set(zip(readings.run.tolist(), readings.direction.tolist(), strict=True)))
    span = f"{readings.target_mm.min():g} to {readings.target_mm.max():g} mm"
    stated = "actual minus commanded" if readings.sense_known else "as in the file, the plan must state it"
    component = readings.component or "not stated"
    diagnostic(f"{len(rows)} readings in {runs} one-way runs, {span}; component {component}; sign: {stated}")
    for note in readings.notes:
        diagnostic(f"note: {note}")
