"""Colours of deviations: bands in units of a tolerance, for the page and for live views.

A colour has one meaning: blue is within what the picture is judged by, orange to red is above it, and what
is judged by nothing is violet, or where it has a sign violet for plus and green for minus.
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
        "within": ("#2a98af", "#0a8fb2", "#0785b3", "#007ab5", "#066bb0", "#0459a4", "#01459d", "#0a2f94"),
        "above": ("#d2760b", "#ce6709", "#cc5601", "#c94101", "#be2602", "#a31713", "#890717", "#6d0318"),
        "open": ("#a87db1", "#9a6ea9", "#8c60a2", "#7e529a", "#704392", "#62358b", "#552683", "#47137c"),
        "minus": ("#629a82", "#548e75", "#478368", "#39775c", "#2b6c4f", "#1b6143", "#055638", "#014a2e"),
    },
    "dark": {
        "within": ("#4b67a3", "#4b77b5", "#4888c7", "#4199d8", "#3eabe2", "#49bde5", "#5ccee7", "#73dee9"),
        "above": ("#e14d28", "#e96321", "#f07820", "#f58c27", "#f8a136", "#f8b64b", "#f8ca63", "#f7dd7d"),
        "open": ("#7d5fad", "#8c6cb7", "#9c78c2", "#ab84cc", "#bb91d7", "#cb9ee1", "#dbabec", "#ebb9f7"),
        "minus": ("#448061", "#4e8d6e", "#589b7a", "#62a987", "#6cb794", "#77c6a2", "#81d4b0", "#8ce3be"),
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
#: A ratio that is not smaller: bands of nothing.
_LEAST = 1e-6


def bands(largest: float, tolerance: float | None) -> list[float]:
    """Ascending edges of bands, from 0 to the first round number at or above `largest`.

    With a tolerance they are round shares or multiples of it. It is one of them unless all are below it.
    """
    unit = 1.0 if tolerance is None else tolerance
    ratio = max(largest / unit, _LEAST)
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
