"""A machine file from a HAL file of LinuxCNC: the kinematics module that it loads, and its parameters.

Source: the man pages kins(9), genhexkins(9) and others of LinuxCNC 2.9, and its modules, which judge this.
Lengths are in machine units, taken as mm.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import field

from olp.core.errors import InputError
from olp.core.machine import Vector
from olp.core.values import dataclass
from olp.files.kinematics.families import (
    X,
    Y,
    Z,
    arm,
    back,
    legs,
    linear_delta,
    rotary_delta,
    scara,
    with_turns,
)
from olp.files.kinematics.written import WIDE_DEG, WIDE_MM, Parts, Written, machine_file
from olp.files.write import PathLike, read_bytes

#: Whole lengths of legs that are taken as travel where nothing states it, mm.
_LEG_MM = (1.0, 1e4)
#: The foot of rods from the centre of the platform: lineardeltakins knows the difference of radii alone, mm.
_FOOT_MM = 60.0


@dataclass(frozen=True, slots=True)
class Pins:
    """What a HAL file sets of one module: values by pin, each with its line."""

    file: str
    module: str
    values: Mapping[str, tuple[float, int]] = field(default_factory=dict)

    def __call__(self, pin: str, default: float | None = None) -> float:
        """The value of a pin. Raises InputError where the file does not set it."""
        if pin in self.values:
            return self.values[pin][0]
        if default is None:
            raise InputError(
                f"sets no {self.module}.{pin}; state it with setp, because its default is not that of every "
                "version",
                file=self.file,
            )
        return default

    def vector(self, stem: str) -> Vector:
        return (self(f"{stem}.x"), self(f"{stem}.y"), self(f"{stem}.z"))


def _tables(letter: str, direction: Vector, across: str) -> Callable[[Pins], Parts]:
    """xyzac-trt-kins and xyzbc-trt-kins: two tables, which turn against ISO 841 (LinuxCNC issue 2435)."""

    def parts(pins: Pins) -> Parts:
        x, y, z = (pins(f"{axis}-rot-point", 0.0) for axis in "xyz")
        lifted = z + pins("z-offset", 0.0)
        beside = pins(f"{across}-offset", 0.0)
        point = (x, y + beside, lifted) if across == "y" else (x + beside, y, lifted)
        return with_turns(
            f"C {letter} F X Y Z",
            (letter, back(direction), point, WIDE_DEG),
            ("C", back(Z), (x, y, z), WIDE_DEG),
        )

    return parts


def _head(pins: Pins) -> Parts:
    pivot = (0.0, 0.0, pins("pivot-length"))
    return with_turns("F X Y Z C B", ("B", back(Y), pivot, WIDE_DEG), ("C", Z, pivot, WIDE_DEG))


def _puma(pins: Pins) -> Parts:
    a2, a3, d3, d4, d6 = (pins(name) for name in ("A2", "A3", "D3", "D4", "D6"))
    rows = [(0.0, 0.0, 0.0, 0.0), (0.0, -90.0, 0.0, 0.0), (a2, 0.0, d3, 0.0)]
    rows += [(a3, -90.0, d4, 0.0), (0.0, 90.0, 0.0, 0.0), (0.0, -90.0, d6, 0.0)]
    return arm(rows)


def _serial(pins: Pins) -> Parts:
    rows = [
        (pins(f"A-{n}"), math.degrees(pins(f"ALPHA-{n}")), pins(f"D-{n}"), 0.0) for n in range(6)
    ]  # fmt: skip
    return arm(rows)


def _tripod(pins: Pins) -> Parts:
    bases = [(0.0, 0.0, 0.0), (pins("Bx"), 0.0, 0.0), (pins("Cx"), pins("Cy"), 0.0)]
    x, y = (sum(base[k] for base in bases) / len(bases) for k in range(2))
    start = (x, y, max(abs(pins("Bx")), abs(pins("Cy"))))
    return legs(bases, [(0.0, 0.0, 0.0)] * 3, start, _LEG_MM)


def _hexapod(pins: Pins) -> Parts:
    if pins("screw-lead", 0.0):
        raise InputError(
            f"sets {pins.module}.screw-lead; the turn of the screws with the joints is not built",
            file=pins.file,
        )
    bases, ends = ([pins.vector(f"{what}.{leg}") for leg in range(6)] for what in ("base", "platform"))
    above = max(math.hypot(*base) for base in bases)
    return legs(bases, ends, (0.0, 0.0, above), _LEG_MM)


#: By module what it makes.
MODULES: Mapping[str, Callable[[Pins], Parts]] = {
    "xyzac-trt-kins": _tables("A", X, "y"),
    "xyzbc-trt-kins": _tables("B", Y, "x"),
    "5axiskins": _head,
    "pumakins": _puma,
    "genserkins": _serial,
    "scarakins": lambda pins: scara(*(pins(f"D{number}") for number in range(1, 7))),
    "tripodkins": _tripod,
    "genhexkins": _hexapod,
    "lineardeltakins": lambda pins: linear_delta(pins("R"), pins("L"), _FOOT_MM),
    "rotarydeltakins": lambda pins: rotary_delta(
        pins("platformradius"), pins("thighlength"), pins("shinlength"), pins("footradius")
    ),
}


def machine_of_hal(path: PathLike, name: str, controller: str | None = None) -> Written:
    """The machine file of the kinematics that a HAL file loads and sets. Raises InputError where the file
    cannot be read, loads none that is known, or leaves a dimension out."""
    pins = _read(read_bytes(path).decode("utf-8", "replace"), str(path))
    parts = MODULES[pins.module](pins)
    notes = [
        f"{pins.module}: lengths are taken as mm",
        f"A HAL file states no travel; {WIDE_MM[0]:g} to {WIDE_MM[1]:g} mm and {WIDE_DEG[0]:g} to "
        f"{WIDE_DEG[1]:g} deg or wider are written: put those of the INI file there",
    ]
    return machine_file(parts, name, controller or "linuxcnc", notes)


def _read(text: str, file: str) -> Pins:
    loaded: dict[str, int] = {}
    values: dict[str, dict[str, tuple[float, int]]] = {module: {} for module in MODULES}
    for line, statement in enumerate(text.splitlines(), 1):
        words = statement.partition("#")[0].split()
        if len(words) >= 2 and words[0] == "loadrt" and words[1] in MODULES:
            loaded.setdefault(words[1], line)
        if len(words) < 3 or words[0] != "setp":
            continue
        module, _, pin = words[1].partition(".")
        if module in MODULES:
            values[module][pin] = (_number(words[1], words[2], file, line), line)
    named = list(dict.fromkeys([*loaded, *(module for module, pins in values.items() if pins)]))
    if len(named) != 1:
        found = f"loads {len(named)} of them ({', '.join(named)})" if named else "loads none of them"
        raise InputError(f"{found}; expected one kinematics module of {', '.join(MODULES)}", file=file)
    return Pins(file, named[0], values[named[0]])


def _number(pin: str, text: str, file: str, line: int) -> float:
    try:
        value = float(text) if not re.search(r"[^-+.\deE]", text) else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            f"setp {pin} {text}: expected a number; put the value there that it has", file=file, line=line
        )
    return value
