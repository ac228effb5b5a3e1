"""Which further points would decide what a diagnosis leaves undecided."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.calibration.diagnosis.doctor import Diagnosis
from olp.calibration.diagnosis.factors import DECIDED_Z, contributions_of, design_of
from olp.core.arrays import Array
from olp.core.machine import Vector
from olp.core.values import dataclass
from olp.errormodel.build import build

#: Positions that are tried.
POSITIONS = 160
#: Points that are proposed, at most.
MOST = 12
#: Offset of further reflectors from the first known tool, to each side; mm.
REACH_MM = 150.0
#: A point is worth its time where it reduces the sum of log variances by this.
WORTH = 0.02
#: Margin over the limit, so that noise does not make the result undecided again.
MARGIN = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class Advice:
    """Points to take in addition, in the same set-up: axis positions and tool vectors (n, 3) in mm. `z` says
    for each undecided name how many standard deviations a factor of one would have then, `effect_mm` how much
    the curve does at most in the box with these tools."""

    axis_mm: Array
    tool_mm: Array
    z: dict[str, float]
    effect_mm: dict[str, float]


def advise(diagnosis: Diagnosis, tools: Sequence[Vector], seed: int = 1) -> Advice:
    """The points that lower the uncertainty of undecided factors most, chosen one after the other."""
    from scipy.stats import qmc

    names = diagnosis.factors.names
    calibration, points = diagnosis.calibration, diagnosis.seen.points
    box = np.asarray(calibration.box_mm)
    share = qmc.LatinHypercube(3, seed=seed).random(POSITIONS)
    position = np.round(box[:, 0] + share * np.ptp(box, axis=1), 1)
    vectors = offsets(tools or [tuple(points.tool_mm[0].tolist())])
    axis = np.repeat(position, len(vectors), axis=0)
    tool = np.tile(vectors, (len(position), 1))
    model = build(calibration, diagnosis.chain, outside="hold", skip_components=diagnosis.skip)
    columns = contributions_of(model, axis, tool)
    rows = design_of(axis, tool, diagnosis.seen.centre_mm, columns, names)
    open_names = [v.name for v in diagnosis.undecided]
    which = np.array([names.index(name) for name in open_names], int)
    effect = {
        name: float(np.sqrt((columns[name] ** 2).sum(axis=1)).max()) if name in columns else 0.0
        for name in open_names
    }
    covariance = diagnosis.factors.covariance.copy()
    noise = float(np.mean(diagnosis.factors.sigma_mm)) ** 2 * np.eye(3)
    chosen: list[int] = []
    while len(which) and len(chosen) < MOST:
        sigma = np.sqrt(np.diag(covariance)[which])
        waiting = which[sigma * DECIDED_Z * MARGIN > 1.0]
        if not len(waiting):
            break
        seen = rows @ covariance
        spread = np.einsum("nik,njk->nij", seen, rows) + noise
        gain = np.linalg.solve(spread, seen[:, :, waiting])
        less = np.einsum("nik,nik->nk", seen[:, :, waiting], gain) / np.diag(covariance)[waiting]
        worth = -np.log1p(-np.minimum(less, 1.0 - 1e-9)).sum(axis=1)
        worth[chosen] = 0.0
        best = int(np.argmax(worth))
        if worth[best] < WORTH:
            break
        chosen.append(best)
        covariance -= seen[best].T @ np.linalg.solve(spread[best], seen[best])
    z = dict(zip(open_names, (1.0 / np.sqrt(np.diag(covariance)[which])).tolist(), strict=True))
    return Advice(axis[chosen], tool[chosen], z, effect)


def offsets(tools: Sequence[Vector]) -> Array:
    """(m, 3) tool vectors: those known, and the first one moved to either side, so that every angle acts."""
    first = np.array(tools[0], float)
    aside = [first + REACH_MM * np.array(side) for side in ((1.0, 0, 0), (0, 1.0, 0), (-0.6, -0.6, -0.8))]
    return np.unique(np.round(np.array([*map(list, tools), *aside], float), 3), axis=0)
