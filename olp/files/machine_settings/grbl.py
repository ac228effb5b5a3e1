"""Grbl, grblHAL: the answer to `$$`, and to `$#` and `$I` where they are in the same file.

`$110` to `$112` are in mm/min, `$120` to `$122` in mm/s2, `$130` to `$132` in mm, whatever `$13` says: that
is for reports, of which the offsets of `$#` are one. Machine positions run from -travel to 0, whichever end
is home. Where homing sets the origin, an axis that homes to its lower end runs from 0 to its travel. `$22`
bit 3 of grblHAL and the option Z of `$I` in Grbl say so; `$23` says which axes do. `$3` turns motors and
changes no position. grblHAL adds the backlash `$160` to `$162` in mm and the jerk `$800` to `$802` in mm/s3.
Names behind a value, as older versions and some senders write them, are skipped.

Source: the documentation of Grbl 1.1 (settings, build options) and the settings of grblHAL.
"""

from __future__ import annotations

import re
from pathlib import Path

from olp.core.errors import InputError
from olp.core.machine import Vector, WorkOffset
from olp.core.units import AXES, MM_PER_INCH
from olp.files.machine_settings.base import (
    NUMBER,
    SECONDS,
    AxisSettings,
    Load,
    Settings,
    SettingsFormat,
    backlash_note,
    decoded,
    finite,
    interval,
    positive,
    times,
    touched_note,
)

_SETTING = re.compile(r"^[^$\n;#(]{0,20}\$(\d{1,4})\s*=\s*([^\s;(]+)", re.MULTILINE)
_OFFSET = re.compile(rf"\[(G5[4-9](?:\.[1-3])?):({NUMBER}),({NUMBER}),({NUMBER})")
_OPTIONS = re.compile(r"\[OPT:([^,\]]*)")
#: `$22` bit 3 of grblHAL: homing sets the origin.
_SETS_ORIGIN = 8
#: In mm: decimals that Grbl takes.
_LEAST_INCREMENT_MM = 0.001


def _read(path: Path, load: Load) -> Settings:
    text = decoded(load(path))
    stated = _numbers(text, path)
    notes = []
    homing = int(stated.get(22, 0))
    options = _OPTIONS.search(text)
    sets_origin = bool(homing & _SETS_ORIGIN) or (options is not None and "Z" in options[1])
    if not homing & 1:
        notes.append(
            "Homing is off ($22 = 0): machine positions count from where the control was switched on, so "
            "set the work offset each time."
        )
    elif options is None and not sets_origin:
        notes.append(
            "Positions are taken to run from -travel to 0. Grbl built to set its origin at homing (Z in the "
            "answer to $I) runs from 0 up on axes that home downwards: check travel_mm."
        )
    axes = {}
    for k, axis in enumerate(AXES):
        travel = positive(stated.get(130 + k))
        upwards = sets_origin and bool(int(stated.get(23, 0)) >> k & 1)
        low, high = (0.0, travel) if upwards else (None if travel is None else -travel, 0.0)
        axes[axis] = AxisSettings(
            travel_mm=interval(low, high),
            least_increment_mm=_LEAST_INCREMENT_MM,
            velocity_mm_s=times(positive(stated.get(110 + k)), 1.0 / SECONDS),
            acceleration_mm_s2=positive(stated.get(120 + k)),
            jerk_mm_s3=positive(stated.get(800 + k)),
        )
        if steps := positive(stated.get(100 + k)):
            notes.append(
                f"One step of {axis} is {1e3 / steps:.3g} um; the control rounds positions to steps."
            )
        if backlash := positive(stated.get(160 + k)):
            notes.append(backlash_note(axis, f"${160 + k}", backlash))
    offsets = _offsets(text, MM_PER_INCH if stated.get(13) else 1.0)
    if offsets:
        notes.append(touched_note())
    return Settings("", "grbl", axes, work_offsets=offsets, notes=tuple(notes))


def _numbers(text: str, path: Path) -> dict[int, float]:
    """The last value of each setting. Raises InputError for one that is needed and no number."""
    stated: dict[int, float] = {}
    for match in _SETTING.finditer(text):
        number = int(match[1])
        value = finite(match[2])
        if value is not None:
            stated[number] = value
        elif number in (22, 23) or 100 <= number < 170:
            line = text.count("\n", 0, match.start(1)) + 1
            what = f'${number} = "{match[2]}" is not a number'
            raise InputError(f"{what}; expected it as the control prints it", file=str(path), line=line)
    return stated


def _offsets(text: str, mm: float) -> dict[str, WorkOffset]:
    """Those of `$#` that are not all zero, and G54; `mm` is the length of their unit."""
    offsets = {}
    for match in _OFFSET.finditer(text):
        place: Vector = (mm * float(match[2]), mm * float(match[3]), mm * float(match[4]))
        if any(place) or match[1] == "G54":
            offsets[match[1]] = WorkOffset(match[1], offset_mm=place)
    return offsets


def _recognises(text: str) -> bool:
    numbers = {int(match[1]) for match in _SETTING.finditer(text)}
    # Grbl before 0.9 numbers its settings in another way, without these
    return bool(numbers & {110, 111, 112, 130, 131, 132})


FORMAT = SettingsFormat(
    "grbl",
    "the answer of Grbl or grblHAL to $$",
    "documentation of Grbl 1.1 and settings of grblHAL",
    _recognises,
    _read,
)
