"""Which lines of a program would gain most: from a larger path tolerance, and from a higher feed.

The whole program is planned once more under each, and the times of its lines are compared. So a gain counts
what the neighbours of a line allow, and gains of neighbours are not independent.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.core.progress import Progress
from olp.program.feeds.timing import timing
from olp.trajectory.usage import LineUse
from olp.trajectory.variants import Case, Plan, planned

#: factor on path tolerances
TOLERANCE = 4.0
#: factor on feeds
FEED = 1.25
#: lines that are listed of each change
MOST = 5
#: seconds below which nothing is gained
_LEAST_S = 1e-3


def gains(case: Case, base: Plan, tell: Progress) -> list[dict[str, Any]]:
    """The lines that gain most, first from tolerance, then from feed; `base` is the plan of the case.

    `change` is "tolerance" (um) or "feed" (mm/min), `now` and `then` its values. Raises as `planned`.
    """
    quicker = replace(case, override=case.override * FEED).driven()
    lines, wider, faster = (
        plan.in_original().lines
        for plan in (
            base,
            planned(case.scaled(TOLERANCE), base.limits, tell, "gains of tolerance"),
            planned(quicker, base.limits, tell, "gains of feed"),
        )
    )
    tolerance_um, feed = _tolerances(case, lines.line) * 1e3, lines.feed_mm_s * 60.0
    rows = _rows(lines, wider, "tolerance", tolerance_um, TOLERANCE * tolerance_um)
    return rows + _rows(lines, faster, "feed", feed, FEED * feed)


def _rows(base: LineUse, other: LineUse, change: str, now: Array, then: Array) -> list[dict[str, Any]]:
    known, place = _places(other.line, base.line)
    gained = np.where(known, base.seconds - other.seconds[place], 0.0)
    return worth(base.line, gained, change, now, then)


def worth(line: Index, gained_s: Array, change: str, now: Array, then: Array) -> list[dict[str, Any]]:
    """The lines that gain most of (m,) `line`, which gain (m,) s, where `now` (m,) is a value that can be
    changed."""
    gained = np.where(np.isfinite(now) & (now > 0.0), gained_s, 0.0)
    return [
        {
            "line": int(line[i]), "seconds": float(gained[i]), "change": change, "now": float(now[i]),
            "then": float(then[i]),
        }
        for i in np.argsort(-gained, kind="stable")[:MOST].tolist()
        if gained[i] > _LEAST_S
    ]  # fmt: skip


def _tolerances(case: Case, line: Index) -> Array:
    """(m,) the path tolerance of lines (m,) of the original; 0 where they do not blend."""
    clock = timing(case.program, blend_mm=case.blend_mm, block_delete=case.block_delete)
    known, place = _places(line, case.program.original_lines(case.program.toolpath.line))
    tolerance = np.zeros(len(line))
    np.maximum.at(tolerance, place[known], clock.blend_mm[known])
    return tolerance


def _places(among: Index, line: Index) -> tuple[Mask, Index]:
    """(n,) whether lines (n,) are among others, which rise, and their places there."""
    place = np.searchsorted(among, line)
    known = place < len(among)
    known[known] = among[place[known]] == line[known]
    return known, np.asarray(np.where(known, place, 0), np.int64)
