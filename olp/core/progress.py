"""How a long run reports its progress."""

from __future__ import annotations

from collections.abc import Callable

#: called with the name of the present step and the share of the whole that is done
Progress = Callable[[str, float], None]


def silent(what: str, share: float) -> None:
    """Report no progress."""


def part(tell: Progress, begin: float, end: float, name: str = "") -> Progress:
    """What a step of a run is given to report to: its shares are from `begin` to `end` of the whole, under
    its own `name` where one is given."""

    def told(what: str, share: float) -> None:
        tell(name or what, begin + share * (end - begin))

    return told
