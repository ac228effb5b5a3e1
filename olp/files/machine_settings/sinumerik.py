"""Sinumerik: machine data as an archive holds them as text, such as `N36110 $MA_POS_LIMIT_PLUS[AX1]=500`.

    | number | name | unit, metric |
    | 36100, 36110 | POS_LIMIT_MINUS, POS_LIMIT_PLUS: first software limits | mm |
    | 32000 | MAX_AX_VELO | mm/min |
    | 32300, 32431 | MAX_AX_ACCEL, MAX_AX_JERK; index 0 is DYNNORM | m/s2, m/s3 |
    | 32450 | BACKLASH | mm |
    | 32700, 32710 | ENC_COMP_ENABLE, CEC_ENABLE | |
    | 10000 | AXCONF_MACHAX_NAME_TAB: names of AX1, AX2 ... | |
    | 10200 | INT_INCR_PER_MM, 1000 by default | 1/mm |
    | 10240 | SCALING_SYSTEM_IS_METRIC; 0 is inch, inch/min, inch/s2, inch/s3 | |

Limits of 1e8 and jerks of 1e6 are the values by which the control has none.

Source: the parameter manuals of Sinumerik 808D and 840D sl (detailed descriptions of the machine data).
"""

from __future__ import annotations

import re
from pathlib import Path

from olp.core.errors import InputError
from olp.core.units import AXES, MM_PER_INCH
from olp.core.values import dataclass
from olp.files.machine_settings.base import (
    SECONDS,
    AxisSettings,
    Load,
    Settings,
    SettingsFormat,
    backlash_note,
    corrected_note,
    decoded,
    finite,
    interval,
    positive,
    times,
)

_LINE = re.compile(
    r"^[ \t]*(?:N\d+[ \t]+)?\$M([ACN])_([A-Z0-9_]+)(?:\[([^\]\n]*)\])?[ \t]*=[ \t]*([^;\n]*)",
    re.MULTILINE | re.IGNORECASE,
)
#: mm of a limit, and m/s3 of a jerk, from which there is none.
_NO_LIMIT = 1e7
_NO_JERK = 1e6
#: Increments per mm where the file states none: the value by default.
_INCREMENTS_PER_MM = 1000.0
_MM_PER_M = 1000.0


@dataclass(frozen=True, slots=True)
class _Entry:
    """A machine datum: its kind (A of an axis, C of a channel, N general), indices and text."""

    kind: str
    name: str
    index: tuple[str, ...]
    text: str
    line: int


def _read(path: Path, load: Load) -> Settings:
    entries = list(_entries(decoded(load(path))))
    notes: list[str] = []
    owners = _owners(entries, notes)
    metric = _value(entries, path, "SCALING_SYSTEM_IS_METRIC")
    mm = MM_PER_INCH if metric == 0.0 else 1.0
    # lengths per s2 and s3 are in m where the system is metric
    per_s = MM_PER_INCH if metric == 0.0 else _MM_PER_M
    increments = positive(_value(entries, path, "INT_INCR_PER_MM")) or _INCREMENTS_PER_MM
    axes, compensated = {}, []
    for axis in AXES:
        mine = [e for e in entries if e.kind == "A" and e.index and e.index[-1] == owners.get(axis)]
        jerk = _value(mine, path, "MAX_AX_JERK")
        low, high = (_limit(_value(mine, path, f"POS_LIMIT_{end}"), mm) for end in ("MINUS", "PLUS"))
        axes[axis] = AxisSettings(
            travel_mm=interval(low, high),
            least_increment_mm=1.0 / increments,
            velocity_mm_s=times(positive(_value(mine, path, "MAX_AX_VELO")), mm / SECONDS),
            acceleration_mm_s2=times(positive(_value(mine, path, "MAX_AX_ACCEL")), per_s),
            jerk_mm_s3=None if jerk is None or jerk >= _NO_JERK else times(positive(jerk), per_s),
        )
        if backlash := _value(mine, path, "BACKLASH"):
            notes.append(backlash_note(axis, f"BACKLASH of {axis}", backlash * mm))
        if _value(mine, path, "ENC_COMP_ENABLE"):
            compensated.append(f"E{axis}{axis}")
            notes.append(corrected_note(f"ENC_COMP_ENABLE of {axis}", [f"E{axis}{axis}"]))
        if _value(mine, path, "CEC_ENABLE"):
            notes.append(
                f"CEC_ENABLE of {axis} is on: its tables correct errors of {axis}. List in "
                "compensated_by_controller which; olp calibrate import --format siemens reads them."
            )
    return Settings("", "sinumerik", axes, frozenset(compensated), notes=tuple(notes))


def _entries(text: str) -> list[_Entry]:
    found = []
    for match in _LINE.finditer(text):
        index = tuple(part.strip().upper() for part in (match[3] or "").split(",") if part.strip())
        line = text.count("\n", 0, match.start(1)) + 1
        found.append(_Entry(match[1].upper(), match[2].upper(), index, match[4].strip(), line))
    return found


def _owners(entries: list[_Entry], notes: list[str]) -> dict[str, str]:
    """By axis letter, the name in the index of its data. Without names in the file AX1, AX2, AX3 are taken as
    X, Y, Z, which a note says."""
    names = {
        f"AX{int(e.index[0]) + 1}": e.text.strip('"').upper()
        for e in entries
        if e.name == "AXCONF_MACHAX_NAME_TAB" and e.index and re.fullmatch("[0-9]{1,3}", e.index[0])
    }
    used = dict.fromkeys(e.index[-1] for e in entries if e.kind == "A" and e.index)
    owners: dict[str, str] = {}
    for own in used:
        letter = re.fullmatch(r"([XYZ])\d*", names.get(own, own))
        if letter and letter[1] in owners:
            notes.append(f"{own} is a further axis {letter[1]} and left out; {owners[letter[1]]} is used.")
        elif letter:
            owners[letter[1]] = own
    rest = [(axis, f"AX{k}") for k, axis in enumerate(AXES, 1) if axis not in owners]
    assumed = {axis: own for axis, own in rest if own in used and own not in names}
    if assumed:
        pairs = ", ".join(f"{own} as {axis}" for axis, own in assumed.items())
        notes.append(f"The file names no axes (MD10000): {pairs} is assumed; check it.")
    return owners | assumed


def _value(entries: list[_Entry], path: Path, name: str) -> float | None:
    """The number of a datum: its first index is 0 or left out. Raises InputError where it is no number."""
    for entry in entries:
        first = entry.index[0] if len(entry.index) > 1 else "0"
        if entry.name != name or not (first == "0" or first == "DYNNORM"):
            continue
        value = finite({"TRUE": "1", "FALSE": "0"}.get(entry.text.upper(), entry.text))
        if value is None:
            what = f'{name} = "{entry.text}" is not a number'
            raise InputError(f"{what}; expected a number", file=str(path), line=entry.line)
        return value
    return None


def _limit(value: float | None, mm: float) -> float | None:
    return None if value is None or abs(value) >= _NO_LIMIT else value * mm


def _recognises(text: str) -> bool:
    return any(match[1].upper() == "A" for match in _LINE.finditer(text))


FORMAT = SettingsFormat(
    "sinumerik",
    "machine data of a Sinumerik as text ($MA_...)",
    "parameter manuals of Sinumerik 808D and 840D sl",
    _recognises,
    _read,
)
