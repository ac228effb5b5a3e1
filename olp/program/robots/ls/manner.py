"""What the words of a move say beside the number of its position, in TP programs. Most moves say the same."""

from __future__ import annotations

from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.moves import NAN

_MOVE = pattern(
    rb"(?i)\s*([LJ])\s+(PR?)\[\s*(\d+|R\[[^\]]*\])\s*(?::[^\]]*)?\]\s+(?:(\d+\.?\d*)\s*(mm/sec|cm/min|inch/min|%|deg/sec|"
    rb"sec|msec)|(R\[[^\]]*\]\S*|\S+))\s+(FINE|CNT\s*\d+|CNT\s*R\[[^\]]*\]|CD\d+|CR\d+)?(.*)"
)
_OFFSET = pattern(rb"(?i)\b(Tool_Offset|Offset|WZVersatz|Versatz)\b\s*(?:,\s*PR\[\s*(\d+)[^\]]*\])?")
_SKIP = pattern(rb"(?i)\bSkip(?:Jump)?\b")
_INDEX = rb"\[[^\]]*\]"
_VALUE = rb"(?:[-+]?\d*\.?\d+|R" + _INDEX + rb")"
_SEAM = rb":?\s*(?:Arc|Weld)\s+(?:Start|End)\s*" + _INDEX
#: Words behind a move that change nothing of its path.
_PLAIN_TAIL = rb"ACC\s*" + _VALUE + rb"|PTH|(?:Ind\.)?EV\s*\d+\s*%|" + _SEAM
#: Words that belong to the whole move, or to one of its ends, so that it is never split.
_WHOLE_TAIL = (
    rb"Skip(?:Jump)?\s*,\s*LBL" + _INDEX + rb"(?:\s*,\s*PR" + _INDEX + rb"\s*=\s*[LJ]POS)?|"
    rb"(?:AP|RT)_LD\s*\d+|T[AB]\s*" + _VALUE + rb"\s*sec\s*,.*|DB\s*" + _VALUE + rb"\s*mm\s*,.*"
)  # fmt: skip
_SHIFTED_TAIL = rb"(?:Tool_Offset|Offset|WZVersatz|Versatz)(?:\s*,\s*PR" + _INDEX + rb")?"
_TAIL = pattern(
    rb"(?i)(?:\s*(?:" + _PLAIN_TAIL + rb"|" + _WHOLE_TAIL + rb"|" + _SHIFTED_TAIL + rb")(?![\w(\[]))*\s*"
)
_HELD = pattern(rb"(?i)(?<![\w.])(?:" + _WHOLE_TAIL + rb")")
#: Other words of a move, in capitals, and why they are not read.
_UNREAD = {
    b"RTCP": "the tool stands still, and the robot moves the part",
    b"WJNT": "the wrist turns by its joints, and the tool not evenly",
}
_WORD = pattern(rb"[\w.]+|\S")
_WRIST = pattern(rb"(?i)\bWjnt\b")
#: Words of a move by which it is no way to a position, and why.
_ELSEWHERE = (
    (pattern(rb"(?i)\bINC\b"), "is a distance (INC)"),
    (pattern(rb"(?i)\bCOORD\b"), "counts from a positioner (COORD)"),
    (pattern(rb"(?i)\bVOFFSET\b|\bSearch\[|\bTrack\b"), "goes where a sensor says"),
)
_ALONG_TOOL = pattern(rb"(?i)\b(?:Tool_Offset|WZVersatz)\b")
#: mm/s in one unit of a speed
_SPEEDS = {b"mm/sec": 1.0, b"cm/min": 10.0 / 60.0, b"inch/min": 25.4 / 60.0}
#: The number of a position or register that a register chooses.
CHOSEN = -1


@dataclass(frozen=True, slots=True)
class Offset:
    """How a move is shifted: by the numbers of a `register`, None where none is named. The first word says
    whether these are along the frame, and `along_tool` whether any word is about the tool."""

    register: int | None
    in_frame: bool
    along_tool: bool


@dataclass(frozen=True, slots=True)
class Manner:
    """How a move goes: straight or not, to a register or a position, its speed in mm/s, whether it is never
    split, and where it may be left (`skips`). `elsewhere` and `unread` are why it is not read, else empty."""

    straight: bool
    register: bool
    feed: float
    whole: bool
    skips: bool
    offset: Offset | None
    elsewhere: str
    unread: str


class Manners:
    """Those of a program, on an `arm` or not; each is made once."""

    def __init__(self, *, arm: bool) -> None:
        self._arm = arm
        self._known: dict[tuple[bytes, ...], Manner] = {}

    def of(self, text: bytes) -> tuple[Manner, int] | None:
        """That of a statement, and the number of its position or register; None where it is no such move."""
        match = _MOVE.fullmatch(text)
        if match is None:
            return None
        letter, kind, number, *rest = match.groups(b"")
        key = letter, kind, *rest
        known = self._known.get(key)
        if known is None:
            known = self._known[key] = self._made(*key)
        return known, int(number) if number.isdigit() else CHOSEN

    def _made(
        self, letter: bytes, kind: bytes, speed: bytes, unit: bytes, other: bytes, _: bytes, tail: bytes
    ) -> Manner:
        straight, unit, offset = letter.upper() == b"L", unit.lower(), _OFFSET.search(tail)
        timed = unit in (b"sec", b"msec") or other.lower().endswith((b"]sec", b"]msec"))
        shift = None
        if offset is not None:
            register = None if offset[2] is None else int(offset[2])
            in_frame = offset[1].lower() in (b"offset", b"versatz")
            shift = Offset(register, in_frame, _ALONG_TOOL.search(tail) is not None)
        return Manner(
            straight, kind.upper() == b"PR", float(speed) * _SPEEDS[unit] if unit in _SPEEDS else NAN,
            timed or _HELD.search(tail) is not None, _SKIP.search(tail) is not None, shift,
            next((why for sign, why in _ELSEWHERE if sign.search(tail)), ""),
            # without joints, and behind J, a wrist turns nothing else
            _unread(tail if self._arm and straight else _WRIST.sub(b"", tail)),
        )  # fmt: skip


def _unread(tail: bytes) -> str:
    """The first word behind a move whose effect on its path is not known, and why; empty where there is
    none."""
    known = _TAIL.match(tail)
    word = _WORD.search(tail, 0 if known is None else known.end())
    if word is None:
        return ""
    why = _UNREAD.get(word[0].upper(), "what it does to the path is not known")
    return f"`{word[0].decode('latin-1')}` behind a move is not read: {why}"
