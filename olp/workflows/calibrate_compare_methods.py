"""`calibrate compare-methods`: equation (1), the map of two pods and the adjustment on a shop's own readings.

Each method is one entry of METHODS: what it is called, which readings it takes, and how it makes errors of
them. All are judged at the same independent points.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.fitted import Fit
from olp.calibration.methods.equation_1 import equation_1, in_the_papers_signs
from olp.calibration.methods.judging import (
    EQUAL,
    Errors,
    Judged,
    best,
    beyond_noise,
    judged,
    noise_of,
    stated,
)
from olp.calibration.methods.pod_map import pod_map
from olp.calibration.observations.base import Observation
from olp.calibration.observations.copies import refuse_copies
from olp.calibration.observations.lines import Line
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.pods import Pods
from olp.calibration.observations.points import Points
from olp.calibration.observations.squareness import SquarenessReading
from olp.core.arrays import Array
from olp.core.errors import CannotCompute, ConfigError
from olp.core.machine import Machine, Setup, Vector
from olp.core.progress import Progress, silent
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.core.values import dataclass
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.files.measurements.checkpoints import load_checkpoints
from olp.files.measurements.reader import files_of_measurements, load_measurements
from olp.findings.catalogue import Finding
from olp.workflows.measuring_time import DWELL_S, passes_of, seconds_of, set_up_min
from olp.workflows.session import PathLike, Session
from olp.workflows.shown import Shown

#: Seconds from the end of a motion to a reading.
SETTLE_S = 1.0
#: The name of the uncompensated machine.
UNCORRECTED = "uncorrected"


@dataclass(frozen=True, slots=True, eq=False)
class Shop:
    """What the methods are made from: the machine, all its readings, and the box (3, 2) in mm of readings and
    points."""

    machine: Machine
    measurements: Measurements
    box_mm: Array

    @property
    def travel_mm(self) -> list[tuple[float, float]]:
        return [self.machine.axes[axis].travel_mm for axis in AXES]

    def of(self, kinds: tuple[type[Observation], ...]) -> Measurements:
        """The readings of some kinds alone."""
        own = tuple(taken for taken in self.measurements.observations if isinstance(taken, kinds))
        return dataclasses.replace(self.measurements, observations=own)


@dataclass(frozen=True, slots=True, eq=False)
class Made:
    """What a method gives: errors, the fit behind them if there is one, the calibration of equation (1)."""

    errors: Errors
    fit: Fit | None = None
    calibration: Calibration | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Method:
    """One way from readings of `kinds` to errors. `make` raises CannotCompute where it cannot."""

    name: str
    kinds: tuple[type[Observation], ...]
    make: Callable[[Shop, Measurements], Made]


def _from_lines(placed: bool) -> Callable[[Shop, Measurements], Made]:
    def make(shop: Shop, taken: Measurements) -> Made:
        described = equation_1(taken, shop.machine.chain, shop.box_mm, placed=placed)
        model = build(described, shop.machine.chain, outside="hold")
        return Made(lambda axis, tool: model.error(axis, tool), calibration=described)

    return make


def _from_pods(shop: Shop, taken: Measurements) -> Made:
    return Made(pod_map(taken.of(Pods)[0]).error)


def _adjusted(shop: Shop, taken: Measurements) -> Made:
    fitted = fit(taken, shop.machine.chain, travel_mm=shop.travel_mm)
    return Made(lambda axis, tool: fitted.error(axis, tool), fitted)


_LINES: tuple[type[Observation], ...] = (Line, SquarenessReading)
#: All methods, in the order of the table.
METHODS: tuple[Method, ...] = (
    Method("equation (1), lever arms from machine zero", _LINES, _from_lines(placed=False)),
    Method("equation (1), lever arms from the lines", _LINES, _from_lines(placed=True)),
    Method("linear map of the pods", (Pods,), _from_pods),
    Method("adjustment, lines", _LINES, _adjusted),
    Method("adjustment, pods", (Pods,), _adjusted),
    Method("adjustment, all readings", (Observation,), _adjusted),
)


@dataclass(frozen=True, slots=True, eq=False)
class ComparedMethods(Shown):
    """Methods of calibration at independent points: `methods` in the order of the table, the first one is the
    uncompensated machine. `use` is the one to use, `report` the same as a mapping ("olp-methods-1")."""

    methods: tuple[Judged, ...]
    use: Judged
    report: dict[str, Any]
    findings: tuple[Finding, ...] = ()
    inputs: tuple[str, ...] = ()


def compare_methods(
    data: PathLike | Sequence[PathLike] | Measurements,
    points: PathLike | Points,
    machine: PathLike | Setup,
    *,
    sigma_um: float | None = None,
    tool_mm: Vector | None = None,
    progress: Progress | None = None,
) -> ComparedMethods:
    """Make calibrations of a machine in the ways of the paper and by adjustment, and judge them at points.

    `data` are as for `fit_calibration`; `points` are independent ones, as for `diagnose_calibration`, with
    `sigma_um` and `tool_mm` where the file states none. Raises InputError, ConfigError where there are
    neither lines nor pods, and CannotCompute where the points determine no frame.
    """
    tell = progress or silent
    described = Session.start(machine).setup.machine
    inputs: tuple[str, ...] = ()
    if isinstance(data, Measurements):
        measurements = data
    else:
        sources = [data] if isinstance(data, str) or not isinstance(data, Sequence) else list(data)
        inputs = files_of_measurements(sources)
        measurements = load_measurements(sources, described.chain)
    if not measurements.of(Line) and not measurements.of(Pods):
        raise ConfigError("there is nothing to compare; expected [[lines]] or [[pods]], or both")
    if isinstance(points, Points):
        check = points
    else:
        check, _ = load_checkpoints(points, sigma_um=sigma_um, tool_mm=tool_mm)
        inputs = (*inputs, *files_of_measurements([points]))
    # points that a method was made from do not judge it
    for copy in refuse_copies((*measurements.observations, check)):
        raise copy
    shop = Shop(described, measurements, _box(measurements, check))
    rows = [Judged(UNCORRECTED, *judged(check, lambda axis, _: np.zeros(axis.shape)))]
    why_not: list[dict[str, str]] = []
    papers: dict[str, Any] = {}
    done: set[tuple[int, ...]] = set()
    for number, method in enumerate(METHODS):
        tell(method.name, number / len(METHODS))
        taken = shop.of(method.kinds)
        same = tuple(sorted(map(id, taken.observations)))
        if not taken.observations or (method.make is _adjusted and same in done):
            continue
        try:
            made = method.make(shop, taken)
        except CannotCompute as error:
            why_not.append({"name": method.name, "why": str(error)})
            continue
        if method.make is _adjusted:
            done.add(same)
        if made.calibration is not None:
            papers = _in_units(in_the_papers_signs(made.calibration))
        expected = None if made.fit is None else stated(check, made.fit)
        hours = _hours(taken, described, shop.box_mm)
        rows.append(Judged(method.name, *judged(check, made.errors), expected, *hours))
    use = best(rows)
    report = {
        "schema": "olp-methods-1",
        "machine": described.name,
        "chain": described.chain,
        "points": len(check.axis_mm),
        "noise_of_points_um": noise_of(check) * UM_PER_MM,
        "use": use.name,
        "because": _because(use, rows),
        "methods": list(_rows(rows, check)),
        "not_possible": why_not,
        "equation_1": papers,
    }
    return ComparedMethods(tuple(rows), use, report, inputs=inputs)


def _box(measurements: Measurements, check: Points) -> Array:
    """(3, 2) what readings and points reach."""
    box = []
    for axis in range(3):
        reached = [taken.reach(axis) for taken in measurements.observations]
        whole = np.concatenate([*reached, check.axis_mm[:, axis]])
        box.append((float(whole.min()), max(float(whole.max()), float(whole.min()) + 1.0)))
    return np.array(box)


def _hours(taken: Measurements, machine: Machine, box: Array) -> tuple[float | None, float]:
    """Hours of the machine, None where its file lacks limits of motion; and hours of people."""
    by_hand = set_up_min(taken) / 60.0
    if machine.missing_limits:
        return None, by_hand
    seconds = 0.0
    for kind, name in ((Line, "lines"), (Pods, "pods")):
        own = dataclasses.replace(taken, observations=taken.of(kind))
        passes = passes_of(own, machine, DWELL_S[name] + SETTLE_S, box)
        seconds += sum(seconds_of(run, machine) for run in passes)
    others = tuple(o for o in taken.observations if not isinstance(o, Line | Pods | SquarenessReading))
    rest = dataclasses.replace(taken, observations=others)
    seconds += sum(
        seconds_of(run, machine) for run in passes_of(rest, machine, DWELL_S["tracker"] + SETTLE_S, box)
    )
    return seconds / 3600.0, by_hand


def _rows(methods: Sequence[Judged], check: Points) -> Iterator[dict[str, Any]]:
    for method in methods:
        made = method.name != UNCORRECTED
        yield {
            "name": method.name,
            "residual_um": method.residual_mm * UM_PER_MM,
            "beyond_noise_um": beyond_noise(method.residual_mm, check) * UM_PER_MM,
            "worst_um": method.worst_mm * UM_PER_MM,
            "stated_um": None if method.stated_mm is None else method.stated_mm * UM_PER_MM,
            "machine_h": method.machine_h if made else None,
            "set_up_h": method.set_up_h if made else None,
        }


def _because(use: Judged, methods: Sequence[Judged]) -> str:
    before = methods[0]
    if use is before:
        return "no method is clearly better at these points than no correction"
    size = f"{use.residual_mm * UM_PER_MM:.2g} um rms where the uncompensated machine has "
    size += f"{before.residual_mm * UM_PER_MM:.2g} um"
    least = min(methods, key=lambda method: method.residual_mm)
    if use is not least:
        return f"{size}, as good as {least.name} within {EQUAL - 1.0:.0%}, and quicker to measure"
    return size


def _in_units(values: dict[str, float]) -> dict[str, float]:
    """Ranges of curves in um or urad, squareness in urad, by the paper's names."""
    angles = ("roll", "pitch", "yaw", "sqr")
    return {
        f"{name}_{'urad' if name.endswith(angles) else 'um'}": value
        * (1.0 / RAD_PER_URAD if name.endswith(angles) else UM_PER_MM)
        for name, value in values.items()
    }
