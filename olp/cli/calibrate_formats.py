"""`olp calibrate formats`."""

from __future__ import annotations

import click

from olp.cli.common import put
from olp.cli.options import json_option


@click.command("formats")
@json_option("Print the list as JSON.")
def command(as_json: bool) -> None:
    """List the tables and the code of controls: what each holds, how far verified."""
    from olp.files.control_code.registry import CODE
    from olp.files.control_tables.registry import FORMATS
    from olp.reports.report import to_json

    if as_json:
        keys = ("title", "ending", "sense", "status", "holds")
        both = {**FORMATS, **CODE}
        put(to_json({key: {k: getattr(form, k, None) for k in keys} for key, form in both.items()}))
        return
    for key, form in FORMATS.items():
        put(f"{key} ({form.ending})  {form.title}\n")
        put(f"  holds: {form.holds}\n  sign convention: {form.sense or 'to be stated with --sense'}\n")
        put(f"  known from: {form.status}\n")
    for key, code in CODE.items():
        put(f"{key} ({code.ending})  {code.title}\n  holds: {code.holds}\n  known from: {code.status}\n")
