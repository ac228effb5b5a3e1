"""Words that neither papers nor code use, and what they say instead: the unambiguous ones, as patterns."""

from __future__ import annotations

import re

#: Pattern to the word that is used instead.
BANNED: dict[str, str] = {
    r"way-points?": "waypoint",
    r"lost[ -]motions?": "backlash, play, reversal error",
    r"flanks?": "which side of the backlash",
    r"raw machine|uncorrected machine|machine as it is": "uncompensated machine",
    r"stood": "was; the position of",
    r"what is left (over|of)|leftovers?": "residual",
    r"cannot see|nobody|somebody": "not observable from these data; say who",
    r"eaten": "absorbed by the fit",
    r"how sure|sureness|surely": "uncertainty, coverage",
    r"made anew|anew": "repeated, iterated",
    r"freed of": "with zero offset and slope removed",
    r"to and fro|there and back": "in both directions",
    r"stands? twice": "is defined twice",
    r"a row an? \w+|a line an? \w+": "one row per point",
    r"and kin": "and similar",
    r"asks no clock": "does not read the system clock",
    r"testpaths": "predicted acceptance tests",
    r"no whole number": "is not an integer",
    r"pills?": "verdict",
    r"flattened": "unrolled",
}
PATTERN = re.compile("|".join(rf"(?<![\w-])(?:{word})(?![\w-])" for word in BANNED), re.IGNORECASE)


def instead(banned: str) -> str:
    """What to say instead of a banned word."""
    return next(better for word, better in BANNED.items() if re.fullmatch(word, banned, re.IGNORECASE))
