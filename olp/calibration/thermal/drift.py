"""Identifies the indirect thermal model from logs of sensors and of drift.

A reading of component c at position q and time t is modelled as

    sum over sensors i and shapes k of a_cik shape_k(q) (theta_i(t) - reference_i) + offset of its channel

with theta_i the lagged temperature of sensor i. It is linear except for the lags. For given lags the
coefficients follow by least squares (variable projection, G. Golub and V. Pereyra 1973); the lags are found
one after the other from the smallest residual. The offset of each channel in each log absorbs the zero of its
instrument. The last log (or the last quarter of the only one) is held out of a first fit and shows how good
the model is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from olp.calibration.thermal.drift_problem import DriftLog as DriftLog
from olp.calibration.thermal.drift_problem import Problem, rms, thinned
from olp.core.arrays import Array
from olp.core.errors import CannotCompute, ConfigError
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.distortion import SHAPES
from olp.errormodel.sources.structure import Distortion, Sensor, Structure
from olp.findings.catalogue import Finding

#: Above this condition number the histories of sensors are too similar to separate their effects.
MOST_CONDITION = 1e3
#: A share of the axis that positions should reach over.
_COVERED = 0.7
#: Where the model was not fitted, a residual above this share of the drift is poor.
_POOR = 0.3


@dataclass(frozen=True, slots=True)
class ComponentFit:
    """How well one component is described, rms in mm or rad: of the drift (each channel about its mean), of
    the residual, and both in the held-out readings (NaN where there are none). `covered` is the share of the
    span that its positions reach over, `shapes` the shapes that they determine."""

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
        shares = [
            c.held_out_rms / c.held_out_drift_rms for c in self.components if c.held_out_drift_rms > 0.0
        ]
        return 1.0 - float(np.sqrt(np.mean(np.square(shares)))) if shares else float("nan")


def identify(
    logs: Sequence[DriftLog],
    box_mm: Array,
    reference_degC: float | Mapping[str, float],
    *,
    sensors: Sequence[str] = (),
) -> ThermalFit:
    """The structure of logs with readings, over `box_mm` (3, 2). `reference_degC` is the temperature at
    which the machine was calibrated, of all sensors or by name; `sensors` chooses some of them.

    Raises ConfigError for logs that do not fit together and CannotCompute where they do not determine it.
    """
    names = _names(logs, sensors)
    logs = [thinned(log) for log in logs]
    reference = {
        n: float(reference_degC[n] if isinstance(reference_degC, Mapping) else reference_degC) for n in names
    }
    problem = Problem.of(logs, names, reference, box_mm)
    training, held_out = problem.parts()
    held: dict[str, tuple[float, float]] = {}
    what = "nothing"
    if held_out is not None:
        lags = problem.lags(training)
        held = problem.judge(lags, training, held_out)
        what = problem.held_out_name()
    lags = problem.lags(None)
    return _result(problem, lags, held, what)


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
        raise ConfigError(f"{unknown[0]} is not a sensor of the logs; expected some of {', '.join(names)}")
    if not any(log.readings for log in logs):
        raise ConfigError("no log holds readings of drift; expected columns such as EXX@500_um")
    return list(chosen) or names


def _result(
    problem: Problem, lags: Mapping[str, float], held: Mapping[str, tuple[float, float]], what: str
) -> ThermalFit:
    """The fit to all logs at these lags."""
    rises = problem.rises(lags)
    # sensors that change together before they lag do so with any lags
    condition = max(problem.condition(some) for some in (rises, problem.rises(dict.fromkeys(lags, 0.0))))
    if condition > MOST_CONDITION:
        raise CannotCompute(
            f"the sensors {', '.join(problem.names)} change together (condition {condition:.0f}), so their "
            "effects cannot be separated; log a day on which they differ, or choose some with --sensor"
        )
    used = sorted({c.log for c in problem.channels})
    every = np.concatenate([rises[i] for i in used])
    sensors = tuple(
        Sensor(
            name,
            problem.reference[name],
            (
                float(every[:, i].min()) + problem.reference[name],
                float(every[:, i].max()) + problem.reference[name],
            ),
            float(lags[name]),
        )
        for i, name in enumerate(problem.names)
    )
    distortions: list[Distortion] = []
    sigma: list[tuple[float, float, float]] = []
    fits = []
    for component in problem.components:
        columns, values = problem.design(component, problem.channels, rises)
        count = problem.count(component)
        freedom = len(values) - columns.shape[1] - sum(c.component == component for c in problem.channels)
        if freedom <= 0:
            raise CannotCompute(
                f"{component} has {len(values)} readings for {columns.shape[1]} coefficients; log for longer"
            )
        coefficients = problem.solve(columns, values)
        residual = values - columns @ coefficients
        size = np.maximum(np.sqrt((columns**2).sum(axis=0)), 1e-300)
        inverse = np.linalg.pinv((columns / size).T @ (columns / size))
        spread = np.sqrt(np.diag(inverse) * float(residual @ residual) / freedom) / size
        log = problem.logs[used[0]]
        for i, name in enumerate(problem.names):
            a = [0.0, 0.0, 0.0]
            s = [0.0, 0.0, 0.0]
            for k in range(count):
                a[k], s[k] = (float(v[k * len(problem.names) + i]) for v in (coefficients, spread))
            distortions.append(
                Distortion(
                    component, name, problem.span(component), a[0], a[1], a[2], log.line_mm, log.tool_mm
                )
            )
            sigma.append((s[0], s[1], s[2]))
        drift, held_out_rms = held.get(component, (float("nan"), float("nan")))
        places = sorted({c.position_mm for c in problem.channels if c.component == component})
        low, high = problem.span(component)
        fits.append(
            ComponentFit(
                component, SHAPES[:count], len(places), len(values), rms(values), rms(residual), drift,
                held_out_rms, (places[-1] - places[0]) / (high - low),
            )
        )  # fmt: skip
    return ThermalFit(Structure(sensors, tuple(distortions)), condition, tuple(fits), tuple(sigma), what)


def findings(fit: ThermalFit) -> tuple[Finding, ...]:
    """The findings about a fit."""
    results = []
    for c in fit.components:
        if len(c.shapes) < len(SHAPES):
            missing = " and ".join(SHAPES[len(c.shapes) :])
            what = f"{c.component} was read at {c.positions} positions: its {missing} is not known"
            results.append(Finding("OLP881", what))
        elif c.covered < _COVERED:
            what = (
                f"{c.component} was read over {c.covered:.0%} of its axis; beyond, its shape is extrapolated"
            )
            results.append(Finding("OLP881", what))
        if c.held_out_drift_rms > 0.0 and c.held_out_rms > _POOR * c.held_out_drift_rms:
            share = c.held_out_rms / c.held_out_drift_rms
            what = f"{c.component}: the residual is {share:.0%} of the drift where the model was not fitted"
            results.append(Finding("OLP883", what))
    known = {c.component for c in fit.components}
    for axis in AXES:
        bent = sorted(n for n in known if n[2] == axis and n[1] in AXES and n[1] != axis)
        if bent and not any(n[2] == axis and n[1] in "ABC" for n in known):
            results.append(Finding("OLP882", f"{', '.join(bent)} was read, and no angle of {axis}"))
    return tuple(results)
