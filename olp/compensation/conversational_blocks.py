"""What stands around the words of a block that is put behind a line of a conversational program."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

from olp.program.heidenhain.columns import NORMAL, SIDE
from olp.program.program import Program

_NUMBER = re.compile(rb"[ \t]*\d*[ \t]*")
_SPACED = re.compile(rb"(?i)\bF[ \t]+MAX\b")


class ConversationalBlocks:
    """Numbers of blocks, R0 and FMAX, as a program writes them."""

    def __init__(self, program: Program) -> None:
        self._program = program
        self._rapid = b" F MAX" if _SPACED.search(program.data) else b" FMAX"

    def signed(self, words: npt.NDArray[np.int32]) -> bool:
        """Whether most of these words that are not negative have a plus."""
        assert self._program.words is not None
        first = np.frombuffer(self._program.data, np.uint8)[self._program.words.number[words]]
        return bool((first == ord("+")).sum() > ((first != ord("+")) & (first != ord("-"))).sum())

    def lead(self, line: int) -> bytes:
        """What comes before the name of a block that is put behind a line: a line end and the number."""
        number = _NUMBER.match(self._program.data, int(self._program.line_start[line - 1]))
        assert number is not None
        return self._program.eol(line) + number[0].lstrip()

    def normal(self, line: int) -> bytes:
        """The words of the normal of the surface that a block states, empty where it has none."""
        words = self._program.words
        assert words is not None
        own = [i for i in words.of_line(line) if words.letter[i] == NORMAL]
        return b"".join(b" " + self._program.data[words.start[i] : words.end[i]] for i in own)

    def trail(self, line: int) -> bytes:
        """What comes behind the words of a part of a block: R0 and FMAX where the block has them."""
        words = self._program.words
        assert words is not None
        text = b""
        for i in words.of_line(line):
            if words.letter[i] == SIDE and words.mantissa[i] == 0:
                text += b" R0"
            elif words.letter[i] == ord("F") and words.mantissa[i] < 0:
                text += self._rapid
        return text
