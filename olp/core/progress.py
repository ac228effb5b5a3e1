"""How a long run tells how far it is."""

from __future__ import annotations

from collections.abc import Callable

#: called with what is being done and the share of the whole that is
Progress = Callable[[str, float], None]


def silent(what: str, share: float) -> None:
    """The progress of a run that nobody watches."""
