"""What a writing changed."""

from __future__ import annotations

from olp.core.values import dataclass


@dataclass(slots=True)
class Tally:
    """Counts of what was changed."""

    changed_words: int = 0
    inserted_words: int = 0
    inserted_blocks: int = 0
