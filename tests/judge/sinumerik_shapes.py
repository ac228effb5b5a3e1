"""A judge of shapes that Sinumerik programs state: polar positions, angles, circles through points and
tangential ones, roundings and chamfers, in G17. Points are complex numbers; roundings are solved numerically.

It shares no code with the package, and reads one block a line with the words that its own programs have.
"""

from __future__ import annotations

import cmath
import math
import re

import numpy as np
from scipy.optimize import fsolve

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
_WORD = re.compile(rf"([A-Z]+\d?)=(AC|IC)?\(?({_NUMBER})\)?|([A-Z])({_NUMBER})|(CIP|CT)\b")


class Arc:
    """A circle from `a` about `centre` by an angle in rad, to the left above 0; a line where that is 0."""

    def __init__(self, a: complex, b: complex, centre: complex = 0j, sweep: float = 0.0) -> None:
        self.a, self.b, self.centre, self.sweep = a, b, centre, sweep

    def at(self, share: float) -> complex:
        if not self.sweep:
            return self.a + (self.b - self.a) * share
        return self.centre + (self.a - self.centre) * cmath.exp(1j * self.sweep * share)

    def along(self, share: float) -> complex:
        """The direction of travel."""
        step = self.at(share + 1e-6) - self.at(share - 1e-6)
        return step / abs(step)

    def near(self, point: complex) -> float:
        """The share at which a point of its line or circle is."""
        if not self.sweep:
            d = self.b - self.a
            return ((point - self.a) * d.conjugate()).real / abs(d) ** 2
        return cmath.phase((point - self.centre) / (self.at(0.5) - self.centre)) / self.sweep + 0.5

    def foot(self, point: complex) -> complex:
        if not self.sweep:
            return self.at(self.near(point))
        away = point - self.centre
        return self.centre + away / abs(away) * abs(self.a - self.centre)

    def cut(self, a: complex, b: complex) -> Arc:
        return Arc(a, b, self.centre, self.sweep * (self.near(b) - self.near(a)))


def _between(a: complex, b: complex, centre: complex, left: bool) -> Arc:
    turn = cmath.phase((b - centre) / (a - centre)) % (2 * math.pi)
    return Arc(a, b, centre, turn if left else turn - 2 * math.pi)


def _about(a: complex, b: complex, c: complex) -> complex:
    """The centre of three points."""
    rows = [[2 * (p - a).real, 2 * (p - a).imag] for p in (b, c)]
    x, y = np.linalg.solve(rows, [abs(p) ** 2 - abs(a) ** 2 for p in (b, c)])
    return complex(x, y)


def _round(one: Arc, other: Arc, size: float) -> list[Arc]:
    a, b = one.along(1.0), other.along(0.0)
    left = (a.conjugate() * b).imag > 0
    inward = (b - a) / abs(b - a)
    half = abs(cmath.phase(b / a)) / 2
    guess = one.b + inward * size / math.cos(half)

    def off(v: np.ndarray) -> list[float]:
        c = complex(*v)
        return [abs(c - leg.foot(c)) - size for leg in (one, other)]

    c = complex(*fsolve(off, [guess.real, guess.imag], xtol=1e-10))
    first, last = one.foot(c), other.foot(c)
    return [one.cut(one.a, first), _between(first, last, c, left), other.cut(last, other.b)]


def _chamfer(one: Arc, other: Arc, size: float, across: bool) -> list[Arc]:
    a, b = one.along(1.0), other.along(0.0)
    leg = size / abs(a + b) if across else size
    first, last = one.b - a * leg, one.b + b * leg
    return [Arc(one.a, first), Arc(first, last), Arc(last, other.b)]


def elements(text: str) -> list[Arc]:
    """The lines and circles of a program, in its plane."""
    here, pole, angle, radius = 0j, 0j, 0.0, 0.0
    motion, relative, always = "G1", False, 0.0
    done: list[Arc] = []
    corner: tuple[str, float] = ("", 0.0)
    for line in text.splitlines():
        words: dict[str, tuple[str, float]] = {}
        pole_code = ""
        for name, how, number, letter, value, mode in _WORD.findall(line.partition(";")[0]):
            if mode:
                motion = mode
            elif letter == "G" and value in "0123":
                motion = f"G{value}"
            elif letter == "G" and value in ("90", "91"):
                relative = value == "91"
            elif letter == "G" and value in ("110", "111", "112"):
                pole_code = value
            elif letter:
                words[letter] = ("", float(value))
            else:
                words[name] = (how, float(number))
        if "RNDM" in words:
            always = words["RNDM"][1]
        if pole_code:
            base = {"110": here, "111": 0j, "112": pole}[pole_code]
            pole = base + complex(words.get("X", ("", 0.0))[1], words.get("Y", ("", 0.0))[1])
            continue

        def place(  # type: ignore[no-untyped-def]
            x: str, y: str, start=here, of=words, relative=relative
        ) -> complex:
            parts = []
            for name, now in ((x, start.real), (y, start.imag)):
                how, value = of.get(name, ("", math.nan))
                counted = how == "IC" or (relative and how != "AC")
                parts.append(now if math.isnan(value) else value + now * counted)
            return complex(*parts)

        if not {"X", "Y", "AP", "RP", "AR"} & set(words):
            continue
        end = place("X", "Y")
        if {"AP", "RP"} & set(words):
            how, value = words.get("AP", ("IC", 0.0))
            angle = angle * (how == "IC") + value
            how, value = words.get("RP", ("IC", 0.0))
            radius = radius * (how == "IC") + value
            end = pole + cmath.rect(radius, math.radians(angle))
        if "ANG" in words:
            tangent = math.tan(math.radians(words["ANG"][1]))
            gone = end - here
            end = here + (complex(gone.real, gone.real * tangent) if "X" in words
                          else complex(gone.imag / tangent, gone.imag))  # fmt: skip
        if motion == "CIP":
            middle = place("I1", "J1")
            centre = _about(here, middle, end)
            new = _between(here, end, centre, left=((middle - here).conjugate() * (end - here)).imag > 0)
        elif motion == "CT":
            along = done[-1].along(1.0)
            turn = 2 * cmath.phase((end - here) / along)
            centre = here + along * 1j * abs(end - here) / (2 * math.sin(turn / 2))
            new = Arc(here, end, centre, turn)
        elif motion in ("G0", "G1"):
            new = Arc(here, end)
        elif "AR" in words:
            turn = cmath.exp(1j * math.radians(words["AR"][1]) * (1 if motion == "G3" else -1))
            if {"I", "J"} & set(words):
                centre = here + complex(words.get("I", ("", 0.0))[1], words.get("J", ("", 0.0))[1])
                end = centre + (here - centre) * turn
            else:
                centre = (end - here * turn) / (1 - turn)
            new = _between(here, end, centre, left=motion == "G3")
        elif "CR" in words:
            size = words["CR"][1]
            high = math.sqrt(max(size**2 - abs(end - here) ** 2 / 4, 0.0))
            side = 1 if (motion == "G3") == (size > 0) else -1
            unit = (end - here) / abs(end - here)
            new = _between(here, end, (here + end) / 2 + 1j * unit * high * side, left=motion == "G3")
        elif {"AP", "RP"} & set(words) and not {"I", "J"} & set(words):
            new = _between(here, end, pole, left=motion == "G3")
        else:
            parts = [words.get(k, ("", 0.0)) for k in "IJ"]
            centre = complex(*(v + n * (how != "AC") for (how, v), n in
                               zip(parts, (here.real, here.imag), strict=True)))  # fmt: skip
            new = _between(here, end, centre, left=motion == "G3")
        here = end
        if corner[1] and done and abs(cmath.phase(new.along(0.0) / done[-1].along(1.0))) > 1e-5:
            kind, size = corner
            before = done.pop()
            done += _round(before, new, size) if kind == "RND" else _chamfer(before, new, size, kind == "CHF")
        else:
            done.append(new)
        stated = [(k, words[k][1]) for k in ("RND", "CHF", "CHR") if k in words]
        corner = stated[0] if stated else ("RND", always)
        if motion == "G0":
            corner = ("", 0.0)
    return done
