"""Comments that instruct `olp`: `(olp off)`, `(olp on)`, and `(olp payload 30 kg)`.

Any comment of the dialect serves, in capital or small letters. A section between `olp off` and `olp on` is
left uncorrected. A payload holds from its line on, including the motion of that line.

The job file may give payloads by line (`[[payloads]]`). These are put into the text as such comments, marked
with their line, before it is read. So they keep to their blocks when a program is unrolled or corrected. A
text that has the marks is not marked again.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Mask
from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.spool import Text
from olp.program.rs274.lexer import WordChunk
from olp.program.text.line_ends import LINE_END

_DIRECTIVE = pattern(rb"([(;])[ \t]*olp[ \t]+([^\r\n]*)", re.IGNORECASE)
_SWITCH = pattern(rb"(off|on)\b", re.IGNORECASE)
_PAYLOAD = pattern(r"payload[ \t]+(\d+(?:\.\d*)?|\.\d+)(?:[ \t]*kg)?(?:[ \t]*,[ \t]*line[ \t]+(\d+))?", re.I)
_MARKED = pattern(
    rb"[(;][ \t]*olp[ \t]+payload[ \t]+([\d.]+)[ \t]*(?:kg)?[ \t]*(?:,[ \t]*line[ \t]+(\d+))?", re.IGNORECASE
)


class Directives:
    """What the comments of a text say, as far as it has been read."""

    def __init__(self, data: Text) -> None:
        self._data = data
        self._text = np.frombuffer(data, np.uint8)
        self._lines = np.zeros(0, np.int64)
        # the first entry is for the lines before any switch
        self._off = np.zeros(1, bool)

    def follow(self, chunk: WordChunk) -> dict[int, float]:
        """Read the comments of the next chunk. Returns payloads in kg by the line of the chunk, from 0, from
        which they hold. Raises ProgramError for a payload that cannot be read."""
        after = self._text[np.minimum(chunk.comments + 1, len(self._text) - 1)]
        may_be = chunk.comments[((after | 32) == ord("o")) | (after <= 32)]
        matches = [m for m in (_DIRECTIVE.match(self._data, start) for start in may_be.tolist()) if m]
        payloads: dict[int, float] = {}
        if not matches:
            return payloads
        places = np.searchsorted(chunk.line_start, [m.start() for m in matches], "right") - 1
        for match, place in zip(matches, places.tolist(), strict=True):
            switch = _SWITCH.match(match[2])
            if switch:
                self._lines = np.append(self._lines, chunk.first_line + place)
                self._off = np.append(self._off, switch[1].lower() == b"off")
                continue
            number = chunk.first_line + place + 1
            content = match[2].partition(b")")[0] if match[1] == b"(" else match[2]
            payload = _payload(content.decode("latin-1").strip(), number)
            if payload is None:
                continue
            if place in payloads:
                raise ProgramError("this line has two payloads; expected one", line=number, code="OLP550")
            if chunk.deleted[place]:
                raise ProgramError(
                    "a payload is under block delete, so it is not known whether it holds afterwards; "
                    "move it to a block without `/`",
                    line=number,
                    code="OLP525",
                )
            payloads[place] = payload
        return payloads

    def __bool__(self) -> bool:
        return len(self._lines) > 0

    def off(self, number: npt.ArrayLike) -> Mask:
        """Whether lines of these numbers, counted from 1, are exempt."""
        return np.asarray(self._off[np.searchsorted(self._lines, np.asarray(number) - 1, "right")])


def _payload(content: str, line: int) -> float | None:
    """The payload that a comment states; None where it is about something else."""
    import difflib

    word = content.split(maxsplit=1)[0].rstrip("=:,").lower() if content else ""
    if not word.startswith("payload") and not difflib.get_close_matches(word, ["payload"], cutoff=0.7):
        return None
    match = _PAYLOAD.fullmatch(content)
    if match is None or not math.isfinite(float(match[1])):
        raise ProgramError(
            f"the comment `olp {content[:40]}` is not understood; "
            "expected a mass in kg, such as (OLP PAYLOAD 30 kg)",
            line=line,
            code="OLP550",
        )
    return float(match[1])


def with_payloads(data: Text, payloads: Mapping[int, float], comment: tuple[bytes, bytes]) -> Text:
    """The text with a comment at the end of each line of `payloads` (line from 1, kg), where it has none yet;
    no line is added. Raises ProgramError for a line that the text does not have, and where the text states
    payloads of its own."""
    if not payloads:
        return data
    marks = {}
    for match in _MARKED.finditer(data):
        if match[2] is None:
            raise ProgramError(
                "the program states a payload here, and the job file states payloads in [[payloads]]; "
                "expected one of the two",
                line=len(LINE_END.findall(data, 0, match.start())) + 1,
                code="OLP550",
            )
        marks[int(match[2])] = float(match[1])
    if marks:
        if marks != dict(payloads):
            raise ProgramError(
                "the payloads in the comments of this program are not those of [[payloads]] in the job file; "
                "give the job file that it was made with",
                code="OLP550",
            )
        return data
    ends = [m.start() for m in LINE_END.finditer(data)]
    starts = [0, *(m.end() for m in LINE_END.finditer(data))]
    ends += [len(data)]
    pieces, done = [], 0
    for line, mass in sorted(payloads.items()):
        if line > len(ends) or (line == len(ends) and starts[-1] == len(data)):
            raise ProgramError(
                f"[[payloads]] of the job file names line {line}, and the program has fewer lines; "
                "give the number of one of its lines",
                code="OLP550",
            )
        text = data[starts[line - 1] : ends[line - 1]]
        semicolon = _outside_brackets(text)
        place = ends[line - 1] if semicolon is None else starts[line - 1] + semicolon
        stated = comment[0] + f"OLP PAYLOAD {_short(mass)} kg, line {line}".encode() + comment[1]
        blank = b" " if text[: place - starts[line - 1]].strip() else b""
        pieces += [data[done:place], blank, stated]
        done = place
    return b"".join([*pieces, data[done:]])


def _outside_brackets(text: bytes) -> int | None:
    """Where a comment to the end of the line opens; None where there is none."""
    depth = False
    for index, byte in enumerate(text):
        if byte == 40:
            depth = True
        elif byte == 41:
            depth = False
        elif byte == 59 and not depth:
            return index
    return None


def _short(mass: float) -> str:
    """A decimal number without an exponent that is read back as the same value."""
    return np.format_float_positional(mass, trim="-")
