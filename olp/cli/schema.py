"""`olp schema`."""

from __future__ import annotations

import click

from olp.cli.common import STREAM, diagnostic, put
from olp.cli.options import force_option, output_option

#: The kinds of `olp.files.json_schema`, which is loaded late.
_KINDS = (
    *("machine", "calibration", "job", "joint-machine", "joint-calibration"),
    *("joint-measurements", "measurements", "artefact", "points", "dialect"),
)


@click.command("schema")
@click.argument("kind", type=click.Choice(_KINDS))
@output_option("FILE", "Default: stdout.", default=STREAM)
@force_option("the output file")
def command(kind: str, output: str, force: bool) -> None:
    """Write the JSON Schema of a file that people write.

    With it, editors complete and check TOML.
    """
    from olp.files.json_schema import json_schema_text

    text = json_schema_text(kind)
    if output == STREAM:
        put(text)
        return
    from olp.files.write import write_bytes

    write_bytes(output, text.encode(), force=force)
    diagnostic(f"wrote {output}")
