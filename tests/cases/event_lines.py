"""Programs of one kind of line, as long as wanted: what the benchmark times and the budgets count.

Same arguments, same text. They fit LinuxCNC and a machine with at least 600 x 600 x 30 mm below Z = 60 mm,
tools 1 and 2, and work offsets G54 and G55.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from itertools import islice

HEAD = ("G21 G17 G90 G94 G40 G49 G80", "G54", "T1 M6", "G43 H1", "S12000 M3", "G0 X300 Y300 Z30", "G1 F1500")
END = ("G90", "G0 X300 Y300 Z30", "M30")


def program(kind: str, lines: int, seed: int = 1) -> str:
    """A program with so many lines of a kind of `KINDS`."""
    rng = random.Random(f"{kind} {seed}")
    return "\n".join((*HEAD, *islice(KINDS[kind](rng), lines), *END, ""))


def _point(rng: random.Random) -> str:
    """One near the middle, so that no error bends the line to it."""
    return f"X{rng.uniform(299, 301):.3f} Y{rng.uniform(299, 301):.3f} Z{rng.uniform(29, 30):.3f}"


def _far(rng: random.Random) -> str:
    return f"X{rng.uniform(0, 600):.3f} Y{rng.uniform(0, 600):.3f} Z{rng.uniform(0, 30):.3f}"


def _step(rng: random.Random) -> str:
    return f"{rng.choice('XYZ')}{rng.uniform(-0.1, 0.1):.3f}"


def _deleted(rng: random.Random) -> Iterator[str]:
    """All lines under `/`."""
    while True:
        yield f"/{_point(rng)}"


def _some_deleted(rng: random.Random) -> Iterator[str]:
    """Every second line under `/`, and no block relies on it."""
    while True:
        yield f"/{_point(rng)}"
        yield _point(rng)


def _switches(rng: random.Random) -> Iterator[str]:
    """Single steps in G91."""
    while True:
        yield f"G91 {_step(rng)}"
        yield f"G90 {_point(rng)}"


def _tools(rng: random.Random) -> Iterator[str]:
    while True:
        tool = rng.choice((1, 2))
        yield f"T{tool} M6"
        yield f"G43 H{tool}"
        yield f"G0 {_point(rng)}"
        yield f"G1 {_point(rng)}"


def _lengths(rng: random.Random) -> Iterator[str]:
    while True:
        yield f"G43 H{rng.choice((1, 2))}"
        yield _point(rng)


def _offsets(rng: random.Random) -> Iterator[str]:
    while True:
        yield rng.choice(("G54", "G55"))
        yield _point(rng)


def _shifts(rng: random.Random) -> Iterator[str]:
    """Shifts that store the present position, and end again."""
    while True:
        yield f"G92 X{rng.uniform(299, 301):.3f}"
        yield f"Y{rng.uniform(299, 301):.3f}"
        yield "G92.1"
        yield _point(rng)


def _written_offsets(rng: random.Random) -> Iterator[str]:
    while True:
        yield f"G10 L2 P2 X{rng.randint(0, 5)}"
        yield _point(rng)


def _homes(rng: random.Random) -> Iterator[str]:
    while True:
        yield "G28 Z30"
        yield f"G0 {_point(rng)}"


def _units(rng: random.Random) -> Iterator[str]:
    while True:
        yield "G20"
        yield f"X{rng.uniform(11.78, 11.84):.4f}"
        yield "G21"
        yield _point(rng)


def _dwells(rng: random.Random) -> Iterator[str]:
    while True:
        yield "G4 P0.1"
        yield _point(rng)


def _path_modes(rng: random.Random) -> Iterator[str]:
    while True:
        yield f"G64 P0.0{rng.randint(1, 9)}"
        yield _point(rng)


def _machine_positions(rng: random.Random) -> Iterator[str]:
    while True:
        yield f"G53 G0 {_point(rng)}"
        yield f"G1 {_point(rng)}"


def _series(rng: random.Random) -> Iterator[str]:
    """Short series of holes."""
    while True:
        x, y = (f"{rng.uniform(299, 301):.3f}" for _ in range(2))
        yield f"G99 G8{rng.choice('15')} X{x} Y{y} Z20 R29"
        yield f"X{rng.uniform(299, 301):.3f}"
        yield "G80"
        yield f"G0 {_point(rng)}"


def _mixed(rng: random.Random) -> Iterator[str]:
    """One event of a kind that shops mix, then a few moves."""
    while True:
        event = rng.randrange(6)
        if event == 0:
            yield f"G91 {_step(rng)}"
            yield "G90"
        elif event == 1:
            tool = rng.choice((1, 2))
            yield f"T{tool} M6"
            yield f"G43 H{tool}"
        elif event == 2:
            yield rng.choice(("G54", "G55"))
        elif event == 3:
            yield f"G4 P0.{rng.randint(1, 9)}"
        elif event == 4:
            yield f"G92 X{rng.uniform(299, 301):.3f}"
            yield "G92.1"
        else:
            yield f"G64 P0.0{rng.randint(1, 9)}"
        yield f"G0 {_point(rng)}"
        yield f"G1 {_point(rng)}"


def _long(rng: random.Random) -> Iterator[str]:
    """Lines that the error bends, so that they are divided."""
    while True:
        yield _far(rng)


KINDS: dict[str, Callable[[random.Random], Iterator[str]]] = {
    "deleted": _deleted,
    "some deleted": _some_deleted,
    "switches": _switches,
    "tools": _tools,
    "lengths": _lengths,
    "offsets": _offsets,
    "shifts": _shifts,
    "written offsets": _written_offsets,
    "homes": _homes,
    "units": _units,
    "dwells": _dwells,
    "path modes": _path_modes,
    "machine positions": _machine_positions,
    "series": _series,
    "mixed": _mixed,
    "long": _long,
}
