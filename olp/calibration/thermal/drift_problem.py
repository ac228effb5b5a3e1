"""Drift as a problem of least squares: logs, the channels in them, and the lags of their sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.errors import CannotCompute, ConfigError
from olp.core.machine import ZERO, Vector
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.distortion import SHAPES, lagged, shapes

Index = npt.NDArray[np.intp]

#: Lags that are tried first, as shares of the length of the longest log; 0 besides.
_LAGS = np.geomspace(2e-3, 0.5, 14)
#: A part may be ahead of its sensor by this share of the log, as with a sensor that is glued on badly.
_LONGEST_LEAD = 0.05
#: Rounds over all sensors, at most.
_ROUNDS = 4
#: Longer logs are thinned to so many rows: half a minute on a day.
_MOST_ROWS = 3000
#: Steps of the golden section.
_REFINED = 12
#: Share of the only log that is held out.
_HELD_OUT = 0.25


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


def thinned(log: DriftLog) -> DriftLog:
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
class Channel:
    """Readings (m,) of one component at one position in one log, at rows (m,) of it."""

    log: int
    component: str
    position_mm: float
    row: Index
    value: Array


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """The channels of logs over `box_mm` (3, 2), with the sensors `names` and their reference in degC."""

    logs: tuple[DriftLog, ...]
    names: tuple[str, ...]
    reference: Mapping[str, float]
    box_mm: Array
    channels: tuple[Channel, ...]
    _known: dict[tuple[int, str, float], Array] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(
        cls, logs: Sequence[DriftLog], names: Sequence[str], reference: Mapping[str, float], box_mm: Array
    ) -> Problem:
        channels = []
        for number, log in enumerate(logs):
            for (component, position), values in log.readings.items():
                rows = np.flatnonzero(np.isfinite(values))
                if len(rows) >= 2:
                    channels.append(Channel(number, component, position, rows, values[rows]))
        lines = {(log.line_mm, log.tool_mm) for log in logs}
        if len(lines) > 1:
            raise ConfigError(
                "the logs were measured on different lines or with different tools; expected the same "
                "line_mm and tool_mm in all, or a fit for each"
            )
        if not channels:
            raise CannotCompute("no channel of drift has two readings or more")
        return cls(tuple(logs), tuple(names), reference, box_mm, tuple(channels))

    # -- parts -------------------------------------------------------------------------------------

    def _last_log(self) -> int:
        return max(c.log for c in self.channels)

    def parts(self) -> tuple[list[Channel], list[Channel] | None]:
        """The channels of a first fit, and those held out: of the last log, or of the last quarter of the
        only one."""
        used = sorted({c.log for c in self.channels})
        if len(used) > 1:
            return (
                [c for c in self.channels if c.log != used[-1]],
                [c for c in self.channels if c.log == used[-1]],
            )
        time = self.logs[used[0]].time_s
        cut = time[0] + (1.0 - _HELD_OUT) * (time[-1] - time[0])
        before: list[Channel] = []
        after: list[Channel] = []
        for c in self.channels:
            early = time[c.row] <= cut
            for pick, channels in ((early, before), (~early, after)):
                if pick.sum() >= 2:
                    channels.append(Channel(c.log, c.component, c.position_mm, c.row[pick], c.value[pick]))
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
        positions = [c.position_mm for c in self.channels if c.component == component]
        return min(float(low), *positions), max(float(high), *positions)

    def count(self, component: str) -> int:
        """How many shapes the positions of a component determine."""
        return min(len({c.position_mm for c in self.channels if c.component == component}), len(SHAPES))

    def design(
        self, component: str, channels: Sequence[Channel], rises: Sequence[Array]
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

    def cost(self, lags: Mapping[str, float], channels: Sequence[Channel]) -> float:
        """Half of minus the log likelihood with the noise of each component unknown, up to a constant."""
        rises = self.rises(lags)
        total = 0.0
        for component in self.components:
            columns, values = self.design(component, channels, rises)
            if len(values) > columns.shape[1]:
                rest = values - columns @ self.solve(columns, values)
                total += 0.5 * len(values) * float(np.log(max(float(rest @ rest), 1e-300)))
        return total

    def lags(self, channels: Sequence[Channel] | None) -> dict[str, float]:
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
        self, name: str, lags: Mapping[str, float], low: float, high: float, channels: Sequence[Channel]
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

    # -- quality -----------------------------------------------------------------------------------

    def judge(
        self, lags: Mapping[str, float], training: Sequence[Channel], held_out: Sequence[Channel]
    ) -> dict[str, tuple[float, float]]:
        """rms of the drift and of the residual of each component, where it was not fitted."""
        rises = self.rises(lags)
        figures = {}
        for component in self.components:
            columns, values = self.design(component, training, rises)
            held_out_columns, drift = self.design(component, held_out, rises)
            if len(values) > columns.shape[1] and len(drift):
                residual = drift - held_out_columns @ self.solve(columns, values)
                figures[component] = (rms(drift), rms(residual))
        return figures

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
                f"the temperature of sensor {still[0]} does not change in the logs, so its effect is not "
                "observable; log it while it changes, or leave it out with --sensor"
            )
        return float(np.linalg.cond(history / size))


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values * values))) if len(values) else float("nan")
