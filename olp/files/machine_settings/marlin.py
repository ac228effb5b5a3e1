"""Marlin: the answer to `M503`, and to `M211` where it is in the same file.

`M203` are velocities in mm/s, `M201` accelerations in mm/s2; after `G20` they are in inches. X, Y, Z of
`M205` are speeds that the control may jump by, no jerk in mm/s3. `M852` are skew factors and `M425` is
backlash: the firmware corrects them. `M503` states no travel; the answer to `M211` does (`Min: ... Max:
...`), in mm whatever the unit.

Source: the documentation of Marlin 2 (G-codes M201, M203, M205, M211, M425, M503, M852).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from olp.core.machine import SQUARENESS
from olp.core.units import AXES, MM_PER_INCH
from olp.files.machine_settings.base import (
    BED,
    AxisSettings,
    Load,
    Settings,
    SettingsFormat,
    backlash_note,
    bed_note,
    corrected_note,
    decoded,
    interval,
    positive,
    times,
    words,
)

_COMMAND = re.compile(r"^(?:.*?Recv:\s*)?(?:echo:)?\s*([GM]\d+)\b([^;\n]*)", re.MULTILINE)
_ENDS = re.compile(r"Min:\s*(X[^\n]*?)\s+Max:\s*(X[^\n]*)")
#: In mm: decimals that Marlin keeps of a position.
_LEAST_INCREMENT_MM = 0.001


def _read(path: Path, load: Load) -> Settings:
    text = decoded(load(path))
    commands: dict[str, dict[str, float]] = {}
    mm = 1.0
    for match in _COMMAND.finditer(text):
        mm = MM_PER_INCH if match[1] == "G20" else 1.0 if match[1] == "G21" else mm
        commands.setdefault(match[1], {}).update(words(match[2]))
    ends = _ENDS.search(text)
    low, high = ({}, {}) if ends is None else (words(ends[1]), words(ends[2]))
    axes = {
        axis: AxisSettings(
            travel_mm=interval(low.get(axis), high.get(axis)),
            least_increment_mm=_LEAST_INCREMENT_MM,
            velocity_mm_s=times(positive(commands.get("M203", {}).get(axis)), mm),
            acceleration_mm_s2=times(positive(commands.get("M201", {}).get(axis)), mm),
        )
        for axis in AXES
    }
    skew = commands.get("M852", {})
    skewed = [name for letter, name in zip("IJK", SQUARENESS, strict=True) if skew.get(letter)]
    notes = (bed_note(), *_notes(commands, mm, skewed))
    return Settings("", "marlin", axes, frozenset(skewed), work_offsets=BED, notes=notes)


def _notes(commands: dict[str, dict[str, float]], mm: float, skewed: list[str]) -> Iterator[str]:
    if skewed:
        yield corrected_note("M852", skewed)
    backlash = commands.get("M425", {})
    for axis in AXES:
        if backlash.get("F", 0.0) > 0.0 and backlash.get(axis):
            yield backlash_note(axis, f"M425 {axis}", backlash[axis] * mm)
    if any(commands.get("M206", {}).get(axis) for axis in AXES):
        yield "M206 moves the origin of the axes; state travel and work offset with it in effect."


def _recognises(text: str) -> bool:
    names = {match[1] for match in _COMMAND.finditer(text)}
    return {"M203", "M201"} <= names and bool(names & {"M92", "M204", "M205"})


FORMAT = SettingsFormat(
    "marlin",
    "the answer of Marlin to M503",
    "documentation of Marlin 2, G-codes",
    _recognises,
    _read,
)
