"""A reader of plain Sinumerik blocks that shares nothing with olp: text to canonical moves, in G17.

Written from the forms of blocks alone, for judging: what it does not know, it does not read (ValueError). One
block after the other, one regular expression a word; frames are matrices.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

import numpy as np

from .cldata import Moves
from .linuxcnc import ARC, FEED, RAPID

_N = r"[-+]?(?:\d+\.?\d*|\.\d+)"
_WORD = re.compile(
    rf"([A-Z]+)\s*=\s*(?:(AC|IC)\()?({_N})\)?|([A-Z])\s*({_N})|([A-Z]{{2,}}\d*)(\([^)]*\))?|(T)=\"([^\"]*)\""
)
_FRAMES = ("TRANS", "ATRANS", "ROT", "AROT", "MIRROR", "AMIRROR", "SCALE", "ASCALE")
_QUIET = {"MSG", "SOFT", "FFWON", "FNORM", "WORKPIECE", "COMPCAD", "COMPOF", "TRAFOOF",
          "CYCLE800", "CYCLE832", "STOPRE", "EXTERN", "SLOT"}  # fmt: skip
#: cycles that come back at a feed
_FEED_BACK = {"CYCLE84", "CYCLE840", "CYCLE85", "CYCLE89"}


class Reading:
    """The state of one reading: `origins` by name, `tools` are lengths by number, `names` numbers by name."""

    def __init__(
        self, origins: Mapping[str, np.ndarray], tools: Mapping[int, float], names: Mapping[str, int]
    ):
        self.origins, self.tools, self.names = origins, tools, names
        self.offset, self.tool, self.next, self.length = "G54", 1, 1, 0.0
        self.turn, self.shift = np.eye(3), np.zeros(3)
        self.parts = np.zeros((2, 3))
        self.axis = np.full(3, np.nan)
        self.motion, self.relative, self.unit = 1, False, 1.0
        self.cycle: list[float | None] | None = None
        self.name = ""
        self.moves = Moves()

    @property
    def zero(self) -> np.ndarray:
        return self.origins[self.offset] + self.shift + [0.0, 0.0, self.length]

    def words(self) -> np.ndarray:
        """The position in numbers of the program, mm."""
        return np.linalg.inv(self.turn) @ np.nan_to_num(self.axis - self.zero)

    def go(self, line: int, kind: int, axis: np.ndarray, **arc: object) -> None:
        vector = np.array([0.0, 0.0, -self.tools.get(self.tool, 0.0)])
        length = np.array([0.0, 0.0, self.length])
        self.moves.add(line, kind, axis, length, self.tool, vector, **arc)  # type: ignore[arg-type]
        self.axis = axis

    def frame(self, name: str, values: dict[str, float]) -> None:
        kind, adds = name.removeprefix("A"), name.startswith("A")
        vector = np.array([values.get(a, 0.0) for a in "XYZ"]) * self.unit
        step = np.eye(3)
        if kind == "ROT":
            angle = math.radians(values.get("Z", values.get("RPL", 0.0)))
            c, s = math.cos(angle), math.sin(angle)
            step = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        elif kind == "SCALE":
            step = np.diag([values.get(a, 1.0) for a in "XYZ"])
        elif kind == "MIRROR":
            step = np.diag([-1.0 if a in values else 1.0 for a in "XYZ"])
        if not adds:
            self.turn, self.shift, self.parts = np.eye(3), np.zeros(3), np.zeros((2, 3))
        if kind == "TRANS":
            self.shift = self.shift + self.turn @ vector
            self.parts[int(adds)] += vector
        self.turn = self.turn @ step

    def hole(self, line: int) -> None:
        assert self.cycle is not None
        rtp, rfp, safe, deep = (value or 0.0 for value in self.cycle[:4])
        if len(self.cycle) > 4 and self.cycle[4]:
            deep = rfp - self.cycle[4]
        back = [(FEED, rfp + safe)] if self.name in _FEED_BACK else []
        for kind, level in ((RAPID, rfp + safe), (FEED, deep), *back, (RAPID, rtp)):
            if back and kind == RAPID and level == rtp == rfp + safe:
                continue
            axis = self.axis.copy()
            axis[2] = self.zero[2] + level * self.unit
            self.go(line, kind, axis)

    def block(self, line: int, text: str) -> bool:
        """One block; whether the program ends."""
        values: dict[str, tuple[str, float]] = {}
        machine, name, alone = False, "", "MCALL" not in text
        for word, how, number, letter, value, call, given, _, tool in _WORD.findall(text):
            if tool or (_ == "T"):
                self.next = self.names[tool]
            elif call == "SUPA":
                machine = True
            elif call in _FRAMES:
                name = call
            elif call == "MCALL":
                self.cycle = None
            elif re.fullmatch(r"CYCLE8(\d|40)", call):
                self.name = call
                self.cycle = [float(a) if a.strip() else None for a in given[1:-1].split(",")]
            elif call and call not in _QUIET:
                raise ValueError(text)
            elif letter == "G":
                code = int(value)
                if code < 4:
                    self.motion = code
                elif code in (90, 91):
                    self.relative = code == 91
                elif code in (70, 71, 700, 710):
                    self.unit = 25.4 if code in (70, 700) else 1.0
                elif code in (53, 153):
                    machine = True
                elif code in (54, 55, 500) or 504 < code < 600:
                    self.offset = f"G{code}"
                elif code in (58, 59):
                    name = f"G{code}"
                elif code not in (17, 40, 60, 64, 94, 601, 641, 642):
                    raise ValueError(text)
            elif "T" in (letter, word):
                self.next = int(float(value or number))
            elif letter == "M" and int(value) == 6:
                self.tool, self.length = self.next, self.tools[self.next]
                self.axis = np.full(3, np.nan)
            elif letter == "M" and int(value) in (17, 30):
                return True
            elif letter == "D":
                self.length = self.tools[self.tool] if int(value) else 0.0
            elif word or letter:
                values[word or letter] = (how, float(number or value))
        plain = {key: number for key, (_, number) in values.items()}
        if name in ("G58", "G59"):
            part = self.parts[int(name == "G59")]
            for axis, letter in enumerate("XYZ"):
                part[axis] = plain.get(letter, part[axis] / self.unit) * self.unit
            self.shift = self.parts.sum(axis=0)
        elif name:
            self.frame(name, plain)
        elif alone and self.cycle is not None and "CYCLE8" in text:
            self.hole(line)
            self.cycle = None
        elif values.keys() & {*"XYZIJ"}:
            self.move(line, values, machine)
            if self.cycle is not None:
                self.hole(line)
        return False

    def move(self, line: int, values: dict[str, tuple[str, float]], machine: bool) -> None:
        if machine:
            axis = self.axis.copy()
            for i, letter in enumerate("XYZ"):
                if letter in values:
                    axis[i] = values[letter][1] * self.unit + (self.length if i == 2 else 0.0)
            self.go(line, RAPID, axis)
            return
        begin = self.words()
        end = begin.copy()
        known = ~np.isnan(self.axis)
        for i, letter in enumerate("XYZ"):
            if letter in values:
                how, number = values[letter]
                step = how == "IC" or (self.relative and how != "AC")
                end[i] = number * self.unit + (begin[i] if step else 0.0)
                known[i] = True
        axis = self.turn @ end + self.zero
        axis[~known] = np.nan
        if self.motion < 2:
            self.go(line, FEED if self.motion else RAPID, axis)
            return
        sign = 1.0 if self.motion == 3 else -1.0
        if "CR" in values:
            size = values["CR"][1] * self.unit
            chord = (end - begin)[:2]
            half = np.hypot(*chord) / 2
            high = math.sqrt(max(size * size - half * half, 0.0)) * sign * math.copysign(1.0, size)
            centre = (begin + end)[:2] / 2 + high * np.array([-chord[1], chord[0]]) / (2 * half)
        else:
            centre = begin[:2].copy()
            for i, letter in enumerate("IJ"):
                how, number = values.get(letter, ("", 0.0))
                centre[i] = number * self.unit + (0.0 if how == "AC" else begin[i])
        middle = self.turn @ np.array([*centre, end[2]]) + self.zero
        turns = (1 + int(values.get("TURN", ("", 0.0))[1])) * sign * np.sign(np.linalg.det(self.turn))
        self.go(line, ARC, axis, centre=middle, turns=int(turns), plane=0)


def read(
    data: bytes, origins: Mapping[str, np.ndarray], tools: Mapping[int, float], names: Mapping[str, int]
) -> Moves:
    """The moves of a program of plain blocks, with tool 1 in the spindle at the start."""
    reading = Reading(origins, tools, names)
    for number, raw in enumerate(data.decode("latin-1").splitlines(), 1):
        text = re.sub(r"^\s*N\d+\s*", "", re.sub(r'MSG\("[^"]*"\)', "", raw).split(";")[0].upper())
        if text.startswith("%") or not text.strip():
            continue
        if reading.block(number, text):
            break
    return reading.moves
