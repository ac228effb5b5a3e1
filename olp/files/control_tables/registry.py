"""The formats of compensation tables, by the name that a caller uses."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from olp.core.errors import UsageError
from olp.errormodel.calibration import Calibration
from olp.files.control_tables.base import Exported, Format, Given, Imported, Load
from olp.files.problems import nearest
from olp.files.write import read_bytes

#: the modules of this package that hold a FORMAT, in the order in which formats are listed
MODULES = (
    "isg",
    "etalon",
    "linuxcnc",
    "klipper",
    "siemens",
    "heidenhain",
)


def _format(module: str) -> Format:
    found: Format = import_module(f"olp.files.control_tables.{module}").FORMAT
    return found


FORMATS: dict[str, Format] = {form.key: form for form in map(_format, MODULES)}


def format_named(key: str) -> Format:
    """The format of that name. Raises UsageError with the nearest one."""
    if key not in FORMATS:
        near = nearest(key, FORMATS)
        raise UsageError(
            f'"{key}" is no format of tables; '
            + (f"did you mean {near}?" if near else f"expected one of {', '.join(FORMATS)}")
        )
    return FORMATS[key]


def read_table(path: Path, key: str, given: Given, load: Load = read_bytes) -> Imported:
    """What a table says. `load` gives the bytes of a file. Raises UsageError for what has to be stated, and
    InputError with file and line."""
    return format_named(key).read(path, given, load)


def write_table(calibration: Calibration, key: str, target: Path, given: Given) -> Exported:
    """The files of a table, the table itself named `target`. Raises UsageError for what has to be stated."""
    return format_named(key).write(calibration, target, given)
