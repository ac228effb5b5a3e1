"""A reader of review pages of its own: it shares no code with the packer, nor with the page."""

from __future__ import annotations

import base64
import json
import zlib
from html.parser import HTMLParser
from itertools import accumulate
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
    if spec["enc"] == "patch":
        return _patched(specs, raw, spec)
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
        whole = np.array(_integers(specs, raw, spec), dtype=object).reshape(c, n).T
        column = np.array(whole / round(1 / spec["q"]), float).reshape(n, c)
    return column[:, 0] if c == 1 else column


def _integers(specs: dict[str, Any], raw: bytes, spec: dict[str, Any]) -> list[int]:
    """Columns one after the other, summed in Python's own integers."""
    n, c, offset = spec["n"], spec["c"], spec["off"]
    planes = [raw[offset + k * n * c : offset + (k + 1) * n * c] for k in range(4)]
    steps = [int.from_bytes(four, "little", signed=True) for four in zip(*planes, strict=True)]
    values: list[int] = []
    for column in range(c):
        values += accumulate(steps[column * n : (column + 1) * n])
    for other in spec.get("plus", ()):
        more = specs[other]
        assert (more["q"], more["n"], more["c"]) == (spec["q"], n, c)
        assert "plus" not in more
        values = [a + b for a, b in zip(values, _integers(specs, raw, more), strict=True)]
    return values


def _patched(specs: dict[str, Any], raw: bytes, spec: dict[str, Any]) -> list[str]:
    of = decoded(specs, raw, spec["of"])
    columns = [decoded(specs, raw, spec[key]) for key in ("from", "prefix", "suffix", "middle")]
    rows = []
    for line, prefix, suffix, middle in zip(*columns, strict=True):
        old = of[int(line)] if line >= 0 else ""
        rows.append(old[: int(prefix)] + middle + old[len(old) - int(suffix) :])
    assert len(rows) == spec["n"]
    return rows
