"""Random programs in RS-274 whose modal state interleaves on every block: `program(seed)`.

Each block takes from all modal groups, whatever is in force: motion, cycles, frames, units, lengths, planes,
distances, retracts, feed modes. Spelling, order of words, comments and line ends are drawn too, and now and
then a block that a control must refuse.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

from fuzz.drawn_words import TAPS, TOOLS, Words

#: work offsets of the control
FRAMES = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
_REMARKS = ("(x1 y2)", "( G1 X99 )", "()", "(msg, a)", "(g0 ; z5)", "(debug)")
_SPINDLE = ("S1000 M3", "M4", "M5", "S500", "M8", "M9", "M3", "F100", "F20.5", "M1", "M3", "M48")
_WRONG = (
    "X1 X2", "G1 G0 X1", "G41", "G2 X1", "G99.5", "M3 M4", "G81 X1", "P-1 G4", "G1 X", "X1..2", "G1 X-+2",
    "Q", "G10 L3", "G43 H9", "G53 X1", "G54 G55", "G17 G18", "G92", "G90 G91", "G21 G20", "M6", "T-1",
    "L-1 G81 X1 Z-1 R1", "(open", "closed) X1", "G93 G94", "G1 F-5", "G82 X1 Z-2 R1 P-1",
    "G83 X1 Z-2 R1 Q0", "G43.1", "G10 L2 P12 X0", "A1 B2", "G80 X5", "G4", "G28 G53 X1", "G0 G10 L2 P1 X0",
    "R5 X1", "I5 X1", "D1", "H1", "K2 X1", "P5 X1", "L3 X1", "G10 L20 P0 X0", "G2 X1 Y1 I1 R2", "G1.5",
    "N1 N2 X1", "G61 P1", "G43 G49", "G92 X1 G92.1", "U1", "G5 X1", "G38.2 X1", "S-5", "M30 X1",
    "G33 Z1 K1", "Z", "G9", "G9 X1", "#1=5", "G1 X[1+1]", "G0 X#1", "O1", "M98 P1", "!", "/ /",
    "G91.1 G90.1", "E5", "G1 X1e2", "G61.1", "G7", "G8", "G96", "G96 S10 D5", "M19", "M60", "M0", "M1",
    "M48", "M7 M8", "M5 M9", "M99", "G15", "G16", "G50", "G51", "G68", "G69", "M2.0", "M30.", "G00.0 X1",
    "G1.0 X1", "G01 X1 G40", "G 2 8", "M62 P1", "M66 P0 L0",
)  # fmt: skip


@dataclass(slots=True)
class Drawn:
    """A program, whether the block-delete switch is on, where the machine stands first (None: unknown), and
    the number of a machine with errors."""

    data: bytes
    deletes: bool
    start_mm: tuple[float, float, float] | None
    machine: int = 0


@dataclass(slots=True)
class _Grammar(Words):
    """Blocks: what changes the state, and how words become a line."""

    # -- state ---------------------------------------------------------------------------------------

    def again(self) -> list[str]:
        self.gone, self.relative, self.motion, self.series = False, False, "G0", ""
        words = ["G90", "G0"]
        self.go(words, ["X", "Y", "Z"])
        return words

    def frame(self) -> list[str]:
        self.lost()
        return [self.code(self.rng.choice(FRAMES[:2] if self.chance(0.5) else FRAMES))]

    def preset(self) -> list[str]:
        code = self.rng.choice(("G92", "G92", "G92.1", "G92.2", "G92.3", "G52"))
        words = [self.code(code)]
        letters = self.axes(1) if code in ("G92", "G52") else self.axes(0) if self.chance(0.3) else []
        self.go(words, letters)
        self.lost()
        return words

    def write(self) -> list[str]:
        words = [
            self.code("G10"),
            "L" + self.rng.choice(("2", "20")),
            self.word("P", self.rng.choice((0, 1, 2, 3, 9))),
        ]
        if self.chance(0.1):
            words.append("R0")
        self.go(words, self.axes(1))
        self.lost()
        return words

    def units(self) -> list[str]:
        self.inch = self.chance(0.4)
        self.lost()
        return [self.code("G20" if self.inch else "G21")]

    def tool_length(self) -> list[str]:
        code = self.rng.choice(("G43", "G43", "G43.1", "G43.2", "G49"))
        words = [self.code(code)]
        if (code == "G43" and (self.told or self.chance(0.8))) or (
            code == "G43.2" and (self.told or self.chance(0.9))
        ):
            # the interpreter alone does not know what is in the spindle after M61
            words.append(self.word("H", self.rng.choice(TOOLS if self.told else (0, *TOOLS))))
        if code == "G43.1":
            self.go(words, self.axes(1))
        self.lost()
        return words

    def change(self) -> list[str]:
        self.lost()
        how = self.rng.random() if self.sets_tool else self.rng.uniform(0.4, 1.0)
        if how < 0.2:
            return [self.word("T", self.rng.choice(TOOLS))]
        if how < 0.4:
            self.told = True
            return [self.code("M61"), self.word("Q", self.rng.choice(TOOLS))]
        self.gone = True
        words = [self.word("T", self.rng.choice((*TOOLS, 0) if self.chance(0.2) else TOOLS)), self.code("M6")]
        return words if how < 0.8 else words + self.tool_length()

    def machine(self) -> list[str]:
        if self.relative and self.chance(0.95):
            return self.distance()
        code = self.rng.choice(("G0", "G1", "" if self.motion in ("G0", "G1") else "G0"))
        words = [self.code("G53"), *([self.code(code)] if code else [])]
        self.motion, self.series = code or self.motion, ""
        if code == "G1" and self.feed == "G93":
            words.append(self.word("F", 4))
        words += [self.word(a, self.length(0, 90)) for a in self.axes(1)]
        self.lost()
        return words

    def home(self) -> list[str]:
        self.gone = True
        words = [self.code(self.rng.choice(("G28", "G30")))]
        self.go(words, self.axes(0) if self.chance(0.7) else [])
        self.lost()
        return words

    def dwell(self) -> list[str]:
        words = [self.code("G4"), self.word("P", self.rng.choice((0, 0.5, 2)))]
        if self.chance(0.15):
            self.go(words, self.axes(1))
        return words

    def distance(self) -> list[str]:
        self.relative = self.chance(0.45)
        return [self.code("G91" if self.relative else "G90")]

    def centre(self) -> list[str]:
        self.centres = self.chance(0.4)
        return [self.code("G90.1" if self.centres else "G91.1")]

    def plane_code(self) -> list[str]:
        self.plane = self.rng.choice(("G17", "G17", "G18", "G19"))
        if self.series:
            self.motion = self.series = ""
            return [self.code(self.plane), *([self.code("G80")] if self.chance(0.8) else [])]
        return [self.code(self.plane)]

    def feed_mode(self) -> list[str]:
        self.feed = self.rng.choice(("G94", "G94", "G93", "G95" if self.turning else "G94"))
        if self.feed == "G93" and self.series:
            self.motion = self.series = ""
            return [self.code("G80"), self.code("G93")]
        words = [self.code(self.feed)]
        if self.feed != "G93" and self.chance(0.95):
            words.append(self.word("F", self.rng.choice((100, 300.5, 0.25))))
        return words

    def retract(self) -> list[str]:
        return [self.code(self.rng.choice(("G98", "G99")))]

    def end_cycle(self) -> list[str]:
        self.motion = self.series = ""
        return [self.code("G80")]

    def mode(self) -> list[str]:
        words = [self.code(self.rng.choice(("G61", "G64", "G64", "G61.1", "G40", "G49")))]
        if words[0].replace(" ", "").startswith("G64") and self.chance(0.6):
            words += [self.word("P", 0.05), *([self.word("Q", 0.01)] if self.chance(0.4) else [])]
        return words

    def spindle(self) -> list[str]:
        words = self.rng.choice(_SPINDLE).split()
        if words[-1] in ("M3", "M4", "M5"):
            self.turning = "" if words[-1] == "M5" else words[-1]
            if self.series in ("G86", *TAPS):
                self.motion = self.series = ""
                return [self.code("G80"), *words]
        return words

    def nothing(self) -> list[str]:
        return self.rng.choice(
            ([], ["N10"], ["(remark)"], ["N5", "(x)"], [";rest G0 X5"], ["%"], ["M0"], [" "])
        )

    def bad(self) -> list[str]:
        self.lost()
        return [self.rng.choice(_WRONG)]

    # -- blocks --------------------------------------------------------------------------------------

    def words_of(self) -> list[str]:
        move = self.rng.choice(_MOVES)
        if move is _Grammar.hole and not (self.cycles and (self.feed != "G93" or self.chance(0.03))):
            move = _Grammar.straight
        if self.wrong and self.chance(self.wrong):
            return self.bad()
        if self.chance(0.45):
            return move(self)
        state = self.rng.choice(_STATES)
        words = state(self)
        if state in _JOINED and self.chance(0.35) and not words[0].endswith((".1", ".2")):
            # those that change how the words of a move are meant come with it
            words = words + move(self)
        return words

    def block(self) -> str:
        rng = self.rng
        # after what the control does by itself most programs state all axes
        words = self.again() if self.gone and self.chance(0.6) else self.words_of()
        if self.chance(0.3):
            rng.shuffle(words)
        if self.chance(0.1) and not any(w.startswith("N") for w in words):
            words.insert(0, f"N{rng.randrange(9999)}")
        if self.chance(0.06):
            words.insert(rng.randrange(len(words) + 1), rng.choice(_REMARKS))
        gap = rng.choice((" ", " ", "", "\t")) if self.odd else " "
        text = gap.join(words)
        if self.chance(0.03):
            text += rng.choice((" ; rest X9", ";G1 Z-5", " (end)"))
        if self.slashes and self.chance(self.slashes):
            text = rng.choice(("/", "/ ", " /")) + text
        if self.odd:
            text = self.spoilt(text)
        return text.lower() if self.chance(0.1) else text

    def spoilt(self, text: str) -> str:
        """Now and then a byte that editors, senders and tapes put in."""
        if not self.chance(0.04):
            return text
        place = self.rng.randrange(len(text) + 1)
        byte = self.rng.choice(
            (
                "\0",
                "\xff",
                "\x80",
                "\xa0",
                "\t",
                "\v",
                "\f",
                "\r",
                "\x1a",
                "\x7f",
                "\xb5",
                " ",
                "(",
                ")",
                ";",
                "/",
                "%",
            )
        )
        return text[:place] + byte + text[place:]


_MOVES: tuple[Callable[[_Grammar], list[str]], ...] = (
    _Grammar.straight, _Grammar.straight, _Grammar.arc, _Grammar.hole, _Grammar.hole,
)  # fmt: skip
_STATES: tuple[Callable[[_Grammar], list[str]], ...] = (
    _Grammar.frame, _Grammar.frame, _Grammar.preset, _Grammar.preset, _Grammar.write, _Grammar.units,
    _Grammar.tool_length, _Grammar.change, _Grammar.machine, _Grammar.home, _Grammar.dwell, _Grammar.distance,
    _Grammar.distance, _Grammar.centre, _Grammar.plane_code, _Grammar.feed_mode, _Grammar.retract,
    _Grammar.end_cycle, _Grammar.mode, _Grammar.spindle, _Grammar.nothing,
)  # fmt: skip
_JOINED = frozenset((
    _Grammar.frame, _Grammar.units, _Grammar.tool_length, _Grammar.change, _Grammar.distance, _Grammar.centre,
    _Grammar.plane_code, _Grammar.feed_mode, _Grammar.retract, _Grammar.mode, _Grammar.spindle,
))  # fmt: skip


def legal(seed: int) -> Drawn:
    """The program of a seed in plain text, with no block that a control refuses on purpose."""
    rng = random.Random(f"legal {seed}")
    grammar = _Grammar(rng, odd=False, wrong=0.0, sets_tool=False, turning="M3")
    grammar.cycles = rng.random() < 0.6
    grammar.slashes = rng.choice((0.0, 0.0, 0.0, 0.1))
    words = ["G0"]
    grammar.go(words, ["X", "Y", "Z"])
    lines = ["G21 G90 G17 G94 F300 S1000 M3", " ".join(words)]
    lines += [grammar.block() for _ in range(rng.choice((3, 5, 8, 12, 20)))]
    lines.append(rng.choice(("M2", "M30")))
    end = rng.choice(("\n", "\n", "\r\n"))
    start = None if rng.random() < 0.2 else (12.0, -8.0, 30.0)
    return Drawn("".join(line + end for line in lines).encode(), False, start, seed)


def program(seed: int) -> Drawn:
    """The program of a seed."""
    rng = random.Random(f"interleaved {seed}")
    odd = rng.random() < 0.35
    grammar = _Grammar(rng, odd, wrong=rng.choice((0.0, 0.0, 0.0, 0.05)))
    grammar.cycles = rng.random() < 0.75
    grammar.slashes = rng.choice((0.0, 0.0, 0.0, 0.15))
    lines = []
    if rng.random() < 0.85:
        grammar.turning = rng.choice(("M3", "M3", "M3", "M4", ""))
        lines.append(f"G21 G90 G17 G94 F300 S1000 {grammar.turning}" if grammar.turning else "F200")
    if rng.random() < 0.95:
        grammar.motion = "G0"
        words = ["G0"]
        grammar.go(words, ["X", "Y", "Z"])
        lines.append(" ".join(words))
    lines += [grammar.block() for _ in range(rng.choice((3, 5, 8, 12, 20)))]
    if rng.random() < 0.6:
        lines.append(
            rng.choice(("M2", "M30", "m2", "M02", "M30 (end)", "G0 X1 M2", "M2.0", "G80 M30", "G92.1 M2"))
        )
        if rng.random() < 0.2:
            lines.append("G0 X50")
    if rng.random() < 0.08:
        lines = ["%", *lines, "%"]
        if rng.random() < 0.3:
            lines.append("G0 X60")
    ends = ["\n"]
    how = rng.random()
    if how < 0.15:
        ends = ["\r\n"]
    elif how < 0.2:
        ends = ["\r\r\n"]
    elif how < 0.205:
        ends = ["\r"]
    elif how < 0.22:
        ends = ["\n", "\r\n", "\r", "\n\r", "\r\r\n"]
    text = "".join(line + rng.choice(ends) for line in lines)
    if rng.random() < 0.1:
        text = text.rstrip("\r\n")
    start = None if rng.random() < 0.4 else (12.0, -8.0, 30.0)
    return Drawn(text.encode("latin-1"), rng.random() < 0.3, start)
