"""Tools of Fagor mills: `T2.2` is the tool 2 with its offset 2, which the control takes for its length.

The tool table has one offset for each tool, so both numbers have to be the same.
"""

from __future__ import annotations

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.program.rs274.translation import Translation

#: A comment, where no word is; a T word; or a work offset.
_SOUGHT = pattern(rb"(?i)\([^)\r\n]*\)?|;[^\r\n]*|T[ \t]*(\d+)(?:(\.)(\d*))?|(G[ \t]*0*5[4-9])(?![\d.])|\n")
_AXIS = pattern(rb"(?i)\([^)\r\n]*\)?|;[^\r\n]*|([XYZ])")


def translate(data: bytes) -> Translation:
    """The text with blanks for the point and the offset of each T word. Lines with a tool without an offset,
    or with that of another tool, are refused, and so are work offsets with axes, which write them."""
    text = bytearray(data)
    refused: dict[int, ProgramError] = {}
    line = 1
    for match in _SOUGHT.finditer(data):
        if match[0] == b"\n":
            line += 1
        elif match[4]:
            end = data.find(b"\n", match.start())
            begin = data.rfind(b"\n", 0, match.start()) + 1
            block = data[begin : end if end >= 0 else len(data)]
            if any(axis[1] for axis in _AXIS.finditer(block)):
                why = (
                    f"{_shown(match[4])} with axes writes a work offset; state it in the machine or job file"
                )
                refused[line] = ProgramError(f"{why}, and take the axes out", line=line, code="OLP512")
        elif match[1]:
            tool, offset = int(match[1]), match[3]
            if offset and int(offset) == tool:
                text[match.start(2) : match.end(3)] = b" " * (match.end(3) - match.start(2))
                continue
            stated = f"has the offset {int(offset)} of another tool" if offset else "has no offset"
            refused[line] = ProgramError(
                f"T{tool} {stated}, and which length that is is not known; write T{tool}.{tool}, with a "
                f"table [tools.{tool}]",
                line=line,
                code="OLP516",
            )
    return Translation(bytes(text), refused=refused)


def _shown(word: bytes) -> str:
    return word.decode().upper().replace(" ", "").replace("\t", "")
