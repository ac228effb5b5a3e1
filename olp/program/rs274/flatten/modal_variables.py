"""Modal variables of Macro B (#4001 to #4010, #4107 to #4120): the codes and words in force before a block.

Only what the program has stated itself is known. Groups 1 to 10 are alike on the controls that have these
variables; the numbers of further groups differ.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from olp.program.rs274.codes import CYCLES, END_OF_CYCLES, INCH, METRIC

#: The codes of each group, ten times their number.
_GROUPS = {
    1: frozenset({0, 10, 20, 30, 330}),
    2: frozenset({170, 180, 190}),
    3: frozenset({900, 910}),
    5: frozenset({930, 940, 950}),
    6: frozenset({INCH, METRIC}),
    7: frozenset({400, 410, 420}),
    8: frozenset({430, 440, 490}),
    9: CYCLES | {END_OF_CYCLES},
    10: frozenset({980, 990}),
}
_MOTION = 1
_FEED_MODE = 5
_UNITS = 6
_LENGTH = 8
_CYCLE = 9
_FIRST_GROUP = 4000
#: The letters whose word each variable has.
_WORDS = {4107: "d", 4109: "f", 4111: "h", 4119: "s", 4120: "t"}

_NAMES = {
    **{_FIRST_GROUP + group: f"the G code of group {group}" for group in _GROUPS},
    **{number: f"the {letter.upper()} word" for number, letter in _WORDS.items()},
}


class ModalVariables:
    """What the blocks that were carried out have put into force."""

    def __init__(self) -> None:
        self._codes: dict[int, float] = {}
        self._words: dict[str, float] = {}

    def follow(self, words: Sequence[tuple[str, float | None]], *, switched: bool) -> None:
        """Take the words of a block. What a block states that is `switched` by block delete is not known."""
        codes = {round(value * 10) for letter, value in words if letter == "g" and value is not None}
        stated = {group: codes & own for group, own in _GROUPS.items() if codes & own}
        for group, own in stated.items():
            self._codes[group] = max(own) / 10
        if _MOTION in stated:
            # a code of motion ends cycles
            self._codes[_CYCLE] = END_OF_CYCLES / 10
        elif _CYCLE in stated:
            # whether the motion before cycles is in force behind them differs
            self._codes.pop(_MOTION, None)
        if {_UNITS, _FEED_MODE} & stated.keys():
            self._words.pop("f", None)
        for letter, value in words:
            if letter in _WORDS.values():
                self._words.pop(letter, None)
                if value is not None:
                    self._words[letter] = value
        if switched:
            self._forget(stated, (letter for letter, _ in words))

    def _forget(self, groups: Iterable[int], letters: Iterable[str]) -> None:
        for group in (*groups, *((_CYCLE,) if _MOTION in groups else ())):
            self._codes.pop(group, None)
        for letter in letters:
            self._words.pop(letter, None)

    def value(self, index: int) -> float | None:
        """What variable `index` has; None where the program has not stated it."""
        if index in _WORDS:
            return self._words.get(_WORDS[index])
        return self._codes.get(index - _FIRST_GROUP)

    @property
    def length_on(self) -> bool:
        """Whether the program has put a tool length into force."""
        return self._codes.get(_LENGTH, 49.0) != 49.0


def meaning(index: int) -> str:
    """What a modal variable has, in words; empty for other variables."""
    return _NAMES.get(index, "")
