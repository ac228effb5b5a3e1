"""Readings of one component along one line, and their native CSV.

Every reader of an instrument's file returns such readings.

    # component = "EXX"
    # line_mm = { Y = 700.0, Z = -600.0 }
    # sense = "actual-minus-commanded"
    target_mm,run,direction,value_um
    0,1,1,0.0
    100,1,1,3.2

Rows are in the order of time. A comment `# key = value` states a key of a table [[lines]] of a plan
(`olp.files.measurements.reader`). The program ignores any other comment.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from types import MappingProxyType

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import ConfigError
from olp.core.units import MM_PER_UM, RAD_PER_URAD
from olp.core.values import dataclass
from olp.files.columns import Wanted, finite, missing, names, read_sheet, unknown
from olp.files.measurements.stated import stated_keys
from olp.files.problems import Problem, config_error
from olp.files.write import PathLike, read_bytes

#: Sign conventions of files, each with the factor to actual minus commanded of the tool relative to the
#: workpiece. A table that moves 1 um too far in + takes the workpiece along: the tool is then 1 um behind.
SENSES: Mapping[str, float] = MappingProxyType(
    {
        "actual-minus-commanded": 1.0,
        "commanded-minus-actual": -1.0,
        "table-motion actual-minus-commanded": -1.0,
        "table-motion commanded-minus-actual": 1.0,
    }
)
#: Units of values, and the factor to mm or rad.
UNITS: Mapping[str, float] = MappingProxyType(
    {
        "mm": 1.0,
        "um": MM_PER_UM,
        "nm": 1e-6,
        "rad": 1.0,
        "mrad": 1e-3,
        "urad": RAD_PER_URAD,
        "arcsec": math.pi / 648_000.0,
        "um/m": RAD_PER_URAD,
        "mm/m": 1e-3,
    }
)
#: Units of angles.
ANGULAR = frozenset({"rad", "mrad", "urad", "arcsec", "um/m", "mm/m"})

#: Columns that a sentence lists, at most.
_LISTED = 6
_HEADER = ("target_mm", "run", "direction")
_VALUES = {"value_um": "um", "value_urad": "urad"}
#: Columns of the environment of a laser: of its air, all or none, and of the material.
AIR = ("air_degC", "pressure_hPa", "humidity_percent")
MATERIAL = "material_degC"
#: The end of the name of a column of a sensor of the structure.
SENSOR = "_degC"
#: What a sensor may read, degC.
_DEGC = -50.0, 150.0


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """(n,) columns in the order of time: axis positions in mm, errors in mm or rad, runs from 1, and
    directions +1 or -1 of the approach. Errors have the sign convention of the file until `with_sense`.

    `line` (n,) is the line of each row in the file, 0 where it has none. `component` is an ISO 230-1 name,
    None where the file does not state it. `angular` says that values are in rad, None where the file does not
    state it. `keys` are the comments of the file, each with its line. `notes` are sentences on what the
    reader assumed. `sense_known` says that values are actual minus commanded. `environment` are columns (n,)
    of AIR and MATERIAL, `sensors` are temperatures (n,) of the structure by the name of the sensor.
    """

    file: str
    target_mm: Array
    value: Array
    run: Index
    direction: Index
    line: Index
    component: str | None = None
    angular: bool | None = None
    keys: Mapping[str, tuple[str, int]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    sense_known: bool = False
    environment: Mapping[str, Array] = field(default_factory=dict)
    sensors: Mapping[str, Array] = field(default_factory=dict)

    def with_sense(self, sense: str) -> Readings:
        """The same as actual minus commanded. `sense`, a key of SENSES, is the sign convention so far."""
        return replace(self, value=self.value * SENSES[sense], sense_known=True)


def read_readings(path: PathLike) -> Readings:
    """The readings of a native CSV file, in the sign convention of the file.

    Raises InputError where it cannot be read, and ConfigError with every problem and its line.
    """
    return parse_readings(read_bytes(path), str(path))


def parse_readings(data: bytes, file: str) -> Readings:
    """As `read_readings`, from the bytes of the file."""
    sheet = read_sheet(data, file, _WANTED)
    if sheet.problems:
        raise config_error(sheet.problems, file)
    if len(sheet.rows) < 2:
        raise config_error([(sheet.line, f"{len(sheet.rows)} readings; expected at least 2")], file)
    keys = dict(stated_keys(sheet.text))
    value = next(name for name in sheet.header if name in _VALUES)
    unit = _VALUES[value]
    column = sheet.columns
    component = keys["component"][0].strip("\"'") if "component" in keys else None
    return Readings(
        file,
        column["target_mm"],
        column[value] * UNITS[unit],
        column["run"].astype(np.int64),
        column["direction"].astype(np.int64),
        sheet.lines,
        component,
        unit in ANGULAR,
        MappingProxyType(keys),
        environment={name: column[name] for name in (*AIR, MATERIAL) if name in column},
        sensors={name.removesuffix(SENSOR): column[name] for name in column if _is_sensor(name)},
    )


def _is_sensor(name: str) -> bool:
    """Whether a column holds the temperatures of a sensor of the structure."""
    return name.endswith(SENSOR) and name not in (*AIR, MATERIAL, SENSOR)


def check_component(readings: Readings, component: str) -> None:
    """Raise ConfigError where the file names another component, or holds lengths for an angle."""
    if readings.component is not None and readings.component != component:
        line = readings.keys["component"][1] if "component" in readings.keys else None
        sentence = f"the file says {readings.component}, but the plan {component}; expected the same"
        raise config_error([(line, sentence)], readings.file)
    if readings.angular is not None and readings.angular != (component[1] in "ABC"):
        held, wanted = ("angles", "lengths") if readings.angular else ("lengths", "angles")
        raise ConfigError(
            f"the file holds {held}, but {component} is read in {wanted}; expected another component or file",
            file=readings.file,
        )


def _header_problems(line: int, header: Sequence[str]) -> list[Problem]:
    known = (*_HEADER, *_VALUES, *AIR, MATERIAL)
    if len(header) == 1 and re.search(r"[;\t]", header[0]):
        sentence = "columns are separated by semicolons or tabs; expected commas, or a profile for this file"
        return [(line, sentence)]
    more = "; files of other instruments need a profile"
    if not {*header} & {*known}:
        shown = ", ".join(header[:_LISTED]) + (" ..." if len(header) > _LISTED else "")
        wanted = ", ".join((*_HEADER, *[*_VALUES][:1]))
        return [(line, f"its columns are {shown}; expected {wanted}, as of a line{more}")]
    problems = names(line, header, lambda _, name: None if _is_sensor(name) else unknown(name, known, more))
    air = AIR if any(name in header for name in AIR) else ()
    problems += missing(line, header, (*_HEADER, *air))
    if sum(name in _VALUES for name in header) != 1:
        sentence = "expected one column of values: value_um for lengths or value_urad for angles"
        problems.append((line, sentence))
    return problems


def _number(name: str, cell: str) -> tuple[float, str | None]:
    value, problem = finite(cell), None
    if math.isnan(value):
        wrong = "is empty" if not cell else f'= "{cell}" is not a finite number'
        problem = f"{name} {wrong}; leave the row out where the reading is missing"
    elif name == "direction" and value not in (1.0, -1.0):
        problem = f"direction = {cell}; expected 1 (approached in +) or -1"
    elif name == "run" and (value != int(value) or value < 1):
        problem = f"run = {cell}; expected an integer from 1"
    elif _is_sensor(name) and not _DEGC[0] <= value <= _DEGC[1]:
        problem = f"{name} = {cell}; expected {_DEGC[0]:g} to {_DEGC[1]:g}"
    return value, problem


_WANTED = Wanted(
    f"holds no readings; expected {','.join(_HEADER)},value_um",
    _header_problems,
    _number,
    many="; is a decimal comma in it? write a decimal point",
)
