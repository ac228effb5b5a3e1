"""What the comparison of each source with all others says: findings, and rows of the report of a fit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from olp.calibration.diagnosis.agreement import Agreement, Compared
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.summary import cost_um, grid_of
from olp.core.machine import Vector
from olp.findings.catalogue import Finding

#: um; smaller harm is not listed.
_LEAST_UM = 0.1
#: Files that one finding lists, at most.
_LISTED = 8


def agreement_findings(found: Compared, fit: Fit, tools: Sequence[Vector]) -> Iterator[Finding]:
    """What is wrong with sources, which contradict the others, and which nothing checks."""
    for one in found.wrong:
        assert one.named is not None
        yield Finding(
            "OLP810",
            f"{_name(one)}: {one.named.words}; so it agrees with all other readings, with odds of "
            f"10^{one.named.log_odds / math.log(10.0):.0f} to 1",
        )
    for one in found.unlike:
        yield Finding(
            "OLP811",
            f"{_name(one)}: it differs from what all other readings say by "
            f"{math.sqrt(one.misfit.reduced):.1f} times what both uncertainties explain",
        )
    open_ones = [one for one in found.sources if "sign" in one.possible]
    costs = sorted(((_harm_um(one, fit, tools), _name(one)) for one in open_ones), reverse=True)
    costs = [cost for cost in costs if cost[0] > _LEAST_UM]
    if costs:
        words = ", ".join(f"{name} {harm:.3g} um" for harm, name in costs[:_LISTED])
        more = f" and {len(costs) - _LISTED} more" if len(costs) > _LISTED else ""
        yield Finding("OLP812", f"{len(costs)} of {len(found.sources)} sources: {words}{more}")


def agreement_rows(found: Compared) -> list[dict[str, Any]]:
    """One row a source: how it agrees with the others, and what they do not exclude."""
    wrong = {id(one.misfit): one for one in found.wrong}
    return [
        {
            "file": one.label,
            "name": one.component,
            "directions": int(one.misfit.freedom),
            "chi_square_per_direction": one.misfit.reduced,
            "wrong": one.named.words if id(one.misfit) in wrong and one.named is not None else "",
            "not_excluded": ", ".join(one.possible),
        }
        for one in found.sources
    ]


def _name(one: Agreement) -> str:
    return f"{one.label} ({one.component})" if one.component and one.component != one.label else one.label


def _harm_um(one: Agreement, fit: Fit, tools: Sequence[Vector]) -> float:
    """The error in um where the sign of a source is wrong: twice what it says, at the longest lever arm."""
    if not one.component:
        return 0.0
    values = fit.curve(one.component, grid_of(fit, one.component)) @ fit.theta
    return 2.0 * cost_um(fit, one.component, float(np.ptp(values)), tools)
