"""`calibrate import`: the compensation table of a control read as a calibration."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from olp.core.errors import UsageError
from olp.core.machine import Setup
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration, Reference
from olp.files.calibration.writer import calibration_files
from olp.files.control_tables.base import Imported, Sense
from olp.files.control_tables.registry import format_named, read_table
from olp.findings.catalogue import Finding
from olp.workflows.control_table import given_of
from olp.workflows.session import PathLike, Session


@dataclass(frozen=True, slots=True, eq=False)
class TableImport:
    """A calibration read from a table, the files that hold it, findings and notes."""

    calibration: Calibration
    files: Mapping[Path, bytes]
    findings: tuple[Finding, ...]
    notes: tuple[str, ...]


def import_table(
    table: PathLike,
    kind: str,
    target: PathLike = "calibration.toml",
    machine: PathLike | Setup | None = None,
    *,
    sense: Sense | None = None,
    measured: datetime.date | None = None,
    axis: str | None = None,
    comp_type: int | None = None,
    axis_names: Mapping[str, str] | None = None,
    reference: Reference | None = None,
    chain: str | None = None,
) -> TableImport:
    """Read the table of a control as a calibration; `kind` names the format, such as "isg".

    The calibration holds the errors of the table, actual minus commanded, whatever the sign convention of the
    format. Its date is `measured`; tables state none. Raises UsageError for what has to be stated, and
    InputError with file and line.
    """
    described = None if machine is None else Session.start(machine).setup.machine
    given = given_of(described, chain, sense, axis, comp_type, axis_names, reference, None)
    if measured is None:
        raise UsageError("a table does not state when the machine was measured; give --measured")
    given = replace(given, measured=measured)
    imported: Imported = read_table(Path(table), kind, given)
    notes = (
        f"Read from {Path(table).name}, a table of the format {format_named(kind).title}.",
        "These are the errors that the table corrects: while it is active, correct only the rest.",
        *imported.notes,
    )
    files = calibration_files(imported.calibration, Path(target), notes=notes)
    return TableImport(imported.calibration, files, imported.findings, imported.notes)
