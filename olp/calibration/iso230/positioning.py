"""Accuracy and repeatability of positioning after ISO 230-2, of lengths and of angles; straightness of both
directions about one reference line after ISO 230-1.

At target i, the n readings of each direction have the mean x (up, down) and the standard deviation s with
n - 1. Reversal is B_i = x_up - x_down.
Repeatability is R_i = max(2 s_up + 2 s_down + |B_i|, 4 s_up, 4 s_down). Of the axis: E spans all means of
both directions, M the means of the two, A all x + 2 s to x - 2 s, B is the largest |B_i|.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from olp.calibration.observations.lines import Line
from olp.core.arrays import Array, Index
from olp.core.errors import ConfigError
from olp.core.units import RAD_PER_URAD, UM_PER_MM
from olp.core.values import dataclass
from olp.findings.catalogue import Finding

Zone = Literal["least-squares", "minimum-zone"]

#: Positions this close to the next one are one target.
SAME_MM = 0.05
#: Readings of a target from each side that ISO 230-2 asks for.
RUNS = 5
#: Targets per metre that it asks for, of an axis up to LONG_MM.
PER_METRE = 5
#: Targets that it asks for, at least.
TARGETS = 5
#: Largest step between targets that it asks for, of an axis above LONG_MM; mm.
STEP_MM = 250.0
#: Length above which ISO 230-2 counts an axis as long, mm.
LONG_MM = 2000.0
#: Steps between targets that differ by less than this share of their mean are equal.
_EQUAL = 0.01
#: A reading so many usual deviations from its repetitions is reported.
_FAR = 7.0
#: Repetitions that this needs, at least.
_REPEATED = 3
#: Share of the deviations from which the usual one is computed, the smallest ones.
_KEPT = 0.95
#: Readings reported, at most.
_MOST = 10
#: A reference point has drifted where it moved by so many standard deviations of a difference.
_DRIFTED = 5.0
#: A smaller drift than this is none, mm or rad: only rounding.
_LEAST = 1e-7


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One direction of approach, +1 or -1: mean and s of the readings at each target, (m,) in mm or rad."""

    direction: int
    mean: Array
    s: Array

    @property
    def accuracy(self) -> float:
        """A of this direction."""
        return float((self.mean + 2.0 * self.s).max() - (self.mean - 2.0 * self.s).min())

    @property
    def systematic(self) -> float:
        """E of this direction."""
        return float(np.ptp(self.mean))

    @property
    def repeatability_at(self) -> Array:
        """(m,) R_i of this direction."""
        return 4.0 * self.s

    @property
    def repeatability(self) -> float:
        """R of this direction."""
        return float(self.repeatability_at.max())


@dataclass(frozen=True, slots=True, eq=False)
class Statistics:
    """Readings at targets (m,), evaluated; columns in mm or rad. `up` is the approach in +, `down` that in -;
    of readings from one side the other one is None, and so are all figures that need both."""

    target_mm: Array
    runs: int
    up: Side | None
    down: Side | None

    @property
    def sides(self) -> tuple[Side, ...]:
        return tuple(side for side in (self.up, self.down) if side is not None)

    @property
    def mean(self) -> Array:
        """(m,) mean of both directions."""
        return np.asarray(np.mean([side.mean for side in self.sides], axis=0))

    @property
    def reversal_at(self) -> Array | None:
        """(m,) B_i."""
        return None if self.up is None or self.down is None else self.up.mean - self.down.mean

    @property
    def repeatability_at(self) -> Array:
        """(m,) R_i, of both directions where there are two."""
        each = [side.repeatability_at for side in self.sides]
        if self.up is not None and self.down is not None:
            each.append(2.0 * self.up.s + 2.0 * self.down.s + np.abs(self.up.mean - self.down.mean))
        return np.asarray(np.max(each, axis=0))

    def figures(self) -> dict[str, float]:
        """A, E, R, M, B and the mean of B_i of the axis, and A, E, R of each direction; mm or rad."""
        figures: dict[str, float] = {}
        reversal = self.reversal_at
        if reversal is not None:
            means = np.array([side.mean for side in self.sides])
            spread = 2.0 * np.array([side.s for side in self.sides])
            figures["A"] = float((means + spread).max() - (means - spread).min())
            figures["E"] = float(np.ptp(means))
            figures["R"] = float(self.repeatability_at.max())
            figures["M"] = float(np.ptp(self.mean))
            figures["B"] = float(np.abs(reversal).max())
            figures["B_mean"] = float(reversal.mean())
        for name, side in (("up", self.up), ("down", self.down)):
            if side is not None:
                figures[f"A_{name}"] = side.accuracy
                figures[f"E_{name}"] = side.systematic
                figures[f"R_{name}"] = side.repeatability
        return figures


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation(Statistics):
    """A line evaluated. Of a straightness, one reference line with `slope` (rad) was removed from the
    readings of both directions first."""

    line: Line
    slope: float = 0.0

    @property
    def component(self) -> str:
        return self.line.component

    def uncertainties(self) -> dict[str, float]:
        """U_A, U_E, U_R, and with both directions U_M and U_B: the expanded uncertainty (k = 2) of the
        figures; mm or rad.

        It follows from the spread of the readings, at least the stated `sigma` of one, and for positioning
        from that of the scale over the length. The spread itself is known from few runs: that is in A and R.
        """
        s = np.concatenate([side.s for side in self.sides])
        spread = float(np.mean(s**2))
        mean = max(spread, self.line.sigma**2) / self.runs
        of_s = spread / (2.0 * (self.runs - 1))
        scale = (self.line.sigma_scale * float(np.ptp(self.target_mm))) ** 2
        variances = {"A": 2.0 * (mean + 4.0 * of_s) + scale, "E": 2.0 * mean + scale}
        if len(self.sides) == 2:
            variances |= {"R": 8.0 * of_s + 2.0 * mean, "M": mean + scale, "B": 2.0 * mean}
        else:
            variances["R"] = 16.0 * of_s
        return {f"U_{name}": 2.0 * float(np.sqrt(value)) for name, value in variances.items()}

    def as_dict(self) -> dict[str, Any]:
        """Figures and columns for JSON; keys end in um or urad."""
        unit, scale = scale_of(self.line)
        columns: dict[str, Array] = {"mean": self.mean, "R": self.repeatability_at}
        if self.reversal_at is not None:
            columns["B"] = self.reversal_at
        for name, side in (("up", self.up), ("down", self.down)):
            if side is not None:
                columns |= {f"mean_{name}": side.mean, f"s_{name}": side.s}
        figures = self.figures() | self.uncertainties()
        report: dict[str, Any] = {
            "component": self.component,
            "quantity": self.line.quantity,
            "file": self.line.source,
            "runs": self.runs,
            "directions": len(self.sides),
            **{f"{key}_{unit}": value * scale for key, value in figures.items()},
            "targets": {
                "target_mm": self.target_mm.tolist(),
                **{f"{key}_{unit}": (value * scale).tolist() for key, value in columns.items()},
            },
        }
        if self.line.quantity == "straightness":
            report["slope_urad"] = self.slope / RAD_PER_URAD
        return report


def scale_of(line: Line) -> tuple[str, float]:
    """The unit that values of a line are shown in, and the factor from mm or rad."""
    return ("urad", 1.0 / RAD_PER_URAD) if line.quantity == "angle" else ("um", UM_PER_MM)


def evaluate(line: Line, zone: Zone = "least-squares") -> Evaluation:
    """The figures of ISO 230-2 from the readings of a line.

    Every target needs the same number of readings, at least two, from each of its directions; of readings
    from one side there are the unidirectional figures only. `zone` is the kind of the reference line of a
    straightness: least squares, or the one with the least range (ISO 230-1, minimum zone), through the
    means of both directions. Raises ConfigError.
    """
    label = f"line {line.component}"
    checked_runs(line.target_mm, line.direction, label, line.source)
    slope = 0.0
    value = line.value
    if line.quantity == "straightness":
        # runs of both sides weigh the same, so the line through all readings is that of the means
        target, target_of = targets_of(line.target_mm)
        slope, offset = reference_line(target, np.bincount(target_of, value) / np.bincount(target_of), zone)
        value = value - (offset + slope * line.target_mm)
    result = statistics(line.target_mm, value, line.direction, label, line.source)
    return Evaluation(result.target_mm, result.runs, result.up, result.down, line, slope)


def statistics(target_mm: Array, value: Array, direction: Index, label: str, source: str = "") -> Statistics:
    """Means and spreads of readings (n,) at targets (n,). Raises ConfigError as `evaluate` does."""
    runs = checked_runs(target_mm, direction, label, source)
    target, target_of = targets_of(target_mm)
    sides: dict[int, Side] = {}
    for d in (1, -1):
        rows = direction == d
        if rows.any():
            mean = np.bincount(target_of[rows], value[rows]) / runs
            square = np.bincount(target_of[rows], (value[rows] - mean[target_of[rows]]) ** 2)
            sides[d] = Side(d, mean, np.sqrt(square / (runs - 1)))
    return Statistics(target, runs, sides.get(1), sides.get(-1))


def targets_of(target_mm: Array) -> tuple[Array, Index]:
    """(m,) targets, ascending, and (n,) the target of each reading."""
    order = np.argsort(target_mm, kind="stable")
    target_of = np.zeros(len(target_mm), np.int64)
    target_of[order[1:]] = np.cumsum(np.diff(target_mm[order]) > SAME_MM)
    return np.bincount(target_of, target_mm) / np.bincount(target_of), target_of


def checked_runs(target_mm: Array, direction: Index, label: str, source: str) -> int:
    """How many readings each target has from each side. Raises ConfigError where they differ."""
    target, target_of = targets_of(target_mm)
    if len(target) < 2:
        raise ConfigError(f"{label}: one target; expected at least 2, better {TARGETS}", file=source)
    directions = [d for d in (1, -1) if (direction == d).any()]
    count = {d: np.bincount(target_of[direction == d], minlength=len(target)) for d in directions}
    runs = int(max(c.max() for c in count.values()))
    for d, counts in count.items():
        if (counts != runs).any() or runs < 2:
            i = int(np.argmin(counts))
            raise ConfigError(
                f"{label}: {counts[i]} readings at {target[i]:g} mm approached in {'+' if d > 0 else '-'}; "
                f"expected {max(runs, 2)}, as many at every target and from each side, at least 2; leave out "
                "the incomplete run, or the targets that it lacks",
                file=source,
            )
    return runs


def reference_line(x: Array, y: Array, zone: Zone) -> tuple[float, float]:
    """(slope, offset) of the reference line of y over x, both (n,)."""
    middle = x.mean()
    slope = float(((x - middle) * y).sum() / ((x - middle) ** 2).sum())
    if zone == "minimum-zone":
        # the narrowest strip has one side of the convex hull on its edge, so its slope is the slope of a side
        slope = min(_hull_slopes(x, y), key=lambda candidate: float(np.ptp(y - candidate * x)))
        rest = y - slope * x
        return slope, float((rest.max() + rest.min()) / 2.0)
    return slope, float(y.mean() - slope * middle)


def _hull_slopes(x: Array, y: Array) -> Iterator[float]:
    order = np.argsort(x)
    for sign in (1.0, -1.0):
        hull: list[tuple[float, float]] = []
        for px, py in zip(x[order], sign * y[order], strict=True):
            while len(hull) >= 2:
                (ax, ay), (bx, by) = hull[-2:]
                if (bx - ax) * (py - ay) - (by - ay) * (px - ax) > 0.0:
                    break
                hull.pop()
            hull.append((float(px), float(py)))
        yield from (sign * (b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(hull))


def findings_of(evaluation: Evaluation) -> Iterator[Finding]:
    """Where a line has less than ISO 230-2 asks for, where its targets could hide a cyclic error, and
    readings far from their repetitions."""
    line, x = evaluation.line, evaluation.target_mm
    yield from _outliers(line)
    yield from _drift(line)
    length = float(np.ptp(x))
    if length > LONG_MM:
        wanted = int(np.ceil(length / STEP_MM)) + 1
    else:
        wanted = max(TARGETS, int(np.ceil(PER_METRE * length / 1e3)))
    lacks = []
    if evaluation.runs < RUNS:
        lacks.append(f"{evaluation.runs} runs, {RUNS} are asked for")
    if len(x) < wanted:
        lacks.append(f"{len(x)} targets over {length:g} mm, {wanted} are asked for")
    if len(evaluation.sides) < 2:
        lacks.append("readings from one side only, so no bidirectional figures and no reversal")
    if lacks:
        yield Finding("OLP851", f"{_named(line)}: {'; '.join(lacks)}")
    if len(x) > 2 and line.quantity != "straightness":
        step = np.diff(x)
        if np.ptp(step) < _EQUAL * step.mean():
            yield Finding("OLP852", f"{_named(line)}: all {len(x)} targets are {step.mean():g} mm apart")


def _outliers(line: Line) -> Iterator[Finding]:
    """Readings far from their repetitions: the deviation from the median of their target and direction, with
    the level of their run removed, in units of the usual deviation."""
    group = targets_of(line.target_mm)[1] * 2 + (line.direction > 0)
    run = np.unique(line.run, return_inverse=True)[1]
    rest = line.value.copy()
    for label in (group, run, group):
        rest -= _medians(rest, label)[label]
    counts = np.bincount(group)[group]
    size = np.where(counts >= _REPEATED, np.abs(rest), 0.0)
    # the largest twentieth left out, which of normal readings makes it smaller by 0.87
    kept = np.sort(size[counts >= _REPEATED])[: int(_KEPT * (counts >= _REPEATED).sum())]
    usual = float(np.sqrt((kept**2).mean())) / 0.87 if len(kept) else 0.0
    far: list[int] = np.flatnonzero(size > _FAR * usual).tolist() if usual > 0.0 else []
    unit, scale = scale_of(line)
    for k in far[:_MOST]:
        yield Finding(
            "OLP859",
            f"{_named(line)}: the reading at {line.target_mm[k]:g} mm in run {line.run[k]} is "
            f"{rest[k] * scale:+.1f} {unit} off its repetitions",
            int(line.row[k]),
        )


def _drift(line: Line) -> Iterator[Finding]:
    """The target of the first reading in the first run and in the last one, from the same side."""
    group = targets_of(line.target_mm)[1] * 2 + (line.direction > 0)
    rows = np.flatnonzero(group == group[0])
    runs = np.unique(line.run, return_inverse=True)[1]
    if len(rows) < _REPEATED:
        return
    # what drifts is in the level of the runs; the residual of each run is noise
    rest = line.value - (np.bincount(group, line.value) / np.bincount(group))[group]
    level = (np.bincount(runs, rest) / np.bincount(runs))[runs]
    free = len(rest) - len(np.unique(group)) - int(runs.max())
    noise = float(np.sqrt(((rest - level) ** 2).sum() / max(free, 1)))
    moved = float(line.value[rows[-1]] - line.value[rows[0]])
    if abs(moved) > _DRIFTED * max(noise, line.sigma) * np.sqrt(2.0) and abs(moved) > _LEAST:
        unit, scale = scale_of(line)
        yield Finding(
            "OLP860",
            f"{_named(line)}: {line.component[2]} {line.target_mm[0]:g} mm reads {moved * scale:+.2f} {unit} "
            f"in the last run against the first; readings of a run scatter by {noise * scale:.2f} {unit}",
            int(line.row[rows[-1]]),
        )


def _medians(value: Array, label: Index) -> Array:
    """The median of the values (n,) of each label from 0."""
    order = np.lexsort((value, label))
    count = np.bincount(label)
    start = np.cumsum(count) - count
    low, high = start + np.maximum(count - 1, 0) // 2, start + count // 2
    ordered = value[order]
    last = len(ordered) - 1
    return np.asarray((ordered[np.minimum(low, last)] + ordered[np.minimum(high, last)]) / 2.0)


def _named(line: Line) -> str:
    return f"{line.component} ({line.source})" if line.source else line.component
