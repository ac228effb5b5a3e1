"""The words of a move of RAPID: target, speed, zone, tool, and what is said beside them."""

from __future__ import annotations

import re

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.values import dataclass
from olp.program.robots.rapid.forms import Form
from olp.program.robots.rapid.text import Statement
from olp.program.robots.rapid.values import NUMBER
from olp.program.robots.targets import NOWHERE, Span

_NESTED = rb"\[(?:[^\[\]]|\[(?:[^\[\]]|\[[^\[\]]*\])*\])*\]"
#: What may stand in parentheses, which hold further ones.
_INNER = rb"[^()\[\]]|" + _NESTED
_PARENS = rb"\((?:" + _INNER + rb"|\((?:" + _INNER + rb"|\((?:" + _INNER + rb")*\))*\))*\)"
_BRACES = rb"\{(?:[^{}]|\{[^{}]*\})*\}"
#: An argument up to its comma, brackets whole.
_ARGUMENT = pattern(rb"(?:[^,\[\](){}]|" + _NESTED + rb"|" + _PARENS + rb"|" + _BRACES + rb")+")
#: What the letters of a layout are.
_ARGUMENTS = {
    "c": "via point",
    "t": "target",
    "v": "speed",
    "z": "zone",
    "w": "tool",
    ".": "data of the process",
}
_PLAIN_LAYOUTS = ("tvzw",)
#: A move without further words.
_PLAIN = pattern(
    rb"(?i)\s*(\w+|\[[^;()\\]*?\]\s*\])\s*,\s*(\w+)\s*,\s*(\w+)\s*,\s*(\w+)\s*(?:\\WObj\s*:=\s*(\w+)\s*)?"
)
_SWITCH = pattern(rb"\\\s*(\w+)\s*(?::=\s*((?:[^\\\[\]]|" + _NESTED + rb")*))?")
_NAME = pattern(rb"\s*([A-Za-z]\w*)\s*(?:\{\s*(\d+)\s*\})?\s*")
_N = rb"\s*(" + NUMBER.replace(b"(", b"(?:", 1) + rb")\s*"
_MOVED = pattern(
    rb"(?i)\s*(Offs|RelTool)\s*\((.*?)," + _N + b"," + _N + b"," + _N
    + rb"((?:,?\s*\\\s*R[xyz]\s*:=" + _N.replace(b"(", b"(?:", 1) + rb")*)\)\s*",
    re.DOTALL,
)  # fmt: skip
_TURN = pattern(rb"(?i)R([xyz])\s*:=\s*([-+.\deE]+)")


@dataclass(frozen=True, slots=True)
class Words:
    """Bytes of the `target` of a move and of the `via` point of an arc, `speed`, `zone` with what is said of
    it, and the names `tool` and `frame`. `others` are further words by their names in capitals."""

    via: Span
    target: Span
    speed: bytes
    zone: Span
    tool: str
    frame: str
    others: dict[bytes, bytes]


def words_of(statement: Statement, begin: int, data: bytes, form: Form) -> Words:
    """The words of a move whose name ends at byte `begin`. Raises ProgramError where it has others."""
    plain = _PLAIN.fullmatch(data, begin, statement.end) if form.layouts == _PLAIN_LAYOUTS else None
    if plain is not None:
        tool, frame = plain[4].decode("latin-1"), (plain[5] or b"wobj0").decode("latin-1")
        return Words(NOWHERE, plain.span(1), plain[2], plain.span(3), tool, frame, {})
    pieces: list[tuple[Span, bytes]] = []
    others: dict[bytes, bytes] = {}
    for match in _ARGUMENT.finditer(data, begin, statement.end):
        text = match[0]
        mark = _outer_switch(text)
        main = text[:mark]
        for name, value in _SWITCH.findall(text[mark:]):
            others[name.upper()] = value.strip()
        blank = len(main) - len(main.lstrip())
        if main.strip():
            start = match.start() + blank
            pieces.append(((start, start + len(main.strip())), main.strip()))
            stop = match.end() if mark < len(text) else pieces[-1][0][1]
            pieces[-1] = ((start, stop), main.strip())
    layout = form.layout(len(pieces))
    if layout is None:
        expected = " or ".join(", ".join(_ARGUMENTS[letter] for letter in layout) for layout in form.layouts)
        raise ProgramError(
            f"the move has {len(pieces)} arguments; expected {expected}",
            line=statement.line,
            code="OLP516",
        )
    own = {letter: piece for letter, piece in zip(layout, pieces, strict=True) if letter != "."}
    (start, _), target = own["t"]
    via = own["c"][0] if "c" in own else NOWHERE
    zone = own["z"][0] if "z" in own else NOWHERE
    return Words(
        via, (start, start + len(target)), own["v"][1], zone, own["w"][1].decode("latin-1"),
        others.pop(b"WOBJ", b"wobj0").decode("latin-1"), others,
    )  # fmt: skip


def _outer_switch(text: bytes) -> int:
    """Where the first `\\` outside brackets is; the length of the text where there is none."""
    depth = 0
    if b"\\" not in text:
        return len(text)
    for place, byte in enumerate(text):
        if byte in b"([{":
            depth += 1
        elif byte in b")]}":
            depth -= 1
        elif byte == 92 and depth == 0:
            return place
    return len(text)


def name_of(text: bytes) -> tuple[str, int] | None:
    """The name of data and its index, 0 where it has none; None where the text is no name."""
    match = _NAME.fullmatch(text)
    return None if match is None else (match[1].decode("latin-1"), int(match[2] or 0))


@dataclass(frozen=True, slots=True)
class Moved:
    """A target that is moved: `tool` along the tool, else along its frame.

    `inner` are the bytes of the target, and `numbers` those of the shift. `turns_deg` is what it is turned by
    about x, y, z of the tool."""

    tool: bool
    inner: Span
    numbers: tuple[Span, Span, Span]
    shift_mm: tuple[float, float, float]
    turns_deg: tuple[float, float, float]


def moved(data: bytes, span: Span) -> Moved | None:
    """What Offs or RelTool with numbers say; None where the text is neither."""
    match = _MOVED.fullmatch(data, *span)
    if match is None:
        return None
    turns = {axis.lower(): float(value) for axis, value in _TURN.findall(match[6])}
    x, y, z = (float(match[k]) for k in (3, 4, 5))
    tool = match[1].lower() == b"reltool"
    numbers = (match.span(3), match.span(4), match.span(5))
    return Moved(
        tool,
        match.span(2),
        numbers,
        (x, y, z),
        (turns.get(b"x", 0.0), turns.get(b"y", 0.0), turns.get(b"z", 0.0)),
    )
