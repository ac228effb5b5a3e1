"""A printer that carries out lines of commands, for tests: where the nozzle goes, and what is fed on the way.

Written from the documentation of Marlin 2 and Klipper; it knows nothing of the reader.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

_WORD = re.compile(r"([A-Z])\s*([-+]?(?:\d+\.?\d*|\.\d+))")


@dataclass
class Step:
    """One move: its end, what it feeds, and its length along the path."""

    end: tuple[float, float, float]
    fed: float
    length: float


@dataclass
class Printer:
    """`klipper`: G90 does not make the extruder absolute."""

    klipper: bool
    place: dict[str, float] = field(default_factory=lambda: dict.fromkeys("XYZE", 0.0))
    relative: bool = False
    distances: bool = False
    steps: list[Step] = field(default_factory=list)

    def run(self, text: str) -> list[Step]:
        for line in text.splitlines():
            self._line(line.partition(";")[0].strip().upper())
        return self.steps

    def _line(self, line: str) -> None:
        command = re.match(r"([GM])0*(\d+(?:\.\d+)?)\b", line) or re.match(r"([GM])0*(\d+)", line)
        if command is None:
            return
        name = command[1] + command[2]
        words = {letter: float(value) for letter, value in _WORD.findall(line[command.end() :])}
        if name in ("G90", "G91"):
            self.relative = name == "G91"
            if not self.klipper:
                self.distances = self.relative
        elif name in ("M82", "M83"):
            self.distances = name == "M83"
        elif name == "G92":
            self.place |= {axis: words[axis] for axis in "XYZE" if axis in words}
        elif name in ("G0", "G1", "G2", "G3"):
            self._move(name, words)

    def _move(self, name: str, words: dict[str, float]) -> None:
        before = dict(self.place)
        for axis in "XYZE":
            if axis in words:
                distance = (
                    self.distances or (self.klipper and self.relative) if axis == "E" else self.relative
                )
                self.place[axis] = words[axis] + (before[axis] if distance else 0.0)
        if not {"X", "Y", "Z", "I", "J"} & set(words):
            # what is fed on the spot belongs to no move
            return
        x, y, z = (self.place[axis] for axis in "XYZ")
        flat = math.hypot(x - before["X"], y - before["Y"])
        if name in ("G2", "G3"):
            i, j = words.get("I", 0.0), words.get("J", 0.0)
            a = math.atan2(-j, -i)
            b = math.atan2(y - before["Y"] - j, x - before["X"] - i)
            turn = (b - a if name == "G3" else a - b) % (2 * math.pi)
            flat = math.hypot(i, j) * (turn if turn > 1e-6 else 2 * math.pi)
        self.steps.append(Step((x, y, z), self.place["E"] - before["E"], math.hypot(flat, z - before["Z"])))
