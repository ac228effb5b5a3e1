"""Words of random blocks: numbers as they may be spelt, straight moves, arcs and canned cycles.

The positions that are followed only help to arcs that a control accepts.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field

#: lengths in the table of tools
TOOLS = (1, 2, 3)
#: axes of a plane: first, second, along the tool
PLANES = {"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)}
CYCLES = ("G73", "G81", "G82", "G83", "G85", "G89", "G86", "G84", "G74")
#: only in G17: outside, LinuxCNC 2.9 taps along the wrong axes
TAPS = ("G74", "G84")


@dataclass(slots=True)
class Words:
    """What is in force while a program is drawn, and the words of its moves.

    `at` are program coordinates, None where they are not followed. `odd`: spelling is, too. `wrong` and
    `slashes` are shares of blocks. `turning` is the code of the spindle; `gone`: the control has moved the
    axes; `told`: M61 has said which tool is there.
    """

    rng: random.Random
    odd: bool
    wrong: float
    at: list[float | None] = field(default_factory=lambda: [None] * 3)
    motion: str = ""
    relative: bool = False
    centres: bool = False
    plane: str = "G17"
    inch: bool = False
    feed: str = "G94"
    series: str = ""
    cycles: bool = True
    slashes: float = 0.0
    turning: str = ""
    sets_tool: bool = True
    gone: bool = False
    told: bool = False

    def chance(self, share: float) -> bool:
        return self.rng.random() < share

    # -- numbers and words ---------------------------------------------------------------------------

    def spelt(self, value: float) -> str:
        """A number as a person or a program may write it."""
        rng = self.rng
        text = (
            f"{abs(value):.{rng.choice((0, 1, 2, 3))}f}"
            if value == round(value)
            else f"{abs(value):.4f}".rstrip("0")
        )
        how = rng.random()
        if how < 0.15 and text.startswith("0."):
            text = text[1:]
        elif how < 0.3 and "." not in text:
            text += "."
        elif how < 0.35:
            text = "0" + text
        sign = "-" if value < 0 else ("+" if rng.random() < 0.05 else "")
        text = sign + text
        if self.odd and rng.random() < 0.05:
            place = rng.randrange(len(text) + 1)
            text = text[:place] + rng.choice((" ", "\t", "  ")) + text[place:]
        return text

    def word(self, letter: str, value: float) -> str:
        gap = " " if self.odd and self.chance(0.03) else ""
        return letter + gap + self.spelt(value)

    def code(self, name: str) -> str:
        if self.chance(0.06):
            name = name[0] + "0" + name[1:]
        if self.odd and self.chance(0.02):
            name = name[0] + " " + name[1:]
        return (
            name if "." in name or not self.odd or self.chance(0.97) else name + self.rng.choice((".", ".0"))
        )

    def length(self, low: float = -20.0, high: float = 20.0) -> float:
        """A length in program units."""
        value = round(self.rng.uniform(low, high), self.rng.choice((0, 0, 1, 2, 3)))
        return round(value / 25.0, 4) if self.inch else value

    def axes(self, least: int = 0, letters: str = "XYZ") -> list[str]:
        picked = [a for a in letters if self.chance(0.55)]
        while len(picked) < least:
            picked = sorted({*picked, self.rng.choice(letters)})
        return picked

    def lost(self) -> None:
        self.at = [None] * 3

    # -- motion --------------------------------------------------------------------------------------

    def go(self, words: list[str], letters: list[str]) -> None:
        for letter in letters:
            value, i = self.length(), "XYZ".index(letter)
            words.append(self.word(letter, value))
            before = self.at[i]
            self.at[i] = value if not self.relative else None if before is None else before + value

    def straight(self) -> list[str]:
        code = self.rng.choice(("G0", "G1", "G1"))
        words = []
        if code != self.motion or self.chance(0.3):
            words.append(self.code(code))
        self.motion, self.series = code, ""
        if code == "G1" and (self.feed == "G93" or self.chance(0.25)):
            words.append(self.word("F", self.rng.choice((100, 250.5, 10, 2))))
        self.go(words, self.axes(1))
        return words

    def arc(self) -> list[str]:
        code = self.rng.choice(("G2", "G3"))
        first, second, third = PLANES[self.plane]
        words = [self.code(code)] if code != self.motion or self.chance(0.4) else []
        self.motion, self.series = code, ""
        if self.feed == "G93":
            words.append(self.word("F", 3))
        scale = 0.04 if self.inch else 1.0
        radius = self.rng.choice((1.0, 2.5, 5.0, 8.0)) * scale
        here = self.at[first], self.at[second]
        known = None not in here
        known_here = (here[0] or 0.0, here[1] or 0.0)
        turn = self.rng.choice((0.0, 90.0, 180.0, 270.0, 30.0, 211.0))
        begin = self.rng.choice((0.0, 90.0, 180.0, 270.0, 45.0))
        middle = [
            round(radius * math.cos(math.radians(begin)), 4),
            round(radius * math.sin(math.radians(begin)), 4),
        ]
        radius = math.hypot(*middle)
        angle = math.radians(begin + 180.0 + turn)
        step = [
            round(middle[0] + radius * math.cos(angle), 4),
            round(middle[1] + radius * math.sin(angle), 4),
        ]
        full = turn == 0.0 or not (known or self.relative)
        if self.centres and not known:
            full = False
        centre = [m + h for m, h in zip(middle, known_here, strict=True)] if self.centres else middle
        letters = "IJK"[first], "IJK"[second]
        by_radius = not full and self.chance(0.35)
        if by_radius:
            words.append(self.word("R", round(radius * self.rng.choice((1.0, 1.5, -1.0, -1.2)), 4)))
        else:
            for letter, value in zip(letters, centre, strict=True):
                if value or self.centres or self.chance(0.5):
                    words.append(self.word(letter, round(value, 4)))
        if not full or self.chance(0.3):
            ends = zip((first, second), step if not full else (0.0, 0.0), known_here, strict=True)
            for axis, value, before in ends:
                if full and not self.relative and not known:
                    continue
                words.append(self.word("XYZ"[axis], round(value if self.relative else value + before, 4)))
                if known:
                    self.at[axis] = round(value + before, 4)
        if self.chance(0.4):
            self.go(words, ["XYZ"[third]])
        if self.chance(0.2):
            words.append(self.word("P", self.rng.choice((1, 2, 3))))
        return words

    def hole(self) -> list[str]:
        third = "XYZ"[PLANES[self.plane][2]]
        level = self.at[PLANES[self.plane][2]]
        turning = {"": CYCLES[:6], "M3": (*CYCLES[:7], "G84"), "M4": (*CYCLES[:7], "G74")}[self.turning]
        plain = CYCLES if self.chance(0.02) else [c for c in turning if c not in TAPS or self.plane == "G17"]
        on = bool(self.series) and self.chance(0.7)
        code = self.series if on else self.rng.choice(plain)
        words = [] if on and self.motion == code and self.chance(0.7) else [self.code(code)]
        sticky = self.series == code
        self.motion = self.series = code
        words += [self.word(a, self.length()) for a in self.axes(0, "XYZ".replace(third, ""))]
        top = (
            self.length(2, 8)
            if self.relative or level is None or self.chance(0.5)
            else level - self.length(0, 4)
        )
        if not sticky or self.chance(0.25):
            words.append(
                self.word(third, -abs(self.length(1, 20)) if self.relative else top - abs(self.length(0, 9)))
            )
        if not sticky or self.chance(0.25):
            words.append(self.word("R", -abs(self.length(0, 5)) if self.relative else top))
        if code in ("G73", "G83") and (not sticky or self.chance(0.2)):
            words.append(self.word("Q", abs(self.length(2, 9)) or 1.0))
        if (code in ("G82", "G86", "G89", "G84", "G74") and (not sticky or self.chance(0.2))) or self.chance(
            0.03
        ):
            words.append(self.word("P", self.rng.choice((0, 0.5, 1))))
        if self.chance(0.15):
            words.append(self.word("L", self.rng.choice((1, 2, 3))))
        if not words or (not any(w[0] in "XYZ" for w in words) and self.chance(0.9)):
            words.append(self.word("XYZ".replace(third, "")[0], self.length()))
        self.lost()
        return words
