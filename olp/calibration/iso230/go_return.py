"""Reversal from readings approached from both sides: the paper's test B (go and return), and the reversal
part of any bidirectional line.

B_i = x_up - x_down as in ISO 230-2. An axis with backlash b lags its command by b/2 on both sides, so its B
is -b.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from olp.calibration.iso230.positioning import scale_of, targets_of
from olp.calibration.observations.lines import Line
from olp.core.arrays import Array, Index
from olp.core.errors import ConfigError, UsageError
from olp.core.machine import Machine
from olp.core.units import AXES, UM_PER_MM
from olp.core.values import dataclass
from olp.findings.catalogue import Finding

#: A reversal depends on position where chance explains the differences with less than this probability.
UNLIKELY = 0.01
#: The scatter between runs is known from so many runs on.
_RUNS = 3
#: Courses along the axis that are tested, at most.
_COURSES = 4
#: An estimate so many standard uncertainties from zero is significant.
_SIGNIFICANT = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Reversal:
    """B at each target (m,) with its standard uncertainty, and of the line, in mm or rad.

    `constant` says that one number holds for the whole line, within the noise of the readings (`chance`:
    how likely such differences are then). `noise` is the standard deviation of one reading, `drift`
    the range of the drift that was removed.
    """

    line: Line
    target_mm: Array
    at: Array
    sigma_at: Array
    mean: float
    sigma: float
    constant: bool
    chance: float
    noise: float
    drift: float

    @property
    def backlash(self) -> float:
        """The backlash of the axis, for a positioning line; mm."""
        return 0.0 - self.mean

    def as_dict(self) -> dict[str, Any]:
        unit, scale = scale_of(self.line)
        report: dict[str, Any] = {
            "component": self.line.component,
            "file": self.line.source,
            f"reversal_{unit}": self.mean * scale,
            f"sigma_{unit}": self.sigma * scale,
            f"noise_{unit}": self.noise * scale,
            f"drift_{unit}": self.drift * scale,
            "constant": self.constant,
            "chance": self.chance,
            "targets": {
                "target_mm": self.target_mm.tolist(),
                f"reversal_{unit}": (self.at * scale).tolist(),
                f"sigma_{unit}": (self.sigma_at * scale).tolist(),
            },
        }
        if self.line.quantity == "positioning":
            report["lost_motion_um"] = self.backlash * UM_PER_MM
        return report


def reversal_of(line: Line, *, drift: bool = True) -> Reversal:
    """The reversal of a line whose targets were approached from both sides, least squares.

    With `drift` the readings count as equally spaced in time, and a continuous drift, straight within each
    run, is removed; without it the order of the rows does not matter. Raises ConfigError.
    """
    target, place = targets_of(line.target_mm)
    side = place * 2 + (line.direction < 0)
    lacking = np.flatnonzero(np.bincount(side, minlength=2 * len(target)) == 0)
    if len(lacking):
        raise ConfigError(
            f"line {line.component}: {target[lacking[0] // 2]:g} mm was never approached in "
            f"{'-' if lacking[0] % 2 else '+'}; expected every target approached from both sides; leave it "
            "out, or measure it again",
            file=line.source,
        )
    n, m = len(line.value), len(target)
    extra = _drift_columns(line.run) if drift else np.zeros((n, 0))
    # a mean for each target and side, or a mean for each target and one reversal: both are removed first
    drift_estimate, cofactor, rest, dof = _within(side, extra, line.value)
    single, spread, rest_one, dof_one = _within(
        place, np.column_stack((0.5 * line.direction, extra)), line.value
    )
    noise = float(np.sqrt(rest / dof)) if dof > 0 else line.sigma
    if noise == 0.0 and line.sigma == 0.0 and dof <= 0:
        raise ConfigError(
            f"line {line.component}: one reading of each target from each side and no sigma; expected "
            "repeated runs, or the standard uncertainty of a reading",
            file=line.source,
        )
    noise = max(noise, line.sigma)
    chance = 1.0
    if m > 1 and dof > 0:
        chance = _chance(rest_one - rest, dof_one - dof, rest, dof, float(np.abs(line.value).max()))
    wander = extra @ drift_estimate
    sigma = float(noise * np.sqrt(spread[0, 0]))
    between = _between_runs(line, place, line.value - wander) if m > 1 else None
    if between is not None:
        # a drift that is not straight within a run is no white noise: its effect shows between runs
        chance, scatter = between
        sigma = max(sigma, scatter)
    count = np.bincount(side, minlength=2 * m)
    level = np.bincount(side, line.value - wander) / count
    slope = np.column_stack(
        [np.bincount(side, column) / count for column in extra.T] or [np.zeros((2 * m, 0))]
    )
    reversal, lean = level[::2] - level[1::2], slope[::2] - slope[1::2]
    own = 1.0 / count[::2] + 1.0 / count[1::2]
    sigma_at = noise * np.sqrt(own + np.einsum("ik,kl,il->i", lean, cofactor, lean))
    constant = chance >= UNLIKELY
    mean = float(single[0]) if constant else float(reversal.mean())
    return Reversal(
        line, target, reversal, sigma_at, mean, sigma, constant, chance, noise,
        float(np.ptp(wander)) if len(wander) else 0.0,
    )  # fmt: skip


def _between_runs(line: Line, place: Index, value: Array) -> tuple[float, float] | None:
    """The probability that the runs' reversals show such a course along the axis by chance, and the standard
    uncertainty of their mean. Both follow from the differences between runs (t test of the first cosines
    along the targets, Bonferroni). None for fewer than three runs, or where a run lacks a target."""
    runs, row = np.unique(line.run, return_inverse=True)
    m = int(place.max()) + 1
    total, count = np.zeros((len(runs), m, 2)), np.zeros((len(runs), m, 2))
    side = (line.direction < 0).astype(int)
    np.add.at(total, (row, place, side), value)
    np.add.at(count, (row, place, side), 1.0)
    if len(runs) < _RUNS or (count == 0.0).any():
        return None
    mean = total / count
    reversal = mean[:, :, 0] - mean[:, :, 1]
    courses = min(_COURSES, m - 1)
    cosines = np.cos(np.pi * np.outer((np.arange(m) + 0.5) / m, np.arange(courses + 1)))
    part = reversal @ (cosines / (cosines**2).sum(axis=0))
    spread = part.std(axis=0, ddof=1) / np.sqrt(len(runs))
    floor = 1e-12 * max(float(np.abs(value).max()), 1e-12)
    from scipy.special import stdtr

    t = np.abs(part.mean(axis=0)) / np.maximum(spread, floor)
    t[np.abs(part.mean(axis=0)) < floor] = 0.0
    least = float(2.0 * stdtr(len(runs) - 1, -t[1:]).min())
    return min(1.0, courses * least), float(spread[0])


def _drift_columns(run: Index) -> Array:
    """(n, k) hat functions over the rows with a knot where each run begins, the first left out: a drift
    counts from its start."""
    starts = np.flatnonzero(np.diff(run, prepend=run[0] - 1) != 0)
    if len(starts) < 2:
        return np.zeros((len(run), 0))
    knots = np.append(starts, len(run) - 1).astype(float)
    rows = np.arange(len(run), dtype=float)
    hats = np.eye(len(knots))
    return np.column_stack([np.interp(rows, knots, hat) for hat in hats[1:]])


def _within(group: Index, columns: Array, value: Array) -> tuple[Array, Array, float, int]:
    """Least squares of value (n,) on columns (n, k) beside one mean per group (n,): (k,) estimates of
    least norm, (k, k) cofactors, residual sum of squares and its degrees of freedom."""
    count = np.bincount(group)

    def free(one: Array) -> Array:
        return np.asarray(one - (np.bincount(group, one) / count)[group])

    design = np.column_stack([free(column) for column in columns.T] or [np.zeros((len(value), 0))])
    inverse = np.linalg.pinv(design, rcond=1e-10)
    estimate = inverse @ free(value)
    rest = free(value) - design @ estimate
    rank = round(float(np.einsum("ij,ji->", design, inverse)))
    return (
        estimate,
        np.asarray(inverse @ inverse.T),
        float(rest @ rest),
        len(value) - int((count > 0).sum()) - rank,
    )


def _chance(more: float, more_dof: int, rest: float, dof: int, size: float) -> float:
    """The probability that `more_dof` added parameters reduce the residual so much by chance (F test)."""
    floor = dof * (1e-12 * size) ** 2
    if more_dof <= 0 or more <= floor:
        return 1.0
    from scipy.special import fdtrc

    return float(fdtrc(more_dof, dof, (more / more_dof) / (max(rest, floor) / dof)))


def findings_of(reversal: Reversal) -> Iterator[Finding]:
    """A reversal that depends on position, and one whose sign is not that of backlash."""
    unit, scale = scale_of(reversal.line)
    name = reversal.line.component
    if not reversal.constant:
        low, high = reversal.at.min() * scale, reversal.at.max() * scale
        yield Finding("OLP854", f"{name}: B from {low:.2f} to {high:.2f} {unit} along the axis")
    if reversal.line.quantity == "positioning" and reversal.mean > _SIGNIFICANT * reversal.sigma:
        value, sigma = reversal.mean * scale, reversal.sigma * scale
        yield Finding("OLP855", f"{name}: B = +{value:.2f} {unit}, standard uncertainty {sigma:.2f}")


def backlash_toml(reversals: Sequence[Reversal]) -> str:
    """A table [backlash] for calibration.toml; an axis whose reversal depends on position is a comment."""
    lines = ["[backlash]"]
    for reversal in reversals:
        axis = AXES[reversal.line.axis]
        b, sigma = reversal.backlash * UM_PER_MM, reversal.sigma * UM_PER_MM
        if reversal.constant:
            lines.append(f"{axis}_um = {b:.3f}  # standard uncertainty {sigma:.3f} um")
        else:
            low, high = np.sort(-reversal.at[[reversal.at.argmax(), reversal.at.argmin()]]) * UM_PER_MM
            lines.append(
                f"# {axis}: {low:.3f} to {high:.3f} um along the axis; needs a direction column, "
                "olp calibrate fit"
            )
    return "\n".join(lines) + "\n"


def program(
    machine: Machine, axis: str, targets_mm: Sequence[float], *, over_mm: float, feed_mm_min: float,
    runs: int = 5, dwell_s: float = 2.0,
) -> str:  # fmt: skip
    """RS-274 text that goes to each target from below and from above, in axis positions (G53): first
    `over_mm` away from it, then to it. You read the instrument in each dwell. Raises UsageError
    where it leaves the travel."""
    if axis not in machine.axes:
        raise UsageError(f"axis {axis!r}; expected X, Y or Z")
    if over_mm <= 0.0 or feed_mm_min <= 0.0 or runs < 1 or dwell_s < 0.0 or not len(targets_mm):
        raise UsageError("expected targets; and a distance past them, a feed and runs above zero")
    low, high = machine.axes[axis].travel_mm
    x = sorted(targets_mm)
    if x[0] - over_mm < low or x[-1] + over_mm > high:
        raise UsageError(
            f"targets from {x[0]:g} to {x[-1]:g} mm and {over_mm:g} mm past them leave the travel of {axis}, "
            f"{low:g} to {high:g} mm; choose targets further inside"
        )
    step = machine.axes[axis].least_increment_mm
    lines = [
        f"(go and return on {axis}: {len(x)} targets, {runs} runs, {over_mm:g} mm past each)",
        "(the other axes keep their positions; read the instrument in each dwell)",
        "G21 G90 G94 G61",
    ]

    def to(position: float) -> str:
        return f"G53 G1 {axis}{round(position / step) * step:.6f} F{feed_mm_min:g}"

    for run in range(1, runs + 1):
        for direction, order in ((1, x), (-1, x[::-1])):
            for target in order:
                lines += [
                    f"(run {run} target {target:g} direction {direction})",
                    to(target - direction * over_mm), to(target), f"G4 P{dwell_s:g}",
                ]  # fmt: skip
    return "\n".join([*lines, "M2"]) + "\n"
