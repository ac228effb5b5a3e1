"""How a long run reports its progress."""

from __future__ import annotations

from collections.abc import Callable

#: called with the name of the present step and the share of the whole that is done
Progress = Callable[[str, float], None]


def silent(what: str, share: float) -> None:
    """Report no progress."""
