"""LinuxCNC: the INI file with its tool table and stored work offsets.

Sources: the LinuxCNC integrator manual (INI configuration, tool table) and the parameter list of its G-code
manual. Parameter 5220 holds the active offset. Parameters 5221 to 5390 hold G54 to G59.3, nine axes and a
rotation each, in machine units.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import field
from pathlib import Path

from olp.core.errors import InputError
from olp.core.machine import Tool, Vector, WorkOffset
from olp.core.units import AXES, MM_PER_INCH
from olp.core.values import dataclass
from olp.files.machine_settings.base import (
    NUMBER,
    AxisSettings,
    Load,
    Settings,
    SettingsFormat,
    backlash_note,
    interval,
    touched_note,
)
from olp.files.write import read_bytes

#: In mm. LinuxCNC takes any number of decimals; programs commonly have four.
LEAST_INCREMENT_MM = 0.0001

#: Work offsets in the order of their parameters.
OFFSETS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")

_UNITS_MM = {"mm": 1.0, "metric": 1.0, "in": MM_PER_INCH, "inch": MM_PER_INCH, "imperial": MM_PER_INCH}
_CARTESIAN = ("trivkins", "corexykins")
#: Kinematics of arms and platforms.
_OF_OTHER_JOINTS = frozenset({
    "genhexkins", "genserkins", "lineardeltakins", "pentakins", "pumakins", "rosekins", "rotarydeltakins",
    "scarakins", "scorbot-kins", "tripodkins",
})  # fmt: skip
_TOOL_WORD = re.compile(rf"([A-Z])\s*({NUMBER})", re.IGNORECASE)
#: Depth of nested `#INCLUDE` files.
_MAX_INCLUDES = 20

Sections = dict[str, dict[str, str]]


@dataclass(slots=True)
class Reading:
    """An INI file while it is read: its sections, the notes so far, and the length of its unit in mm."""

    file: str
    sections: Sections
    notes: list[str] = field(default_factory=list)
    mm: float = 1.0

    def text(self, section: str, key: str) -> str | None:
        return self.sections.get(section, {}).get(key)

    def number(self, section: str, key: str) -> float | None:
        text = self.text(section, key)
        if text is None:
            return None
        match = re.match(NUMBER, text)
        if match is None:
            raise InputError(f'[{section}] {key} = "{text}" is not a number', file=self.file)
        return float(match[0])

    def length(self, section: str, key: str) -> float | None:
        number = self.number(section, key)
        return None if number is None else number * self.mm


def _read(path: Path, load: Load) -> Settings:
    """Raises InputError where a file cannot be read, or where units or one of X, Y, Z are missing."""
    reading = Reading(str(path), sections_of(path, load))
    reading.mm = unit_mm(reading)
    joints = joints_of(reading)
    axes = {letter: _axis(reading, letter, joints[letter]) for letter in AXES}
    compensated = _compensated(reading, joints)
    tools = _tools(reading, path, load)
    offsets, active = _offsets(reading, path, load)
    name = reading.text("EMC", "MACHINE") or path.stem
    return Settings(name, "linuxcnc", axes, compensated, tools, offsets, active, tuple(reading.notes))


def unit_mm(reading: Reading) -> float:
    """Length of a machine unit in mm. LinuxCNC takes a name, or a number of units per mm."""
    units = (reading.text("TRAJ", "LINEAR_UNITS") or "").casefold()
    if units in _UNITS_MM:
        return _UNITS_MM[units]
    if re.fullmatch(NUMBER, units) and float(units) > 0:
        return 1.0 / float(units)
    stated = f'"{units}"' if units else "missing"
    raise InputError(f"[TRAJ] LINEAR_UNITS is {stated}; expected mm or inch", file=reading.file)


def _lines(path: Path, load: Load, depth: int = 0) -> Iterator[str]:
    """The lines of an INI file, with the lines of `#INCLUDE` files inserted."""
    for line in load(path).decode("utf-8", "replace").splitlines():
        include = re.match(r"\s*#INCLUDE\s+(\S.*)", line)
        if include and depth < _MAX_INCLUDES:
            yield from _lines(path.parent / Path(include[1].strip()).expanduser(), load, depth + 1)
        else:
            yield line.strip()


def sections_of(path: Path, load: Load = read_bytes) -> Sections:
    """The first value of each key, by section and key. `load` gives the bytes of a file."""
    sections: Sections = {}
    current: dict[str, str] = {}
    for line in _lines(path, load):
        if line.startswith("[") and "]" in line:
            current = sections.setdefault(line[1 : line.index("]")].strip(), {})
        elif line and line[0] not in "#;" and "=" in line:
            key, _, value = line.partition("=")
            current.setdefault(key.strip(), value.strip())
    return sections


def joints_of(reading: Reading) -> dict[str, list[str]]:
    """The sections of the joints of each axis; none where the kinematics are not trivial."""
    coordinates = (reading.text("TRAJ", "COORDINATES") or "XYZ").upper().replace(" ", "")
    kinematics = reading.text("KINS", "KINEMATICS") or "trivkins"
    stated = re.search(r"coordinates\s*=\s*([A-Z]+)", kinematics, re.IGNORECASE)
    order = stated[1].upper() if stated else "XYZABCUVW"
    module = kinematics.split()[0]
    missing = [letter for letter in AXES if letter not in coordinates]
    if missing:
        what = f"[TRAJ] COORDINATES = {coordinates} lacks {', '.join(missing)}"
        raise InputError(f"{what}; expected a machine with the linear axes X, Y and Z", file=reading.file)
    rotary = [letter for letter in coordinates if letter not in AXES]
    if rotary:
        reading.notes.append(
            f"These files describe X, Y and Z, without {', '.join(rotary)}. Machines of more axes are "
            "described by olp init --structure, --trafo or --urdf."
        )
    if module != "trivkins":
        if module in _OF_OTHER_JOINTS:
            raise InputError(
                f"KINEMATICS = {module} is no machine of three linear axes; describe it with olp init DIR "
                "and one of --trafo (its HAL file), --structure or --urdf",
                file=reading.file,
            )
        if module not in _CARTESIAN:
            reading.notes.append(
                f"KINEMATICS = {module}: check that X, Y, Z are three linear axes in series. Other machines "
                "are described by olp init --trafo, --structure or --urdf."
            )
        return {letter: [] for letter in AXES}
    joints: dict[str, list[str]] = {}
    for letter in AXES:
        numbers = [index for index, owner in enumerate(order) if owner == letter]
        joints[letter] = [f"JOINT_{n}" for n in numbers if f"JOINT_{n}" in reading.sections]
        # Before version 2.8 one section served as axis and joint.
        joints[letter] += [f"AXIS_{n}" for n in numbers if f"AXIS_{n}" in reading.sections]
    return joints


def _axis(reading: Reading, letter: str, joints: list[str]) -> AxisSettings:
    """The tightest of what the sections of an axis and its joints state."""
    sections = [f"AXIS_{letter}", *joints]

    def all_of(key: str) -> list[float]:
        values = (reading.length(section, key) for section in sections)
        return [value for value in values if value is not None]

    def least(key: str, *caps: str) -> float | None:
        values = all_of(key) + [v for cap in caps if (v := reading.length("TRAJ", cap)) is not None]
        return min((value for value in values if value > 0), default=None)

    low, high = max(all_of("MIN_LIMIT"), default=None), min(all_of("MAX_LIMIT"), default=None)
    if low is not None and high is not None and not low < high:
        raise InputError(
            f"axis {letter} has no travel; expected MIN_LIMIT below MAX_LIMIT in [AXIS_{letter}]",
            file=reading.file,
        )
    return AxisSettings(
        travel_mm=interval(low, high),
        least_increment_mm=LEAST_INCREMENT_MM,
        velocity_mm_s=least("MAX_VELOCITY", "MAX_LINEAR_VELOCITY", "MAX_VELOCITY"),
        acceleration_mm_s2=least("MAX_ACCELERATION", "MAX_LINEAR_ACCELERATION", "MAX_ACCELERATION"),
        jerk_mm_s3=least("MAX_JERK", "MAX_LINEAR_JERK"),
    )


def _compensated(reading: Reading, joints: Mapping[str, list[str]]) -> frozenset[str]:
    """ISO names of the errors that COMP_FILE corrects. BACKLASH has no such name and gives a note."""
    names = set()
    for letter, sections in joints.items():
        for section in sections:
            table = reading.text(section, "COMP_FILE")
            if table:
                names.add(f"E{letter}{letter}")
                reading.notes.append(
                    f"[{section}] COMP_FILE = {table} corrects E{letter}{letter}, so it is listed in "
                    "compensated_by_controller (olp calibrate import --format linuxcnc reads it). If it was "
                    "active while measuring, list it in active_during_measurement of the calibration instead."
                )
            elif backlash := reading.length(section, "BACKLASH"):
                reading.notes.append(backlash_note(letter, f"[{section}] BACKLASH", backlash))
    return frozenset(names)


def _tools(reading: Reading, ini: Path, load: Load) -> dict[int, Tool]:
    name = reading.text("EMCIO", "TOOL_TABLE")
    if name is None:
        reading.notes.append("[EMCIO] TOOL_TABLE is not given: add [tools.N] by hand.")
        return {}
    path = ini.parent / name
    if not path.is_file():
        reading.notes.append(f"The tool table {name} does not exist: add [tools.N] by hand.")
        return {}
    tools: dict[int, Tool] = {}
    for line in load(path).decode("utf-8", "replace").splitlines():
        words = {
            letter.upper(): float(number) for letter, number in _TOOL_WORD.findall(line.partition(";")[0])
        }
        if "T" not in words:
            continue
        x, y, z = (words.get(letter, 0.0) * reading.mm for letter in AXES)
        number = int(words["T"])
        if number in tools:
            reading.notes.append(f"Tool {number} is defined twice in {name}; the last row is used.")
        radius = words.get("D", 0.0) * reading.mm / 2
        # a diameter below 0 offsets contours to the other side
        tools[number] = Tool(number, length_mm=(x, y, z), radius_mm=abs(radius), wear_mm=radius - abs(radius))
    negative = [str(number) for number, tool in tools.items() if tool.tool_vector_mm is None]
    if negative:
        reading.notes.append(
            f"Tools {', '.join(negative)} have a negative Z: a touch-off value, not a length. "
            "Give gauge_to_tip_mm to use them."
        )
    return tools


def _offsets(reading: Reading, ini: Path, load: Load) -> tuple[dict[str, WorkOffset], str]:
    """Work offsets G54 to G59.3 and the name of the active one."""
    name = reading.text("RS274NGC", "PARAMETER_FILE")
    path = ini.parent / name if name else None
    if path is None or not path.is_file():
        what = f"The parameter file {name} does not exist" if name else "No PARAMETER_FILE is given"
        reading.notes.append(f"{what}: set the work offsets by hand.")
        return {}, "G54"
    values: dict[int, float] = {}
    for line in load(path).decode("utf-8", "replace").splitlines():
        row = re.match(rf"\s*(\d+)\s+({NUMBER})\s*$", line)
        if row:
            values[int(row[1])] = float(row[2])
    if values.get(5210) and any(values.get(5211 + i) for i in range(3)):
        reading.notes.append(f"A G92 offset is active in {name}; it is not imported: cancel it with G92.1.")
    offsets = {}
    for index, offset in enumerate(OFFSETS):
        first = 5221 + 20 * index
        x, y, z = (values.get(first + i, 0.0) * reading.mm for i in range(3))
        rotation: Vector = (0.0, 0.0, values.get(first + 9, 0.0))
        offsets[offset] = WorkOffset(offset, offset_mm=(x, y, z), rotation_deg=rotation)
    reading.notes.append(touched_note())
    active = int(values.get(5220, 1.0))
    return offsets, OFFSETS[active - 1] if 1 <= active <= len(OFFSETS) else "G54"


def _recognises(text: str) -> bool:
    """[TRAJ] beside another section, or one of them where an `#INCLUDE` may bring the rest."""
    sections = set(re.findall(r"^\[(\w+)\]", text, re.MULTILINE))
    others = sections & {"KINS", "EMC", "HAL", "DISPLAY", "RS274NGC", "AXIS_X", "AXIS_0", "JOINT_0"}
    if "TRAJ" in sections:
        return bool(others - {"HAL", "DISPLAY"})
    return bool(sections) and re.search(r"^\s*#INCLUDE\s", text, re.MULTILINE) is not None


FORMAT = SettingsFormat(
    "linuxcnc",
    "the INI file of LinuxCNC",
    "integrator manual of LinuxCNC",
    _recognises,
    _read,
)
