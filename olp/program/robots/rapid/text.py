"""The statements of a RAPID text, with their lines and bytes. Nothing here knows what they mean."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.values import dataclass

#: Blanks and comments between statements, the header of a file, what names the modules of a program, and
#: places where statements are still to be programmed: the control stops there.
_ASIDE = pattern(
    rb"(?:\s+|!@?[^\r\n]*|%%%[^%]*%%%|\xef\xbb\xbf|<\?[^<>]*>|"
    rb"<(?i:SMT|DDN|RDN|TDN)>|<(?i:program)[^<>]*>[^<>]*(?:<(?i:module)>[^<>]*</(?i:module)>[^<>]*)*</(?i:program)>)*"
)
#: Statements that end without a semicolon.
_BLOCK = pattern(
    rb"(?i)(?:(?P<routine>(?:LOCAL\s+|TASK\s+)?(?:PROC|FUNC|TRAP|RECORD)\b)[^\r\n!;]*|"
    rb"(?P<module>MODULE\s+\w+(?:\s*\([^)]*\))?)|"
    rb"(?P<end>END(?:MODULE|PROC|FUNC|TRAP|RECORD|IF|FOR|WHILE|TEST)\b)|"
    rb"(?P<part>ERROR\s*\([^;!()]*\)|(?:ERROR|UNDO|BACKWARD|ELSE|DEFAULT\s*:)(?![\w:]))|"
    rb"(?P<elseif>ELSEIF\b(?:[^;!\"]|\"[^\"\r\n]*\")*?\bTHEN\b)|"
    rb"(?P<case>CASE\b(?:[^;!\"]|\"[^\"\r\n]*\")*?:(?!=))|"
    rb"(?P<if>IF\b(?:[^;!\"]|\"[^\"\r\n]*\")*?\bTHEN\b)|"
    rb"(?P<loop>(?:FOR|WHILE)\b(?:[^;!\"]|\"[^\"\r\n]*\")*?\bDO\b)|"
    rb"(?P<test>TEST\b[^\r\n!;]*)|"
    rb"(?P<label>[A-Za-z]\w*\s*:(?!=)))"
)
_STATEMENT = pattern(rb"(?:[^;\"!]|\"[^\"\r\n]*\"|![^\r\n]*)*;")
_WORD = pattern(rb"\s*([A-Za-z]\w*)")
_COMMENT = pattern(rb"\"[^\"\r\n]*\"|![^\r\n]*")


@dataclass(frozen=True, slots=True)
class Statement:
    """A statement from byte `begin` to byte `end`, its semicolon left out. `block` is what it is where it
    ends without a semicolon: a name of `_BLOCK`, else "". `text` has blanks in place of comments, and `word`
    is its first word in capitals, empty where it begins with something else."""

    line: int
    begin: int
    end: int
    text: bytes
    block: str
    word: bytes

    @staticmethod
    def of(line: int, begin: int, end: int, text: bytes, block: str = "") -> Statement:
        """With its first word."""
        word = _WORD.match(text)
        return Statement(line, begin, end, text, block, b"" if word is None else word[1].upper())


class Lines:
    """Lines of a text by their bytes."""

    def __init__(self, data: bytes) -> None:
        self.starts = [0, *(hit.end() for hit in re.finditer(rb"\r\n|\n|\r", data))]

    def of(self, place: int) -> int:
        """The line of a byte, counted from 1."""
        return bisect_right(self.starts, place)


def statements(data: bytes, lines: Lines) -> Iterator[Statement]:
    """All statements in order. Raises ProgramError with the line of one that has no end."""
    place = 0
    while True:
        aside = _ASIDE.match(data, place)
        assert aside is not None
        place = aside.end()
        if place >= len(data):
            return
        line = lines.of(place)
        block = _BLOCK.match(data, place)
        if block is not None:
            yield Statement.of(line, place, block.end(), block[0], block.lastgroup or "")
            place = block.end()
            continue
        end, text = _end_of(data, place)
        if end < 0:
            raise ProgramError(
                f"`{_shown(data[place : place + 60])}` has no semicolon at its end",
                line=line,
                code="OLP510",
            )
        yield Statement.of(line, place, end, text)
        place = end + 1


def _end_of(data: bytes, place: int) -> tuple[int, bytes]:
    """Where a statement ends that begins at a byte, -1 where it has no end, and its text with blanks in place
    of comments."""
    end = data.find(b";", place)
    text = data[place:end]
    # a semicolon may stand in a string or a comment
    if end < 0 or (b'"' not in text and b"!" not in text):
        return end, text
    match = _STATEMENT.match(data, place)
    if match is None:
        return -1, b""
    return match.end() - 1, _COMMENT.sub(_blanked, match[0][:-1])


def _blanked(hit: re.Match[bytes]) -> bytes:
    return b" " * len(hit[0]) if hit[0].startswith(b"!") else hit[0]


def _shown(text: bytes) -> str:
    return text.split(b"\n")[0].decode("latin-1").strip()
