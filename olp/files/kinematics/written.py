"""The text of a machine file of any joints, from the parts that other descriptions give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

from olp.core.arrays import Array
from olp.core.machine import ZERO, Vector
from olp.core.values import dataclass
from olp.files.toml_text import toml_document, toml_key

#: The smallest step of a control where nothing states it: mm or deg.
STEP = 0.001
#: Digits of lengths and directions, so that 90 degrees given as 1.5707963 stay 90 degrees to 1e-12.
DIGITS = 12
#: Travel of a linear axis where nothing states it, mm.
WIDE_MM = (-1000.0, 1000.0)
#: Travel of a rotary axis where nothing states it, in degrees.
WIDE_DEG = (-360.0, 360.0)

Keys = Mapping[str, object]


@dataclass(frozen=True, slots=True)
class Written:
    """A machine file, and what is to be checked in it."""

    data: bytes
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Parts:
    """A machine as the tables of its file: the chain, the keys of each axis and of the gauge, and of each
    platform its keys and those of its legs. Lengths in mm, angles in deg."""

    chain: tuple[str, ...]
    axes: Mapping[str, Keys]
    gauge: Keys = field(default_factory=dict)
    platforms: Mapping[str, tuple[Keys, Sequence[Keys]]] = field(default_factory=dict)


def machine_file(parts: Parts, name: str, controller: str | None, notes: Sequence[str]) -> Written:
    """The machine file of parts. It names no calibration; `notes` are what is to be checked in it."""
    head = {
        "schema": "olp-machine-1",
        "name": name,
        "chain": " ".join(parts.chain),
        "controller": controller or "linuxcnc",
        "compensated_by_controller": [],
    }
    tables: list[tuple[str, Keys]] = [("", head)]
    tables += [(f"[axes.{toml_key(axis)}]", keys) for axis, keys in parts.axes.items()]
    for platform, (keys, legs) in parts.platforms.items():
        tables.append((f"[platforms.{toml_key(platform)}]", keys))
        tables += [(f"[[platforms.{toml_key(platform)}.legs]]", leg) for leg in legs]
    if parts.gauge:
        tables.append(("[gauge]", parts.gauge))
    if parts.platforms and parts.chain == ("F", *parts.platforms):
        tables.append(("[kinematics]", {"program_words": "pose"}))
    said = [
        *notes,
        "The file names no calibration, so the machine has no errors: add calibration where it was measured",
    ]
    if parts.platforms:
        said.append(
            "X, Y and Z of programs are taken for the tip, as with the kinematics modules of LinuxCNC: leave "
            "program_words out where the control is commanded in axis values alone"
        )
    if controller is None:
        said.append('No control is stated; controller = "linuxcnc" is written: name yours with --controller')
    return Written(toml_document(tables).encode(), tuple(said))


def linear(direction: Vector, travel_mm: tuple[float, float] = WIDE_MM) -> Keys:
    """The keys of a linear axis."""
    return {
        "kind": "linear",
        "direction": numbers(direction),
        "travel_mm": list(travel_mm),
        "least_increment_mm": STEP,
    }


def rotary(direction: Vector, point_mm: Vector = ZERO, travel_deg: tuple[float, float] = WIDE_DEG) -> Keys:
    """The keys of a rotary axis."""
    return {
        "kind": "rotary",
        "direction": numbers(direction),
        "point_mm": numbers(point_mm),
        "travel_deg": list(travel_deg),
        "least_increment_deg": STEP,
    }


def length(travel_mm: tuple[float, float]) -> Keys:
    """The keys of the length of a leg."""
    return {"kind": "length", "travel_mm": list(travel_mm), "least_increment_mm": STEP}


def numbers(vector: Sequence[float] | Array) -> list[float]:
    """A vector as numbers of a file, without negative zeros."""
    return [round(float(value), DIGITS) + 0.0 for value in vector]
