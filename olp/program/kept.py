"""A corrected program that keeps its loops and subprograms: what the `keeper` of a dialect gives."""

from __future__ import annotations

from olp.core.values import dataclass
from olp.program.origin import Unrolled


@dataclass(frozen=True, slots=True)
class Difference:
    """A line, as the origin counts it, that cannot be kept, and why."""

    line: int
    why: str


@dataclass(frozen=True, slots=True, eq=False)
class Kept:
    """The corrected program with its flow, None where some lines cannot be kept; these are `differences`.
    `changed` are the lines that were changed, `repeated` those of them that run more than once.

    `apart` is the program with the `calls` in some of its lines written out, where that may help: those whose
    passes differ, or all whose passes have the same numbers where none differs."""

    text: bytes | None
    differences: tuple[Difference, ...]
    changed: tuple[int, ...]
    repeated: tuple[int, ...]
    apart: Unrolled | None = None
    calls: tuple[int, ...] = ()
