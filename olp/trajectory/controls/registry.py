"""The profiles of controls, by name."""

from __future__ import annotations

from importlib import import_module

from olp.core.errors import UsageError
from olp.trajectory.controls.base import Control

#: The modules of this package that hold a CONTROL, in the order in which they are listed.
MODULES = ("linuxcnc", "grbl", "sinumerik", "heidenhain", "fanuc")


def _control(module: str) -> Control:
    control: Control = import_module(f"olp.trajectory.controls.{module}").CONTROL
    return control


#: The profiles by name.
CONTROLS: dict[str, Control] = {control.key: control for control in map(_control, MODULES)}


def control_named(key: str) -> Control:
    """The profile of that name. Raises UsageError with the names that exist."""
    if key not in CONTROLS:
        raise UsageError(f'"{key}" is no control with a profile; expected one of {", ".join(CONTROLS)}')
    return CONTROLS[key]
