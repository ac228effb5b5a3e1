"""Levels of holes that blocks call: a cycle that is defined or called before its holes is written again where
one of them needs other levels."""

from __future__ import annotations

from olp.compensation.tally import Tally
from olp.program.program import Program
from olp.program.text.edits import BARE, EditList

#: Program units; a surface that is off by less is the same.
_SAME = 1e-9


class Surfaces:
    """The surface of the cycle that is defined last, band by band."""

    def __init__(self) -> None:
        #: where the text of the definition begins, and the surface as written
        self._in_force = (-1, 0.0)

    def lift(
        self, program: Program, stroke: int, line: int, away: float, decimals: int, made: EditList,
        tally: Tally,
    ) -> float:  # fmt: skip
        """How much higher than the program says a hole is that has to be `away` higher, in program units;
        defines its cycle again before its line where that changes."""
        assert program.statements is not None and program.statements.definitions is not None
        definitions = program.statements.definitions
        begin, end = definitions.text[stroke].tolist()
        surface = float(definitions.surface[stroke])
        if begin < 0:
            return 0.0
        if self._in_force[0] != begin:
            self._in_force = (begin, surface)
        wanted = surface
        if abs(away) > _SAME:
            wanted = round((surface + away) * 10**decimals) / 10**decimals
        if wanted != self._in_force[1]:
            self._in_force = (begin, wanted)
            data, place = program.data, int(program.line_start[line - 1])
            number, stop = definitions.number[stroke].tolist()
            made.add(place, place, round(wanted * 10**decimals), decimals, data[begin:number], 1)
            made.add(place, place, BARE, 0, data[stop:end] + program.eol(line), 2)
            tally.inserted_blocks += 1
        return wanted - surface


class CalledLevels:
    """The levels of the call in force, band by band."""

    def __init__(self) -> None:
        #: where the text of the call begins, and how much higher than in the program its levels are
        self._in_force = (-1, 0.0, 0.0)

    def lift(
        self, program: Program, hole: int, line: int, raised: tuple[float, float], decimals: int,
        made: EditList, tally: Tally,
    ) -> None:  # fmt: skip
        """Write the call of a hole before its line with other levels, where these change. `raised`, in
        program units: how much higher than the program says the tool goes back, and the hole is."""
        called = program.called
        begin = int(called.text[hole, 0])
        if raised == (self._in_force[1:] if self._in_force[0] == begin else (0.0, 0.0)):
            return
        back, down = raised
        both = zip(called.numbers[hole].tolist(), (back, down, down), strict=True)
        levels = [(a, b, high) for (a, b), high in both if a >= 0]
        if called.alone[hole]:
            for a, b, high in levels:
                _put(made, program.data[a:b], high, decimals, (a, b), b"", 0)
            tally.changed_words += len(levels)
            return
        self._in_force = (begin, back, down)
        data, place = program.data, int(program.line_start[line - 1])
        end, order = int(called.text[hole, 1]), 1
        for a, b, high in levels:
            _put(made, data[a:b], high, decimals, (place, place), data[begin:a], order)
            begin, order = b, order + 1
        made.add(place, place, BARE, 0, data[begin:end] + program.eol(line), order)
        tally.inserted_blocks += 1


def _put(
    made: EditList, text: bytes, lift: float, decimals: int, span: tuple[int, int], prefix: bytes, order: int
) -> None:
    """Put a number that is higher by `lift` than the one in a text."""
    given = text.replace(b" ", b"").replace(b"\t", b"")
    own = max(decimals, len(given.partition(b".")[2]))
    made.add(*span, round((float(given) + lift) * 10**own), own, prefix, order)
