"""Words of Okuma mills for the tool in the spindle: HA is the number of its length, DA that of its radius.

HB, HC, DB and DC name further offsets of the same tool, for which the machine file has no place.

Source: programming manuals of OSP-P200M and OSP-P300M.
"""

from __future__ import annotations

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.program.rs274.translation import Translation

#: A comment, where no word is; or one or two such words, which are no part of a name or an expression.
_SOUGHT = pattern(
    rb"(?i)\([^)\r\n]*\)?|;[^\r\n]*|"
    rb"(?<![A-Z_=+*/,\[-])((?:[HD][ \t]*[ABC]){1,2}|[HD][ \t]*[ABC][ \t]+[HD][ \t]*[ABC])"
    rb"(?=[ \t]*(?:[A-Z][ \t]*[-+.\d]|[HD][ \t]*[ABC]|[;(\r\n]|\Z))"
)
_WORD = pattern(rb"(?i)([HD])[ \t]*([ABC])")


def translate(data: bytes) -> Translation:
    """The text with `0` for the letter of each number, and the lines and letters of these words."""
    if not _WORD.search(data):
        return Translation(data)
    text = bytearray(data)
    letters: dict[int, str] = {}
    refused: dict[int, ProgramError] = {}
    line, counted = 1, 0
    for match in _SOUGHT.finditer(data):
        if not match[1]:
            continue
        line += data.count(b"\n", counted, match.start())
        counted = match.start()
        for word in _WORD.finditer(match[1]):
            letter, which = word[1].decode().upper(), word[2].decode().upper()
            place = match.start(1) + word.start(2)
            text[place : place + 1] = b"0"
            letters[line] = letters.get(line, "") + letter
            if which != "A":
                refused[line] = ProgramError(
                    f"{letter}{which} is a further offset of the tool in the spindle, which is not read; "
                    f"give its number, as in {letter}12, with a table of its own in [tools]",
                    line=line,
                    code="OLP512",
                )
    return Translation(bytes(text), refused=refused, of_spindle=letters)
