"""What the comparison of each source with all others says: findings, and rows of the report of a fit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from olp.calibration.diagnosis.agreement import Compared
from olp.calibration.diagnosis.mistakes import Agreement, Tried
from olp.calibration.estimator.character import class_of, largest
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.summary import grid_of
from olp.core.arrays import Array
from olp.core.machine import Vector
from olp.core.units import UM_PER_MM
from olp.findings.catalogue import Finding

#: um; smaller harm is not listed.
_LEAST_UM = 0.1
#: Files that one finding lists, at most.
_LISTED = 8
#: Positions along each axis of a lattice where harm is looked for: ends and corners have the longest levers.
_LEVELS = 3
#: Random positions beside them: a curve may differ between the same few positions of its axis only.
_AMONG = 300


def agreement_findings(found: Compared, fit: Fit, tools: Sequence[Vector]) -> Iterator[Finding]:
    """What is wrong with sources, which contradict the others, and which nothing checks."""
    for one in found.wrong:
        assert one.named is not None
        yield Finding(
            "OLP810",
            f"{one.name}: {one.causes}; so it agrees with all other readings, with odds of "
            f"10^{one.named.log_odds / math.log(10.0):.0f} to 1" + _instead(one),
        )
    for one in found.unlike:
        yield Finding(
            "OLP811",
            f"{one.name}: it differs from what all other readings say by {_times(one)}"
            + (f"; it may be that {one.likely}, which they do not confirm" if one.likely else "")
            + _instead(one),
        )
    told = {one.number for one in (*found.wrong, *found.unlike)}
    harms = [
        (harm, one.name, kind) for one, (harm, kind) in _harms(found, fit, tools) if one.number not in told
    ]
    costs = sorted((cost for cost in harms if cost[0] > _LEAST_UM), reverse=True)
    if costs:
        words = ", ".join(f"{name} {harm:.3g} um ({kind})" for harm, name, kind in costs[:_LISTED])
        more = f" and {len(costs) - _LISTED} more" if len(costs) > _LISTED else ""
        yield Finding("OLP812", f"{len(costs)} of {len(found.sources)} sources: {words}{more}")


def _times(one: Agreement) -> str:
    """In words by how much a source differs."""
    if one.beside is not None and one.unlike_its_kind:
        return f"{math.sqrt(one.beside.reduced):.1f} times as much as others of its kind do"
    return f"{math.sqrt(one.misfit.reduced):.1f} times what both uncertainties explain"


def _instead(one: Agreement) -> str:
    """In words which sources may be wrong instead."""
    return f"; or {' or '.join(one.rivals)} is wrong instead, as probably" if one.rivals else ""


def agreement_rows(found: Compared, fit: Fit, tools: Sequence[Vector]) -> list[dict[str, Any]]:
    """One row a source: how it agrees with the others, what they do not exclude, and what that could cost."""
    wrong = {one.number: one for one in found.wrong}
    return [
        {
            "file": one.label,
            "name": one.component,
            "directions": int(one.misfit.freedom),
            "chi_square_per_direction": one.misfit.reduced,
            "wrong": wrong[one.number].causes if one.number in wrong else "",
            "log10_odds_of_a_mistake": one.doubt / math.log(10.0) if np.isfinite(one.doubt) else None,
            "not_excluded": ", ".join(sorted({tried.kind for tried in _open(one, fit)})),
            "hidden_harm_um": harm,
        }
        for one, (harm, _) in _harms(found, fit, tools)
    ]


def _harms(
    found: Compared, fit: Fit, tools: Sequence[Vector]
) -> Iterator[tuple[Agreement, tuple[float, str]]]:
    """What of each source is not excluded and changes the errors most: by how much in um, and its kind. It is
    taken over the box with all tools, those of the readings where none are known."""
    sides = [np.linspace(low, high, _LEVELS) for low, high in fit.box_mm.tolist()]
    lattice = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 3)
    low, high = fit.box_mm.T
    among = np.random.default_rng(1).uniform(low, high, (_AMONG, 3))
    position = np.concatenate([lattice, among])
    rows = np.stack([fit.design(position, np.array(tool)) for tool in tools or _read_with(fit)])
    for one in found.sources:
        harms = [(0.0, "")]
        for tried in _open(one, fit):
            if len(tried.change):
                error = rows @ tried.change
                harms.append((float(np.linalg.norm(error, axis=-1).max()) * UM_PER_MM, tried.kind))
        yield one, max(harms)


def _read_with(fit: Fit) -> list[Vector]:
    """The outermost tool vectors of the readings: harm grows with the lever arm, so no other does more."""
    every = np.concatenate([np.atleast_2d(result.state.observation.tool_mm) for result in fit.results])
    outer = np.unique(every[np.concatenate([every.argmin(axis=0), every.argmax(axis=0)])], axis=0)
    return [(x, y, z) for x, y, z in outer.tolist()]


def _open(one: Agreement, fit: Fit) -> list[Tried]:
    """What may be wrong with a source without notice, of what a machine can be."""
    return [tried for tried in one.open if not len(tried.change) or _plausible(one.component, tried, fit)]


def _plausible(name: str, tried: Tried, fit: Fit) -> bool:
    """Whether the curve that was read is no larger, if it is so, than those of machines are; every curve
    where a source reads all of them."""
    curves = [name] if name in fit.parameters.spaces else [*fit.parameters.spaces]
    return all(_no_larger(curve, tried.change, fit) for curve in curves)


def _no_larger(name: str, change: Array, fit: Fit) -> bool:
    rows = fit.curve(name, grid_of(fit, name))
    before, after = (float(np.sqrt(np.mean((rows @ x) ** 2))) for x in (fit.theta, fit.theta + change))
    return after <= max(before, largest(class_of(name)))
