"""A small reader of rotated, scaled and mirrored programs of ISO controls, from what their manuals say.

It knows G0 to G3 in the plane of X and Y, G90 and G91, and one of G68 X Y R, G51 X Y Z with P or I J K, and
G51.1 X Y at a time. Points of the plane are complex numbers. A point w of the program is at c + a (w - c)
where a program is turned by a about c, and mirrored ones are conjugate.
"""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Callable
from dataclasses import dataclass

WORD = re.compile(r"([A-Z])\s*([-+]?\d*\.?\d*)")
#: what a factor of G51 counts
UNIT = 0.001


@dataclass(frozen=True)
class Cut:
    """A move of the tool in the work offset: its line, and the points that it passes."""

    line: int
    rapid: bool
    points: list[tuple[complex, float]]


def cuts(text: str, steps: int = 8, unit: float | None = UNIT) -> list[Cut]:
    """The moves whose ends are stated; arcs are passed in `steps`."""
    place: Callable[[complex], complex] = lambda w: w  # noqa: E731
    heights: Callable[[float], float] = lambda z: z  # noqa: E731
    mirrors: dict[str, float] = {}
    here, level, motion, absolute = complex(0, 0), 0.0, 0, True
    moves: list[Cut] = []
    for number, block in enumerate(text.splitlines(), 1):
        words = [
            (letter, float(value)) for letter, value in WORD.findall(re.sub(r"\(.*?\)|[%O].*", "", block))
        ]
        codes, by = [v for a, v in words if a == "G"], {a: v for a, v in words if a not in "GM"}
        absolute = 90 in codes or (absolute and 91 not in codes)
        for undo in (69, 50, 50.1):
            if undo in codes:
                place, heights, mirrors = (lambda w: w), (lambda z: z), {}
        if 68 in codes:
            place = _turned(complex(by["X"], by["Y"]), cmath.rect(1, math.radians(by["R"])))
            continue
        if 51 in codes:
            factor = [by["P"]] * 3 if "P" in by else [by[a] for a in "IJK"]
            factor = [f * unit if unit else f for f in factor]
            place = _scaled(complex(by["X"], by["Y"]), factor)
            heights = _stretched(by["Z"], factor[2])
            continue
        if 51.1 in codes:
            mirrors |= {a: by[a] for a in "XY" if a in by}
            place = _mirrored(dict(mirrors))
            continue
        motion = next((int(c) for c in codes if c in (0, 1, 2, 3)), motion)
        if not set(by) & set("XYZIJR"):
            continue
        old, rise = here, level
        if absolute:
            here = complex(by.get("X", here.real), by.get("Y", here.imag))
            level = by.get("Z", level)
        else:
            here += complex(by.get("X", 0.0), by.get("Y", 0.0))
            level += by.get("Z", 0.0)
        shares = [(k + 1) / steps for k in range(steps)] if motion > 1 else [1.0]
        path = _arc(old, here, motion == 2, by) if motion > 1 else (lambda s, a=old, b=here: a + s * (b - a))
        points = [(place(path(s)), heights(rise + s * (level - rise))) for s in shares]
        moves.append(Cut(number, motion == 0, points))
    return moves


def _turned(about: complex, by: complex) -> Callable[[complex], complex]:
    return lambda w: about + by * (w - about)


def _scaled(about: complex, factor: list[float]) -> Callable[[complex], complex]:
    return lambda w: about + complex(factor[0] * (w - about).real, factor[1] * (w - about).imag)


def _stretched(about: float, factor: float) -> Callable[[float], float]:
    return lambda z: about + factor * (z - about)


def _mirrored(at: dict[str, float]) -> Callable[[complex], complex]:
    def place(w: complex) -> complex:
        if "X" in at:
            w = 2 * at["X"] - w.conjugate()
        return w if "Y" not in at else w.conjugate() + 2j * at["Y"]

    return place


def _arc(start: complex, end: complex, clockwise: bool, by: dict[str, float]) -> Callable[[float], complex]:
    if "R" in by:
        half = (end - start) / 2
        # the centre of a short arc lies to the left of a counter-clockwise chord
        side = (1j if clockwise == (by["R"] < 0) else -1j) * half / abs(half)
        centre = start + half + side * math.sqrt(max(by["R"] ** 2 - abs(half) ** 2, 0.0))
    else:
        centre = start + complex(by.get("I", 0.0), by.get("J", 0.0))
    turn = cmath.phase((end - centre) / (start - centre))
    if clockwise and turn >= -1e-9:
        turn -= 2 * math.pi
    elif not clockwise and turn <= 1e-9:
        turn += 2 * math.pi
    wider = abs(end - centre) / abs(start - centre)
    return lambda s: centre + (start - centre) * cmath.rect(1 + s * (wider - 1), s * turn)
