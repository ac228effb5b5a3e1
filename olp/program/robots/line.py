"""A line of a robot program that says something."""

from __future__ import annotations

from olp.core.values import dataclass


@dataclass(frozen=True, slots=True)
class Line:
    """Its number, its first byte that is not blank, and its `text`, without blanks and comments around it."""

    line: int
    begin: int
    text: bytes

    @property
    def end(self) -> int:
        return self.begin + len(self.text)
