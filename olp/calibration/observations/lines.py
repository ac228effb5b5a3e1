"""Lines and squares as rows of the adjustment.

The zero of a line is not known, nor is the slope of a straightness, which contains that of its reference. Two
lines that were read against the legs of one square share one such slope and the square's own error. A
laser's wavelength scales a positioning line. All readings of a line drift together: a continuous function
of time, linear during each run.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from typing import Any, ClassVar, Literal

import numpy as np

from olp.calibration.estimator.normal import Block, Chunk
from olp.calibration.estimator.parameters import CROSS, SHEAR, Parameters, gathered
from olp.calibration.observations.base import (
    OUTLIER,
    OWN_SCALE,
    SHARE,
    Alternative,
    Noise,
    Observation,
    Outlier,
    Screened,
    State,
    rms,
    scatter_words,
    unit_of,
)
from olp.calibration.observations.references import form_columns, sense_of, square_names
from olp.calibration.observations.sensors import own_columns, per_kelvin
from olp.core.arrays import Array, Index
from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, ZERO, Vector
from olp.core.units import AXES
from olp.core.values import dataclass

Reference = Literal["functional-point", "table"]
#: Targets this close are one.
SAME_MM = 0.05
#: No instrument reads better than this (mm, rad): 10 nm, 10 nrad.
LEAST = 1e-5, 1e-8
#: urad per second of arc.
ARCSEC_URAD = math.pi / 0.648
#: Standard deviation of a place or lever arm that may be another one, mm.
OWN_LEVER_MM = 500.0
#: By how much axes at rest tilt a line at another place, as a standard deviation, rad.
_OWN_TILT = 2e-5
_DOUBLE = (
    ("factor 2", 2.0, "its values are half of what they should be"),
    ("factor 2", 0.5, "its values are twice what they should be"),
)
#: The sign of all values: kind, factor that puts it right, and words.
REVERSED = ("sign", -1.0, "the sign of its values is reversed")
#: What else the unit of lengths, and of angles, may be: the factor that puts it right, and words.
UNITS = (
    (
        ("unit", 25.4, "its values are in thousandths of an inch, taken as 0.001 mm"),
        ("unit", 1 / 25.4, "its values are in 0.001 mm, taken as thousandths of an inch"),
        ("unit", 1e3, "its values are in mm, taken as um"),
        ("unit", 1e-3, "its values are in nm, taken as um"),
        *_DOUBLE,
    ),
    (
        ("unit", ARCSEC_URAD, "its values are in arcsec, taken as urad"),
        ("unit", 1 / ARCSEC_URAD, "its values are in urad, taken as arcsec"),
        ("unit", 1e3, "its values are in mm/m, taken as um/m"),
        ("unit", 1e-3, "its values are in um/m, taken as mm/m"),
        *_DOUBLE,
    ),
)
#: Drift of an instrument over a run, assumed where there is one run only (mm, rad): 2 um, 2 urad.
DRIFT = 2e-3, 2e-6
#: How much larger the drift of an instrument beside sensors may be.
_LARGE_DRIFT = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Line(Observation):
    """One component error read at targets along one axis, rows in the order of time.

    `component` is an ISO 230-1 name such as EXX (positioning), EYX (straightness) or EBX (angle); the moving
    axis is its last letter. `target_mm` (n,) axis positions, `value` (n,) in mm or rad, `run` (n,) from 1,
    `direction` (n,) +1 or -1: from which side the target was approached. `line_mm` holds the positions of
    the other axes (the own entry is ignored) and `tool_mm` the tool vector to the reflector; with `reference`
    "table" the reflector was fixed on a moving table. The zero of the values is arbitrary, so is the slope of
    a straightness. Straightness lines that name the same `square` were read against its two legs, those that
    name a `straightedge` against that, at one place of it along the axis; `turned` where it was turned over.
    `sigma` is the standard uncertainty of one reading (mm or rad), `sigma_scale` that of the scale of
    all readings of a line (mm/mm, a laser's wavelength). A sigma of 0 means not known: it then follows from
    the spread of the runs. `source` is the file and `row` (n,) the line of each reading in it.
    `sensors_degC` (n,) are the temperatures of the structure at each reading, by the name of the sensor.
    `sigma_lever_mm` is the standard uncertainty of its place and lever arm. Raises ConfigError.
    """

    read_columns: ClassVar[tuple[str, ...]] = ("target_mm", "value")

    component: str
    target_mm: Array
    value: Array
    run: Index
    direction: Index
    line_mm: Vector
    tool_mm: Vector = ZERO
    reference: Reference = "functional-point"
    square: str | None = None
    sigma: float = 0.0
    sigma_scale: float = 0.0
    source: str = ""
    row: Index = field(default_factory=lambda: np.zeros(0, np.int64))
    instrument: str = ""
    straightedge: str | None = None
    turned: bool = False
    sensors_degC: Mapping[str, Array] = field(default_factory=dict)
    sigma_lever_mm: float = 0.0

    def __post_init__(self) -> None:
        if not len(self.row):
            object.__setattr__(self, "row", np.arange(1, len(self.target_mm) + 1))
        for name, kind in (
            ("target_mm", float),
            ("value", float),
            ("run", np.int64),
            ("direction", np.int64),
            ("row", np.int64),
        ):
            column = np.array(getattr(self, name), dtype=kind)
            column.flags.writeable = False
            object.__setattr__(self, name, column)
        label = f"line {self.component}"
        n = len(self.target_mm)
        if self.component not in COMPONENTS:
            raise ConfigError(
                f"{label}: expected an ISO 230-1 name such as EXX, EYX or EBX", file=self.source
            )
        if n < 2 or any(len(c) != n for c in (self.value, self.run, self.direction, self.row)):
            raise ConfigError(
                f"{label}: {n} readings; expected at least 2, each with all columns", file=self.source
            )
        if not (np.isfinite(self.target_mm).all() and np.isfinite(self.value).all()):
            raise ConfigError(f"{label}: a reading is not finite; leave the row out", file=self.source)
        if not np.isin(self.direction, (-1, 1)).all():
            raise ConfigError(f"{label}: a direction is neither +1 nor -1", file=self.source)
        for name, own in self.sensors_degC.items():
            if np.shape(own) != (n,) or not np.isfinite(own).all():
                raise ConfigError(
                    f"{label}: sensor {name} has no temperature at each reading; leave such rows out",
                    file=self.source,
                )

    @property
    def axis(self) -> int:
        """0, 1, 2 for a line along X, Y, Z."""
        return AXES.index(self.component[2])

    @property
    def quantity(self) -> Literal["positioning", "straightness", "angle"]:
        if self.component[1] in "ABC":
            return "angle"
        return "positioning" if self.component[1] == self.component[2] else "straightness"

    def reach(self, axis: int) -> Array:
        return self.target_mm if axis == self.axis else np.zeros(0)

    def screened(self) -> Screened:
        """Without readings far outside the spread of their repetitions, and the noise of the others. Raises
        ConfigError where neither repetitions nor the line give the noise."""
        return _screened(self)

    def alternatives(self) -> Sequence[Alternative]:
        """Sign, unit, order of the targets, and a scale of its own. The form of a straightedge is known at
        the targets only, so no other order is tried."""
        factors = [REVERSED, *UNITS[self.quantity == "angle"]]
        found = [
            Alternative(
                kind, words, replace(self, value=factor * self.value, sigma=abs(factor) * self.sigma), factor
            )
            for kind, factor, words in factors
        ]
        if self.straightedge is None:
            ends = float(self.target_mm.min() + self.target_mm.max())
            turned = replace(self, target_mm=ends - self.target_mm, direction=-self.direction)
            found.append(Alternative("order", "its targets run the other way", turned))
        if self.quantity == "positioning":
            scaled = replace(self, sigma_scale=math.hypot(self.sigma_scale, OWN_SCALE))
            words = "it has a scale of its own (temperature, expansion, wavelength)"
            found.append(Alternative("scale", words, scaled))
        return [*found, *self._others()]

    def _others(self) -> Iterator[Alternative]:
        """Another component, another place or lever arm, and another reference."""
        mine = AXES if self.component[1] in AXES else "ABC"
        own = (self.component[1], self.component[2] if mine == AXES else "")
        if self.quantity != "positioning" and self.square is None and self.straightedge is None:
            for letter in (letter for letter in mine if letter not in own):
                name = f"E{letter}{self.component[2]}"
                yield Alternative("columns", f"it is {name}", replace(self, component=name), where_off=True)
        if self.quantity != "angle":
            words = "it was read at another place or with another lever arm"
            other = replace(self, sigma_lever_mm=OWN_LEVER_MM)
            yield Alternative("place", words, other, where_off=True)
        if self.quantity == "straightness":
            seen: Reference = "table" if self.reference == "functional-point" else "functional-point"
            words = "its reflector was on the table" if seen == "table" else "its reflector was on the tool"
            other = replace(self, reference=seen)
            yield Alternative("reference", words, other, on_table=self.component[2], where_off=True)

    def start(self, noise: Noise | None = None) -> LineState:
        return LineState(self, noise or noise_of(self))


@dataclass(frozen=True, slots=True, eq=False)
class LineState(State):
    """A line in an adjustment, with the noise of its readings. One row per reading."""

    noun = "lines"
    observation: Line
    noise: Noise

    @property
    def section(self) -> str:
        return "lines_of_angles" if self.observation.quantity == "angle" else "lines_of_lengths"

    @property
    def component(self) -> str:
        return self.observation.component

    @property
    def label(self) -> str:
        return self.observation.source or self.observation.component

    @property
    def count(self) -> int:
        return len(self.observation.value)

    def block(self, parameters: Parameters, theta: Array) -> Block:
        return line_block(self.observation, parameters, self.noise, theta)

    def scatter(self) -> str | None:
        return scatter_words(self.label, self.noise, self.observation.sigma, *unit_of(self.component))

    def row(self, residual: Array, chi_square: float) -> dict[str, Any]:
        unit, scale = unit_of(self.component)
        return {
            "name": self.component,
            "file": self.observation.source,
            "readings": self.count,
            f"sigma_reading_{unit}": self.noise.sigma * scale,
            f"drift_a_run_{unit}": self.noise.drift * scale,
            f"residual_{unit}": rms(residual) * scale,
            "chi_square_per_reading": chi_square / self.count,
        }


def noise_of(line: Line) -> Noise:
    """From the spread of repeated readings and, where there are none, from what the line states.

    Raises ConfigError where both are missing.
    """
    groups = group_of(line)
    n, several = len(line.value), len(np.unique(line.run)) > 1
    ramps = drift_ramps(line)
    spread: float | None = None
    drift, least = 0.0, LEAST[line.quantity == "angle"]
    if several:
        # the mean of each target and direction is removed on both sides, so the ramps describe the drift
        count = int(groups.max()) + 1
        # what temperatures do is not noise
        causes = np.concatenate([ramps, own_columns(line.target_mm, line.sensors_degC)], axis=1)
        own = causes - _means(causes, groups, count)[groups]
        value = line.value - _means(line.value[:, None], groups, count)[groups, 0]
        steps, _, rank, _ = np.linalg.lstsq(own, value, rcond=1e-9)
        free = n - count - int(rank)
        if free >= 3:
            rest = value - own @ steps
            # from the median, so that one slip does not enlarge the noise of all readings
            robust = 1.4826 * float(np.median(np.abs(rest))) * np.sqrt(n / free)
            spread = min(float(np.sqrt(rest @ rest / free)), 1.3 * robust)
            if line.sensors_degC:
                steps = _apart(line, own, value, max(spread, least))
            drift = float(np.sqrt(np.mean(steps[: ramps.shape[1]] ** 2)))
    if spread is None and line.sigma <= 0.0:
        few, runs = ("too few", "more") if several else ("no", "two")
        raise ConfigError(
            f"line {line.component} has {few} repeated readings to show their noise, and states no sigma; "
            f"expected {runs} runs or {'sigma_urad' if line.quantity == 'angle' else 'sigma_um'}",
            file=line.source,
        )
    sigma = max(line.sigma, spread or 0.0, least)
    return Noise(sigma, max(drift, 0.2 * sigma) if several else DRIFT[line.quantity == "angle"], spread)


def _apart(line: Line, causes: Array, value: Array, sigma: float) -> Array:
    """Drift of the instrument and what temperatures do, as far as both differ: where they rise alike, neither
    is larger than usual."""
    angle = line.quantity == "angle"
    warm = per_kelvin(line.component, len(line.sensors_degC))
    usual = np.concatenate([np.full(causes.shape[1] - len(warm), _LARGE_DRIFT * DRIFT[angle]), warm])
    table = causes * usual / sigma
    inner = table.T @ table + np.eye(len(usual))
    return np.asarray(usual * np.linalg.solve(inner, table.T @ value / sigma))


def _means(columns: Array, groups: np.ndarray, count: int) -> Array:
    """(count, k) mean of columns (n, k) in each group."""
    sums = np.stack([np.bincount(groups, column, count) for column in columns.T], axis=1)
    return np.asarray(sums / np.bincount(groups, minlength=count)[:, None])


def group_of(line: Line) -> np.ndarray:
    """(n,) number of the target and direction of each reading."""
    order = np.argsort(line.target_mm, kind="stable")
    target = np.empty(len(order), np.int64)
    target[order] = np.concatenate([[0], np.cumsum(np.diff(line.target_mm[order]) > SAME_MM)])
    _, group = np.unique(2 * target + (line.direction > 0), return_inverse=True)
    return np.asarray(group)


def targets_of(line: Line) -> Array:
    """The targets of a line, ascending, each once."""
    q = np.sort(line.target_mm)
    return np.asarray(q[np.concatenate([[True], np.diff(q) > SAME_MM])])


def drift_ramps(line: Line) -> Array:
    """(n, runs) columns: each rises from 0 to 1 during one run and is 1 after it."""
    index = np.arange(len(line.run), dtype=float)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(line.run)) + 1, [len(line.run)]])
    return np.stack(
        [np.clip((index - a) / max(b - a, 1), 0.0, 1.0) for a, b in itertools.pairwise(starts)],
        axis=1,
    )


def shared_names(line: Line) -> list[str]:
    """The shared nuisances that a line depends on."""
    names = list(square_names(line.square, line.component, line.turned)) if line.square is not None else []
    return names + (list(form_columns(line.straightedge, line.target_mm)) if line.straightedge else [])


def line_block(line: Line, parameters: Parameters, noise: Noise, theta: Array | None = None) -> Block:
    """The readings of one line; where its lever arm is not known, with the angles of `theta`."""
    n, axis = len(line.value), line.axis
    q = line.target_mm
    side = line.direction.astype(float)
    from_datum = q - parameters.datum_mm[axis]
    local = [np.ones(n)]
    precision = [0.0]
    position = np.tile(np.array(line.line_mm), (n, 1))
    position[:, axis] = q
    tool, sensors = np.array(line.tool_mm), line.sensors_degC
    if line.quantity == "angle":
        parts = parameters.curve(line.component, q, side)
        for k, letter in enumerate(AXES):
            # an axis at rest turns with temperature, too
            parts += parameters.warmed(line.component[:2] + letter, position[:, k], sensors)
    else:
        row = AXES.index(line.component[1])
        parts = []
        for other in range(3):
            # an axis at rest still has an angle there, and this tilts the line of an axis that it carries
            own = other == axis
            on_table = own and line.reference == "table"
            where = side if own else None
            parts += parameters.displacement(row, other, position, tool, where, on_table=on_table)
            parts += parameters.distortion(row, other, position, tool, sensors, on_table=on_table)
        if line.quantity == "straightness":
            parts += [
                (parameters.slices[name], sign * from_datum[:, None])
                for name, (i, j, sign) in SHEAR.items()
                if (i, j) == (row, axis)
            ]
            if line.straightedge is not None:
                form = form_columns(line.straightedge, q)
                columns_of_form = sense_of(line.turned) * np.stack(list(form.values()), axis=1)
                parts += [(parameters.slices[name], columns_of_form[:, [k]]) for k, name in enumerate(form)]
            if line.square is None:
                local.append(from_datum / 1000.0)
                precision.append(0.0)
            else:
                # slopes against both legs differ in sign, and add up to the square's error
                pose, error = (parameters.slices[name] for name in shared_names(line))
                first = axis < row
                parts.append((pose, (1.0 if first else -1.0) * from_datum[:, None]))
                if not first:
                    parts.append((error, sense_of(line.turned) * from_datum[:, None]))
        elif line.sigma_scale > 0.0:
            local.append(from_datum)
            precision.append(1.0 / line.sigma_scale**2)
    if line.sigma_lever_mm > 0.0 and theta is not None:
        angles = [f"E{'ABC'[a]}{AXES[axis]}" for i, a, _, _ in CROSS if AXES[i] == line.component[1]]
        for name in angles:
            each = [values @ theta[part] for part, values in parameters.curve(name, q, side)]
            local.append(np.asarray(np.sum(each, axis=0)))
        precision += [1.0 / line.sigma_lever_mm**2] * len(angles)
        if line.square is not None:
            # at another place the axes at rest tilt it: without a square its slope is free anyhow
            local.append(from_datum)
            precision.append(1.0 / _OWN_TILT**2)
    if noise.drift > 0.0:
        ramps = drift_ramps(line)
        local += list(ramps.T)
        precision += [1.0 / noise.drift**2] * ramps.shape[1]
    rows, columns = gathered(parts, n)
    chunk = Chunk(rows, line.value, np.full(n, noise.sigma), np.stack(local, axis=1))
    return Block.of(chunk, columns, np.array(precision), line.source or line.component)


def _screened(line: Line) -> Screened:
    outliers: list[Outlier] = []
    noise = noise_of(line)
    use = np.ones(len(line.value), bool)
    for _ in range(max(1, int(SHARE * len(use)))):
        some = _part(line, use)
        noise = noise_of(some)
        rest = _about_group(some)
        worst = int(np.argmax(np.abs(rest)))
        if abs(rest[worst]) <= OUTLIER * noise.sigma:
            break
        k = int(np.flatnonzero(use)[worst])
        use[k] = False
        off = float(abs(rest[worst]) / noise.sigma)
        outliers.append(Outlier(line.source, int(line.row[k]), line.component, float(line.value[k]), off))
    return Screened(_part(line, use), noise, tuple(outliers))


def _part(line: Line, use: np.ndarray) -> Line:
    if use.all():
        return line
    columns = ("target_mm", "value", "run", "direction", "row")
    sensors = {name: own[use] for name, own in line.sensors_degC.items()}
    kept = {name: getattr(line, name)[use] for name in columns}
    return dataclasses.replace(line, sensors_degC=sensors, **kept)


def _about_group(line: Line) -> Array:
    """(n,) deviation from the others of the same target and direction, with the level of its run removed;
    zero where fewer than three were read."""
    group = group_of(line)
    rest = line.value - _of_temperatures(line, group)
    for _ in range(3):
        for labels in (group, line.run - line.run.min()):
            rest -= _medians(rest, labels)[labels]
    counts = np.bincount(group)[group]
    return np.where(counts >= 3, rest, 0.0)


def _of_temperatures(line: Line, group: np.ndarray) -> Array:
    """(n,) what the temperatures of a line explain of the spread of its repetitions."""
    causes = own_columns(line.target_mm, line.sensors_degC)
    if not causes.shape[1]:
        return np.zeros(len(line.value))
    table = np.column_stack([causes, line.value])
    rest = table - _means(table, group, int(group.max()) + 1)[group]
    return np.asarray(causes @ np.linalg.lstsq(rest[:, :-1], rest[:, -1], rcond=1e-9)[0])


def _medians(values: Array, labels: np.ndarray) -> Array:
    """Median of the values of each label from 0."""
    ordered = values[np.lexsort((values, labels))]
    counts = np.bincount(labels)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    last = len(ordered) - 1
    below, above = starts + np.maximum(counts - 1, 0) // 2, starts + counts // 2
    middle = 0.5 * (ordered[np.minimum(below, last)] + ordered[np.minimum(above, last)])
    return np.asarray(np.where(counts > 0, middle, 0.0))
