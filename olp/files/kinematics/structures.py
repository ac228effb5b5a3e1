"""Structures of machines by name, each with the dimensions of an example: `olp init --structure`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from olp.core.errors import UsageError
from olp.core.machine import Vector
from olp.files.fields import nearest
from olp.files.kinematics.families import (
    X,
    Y,
    Z,
    back,
    legs,
    linear_delta,
    rotary_delta,
    scara,
    with_turns,
)
from olp.files.kinematics.written import Keys, Parts, Written, linear, machine_file, rotary

#: The travel of a table or head that turns round, in degrees.
_ROUND = (-360.0, 360.0)
#: The travel of a cradle, in degrees.
_TILT = (-120.0, 30.0)
#: The travel of a head that swivels, in degrees.
_HEAD = (-110.0, 110.0)
#: The centre of the turns of the heads: this far above the gauge point, mm.
_PIVOT: Vector = (0.0, 0.0, 220.0)
#: Half of a right angle as a part of a unit vector.
_HALF = math.sqrt(0.5)


def _polar() -> Parts:
    axes = {
        "R": rotary(Z),
        "H": linear(Z, (0.0, 700.0)),
        "L": linear(X, (0.0, 700.0)),
        "W": rotary(X, (600.0, 0.0, 500.0)),
    }
    gauge = {"point_mm": [600.0, 0.0, 500.0], "B_deg": 90.0}
    return Parts(("F", *axes), axes, gauge)


def _six() -> Parts:
    places = ((0.0, 400.0), (25.0, 400.0), (480.0, 400.0), (480.0, 435.0), (900.0, 435.0), (980.0, 435.0))
    points = [(x, 0.0, z) for x, z in places]
    directions = (back(Z), Y, Y, back(X), Y, back(X))
    travels = ((-170.0, 170.0), (-190.0, 45.0), (-120.0, 156.0), (-185.0, 185.0), (-120.0, 120.0), _ROUND)
    lines = zip(directions, points, travels, strict=True)
    axes = {f"J{number}": rotary(*line) for number, line in enumerate(lines, 1)}
    return Parts(("F", *axes), axes, {"point_mm": [980.0, 0.0, 435.0], "B_deg": 90.0})


def _track() -> Parts:
    heights = ((0.0, Z), (360.0, Y), (360.0, Z), (780.0, back(Y)), (780.0, Z), (1180.0, Y), (1306.0, Z))
    axes: dict[str, Keys] = {"E1": {**linear(X, (0.0, 3000.0)), "correct": False}}
    for number, (height, direction) in enumerate(heights, 1):
        axes[f"J{number}"] = rotary(direction, (0.0, 0.0, height), (-170.0, 170.0))
    return Parts(("F", *axes), axes, {"point_mm": [0.0, 0.0, 1306.0]})


def _around(radius_mm: float, angles_deg: tuple[float, ...]) -> list[Vector]:
    rays = (math.radians(angle) for angle in angles_deg)
    return [(radius_mm * math.cos(angle), radius_mm * math.sin(angle), 0.0) for angle in rays]


def _hexapod() -> Parts:
    bases = _around(662.5, (150.0, 30.0, 30.0, 270.0, 270.0, 150.0))
    ends = _around(288.6, (95.0, 85.0, 335.0, 325.0, 215.0, 205.0))
    return legs(bases, ends, (0.0, 0.0, 700.0), (700.0, 1100.0))


def _tripod() -> Parts:
    bases: list[Vector] = [(0.0, 0.0, 0.0), (900.0, 0.0, 0.0), (430.0, 780.0, 0.0)]
    return legs(bases, [(0.0, 0.0, 0.0)] * 3, (400.0, 300.0, 800.0), (600.0, 1200.0))


#: By name what the structure is, and its parts.
STRUCTURES: Mapping[str, tuple[str, Callable[[], Parts]]] = {
    "trunnion-ac": (
        "a table that turns about C on a cradle A, and a tool that moves",
        lambda: with_turns(
            "C A Y F X Z",
            ("A", back(X), (0.0, 0.0, -180.0), _TILT),
            ("C", back(Z), (0.0, 0.0, -230.0), _ROUND),
        ),
    ),
    "trunnion-bc": (
        "a table that turns about C on a cradle B, and a tool that moves",
        lambda: with_turns(
            "C B X F Y Z",
            ("B", back(Y), (0.0, 0.0, -180.0), _HEAD),
            ("C", back(Z), (0.0, 0.0, -230.0), _ROUND),
        ),
    ),
    "head-table": (
        "a table that turns about C, and a head that swivels about B",
        lambda: with_turns(
            "C F X Y Z B", ("B", Y, _PIVOT, _HEAD), ("C", back(Z), (100.0, 0.0, -300.0), _ROUND)
        ),
    ),
    "head-head": (
        "a fork head: A on C",
        lambda: with_turns("F X Y Z C A", ("C", Z, _PIVOT, _ROUND), ("A", X, _PIVOT, _HEAD)),
    ),
    "gantry-wrist": (
        "a gantry with a wrist: B on C",
        lambda: with_turns("F X Y Z C B", ("C", Z, _PIVOT, _ROUND), ("B", back(Y), _PIVOT, _HEAD)),
    ),
    "nutating-head": (
        "a head whose B axis lies at 45 degrees, on C",
        lambda: with_turns(
            "F X Y Z C B", ("C", Z, _PIVOT, _ROUND), ("B", (0.0, _HALF, _HALF), _PIVOT, (-180.0, 180.0))
        ),
    ),
    "polar": ("a column that turns, a slide on it, a wrist", _polar),
    "scara": (
        "two links that turn, a quill that moves and turns",
        lambda: scara(490.0, 340.0, 0.0, 250.0, 0.0, 50.0),
    ),
    "arm-6": ("an arm of six joints with a wrist", _six),
    "arm-7-track": ("an arm of seven joints on a track", _track),
    "linear-delta": (
        "three carriages on towers, two rods each",
        lambda: linear_delta(250.0, 520.0, 60.0, 90.0),
    ),
    "rotary-delta": (
        "three arms that turn, two rods each",
        lambda: rotary_delta(200.0, 300.0, 500.0, 80.0, 90.0),
    ),
    "tripod": ("a platform on three legs of driven length, which does not turn", _tripod),
    "hexapod": ("a platform on six legs of driven length", _hexapod),
}


def machine_of_structure(structure: str, name: str, controller: str | None = None) -> Written:
    """The machine file of a structure with the dimensions of an example. Raises UsageError for a name that is
    not known."""
    if structure not in STRUCTURES:
        near = nearest(structure, list(STRUCTURES))
        hint = f"did you mean {near}?" if near else f"expected one of {', '.join(STRUCTURES)}"
        raise UsageError(f"--structure {structure}: {hint}")
    words, parts = STRUCTURES[structure]
    notes = [
        f"Structure {structure}: {words}; all dimensions and travels are those of an example: put those of "
        "your control there",
        "The directions of rotary axes say how the tool turns relative to the workpiece: compare them with "
        "olp inspect and the machine",
    ]
    return machine_file(parts(), name, controller, notes)
