"""A reader of review pages of its own: it shares no code with the packer, nor with the page."""

from __future__ import annotations

import base64
import json
import math
import zlib
from bisect import bisect_right
from decimal import Decimal
from html.parser import HTMLParser
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

_TYPES = {"f4": np.float32, "u4": np.uint32, "u1": np.uint8}


class _Scripts(HTMLParser):
    """What is in script elements and what is outside, as a browser takes it."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.by_id: dict[str, str] = {}
        self.code: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self._inside: dict[str, str | None] | None = None
        self._parts: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag == "script":
            self._inside, self._parts = dict(attrs), []

    def handle_endtag(self, tag: str) -> None:
        if tag == "script" and self._inside is not None:
            text = "".join(self._parts)
            if self._inside.get("id"):
                self.by_id[str(self._inside["id"])] = text
            else:
                self.code.append(text)
            self._inside = None

    def handle_data(self, data: str) -> None:
        if self._inside is None:
            self.text += data
        else:
            self._parts.append(data)


class Page:
    """A page taken apart: `manifest`, `scripts` that run, `tags`, and arrays by name."""

    def __init__(self, data: bytes) -> None:
        parser = _Scripts()
        parser.feed(data.decode("utf-8"))
        parser.close()
        self.tags, self.scripts, self.text = parser.tags, parser.code, parser.text
        self.manifest_text = parser.by_id["olp-manifest"]
        self.manifest: dict[str, Any] = json.loads(self.manifest_text)
        self._raw = zlib.decompress(base64.b64decode(parser.by_id["olp-data"], validate=True))

    def array(self, name: str) -> Any:
        """Rows (n, c), or (n,) of one column, of an array; lines of a text."""
        return decoded(self.manifest["arrays"], self._raw, name)

    def layer(self, name: str) -> dict[str, Any]:
        return next(layer for layer in self.manifest["layers"] if layer["name"] == name)


def decoded(specs: dict[str, Any], raw: bytes, name: str) -> Any:
    """One array of a deflated block, as its entry says."""
    spec = specs[name]
    if spec["enc"] == "lines":
        return _filled_in(specs, raw, spec)
    if spec["enc"] == "bent":
        at, knots = (decoded(specs, raw, spec[key]) for key in ("at", "knots"))
        return np.interp(np.arange(spec["n"]), at, knots) if spec["n"] else np.zeros(0)
    if spec["enc"] == "along":
        return np.array(_along(specs, raw, spec)) / round(1 / spec["q"])
    if spec["enc"] == "text":
        lines = raw[spec["off"] : spec["off"] + spec["bytes"]].decode().split("\n")
        assert len(lines) == spec["n"]
        return lines
    n, c, offset = spec["n"], spec["c"], spec["off"]
    assert offset % 8 == 0
    if spec["enc"] == "raw":
        size = np.dtype(_TYPES[spec["dtype"]]).itemsize
        column = np.frombuffer(raw[offset : offset + n * c * size], _TYPES[spec["dtype"]]).reshape(n, c)
    else:
        whole = np.array(integers(specs, raw, spec), dtype=object).reshape(c, n).T
        column = np.array(whole / round(1 / spec["q"]), float).reshape(n, c)
    return column[:, 0] if c == 1 else column


def _along(specs: dict[str, Any], raw: bytes, spec: dict[str, Any]) -> list[float]:
    """Whole steps by knots over the length of a path, row by row."""
    at, knots, rest = (integers(specs, raw, specs[spec[key]]) for key in ("at", "knots", "rest"))
    n, place = spec["n"], integers(specs, raw, specs[spec["path"]])
    points = list(zip(place[:n], place[n : 2 * n], place[2 * n :], strict=True))
    steps = [
        math.sqrt(sum(float(b - a) ** 2 for a, b in zip(p, q, strict=True))) for p, q in pairwise(points)
    ]
    length = list(accumulate(steps, initial=0.0))
    values = []
    for i in range(n):
        k = bisect_right(at, i) - 1
        guess = float(knots[k])
        if k + 1 < len(at) and length[at[k + 1]] > length[at[k]]:
            share = (length[i] - length[at[k]]) / (length[at[k + 1]] - length[at[k]])
            guess += share * (knots[k + 1] - knots[k])
        values.append(math.floor(guess + 0.5) + float(rest[i]))
    return values


def integers(specs: dict[str, Any], raw: bytes, spec: dict[str, Any]) -> list[int]:
    """Columns one after the other, summed in Python's own integers."""
    n, at = spec["n"], spec["off"]
    values: list[int] = []
    for order, width in zip(spec["order"], spec["width"], strict=True):
        planes = [raw[at + k * n : at + (k + 1) * n] for k in range(width)]
        stored = [int.from_bytes(few, "little") for few in zip(*planes, strict=True)] if width else [0] * n
        column = [-(z + 1) // 2 if z % 2 else z // 2 for z in stored]
        for _ in range(order):
            column = list(accumulate(column))
        values += column
        at += width * n
    for other in spec.get("plus", ()):
        more = specs[other]
        assert (more["q"], more["n"], more["c"]) == (spec["q"], n, spec["c"])
        assert "plus" not in more
        values = [a + b for a, b in zip(values, integers(specs, raw, more), strict=True)]
    return values


def _filled_in(specs: dict[str, Any], raw: bytes, spec: dict[str, Any]) -> list[str]:
    """Lines from templates, styles, and numbers that positions in whole nm predict."""
    n, mark, columns = spec["n"], spec["mark"], spec["columns"]
    templates = decoded(specs, raw, spec["templates"])
    which = integers(specs, raw, specs[spec["template"]])
    rest = integers(specs, raw, specs[spec["rest"]])
    at = integers(specs, raw, specs[spec["at"]]) if spec["at"] else []
    place = [_nanometres(specs, raw, specs[name]) for name in spec["of"]]
    samples = len(place[0]) // 3 if place else 0

    def position(line: int, axis: int) -> int:
        return sum(values[axis * samples + at[line]] for values in place)

    def number(line: int, style: str) -> str:
        column, decimals, least, trim, point = spec["styles"][ord(style) - spec["first"]]
        rule = columns[column]
        value = rest[column * n + line]
        if rule["axis"] is not None:
            nm = position(line, rule["axis"])
            if rule["relative"]:
                nm -= position(max(line - 1, 0), rule["axis"])
            value += math.floor(nm / rule["nm"] + 0.5)
        text = f"{Decimal(abs(value)).scaleb(-rule['decimals']):.{decimals}f}"
        whole, _, behind = text.partition(".")
        behind = behind.rstrip("0") if trim else behind
        whole = whole.lstrip("0").zfill(least) or ("" if behind else "0")
        return "-" * (value < 0) + whole + "." * bool(behind or point) + behind

    lines = []
    for line in range(n):
        first, *parts = templates[which[line]].split(mark)
        lines.append(first + "".join(number(line, part[0]) + part[1:] for part in parts))
    return lines


def _nanometres(specs: dict[str, Any], raw: bytes, spec: dict[str, Any]) -> list[int]:
    step = Decimal(repr(spec["q"])) * 1_000_000
    return [int(value * step) for value in integers(specs, raw, spec)]
