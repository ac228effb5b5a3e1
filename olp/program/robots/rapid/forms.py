"""The moves of RAPID by the order of their arguments: plain ones, and those of processes and signals.

Letters of a layout are arguments. `c` is the via point of an arc, `t` the target, `v` the speed. `z` is the
zone, and `w` the tool. A dot stands for data of a process or a signal, which stay as they are. Source: the
reference manual of RAPID instructions, and those of Arc, Spot, Dispense, Paint and Continuous Application.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from olp.core.values import dataclass


@dataclass(frozen=True, slots=True)
class Form:
    """A move: its `layouts`, one for each number of arguments. It goes `straight`, as arcs do, or as the axes
    do. One that is `whole` has an action at its end or on its way, and is never split. One that is `stopped`
    ends before its target where something is found."""

    layouts: tuple[str, ...]
    straight: bool
    whole: bool = False
    stopped: bool = False

    @property
    def arc(self) -> bool:
        return "c" in self.layouts[0]

    def layout(self, count: int) -> str | None:
        """The layout with so many arguments, None where there is none."""
        return next((layout for layout in self.layouts if len(layout) == count), None)


def _three(
    name: str, *layouts: str, letters: str = "LJC", ends: tuple[str, ...] = ("",), whole: bool = False
) -> Iterator[tuple[bytes, Form]]:
    """Moves of a name with a letter for their path, `layouts` without the via point."""
    for letter in letters:
        own = tuple(layout.replace("t", "ct") if letter == "C" else layout for layout in layouts)
        for end in ends:
            yield (f"{name}{letter}{end}".upper().encode(), Form(own, letter != "J", whole))


#: Moves to joint values by their names in capitals.
JOINT_MOVES = frozenset((b"MOVEABSJ", b"ARCMOVEABSJ"))

#: Moves by their names in capitals.
FORMS: Mapping[bytes, Form] = {
    **dict(_three("Move", "tvzw")),
    **dict(_three("Move", "tvzw..", ends=("DO", "AO", "GO"), whole=True)),
    **dict(_three("Move", "tvzw.", ends=("Sync",), whole=True)),
    **dict(_three("Trigg", "tv.zw", whole=True)),
    b"TRIGGLIOS": Form(("tvzw", "tv.zw"), straight=True, whole=True),
    # without weaving, and with it as an argument of its own on older controls
    **dict(_three("Arc", "tv..zw", "tv...zw", letters="LC", ends=("", "1", "2"))),
    **dict(
        _three(
            "Arc", "tv..zw", "tv...zw", letters="LC",
            ends=("Start", "End", "1Start", "1End", "2Start", "2End"), whole=True,
        )
    ),
    **dict(_three("ArcMove", "tvzw")),
    **dict(_three("Disp", "tv.zw", letters="LC")),
    **dict(_three("Paint", "tvzw", "tv.zw", letters="LC")),
    **dict(_three("Cap", "tv...zw", letters="LC")),
    **dict(_three("Spot", "tv..w", letters="LJ", whole=True)),
    b"SEARCHL": Form(("..tvw",), straight=True, whole=True, stopped=True),
    b"SEARCHC": Form(("..ctvw",), straight=True, whole=True, stopped=True),
}  # fmt: skip
