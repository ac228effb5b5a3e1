"""The least of a program that still shows what the whole one shows: blocks go first, then words."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

from fuzz.grammar import Drawn

_BLOCK = re.compile(rb"[^\r\n]*(?:\r*\n|\r|$)")
_WORD = re.compile(rb"\([^)\r\n]*\)|[A-Za-z][ \t]*[-+0-9. \t]+|[\r\n]+|.", re.DOTALL)
_CODE = re.compile(r"(?i)([GMTL])0*(\d+(?:\.[1-9]\d*)?)\.?0*(?![\d.])|([A-Z])[-+]?[\d.]+|\([^)]*\)")


def minimised(drawn: Drawn, shows: Callable[[Drawn], bool]) -> Drawn:
    """`shows` holds for `drawn`, and for what is returned."""
    for pattern in (_BLOCK, _WORD):
        parts = [part for part in pattern.findall(drawn.data) if part]
        drawn = _without(drawn, parts, shows)
    for simpler in ({"deletes": False}, {"start_mm": (12.0, -8.0, 30.0)}):
        trial = replace(drawn, **simpler)
        if trial != drawn and shows(trial):
            drawn = trial
    return drawn


def _without(drawn: Drawn, parts: list[bytes], shows: Callable[[Drawn], bool]) -> Drawn:
    """Without as many of the parts as possible, in ever smaller runs of them."""
    size = max(1, len(parts) // 2)
    while True:
        k, before = 0, len(parts)
        while k < len(parts):
            trial = replace(drawn, data=b"".join(parts[:k] + parts[k + size :]))
            if shows(trial):
                drawn, parts = trial, parts[:k] + parts[k + size :]
            else:
                k += size
        if size > 1:
            size //= 2
        elif len(parts) == before:
            return drawn


def signature(data: bytes) -> str:
    """The codes and letters of a program without its numbers: programs of one cause mostly share it."""

    def code(hit: re.Match[str]) -> str:
        if hit[1]:
            return hit[1].upper() + hit[2]
        return hit[3].upper() if hit[3] else "()"

    lines = re.split(r"\r*\n|\r", data.decode("latin-1").upper())
    return " | ".join(" ".join(_CODE.sub(code, line).split()) for line in lines if line.strip())
