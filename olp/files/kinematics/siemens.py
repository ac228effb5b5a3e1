"""A machine file from the vectors of a Sinumerik control: swivel data ($TC_CARR) or those of its five-axis
transformation ($MC_TRAFO5), which are the same under other names.

Sources: Siemens, Commissioning Manual SINUMERIK Operate (swiveling), Function Manual W1 (orientable
toolholders). Lengths are taken as mm. A vector of a table turns the table: the tool goes the other way in the
workpiece.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from olp.core.errors import InputError
from olp.core.machine import ZERO, Vector
from olp.core.values import dataclass
from olp.files.kinematics.families import back, with_turns
from olp.files.kinematics.written import WIDE_DEG, Parts, Written, machine_file
from olp.files.write import PathLike, read_bytes

_STATED = re.compile(
    r"""(?imx) \$ (?: TC_CARR(?P<part>\d+) \[ (?P<set>\d+) \]
    | MC_(?P<name>TRAFO\w*) (?: \[ (?P<index>\d+) \] )? ) \s* = \s* (?P<value>"[^"\n]*"|[^\s;"]+)"""
)
#: What a remark of the control says.
_REMARK = re.compile(r";.*")
#: First number of each vector in swivel data.
NUMBERED = {"I1": 1, "I2": 4, "V1": 7, "V2": 10, "I3": 15, "I4": 18}
#: By type of a transformation the kind of the machine, and the data of its vectors.
DATA: Mapping[int, tuple[str, Mapping[str, str]]] = {
    24: ("T", {"I1": "PART_OFFSET", "I2": "JOINT_OFFSET", "I3": "BASE_TOOL"}),
    40: ("P", {"I2": "BASE_TOOL", "I3": "JOINT_OFFSET", "I4": "PART_OFFSET"}),
    56: ("M", {"I1": "JOINT_OFFSET", "I2": "BASE_TOOL", "I3": "JOINT_OFFSET_PART", "I4": "PART_OFFSET"}),
}
#: Numbers of swivel data that are added to others: offsets of angles, and fine offsets.
_ADDED = (24, 25, *range(41, 47), *range(55, 61))
#: Vectors that close a chain, by kind: those that add up to nothing.
_CLOSED: Mapping[str, Sequence[tuple[str, ...]]] = {
    "T": [("I1", "I2", "I3")],
    "P": [("I2", "I3", "I4")],
    "M": [("I1", "I2"), ("I3", "I4")],
}
_CLOSE_MM = 1e-3
_LETTERS = "ABC"
#: A name of a rotary axis that tells its letter.
_NAME = re.compile(r"(?i)[ABC]\d*")
#: Data of a transformation that change what its vectors mean, each with the values that do not.
_NEUTRAL: Mapping[str, tuple[str, ...]] = {
    "TRAFO5_ROT_SIGN_IS_PLUS_1": ("1", "TRUE"),
    "TRAFO5_ROT_AX_OFFSET_1": ("0", "0.0"),
    "TRAFO5_ROT_OFFSET_FROM_FRAME_1": ("0", "FALSE"),
    "TRAFO5_NUTATOR_AX_ANGLE_1": ("0", "0.0", "45", "45.0"),
}
_BASE_ORIENT = "TRAFO5_BASE_ORIENT_1"


@dataclass(frozen=True, slots=True)
class Vectors:
    """Vectors by name; the `kind` of the machine, T for a head, P for tables, M for both; the names of the
    two rotary axes, "" where they are not stated, and their travel."""

    kind: str
    of: Mapping[str, Vector]
    names: tuple[str, str] = ("", "")
    travels: tuple[tuple[float, float], tuple[float, float]] = (WIDE_DEG, WIDE_DEG)


def has_vectors(text: str) -> bool:
    """Whether a text is of this kind."""
    return _STATED.search(_REMARK.sub("", text)) is not None


def machine_of_vectors(path: PathLike, name: str, controller: str | None = None) -> Written:
    """The machine file of the vectors that a file states. Raises InputError where it is not one machine, or
    states what such a file cannot hold."""
    file = str(path)
    vectors = _read(read_bytes(path).decode("latin-1"), file)
    notes = [
        "Lengths of the vectors are taken as mm, as measured at axis zero",
        "Directions of tables are those of the tool in the workpiece, against V1 and V2",
    ]
    return machine_file(_parts(vectors, file), name, controller or "sinumerik", notes)


def _read(text: str, file: str) -> Vectors:
    sets: dict[str, dict[int, str]] = {}
    data: dict[str, str] = {}
    for match in _STATED.finditer(_REMARK.sub("", text)):
        value = match["value"].strip('"')
        kept: dict[Any, str] = sets.setdefault(match["set"], {}) if match["part"] else data
        key = int(match["part"]) if match["part"] else f"{match['name'].upper()}[{match['index'] or 0}]"
        if kept.setdefault(key, value) != value:
            raise InputError(f"{match[0].strip()}: was {kept[key]} before; state it once", file=file)
    kind = next((number for number in DATA if data.get("TRAFO_TYPE_1[0]") == str(number)), None)
    if kind is not None and not sets:
        return _of_transformation(kind, data, file)
    if kind is not None:
        raise InputError("states swivel data and a transformation; keep one of them", file=file)
    used = {number: values for number, values in sets.items() if 23 in values}
    if len(used) != 1:
        found = f"states {len(used)} sets of swivel data" if used else "states no $TC_CARR23"
        raise InputError(
            f"{found}; expected one set, or $MC_TRAFO_TYPE_1 = {', '.join(map(str, DATA))} and its vectors",
            file=file,
        )
    return _of_swivel(*used.popitem(), file)


def _of_swivel(number: str, values: Mapping[int, str], file: str) -> Vectors:
    def of(part: int) -> float:
        return _number(f"$TC_CARR{part}[{number}]", values.get(part, "0"), file)

    for part in _ADDED:
        if of(part):
            raise InputError(
                f"$TC_CARR{part}[{number}] adds to the other vectors or angles; put it into them, and 0 here",
                file=file,
            )
    vectors = {name: (of(first), of(first + 1), of(first + 2)) for name, first in NUMBERED.items()}
    low, high = (of(30), of(31)), (of(32), of(33))
    for a, b in zip(low, high, strict=True):
        if b < a:
            raise InputError(
                f"a rotary axis has limits from {a:g} to {b:g}; expected them in order", file=file
            )
    first, second = ((a, b) if b > a else WIDE_DEG for a, b in zip(low, high, strict=True))
    kind = values[23].strip("'").upper()
    return Vectors(kind, vectors, (values.get(21, ""), values.get(22, "")), (first, second))


def _of_transformation(number: int, data: Mapping[str, str], file: str) -> Vectors:
    kind, names = DATA[number]

    def of(name: str) -> Vector:
        keys = [f"TRAFO5_{name}_1[{index}]" for index in range(3)]
        x, y, z = (_number(f"$MC_{key}", data.get(key, "0"), file) for key in keys)
        return (x, y, z)

    for key, value in data.items():
        neutral = _NEUTRAL.get(key.partition("[")[0])
        if neutral is not None and value.upper() not in neutral:
            raise InputError(
                f"$MC_{key} = {value} changes what the vectors mean, which is not read", file=file
            )
    if any(key.startswith(_BASE_ORIENT) for key in data):
        x, y, z = (
            _number(f"$MC_{_BASE_ORIENT}[{k}]", data.get(f"{_BASE_ORIENT}[{k}]", "0"), file) for k in range(3)
        )
        if x or y or z <= 0.0:
            raise InputError(f"$MC_{_BASE_ORIENT} is {x:g}, {y:g}, {z:g}; expected a tool along Z", file=file)
    vectors = {vector: of(name) for vector, name in names.items()}
    return Vectors(kind, vectors | {"V1": of("AXIS1"), "V2": of("AXIS2")})


def _number(name: str, text: str, file: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{name} = {text}: expected a number", file=file)
    return value


def _parts(vectors: Vectors, file: str) -> Parts:
    if vectors.kind not in _CLOSED:
        raise InputError(f"$TC_CARR23 is {vectors.kind!r}; expected T, P or M", file=file)
    of = {**dict.fromkeys(NUMBERED, ZERO), **vectors.of}
    for names in _CLOSED[vectors.kind]:
        rest = [sum(parts) for parts in zip(*(of[name] for name in names), strict=True)]
        if max(map(abs, rest)) > _CLOSE_MM:
            raise InputError(
                f"{' + '.join(names)} is {rest[0]:g}, {rest[1]:g}, {rest[2]:g} and not 0: the head or table "
                "is one that is changed; expected the vectors of the machine as it runs, which are closed",
                file=file,
            )
    points = {
        "T": (_sum(of["I3"], of["I2"]), of["I3"]),
        "P": (of["I2"], _sum(of["I2"], of["I3"])),
        "M": (of["I2"], of["I3"]),
    }[vectors.kind]
    turning = [_direction(of[name], name, file) for name in ("V1", "V2")]
    if turning[0] is None:
        raise InputError("V1 is 0: no rotary axis is described", file=file)
    letters = _named(vectors.names, turning, file)
    table = {"T": (False, False), "P": (True, True), "M": (False, True)}[vectors.kind]
    turns = [
        (letter, back(direction) if on_table else direction, point, travel)
        for letter, direction, on_table, point, travel in zip(
            letters, turning, table, points, vectors.travels, strict=True
        )
        if direction is not None
    ]
    tables = [turn[0] for turn, on_table in zip(turns, table, strict=False) if on_table]
    heads = [turn[0] for turn, on_table in zip(turns, table, strict=False) if not on_table]
    return with_turns(" ".join([*reversed(tables), "F", "X", "Y", "Z", *heads]), *turns)


def _sum(one: Vector, other: Vector) -> Vector:
    x, y, z = (a + b for a, b in zip(one, other, strict=True))
    return (x, y, z)


def _direction(vector: Vector, name: str, file: str) -> Vector | None:
    """A vector of length 1; None where it is 0."""
    size = math.hypot(*vector)
    if size == 0.0:
        return None
    x, y, z = (part / size for part in vector)
    return (x, y, z)


def _named(stated: tuple[str, str], directions: Sequence[Vector | None], file: str) -> tuple[str, str]:
    """The letters of the rotary axes: as they are stated, or by what they turn about, first that which turns
    about one axis the most."""
    found = [name[0].upper() if _NAME.fullmatch(name.strip()) else "" for name in stated]
    sizes = [[abs(part) for part in direction or ZERO] for direction in directions]
    for which in sorted((0, 1), key=lambda k: -max(sizes[k])):
        if not found[which]:
            left = [k for k in range(3) if _LETTERS[k] not in found]
            best = max(left, key=lambda k: sizes[which][k])
            found[which] = (
                _LETTERS[best] if sizes[which][best] or directions[which] is None else found[1 - which]
            )
    if found[0] == found[1] and directions[1] is not None:
        raise InputError(
            f"both rotary axes would be {found[0]}; state their names in $TC_CARR21 and $TC_CARR22", file=file
        )
    return found[0], found[1]
