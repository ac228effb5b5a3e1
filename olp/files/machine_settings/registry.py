"""The formats of control settings, and which of them a file is in.

A new format is a module of this package with its value, `FORMAT`, and a line in `MODULES`.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from olp.core.errors import InputError
from olp.files.machine_settings.base import Load, Settings, SettingsFormat, decoded, with_notes
from olp.files.write import PathLike, read_bytes

#: The modules of this package that hold a FORMAT, in the order in which formats are listed.
MODULES = (
    "linuxcnc",
    "grbl",
    "klipper",
    "marlin",
    "sinumerik",
    "heidenhain",
)
#: Characters of a text that are searched for signs of a format.
_LOOKED_AT = 1 << 20


def _format(module: str) -> SettingsFormat:
    form: SettingsFormat = import_module(f"olp.files.machine_settings.{module}").FORMAT
    return form


#: The formats by key.
FORMATS: dict[str, SettingsFormat] = {form.key: form for form in map(_format, MODULES)}


def recognised(text: str) -> list[SettingsFormat]:
    """The formats that a text may be in."""
    return [form for form in FORMATS.values() if form.recognises(text[:_LOOKED_AT])]


def read_settings(path: PathLike, load: Load = read_bytes) -> Settings:
    """What the configuration of a control states; its format is detected from its contents. Raises InputError
    where no format or several fit, or the file is wrong."""
    forms = recognised(decoded(load(Path(path))))
    if len(forms) != 1:
        what = "no settings of a control that olp knows are in this file"
        if forms:
            what = f"this file may be {' or '.join(form.title for form in forms)}"
        titles = "; ".join(form.title for form in FORMATS.values())
        raise InputError(f"{what}; expected one of: {titles}", file=str(path))
    return with_notes(forms[0].read(Path(path), load))
