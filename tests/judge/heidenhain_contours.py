"""What a Heidenhain control makes of contours: a reader that shares nothing with olp, in complex numbers.

It reads the words where the program has them, and turns what it found outward at the end. Roundings are found
by a search for the two points whose normals meet. What it does not know it does not read (ValueError).
"""

from __future__ import annotations

import cmath
import math
import re
import warnings
from dataclasses import dataclass, replace

from scipy.optimize import brentq, fsolve

from .heidenhain import NUMBER, joined

TURN = 2 * math.pi


@dataclass(frozen=True)
class Step:
    """A move to `end` at height `z`; an arc by `sweep` about `centre`, else straight. `rapid` at FMAX."""

    line: int
    start: complex
    end: complex
    z: float
    rapid: bool = False
    centre: complex = 0j
    sweep: float = 0.0
    planar: bool = True

    def after(self, share: float) -> complex:
        if not self.sweep:
            return self.start + share * (self.end - self.start)
        return self.centre + (self.start - self.centre) * cmath.exp(1j * self.sweep * share)

    def heading(self, share: float) -> complex:
        if not self.sweep:
            return (self.end - self.start) / abs(self.end - self.start)
        arm = self.after(share) - self.centre
        return arm / abs(arm) * 1j * math.copysign(1, self.sweep)

    def between(self, a: float, b: float) -> Step:
        return replace(self, start=self.after(a), end=self.after(b), sweep=self.sweep * (b - a))


def fillet(a: Step, b: Step, radius: float, line: int) -> tuple[Step, Step, Step]:
    turn = cmath.phase(b.heading(0) / a.heading(1))
    side = 1j * math.copysign(radius, turn)

    def apart(x: list[float]) -> list[float]:
        gap = a.after(x[0]) + side * a.heading(x[0]) - b.after(x[1]) - side * b.heading(x[1])
        return [gap.real, gap.imag]

    back = radius * math.tan(abs(turn) / 2)
    length = [abs(s.sweep) * abs(s.start - s.centre) if s.sweep else abs(s.end - s.start) for s in (a, b)]
    with warnings.catch_warnings():
        # between lines the first guess is right
        warnings.simplefilter("ignore")
        s, t = fsolve(apart, [1 - back / length[0], back / length[1]], xtol=1e-12)
    centre = a.after(s) + side * a.heading(s)
    begin, end = a.after(s), b.after(t)
    sweep = cmath.phase(b.heading(t) / a.heading(s))
    return a.between(0, s), Step(line, begin, end, a.z, False, centre, sweep), b.between(t, 1)


def chamfer(a: Step, b: Step, size: float, line: int) -> tuple[Step, Step, Step]:
    s, t = 1 - size / abs(a.end - a.start), size / abs(b.end - b.start)
    return a.between(0, s), Step(line, a.after(s), b.after(t), a.z), b.between(t, 1)


class Contours:
    """The state of one reading, in words of the program."""

    def __init__(self) -> None:
        self.steps: list[Step] = []
        self.shift, self.turn, self.mirror = 0j, 0.0, ""
        self.scale, self.tall, self.about = 1.0, 1.0, 0j
        self.here, self.z, self.pole = complex("nan"), math.nan, 0j
        self.corner: tuple[str, float, int] | None = None
        self.approach: tuple[str, dict[str, float], complex, complex, int, int] | None = None
        self.out: list[Step] = []

    # the frame
    def outward(self, p: complex) -> complex:
        p = self.about + (p - self.about) * self.scale
        p *= cmath.exp(1j * math.radians(self.turn))
        x = -p.real if "X" in self.mirror else p.real
        y = -p.imag if "Y" in self.mirror else p.imag
        return complex(x, y) + self.shift

    def flush(self) -> None:
        """Turn all steps so far outward."""
        sign = -1 if len(self.mirror) == 1 else 1
        for s in self.steps:
            self.out.append(replace(
                s, start=self.outward(s.start), end=self.outward(s.end), centre=self.outward(s.centre),
                sweep=s.sweep * sign, z=s.z * self.tall,
            ))  # fmt: skip
        self.steps = []

    def reframed(self, text: str) -> None:
        here, height = self.outward(self.here), self.z * self.tall
        self.flush()
        if match := re.match(rf"CYCL DEF 7\.\d *(I?)([XY]) *({NUMBER})", text):
            unit = 1 if match[2] == "X" else 1j
            old = (self.shift.real if unit == 1 else self.shift.imag) if not match[1] else 0.0
            self.shift += unit * (float(match[3]) - old)
        elif match := re.match(rf"CYCL DEF 10\.1 *(I?)ROT *({NUMBER})", text):
            self.turn = float(match[2]) + (self.turn if match[1] else 0.0)
        elif match := re.match(r"CYCL DEF 8\.1 *([XY ]*)$", text):
            self.mirror = match[1].replace(" ", "")
        elif match := re.match(rf"CYCL DEF 11\.1 *SCL *({NUMBER})", text):
            self.scale = self.tall = float(match[1])
        elif match := re.match(
            rf"CYCL DEF 26\.1 *X *({NUMBER}) *Y *\1 *CCX *({NUMBER}) *CCY *({NUMBER})", text
        ):
            self.scale, self.about = float(match[1]), complex(float(match[2]), float(match[3]))
        p = here - self.shift
        x = -p.real if "X" in self.mirror else p.real
        y = -p.imag if "Y" in self.mirror else p.imag
        inner = complex(x, y) * cmath.exp(-1j * math.radians(self.turn))
        self.here, self.z = self.about + (inner - self.about) / self.scale, height / self.tall

    # moves
    def target(self, text: str) -> tuple[complex, float]:
        x, y, z = self.here.real, self.here.imag, self.z
        for step, letter, number in re.findall(rf"\b(I?)([XYZ]) *({NUMBER})", text):
            value = float(number)
            if letter == "X":
                x = x * bool(step) + value if step else value
            elif letter == "Y":
                y = y + value if step else value
            else:
                z = z + value if step else value
        return complex(x, y), z

    def polar(self, text: str) -> complex:
        radius, angle = cmath.polar(self.here - self.pole)
        if match := re.search(rf"(I?)PR *({NUMBER})", text):
            radius = float(match[2]) + (radius if match[1] else 0)
        if match := re.search(rf"(I?)PA *({NUMBER})", text):
            angle = math.radians(float(match[2])) + (angle if match[1] else 0)
        return self.pole + cmath.rect(radius, angle)

    def arc(self, line: int, centre: complex, end: complex, sign: int) -> Step:
        sweep = sign * (cmath.phase((end - centre) / (self.here - centre)) * sign % TURN)
        return Step(line, self.here, end, self.z, False, centre, sweep or sign * TURN)

    def add(self, step: Step, z: float) -> None:
        step = replace(step, z=z)
        if self.approach is not None:
            self.approaching(step)
        if self.corner is not None:
            name, size, line = self.corner
            self.corner = None
            made = (fillet if name == "RND" else chamfer)(self.steps[-1], step, size, line)
            self.steps[-1:] = made[:2]
            step = made[2]
        self.steps.append(step)
        self.here, self.z = step.end, z

    def move(self, line: int, name: str, text: str) -> None:
        end, z = self.target(text)
        sign = 1 if "DR+" in text else -1
        if name in ("LP", "CTP"):
            end = self.polar(text)
        if name in ("L", "LP"):
            rapid = bool(re.search(r"F *MAX", text))
            planar = name == "LP" or bool(re.search(r"[XY] *[-+.\d]", text))
            self.add(Step(line, self.here, end, z, rapid, planar=planar), z)
        elif name == "C":
            self.add(self.arc(line, self.pole, end, sign), z)
        elif name == "CP":
            match = re.search(rf"IPA *({NUMBER})", text)
            assert match is not None
            sweep = math.radians(float(match[1]))
            end = self.pole + (self.here - self.pole) * cmath.exp(1j * sweep)
            self.add(Step(line, self.here, end, z, False, self.pole, sweep), z)
        elif name == "CR":
            match = re.search(rf"\bR *({NUMBER})", text)
            assert match is not None
            size, chord = float(match[1]), end - self.here
            lift = math.acos(min(abs(chord) / 2 / abs(size), 1.0)) * sign * math.copysign(1, size)
            centre = self.here + abs(size) * chord / abs(chord) * cmath.exp(1j * lift)
            self.add(self.arc(line, centre, end, sign), z)
        else:
            heading = self.steps[-1].heading(1)
            off = cmath.phase((end - self.here) / heading)
            centre = self.here + 1j * heading * abs(end - self.here) / 2 / math.sin(off)
            self.add(Step(line, self.here, end, z, False, centre, 2 * off), z)

    # approaches: the tool is on the right of the contour
    def approaching(self, first: Step) -> None:
        assert self.approach is not None
        form, size, start, end, line, where = self.approach
        self.approach = None
        way = first.heading(0)
        if form == "LT":
            made = [Step(line, start, end - size["LEN"] * way, self.z)]
        elif form == "LN":
            made = [Step(line, start, end - 1j * way * size["LEN"], self.z)]
        else:
            centre = end - 1j * way * size["R"]
            sign = -1 if size["R"] > 0 else 1
            sweep = math.radians(size["CCA"]) if form == "CT" else touching(start, centre, end, sign)
            helper = centre + (end - centre) * cmath.exp(-1j * sign * sweep)
            made = [Step(line, start, helper, self.z)]
            self.steps[where:] = [*made, Step(line, helper, end, self.z, False, centre, sign * sweep)]
            return
        self.steps[where:] = [*made, Step(line, made[0].end, end, self.z)]

    def depart(self, line: int, form: str, size: dict[str, float], end: complex) -> None:
        way = self.steps[-1].heading(1)
        if form in ("LT", "LN"):
            self.add(
                Step(line, self.here, self.here + size["LEN"] * way * (1 if form == "LT" else -1j), 0), self.z
            )
            return
        centre = self.here - 1j * way * size["R"]
        sign = -1 if size["R"] > 0 else 1
        if form == "CT":
            sweep = math.radians(size["CCA"])
        else:
            # the way back along the same path
            sweep = touching(end, centre, self.here, -sign)
        leave = centre + (self.here - centre) * cmath.exp(1j * sign * sweep)
        self.add(Step(line, self.here, leave, 0, False, centre, sign * sweep), self.z)
        if form == "LCT":
            self.add(Step(line, self.here, end, 0), self.z)


def touching(start: complex, centre: complex, end: complex, sign: int) -> float:
    """The turn to `end` from where a line from `start` goes over into the circle, found by search."""

    def off(turn: float) -> float:
        arm = (end - centre) * cmath.exp(-1j * sign * turn)
        return ((centre + arm - start) * arm.conjugate()).real

    for k in range(720):
        a, b = math.radians(k / 2), math.radians(k / 2 + 0.5)
        if off(a) * off(b) <= 0:
            turn = float(brentq(off, a, b, xtol=1e-14))
            arm = (end - centre) * cmath.exp(-1j * sign * turn)
            if ((centre + arm - start) * (arm * 1j * sign).conjugate()).real > 0:
                return turn
    raise ValueError("no tangent")


def read(data: bytes) -> list[Step]:
    """The moves of a program, in words of the system in which it starts."""
    c = Contours()
    for line, text in joined(data):
        name = text.split()[0] if text.split()[0] in ("LP", "C", "CP", "CR", "CT", "CTP") else "L"
        if text.startswith("END PGM"):
            break
        sizes = {k: float(v) for k, v in re.findall(rf"\b(R|LEN|CCA) *({NUMBER})", text.replace(" R0", ""))}
        if re.match(r"CYCL DEF (7|8|10|11|26)\.", text):
            c.reframed(text)
        elif text.startswith("CC"):
            c.pole = c.target(text)[0]
        elif match := re.match(rf"(RND|CHF) *R? *({NUMBER})", text):
            c.corner = match[1], float(match[2]), line
        elif match := re.match(r"APPR (P?)(\w+)", text):
            end = c.polar(text) if match[1] else c.target(text)[0]
            c.approach = match[2], sizes, c.here, end, line, len(c.steps)
            c.here = end
        elif match := re.match(r"DEP (P?)(\w+)", text):
            c.depart(line, match[2], sizes, c.polar(text) if match[1] else c.target(text)[0])
        elif not re.match(r"BEGIN|TOOL CALL|F\d", text):
            c.move(line, name, text)
    c.flush()
    return c.out
