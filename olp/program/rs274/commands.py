"""Controls whose lines are commands, as printers have them: a code or a name, and parameters behind it.

A command is the first word of its line, behind a line number. All other letters are its parameters, and no
code of motion holds for the next line. Lines that are more than words, such as `G28 X`, `M117 Layer 1` or
`START_PRINT BED=60`, are sorted here by their name.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import field
from enum import Enum, auto

import numpy as np

from olp.core.arrays import Index, Mask, is_in
from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.core.spool import Text, matches
from olp.core.values import dataclass
from olp.program.rs274.lexer import WordChunk

_COMMENT = pattern(rb";.*", re.DOTALL)
_COMMENTS = pattern(rb"\([^)]*\)?|;.*", re.DOTALL)
_NUMBERED = pattern(rb"N[ \t]*\d+[ \t]*")
_CODE = pattern(rb"([GMT])[ \t]*(\d+(?:\.\d+)?)(?![\w.])|([GMT])[ \t]*(\d+(?:\.\d+)?)(?=[A-Z])")
_NAME = pattern(rb"[A-Z_][A-Z0-9_]+")
_COMMAND_LETTERS = is_in(np.arange(256), list(b"GMT"))
#: What is shifted by offsets, and 0 as a number.
_OFFSETS = (b"X", b"Y", b"Z", b"E")
_ZERO = pattern(rb"[-+]?(?:0+\.?0*|\.0+)")
#: Characters of a line that a message shows.
_SHOWN = 60


class Reading(Enum):
    """What a line of more than words does to positions."""

    STILL = auto()  #: nothing: its bytes are unchanged
    MOVES = auto()  #: no position is known after it
    UNKNOWN = auto()  #: the same, and what it does is not known: a macro of the machine


@dataclass(frozen=True, slots=True, kw_only=True)
class Commands:
    """How a control takes lines of commands.

    - `text`: M codes whose parameters are any text.
    - `named`: names may be commands. `still` are those that move nothing, `refused` those that change what
      positions mean, and why. Others are macros of the machine.
      `zeros` are refused unless all their offsets are 0, as those of axes that nothing has shifted are.
    - `still_with`: M codes that move nothing where they have a parameter.
    - `extruder`: the letter of the extruder, which is shared out where a move is split. `extruder_follows`:
      G90 and G91 decide of it as M82 and M83 do; else it is relative in G91, and by M82 and M83 in G90.
    - `arc_words`: parameters of G2 and G3 that are read.
    """

    text: frozenset[int]
    named: bool = False
    still: frozenset[bytes] = frozenset()
    refused: Mapping[bytes, str] = field(default_factory=dict)
    zeros: Mapping[bytes, str] = field(default_factory=dict)
    still_with: Mapping[int, str] = field(default_factory=dict)
    extruder: str = "E"
    extruder_follows: bool
    arc_words: str

    def feeds(self, data: Text, *, brackets: bool) -> bool:
        """Whether a text moves the extruder: else its G1 are cuts, and not travels where nothing is fed.
        With `brackets` (a) is a comment."""
        move = rb"(?im)^[ \t]*(?:N[ \t]*\d+[ \t]*)?G[ \t]*0*[0-3][ \t]*(?![\d.])"
        move += rb"(?:\([^)\r\n]*\)|[^;(\r\n])*" if brackets else rb"[^;\r\n]*"
        return next(matches(re.compile(move + self.extruder.encode()), data), None) is not None


def own_words(chunk: WordChunk) -> Mask:
    """(words,) the commands of their lines: the first word of each that is no line number."""
    own = np.zeros(len(chunk.letter), bool)
    first = chunk.first_word[:-1][np.diff(chunk.first_word) > 0]
    numbered = chunk.letter[first] == ord("N")
    behind = first + numbered
    some = behind < chunk.first_word[1:][np.diff(chunk.first_word) > 0]
    own[behind[some]] = True
    return own


def check_lines(chunk: WordChunk, own: Mask, active: Mask, arcs: Mask, commands: Commands) -> None:
    """Refuse lines without a command, and arcs with parameters that are read in no way; all at once."""
    errors = {}
    lost = own & ~_COMMAND_LETTERS[chunk.letter] & active[chunk.line]
    for line in chunk.line[lost].tolist():
        why = "this line has no command, and no code holds from line to line; expected G0, G1, G2 or G3"
        errors[line] = ProgramError(why, line=chunk.first_line + line + 1, code="OLP517")
    for line in np.flatnonzero(chunk.deleted & active).tolist():
        why = "`/` is not block delete on this control; remove the line or the `/`"
        errors[line] = ProgramError(why, line=chunk.first_line + line + 1, code="OLP505")
    odd = is_in(chunk.letter, list(b"IJKRP")) & ~is_in(chunk.letter, list(commands.arc_words.encode()))
    odd &= arcs[chunk.line]
    for word in np.flatnonzero(odd).tolist():
        line, letter = int(chunk.line[word]), chr(int(chunk.letter[word]))
        why = (
            f"{letter} of an arc is not read on this control; state its centre by {commands.arc_words[:2]} "
            "in one turn"
        )
        error = ProgramError(why, line=chunk.first_line + line + 1, code="OLP519", word=letter)
        errors.setdefault(line, error)
    if errors:
        raise ProgramError.together(errors.values())


def sorted_line(
    line: bytes, commands: Commands, still_m: frozenset[int], moving: frozenset[int], still_g: frozenset[int],
    known: frozenset[str], *, brackets: bool = False, by_option: bool = False,
) -> Reading:  # fmt: skip
    """What a line of more than words does. `still_m` and `still_g` are codes, ten times their number, that
    move no axis; after `moving` no position is known. `known` are macros that the machine file states as
    still. `brackets`: (a) is a comment, else `by_option` says whether the machine file may state that.
    Raises ProgramError, without a line, for what cannot be read correctly."""
    text = (_COMMENTS if brackets else _COMMENT).sub(b" ", line).strip().upper()
    numbered = _NUMBERED.match(text)
    text = text[numbered.end() :] if numbered else text
    shown = line.strip()[:_SHOWN].decode("latin-1")
    code = _CODE.match(text)
    if code is not None:
        letter, number = code[1] or code[3], round(10 * float(code[2] or code[4]))
        if letter == b"M" and number % 10 == 0 and number // 10 in commands.text:
            return Reading.STILL
        if b"*" in text:
            raise ProgramError(
                f"`{shown}` has a checksum, which no corrected line would keep; save the program without "
                "line numbers and checksums, which its sender adds",
                code="OLP505",
            )
        if letter == b"M":
            return Reading.STILL if number in still_m else Reading.MOVES
        if letter == b"G" and number in moving | still_g:
            return Reading.MOVES if number in moving else Reading.STILL
    if text.startswith(b"(") or (b"(" in text and code is not None):
        option = ", or state bracket_comments = true in the machine file where its firmware has that option"
        raise ProgramError(
            f"`{shown}` has brackets, which are no comment on this control; write the comment behind `;`"
            f"{option if by_option else ''}",
            code="OLP514",
        )
    name = _NAME.match(text)
    if commands.named and name is not None and code is None:
        why = commands.refused.get(name[0])
        if name[0] in commands.zeros and not _all_zero(text[name.end() :]):
            why = commands.zeros[name[0]]
        if why is not None:
            raise ProgramError(f"`{shown}` {why}", code="OLP512")
        if name[0] in commands.still | commands.zeros.keys() or name[0].decode() in known:
            return Reading.STILL
        return Reading.UNKNOWN
    if not text:
        return Reading.STILL
    raise ProgramError(
        f"`{shown}` is not understood and may move the machine; expected a command and parameters, each a "
        "letter and a number",
        code="OLP510",
    )


def _all_zero(parameters: bytes) -> bool:
    """Whether all offsets among the parameters of a command (`Z=0`, `Z_ADJUST=0.0`) are 0."""
    pairs = [pair.partition(b"=") for pair in parameters.split()]
    offsets = [value for name, _, value in pairs if name.partition(b"_")[0] in _OFFSETS]
    return bool(pairs) and all(_ZERO.fullmatch(value) for value in offsets)


def last_of_line(chunk: WordChunk, letter: str, lines: Mask) -> Index:
    """(lines,) the index of the word with a letter in each of the `lines`, -1 where there is none."""
    word = np.full(len(lines), -1, np.int64)
    mine = np.flatnonzero(chunk.letter == ord(letter))
    word[chunk.line[mine]] = mine
    word[~lines] = -1
    return word
