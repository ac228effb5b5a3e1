"""`olp calibrate import`."""

from __future__ import annotations

import datetime
from typing import TYPE_CHECKING, Any

import click

from olp.cli.common import diagnostic, files_of, refuse_early
from olp.cli.options import Count, day_option, force_option, machine_option, output_option
from olp.core.errors import UsageError

if TYPE_CHECKING:
    from olp.errormodel.calibration import Reference
    from olp.files.control_tables.base import Sense


def axis_names(_: click.Context, __: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
    """`X=AX1` as a mapping; an option's callback."""
    names = {}
    for value in values:
        axis, mark, name = value.partition("=")
        if not mark or axis not in ("X", "Y", "Z") or not name:
            raise UsageError(f"--axis-name {value} is not understood; expected such as --axis-name X=AX1")
        names[axis] = name
    return names


def table_options(function: Any) -> Any:
    """What reading and writing of tables have in common."""
    for option in (
        force_option(),
        click.option("--chain", metavar="FXYZ", help="Axes from workpiece to tool, F the frame; without -m."),
        click.option(
            "--reference", type=click.Choice(["functional-point", "table"]),
            help="Where errors of axes that move the workpiece are stated: at the tool, or on the table.",
        ),
        click.option(
            "--axis-name", "names", multiple=True, metavar="X=NAME", callback=axis_names,
            help="What the control calls an axis, such as X=AX1.",
        ),
        click.option("--comp-type", type=Count(min=0), help="LinuxCNC's COMP_FILE_TYPE."),
        click.option(
            "--sense", type=click.Choice(["error", "correction"]),
            help="error: the control subtracts the values (actual minus commanded); correction: adds them.",
        ),
    ):  # fmt: skip
        function = option(function)
    return function


@click.command("import")
@click.argument("table")
@click.option("--format", "kind", required=True, metavar="FORMAT", help="One of: olp calibrate formats.")
@machine_option("The machine file: its name, chain and travel.")
@output_option("FILE", "The calibration.", default="calibration.toml", show_default=True)
@day_option("When the machine was measured.", "--measured")
@click.option("--axis", type=click.Choice(["X", "Y", "Z"]), help="Axis of a file that names none.")
@table_options
def command(
    table: str,
    kind: str,
    machine: str | None,
    output: str,
    measured: datetime.date | None,
    axis: str | None,
    sense: Sense | None,
    comp_type: int | None,
    names: dict[str, str],
    reference: Reference | None,
    chain: str | None,
    force: bool,
) -> None:
    """Read TABLE, the compensation table of a control, as a calibration.

    The calibration holds the errors that the table corrects, actual minus commanded.
    """
    from olp.files.write import write_files
    from olp.workflows.calibrate_import import import_table

    inputs = files_of(table, machine)
    refuse_early([output], inputs, force=force)
    imported = import_table(
        table, kind, output, machine, sense=sense, measured=measured, axis=axis,
        comp_type=comp_type, axis_names=names, reference=reference, chain=chain,
    )  # fmt: skip
    write_files(imported.files, force=force, inputs=inputs)
    for finding in imported.findings:
        diagnostic(f"{finding.severity.name.lower()}: {finding.code} {finding.message}")
    for note in imported.notes:
        diagnostic(f"note: {note}")
    for path in imported.files:
        diagnostic(f"wrote {path}")
