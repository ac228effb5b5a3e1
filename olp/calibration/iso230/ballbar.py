"""Circles measured with a ball-bar (ISO 230-4): circular deviation and hysteresis, and squareness, scale
mismatch, servo mismatch and backlash from them.

At angle t from the first axis of the plane toward the second, with d = +1 counter-clockwise and -1 clockwise:

    dr = r0 + x cos t + y sin t + R (S_1 - S_2) / 2 cos 2t + R g / 2 sin 2t + d v (T_1 - T_2) / 2 sin 2t
         + b_1 / 2 d sgn(sin t) cos t - b_2 / 2 d sgn(cos t) sin t

with g the lean of the second axis toward + of the first one, T the servo lags in time and b the backlash.
In one direction alone g and the servo mismatch are one column: such a circle gives no squareness.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from olp.calibration.iso230.conventions import LEAN
from olp.calibration.observations.circles import PLANES, SKIP_DEG, UNKNOWNS, Circles, columns
from olp.calibration.observations.squareness import SquarenessReading
from olp.core.arrays import Array, Index
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
    circular: dict[int, float]
    hysteresis: float | None

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
        for d, name in ((1, "G_ccw_um"), (-1, "G_cw_um")):
            if d in self.circular:
                report[name] = self.circular[d] * UM_PER_MM
        if self.hysteresis is not None:
            report["H_um"] = self.hysteresis * UM_PER_MM
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
    circular, hysteresis = _figures(circles, estimate)
    return CircleFit(circles, estimate, sigma, determined, residual, used, noise, circular, hysteresis)


def _correlation_factor(circles: Circles, residual: Array, used: Array) -> float:
    """Factor on the uncertainty of a mean because residuals of neighbours on the circle are correlated, from
    straightness and scales: sqrt((1 + r) / (1 - r)) with the autocorrelation r of the first order."""
    product = square = 0.0
    for d in (1, -1):
        for run in np.unique(circles.run[circles.direction == d]):
            rows = np.flatnonzero((circles.direction == d) & (circles.run == run) & used)
            rest = residual[rows[np.argsort(circles.angle_rad[rows] % (2.0 * np.pi))]]
            product += float(rest[:-1] @ rest[1:])
            square += float(rest @ rest)
    correlation = min(max(product / square, 0.0), 0.99) if square > 0.0 else 0.0
    return float(np.sqrt((1.0 + correlation) / (1.0 - correlation)))


def _figures(circles: Circles, estimate: Array) -> tuple[dict[int, float], float | None]:
    """Circular deviation G of each direction (the largest of its runs) and hysteresis H (of the mean runs),
    the centre of the least-squares circle taken out (ISO 230-4, 3.2 to 3.4)."""
    t = circles.angle_rad % (2.0 * np.pi)
    centred = circles.value - estimate[1] * np.cos(t) - estimate[2] * np.sin(t)
    circular: dict[int, float] = {}
    means = {}
    grid = np.arange(_ANGLES) * 2.0 * np.pi / _ANGLES
    for d in (1, -1):
        laps = []
        for run in np.unique(circles.run[circles.direction == d]):
            rows = (circles.direction == d) & (circles.run == run)
            circular[d] = max(circular.get(d, 0.0), float(np.ptp(centred[rows])))
            order = np.argsort(t[rows])
            laps.append(np.interp(grid, t[rows][order], centred[rows][order], period=2.0 * np.pi))
        if laps:
            means[d] = np.mean(laps, axis=0)
    if len(means) < 2 or not _whole(t, circles.direction):
        return circular, None
    return circular, float(np.abs(means[1] - means[-1]).max())


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
