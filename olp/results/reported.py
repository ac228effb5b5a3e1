"""Reported points as read from a file: values, their positions in the text, and what else the file states."""

from __future__ import annotations

from dataclasses import dataclass, field

from olp.core.arrays import Array, Index
from olp.program.text.numbers import Number


@dataclass(frozen=True, slots=True)
class Unchanged:
    """A statement whose values are not changed, and why."""

    line: int
    name: str
    reason: str


@dataclass(frozen=True, slots=True)
class Stated:
    """What a file says of compensation that was active: `what` is "geometry" or "temperature"."""

    line: int
    what: str
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Reported:
    """(n, 3) `value_mm` of points as reported, in the frame `frames[frame]` of each; `normal` (n, 3) out of
    the surface, NaN where not stated.

    `start`, `end` (n, 3) are the positions of the numbers in `data`, `form` the numbers as written, `unit_mm`
    (n,) mm per unit. `tool` (n,) indexes `tools`, labels or numbers of styli (None: the one of the job).
    `stylus_mm` (n, 3) is gauge point to tip where a row states it. `approach_mm` (n,) is the distance of the
    approach before a touch, NaN where not known. `axes_at_ram`: axis positions count at the end of the ram.
    `comment` are the marks of a comment, None where the form has none. `unchanged` are statements that stay
    unchanged. `assumed` says in words what was detected from the file.
    """

    data: bytes
    dialect: str
    line: Index
    start: Index
    end: Index
    form: tuple[tuple[Number, Number, Number], ...]
    value_mm: Array
    unit_mm: Array
    normal: Array
    frame: Index
    frames: tuple[str | None, ...]
    tool: Index
    tools: tuple[str | int | None, ...]
    stylus_mm: Array
    approach_mm: Array
    names: tuple[str, ...]
    decimal: bytes = b"."
    comment: tuple[bytes, bytes] | None = (b"# ", b"")
    point: str | None = None
    axes_at_ram: bool = False
    tip_radius_mm: float | None = None
    unchanged: tuple[Unchanged, ...] = ()
    stated: tuple[Stated, ...] = ()
    assumed: tuple[str, ...] = field(default=())

    def __len__(self) -> int:
        return len(self.line)

    @property
    def digit_mm(self) -> float:
        """The coarsest last digit of any number."""
        return max(
            (n.digit * float(u) for row, u in zip(self.form, self.unit_mm, strict=True) for n in row),
            default=0.0,
        )
