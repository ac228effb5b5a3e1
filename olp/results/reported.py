"""Reported points as read from a file: values, their positions in the text, and what else the file states."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from typing import Any, overload

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array, Mask
from olp.core.values import dataclass
from olp.program.text.columns import Columns
from olp.program.text.numbers import Spans

Small = npt.NDArray[np.int32]

#: Points that are worked on at once, to limit memory.
BAND = 1 << 14


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
class Names(Sequence[str]):
    """The names of n points in little memory: one `text`, and where each of them ends in it (n,)."""

    text: str
    end: npt.NDArray[np.int32]

    @staticmethod
    def of(names: Sequence[str]) -> Names:
        lengths = np.fromiter(map(len, names), np.int64, len(names))
        return Names("".join(names), np.cumsum(lengths).astype(np.int32))

    @staticmethod
    def joined(parts: Sequence[Names]) -> Names:
        """All names, those of one part behind those of another."""
        begin = np.cumsum([0, *(len(part.text) for part in parts)]).tolist()
        ends = [part.end + np.int32(first) for part, first in zip(parts, begin, strict=False)]
        return Names("".join(part.text for part in parts), np.concatenate(ends))

    def __len__(self) -> int:
        return len(self.end)

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[str]: ...
    def __getitem__(self, index: int | slice) -> str | Sequence[str]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        k = range(len(self))[index]
        return self.text[int(self.end[k - 1]) if k else 0 : int(self.end[k])]

    def __iter__(self) -> Iterator[str]:
        begin = 0
        for end in self.end.tolist():
            yield self.text[begin:end]
            begin = end


@dataclass(frozen=True, slots=True, eq=False)
class Reported:
    """(n, 3) `value` of points as written, in the frame `frames[frame]` of each; `normal` (n, 3) out of the
    surface, NaN where not stated.

    `start`, `end` (n, 3) are the positions of the numbers in `data`, and `unit_mm` (n,) mm per unit. `tool`
    (n,) indexes `tools`, labels or numbers of styli (None: the one of the job). `stylus_mm` (n, 3) is gauge
    point to tip where a row states it. `approach_mm` (n,) is the distance of the approach before a touch, NaN
    where not known. `axes_at_ram`: axis positions count at the end of the ram. `comment` are the marks of a
    comment, None where the form has none. `unchanged` are statements that stay unchanged. `assumed` says in
    words what was detected from the file.
    """

    data: bytes
    dialect: str
    line: Small
    start: Spans
    end: Spans
    value: Array
    unit_mm: Array
    normal: Array
    frame: Small
    frames: tuple[str | None, ...]
    tool: Small
    tools: tuple[str | int | None, ...]
    stylus_mm: Array
    approach_mm: Array
    names: Names
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
    def value_mm(self) -> Array:
        """(n, 3) the values in mm."""
        return np.asarray(self.value * self.unit_mm[:, None], float)

    @property
    def own_stylus(self) -> Mask:
        """(n,) points whose row states a stylus vector."""
        return np.asarray(np.isfinite(self.stylus_mm).all(axis=1))

    def bands(self) -> Iterator[slice]:
        """Rows in bands, in order."""
        return (slice(a, min(a + BAND, len(self))) for a in range(0, len(self), BAND))

    def part(self, rows: slice) -> Reported:
        """The points of some rows. Their names stay those of all."""
        columns = ("line", "start", "end", "value", "unit_mm", "normal", "frame", "tool", "stylus_mm")
        views = {name: getattr(self, name)[rows] for name in (*columns, "approach_mm")}
        return replace(self, **views)


class PointColumns:
    """Columns of the points of a text, which are read in parts."""

    def __init__(self) -> None:
        self._columns = Columns()
        self._names: list[Names] = []
        self.count = 0

    def put(self, names: Names, **columns: npt.NDArray[Any]) -> None:
        """More points, with columns of the same names in each part."""
        for name, values in columns.items():
            self._columns.put(name, values, values.dtype)
        self._names.append(names)
        self.count += len(names)

    def take(self, name: str) -> npt.NDArray[Any]:
        """A column of all points."""
        return self._columns.take(name, float)

    def names(self) -> Names:
        return Names.joined(self._names)


def index_type(size: int) -> type[np.signedinteger[Any]]:
    """The smallest type of whole numbers that lead into a text of `size` bytes."""
    return np.int32 if size < 2**31 else np.int64


def missing(count: int, width: int) -> Array:
    """(count, width) NaN, in the memory of one."""
    return np.broadcast_to(np.nan, (count, width))
