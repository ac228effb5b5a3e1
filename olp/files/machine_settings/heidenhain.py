"""Heidenhain: numbered machine parameters of TNC 4xx and iTNC 530 as text, such as `MP1010.0: 24000`.

    | number | holds | unit |
    | MP910.x, MP920.x | upper and lower software limit of traverse range 1 | mm, from the machine datum |
    | MP1010.x | rapid traverse | mm/min |
    | MP1060.x | acceleration | m/s2 |
    | MP710.x, MP750.x | backlash that the control takes up, of axes with encoder on motor or scale | mm |
    | MP730 | which axes have a linear (0) or a table (1) compensation | |
    | MP100.0 | letters of the axes of range 1, the first one at the right | |

Index 0 is the first axis. `:`, `=` or blanks stand between number and value. The jerk of these controls is
one of the path (MP1090), no limit of an axis. A TNC 640 has named parameters in a form that no public source
describes: it is not read.

Source: the technical manuals of TNC 407, TNC 426/430 and iTNC 530.
"""

from __future__ import annotations

import re
from pathlib import Path

from olp.core.errors import InputError
from olp.core.units import AXES
from olp.files.machine_settings.base import (
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
)

_LINE = re.compile(r"^[ \t]*MP[ \t]*(\d{2,5})(?:\.(\d{1,2}))?[ \t]*[:= \t][ \t]*([^\s;]+)", re.MULTILINE)
#: In mm: four decimals of a position.
_LEAST_INCREMENT_MM = 0.0001
_MM_PER_M = 1000.0
#: Parameters of axes that are read as numbers.
_READ = frozenset((710, 750, 910, 920, 1010, 1060))

#: Line and text by number and index.
Parameters = dict[tuple[int, int], tuple[int, str]]


def _read(path: Path, load: Load) -> Settings:
    text = decoded(load(path))
    stated: Parameters = {}
    for match in _LINE.finditer(text):
        line = text.count("\n", 0, match.start(1)) + 1
        stated.setdefault((int(match[1]), int(match[2] or 0)), (line, match[3]))
    notes: list[str] = []
    places = _places(stated, notes)
    axes = {}
    for axis in AXES:
        of = _Axis(stated, places[axis], path)
        axes[axis] = AxisSettings(
            travel_mm=interval(of.number(920), of.number(910)),
            least_increment_mm=_LEAST_INCREMENT_MM,
            velocity_mm_s=times(positive(of.number(1010)), 1.0 / SECONDS),
            acceleration_mm_s2=times(positive(of.number(1060)), _MM_PER_M),
        )
        for number in (710, 750):
            if backlash := of.number(number):
                notes.append(backlash_note(axis, f"MP{number}.{places[axis]}", backlash))
    if any(number == 730 and value.strip("%0") for (number, _), (_, value) in stated.items()):
        notes.append(
            "MP730 switches error tables on. List in compensated_by_controller what they correct; olp "
            "calibrate import --format heidenhain reads them."
        )
    return Settings("", "heidenhain", axes, notes=tuple(notes))


class _Axis:
    """The parameters of one axis."""

    def __init__(self, stated: Parameters, place: int, path: Path) -> None:
        self.stated, self.place, self.path = stated, place, path

    def number(self, parameter: int) -> float | None:
        """Its value. Raises InputError where it is no number."""
        if (parameter, self.place) not in self.stated:
            return None
        line, text = self.stated[parameter, self.place]
        value = finite(text)
        if value is None:
            what = f'MP{parameter}.{self.place} = "{text}" is not a number; expected a number'
            raise InputError(what, file=str(self.path), line=line)
        return value


def _places(stated: Parameters, notes: list[str]) -> dict[str, int]:
    """The index of each axis. Without MP100 the first three are taken as X, Y, Z, which a note says."""
    named = stated.get((100, 0), (0, ""))[1].upper()
    letters = named[::-1]
    if all(letters.count(axis) == 1 for axis in AXES):
        return {axis: letters.index(axis) for axis in AXES}
    notes.append("The file names no axes (MP100.0): index 0, 1, 2 as X, Y, Z is assumed; check it.")
    return {axis: k for k, axis in enumerate(AXES)}


def _recognises(text: str) -> bool:
    return len({int(match[1]) for match in _LINE.finditer(text)} & _READ) > 1


FORMAT = SettingsFormat(
    "heidenhain",
    "numbered machine parameters of a TNC 4xx or iTNC 530 (MP910.0 ...)",
    "technical manuals of TNC 407, TNC 426/430 and iTNC 530",
    _recognises,
    _read,
)
