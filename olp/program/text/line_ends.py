"""Where lines of a text end: at a line feed and the carriage returns before it, or at a lone carriage return.

Some exporters write CR CR LF, which editors and controls take for one line end.
"""

from __future__ import annotations

import re

from olp.core.patterns import pattern

#: One line end, where a lone carriage return is one.
LINE_END = pattern(rb"\r*\n|\r")
#: The same in text.
LINE_END_TEXT = pattern(r"\r*\n|\r")
#: A carriage return that belongs to no line feed and is not the last byte of the text.
LONE_CR = pattern(rb"\r(?!\r*\n|\Z)")
#: A carriage return within a line, for controls that end a line at a line feed alone.
STRAY_CR = pattern(rb"\r(?!\r*(?:\n|\Z))")


def stray_cr(data: bytes) -> int:
    """Where the first carriage return within a line is, or -1."""
    if data.count(b"\r") == data.count(b"\r\n"):
        # a search takes 30 ns a byte
        return -1
    stray = STRAY_CR.search(data)
    return -1 if stray is None else stray.start()


def split(data: bytes, ending: re.Pattern[bytes] = LINE_END) -> list[bytes]:
    """The lines with their ends; the end of the last line begins no further line."""
    if ending is LINE_END and b"\r\r\n" not in data:
        return data.splitlines(keepends=True)
    rows, begin = [], 0
    for match in ending.finditer(data):
        rows.append(data[begin : match.end()])
        begin = match.end()
    if begin < len(data):
        rows.append(data[begin:])
    return rows


def ends_in(data: bytes, begin: int, stop: int) -> int:
    """How many lines end in the bytes `begin`..`stop`."""
    if data.find(b"\r", begin, stop) < 0:
        return data.count(b"\n", begin, stop)
    return sum(1 for _ in LINE_END.finditer(data, begin, stop))
