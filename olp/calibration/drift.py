"""Identifies the indirect thermal model from logs of sensors and of drift.

A reading of component c at position q and time t is modelled as

    sum over sensors i and shapes k of a_cik shape_k(q) (theta_i(t) - reference_i) + offset of its channel

with theta_i the lagged temperature of sensor i. It is linear but for the lags: for given lags the
coefficients follow by least squares (variable projection, G. Golub and V. Pereyra 1973), and the lags are
found one after the other by the residual that is left. The offset of each channel in each log takes up the
zero of its instrument. Held out of a first fit, the last log (or the last quarter of the only one) tells
what the model is worth.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from olp.errormodel.base import Array
from olp.errormodel.structure import SHAPES, Distortion, Sensor, Structure, lagged, shapes
from olp.exceptions import CannotCompute, ConfigError
from olp.findings import Finding
from olp.machine import ZERO, Vector
from olp.units import AXES

Index = npt.NDArray[np.intp]

#: Lags that are tried first, as shares of the length of the longest log; 0 besides.
_LAGS = np.geomspace(2e-3, 0.5, 14)
#: A part may be ahead of its sensor by so much of the log: a sensor that is glued on badly.
_LONGEST_LEAD = 0.05
_ROUNDS = 4
#: Longer logs are thinned: half a minute on a day.
_MOST_ROWS = 3000
_REFINED = 12
#: What is held out of the only log.
_HELD_OUT = 0.25
#: Sensors whose histories are so nearly combinations of one another tell nothing apart.
MOST_CONDITION = 1e3
#: A share of the axis that positions should reach over.
_COVERED = 0.7
#: More than this share of the drift left where it was not fitted is poor.
_POOR = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class DriftLog:
    """One log: (n,) `time_s` ascending, sensors (n,) in degC by name, and readings by (component, position in
    mm), (n,) in mm or rad with NaN where nothing was read. `line_mm` and `tool_mm` as of a curve."""

    time_s: Array
    sensors_degC: Mapping[str, Array]
    readings: Mapping[tuple[str, float], Array]
    line_mm: Vector | None = None
    tool_mm: Vector = ZERO
    name: str = "log"


@dataclass(frozen=True, slots=True)
class ComponentFit:
    """How well one component is described, rms in mm or rad: of the drift (each channel about its mean), of
    what the model leaves, and both in what was held out (NaN where nothing of it was). `covered` is the
    share of the span that its positions reach over, `shapes` the shapes that they can tell."""

    component: str
    shapes: tuple[str, ...]
    positions: int
    readings: int
    drift_rms: float
    residual_rms: float
    held_out_drift_rms: float
    held_out_rms: float
    covered: float


@dataclass(frozen=True, slots=True, eq=False)
class ThermalFit:
    """The identified structure; `condition` of the sensors' histories, scaled to the same size; the standard
    uncertainty of each coefficient beside it, as in `structure.distortions` (offset, growth, bow)."""

    structure: Structure
    condition: float
    components: tuple[ComponentFit, ...]
    sigma: tuple[tuple[float, float, float], ...]
    held_out: str

    @property
    def removed(self) -> float:
        """Share of the drift that the model removes where it was not fitted, over all components, each scaled
        by its own drift; NaN where nothing was held out."""
        left = [c.held_out_rms / c.held_out_drift_rms for c in self.components if c.held_out_drift_rms > 0.0]
        return 1.0 - float(np.sqrt(np.mean(np.square(left)))) if left else float("nan")


def identify(
    logs: Sequence[DriftLog],
    box_mm: Array,
    reference_degC: float | Mapping[str, float],
    *,
    sensors: Sequence[str] = (),
) -> ThermalFit:
    """The structure of logs with readings, over `box_mm` (3, 2). `reference_degC` is the temperature at
    which the machine was calibrated, of all sensors or by name; `sensors` chooses some of them.

    Raises ConfigError for logs that do not fit together and CannotCompute where they do not tell enough.
    """
    names = _names(logs, sensors)
    logs = [_thinned(log) for log in logs]
    reference = {
        n: float(reference_degC[n] if isinstance(reference_degC, Mapping) else reference_degC) for n in names
    }
    problem = _Problem.of(logs, names, reference, box_mm)
    training, held_out = problem.parts()
    held: dict[str, tuple[float, float]] = {}
    what = "nothing"
    if held_out is not None:
        lags = problem.lags(training)
        held = problem.judge(lags, training, held_out)
        what = problem.held_out_name()
    lags = problem.lags(None)
    return problem.result(lags, held, what)


def _names(logs: Sequence[DriftLog], chosen: Sequence[str]) -> list[str]:
    if not logs:
        raise ConfigError("no log is given; expected one or more")
    names = list(logs[0].sensors_degC)
    for log in logs[1:]:
        if set(log.sensors_degC) != set(names):
            raise ConfigError(
                f"{log.name} has the sensors {', '.join(log.sensors_degC)}, and {logs[0].name} has "
                f"{', '.join(names)}; expected the same in all"
            )
    unknown = [name for name in chosen if name not in names]
    if unknown:
        raise ConfigError(f"{unknown[0]} is no sensor of the logs; expected some of {', '.join(names)}")
    if not any(log.readings for log in logs):
        raise ConfigError("no log holds readings of drift; expected columns such as EXX@500_um")
    return list(chosen) or names


def _thinned(log: DriftLog) -> DriftLog:
    """A log of no more than _MOST_ROWS rows: means of what was read in equal spans of time."""
    if len(log.time_s) <= _MOST_ROWS:
        return log
    edges = np.linspace(log.time_s[0], log.time_s[-1], _MOST_ROWS + 1)
    place = np.clip(np.searchsorted(edges, log.time_s, side="right") - 1, 0, _MOST_ROWS - 1)

    def mean(values: Array) -> Array:
        known = np.isfinite(values)
        count = np.bincount(place[known], minlength=_MOST_ROWS)
        total = np.bincount(place[known], values[known], _MOST_ROWS)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    time = mean(log.time_s)
    kept = np.isfinite(time)
    return replace(
        log,
        time_s=time[kept],
        sensors_degC={name: mean(values)[kept] for name, values in log.sensors_degC.items()},
        readings={key: mean(values)[kept] for key, values in log.readings.items()},
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Channel:
    """Readings (m,) of one component at one position in one log, at rows (m,) of it."""

    log: int
    component: str
    position_mm: float
    row: Index
    value: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    logs: tuple[DriftLog, ...]
    names: tuple[str, ...]
    reference: Mapping[str, float]
    box_mm: Array
    channels: tuple[_Channel, ...]
    _known: dict[tuple[int, str, float], Array] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(
        cls, logs: Sequence[DriftLog], names: Sequence[str], reference: Mapping[str, float], box_mm: Array
    ) -> _Problem:
        channels = []
        for number, log in enumerate(logs):
            for (component, position), values in log.readings.items():
                rows = np.flatnonzero(np.isfinite(values))
                if len(rows) >= 2:
                    channels.append(_Channel(number, component, position, rows, values[rows]))
        lines = {(log.line_mm, log.tool_mm) for log in logs}
        if len(lines) > 1:
            raise ConfigError(
                "the logs were measured on different lines or with different tools; expected the same "
                "line_mm and "
                "tool_mm in all, or a fit for each"
            )
        if not channels:
            raise CannotCompute("no channel of drift has two readings or more")
        return cls(tuple(logs), tuple(names), reference, box_mm, tuple(channels))

    # -- parts -------------------------------------------------------------------------------------

    def _last_log(self) -> int:
        return max(c.log for c in self.channels)

    def parts(self) -> tuple[list[_Channel], list[_Channel] | None]:
        """What a first fit may see, and what not: the last log, or the last quarter of the only one."""
        used = sorted({c.log for c in self.channels})
        if len(used) > 1:
            return (
                [c for c in self.channels if c.log != used[-1]],
                [c for c in self.channels if c.log == used[-1]],
            )
        time = self.logs[used[0]].time_s
        cut = time[0] + (1.0 - _HELD_OUT) * (time[-1] - time[0])
        before: list[_Channel] = []
        after: list[_Channel] = []
        for c in self.channels:
            early = time[c.row] <= cut
            for pick, out in ((early, before), (~early, after)):
                if pick.sum() >= 2:
                    out.append(_Channel(c.log, c.component, c.position_mm, c.row[pick], c.value[pick]))
        return before, after or None

    def held_out_name(self) -> str:
        used = sorted({c.log for c in self.channels})
        return self.logs[used[-1]].name if len(used) > 1 else f"the last {_HELD_OUT:.0%} of the log"

    # -- the linear part ---------------------------------------------------------------------------

    def rises(self, lags: Mapping[str, float]) -> list[Array]:
        """(n, sensors) structure temperature above the reference, by log."""
        return [
            np.stack([self._rise(number, name, lags[name]) for name in self.names], axis=1)
            for number in range(len(self.logs))
        ]

    def _rise(self, number: int, name: str, lag_s: float) -> Array:
        key = (number, name, lag_s)
        if key not in self._known:
            log = self.logs[number]
            self._known[key] = lagged(log.time_s, log.sensors_degC[name], lag_s) - self.reference[name]
        return self._known[key]

    def span(self, component: str) -> tuple[float, float]:
        low, high = self.box_mm[AXES.index(component[2])]
        at = [c.position_mm for c in self.channels if c.component == component]
        return min(float(low), *at), max(float(high), *at)

    def count(self, component: str) -> int:
        """How many shapes the positions of a component can tell apart."""
        return min(len({c.position_mm for c in self.channels if c.component == component}), len(SHAPES))

    def design(
        self, component: str, channels: Sequence[_Channel], rises: Sequence[Array]
    ) -> tuple[Array, Array]:
        """Columns (m, shapes x sensors) and values (m,), each channel about its own mean."""
        blocks, values = [], []
        for c in channels:
            if c.component != component:
                continue
            form = shapes(self.span(component), np.array([c.position_mm]))[0, : self.count(component)]
            block = np.einsum("k,ms->mks", form, rises[c.log][c.row])
            flat = block.reshape(len(c.row), -1)
            blocks.append(flat - flat.mean(axis=0))
            values.append(c.value - c.value.mean())
        if not blocks:
            return np.zeros((0, self.count(component) * len(self.names))), np.zeros(0)
        return np.concatenate(blocks), np.concatenate(values)

    @property
    def components(self) -> list[str]:
        return sorted({c.component for c in self.channels})

    @staticmethod
    def solve(columns: Array, values: Array) -> Array:
        size = np.sqrt((columns**2).sum(axis=0))
        size[size == 0.0] = 1.0
        return np.asarray(np.linalg.lstsq(columns / size, values, rcond=1e-10)[0] / size)

    def cost(self, lags: Mapping[str, float], channels: Sequence[_Channel]) -> float:
        """Half of minus the log likelihood with the noise of each component unknown, up to a constant."""
        rises = self.rises(lags)
        total = 0.0
        for component in self.components:
            columns, values = self.design(component, channels, rises)
            if len(values) > columns.shape[1]:
                rest = values - columns @ self.solve(columns, values)
                total += 0.5 * len(values) * float(np.log(max(float(rest @ rest), 1e-300)))
        return total

    def lags(self, channels: Sequence[_Channel] | None) -> dict[str, float]:
        """The lag of each sensor, one after the other until none changes."""
        channels = self.channels if channels is None else channels
        longest = max(float(log.time_s[-1] - log.time_s[0]) for log in self.logs)
        leads = longest * _LAGS[_LAGS <= _LONGEST_LEAD]
        tried = [*(-leads[::-1]).tolist(), 0.0, *(longest * _LAGS).tolist()]
        lags = dict.fromkeys(self.names, 0.0)
        best = self.cost(lags, channels)
        for _ in range(_ROUNDS):
            before = dict(lags)
            for name in self.names:
                costs = [self.cost(lags | {name: lag}, channels) for lag in tried]
                k = int(np.argmin(costs))
                low, high = tried[max(k - 1, 0)], tried[min(k + 1, len(tried) - 1)]
                lag, cost = self._between(name, lags, low, high, channels)
                if cost < best - 1e-9:
                    lags[name], best = lag, cost
            if all(
                abs(lags[n] - before[n]) <= 0.01 * max(abs(before[n]), 1e-3 * longest) for n in self.names
            ):
                break
        return lags

    def _between(
        self, name: str, lags: Mapping[str, float], low: float, high: float, channels: Sequence[_Channel]
    ) -> tuple[float, float]:
        """The best lag in an interval, by golden section."""
        share = 0.5 * (5.0**0.5 - 1.0)
        inner = [high - share * (high - low), low + share * (high - low)]
        costs = [self.cost({**lags, name: lag}, channels) for lag in inner]
        for _ in range(_REFINED):
            if costs[0] <= costs[1]:
                high, inner[1], costs[1] = inner[1], inner[0], costs[0]
                inner[0] = high - share * (high - low)
                costs[0] = self.cost({**lags, name: inner[0]}, channels)
            else:
                low, inner[0], costs[0] = inner[0], inner[1], costs[1]
                inner[1] = low + share * (high - low)
                costs[1] = self.cost({**lags, name: inner[1]}, channels)
        k = int(np.argmin(costs))
        return inner[k], costs[k]

    # -- what came of it ---------------------------------------------------------------------------

    def judge(
        self, lags: Mapping[str, float], training: Sequence[_Channel], held_out: Sequence[_Channel]
    ) -> dict[str, tuple[float, float]]:
        """rms of the drift and of what is left of it, of each component where it was not fitted."""
        rises = self.rises(lags)
        out = {}
        for component in self.components:
            columns, values = self.design(component, training, rises)
            unseen, drift = self.design(component, held_out, rises)
            if len(values) > columns.shape[1] and len(drift):
                left = drift - unseen @ self.solve(columns, values)
                out[component] = (_rms(drift), _rms(left))
        return out

    def condition(self, rises: Sequence[Array]) -> float:
        """Of the sensors' histories, each about its mean in each log and scaled to the same size."""
        used = sorted({c.log for c in self.channels})
        history = np.concatenate([rises[i] - rises[i].mean(axis=0) for i in used])
        size = np.sqrt((history**2).sum(axis=0))
        still = [
            n for n, s in zip(self.names, size.tolist(), strict=True) if s <= 1e-9 * max(size.max(), 1.0)
        ]
        if still:
            raise CannotCompute(
                f"the temperature of sensor {still[0]} does not change in the logs, so nothing can be "
                f"told of it; "
                "log it while it changes, or leave it out with --sensor"
            )
        return float(np.linalg.cond(history / size))

    def result(
        self, lags: Mapping[str, float], held: Mapping[str, tuple[float, float]], what: str
    ) -> ThermalFit:
        rises = self.rises(lags)
        condition = self.condition(rises)
        if condition > MOST_CONDITION:
            raise CannotCompute(
                f"the sensors {', '.join(self.names)} change together (condition {condition:.0f}), so "
                f"what each of "
                "them does cannot be told apart; log a day on which they differ, or choose some with --sensor"
            )
        used = sorted({c.log for c in self.channels})
        every = np.concatenate([rises[i] for i in used])
        sensors = tuple(
            Sensor(
                name,
                self.reference[name],
                (
                    float(every[:, i].min()) + self.reference[name],
                    float(every[:, i].max()) + self.reference[name],
                ),
                float(lags[name]),
            )
            for i, name in enumerate(self.names)
        )
        distortions: list[Distortion] = []
        sigma: list[tuple[float, float, float]] = []
        fits = []
        for component in self.components:
            columns, values = self.design(component, self.channels, rises)
            count = self.count(component)
            freedom = len(values) - columns.shape[1] - sum(c.component == component for c in self.channels)
            if freedom <= 0:
                raise CannotCompute(
                    f"{component} has {len(values)} readings for {columns.shape[1]} coefficients; log for "
                    f"longer"
                )
            found = self.solve(columns, values)
            left = values - columns @ found
            size = np.maximum(np.sqrt((columns**2).sum(axis=0)), 1e-300)
            inverse = np.linalg.pinv((columns / size).T @ (columns / size))
            spread = np.sqrt(np.diag(inverse) * float(left @ left) / freedom) / size
            log = self.logs[used[0]]
            for i, name in enumerate(self.names):
                a = [0.0, 0.0, 0.0]
                s = [0.0, 0.0, 0.0]
                for k in range(count):
                    a[k], s[k] = (float(v[k * len(self.names) + i]) for v in (found, spread))
                distortions.append(
                    Distortion(
                        component, name, self.span(component), a[0], a[1], a[2], log.line_mm, log.tool_mm
                    )
                )
                sigma.append((s[0], s[1], s[2]))
            drift, unseen = held.get(component, (float("nan"), float("nan")))
            places = sorted({c.position_mm for c in self.channels if c.component == component})
            low, high = self.span(component)
            fits.append(
                ComponentFit(
                    component, SHAPES[:count], len(places), len(values), _rms(values), _rms(left), drift,
                    unseen, (places[-1] - places[0]) / (high - low),
                )
            )  # fmt: skip
        return ThermalFit(Structure(sensors, tuple(distortions)), condition, tuple(fits), tuple(sigma), what)


def findings(fit: ThermalFit) -> tuple[Finding, ...]:
    """What a person should know before using the fit."""
    out = []
    for c in fit.components:
        if len(c.shapes) < len(SHAPES):
            missing = " and ".join(SHAPES[len(c.shapes) :])
            what = f"{c.component} was read at {c.positions} positions: its {missing} is not known"
            out.append(Finding("OLP881", what))
        elif c.covered < _COVERED:
            what = f"{c.component} was read over {c.covered:.0%} of its axis; beyond, its shape is continued"
            out.append(Finding("OLP881", what))
        if c.held_out_drift_rms > 0.0 and c.held_out_rms > _POOR * c.held_out_drift_rms:
            share = c.held_out_rms / c.held_out_drift_rms
            what = f"{c.component}: {share:.0%} of the drift is left where the model was not fitted"
            out.append(Finding("OLP883", what))
    known = {c.component for c in fit.components}
    for axis in AXES:
        bent = sorted(n for n in known if n[2] == axis and n[1] in AXES and n[1] != axis)
        if bent and not any(n[2] == axis and n[1] in "ABC" for n in known):
            out.append(Finding("OLP882", f"{', '.join(bent)} was read, and no angle of {axis}"))
    return tuple(out)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values * values))) if len(values) else float("nan")
