"""`olp calibrate formats`."""

from __future__ import annotations

import click

from olp.cli.common import put
from olp.cli.options import json_option


@click.command("formats")
@json_option("Print the list as JSON.")
def command(as_json: bool) -> None:
    """List the tables and the code of controls: what each holds, how far verified."""
    from olp.files.control_code.base import CodeFormat
    from olp.files.control_code.registry import CODE
    from olp.files.control_tables.registry import FORMATS
    from olp.files.kinematics.control_kinematics import KinematicTable
    from olp.files.kinematics.tables import TABLES
    from olp.reports.report import to_json

    if as_json:
        keys = ("title", "ending", "sense", "status", "holds")
        every = {**FORMATS, **TABLES, **CODE}
        put(to_json({key: {k: getattr(form, k, None) for k in keys} for key, form in every.items()}))
        return
    for key, form in FORMATS.items():
        put(f"{key} ({form.ending})  {form.title}\n")
        put(f"  holds: {form.holds}\n  sign convention: {form.sense or 'to be stated with --sense'}\n")
        put(f"  known from: {form.status}\n")
    others: list[KinematicTable | CodeFormat] = [*TABLES.values(), *CODE.values()]
    for other in others:
        put(f"{other.key} ({other.ending})  {other.title}\n")
        put(f"  holds: {other.holds}\n  known from: {other.status}\n")
