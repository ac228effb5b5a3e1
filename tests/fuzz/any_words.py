"""Random programs in RS-274 of any words in any block: `program(seed)`.

Most are refused by a control. They find the words that a control refuses, or takes, where nobody would look.
"""

from __future__ import annotations

import random

from fuzz.grammar import Drawn

_USUAL = (
    "0 0 0 1 1 1 2 3 4 10 17 18 19 20 21 28 30 40 43 43.1 43.2 49 52 53 54 55 59.3 61 64 73 80 81 82 83 85 "
    "86 89 90 90.1 91 91.1 92 92.1 92.2 92.3 93 94 95 98 99"
)
_RARE = (
    "5 5.1 5.2 5.3 7 8 17.1 18.1 19.1 28.1 30.1 33 33.1 38.2 38.3 38.4 38.5 41 41.1 42 42.1 50 51 56 57 58 "
    "59 59.1 59.2 61.1 74 76 84 87 88 96 97"
)
_USUAL_M = "3 3 5 6 9 61"
_RARE_M = "0 1 2 3 4 7 8 19 30 48 49 50 51 52 53 60 62 63 64 65 66 67 68 70 71 72 73 98 99 100 101"
_NUMBERS = (0, 1, 2, 3, -1, 5, 10, -2, -5, 20, 0.5)
_SPELT = ("-.5", "+3", "00", "1.", "007", ".25", "-0", "- 1", "1 0", "1e2", "--1", "", "[1+1]", "#1")
_FIRST = ("G0 X1 Y2 Z3", "G1 X-4 Y5 Z6 F100", "G81 X1 Y1 Z-1 R2", "G0 X0 Y0 Z10")
_LAST = ("G1 X3", "X4", "G0 X1 Y1 Z1", "G91 X1", "Y2", "G80", "G2 X1 Y1 R5", "G81 X5 Z-2 R1")


def program(seed: int) -> Drawn:
    """The program of a seed."""
    rng = random.Random(f"any words {seed}")
    lines = ["G21 G90 G17 G94 F300 S1000 M3"] if rng.random() < 0.9 else []
    if rng.random() < 0.9:
        lines.append(rng.choice(_FIRST))
    lines += [_line(rng) for _ in range(rng.choice((1, 2, 3, 4, 6)))]
    if rng.random() < 0.5:
        lines.append(rng.choice(_LAST))
    start = None if rng.random() < 0.4 else (12.0, -8.0, 30.0)
    return Drawn(("\n".join(lines) + "\nM2\n").encode(), rng.random() < 0.3, start)


def _line(rng: random.Random) -> str:
    words = [_word(rng) for _ in range(rng.choice((1, 1, 2, 2, 3, 3, 4, 5, 6)))]
    text = rng.choice((" ", " ", "")).join(words)
    if rng.random() < 0.03:
        text += rng.choice(("(c)", ";x", "(msg,x)", "( ", "%"))
    return "/" + text if rng.random() < 0.03 else text


def _word(rng: random.Random) -> str:
    how = rng.random()
    if how < 0.35:
        return "G" + rng.choice((_USUAL if rng.random() < 0.8 else _RARE).split())
    if how < 0.42:
        return "M" + rng.choice((_USUAL_M if rng.random() < 0.7 else _RARE_M).split())
    return rng.choice("XYZXYZXYZIJKR" if how < 0.8 else "FSTHPQLDNRKABCUVWEO") + _number(rng)


def _number(rng: random.Random) -> str:
    how = rng.random()
    if how < 0.5:
        return str(rng.choice(_NUMBERS))
    if how < 0.8:
        return f"{rng.uniform(-20, 20):.{rng.choice((0, 1, 2, 3))}f}"
    return rng.choice(_SPELT) if how < 0.85 else str(rng.randint(0, 9))
