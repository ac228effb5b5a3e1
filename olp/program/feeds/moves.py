"""The feed of each move, from the F, S and G93 to G95 words of a program that has been read.

An F word counts with the unit in force where it is written: a later G20 or G21 does not change it. A change
of feed mode forgets F; LinuxCNC forgets it at each G94 and G95.
"""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array, Index, Mask, distinct, is_in
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.toolpath import Flag, Kind, Toolpath
from olp.core.units import MM_PER_INCH
from olp.core.values import dataclass
from olp.program.program import Program, Words
from olp.program.rs274.codes import DWELL, THREAD
from olp.program.rs274.profiles.base import Profile

#: Powers of ten by their exponent: those of the decimals of a number.
_POW10 = 10.0 ** np.arange(19)
#: G0 to G3.
_LAST_MOTION = 3
#: G94, feed per minute, as ten times its number.
_PER_MINUTE = 940
#: G95, feed per turn of the spindle, as ten times its number.
_PER_TURN = 950
#: G93, inverse time, as ten times its number.
_INVERSE = 930


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """The words of a program that concern time: `word` (k,) their indices, `line` (k,) counted from 1;
    the G codes among them once more, as ten times their number, in `code` and `code_line`."""

    program: Program
    words: Words
    word: Index
    line: Index
    code: Index
    code_line: Index

    @staticmethod
    def of(program: Program, words: Words, *, block_delete: bool) -> Scan:
        """The F, G, M and S words of the blocks that are carried out."""
        by_letter = [np.flatnonzero(words.letter == letter) for letter in b"FGMS"]
        word = np.sort(np.concatenate(by_letter))
        line = np.searchsorted(words.first_word, word, "right")
        active = line <= program.end_line
        if block_delete:
            active &= ~is_in(line, deleted_lines(program))
        word, line = word[active], line[active]
        word, line = _carried_out(program.rs274, words, word, line)
        g = words.letter[word] == ord("G")
        code = np.rint(numbers(words, word[g]) * 10).astype(np.int64)
        for alias, meant in program.rs274.aliases.items():
            code[np.rint(numbers(words, word[g]) * 10) == alias] = meant
        return Scan(program, words, word, line, code, line[g])

    def of_letter(self, letter: bytes) -> tuple[Index, Index]:
        """Indices and lines of the words of a letter."""
        mine = self.words.letter[self.word] == ord(letter)
        return self.word[mine], self.line[mine]


def _carried_out(profile: Profile, words: Words, word: Index, line: Index) -> tuple[Index, Index]:
    """Of words and their lines those that a control carries out.

    Of blocks all words, but an F that is the time of a dwell; of commands the code that comes first, and the
    feed of a move."""
    if "F" in profile.dwell_words:
        dwells = line[(words.letter[word] == ord("G")) & (numbers(words, word) == DWELL / 10)]
        mine = (words.letter[word] != ord("F")) | ~is_in(line, dwells)
        word, line = word[mine], line[mine]
    if profile.commands is None or not len(word):
        return word, line
    first = words.first_word[line - 1]
    first = np.minimum(first + (words.letter[first] == ord("N")), len(words.letter) - 1)
    moves = (words.letter[first] == ord("G")) & (words.mantissa[first] <= _LAST_MOTION)
    mine = (word == first) | (moves & (words.letter[word] == ord("F")))
    return word[mine], line[mine]


def numbers(words: Words, word: Index) -> Array:
    """The numbers of words, as written."""
    return np.asarray(words.mantissa[word] / _POW10[words.decimals[word]], float)


def deleted_lines(program: Program) -> Index:
    """The lines that start with `/`, counted from 1."""
    text = np.frombuffer(program.data, np.uint8)
    slash = np.flatnonzero(text == ord("/"))
    line = np.searchsorted(program.line_start, slash, "right")
    start = program.line_start[line - 1]
    pairs = zip(start.tolist(), slash.tolist(), strict=True)
    blank = [not program.data[a:b].strip() for a, b in pairs]
    return distinct(line[np.array(blank, bool)])


def lengths_mm(path: Toolpath) -> Array:
    """(n,) length of each move, along the arc where it is one; NaN from or to unknown positions."""
    start, end = path.starts_mm(), path.end_mm
    step = end - start
    length = np.sqrt(np.einsum("ij,ij->i", step, step))
    arcs = path.arcs
    if len(arcs):
        rows = np.arange(len(arcs))
        axes = np.array(PLANES)[arcs.plane]
        first, second, third = axes[:, 0], axes[:, 1], axes[:, 2]
        centre = arcs.centre_mm
        c0, c1 = centre[rows, first], centre[rows, second]
        a, b = start[arcs.move], end[arcs.move]
        radius = np.hypot(a[rows, first] - c0, a[rows, second] - c1)
        radius = 0.5 * (radius + np.hypot(b[rows, first] - c0, b[rows, second] - c1))
        length[arcs.move] = np.hypot(radius * arcs.sweep_rad, b[rows, third] - a[rows, third])
    return np.asarray(length, float)


def governing(scan: Scan) -> tuple[Index, Index]:
    """(n,) the feed moves, and which of the F words of the scan, in order, gives the feed of each.

    Raises ProgramError for a feed move without a feed.
    """
    path = scan.program.toolpath
    move = np.flatnonzero(path.kind != Kind.RAPID)
    if not len(move):
        return move, move
    line = path.line[move].astype(np.int64)
    mode, since = _modes(scan).in_force(line)
    _, f_line = scan.of_letter(b"F")
    latest = np.searchsorted(f_line, line, "right") - 1
    inverse = mode == _INVERSE
    # in G93 F counts in its own block only, else since the mode began
    needed = np.where(inverse, line, since)
    stated = (latest >= 0) & (np.append(f_line, -1)[latest] >= needed)
    _refuse(~stated, line, inverse)
    return move, latest.astype(np.int64)


def feeds(scan: Scan) -> Array:
    """(n,) feed of each move in mm/s: inf for rapids, NaN for moves that the control makes by itself and
    where the time of G93 has no length. Raises ProgramError for a feed move without a feed, or with one that
    cannot be read correctly."""
    program, path = scan.program, scan.program.toolpath
    threads = scan.code_line[scan.code == THREAD]
    if threads.size:
        raise ProgramError(
            "G33 moves in time with the spindle, whose turns are not known, so it has no feed",
            line=int(threads[0]),
            code="OLP551",
        )
    feed_mm_s = np.full(len(path), np.inf)
    feed_mm_s[(path.flag & np.uint8(Flag.CONTROL)) != 0] = np.nan
    move, latest = governing(scan)
    if not len(move):
        return feed_mm_s
    line = path.line[move].astype(np.int64)
    modes = _modes(scan)
    mode, _ = modes.in_force(line)
    f_word, f_line = scan.of_letter(b"F")
    value, pointed = numbers(scan.words, f_word), scan.words.pointed[f_word]
    # RS-274 takes F before a G20 or G21 of the same block
    unit = _unit(scan, f_line, before=program.rs274.feed_before_unit)
    inverse = mode == _INVERSE
    used = distinct(latest)
    _check_values(scan, modes, f_line[used], value[used], pointed[used], unit[used])
    feed = value[latest] * unit[latest] / 60.0
    turning = mode == _PER_TURN
    if turning.any():
        feed[turning] *= _spindle(scan, line[turning])
    if inverse.any():
        own = value[latest[inverse]] / 60.0 * lengths_mm(path)[move[inverse]]
        least = program.rs274.least_inverse_feed / 60.0 * _unit(scan, line[inverse])
        feed[inverse] = np.where(own > 0, np.maximum(own, least), np.nan)
    feed_mm_s[move] = feed
    return feed_mm_s


@dataclass(frozen=True, slots=True, eq=False)
class _Modes:
    """Feed modes: (k,) lines on which each came into force, and the line from which F counts."""

    line: Index
    code: Index
    since: Index

    def in_force(self, line: Index) -> tuple[Index, Index]:
        here = np.searchsorted(self.line, line, "right") - 1
        return self.code[here], self.since[here]


def _modes(scan: Scan) -> _Modes:
    chosen = is_in(scan.code, (_PER_MINUTE, _PER_TURN, _INVERSE))
    line = np.concatenate(([0], scan.code_line[chosen]))
    code = np.concatenate(([_PER_MINUTE], scan.code[chosen]))
    changed = np.append(True, code[1:] != code[:-1])
    if scan.program.rs274.feed_words_end:
        changed[1:] |= code[1:] != _INVERSE
    since = np.maximum.accumulate(np.where(changed, line, 0))
    return _Modes(line, code, since)


def _unit(scan: Scan, line: Index, *, before: bool = False) -> Array:
    """mm per unit on these lines, or `before` what their own G20 and G21 say."""
    chosen = is_in(scan.code, (200, 210))
    place = np.searchsorted(scan.code_line[chosen], line, side="left" if before else "right")
    inch = np.concatenate(([False], scan.code[chosen] == 200))[place]
    return np.asarray(np.where(inch, MM_PER_INCH, 1.0), float)


def _spindle(scan: Scan, line: Index) -> Array:
    """Turns of the spindle per minute: the S word in force on these lines."""
    word, s_line = scan.of_letter(b"S")
    value = numbers(scan.words, word)
    here = np.searchsorted(s_line, line, "right")
    turns = np.concatenate(([0.0], value))[here]
    bad = ~(turns > 0)
    if bad.any():
        raise ProgramError(
            "G95 states its feed per turn of the spindle, and no S word comes before; give S or use G94",
            line=int(line[np.flatnonzero(bad)[0]]),
            code="OLP551",
        )
    surface = is_in(scan.code, (960, 970))
    if (scan.code == 960).any():
        mode = np.concatenate(([False], scan.code[surface] == 960))
        constant = mode[np.searchsorted(scan.code_line[surface], line, "right")]
        if constant.any():
            raise ProgramError(
                "G95 needs the turns of the spindle, and under G96 these depend on a radius; use G97 or G94",
                line=int(line[np.flatnonzero(constant)[0]]),
                code="OLP551",
            )
    return turns


def _refuse(missing: Mask, line: Index, inverse: Mask) -> None:
    if not missing.any():
        return
    i = int(np.flatnonzero(missing)[0])
    if inverse[i]:
        raise ProgramError(
            "in G93 each feed move needs an F word in its own block; give F", line=int(line[i]), code="OLP551"
        )
    raise ProgramError(
        "a feed move has no feed: no F word comes after the feed mode (G93, G94, G95) was set; give F",
        line=int(line[i]),
        code="OLP551",
    )


def _check_values(scan: Scan, modes: _Modes, line: Index, value: Array, pointed: Mask, unit: Array) -> None:
    """Refuse feeds that are not above zero, and those whose unit is open without a decimal point."""
    bad = ~(value > 0)
    if bad.any():
        i = int(np.flatnonzero(bad)[0])
        raise ProgramError(f"the feed F{value[i]:g} is not above zero", line=int(line[i]), code="OLP551")
    if scan.program.calculator:
        return
    # Fanuc counts whole mm/min; Haas follows its setting 77, and other units have their own increments
    mode, _ = modes.in_force(line)
    plain = (mode == _PER_MINUTE) & (unit == 1.0) & scan.program.rs274.feed_without_point
    open_ = ~pointed & ~plain & (mode != _INVERSE)
    if open_.any():
        i = int(np.flatnonzero(open_)[0])
        raise ProgramError(
            f"F{value[i]:g} has no decimal point, so its unit depends on the settings of the control; "
            'write a point, or state decimal_point = "calculator" in the machine file',
            line=int(line[i]),
            code="OLP551",
        )
