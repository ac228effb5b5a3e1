"""What a program states about time: feeds, path modes, dwells and rests, beside the moves of its toolpath.

The words of a program that has been read are read again, for re-timing only: a correction does not need this.
Sources: NIST IR 6556 (3.5, 3.8: order of execution, G93 to G95, G61 and G64), LinuxCNC's interpreter
(tests/program/feeds/test_timing.py compares with it), and the manuals of Fanuc, Haas and Grbl for what
differs there.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Index, Mask, is_in
from olp.core.errors import ProgramError, UsageError
from olp.core.toolpath import BLEND_MM, Kind
from olp.core.values import dataclass
from olp.program.feeds.moves import Scan, numbers
from olp.program.feeds.stated import programmed
from olp.program.program import Program, Statements


class PathControl(IntEnum):
    """How a control goes from block to block."""

    BLEND = 0  #: G64: rounds corners within a path tolerance
    EXACT_PATH = 1  #: G61 of RS-274: keeps to the path, rests only at its corners
    EXACT_STOP = 2  #: G61.1, and G61 of ISO controls: rests at the end of each block


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """A path mode from its line on; `stated_mm` is the path tolerance that the program gives, None where it
    gives none."""

    line: int
    control: PathControl
    stated_mm: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Timing:
    """The time of n moves.

    (n,) `feed_mm_s`: inf for rapids, NaN where the control moves by itself or a time has no length. (n,)
    `control`: values of `PathControl`. (n,) `blend_mm`: the path tolerance of G64 where it is in force, else
    0. Before, between and after the moves: `rest` (n + 1,), whether the motion has to rest there, and
    `dwell_s` (n + 1,), for how long at least.
    """

    feed_mm_s: Array
    control: npt.NDArray[np.uint8]
    blend_mm: Array
    rest: Mask
    dwell_s: Array


def timing(program: Program, *, blend_mm: float = BLEND_MM, block_delete: bool = False) -> Timing:
    """Feeds, path modes, rests and dwells of a program that was read with its words.

    `blend_mm` is the path tolerance where G64 states none; `block_delete` as in the reading. Raises
    ProgramError with its line for a feed move without a feed, and for a feed or a dwell that cannot be read
    correctly. Raises UsageError for a tolerance that is not above zero, and where the program was read
    without words.
    """
    if not blend_mm > 0:
        raise UsageError(f"the path tolerance of G64 is {blend_mm:g} mm; expected a length above zero")
    if program.words is None:
        raise UsageError("the program was read without its words; re-timing needs them")
    path = program.toolpath
    feed = np.array(programmed(program, block_delete=block_delete))
    if program.statements is not None:
        return _of_statements(program, program.statements, feed, blend_mm)
    scan = Scan.of(program, program.words, block_delete=block_delete)
    control, blend = _path_control(program, _modes(program, scan), blend_mm)
    rest, dwell = _rests(program, scan)
    probes = np.flatnonzero(path.kind == Kind.PROBE)
    rest[probes + 1] = True
    if program.rs274.exact_stop:
        # in-position check of G0 on both sides, whatever the mode
        rapids = np.flatnonzero(path.kind == Kind.RAPID)
        rest[rapids] = rest[rapids + 1] = True
    holes = program.holes
    place = holes.first[holes.rest_hole] + holes.rest_after
    rest[place] = True
    np.add.at(dwell, place, holes.rest_s)
    for column in (feed, control, blend, rest, dwell):
        column.setflags(write=False)
    return Timing(feed, control, blend, rest, dwell)


def _of_statements(program: Program, statements: Statements, feed: Array, blend_mm: float) -> Timing:
    """Timing of statements, which state no path mode: the control blends, unless its mode at the start is
    G61.1."""
    count = len(program.toolpath)
    rest, dwell = statements.rest.copy(), statements.dwell_s.copy()
    probes = np.flatnonzero(program.toolpath.kind == Kind.PROBE)
    rest[probes + 1] = True
    stops = any(mode.name == "G61.1" for mode in program.path_modes)
    control = np.full(count, PathControl.EXACT_STOP if stops else PathControl.BLEND, np.uint8)
    blend = np.full(count, 0.0 if stops else blend_mm)
    for column in (feed, control, blend, rest, dwell):
        column.setflags(write=False)
    return Timing(feed, control, blend, rest, dwell)


def path_modes(program: Program, *, block_delete: bool = False) -> tuple[Mode, ...]:
    """The path modes of a program that was read with its words, in the order of lines. Before the first one
    the control blends, with its own tolerance. Statements state no path mode: the machine file does."""
    if program.statements is not None:
        return tuple(Mode(m.line, PathControl.EXACT_STOP) for m in program.path_modes if m.name == "G61.1")
    assert program.words is not None
    return _modes(program, Scan.of(program, program.words, block_delete=block_delete))


def _modes(program: Program, scan: Scan) -> tuple[Mode, ...]:
    modes = []
    for mode in program.path_modes:
        code = mode.name.split()[0]
        if code == "G64":
            # P0 and less is no tolerance, as LinuxCNC's trajectory planner takes it
            stated = mode.tolerance_mm if mode.tolerance_mm is not None and mode.tolerance_mm > 0 else None
            modes.append(Mode(mode.line, PathControl.BLEND, stated))
        else:
            stop = code == "G61.1" or program.rs274.exact_stop
            modes.append(Mode(mode.line, PathControl.EXACT_STOP if stop else PathControl.EXACT_PATH))
    if program.rs274.exact_stop:
        # G62 and G63 end exact stop as G64 does
        lines = scan.code_line[is_in(scan.code, (620, 630))].tolist()
        modes += [Mode(line, PathControl.BLEND) for line in lines]
    return tuple(sorted(modes, key=lambda mode: mode.line))


def _path_control(
    program: Program, modes: tuple[Mode, ...], blend_mm: float
) -> tuple[npt.NDArray[np.uint8], Array]:
    """Per move its path mode and path tolerance; a mode holds from its own block on."""
    index = np.searchsorted(np.array([m.line for m in modes], np.int64), program.toolpath.line, "right")
    control = np.array([PathControl.BLEND] + [m.control for m in modes], np.uint8)[index]
    stated = [blend_mm if m.stated_mm is None else m.stated_mm for m in modes]
    blend = np.array([blend_mm, *stated], float)[index]
    blend[control != PathControl.BLEND] = 0.0
    return control, blend


def _rests(program: Program, scan: Scan) -> tuple[Mask, Array]:
    """Where the motion rests, and how long, because of words in blocks: G4, G9, M and S."""
    line = program.toolpath.line
    rest = np.zeros(len(line) + 1, bool)
    dwell = np.zeros(len(line) + 1)
    word, m_line = scan.of_letter(b"M")
    code = np.rint(numbers(scan.words, word) * 10).astype(np.int64)
    along = is_in(code, [10 * m for m in program.rs274.m_with_motion])
    m_line, code = m_line[~along], code[~along]
    late = is_in(code, [10 * m for m in program.rs274.late_m])
    rest[np.searchsorted(line, m_line[late], "right")] = True
    rest[np.searchsorted(line, m_line[~late])] = True
    rest[np.searchsorted(line, scan.of_letter(b"S")[1])] = True
    if program.rs274.exact_stop:
        rest[np.searchsorted(line, scan.code_line[scan.code == 90], "right")] = True
    pauses = scan.code_line[scan.code == 40]
    if len(pauses):
        where = np.searchsorted(line, pauses)
        rest[where] = True
        np.add.at(dwell, where, _dwell_seconds(program, scan, pauses))
    return rest, dwell


def _dwell_seconds(program: Program, scan: Scan, pauses: Index) -> Array:
    """Seconds of each G4 block: of P, and of X or U where the control takes these too."""
    words, profile = scan.words, program.rs274
    first = words.first_word[pauses - 1].astype(np.int64)
    count = words.first_word[pauses] - first
    owner = np.repeat(np.arange(len(pauses)), count)
    word = np.repeat(first - np.cumsum(count) + count, count) + np.arange(int(count.sum()))
    time = is_in(words.letter[word], list(profile.dwell_words.encode()))
    owner, word = owner[time], word[time]
    stated = np.bincount(owner, minlength=len(pauses))
    if (stated > 1).any():
        raise ProgramError(
            "a dwell has two times in one block; expected one",
            line=int(pauses[np.flatnonzero(stated > 1)[0]]),
            code="OLP551",
        )
    if len(profile.dwell_words) == 1 and (stated == 0).any():
        letter = profile.dwell_words
        raise ProgramError(
            f"a dwell G4 has no {letter} word with its time; give {letter}",
            line=int(pauses[np.flatnonzero(stated == 0)[0]]),
            code="OLP551",
        )
    number = numbers(words, word)
    pointed = words.pointed[word]
    seconds = np.zeros(len(pauses))
    # P counts milliseconds where it has no point; X and U do where lengths count increments
    bare = ~pointed & ((words.letter[word] == ord("P")) | (not program.calculator))
    bare = words.letter[word] == ord("P") if profile.dwell_ms else bare & profile.increments_without_point
    seconds[owner] = np.where(bare, number / 1000.0, number)
    if (seconds < 0).any():
        raise ProgramError(
            "a dwell is negative; expected zero or more",
            line=int(pauses[np.flatnonzero(seconds < 0)[0]]),
            code="OLP551",
        )
    return seconds
