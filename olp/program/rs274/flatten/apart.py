"""Single calls of subprograms and single blocks written out, so that the others can be kept.

Blocks are those that unrolling writes with other words, such as corners and holes around a centre. Only
calls and blocks of the program itself that run once are written out, and only in programs without parameters:
what a subprogram sets would be lost.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from olp.program.origin import Origin, Unrolled
from olp.program.rs274.codes import MACROS, SPLINES
from olp.program.rs274.flatten.language import Language
from olp.program.rs274.flatten.lines import compile_line
from olp.program.text.line_ends import LINE_END

_COMMENT = re.compile(rb"\([^)]*\)|;.*")
_BOUND = re.compile(rb"(?i)#|GOTO|G[ \t]*0*66|M[ \t]*0*99[^\r\n]*P")
#: Calls, and splines.
_STAYS = frozenset({
    *(("m", code) for code in (970, 980, 990)), *(("g", code) for code in MACROS | SPLINES),
})  # fmt: skip
_NUMBER = re.compile(rb"(?i)^([ \t/]*)N[ \t]*\d+[ \t]*")


def can_be_apart(unrolled: Unrolled) -> bool:
    """Whether a program has no parameters, no jumps, and no macro that runs after each move."""
    return not any(_BOUND.search(_COMMENT.sub(b"", text)) for text in unrolled.origin.texts)


def otherwise(unrolled: Unrolled, lines: Sequence[bytes], language: Language) -> set[int]:
    """The lines of the program itself where a block runs that unrolling has written with other words: it is
    plain, and no call. Splines are written as chords on request only. `lines` are those of the unrolled
    text."""
    origin, found = unrolled.origin, set[int]()
    rows = zip(unrolled.within.line.tolist(), origin.line.tolist(), lines, strict=True)
    for within, line, text in rows:
        source = origin.texts[line - 1]
        if source.strip() == text.strip():
            continue
        block = compile_line(source, line, language)
        codes = {(word.letter, round(10 * word.number)) for word in block.words}
        if block.flow is None and block.plain and not codes & _STAYS:
            own = [(word.letter, word.number) for word in block.words if word.letter != "n"]
            if own != [
                (w.letter, w.number) for w in compile_line(text, line, language).words if w.letter != "n"
            ]:
                found.add(within)
    return found


def runs_once(unrolled: Unrolled) -> frozenset[int]:
    """The lines of the program itself that run once, of those that have a block."""
    runs: dict[int, set[int]] = {}
    for line, run in zip(unrolled.within.line.tolist(), unrolled.within.run.tolist(), strict=True):
        runs.setdefault(line, set()).add(run)
    return frozenset(line for line, each in runs.items() if len(each) == 1)


def apart(unrolled: Unrolled, calls: frozenset[int], lines: list[bytes]) -> Unrolled:
    """The program with the calls in these of its lines written out; `lines` are those of the unrolled text.
    Block numbers of subprograms are left out there."""
    origin = unrolled.origin
    ends = (LINE_END.search(text) for text in lines)
    eol = next((match[0] for match in ends if match), b"\n")
    blocks: dict[int, list[tuple[bytes, int]]] = {line: [] for line in calls}
    each = zip(unrolled.within.line.tolist(), origin.line.tolist(), lines, strict=True)
    for within, line, text in each:
        if within in blocks:
            bare = text if line == within else _NUMBER.sub(rb"\1", text)
            blocks[within].append((bare if bare.endswith((b"\n", b"\r")) else bare + eol, line))
    rows: list[tuple[bytes, int]] = []
    for number, text in enumerate(origin.texts[: origin.lines], 1):
        rows += blocks.get(number, [(text, number)])
    line_of = np.array([line for _, line in rows], np.int64)
    whole = Origin(origin.files, origin.first, origin.texts, line_of)
    return Unrolled.of(b"".join(text for text, _ in rows), whole)
