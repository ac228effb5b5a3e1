"""Lines of statements that became longer than lines of the program are: they go on in the next line."""

from __future__ import annotations

import re

import numpy as np

#: Columns at the end of a card that hold its number, and what may stand in them.
_COLUMNS = 8
_CARD_NUMBER = re.compile(rb"[A-Z]{0,4} *\d{1,8} *\Z")


def wrapped(text: bytes, width: int, mark: bytes) -> bytes:
    """The text with lines of more than `width` bytes broken behind a comma, where `mark` joins them again.
    A line without a comma, or with a comment, is unchanged."""
    if not width:
        return text
    ends = np.flatnonzero(np.frombuffer(text, np.uint8) == 10)
    starts = np.concatenate(([0], ends + 1))
    stops = np.append(ends, len(text))
    long = np.flatnonzero(stops - starts > width)
    parts, position = [], 0
    for start, stop in zip(starts[long].tolist(), stops[long].tolist(), strict=True):
        eol = b"\r\n" if text[stop - 1 : stop] == b"\r" else b"\n"
        line = text[start:stop].rstrip(b"\r")
        parts += [text[position:start], _broken(line, width, mark, eol)]
        position = start + len(line)
    return b"".join([*parts, text[position:]]) if parts else text


def card_stamp(stamp: bytes, width: int) -> bytes:
    """A stamp as a whole card without a number: a line of another length would tell a reader that the text
    is no deck of cards."""
    return stamp.ljust(width + _COLUMNS)


def carded(text: bytes, width: int, mark: bytes) -> bytes:
    """A text of cards, some of whose lines have another length or are new. Their numbers are put into the
    eight columns behind `width` again, each once. A line that is too long goes on in a card without a
    number."""
    lines: list[bytes] = []
    last = b""
    for raw in text.split(b"\n"):
        end = b"\r" if raw.endswith(b"\r") else b""
        line = raw.removesuffix(b"\r")
        number = line[-_COLUMNS:]
        numbered = len(line) > _COLUMNS and (line[-_COLUMNS - 1 : -_COLUMNS] == b" " or len(line) > width)
        if not line.strip():
            lines.append(raw)
            continue
        if not (numbered and _CARD_NUMBER.match(number)):
            number, body = b" " * _COLUMNS, line.rstrip()
        else:
            body = line[:-_COLUMNS].rstrip()
        if number == last:
            number = b" " * _COLUMNS
        last = number if number.strip() else last
        first, *more = _broken(body, width, mark, b"\n").split(b"\n")
        lines.append(first.ljust(width) + number + end)
        lines += [card.ljust(width) + b" " * _COLUMNS + end for card in more]
    return b"\n".join(lines)


def _broken(line: bytes, width: int, mark: bytes, eol: bytes) -> bytes:
    if b"$$" in line or b"'" in line:
        return line
    pieces = []
    while len(line) > width:
        cut = line.rfind(b",", 0, width - len(mark)) + 1
        if not cut:
            break
        pieces.append(line[:cut] + mark)
        line = line[cut:]
    return eol.join([*pieces, line])
