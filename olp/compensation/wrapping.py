"""Lines of statements that became longer than lines of the program are: they go on in the next line."""

from __future__ import annotations

import re


def wrapped(text: bytes, width: int, mark: bytes) -> bytes:
    """The text with lines of more than `width` bytes broken behind a comma, where `mark` joins them again.
    A line without a comma, or with a comment, stays as it is."""
    if not width:
        return text
    long = re.compile(rb"[^\r\n]{%d,}" % (width + 1))
    return long.sub(lambda found: _broken(found, text, width, mark), text)


def _broken(found: re.Match[bytes], text: bytes, width: int, mark: bytes) -> bytes:
    line = found[0]
    if b"$$" in line or b"'" in line:
        return line
    after = text[found.end() : found.end() + 2]
    eol = b"\r\n" if after == b"\r\n" else b"\n"
    pieces = []
    while len(line) > width:
        at = line.rfind(b",", 0, width - len(mark)) + 1
        if not at:
            break
        pieces.append(line[:at] + mark)
        line = line[at:]
    return eol.join([*pieces, line])
