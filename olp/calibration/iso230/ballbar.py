"""Circles measured with a ball-bar (ISO 230-4): circular deviation and hysteresis, and squareness, scale
mismatch, servo mismatch and backlash from them.

At angle t from the first axis of the plane toward the second, with d = +1 counter-clockwise and -1 clockwise:

    dr = r0 + x cos t + y sin t + R (S_1 - S_2) / 2 cos 2t + R g / 2 sin 2t + d v (T_1 - T_2) / 2 sin 2t
         + b_1 / 2 d sgn(sin t) cos t - b_2 / 2 d sgn(cos t) sin t

with g the lean of the second axis toward + of the first one, T the servo lags in time and b the backlash.
In one direction alone g and the servo mismatch are one column: such a circle gives no squareness.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from olp.calibration.iso230.conventions import LEAN
from olp.calibration.observations.base import correlation_factor
from olp.calibration.observations.circles import PLANES, SKIP_DEG, UNKNOWNS, Circles, columns
from olp.calibration.observations.squareness import SquarenessReading
from olp.core.arrays import Array, Index, distinct
from olp.core.errors import ConfigError
from olp.core.units import RAD_PER_URAD, UM_PER_MM
from olp.core.values import dataclass
from olp.findings.catalogue import Finding

#: Angles of the circle at which both directions are compared.
_ANGLES = 720
#: A circle of radius R shows the slope R^2 / 2 of x^3, a mean line over +-s the slope 3 s^2 / 5.
_MEAN_LINE = float(np.sqrt(5.0 / 6.0))
#: Share of an unknown in the null space from which on it is not determined.
_SHARE = 1e-6
#: Singular values below this share of the largest count as zero.
_RANK = 1e-9
#: A residual of so many times the stated uncertainty is reported.
_TOO_MUCH = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class CircleFit:
    """(8,) `value` and `sigma` of UNKNOWNS, all in mm at the circle: scale R (S_1 - S_2) / 2, square R g / 2,
    servo v (T_1 - T_2) / 2, backlash b. `determined` names those that are determined. `residual` (n,) in mm
    of all readings, also those beside the fit (`used` False). G by direction and H in mm."""

    circles: Circles
    value: Array
    sigma: Array
    determined: frozenset[str]
    residual: Array
    used: Array
    noise: float
    figures: Mapping[str, float]

    @property
    def one_way(self) -> bool:
        return len(np.unique(self.circles.direction)) == 1

    @property
    def component(self) -> str:
        return PLANES[self.circles.plane][2]

    def reading(self) -> SquarenessReading | None:
        """The squareness as at the centre; None where it is not determined. Its span is that whose mean lines
        have the slopes that the circle shows, for straightness up to the third order."""
        if "square" not in self.determined:
            return None
        c, r = self.circles, self.circles.radius_mm
        lean = 2.0 * self.value[4] / r
        first, second, name = PLANES[c.plane]
        low, high = sorted((first, second))
        half = _MEAN_LINE * r
        spans = [(c.centre_mm[i] - half, c.centre_mm[i] + half) for i in (low, high)]
        return SquarenessReading(
            name, float(LEAN[name] * lean), c.centre_mm, (spans[0], spans[1]), c.tool_mm,
            float(2.0 * self.sigma[4] / r), c.source,
        )  # fmt: skip

    @property
    def findings(self) -> Iterator[Finding]:
        missing = [name for name in UNKNOWNS if name not in self.determined]
        if self.one_way:
            yield Finding(
                "OLP856",
                f"circle {self.circles.plane}: squareness and servo mismatch not determined, as it was run "
                "in one direction only; run it clockwise and counter-clockwise in one set-up",
            )
        elif missing:
            yield Finding(
                "OLP856",
                f"circle {self.circles.plane}: {', '.join(missing)} not determined; run a larger part of the "
                "circle",
            )
        if self.circles.sigma > 0.0 and self.noise > _TOO_MUCH * self.circles.sigma:
            yield Finding(
                "OLP857",
                f"circle {self.circles.plane}: residual {self.noise * UM_PER_MM:.2f} um rms, "
                f"stated uncertainty {self.circles.sigma * UM_PER_MM:.2f} um",
            )
        for k, axis in zip((6, 7), self.circles.names, strict=True):
            if UNKNOWNS[k] in self.determined and self.value[k] < -3.0 * self.sigma[k]:
                yield Finding("OLP855", f"{axis}: backlash {self.value[k] * UM_PER_MM:.2f} um on the circle")

    def as_dict(self) -> dict[str, Any]:
        c = self.circles
        first, second = c.names
        report: dict[str, Any] = {
            "plane": c.plane, "file": c.source, "radius_mm": c.radius_mm, "centre_mm": list(c.centre_mm),
            "noise_um": self.noise * UM_PER_MM,
        }  # fmt: skip
        report |= {f"{name}_um": value * UM_PER_MM for name, value in self.figures.items()}
        values = []

        def add(name: str, key: str, unit: str, factor: float) -> None:
            k = UNKNOWNS.index(key)
            if key in self.determined:
                values.append({
                    "name": name, f"value_{unit}": self.value[k] * factor,
                    f"sigma_{unit}": self.sigma[k] * abs(factor),
                })  # fmt: skip

        per_radius = 2.0 / c.radius_mm / RAD_PER_URAD
        add(self.component, "square", "urad", LEAN[self.component] * per_radius)
        add(f"scale {first} less scale {second}", "scale", "um_m", per_radius)
        if c.feed_mm_s > 0.0:
            add(f"servo lag {first} less {second}", "servo", "ms", 2e3 / c.feed_mm_s)
        else:
            add("servo mismatch on the circle", "servo", "um", UM_PER_MM)
        add(f"backlash {first}", "backlash_1", "um", UM_PER_MM)
        add(f"backlash {second}", "backlash_2", "um", UM_PER_MM)
        report["found"] = values
        report["not_determined"] = [name for name in UNKNOWNS if name not in self.determined]
        return report


def fit(circles: Circles, *, skip_deg: float = SKIP_DEG) -> CircleFit:
    """All unknowns by least squares. Readings within `skip_deg` of the reversal of an axis are not used.
    Raises ConfigError where too few remain."""
    design = columns(circles)
    quarter = np.abs((circles.angle_rad + np.pi / 4) % (np.pi / 2) - np.pi / 4)
    used = quarter > np.radians(skip_deg)
    if used.sum() < 2 * len(UNKNOWNS):
        raise ConfigError(
            f"circle {circles.plane}: {int(used.sum())} readings away from the reversals; expected at least "
            f"{2 * len(UNKNOWNS)}",
            file=circles.source,
        )
    part, value = design[used], circles.value[used]
    _, singular, v = np.linalg.svd(part, full_matrices=False)
    rank = int((singular > _RANK * singular[0]).sum())
    null = v[rank:]
    determined = frozenset(
        name for k, name in enumerate(UNKNOWNS) if not len(null) or np.abs(null[:, k]).max() < _SHARE
    )
    inverse = np.linalg.pinv(part, rcond=_RANK)
    estimate = inverse @ value
    residual = circles.value - design @ estimate
    dof = len(value) - rank
    noise = float(np.sqrt((residual[used] ** 2).sum() / max(dof, 1)))
    spread = max(noise * _correlation_factor(circles, residual, used), circles.sigma)
    sigma = spread * np.sqrt(np.diag(inverse @ inverse.T))
    return CircleFit(
        circles, estimate, sigma, determined, residual, used, noise, figures_of(circles, estimate[1:3])
    )


def _correlation_factor(circles: Circles, residual: Array, used: Array) -> float:
    """Factor because residuals of neighbours on the circle are alike, from straightness and scales."""
    product = square = 0.0
    for d in (1, -1):
        for run in np.unique(circles.run[circles.direction == d]):
            rows = np.flatnonzero((circles.direction == d) & (circles.run == run) & used)
            rest = residual[rows[np.argsort(circles.angle_rad[rows] % (2.0 * np.pi))]]
            product += float(rest[:-1] @ rest[1:])
            square += float(rest @ rest)
    return correlation_factor(product, square)


def figures_of(circles: Circles, centre: Array) -> dict[str, float]:
    """The figures of ISO 230-4 in mm, with the centre (2,) of the least-squares circle taken out.

    `G_ccw`, `G_cw`: circular deviation of each direction. `F_max_ccw`, `F_min_ccw` and so on: largest and
    least deviation from the nominal radius. Of both directions together: `G_b`, the circular deviation of
    both paths, the first run with the first and so on. `H`, the hysteresis of the mean runs. `D`, the mean
    radial deviation. Of several runs the largest counts.
    """
    t = circles.angle_rad % (2.0 * np.pi)
    centred = circles.value - centre[0] * np.cos(t) - centre[1] * np.sin(t)
    figures: dict[str, float] = {}
    grid = np.arange(_ANGLES) * 2.0 * np.pi / _ANGLES
    laps: dict[int, list[Array]] = {1: [], -1: []}
    ends: dict[int, list[tuple[float, float]]] = {1: [], -1: []}
    for d, way in ((1, "ccw"), (-1, "cw")):
        for run in distinct(circles.run[circles.direction == d]).tolist():
            rows = (circles.direction == d) & (circles.run == run)
            own = centred[rows]
            ends[d].append((float(own.min()), float(own.max())))
            order = np.argsort(t[rows])
            laps[d].append(np.interp(grid, t[rows][order], own[order], period=2.0 * np.pi))
        if ends[d]:
            figures[f"G_{way}"] = max(high - low for low, high in ends[d])
            figures[f"F_max_{way}"] = max(high for _, high in ends[d])
            figures[f"F_min_{way}"] = min(low for low, _ in ends[d])
    if laps[1] and laps[-1] and _whole(t, circles.direction):
        pairs = zip(ends[1], ends[-1], strict=False)
        figures["G_b"] = max(max(a[1], b[1]) - min(a[0], b[0]) for a, b in pairs)
        means = [np.mean(laps[d], axis=0) for d in (1, -1)]
        figures["H"] = float(np.abs(means[0] - means[1]).max())
        figures["D"] = float(np.mean(means))
    return figures


def _whole(angle: Array, direction: Index) -> bool:
    """Whether there is no gap above 10 degrees in either direction."""
    for d in (1, -1):
        turn = np.sort(angle[direction == d])
        if np.diff(turn, append=turn[0] + 2.0 * np.pi).max() > np.radians(10.0):
            return False
    return True


def readings_of(fits: Sequence[CircleFit]) -> tuple[SquarenessReading, ...]:
    """The squareness of all circles that determine one."""
    return tuple(r for r in (one.reading() for one in fits) if r is not None)
