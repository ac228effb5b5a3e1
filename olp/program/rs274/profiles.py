"""Dialect profiles of the RS-274 family: what each word of a control means to the path.

One table per profile decides for the interpreter, the support matrix of `olp inspect` and the
documentation alike. G codes are keyed by ten times their number (G5.1 is 51).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

from olp.program.dialect import Dialect, Row, Support


class Act(IntEnum):
    """What a G code does to the reading of a program."""

    CARRY = 0  #: nothing: its bytes are carried
    MOTION = 1
    PLANE = 2
    DISTANCE = 3
    ARC_DISTANCE = 4
    FEED = 5
    RETRACT = 6
    EVENT = 7  #: changes frames, units, tools or path mode; handled block by block
    REFUSE = 8


_SUPPORT = {Act.CARRY: Support.CARRIED, Act.REFUSE: Support.REFUSED, Act.MOTION: Support.CORRECTED}


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile(Dialect):
    """One control's reading of word-address text."""

    family: str = "rs274"
    first: tuple[bytes, ...] = (b"%", b"O|:")
    codes: Mapping[int, Act]
    refusals: Mapping[int, str]
    harmless_m: frozenset[int]
    #: X100 means 100 least increments, not 100 mm
    increments_without_point: bool
    #: G codes that are in force at the start
    motion: int | None
    #: G52 writes the same offset as G92
    g52_is_g92: bool
    #: canned cycles and G80 are a modal group of their own
    cycles_apart: bool

    def dwell_s(self, number: float, *, pointed: bool) -> float:
        """Seconds of a P word; Fanuc and Haas count milliseconds where it has no decimal point."""
        return number / 1000.0 if self.increments_without_point and not pointed else number

    def rows(self) -> Sequence[Row]:
        return [
            Row(
                f"G{code / 10:g}",
                _SUPPORT.get(act, Support.READ),
                self.refusals.get(code, "is no code of this control") if act is Act.REFUSE else "",
            )
            for code, act in sorted(self.codes.items())
        ]


_REFUSE = {
    50: "G5 is a spline or a high-speed mode of this control",
    51: "G5.1 is a spline or a smoothing mode",
    52: "G5.2 is a NURBS block",
    53: "G5.3 is a NURBS block",
    60: "G6 is a spline block",
    70: "G7 (diameter mode) belongs to lathes",
    71: "G7.1 (cylindrical interpolation) moves a rotary axis",
    101: "G10.1 is not known here",
    120: "G12 (circular pocket or polar interpolation) is a cycle of the control",
    121: "G12.1 (polar interpolation) moves a rotary axis",
    130: "G13 is a cycle of the control",
    160: "G16 (polar coordinates) is not read yet",
    310: "G31 (skip) ends where a signal comes",
    330: "G33 cuts a thread, which a correction would distort",
    331: "G33.1 (rigid tapping) is synchronous with the spindle",
    434: "G43.4 (tool centre point control) needs rotary axes",
    510: "G51 (scaling) is not read yet",
    511: "G51.1 (mirror image) is not read yet",
    650: "G65 calls a macro",
    660: "G66 calls a macro",
    680: "G68 (rotation) is not read yet",
    682: "G68.2 (tilted plane) is not read yet",
    760: "G76 threads or fine-bores, which a correction would distort",
    870: "G87 (back boring) moves off axis inside the control",
    880: "G88 waits for a person inside the control",
    281: "G28.1 stores the present position, and no word of it can be edited",
    301: "G30.1 stores the present position, and no word of it can be edited",
    410: "G41 (cutter compensation) makes the path inside the control",
    411: "G41.1 (cutter compensation) makes the path inside the control",
    420: "G42 (cutter compensation) makes the path inside the control",
    421: "G42.1 (cutter compensation) makes the path inside the control",
}

CUTTER_COMPENSATION = frozenset({410, 411, 420, 421})
CYCLES = frozenset({730, 740, 810, 820, 830, 840, 850, 860, 890})
PROBES = frozenset({382, 383, 384, 385})


def _codes(*, carry: set[int], extra: dict[int, Act], without: set[int]) -> dict[int, Act]:
    codes = dict.fromkeys((0, 10, 20, 30, 800, *CYCLES, *PROBES), Act.MOTION)
    codes |= dict.fromkeys((330, 331, 760, 870, 880), Act.REFUSE)
    codes |= dict.fromkeys((170, 180, 190), Act.PLANE)
    codes |= dict.fromkeys((900, 910), Act.DISTANCE)
    codes |= dict.fromkeys((930, 940, 950), Act.FEED)
    codes |= dict.fromkeys((980, 990), Act.RETRACT)
    codes |= dict.fromkeys((40, 100, 200, 210, 280, 300, 430, 490, 520, 530, 610, 640, 920), Act.EVENT)
    codes |= dict.fromkeys(range(540, 600, 10), Act.EVENT)
    codes |= dict.fromkeys((400, 960, 970, *carry), Act.CARRY)
    codes |= dict.fromkeys((code for code in _REFUSE), Act.REFUSE)
    codes |= extra
    return {code: act for code, act in codes.items() if code not in without}


_EVENTS_LINUXCNC = dict.fromkeys((431, 432, 591, 592, 593, 611, 921, 922, 923), Act.EVENT)
_ARC_DISTANCE = dict.fromkeys((901, 911), Act.ARC_DISTANCE)
_ISO_M = frozenset({0, 1, 2, 3, 4, 5, 7, 8, 9, 19, 30, 48, 49})

LINUXCNC = Profile(
    name="linuxcnc",
    title="LinuxCNC and other RS274/NGC interpreters",
    codes=_codes(carry={80}, extra=_EVENTS_LINUXCNC | _ARC_DISTANCE, without=set()),
    refusals=_REFUSE,
    harmless_m=_ISO_M | {50, 51, 52, 53} | frozenset(range(62, 69)),
    increments_without_point=False,
    motion=None,
    g52_is_g92=True,
    path_mode="G64 without tolerance, LinuxCNC's default",
    inch_decimals=5,
    free_digits=1,
    cycles_apart=False,
)
GRBL = Profile(
    name="grbl",
    title="Grbl 1.1 and its descendants",
    codes=_codes(
        carry=set(),
        extra={431: Act.EVENT, 911: Act.ARC_DISTANCE, 921: Act.EVENT, 611: Act.REFUSE},
        without={330, 331, 520, 300, 960, 970, 730, 740, 760, 810, 820, 830, 840, 850, 860, 870, 880, 890}
        | {950, 980, 990, 430, 640, 281, 301, 411, 421, 410, 420},
    ),
    refusals=_REFUSE,
    harmless_m=_ISO_M | {56},
    increments_without_point=False,
    motion=0,
    g52_is_g92=False,
    path_mode="junction deviation of the control ($11)",
    inch_decimals=5,
    free_digits=1,
    cycles_apart=False,
)
_ISO_CARRY = {50, 51, 80, 90, 110, 150, 500, 501, 620, 630, 670, 690, 691, 131, 231, 250}
FANUC = Profile(
    name="fanuc",
    title="Fanuc and compatible ISO controls (system A words of mills)",
    codes=_codes(
        carry=_ISO_CARRY - {50},
        extra={440: Act.EVENT, 541: Act.EVENT, 921: Act.REFUSE, 51: Act.CARRY},
        without=set(),
    ),
    refusals=_REFUSE | {921: "G92.1 presets offsets that are not known off line"},
    harmless_m=_ISO_M | {10, 11, 29, 13, 88, 89},
    increments_without_point=True,
    motion=None,
    g52_is_g92=False,
    path_mode="cutting mode G64 of the control, unless a smoothing mode is on",
    inch_decimals=4,
    free_digits=0,
    cycles_apart=True,
)
HAAS = Profile(
    name="haas",
    title="Haas mills",
    codes=_codes(
        carry=(_ISO_CARRY - {50, 51, 110}) | {1030, 1870},
        extra={440: Act.EVENT, 541: Act.EVENT, 921: Act.REFUSE, 1540: Act.EVENT}
        | dict.fromkeys(range(1100, 1300, 10), Act.EVENT),
        without=set(),
    ),
    refusals=_REFUSE | {921: "G92.1 is not a code of this control"},
    harmless_m=_ISO_M | {10, 11, 29, 31, 33, 34, 35, 41, 42, 59, 69, 83, 84, 88, 89},
    increments_without_point=True,
    motion=None,
    g52_is_g92=False,
    path_mode="the control's own smoothing (G187)",
    inch_decimals=4,
    free_digits=0,
    cycles_apart=True,
)

PROFILES: Mapping[str, Profile] = {p.name: p for p in (LINUXCNC, FANUC, GRBL, HAAS)}
