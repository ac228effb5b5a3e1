"""One motion block of an unrolled Heidenhain program in parts: its words, and how such blocks are written."""

from __future__ import annotations

import re
from collections.abc import Mapping

from olp.core.errors import ProgramError
from olp.core.values import dataclass
from olp.program.heidenhain.statements import OPERANDS, without_comment

_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)"
_HEAD = re.compile(rb"[ \t]*/?[ \t]*\d*[ \t]*/?[ \t]*")
_NAME = re.compile(rb"(?P<name>(?:APPR|DEP)[ \t]+P?(?:LCT|LT|LN|CT)|CTP|LP|CP|CR|CT|CC|RND|CHF|L|C)(?![A-Z])")
#: `C+30` is a word of a rotary axis, `C X` an arc
_ROTARY = re.compile(rb"C[ \t]*[-+.\d]")
_BARE = re.compile(rb"I?[XYZABCUVW][ \t]*[-+.\d]|[MF][ \t]*[-+.\dM]")
_WORD = re.compile(rb"(?<![A-Z])(I?)(PR|PA|[XYZ])[ \t]*(" + _NUMBER + rb")")
_TURN = re.compile(rb"(?<![A-Z])DR[ \t]*([-+])")
_SIZES = re.compile(rb"(?<![A-Z])(LEN|CCA|R)[ \t]*(" + _NUMBER + rb")")
_NO_RADIUS = re.compile(rb"(?<![A-Z])R0(?![.\d])")
_FUNCTION = re.compile(rb"(?<![A-Z])M[ \t]*(\d+)")
_FEED = re.compile(rb"(?<![A-Z])F[ \t]*(?:MAX|AUTO|Q\w+|\d+\.?\d*|\.\d+)")
_SIZED = (b"CR", b"APPR", b"DEP")
#: decimals of positions and angles that are written out
DECIMALS = 6


@dataclass(frozen=True, slots=True)
class Block:
    """A motion block: its `name`, words by letter (whether each is a distance, and its number), and the
    `turn` of DR (1, -1, or 0). Sizes go by name: R, LEN, CCA, and the bare number of RND and CHF as R. `rest`
    are all other words, `head` and `tail` are the bytes before and behind the statement."""

    name: bytes
    words: Mapping[bytes, tuple[bool, float]]
    turn: int
    sizes: Mapping[bytes, float]
    rest: bytes
    head: bytes
    tail: bytes
    line: int

    @property
    def functions(self) -> tuple[int, ...]:
        return tuple(int(m) for m in _FUNCTION.findall(self.rest))

    @property
    def feed(self) -> bytes:
        """The words of the feed, empty without one."""
        match = _FEED.search(OPERANDS.sub(b"", self.rest))
        return b"" if match is None else match[0]

    def stated(self, letters: bytes) -> bool:
        """Whether one of some axis words is there."""
        return any(letters[k : k + 1] in self.words for k in range(len(letters)))


def block_of(text: bytes, line: int) -> Block | None:
    """The motion block of a line, None where it is another statement. Raises ProgramError where a word is
    stated twice."""
    body = without_comment(text)
    head = _HEAD.match(body)
    assert head is not None
    upper = body[head.end() :].rstrip().upper()
    match = None if _ROTARY.match(upper) else _NAME.match(upper)
    if match is None and not _BARE.match(upper):
        return None
    name = b"L" if match is None else b" ".join(match["name"].split())
    rest = upper if match is None else upper[match.end() :]
    own = [match[0] for match in OPERANDS.finditer(rest)]
    rest = OPERANDS.sub(b" ", rest)
    words: dict[bytes, tuple[bool, float]] = {}
    for step, letter, number in _WORD.findall(rest):
        if letter in words:
            raise ProgramError(
                f"the block states {letter.decode()} twice; state it once", line=line, code="OLP515"
            )
        words[letter] = bool(step), float(number)
    rest = _WORD.sub(b" ", rest)
    turn = _TURN.search(rest)
    rest = _TURN.sub(b" ", rest)
    sizes: dict[bytes, float] = {}
    if name.startswith(_SIZED):
        # R0 beside a radius is the tool's compensation
        kept = b" R0" if name != b"CR" and _NO_RADIUS.search(rest) else b""
        rest = _NO_RADIUS.sub(b" ", rest)
        sizes = {key: float(number) for key, number in _SIZES.findall(rest)}
        rest = _SIZES.sub(b" ", rest) + kept
    elif name in (b"RND", b"CHF"):
        size = re.match(rb"[ \t]*R?[ \t]*(" + _NUMBER + rb")", rest)
        if size is None:
            raise ProgramError(f"{name.decode()} has no size; give it", line=line, code="OLP516")
        sizes, rest = {b"R": float(size[1])}, rest[size.end() :]
    end = text[len(body.rstrip()) :]
    rest = b" ".join([*rest.split(), *own])
    return Block(
        name, words, 0 if turn is None else 1 if turn[1] == b"+" else -1, sizes, rest,
        body[: head.end()], end, line,
    )  # fmt: skip


def number(value: float) -> bytes:
    """A number as blocks have it: with a sign, and no zeros behind."""
    text = f"{value:+.{DECIMALS}f}".rstrip("0").rstrip(".")
    return b"+0" if text in ("-0", "+0", "-", "+") else text.encode()


def written(head: bytes, name: bytes, words: list[tuple[bytes, float]], rest: bytes, tail: bytes) -> bytes:
    """A line: what is before the statement, its name, its words, other words, and what is behind."""
    parts = [name, *(letter + number(value) for letter, value in words), *((rest,) if rest else ())]
    return head + b" ".join(parts) + tail


def line_end(tail: bytes) -> bytes:
    """The end of a line, without the comment before it."""
    return tail[len(tail.rstrip(b"\r\n")) :]
