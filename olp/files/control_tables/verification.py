"""Small programs that show whether a table has the right sign convention.

One axis moves between the two positions where the table differs most. The comments state the reading of an
instrument.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from olp.calibration.control_tables.rows import Rows
from olp.core.values import dataclass

#: Pairs of axes that a program checks, those with the largest difference first.
_PAIRS = 3
#: In mm: a dial gauge hardly shows smaller differences.
LEAST_MM = 2e-4
#: Slow enough that the axis follows the command.
_FEED_MM_MIN = 500
#: Time to read the instrument.
_DWELL_S = 5


@dataclass(frozen=True, slots=True)
class Check:
    """Axis `moves` moves from `first_mm` to `second_mm`, both approached in +. Without a table the reading
    along `shows` then changes by `change_um` (actual minus commanded)."""

    moves: str
    shows: str
    first_mm: float
    second_mm: float
    before_mm: float
    change_um: float


def checks(rows: Sequence[Rows]) -> list[Check]:
    """The checks, the largest differences first. Both positions are approached in +, from one before them."""
    listed = []
    for one in rows:
        position, forward = one.position_mm, one.forward
        # the first position is where the axis comes from
        if len(position) < 3:
            position = np.array([position[0], 0.5 * (position[0] + position[-1]), position[-1]])
            forward = np.interp(position, one.position_mm, one.forward)
        low, high = sorted((1 + int(np.argmin(forward[1:])), 1 + int(np.argmax(forward[1:]))))
        change = float(forward[high] - forward[low]) * 1e3
        if abs(change) >= LEAST_MM * 1e3:
            positions = float(position[low]), float(position[high]), float(position[0])
            listed.append(Check(one.name[2], one.name[1], *positions, change))
    listed.sort(key=lambda check: -abs(check.change_um))
    return listed[:_PAIRS]


def _says(check: Check) -> Iterator[str]:
    shown = f"{check.shows} by {check.change_um:+.1f} um"
    yield f"{check.moves} from {check.first_mm:g} to {check.second_mm:g} mm; instrument along {check.shows}"
    yield f"table off: reading changes {shown} (actual minus commanded)"
    yield "table on, right sign: it does not change"
    yield f"table on, WRONG sign: it changes {check.shows} by {2 * check.change_um:+.1f} um"


_HEAD = (
    "shows whether the compensation table has the right sign",
    "one axis moves at a time; move the others clear of obstacles first",
    "run it with the table off, then on, laser or dial gauge between tool and table",
)


def siemens_program(listed: Sequence[Check], machine: str) -> bytes:
    """A main program for Sinumerik controls. Axis words are those of the geometry axes."""
    lines = [f"; verification of tables of {machine}", *(f"; {text}" for text in _HEAD)]
    lines.append("G90 G71 G94 G40 D0")
    for check in listed:
        lines += [f"; {text}" for text in _says(check)]
        lines.append("M0")
        for position in (check.before_mm, check.first_mm):
            lines.append(f"SUPA G1 {check.moves}{position:.4f} F{_FEED_MM_MIN}")
        lines += [f"G4 F{_DWELL_S} ; read", f"SUPA G1 {check.moves}{check.second_mm:.4f} F{_FEED_MM_MIN}"]
        lines += [f"G4 F{_DWELL_S} ; read"]
    return ("\n".join([*lines, "M30"]) + "\n").encode("ascii", "replace")


def heidenhain_program(listed: Sequence[Check], names: Mapping[str, str], name: str) -> bytes:
    """A plain-language program. M91 moves to positions of the machine."""
    dwell = ["CYCL DEF 9.0 DWELL TIME", f"CYCL DEF 9.1 DWELL {_DWELL_S}"]
    body = [f"; {text}" for text in _HEAD]
    for check in listed:
        body += [*(f"; {text}" for text in _says(check)), "STOP"]
        moves = [
            f"L {names[check.moves]}{position:+.4f} R0 F{_FEED_MM_MIN} M91"
            for position in (check.before_mm, check.first_mm, check.second_mm)
        ]
        body += [moves[0], moves[1], *dwell, moves[2], *dwell]
    lines = [f"BEGIN PGM {name.upper()} MM", *body, f"END PGM {name.upper()} MM"]
    return "".join(f"{number} {line}\n" for number, line in enumerate(lines)).encode("ascii", "replace")
