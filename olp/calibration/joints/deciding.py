"""At which odds something is said of readings or of a calibration, and how odds are written."""

from __future__ import annotations

import math

#: Log of the odds at which something is decided.
DECIDED = math.log(2000.0)
#: Log of the prior odds of any one mistake.
UNLIKELY = math.log(0.01)
#: Readings agree with a machine where their reduced chi-square is at most this.
AGREES = 1.5
#: Powers of ten above which odds are not stated.
_BEYOND = 300


def log_odds(before: float, after: float, reduced: float, mistakes: int = 1) -> float:
    """The log of the odds that so many mistakes were made, from chi-square with and without them. Readings
    that still scatter more than stated, by their `reduced` chi-square, say less."""
    return 0.5 * (before - after) / max(1.0, reduced) + UNLIKELY * mistakes


def odds_in_words(log: float) -> str:
    """Such as "odds 10^12 to 1"; infinite odds are those of readings that settle nowhere as they are."""
    if math.isinf(log):
        return "as stated the readings settle nowhere"
    power = log / math.log(10.0)
    return f"odds 10^{power:.0f} to 1" if power < _BEYOND else f"odds above 10^{_BEYOND} to 1"
