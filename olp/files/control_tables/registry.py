"""The formats of compensation tables, by name."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from olp.core.errors import UsageError
from olp.errormodel.calibration import Calibration
from olp.files.control_tables.base import Exported, Format, Given, Imported, Load
from olp.files.fields import nearest
from olp.files.write import read_bytes

#: The modules of this package that hold a FORMAT, in the order in which formats are listed.
MODULES = (
    "isg",
    "beckhoff",
    "etalon",
    "linuxcnc",
    "klipper",
    "siemens",
    "heidenhain",
)


def _format(module: str) -> Format:
    form: Format = import_module(f"olp.files.control_tables.{module}").FORMAT
    return form


#: The formats by name.
FORMATS: dict[str, Format] = {form.key: form for form in map(_format, MODULES)}


def format_named(key: str) -> Format:
    """The format of that name. Raises UsageError with the nearest name."""
    if key not in FORMATS:
        near = nearest(key, FORMATS)
        raise UsageError(
            f'"{key}" is not a format of tables; '
            + (f"did you mean {near}?" if near else f"expected one of {', '.join(FORMATS)}")
        )
    return FORMATS[key]


def read_table(path: Path, key: str, given: Given, load: Load = read_bytes) -> Imported:
    """The calibration in a table. `load` gives the bytes of a file. Raises UsageError where you have to state
    more, and InputError with file and line."""
    return format_named(key).read(path, given, load)


def write_table(calibration: Calibration, key: str, target: Path, given: Given) -> Exported:
    """The files of a table, the table itself named `target`. Raises UsageError where you have to state
    more."""
    return format_named(key).write(calibration, target, given)
