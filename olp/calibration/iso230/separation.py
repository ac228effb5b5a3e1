"""The parts of a line: what is not cyclic, cyclic errors by period, and reversal; and whether a period is
observable at the targets.

All estimates are linear in the readings: harmonic pairs beside columns that stand for any curve which is
smooth at the density of the targets. So parts add as the readings do. A period that cannot be separated from
a smooth curve at the targets is refused by the same numbers that would have estimated it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from olp.calibration.iso230.go_return import Reversal, reversal_of
from olp.calibration.iso230.positioning import scale_of, targets_of
from olp.calibration.observations.lines import Line
from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.values import dataclass
from olp.errormodel.calibration import Cyclic
from olp.findings.catalogue import Finding

#: A pair of harmonic columns must keep this share of its length beside all smooth columns, else its period is
#: not observable: the amplitude would be uncertain by more than four times what the same readings could give.
LEAST_OBSERVABLE_SHARE = 0.25
#: A smooth curve changes on no less than so many steps between targets.
_STEPS = 6.0
#: A smooth curve changes on no less than so many periods.
_PERIODS = 3.0
#: Half-waves that represent a smooth curve, at most.
_WAVES = 200
#: Steps this near to a multiple of half a period are named so in messages, in half periods.
_NEAR = 0.35


@dataclass(frozen=True, slots=True)
class Harmonic:
    """amplitude * sin(2 pi q / period + phase); mm or rad, with standard uncertainties."""

    component: str
    period_mm: float
    amplitude: float
    phase_rad: float
    sigma_amplitude: float
    sigma_phase_rad: float

    @property
    def cyclic(self) -> Cyclic:
        return Cyclic(self.component, self.period_mm, self.amplitude, self.phase_rad)

    def at(self, position_mm: Array) -> Array:
        """(n,) the error at axis positions (n,)."""
        turn = 2.0 * np.pi * position_mm / self.period_mm
        return np.asarray(self.amplitude * np.sin(turn + self.phase_rad))


@dataclass(frozen=True, slots=True, eq=False)
class Separation:
    """A line in its parts; (m,) columns over its targets, in mm or rad. `noncyclic` + the harmonics are the
    mean of both directions. `reversal` is None for readings from one side. `refused` names each period that
    was asked for and is not observable, with the reason."""

    line: Line
    target_mm: Array
    mean: Array
    noncyclic: Array
    harmonics: tuple[Harmonic, ...]
    reversal: Reversal | None
    refused: tuple[tuple[float, str], ...]

    @property
    def findings(self) -> tuple[Finding, ...]:
        name = self.line.component
        return tuple(
            Finding("OLP853", f"{name}, period {period:g} mm: {reason}") for period, reason in self.refused
        )

    def as_dict(self) -> dict[str, Any]:
        unit, scale = scale_of(self.line)
        return {
            "component": self.line.component,
            "file": self.line.source,
            "cyclic": [
                {
                    "period_mm": h.period_mm,
                    f"amplitude_{unit}": h.amplitude * scale,
                    "phase_rad": h.phase_rad,
                    f"sigma_amplitude_{unit}": h.sigma_amplitude * scale,
                    "sigma_phase_rad": h.sigma_phase_rad,
                }
                for h in self.harmonics
            ],
            "not_seen": [{"period_mm": period, "reason": reason} for period, reason in self.refused],
            "reversal": None if self.reversal is None else self.reversal.as_dict(),
            "targets": {
                "target_mm": self.target_mm.tolist(),
                f"mean_{unit}": (self.mean * scale).tolist(),
                f"noncyclic_{unit}": (self.noncyclic * scale).tolist(),
            },
        }


def aliased(targets_mm: npt.ArrayLike, period_mm: float) -> str | None:
    """Why an error of this period cannot be separated from a smooth curve at these targets; None if it can.

    `targets_mm` (n,) are axis positions, repeated or not, in any order. Raises ConfigError for a period that
    is not above zero.
    """
    if not (np.isfinite(period_mm) and period_mm > 0.0):
        raise ConfigError(f"period {period_mm} mm; expected more than 0")
    x = _distinct(targets_mm)
    return None if observable_share([x], period_mm) >= LEAST_OBSERVABLE_SHARE else _reason(x, period_mm)


def observable_share(blocks: Sequence[Array], period_mm: float, taken: Sequence[float] = ()) -> float:
    """Share (0 to 1) of its length that the weaker combination of sine and cosine of the period keeps beside
    the smooth columns of every block of targets (each (n,), ascending) and the harmonics `taken`."""
    smooth = _block_diagonal([_smooth_columns(x, period_mm) for x in blocks])
    x = np.concatenate(blocks)
    others = [_pair(x, other) for other in taken]
    pair = _pair(x, period_mm)
    rest = pair - _projected(np.hstack([smooth, *others]), pair)
    if len(x) < smooth.shape[1] + 2 * len(taken) + 3:
        return 0.0
    return float(np.linalg.svd(rest, compute_uv=False)[-1] / np.sqrt(len(x) / 2.0))


def separate(
    line: Line, periods_mm: Sequence[float] = (), sweeps: Sequence[Line] = (), *, harmonics: int = 2,
    drift: bool = True,
) -> Separation:  # fmt: skip
    """The parts of a line with cyclic errors of the given periods (each with its harmonics: the period over
    1, 2 ... `harmonics`), from the line and fine sweeps of the same component together.

    A period that is not observable is refused, never fitted. `drift` as in `reversal_of`. Raises ConfigError.
    """
    for sweep in sweeps:
        if sweep.component != line.component:
            raise ConfigError(
                f"a sweep of {sweep.component} beside a line of {line.component}; expected one component",
                file=sweep.source,
            )
    wanted = [period / k for period in periods_mm for k in range(1, harmonics + 1)]
    for period in wanted:
        if not (np.isfinite(period) and period > 0.0):
            raise ConfigError(f"period {period} mm; expected more than 0")
    parts = [_means(part) for part in (line, *sweeps)]
    blocks = [x for x, _ in parts]
    taken: list[float] = []
    refused: list[tuple[float, str]] = []
    for period in dict.fromkeys(wanted):
        if observable_share(blocks, period, taken) >= LEAST_OBSERVABLE_SHARE:
            taken.append(period)
        elif observable_share(blocks, period) >= LEAST_OBSERVABLE_SHARE:
            others = " and ".join(f"{p:g}" for p in taken)
            refused.append((period, f"at these targets it looks like the period of {others} mm"))
        else:
            refused.append((period, _reason(blocks[0], period)))
    target, mean = parts[0]
    fitted = _fit((line, *sweeps), parts, taken)
    cyclic = sum((h.at(target) for h in fitted), np.zeros(len(target)))
    both = (line.direction > 0).any() and (line.direction < 0).any()
    reversal = reversal_of(line, drift=drift) if both else None
    return Separation(line, target, mean, mean - cyclic, fitted, reversal, tuple(refused))


def _fit(
    lines: Sequence[Line], parts: Sequence[tuple[Array, Array]], periods: Sequence[float]
) -> tuple[Harmonic, ...]:
    if not periods:
        return ()
    x = np.concatenate([part[0] for part in parts])
    y = np.concatenate([part[1] for part in parts])
    # lines weigh by their stated uncertainty, never by their residuals: so the estimate is linear
    stated = all(line.sigma > 0.0 for line in lines)
    weight = np.concatenate([
        np.full(len(part[0]), np.sqrt(len(line.value) / len(part[0])) / (line.sigma if stated else 1.0))
        for line, part in zip(lines, parts, strict=True)
    ])  # fmt: skip
    smooth = _block_diagonal([_smooth_columns(part[0], max(periods)) for part in parts])
    design = np.hstack([*(_pair(x, period) for period in periods), smooth]) * weight[:, None]
    inverse = np.linalg.pinv(design, rcond=1e-10)
    estimate = inverse @ (y * weight)
    rest = y * weight - design @ estimate
    dof = len(y) - round(float(np.einsum("ij,ji->", design, inverse)))
    variance = float(rest @ rest) / dof if dof > 0 else 0.0
    covariance = inverse @ inverse.T * max(variance, 1.0 if stated else 0.0)
    harmonics = []
    for k, period in enumerate(periods):
        s, c = estimate[2 * k], estimate[2 * k + 1]
        part = covariance[2 * k : 2 * k + 2, 2 * k : 2 * k + 2]
        amplitude = float(np.hypot(s, c))
        along = np.array([s, c]) / amplitude if amplitude > 0.0 else np.array([1.0, 0.0])
        across = np.array([-along[1], along[0]])
        sigma = float(np.sqrt(along @ part @ along))
        turn = float(np.sqrt(across @ part @ across))
        phase = min(turn / amplitude, np.pi) if amplitude > 0.0 else np.pi
        name = lines[0].component
        harmonics.append(Harmonic(name, period, amplitude, float(np.arctan2(c, s)), sigma, float(phase)))
    return tuple(harmonics)


def _means(line: Line) -> tuple[Array, Array]:
    """(m,) targets and (m,) means of both directions there."""
    target, place = targets_of(line.target_mm)
    sides = []
    for d in (1, -1):
        rows = line.direction == d
        if rows.any():
            count = np.bincount(place[rows], minlength=len(target))
            total = np.bincount(place[rows], line.value[rows], minlength=len(target))
            with np.errstate(invalid="ignore"):
                sides.append(total / count)
    mean = np.nanmean(sides, axis=0)
    return target, np.asarray(mean)


def _distinct(targets_mm: npt.ArrayLike) -> Array:
    x = np.unique(np.round(np.asarray(targets_mm, float), 6))
    if len(x) < 1 or not np.isfinite(x).all():
        raise ConfigError("targets: expected finite axis positions in mm")
    return x


def _pair(x: Array, period: float) -> Array:
    turn = 2.0 * np.pi * x / period
    return np.column_stack((np.sin(turn), np.cos(turn)))


def _smooth_columns(x: Array, period: float) -> Array:
    """(n, k) a constant, a slope, and half-waves no shorter than a smooth curve may have at such targets."""
    length = float(np.ptp(x))
    if len(x) < 2 or length == 0.0:
        return np.ones((len(x), 1))
    shortest = max(_STEPS * length / (len(x) - 1), _PERIODS * period)
    waves = min(int(2.0 * length / shortest), _WAVES)
    u = (x - x.min()) / length
    return np.column_stack(
        [np.ones(len(x)), 2.0 * u - 1.0, *(np.cos(np.pi * k * u) for k in range(1, waves + 1))]
    )


def _block_diagonal(parts: Sequence[Array]) -> Array:
    matrix = np.zeros((sum(len(p) for p in parts), sum(p.shape[1] for p in parts)))
    row = column = 0
    for part in parts:
        matrix[row : row + len(part), column : column + part.shape[1]] = part
        row, column = row + len(part), column + part.shape[1]
    return matrix


def _projected(columns: Array, values: Array) -> Array:
    return np.asarray(columns @ np.linalg.lstsq(columns, values, rcond=1e-10)[0])


def _reason(x: Array, period: float) -> str:
    """In words, what these targets do to an error of this period."""
    remedy = "move each target by a random part of the period, or add a fine sweep over two periods"
    if len(x) < 5:
        return f"it cannot be separated from a curve at {len(x)} targets; {remedy}"
    step = np.diff(x)
    turns = float(np.median(step)) / period
    halves = round(2.0 * turns)
    if halves >= 1 and np.ptp(step) < 0.02 * step.mean() + 1e-6 and abs(2.0 * turns - halves) < _NEAR:
        times = f"{halves // 2}" if halves % 2 == 0 else f"{halves / 2:.1f}"
        exact = abs(2.0 * turns - halves) < 1e-6
        return (
            f"the targets step by {np.median(step):g} mm, {'' if exact else 'nearly '}{times} times the "
            f"period, so all are at {'one phase' if halves % 2 == 0 else 'two phases'} of it; {remedy}"
        )
    return f"at these targets it looks like a smooth curve or like zero; {remedy}"
