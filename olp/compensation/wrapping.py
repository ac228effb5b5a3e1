"""Lines of statements that became longer than lines of the program are: they go on in the next line."""

from __future__ import annotations

import numpy as np


def wrapped(text: bytes, width: int, mark: bytes) -> bytes:
    """The text with lines of more than `width` bytes broken behind a comma, where `mark` joins them again.
    A line without a comma, or with a comment, stays as it is."""
    if not width:
        return text
    ends = np.flatnonzero(np.frombuffer(text, np.uint8) == 10)
    starts = np.concatenate(([0], ends + 1))
    stops = np.append(ends, len(text))
    long = np.flatnonzero(stops - starts > width)
    parts, at = [], 0
    for start, stop in zip(starts[long].tolist(), stops[long].tolist(), strict=True):
        eol = b"\r\n" if text[stop - 1 : stop] == b"\r" else b"\n"
        line = text[start:stop].rstrip(b"\r")
        parts += [text[at:start], _broken(line, width, mark, eol)]
        at = start + len(line)
    return b"".join([*parts, text[at:]]) if parts else text


def _broken(line: bytes, width: int, mark: bytes, eol: bytes) -> bytes:
    if b"$$" in line or b"'" in line:
        return line
    pieces = []
    while len(line) > width:
        at = line.rfind(b",", 0, width - len(mark)) + 1
        if not at:
            break
        pieces.append(line[:at] + mark)
        line = line[at:]
    return eol.join([*pieces, line])
