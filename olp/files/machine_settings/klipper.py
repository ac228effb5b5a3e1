"""Klipper: `printer.cfg` with the files that it includes.

`position_min` (0 if left out) and `position_max` of `[stepper_x]` are the travel in mm. `max_velocity` and
`max_accel` of `[printer]` are in mm/s and mm/s2; `max_z_velocity` and `max_z_accel` are their values of Z.
Klipper has no limit of jerk. A section `[skew_correction NAME]` takes effect when a macro loads it. Values
that the firmware saved are at the end, behind `#*#`, and win.

Source: the configuration reference of Klipper.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path

from olp.core.errors import InputError
from olp.core.units import AXES
from olp.files.machine_settings.base import (
    BED,
    AxisSettings,
    Load,
    Settings,
    SettingsFormat,
    bed_note,
    decoded,
    finite,
    interval,
    positive,
)

#: Kinematics whose X, Y and Z are linear and at right angles.
_CARTESIAN = ("cartesian", "corexy", "corexz", "hybrid_corexy", "hybrid_corexz", "generic_cartesian")
_SECTION = re.compile(r"\[\s*([^\]]+?)\s*\]")
#: Depth of nested files.
_MOST_INCLUDES = 8
#: In mm: decimals of positions that senders write.
_LEAST_INCREMENT_MM = 0.001

#: The line and text of each key, by section and key.
Sections = dict[str, dict[str, tuple[str, str]]]


def _read(path: Path, load: Load) -> Settings:
    sections: Sections = {}
    missing: list[str] = []
    for place, section, key, value in _entries(path, load, missing, 0):
        sections.setdefault(section, {})[key] = (place, value)
    printer = sections.get("printer", {})
    kinematics = printer.get("kinematics", ("", ""))[1]
    if kinematics not in _CARTESIAN:
        what = f'[printer] kinematics is "{kinematics}"; olp corrects machines of three linear axes'
        raise InputError(f"{what}; expected one of {', '.join(_CARTESIAN)}", file=str(path))
    notes = [bed_note()]
    notes += [f"The included file {name} does not exist; what it states is missing here." for name in missing]
    axes = {axis: _axis(axis, sections) for axis in AXES}
    skews = [name for name in sections if name.startswith("skew_correction")]
    if skews:
        notes.append(
            f"[{skews[0]}] corrects squareness where a macro loads it: then list C0Y, B0Z and A0Z in "
            "compensated_by_controller. olp calibrate import --format klipper reads it."
        )
    return Settings("", "klipper", axes, work_offsets=BED, notes=tuple(notes))


def _axis(axis: str, sections: Sections) -> AxisSettings:
    stepper, printer = sections.get(f"stepper_{axis.lower()}", {}), sections.get("printer", {})

    def own(key: str) -> float | None:
        """The value of Z where there is one."""
        value = _number(printer, f"max_z_{key}") if axis == "Z" else None
        return positive(_number(printer, f"max_{key}") if value is None else value)

    low = _number(stepper, "position_min")
    return AxisSettings(
        travel_mm=interval(0.0 if low is None else low, _number(stepper, "position_max")),
        least_increment_mm=_LEAST_INCREMENT_MM,
        velocity_mm_s=own("velocity"),
        acceleration_mm_s2=own("accel"),
    )


def _number(section: dict[str, tuple[str, str]], key: str) -> float | None:
    if key not in section:
        return None
    place, text = section[key]
    value = finite(text)
    if value is None:
        file, _, line = place.rpartition(":")
        what = f'{key} = "{text}" is not a number; expected it in mm and s'
        raise InputError(what, file=file, line=int(line))
    return value


def _entries(path: Path, load: Load, missing: list[str], depth: int) -> Iterator[tuple[str, str, str, str]]:
    """(place, section, key, value) of a file and those that it includes; names of missing ones are added to
    `missing`."""
    section = ""
    for number, raw in enumerate(decoded(load(path)).splitlines(), 1):
        bare = re.split(r"\s*[#;]", raw.removeprefix("#*#").strip(), maxsplit=1)[0]
        header = _SECTION.fullmatch(bare)
        if header:
            section = re.sub(r"\s+", " ", header[1])
            if section.startswith("include ") and depth < _MOST_INCLUDES:
                yield from _included(path, section.removeprefix("include "), load, missing, depth)
        elif match := re.match(r"([A-Za-z_]\w*)\s*[:=]\s*(.*)", bare):
            yield f"{path}:{number}", section, match[1], match[2].strip()


def _included(
    path: Path, name: str, load: Load, missing: list[str], depth: int
) -> Iterator[tuple[str, str, str, str]]:
    named = path.parent / Path(name.strip()).expanduser()
    files = [named]
    if any(sign in name for sign in "*?["):
        root = Path(named.anchor)
        with contextlib.suppress(ValueError):
            # such as `**x`, which is no pattern
            files = sorted(root.glob(str(named.relative_to(root))))
    if not all(map(Path.is_file, files)):
        missing.append(name)
    for file in filter(Path.is_file, files):
        yield from _entries(file, load, missing, depth + 1)


def _recognises(text: str) -> bool:
    names = {match[1] for match in re.finditer(r"^\[([^\]\n]+)\]", text, re.MULTILINE)}
    return "printer" in names and bool(re.search(r"^kinematics\s*[:=]", text, re.MULTILINE))


FORMAT = SettingsFormat(
    "klipper",
    "printer.cfg of Klipper",
    "configuration reference of Klipper",
    _recognises,
    _read,
)
