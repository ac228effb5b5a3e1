"""What a program asks of the control beside motion: tool changes, spindle starts and other M codes.

They are found in words of blocks, and where the dialect finds them (`Dialect.asks`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from heapq import merge

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.machine import ControlTimes
from olp.core.values import dataclass
from olp.program.asked import Asked, by_codes
from olp.program.feeds.moves import Scan, deleted_lines, numbers
from olp.program.program import Program
from olp.program.rs274.codes import M_AFTER_EXACT, M_ENDS

TOOL_CHANGE = "tool change"
SPINDLE_START = "spindle start"
#: G4, whose S is no speed, as ten times its number
_DWELL = 40


@dataclass(frozen=True, slots=True, eq=False)
class Actions:
    """In order of lines: (k,) `line`, `late` (after the motion of its line), and the `name`: "tool change",
    "spindle start", or that of an M code such as "M8"."""

    line: Index
    late: Mask
    name: tuple[str, ...]

    def seconds(self, times: ControlTimes) -> Array:
        """(k,) the time of each, NaN where it is not stated."""
        own = {TOOL_CHANGE: times.tool_change_s, SPINDLE_START: times.spindle_start_s} | {
            f"M{code}": seconds for code, seconds in times.m_codes_s.items()
        }
        stated = (own.get(name) for name in self.name)
        return np.array([np.nan if seconds is None else seconds for seconds in stated], float)

    def waits(self, line: Index, times: ControlTimes) -> Array:
        """(n + 1,) seconds before, between and after moves on lines (n,) that they take, as far as stated."""
        seconds = np.nan_to_num(self.seconds(times))
        after = np.searchsorted(line, self.line, "right")
        place = np.where(self.late, after, np.searchsorted(line, self.line))
        return np.asarray(np.bincount(place, seconds, len(line) + 1), float)

    def rows(self, times: ControlTimes) -> list[dict[str, float | int | str | None]]:
        """What there is, how often, and the seconds of all; None where they are not stated."""
        names, which = np.unique(np.array(self.name, str), return_inverse=True)
        seconds = self.seconds(times)
        rows = []
        for i, name in enumerate(names.tolist()):
            own = seconds[which == i]
            total = None if np.isnan(own).any() else float(own.sum())
            rows.append({"what": name, "count": len(own), "seconds": total})
        return sorted(rows, key=lambda row: (str(row["what"]).startswith("M"), str(row["what"])))


def actions(program: Program, *, block_delete: bool = False) -> Actions | None:
    """The actions of a program that was read with its words, None where its language has none that are
    read."""
    asks = program.dialect.asks
    late = M_ENDS | M_AFTER_EXACT
    if program.statements is None:
        assert program.words is not None
        late = program.rs274.late_m
        out = set(deleted_lines(program).tolist()) if block_delete else set()
        more = () if asks is None else (one for one in asks(program) if one.line not in out)
        of_words = _of_words(Scan.of(program, program.words, block_delete=block_delete))
        asked: Iterable[Asked] = merge(more, of_words, key=lambda one: one.line)
    elif asks is None:
        return None
    else:
        asked = asks(program)
    return _actions((one for one in asked if one.line <= program.end_line), late)


def _actions(asked: Iterable[Asked], late: frozenset[int]) -> Actions:
    rows: list[tuple[int, bool, str]] = []
    turn, speed, running = 0, 0.0, (0, 0.0)
    for one in asked:
        if one.change:
            rows.append((one.line, False, TOOL_CHANGE))
            turn, running = 0, (0, 0.0)
        speed = speed if one.speed is None else one.speed
        turn = turn if one.turn is None else one.turn
        if turn and (turn, speed) != running:
            rows.append((one.line, False, SPINDLE_START))
        running = (turn, speed) if turn else (0, 0.0)
        rows += [(one.line, code in late, f"M{code}") for code in one.codes]
    line, after, name = zip(*rows, strict=True) if rows else ((), (), ())
    return Actions(np.array(line, np.int64), np.array(after, bool), tuple(name))


def _of_words(scan: Scan) -> Iterator[Asked]:
    word, line = scan.of_letter(b"M")
    code = np.rint(numbers(scan.words, word)).astype(np.int64)
    s_word, s_line = scan.of_letter(b"S")
    dwells = set(scan.code_line[scan.code == _DWELL].tolist())
    by_line: dict[int, list[int]] = {}
    for at, number in zip(line.tolist(), code.tolist(), strict=True):
        by_line.setdefault(at, []).append(number)
    speeds = {
        at: value
        for at, value in zip(s_line.tolist(), numbers(scan.words, s_word).tolist(), strict=True)
        if at not in dwells
    }
    for at in sorted(by_line.keys() | speeds.keys()):
        yield by_codes(at, by_line.get(at, []), speeds.get(at))
