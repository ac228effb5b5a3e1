"""The covariance of an adjustment, as that of the numbers of the calibration that it gave."""

from __future__ import annotations

import itertools
import math
from collections import Counter

import numpy as np

from olp.calibration.estimator.basis import Kink
from olp.calibration.estimator.curves import DIGITS
from olp.calibration.estimator.fitted import Fit
from olp.core.arrays import Array
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.core.units import AXES
from olp.errormodel.calibration import Calibration
from olp.errormodel.entry import Entry
from olp.errormodel.uncertainty import Uncertainty, fingerprint

#: Positions of a curve in each cell of its spline: between them its factor is linear.
_PER_CELL = 2
#: Positions in a step, as shares of its length. Its uncertainty over this length is a half circle.
_IN_STEP = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 9))
#: Largest share of the variance of a number that the factor drops; of a small variance, see _FLOOR.
DROPPED = 1e-3
#: Least sigma of a number in the choice of principal components, as a share of the largest of its curve. A
#: sigma near zero, as at the datum, would ask for all components.
_FLOOR = 0.2


def covariance_of(fit: Fit, calibration: Calibration) -> Uncertainty:
    """All 18 mean curves, half differences, cyclic terms and squareness, each a linear functional of the
    unknowns. Curves that are not observable, and zero in the calibration, are included.

    The factor holds the leading principal components; `rest` is the uncertainty of where between two targets
    a step is.
    """
    parts: list[tuple[str, str, Array, float]] = []
    rows: list[Array] = []
    for name in COMPONENTS:
        q = _positions(fit, name)
        parts.append(("mean", name, q, 0.0))
        rows.append(fit.curve(name, q))
    p = fit.parameters
    for name, space in p.halves.items():
        q = _positions(fit, name)
        table = np.zeros((len(q), p.size))
        table[:, p.slices[f"half {name}"]] = space.values(q)
        parts.append(("half", name, q, 0.0))
        rows.append(table)
    for name, waves in p.waves.items():
        start = p.slices[f"wave {name}"].start
        for k, wave in enumerate(waves):
            parts.append(("wave", name, np.zeros(0), wave.period_mm))
            rows.append(np.eye(p.size)[start + 2 * k : start + 2 * k + 2])
    for name in SQUARENESS:
        parts.append(("squareness", name, np.zeros(0), 0.0))
        rows.append(fit.squareness(name)[None, :])
    factor, dropped = principal(rows, fit.covariance)
    entries = []
    first = 0
    for (kind, name, q, period), table in zip(parts, rows, strict=True):
        own = slice(first, first + len(table))
        first = own.stop
        variance = fit.between_targets(name, q) if kind == "mean" else np.zeros(len(table))
        entries.append(Entry(kind, name, factor[own], np.sqrt(variance), q, period))
    kinds = Counter(result.state.noun for result in fit.results if result.state.noun)
    taken = ", ".join(f"{files} of {kind}" for kind, files in kinds.items())
    words = (
        f"the adjustment of readings ({taken}): {len(factor)} numbers, {factor.shape[1]} principal "
        f"components, which drop at most {100.0 * dropped:.2f} % of a variance"
    )
    return Uncertainty(tuple(entries), fingerprint(calibration), words, dropped)


def _positions(fit: Fit, name: str) -> Array:
    """Positions of a curve over the box: evenly in the cells of its spline, and the ends of its features."""
    axis = AXES.index(name[2])
    low, high = (float(side) for side in fit.box_mm[axis])
    space = fit.parameters.spaces[name]
    breaks = {low, high}
    for feature in space.features:
        inside = (
            [feature.at_mm] if isinstance(feature, Kink) else _IN_STEP * (feature.high_mm - feature.low_mm)
        )
        start = 0.0 if isinstance(feature, Kink) else feature.low_mm
        breaks.update(float(start + offset) for offset in inside if low < start + offset < high)
    spline = space.spline
    step = (spline.high_mm - spline.low_mm) / (spline.cells * _PER_CELL)
    parts = [
        np.linspace(a, b, max(1, math.ceil((b - a) / step)), endpoint=False)
        for a, b in itertools.pairwise(sorted(breaks))
    ]
    return np.concatenate([*parts, [high]])


def principal(rows: list[Array], covariance: Array) -> tuple[Array, float]:
    """(m, k) factor of the covariance of numbers that are `rows` of unknowns, and the largest share of a
    variance that it drops."""
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    full = [table @ root for table in rows]
    scale = []
    for part in full:
        sigma = np.sqrt((part**2).sum(axis=1))
        scale.append(np.maximum(sigma, max(_FLOOR * float(sigma.max(initial=0.0)), 1e-300)))
    table, size = np.concatenate(full), np.concatenate(scale)
    scaled = table / size[:, None]
    _, turned = np.linalg.eigh(scaled.T @ scaled)
    turned = turned[:, ::-1]
    share = (scaled @ turned) ** 2
    # the share of each number's variance that the first k components drop
    dropped = np.maximum(share.sum(axis=1)[:, None] - np.cumsum(share, axis=1), 0.0)
    worst = dropped.max(axis=0, initial=0.0)
    count = int(np.argmax(worst <= DROPPED)) + 1 if (worst <= DROPPED).any() else len(worst)
    return table @ turned[:, :count], float(worst[count - 1])


def sigmas_at(calibration: Calibration, uncertainty: Uncertainty) -> dict[str, Array]:
    """Standard uncertainties of components at the positions of their curves, mm or rad."""
    sigmas = {}
    for curve in calibration.curves:
        for name in curve.names:
            entry = uncertainty.find("mean", name)
            if entry is not None:
                sigma = np.interp(curve.position_mm, entry.position_mm, entry.sigma)
                sigmas[name] = np.round(sigma, DIGITS[name[1] in "ABC"])
    return sigmas
