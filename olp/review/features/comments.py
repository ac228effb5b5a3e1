"""What the text of a program says between two of its lines: its last comment there."""

from __future__ import annotations

from olp.program.program import Program
from olp.review.listing import shown

#: Most characters of a comment that are shown.
_LONGEST = 80
#: Comments that begin so are statements of the system that wrote the program (Creo's `$$->`).
_STATEMENT = "->"
#: Most bytes before a line in which a comment is sought: a comment farther away is not about it.
_REACH = 1 << 14


def comment_between(program: Program, after: int, before: int, *, alone: bool = False) -> str:
    """The last comment on the lines between two lines (counted from 1; 0 is before the text), without its
    marks. A comment on a line of its own comes before one behind a statement, which does not count where it
    shall be `alone`. Empty where there is none."""
    if before - after < 2:
        return ""
    begin, end = int(program.line_start[after]), int(program.line_end[before - 2])
    text = program.data[max(begin, end - _REACH) : end]
    behind = ""
    for line in reversed(text.splitlines()):
        comment, own_line = _comment(program, line)
        if comment and own_line:
            return comment
        behind = behind or comment
    return "" if alone else behind


def _comment(program: Program, line: bytes) -> tuple[str, bool]:
    """The first comment of a line, and whether nothing else but a number of the block is on it."""
    places = [(line.find(mark), mark, end) for mark, end in program.dialect.comment_marks() if mark in line]
    if not places:
        return "", False
    at, mark, end = min(places)
    rest = line[at + len(mark) :]
    text, _, behind = rest.partition(end) if end else (rest, b"", b"")
    word = line[:at].strip().upper()
    alone = not behind.strip() and (not word or (word[:1] == b"N" and word[1:].isdigit()))
    words = " ".join(shown(text).split())
    if words.startswith(_STATEMENT):
        return "", False
    return words if len(words) <= _LONGEST else f"{words[:_LONGEST]} …", alone
