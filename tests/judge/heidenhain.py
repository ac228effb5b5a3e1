"""A reader of Heidenhain conversational blocks that shares nothing with olp: text to canonical moves.

Written from the forms of blocks alone, for judging: what it does not know, it does not read (ValueError). One
block after the other, one regular expression a word.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

import numpy as np

from .cldata import Moves
from .linuxcnc import ARC, FEED, RAPID

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
AXES = "XYZ"
#: first and second axis of planes XY, YZ, XZ, as canonical moves number them
PLANES = {(0, 1): 0, (1, 2): 1, (0, 2): 2}
TURNED = {0: (0, 1), 1: (1, 2), 2: (2, 0)}
BY_SURFACE = {200, 201, 202, 203, 205, 206, 207, 208, 209, 240, 241}
#: cycles of modes, which leave the one that is called
MODES = {7, 9, 32, 247}


class Reading:
    """The state of one reading; `origin` is the preset, `tools` are lengths by number."""

    def __init__(self, origin: np.ndarray, tools: Mapping[int, float], tool: int) -> None:
        self.origin, self.tools, self.tool = origin, tools, tool
        self.length = np.zeros(3)
        self.shift = np.zeros(3)
        self.here = np.full(3, np.nan)
        self.pole = np.full(3, np.nan)
        self.unit = 1.0
        self.delta = 0.0
        self.cycle: dict[str, float] = {}
        self.moves = Moves()

    @property
    def zero(self) -> np.ndarray:
        return self.origin + self.shift + self.length

    def go(self, line: int, kind: int, end: np.ndarray, **arc: object) -> None:
        vector = np.array([0.0, 0.0, -self.tools.get(self.tool, 0.0) - self.delta])
        self.moves.add(line, kind, end, self.length, self.tool, vector, **arc)  # type: ignore[arg-type]
        self.here = end

    def words(self, text: str) -> np.ndarray:
        """Where axis words lead, as an axis position."""
        end = self.here.copy()
        for step, letter, number in re.findall(rf"\b(I?)([XYZ]) *({NUMBER})", text):
            axis, size = AXES.index(letter), float(number) * self.unit
            end[axis] = end[axis] + size if step else size + self.zero[axis]
        return end

    def turn(self, line: int, end: np.ndarray, plane: int, sweep: float) -> None:
        centre = end.copy()
        for axis in TURNED[plane]:
            centre[axis] = self.pole[axis]
        turns = math.copysign(math.ceil(abs(sweep) / (2 * math.pi) - 1e-9), sweep)
        self.go(line, ARC, end, centre=centre, turns=int(turns), plane=plane)

    def angle(self, point: np.ndarray, plane: int) -> float:
        a, b = TURNED[plane]
        return math.atan2(point[b] - self.pole[b], point[a] - self.pole[a])

    def arc(self, line: int, text: str) -> None:
        """C about the pole."""
        plane = PLANES[tuple(np.flatnonzero(~np.isnan(self.pole)).tolist())]
        end, sign = self.words(text), 1.0 if "DR+" in text else -1.0
        sweep = (self.angle(end, plane) - self.angle(self.here, plane)) * sign % (2 * math.pi)
        self.turn(line, end, plane, sign * (sweep if sweep > 1e-9 else 2 * math.pi))

    def radius(self, line: int, text: str) -> None:
        """CR in XY: the short way with a positive radius."""
        end, sign = self.words(text), 1.0 if "DR+" in text else -1.0
        match = re.search(rf"\bR *({NUMBER})", text)
        assert match is not None
        size = float(match[1]) * self.unit
        chord = (end - self.here)[:2]
        half = np.hypot(*chord) / 2
        high = math.sqrt(max(size * size - half * half, 0.0)) * sign * math.copysign(1.0, size)
        middle = (self.here + end)[:2] / 2
        self.pole = np.array([*(middle + high * np.array([-chord[1], chord[0]]) / (2 * half)), np.nan])
        self.arc(line, re.sub(rf"\b[XYZ] *{NUMBER}", "", text) + "".join(
            f" {a}{(e - z) / self.unit:.12f}" for a, e, z in zip(AXES, end, self.zero, strict=True)
        ))  # fmt: skip

    def polar(self, line: int, text: str) -> None:
        """CP about the pole, with a step along the third axis."""
        plane = PLANES[tuple(np.flatnonzero(~np.isnan(self.pole)).tolist())]
        a, b = TURNED[plane]
        match = re.search(rf"(I?)PA *({NUMBER})", text)
        assert match is not None
        value = math.radians(float(match[2]))
        sign = 1.0 if "DR+" in text else -1.0
        begin = self.angle(self.here, plane)
        sweep = value if match[1] else sign * ((value - begin) * sign % (2 * math.pi) or 2 * math.pi)
        end = self.words(text)
        reach = math.hypot(self.here[a] - self.pole[a], self.here[b] - self.pole[b])
        end[a] = self.pole[a] + reach * math.cos(begin + sweep)
        end[b] = self.pole[b] + reach * math.sin(begin + sweep)
        self.turn(line, end, plane, sweep)

    def hole(self, line: int) -> None:
        if not self.cycle:
            raise ValueError("no cycle")
        surface = self.cycle["Q203"] * self.unit + self.zero[2]
        clear, second = self.cycle["Q200"] * self.unit, self.cycle["Q204"] * self.unit
        for kind, height in (
            (RAPID, surface + clear), (FEED, surface + self.cycle["Q201"] * self.unit),
            (RAPID, surface + max(clear, second)),
        ):  # fmt: skip
            self.go(line, kind, np.array([*self.here[:2], height]))


def joined(data: bytes) -> list[tuple[int, str]]:
    """(line, text) of statements without numbers and comments."""
    statements, pending, first = [], "", 0
    for number, raw in enumerate(data.decode("latin-1").replace("\r", "").split("\n"), 1):
        first = first if pending else number
        text = raw if pending else re.sub(r"^\s*\d*\s*", "", raw)
        goes_on = raw.rstrip().endswith("~")
        pending += " " + text.split(";")[0].rstrip().removesuffix("~")
        if not goes_on:
            statements.append((first, pending.strip().upper()))
            pending = ""
    return [(line, text) for line, text in statements if text and not text.startswith("*")]


def read(data: bytes, origin: np.ndarray, tools: Mapping[int, float], *, tool: int = 1) -> Moves:
    """The moves of a program of plain blocks."""
    r = Reading(origin, tools, tool)
    for line, text in joined(data):
        if text.startswith("END PGM"):
            break
        if text.startswith("BEGIN PGM"):
            r.unit = 25.4 if text.endswith("INCH") else 1.0
        elif text.startswith("TOOL CALL"):
            r.tool = int(re.findall(r"\d+", text)[0])
            delta = re.search(rf"\bDL *({NUMBER})", text)
            r.delta = float(delta[1]) * r.unit if delta else 0.0
            r.length = np.array([0.0, 0.0, r.tools[r.tool] + r.delta])
            r.here = np.full(3, np.nan)
        elif match := re.match(rf"CYCL DEF 7\.[1-9] *(I?)([XYZ]) *({NUMBER})", text):
            axis = AXES.index(match[2])
            r.shift[axis] = float(match[3]) * r.unit + (r.shift[axis] if match[1] else 0.0)
        elif match := re.match(r"CYCL DEF (\d+)\b", text):
            values = re.findall(rf"(Q\d+) *= *({NUMBER})", text)
            known = int(match[1]) in BY_SURFACE
            r.cycle = {q: float(v) for q, v in values} if known else r.cycle if int(match[1]) in MODES else {}
        elif re.fullmatch(r"CYCL CALL( M\d+)*", text):
            r.hole(line)
        elif re.search(r"\bM91\b", text):
            end = r.here.copy()
            for _, letter, number in re.findall(rf"\b(I?)([XYZ]) *({NUMBER})", text):
                end[AXES.index(letter)] = float(number) * r.unit
            r.go(line, RAPID, end)
        elif re.match(r"CC\b", text):
            words = re.findall(rf"\b(I?)([XYZ]) *({NUMBER})", text)
            place = r.words(text)
            r.pole = np.full(3, np.nan)
            for axis in [AXES.index(w[1]) for w in words] or [0, 1]:
                r.pole[axis] = place[axis]
        elif re.match(r"CR\b", text):
            r.radius(line, text)
        elif re.match(r"CP\b", text):
            r.polar(line, text)
        elif re.match(r"C[ ]", text):
            r.arc(line, text)
        elif re.match(r"L\b|I?[XYZ][-+.\d]", text):
            if re.search(r"\bI?[XYZ] *[-+.\d]", text):
                r.go(line, RAPID if re.search(r"\bF *MAX\b", text) else FEED, r.words(text))
            if "M99" in text.split():
                r.hole(line)
        elif not re.match(r"BLK FORM|TOOL DEF|STOP|M\d|F\d|CYCL DEF \d+\.0|PLANE RESET STAY|LBL 0", text):
            raise ValueError(text)
    return r.moves
