"""`olp schema`."""

from __future__ import annotations

import click

from olp.cli.common import put


@click.command("schema")
@click.argument(
    "kind", type=click.Choice(["machine", "calibration", "job", "measurements", "points", "dialect"])
)
def command(kind: str) -> None:
    """Print the JSON Schema of a file that people write.

    With it, editors complete and check TOML.
    """
    from olp.files.json_schema import json_schema_text

    put(json_schema_text(kind))
