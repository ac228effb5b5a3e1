"""Arrays and texts in the encoding of the page: quantised, differenced, in byte planes, deflated, base64.

Positions are exact to half of 0.1 um and deviations to half of 1 nm everywhere on the axis, as integers are
summed, not floats.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.errors import CannotCompute

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
#: Bytes that one thread deflates at a time, without matches in earlier ones.
_CHUNK = 1 << 22
#: Level of zlib: half the time of its default, and 7 % more bytes.
_LEVEL = 5


class Arrays:
    """Named arrays for a page. `specs` states for each how and where it is stored."""

    def __init__(self) -> None:
        self.specs: dict[str, dict[str, Any]] = {}
        self._chunks: list[bytes] = []
        self._size = 0
        self._integers: dict[str, npt.NDArray[np.int64]] = {}

    def quantised(
        self, name: str, values: npt.ArrayLike, step: float, *, plus: Sequence[str] = (), keep: bool = False
    ) -> str:
        """Store (n,) or (n, c) finite values in integer steps (a power of ten), minus the values of the
        arrays `plus`. With `keep` the array can be named in a later `plus`. Returns the name.

        Raises CannotCompute where neighbours are so far apart that their difference does not fit.
        """
        rows = _rows(np.asarray(values, float))
        whole = np.rint(rows * round(1.0 / step)).astype(np.int64)
        if keep:
            self._integers[name] = whole
        for other in plus:
            whole = whole - self._integers[other]
        change = np.diff(whole, axis=0, prepend=0)
        small = change.T.astype("<i4")
        if (change != small.T).any():
            raise CannotCompute(
                f"neighbouring values of {name!r} are too far apart to be stored in steps of {step:g}"
            )
        planes = np.ascontiguousarray(small.reshape(-1).view(np.uint8).reshape(-1, 4).T)
        spec = {"enc": "qd", "q": step, "n": len(rows), "c": rows.shape[1]}
        self._put(name, spec | ({"plus": list(plus)} if plus else {}), planes.tobytes())
        return name

    def raw(self, name: str, values: npt.ArrayLike, dtype: str) -> str:
        """Store (n,) or (n, c) values unchanged."""
        rows = _rows(np.asarray(values))
        data = np.ascontiguousarray(rows, _TYPES[dtype]).tobytes()
        self._put(name, {"enc": "raw", "dtype": dtype, "n": len(rows), "c": rows.shape[1]}, data)
        return name

    def text(self, name: str, text: str) -> str:
        """Store a text of lines."""
        data = text.encode()
        self._put(name, {"enc": "text", "n": text.count("\n") + 1, "bytes": len(data)}, data)
        return name

    def patch(self, name: str, text: str, of: str, original: str, line: npt.NDArray[np.int64]) -> str:
        """Store a text as its differences from the text `original`, stored as `of`; (n,) `line` is the line
        there, counted from 0, that each of its lines resembles, -1 for none."""
        lines, others = text.split("\n"), original.split("\n")
        old = ["" if i < 0 else others[i] for i in line.tolist()]
        prefix, suffix = _in_common(lines, old)
        middle = "\n".join(
            [s[p : len(s) - q] for s, p, q in zip(lines, prefix.tolist(), suffix.tolist(), strict=True)]
        )
        spec = {
            "enc": "patch", "n": len(lines), "of": of,
            "from": self.quantised(f"{name}_from", line, 1.0),
            "prefix": self.quantised(f"{name}_prefix", prefix, 1.0),
            "suffix": self.quantised(f"{name}_suffix", suffix, 1.0),
            "middle": self.text(f"{name}_middle", middle),
        }  # fmt: skip
        self.specs[name] = spec
        return name

    def deflated(self) -> bytes:
        """All arrays as one zlib stream, deflated by several threads."""
        raw = b"".join(self._chunks)
        parts = [raw[a : a + _CHUNK] for a in range(0, len(raw), _CHUNK)] or [b""]

        def deflate(k: int) -> bytes:
            stream = zlib.compressobj(_LEVEL, zlib.DEFLATED, -zlib.MAX_WBITS)
            last = k == len(parts) - 1
            return stream.compress(parts[k]) + stream.flush(zlib.Z_FINISH if last else zlib.Z_FULL_FLUSH)

        with ThreadPoolExecutor() as threads:
            body = b"".join(threads.map(deflate, range(len(parts))))
        # RFC 1950: deflate with a window of 32 kB, no dictionary
        return b"\x78\x9c" + body + zlib.adler32(raw).to_bytes(4, "big")

    def encoded(self) -> bytes:
        """The stream in base64."""
        return base64.b64encode(self.deflated())

    def _put(self, name: str, spec: dict[str, Any], data: bytes) -> None:
        self.specs[name] = spec | {"off": self._size}
        pad = -len(data) % _ALIGN
        self._chunks.append(data + bytes(pad))
        self._size += len(data) + pad


def _rows(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """(n, c) also of (n,)."""
    return values if values.ndim == 2 else values[:, None]


def _in_common(lines: list[str], others: list[str]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """(n,) numbers of characters that pairs of lines share at the beginning, and at the end without those."""
    a, b = _Table.of(lines), _Table.of(others)
    most = np.minimum(a.length, b.length)
    prefix = np.zeros(len(lines), np.int64)
    suffix = np.zeros(len(lines), np.int64)
    for count, backwards in ((prefix, False), (suffix, True)):
        room = most - prefix
        active = np.flatnonzero(room > 0)
        k = 0
        while active.size:
            same = a.at(active, k, backwards=backwards) == b.at(active, k, backwards=backwards)
            active = active[same]
            count[active] = k = k + 1
            active = active[room[active] > k]
    return prefix, suffix


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """Lines as one array of code points; (n,) `start` and `length` of each."""

    code: npt.NDArray[np.uint8] | npt.NDArray[np.uint32]
    start: npt.NDArray[np.int64]
    length: npt.NDArray[np.int64]

    @staticmethod
    def of(lines: list[str]) -> _Table:
        joined = "".join(lines)
        if joined.isascii():
            code = np.frombuffer(joined.encode("ascii"), np.uint8)
        else:
            code = np.frombuffer(joined.encode("utf-32-le"), np.uint32)
        length = np.fromiter(map(len, lines), np.int64, len(lines))
        return _Table(code, np.cumsum(length) - length, length)

    def at(
        self, rows: npt.NDArray[np.int64], k: int, *, backwards: bool
    ) -> npt.NDArray[np.unsignedinteger[Any]]:
        """(n,) code points number k of lines, from their beginning or from their end."""
        return np.asarray(self.code[self.start[rows] + (self.length[rows] - 1 - k if backwards else k)])


def resolution(peak: float, finest: float, levels: int) -> float:
    """The power of ten that shows a range up to `peak` in at least `levels` steps: at most 1, and not below
    `finest`."""
    step = peak / levels
    if not step > finest:
        return finest
    return float(10.0 ** min(np.floor(np.log10(step)), 0.0))
