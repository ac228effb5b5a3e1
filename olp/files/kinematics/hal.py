"""A machine file from a HAL or INI file of LinuxCNC: the kinematics module that it loads, and its parameters.

Source: the man pages kins(9), genhexkins(9) and others of LinuxCNC 2.9, and its modules, which judge this.
Lengths are in machine units, taken as mm.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
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
from olp.files.kinematics.hal_commands import Command, hal_commands
from olp.files.kinematics.written import WIDE_DEG, WIDE_MM, Parts, Written, machine_file
from olp.files.write import PathLike

#: Whole lengths of legs that are taken as travel where nothing states it, mm.
_LEG_MM = (1.0, 1e4)
#: The foot of rods from the centre of the platform: lineardeltakins knows the difference of radii alone, mm.
_FOOT_MM = 60.0

#: Pins that are no dimension of a machine: the tool, and how a pose is computed.
_IDLE = {
    "tool-offset", "convergence-criterion", "limit-iterations", "max-error", "max-iterations",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Pins:
    """What a HAL file sets of one module: values by pin, each with its line."""

    file: str
    module: str
    values: Mapping[str, tuple[float, int]] = field(default_factory=dict)
    asked: set[str] = field(default_factory=set)

    def __call__(self, pin: str, default: float | None = None) -> float:
        """The value of a pin. Raises InputError where the file does not set it."""
        self.asked.add(pin)
        if pin in self.values:
            return self.values[pin][0]
        if default is None:
            raise InputError(
                f"sets no {self.module}.{pin}; state it with setp, because its default is not that of every "
                "version",
                file=self.file,
            )
        return default

    def refuse_unread(self) -> None:
        """Raises InputError for a pin that is set and has no part in the machine file, unless it is 0: it may
        turn an axis round, or move one."""
        for pin, (value, line) in self.values.items():
            if value and pin not in self.asked and pin not in _IDLE:
                raise InputError(
                    f"sets {self.module}.{pin} = {value:g}, which is not read; describe the machine by hand "
                    "where it matters, or leave it out",
                    file=self.file, line=line,
                )  # fmt: skip

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
    """The machine file of the kinematics that a HAL file, or an INI file with the HAL files that it names,
    loads and sets. Raises InputError where a file cannot be read, none that is known is loaded, a dimension
    is left out, or a pin is set that is not read."""
    pins = _read(hal_commands(path), str(path))
    parts = MODULES[pins.module](pins)
    pins.refuse_unread()
    notes = [
        f"{pins.module}: lengths are taken as mm",
        f"Travel is not read; {WIDE_MM[0]:g} to {WIDE_MM[1]:g} mm and {WIDE_DEG[0]:g} to "
        f"{WIDE_DEG[1]:g} deg or wider are written: put those of the INI file there",
    ]
    return machine_file(parts, name, controller or "linuxcnc", notes)


def _read(commands: Sequence[Command], file: str) -> Pins:
    loaded: dict[str, None] = {}
    values: dict[str, dict[str, tuple[float, int]]] = {module: {} for module in MODULES}
    signals: dict[str, Command] = {}
    wired: dict[tuple[str, str], Command] = {}
    for command in commands:
        words = command.words
        if len(words) >= 2 and words[0] == "loadrt" and words[1] in MODULES:
            loaded[words[1]] = None
        elif len(words) >= 3 and words[0] == "sets":
            signals[words[1]] = command
        elif len(words) >= 3 and words[0] == "net":
            for module, pin in (word.split(".", 1) for word in words[2:] if "." in word):
                if module in MODULES:
                    wired[module, pin] = command
        elif len(words) >= 3 and words[0] == "setp":
            module, _, pin = words[1].partition(".")
            if module in MODULES:
                values[module][pin] = (_number(words[1], words[2], command), command.line)
    for (module, pin), command in wired.items():
        signal = signals.get(command.words[1])
        if signal is not None:
            values[module][pin] = (_number(command.words[1], signal.words[2], signal), signal.line)
        elif pin not in _IDLE:
            raise InputError(
                f"{module}.{pin} follows the signal {command.words[1]}, whose value is not stated; state it "
                "with sets or setp",
                file=command.file, line=command.line,
            )  # fmt: skip
    named = list(dict.fromkeys([*loaded, *(module for module, pins in values.items() if pins)]))
    if len(named) != 1:
        found = f"loads {len(named)} of them ({', '.join(named)})" if named else "loads none of them"
        raise InputError(f"{found}; expected one kinematics module of {', '.join(MODULES)}", file=file)
    return Pins(file, named[0], values[named[0]])


def _number(pin: str, text: str, command: Command) -> float:
    try:
        value = float(text) if not re.search(r"[^-+.\deE]", text) else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            f"{command.words[0]} {pin} {text}: expected a number; put the value there that it has",
            file=command.file, line=command.line,
        )  # fmt: skip
    return value
