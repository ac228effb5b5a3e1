"""Colours of deviations: bands in units of a tolerance, for the page and for live views.

A colour has one meaning: blue is within what the picture is judged by, orange to red is above it. What is
judged by nothing is violet. Where that has a sign, minus is green.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

Theme = Literal["light", "dark"]
Family = Literal["within", "above", "open", "minus"]

#: Colours of bands by theme, from small to large; each has a contrast of 3 or more to the ground of its
#: theme, and grows in contrast with the value, also for colour-blind eyes.
COLOURS: dict[Theme, dict[Family, tuple[str, ...]]] = {
    "light": {
        "within": ("#2192a8", "#0b8aac", "#0c82af", "#0879b3", "#066bb0", "#0459a4", "#01459d", "#0a2f94"),
        "above": ("#cb7202", "#ca6400", "#c85401", "#c84001", "#be2602", "#a31713", "#890717", "#6d0318"),
        "open": ("#a177ab", "#9569a4", "#885c9d", "#7b4e96", "#6e4190", "#613389", "#542583", "#47137c"),
        "minus": ("#5b927a", "#4e886f", "#417d63", "#357358", "#27694d", "#185f42", "#035537", "#014a2e"),
    },
    "dark": {
        "within": ("#5572ae", "#527fbd", "#4d8ccc", "#439ada", "#3eabe2", "#49bde5", "#5ccee7", "#73dee9"),
        "above": ("#e14d28", "#e96321", "#f07820", "#f58c27", "#f8a136", "#f8b64b", "#f8ca63", "#f7dd7d"),
        "open": ("#8467b5", "#9372be", "#a17dc8", "#b089d1", "#bf94da", "#cea0e4", "#dcaced", "#ebb9f7"),
        "minus": ("#4a8667", "#539373", "#5ca07f", "#65ad8b", "#6fba97", "#79c7a4", "#82d5b0", "#8ce3be"),
    },
}  # fmt: skip
#: Most bands of one family, about.
MOST = 6
#: Round factors of a step.
_ROUND = (1.0, 2.0, 2.5, 5.0, 10.0)
#: Share of a value within which it is equal but for rounding.
_ROUNDING = 1e-9
#: Smallest step above the tolerance, as a share of it.
_LEAST_STEP = 0.25
#: A smaller ratio is nothing, whose bands go to 1.
_LEAST = 1e-6


def bands(largest: float, tolerance: float | None) -> list[float]:
    """Ascending edges of bands, from 0 to the first round number at or above `largest`.

    With a tolerance they are round shares or multiples of it. It is one of them unless all are below it.
    """
    unit = 1.0 if tolerance is None else tolerance
    ratio = largest / unit
    if ratio < _LEAST:
        ratio = 1.0
    if tolerance is None or ratio <= 1.0 + _ROUNDING:
        return [unit * edge for edge in (0.0, *_multiples(0.0, ratio, _step(ratio / MOST)))]
    within = (0.0, 1.0) if ratio > 2.0 * MOST else (0.0, 0.5, 1.0)
    above = _multiples(1.0, ratio, _step(max((ratio - 1.0) / MOST, _LEAST_STEP)))
    return [unit * edge for edge in (*within, *above)]


def colours(edges: Sequence[float], tolerance: float | None, theme: Theme) -> list[str]:
    """The colour of each band between `edges`."""
    families: list[Family] = [
        "open" if tolerance is None else "within" if top <= tolerance * (1.0 + _ROUNDING) else "above"
        for top in edges[1:]
    ]
    return [
        spread(COLOURS[theme][family], families[:k].count(family), families.count(family))
        for k, family in enumerate(families)
    ]


def spread(of: Sequence[str], k: int, count: int) -> str:
    """Colour number `k` of `count` that are spread over a family."""
    return of[int((k + 0.5) / count * len(of))]


def _step(least: float) -> float:
    """The smallest round step that is not below `least`."""
    unit = 10.0 ** math.floor(math.log10(least))
    return next(unit * m for m in _ROUND if unit * m >= least * (1.0 - _ROUNDING))


def _multiples(above: float, last: float, step: float) -> list[float]:
    """Multiples of `step` beyond `above`, to the first at or beyond `last`."""
    first = math.floor(above / step * (1.0 + _ROUNDING)) + 1
    final = math.ceil(last / step * (1.0 - _ROUNDING))
    return [k * step for k in range(first, max(first, final) + 1)]
