"""Arrays and texts in the encoding of the page: whole numbers and templates, deflated, base64.

Positions are exact to half of 0.1 um and deviations to half of 1 nm everywhere on the axis, as integers are
summed, not floats.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.review.integers import Coded, small
from olp.review.knots import Curve, knots, lengths, straight
from olp.review.lines import FIRST_STYLE, NM_PER_MM, Lines, Positions
from olp.review.tokens import MARK, Small

#: Step of stored positions in mm.
POSITION_MM = 1e-4
#: Step of stored deviations in mm.
DEVIATION_MM = 1e-6
#: Step of stored times in s.
TIME_S = 1e-6
#: Step of stored arc lengths and of axis positions over time in mm.
ARC_MM = 1e-3

#: Bytes to which each array is aligned.
_ALIGN = 8
#: Types of arrays that are stored as they are.
_TYPES = {"f4": "<f4", "u4": "<u4", "u1": "u1"}
#: Steps within which values are straight between two knots over the length of a path.
_NEAR = 20
#: Level of zlib: bytes of differences gain little from more.
_LEVEL = 6
#: Parts that wait to be deflated at most: more of them would only take memory.
_WAITING = 8


class Arrays:
    """Named arrays for a page, deflated as they come. `specs` states for each how and where it is stored."""

    def __init__(self) -> None:
        self.specs: dict[str, dict[str, Any]] = {}
        self._size = 0
        self._sum = 1
        self._parts: list[Future[bytes]] = []
        self._threads = ThreadPoolExecutor()
        self._kept: dict[str, tuple[npt.NDArray[Any], float]] = {}

    def quantised(
        self, name: str, values: npt.ArrayLike, step: float, *, less: Array | None = None,
        plus: Sequence[str] = (), keep: bool = False,
    ) -> str:  # fmt: skip
        """Store (n,) or (n, c) finite values less (c,) or (n, c) others in integer steps (a power of ten),
        minus the values of the arrays `plus`. With `keep` a later array can name it, and it can predict a
        text. Returns the name.

        Raises CannotCompute for values of 2^48 steps or more.
        """
        rows = _rows(np.asarray(values))
        spec: dict[str, Any] = {"enc": "qd", "q": step, "n": len(rows), "c": rows.shape[1]}
        columns: list[Coded] = []
        kept: list[npt.NDArray[Any]] = []
        for j in range(rows.shape[1]):
            # a column at a time: no difference of all is made
            column = rows[:, j].astype(float)
            if less is not None:
                column -= less[..., j]
            column *= round(1.0 / step)
            whole = np.rint(column, out=column).astype(np.int64)
            if keep:
                kept.append(small(whole))
            for other in plus:
                whole = whole - self._kept[other][0][:, j]
            columns.append(Coded.of(name, whole))
        if keep:
            self._kept[name] = np.stack(kept, axis=1), step
        spec |= {
            "order": [column.order for column in columns],
            "width": [len(column.planes) for column in columns],
            "wide": any(column.wide for column in columns),
        } | ({"plus": list(plus)} if plus else {})
        self._put(name, spec, [plane for column in columns for plane in column.planes])
        return name

    def bent(self, name: str, curve: Curve) -> str:
        """Store a curve by its knots in steps."""
        self.specs[name] = {
            "enc": "bent", "n": curve.count, "at": self.quantised(f"{name}_at", curve.at, 1.0),
            "knots": self.quantised(f"{name}_knots", curve.knot, curve.step),
        }  # fmt: skip
        return name

    def along(self, name: str, values: npt.ArrayLike, step: float, path: str) -> str:
        """As `quantised`, for (n,) values that are almost straight over the length of the kept array `path`
        (n, 3): their differences from what is straight between knots."""
        whole = np.rint(np.asarray(values, float) * round(1.0 / step))
        length = lengths(self._kept[path][0])
        at = knots(len(whole), lambda rows: (whole[rows], whole[rows], length[rows]), _NEAR)
        rest = whole - np.floor(straight(whole[at], at, length) + 0.5)
        self.specs[name] = {
            "enc": "along", "n": len(whole), "q": step, "path": path,
            "at": self.quantised(f"{name}_at", at, 1.0),
            "knots": self.quantised(f"{name}_knots", whole[at], 1.0),
            "rest": self.quantised(f"{name}_rest", rest, 1.0),
        }  # fmt: skip
        return name

    def forget(self, name: str) -> None:
        """A kept array that no other will name."""
        del self._kept[name]

    def raw(self, name: str, values: npt.ArrayLike, dtype: str) -> str:
        """Store (n,) or (n, c) values unchanged."""
        rows = _rows(np.asarray(values))
        data = np.ascontiguousarray(rows, _TYPES[dtype]).tobytes()
        self._put(name, {"enc": "raw", "dtype": dtype, "n": len(rows), "c": rows.shape[1]}, [data])
        return name

    def text(self, name: str, text: str) -> str:
        """Store a text of lines."""
        data = text.encode()
        self._put(name, {"enc": "text", "n": text.count("\n") + 1, "bytes": len(data)}, [data])
        return name

    def lines(self, name: str, text: str, of: Sequence[str] = (), at: Small | None = None) -> str:
        """Store a text of lines by their templates and numbers. The sum of the arrays `of`, (s, 3) mm, at the
        samples `at` of its n lines predicts them."""
        predicted = None
        if at is not None:
            terms = tuple((whole, round(step * NM_PER_MM)) for whole, step in map(self._kept.__getitem__, of))
            predicted = Positions(terms, at)
        lines = Lines.of(text, predicted)
        columns = [
            {"decimals": decimals, "axis": None} if guess is None else {"decimals": decimals, **asdict(guess)}
            for decimals, guess in zip(lines.decimals, lines.predictions, strict=True)
        ]
        self.specs[name] = {
            "enc": "lines", "n": len(lines.template), "styles": [style.spec() for style in lines.styles],
            "columns": columns, "of": list(of), "mark": MARK.decode(), "first": FIRST_STYLE,
            "templates": self.text(f"{name}_templates", "\n".join(lines.templates)),
            "template": self.quantised(f"{name}_template", lines.template, 1.0),
            "rest": self.quantised(f"{name}_rest", lines.rest, 1.0),
            "at": None if at is None else self.quantised(f"{name}_at", at, 1.0),
        }  # fmt: skip
        return name

    def deflated(self) -> bytes:
        """All arrays as one zlib stream."""
        stream = zlib.compressobj(_LEVEL, zlib.DEFLATED, -zlib.MAX_WBITS)
        body = b"".join(part.result() for part in self._parts)
        # RFC 1950: deflate with a window of 32 kB, no dictionary
        return b"\x78\x9c" + body + stream.flush() + self._sum.to_bytes(4, "big")

    def encoded(self) -> bytes:
        """The stream in base64."""
        return base64.b64encode(self.deflated())

    def _put(self, name: str, spec: dict[str, Any], parts: Sequence[bytes]) -> None:
        self.specs[name] = spec | {"off": self._size}
        size = sum(map(len, parts))
        for part in (*parts, bytes(-size % _ALIGN)):
            if part:
                self._sum = zlib.adler32(part, self._sum)
                if len(self._parts) >= _WAITING:
                    self._parts[-_WAITING].result()
                self._parts.append(self._threads.submit(_deflated, part))
        self._size += size + -size % _ALIGN


def _deflated(data: bytes) -> bytes:
    """A part of a stream, without matches in others, that another can follow."""
    stream = zlib.compressobj(_LEVEL, zlib.DEFLATED, -zlib.MAX_WBITS)
    return stream.compress(data) + stream.flush(zlib.Z_FULL_FLUSH)


def _rows(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """(n, c) also of (n,)."""
    return values if values.ndim == 2 else values[:, None]


def resolution(peak: float, finest: float, levels: int) -> float:
    """The power of ten that shows a range up to `peak` in at least `levels` steps: at most 1, and not below
    `finest`."""
    step = peak / levels
    if not step > finest:
        return finest
    return float(10.0 ** min(np.floor(np.log10(step)), 0.0))
