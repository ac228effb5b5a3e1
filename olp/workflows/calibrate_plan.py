"""What to measure for a wanted uncertainty: methods compared by time against accuracy, and the files of
one."""

from __future__ import annotations

import datetime
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from olp.calibration.design import layout
from olp.calibration.design.prediction import Planned, Prediction, predict
from olp.calibration.diagnosis.deciding import offsets
from olp.core.arrays import Array
from olp.core.errors import CannotCompute, UsageError
from olp.core.machine import Machine, Setup, Vector
from olp.core.units import AXES, MM_PER_UM, UM_PER_MM
from olp.core.values import dataclass
from olp.files.measurements.plan_files import Pass, plan_files
from olp.findings.catalogue import Finding
from olp.program.registry import read
from olp.program.rs274.positions import positions_program
from olp.program.rs274.profiles.base import Profile
from olp.workflows.measuring_time import DWELL_S, passes_of, seconds_of, set_up_min
from olp.workflows.session import PathLike, Session
from olp.workflows.shown import Filed

Instrument = Literal["lines", "targets", "tracker", "lines-and-tracker", "pods", "multilateration"]
#: Methods of a first plan.
INSTRUMENTS: tuple[Instrument, ...] = ("lines", "tracker", "lines-and-tracker", "pods", "multilateration")
#: Numbers of points that are tried, fewest first.
COUNTS = (30, 60, 120, 250, 500, 1000)
#: Points of a tracker measured in addition to lines.
BESIDE = 40
#: Stations of multilateration.
STATIONS = 6
#: Default standard uncertainty of a tracker's coordinate in mm.
TRACKER = 8e-3
#: A program read back must stop at its points within this, in mm: rounding of floating point only.
_SAME_MM = 1e-9
#: Seed of random positions.
_SEED = 20


@dataclass(frozen=True, slots=True, eq=False)
class Method:
    """A method to measure: its geometry, its predicted uncertainty, and its time. `passes` are runs of the
    machine, `set_up_min` is the time that people need in addition."""

    instrument: Instrument
    name: str
    planned: Planned
    prediction: Prediction
    passes: tuple[Pass, ...]
    machine_s: float
    set_up_min: float

    @property
    def hours(self) -> float:
        return self.machine_s / 3600.0 + self.set_up_min / 60.0


@dataclass(frozen=True, slots=True, eq=False)
class MeasurementPlan(Filed):
    """A plan: `chosen` of all `methods` that were compared, the report ("olp-plan-1") as a mapping, findings.

    `files(folder)` are a plan to be filled in (measurements.toml), its CSV files, and programs of the points.
    """

    setup: Setup
    chosen: Method
    methods: tuple[Method, ...]
    report: dict[str, Any]
    findings: tuple[Finding, ...]
    dwell_s: float
    inputs: tuple[str, ...] = ()

    def files(self, folder: PathLike, date: datetime.date | None = None) -> dict[Path, bytes]:
        """Bytes by path. Raises CannotCompute for a control whose programs cannot be written."""
        return dict(_files(self, Path(folder), date))


def plan_measurements(
    machine: PathLike | Setup,
    *,
    uncertainty_um: float = 5.0,
    instrument: Instrument | None = None,
    box_mm: Sequence[tuple[float, float]] | None = None,
    tools: Sequence[Vector] = (),
    sigma_um: float | None = None,
    periods_mm: Sequence[Sequence[float]] = ((), (), ()),
    dwell_s: float | None = None,
    settle_s: float = 1.0,
    points: int | None = None,
) -> MeasurementPlan:
    """Propose what to measure so that the residual error of a correction is about `uncertainty_um` (rms
    length, in the best-fit frame).

    Without `instrument` the quickest method that reaches it is chosen; `points` fixes the number of points.
    `box_mm` is the volume (default: the travel less a hundredth at each end). `tools` are vectors from the
    gauge point to the reflector (default: three that are not on one line). `sigma_um` is the standard
    uncertainty of a tracker's coordinate, `periods_mm` the periods of screws and scales by axis. Raises
    UsageError, ConfigError and CannotCompute.
    """
    session = Session.start(machine)
    setup = session.setup
    described = setup.machine
    described.motion_limits()
    box = box_of(described, box_mm)
    reflectors = list(tools) or reflectors_of(described)
    judged = judged_of(described, reflectors)
    sigma = TRACKER if sigma_um is None else sigma_um * MM_PER_UM
    names = INSTRUMENTS if instrument is None else (instrument,)
    methods: list[Method] = []
    for name in names:
        dwell = DWELL_S[name] if dwell_s is None else dwell_s
        for title, planned in _candidates(name, described.name, box, reflectors, sigma, periods_mm, points):
            prediction = predict(planned, described.chain, box, judged)
            methods.append(timed(name, title, planned, prediction, described, dwell + settle_s, box))
    chosen = quickest(methods, uncertainty_um)
    used = (DWELL_S[chosen.instrument] if dwell_s is None else dwell_s) + settle_s
    report = {
        "schema": "olp-plan-1",
        "cannot_see": list(chosen.prediction.hidden),
        **plan_rows(described, box, chosen, methods, uncertainty_um, reflectors, judged),
    }
    findings = tuple(findings_of_plan(chosen, uncertainty_um))
    return MeasurementPlan(setup, chosen, tuple(methods), report, findings, used, session.sources.files)


def timed(
    name: Instrument, title: str, planned: Planned, prediction: Prediction, machine: Machine, wait_s: float,
    box: Array,
) -> Method:  # fmt: skip
    """A method with its runs of the machine and their time. Raises ConfigError without limits of motion."""
    passes = tuple(passes_of(planned.measurements, machine, wait_s, box))
    seconds = sum(seconds_of(run, machine) for run in passes)
    return Method(name, title, planned, prediction, passes, seconds, set_up_min(planned.measurements))


def quickest(methods: Sequence[Method], wanted_um: float) -> Method:
    """The quickest method that reaches the wanted uncertainty, else the best one."""
    good = [m for m in methods if m.prediction.rms_mm <= wanted_um * MM_PER_UM]
    return min(good, key=lambda m: m.hours) if good else min(methods, key=lambda m: m.prediction.rms_mm)


def box_of(machine: Machine, box_mm: Sequence[tuple[float, float]] | None) -> Array:
    """(3, 2) axis positions between which to measure. Raises UsageError."""
    travel = np.array([machine.axes[a].travel_mm for a in AXES])
    if box_mm is None:
        margin = 0.01 * np.ptp(travel, axis=1)
        return np.asarray(np.round(travel + np.stack([margin, -margin], axis=1), 1))
    box = np.array(box_mm, float)
    for k, a in enumerate(AXES):
        low, high = box[k]
        if not (travel[k, 0] <= low < high <= travel[k, 1]):
            raise UsageError(
                f"the box along {a} is {low:g} to {high:g} mm; expected a part of its travel, "
                f"{travel[k, 0]:g} to {travel[k, 1]:g}"
            )
    return box


def judged_of(machine: Machine, reflectors: Sequence[Vector]) -> list[Vector]:
    """The tool vectors that a prediction is for: the first reflector and all tools."""
    tools = [tool.tool_vector_mm for tool in machine.tools.values()]
    return list(dict.fromkeys([reflectors[0], *(vector for vector in tools if vector is not None)]))


def reflectors_of(machine: Machine) -> list[Vector]:
    """Three tool vectors that are not on one line."""
    tool = machine.tools.get(machine.default_tool) if machine.default_tool is not None else None
    tool_vector = tool.tool_vector_mm if tool is not None else None
    first = tool_vector if tool_vector is not None else (0.0, 0.0, -100.0)
    rest = [(float(x), float(y), float(z)) for x, y, z in offsets([first]).tolist()]
    return [first, *(vector for vector in rest if vector != first)][:3]


def _candidates(
    name: Instrument, machine: str, box: Array, tools: Sequence[Vector], sigma: float,
    periods_mm: Sequence[Sequence[float]], points: int | None,
) -> Iterator[tuple[str, Planned]]:  # fmt: skip
    counts = COUNTS if points is None else (points,)
    if name == "lines":
        yield "lines: laser, levels, squares", layout.lines(machine, box, tools[0], periods_mm, _SEED)
    elif name == "lines-and-tracker":
        n = points or BESIDE
        both = layout.together(
            layout.lines(machine, box, tools[0], periods_mm, _SEED),
            layout.points(machine, box, tools, n, sigma, _SEED),
        )
        yield f"lines and {n} points of a tracker", both
    else:
        make: Callable[[int], Planned]
        if name == "tracker":
            words = "{} points of a tracker"
            make = lambda n: layout.points(machine, box, tools, n, sigma, _SEED)  # noqa: E731
        elif name == "pods":
            words = "{} points of two pods"
            make = lambda n: layout.pods(machine, box, tools, n, layout.POD, _SEED)  # noqa: E731
        else:
            words = f"{STATIONS} stations with {{}} lengths"
            make = lambda n: layout.lengths(  # noqa: E731
                machine, box, tools, n, STATIONS, layout.LENGTH, _SEED
            )
        for n in counts:
            yield words.format(n), make(n)


def plan_rows(
    machine: Machine, box: Array, chosen: Method, methods: Sequence[Method], wanted: float,
    reflectors: Sequence[Vector], judged: Sequence[Vector],
) -> dict[str, Any]:  # fmt: skip
    """What the report of every plan states: the machine, the method that was chosen, and the others."""
    return {
        "machine": machine.name,
        "chain": machine.chain,
        "box_mm": {axis: box[k].tolist() for k, axis in enumerate(AXES)},
        "wanted_um": wanted,
        "method": chosen.name,
        "instrument": chosen.instrument,
        "predicted_um": chosen.prediction.rms_mm * UM_PER_MM,
        "predicted_worst_um": chosen.prediction.worst_mm * UM_PER_MM,
        "machine_h": chosen.machine_s / 3600.0,
        "set_up_h": chosen.set_up_min / 60.0,
        "reflectors": [{"name": f"reflector {k}", "tool_mm": list(v)} for k, v in enumerate(reflectors, 1)],
        "judged_with": [{"name": f"tool {k}", "tool_mm": list(v)} for k, v in enumerate(judged, 1)],
        "methods": _method_rows(methods, wanted),
    }


def _method_rows(methods: Sequence[Method], wanted: float) -> list[dict[str, Any]]:
    """Methods as rows of a report, the quickest first."""
    return [
        {
            "name": m.name,
            "predicted_um": m.prediction.rms_mm * UM_PER_MM,
            "worst_um": m.prediction.worst_mm * UM_PER_MM,
            "machine_h": m.machine_s / 3600.0,
            "set_up_h": m.set_up_min / 60.0,
            "total_h": m.hours,
            "reaches": m.prediction.rms_mm <= wanted * MM_PER_UM,
            "cannot_see": list(m.prediction.hidden),
        }
        for m in sorted(methods, key=lambda m: m.hours)
    ]


def findings_of_plan(chosen: Method, wanted: float) -> Iterator[Finding]:
    """What it does not reach, and what would not be observable."""
    rms = chosen.prediction.rms_mm * UM_PER_MM
    if rms > wanted:
        yield Finding("OLP837", f"{chosen.name}: residual about {rms:.1f} um, wanted {wanted:g} um")
    if chosen.prediction.hidden:
        hidden = ", ".join(chosen.prediction.hidden)
        yield Finding("OLP838", f"{hidden}: not observable with {chosen.name}")


def _files(plan: MeasurementPlan, folder: Path, date: datetime.date | None) -> Iterator[tuple[Path, bytes]]:
    machine, chosen = plan.setup.machine, plan.chosen
    for name, data in plan_files(machine, chosen.planned, chosen.passes, chosen.name, date):
        yield folder / name, data
    profile = _control(plan.setup)
    digits = max(0, math.ceil(-math.log10(min(machine.least_increment_mm)) - 1e-9))
    for run in chosen.passes:
        notes = [
            f"{machine.name}: {run.words}",
            f"{int(np.count_nonzero(run.wait_s))} stops in machine coordinates. Clear the volume first: "
            "moves are straight or axis by axis, inside "
            + ", ".join(f"{a} {run.places_mm[:, k].min():g}..{run.places_mm[:, k].max():g}"
                        for k, a in enumerate(AXES)),
        ]  # fmt: skip
        text = positions_program(profile, run.places_mm, run.wait_s, digits, notes)
        _proved(text, run, plan.setup, digits)
        yield folder / f"{run.name}.{profile.written_ending}", text


def _control(setup: Setup) -> Profile:
    """The dialect of the control. Raises CannotCompute where no program of positions is written for it."""
    control = Session(setup).control()
    if not isinstance(control, Profile):
        raise CannotCompute(
            f"no programs of positions are written for {control.title}; take the points from the CSV files, "
            "or name an RS-274 control in the machine file"
        )
    return control


def _proved(text: bytes, run: Pass, setup: Setup, digits: int) -> None:
    """Read a program back: it must stop at its points. Its first block moves Z alone."""
    path = read(text, setup, _control(setup)).toolpath
    wanted = np.round(run.places_mm, digits)
    kept = np.concatenate([[True], (np.diff(wanted, axis=0) != 0.0).any(axis=1)])
    wanted = wanted[kept]
    stops_mm = path.end_mm[1:]
    if stops_mm.shape != wanted.shape or not np.abs(stops_mm - wanted).max() <= _SAME_MM:
        raise CannotCompute(f"program {run.name} does not read back as its points; report this")


__all__ = ["INSTRUMENTS", "MeasurementPlan", "Method", "plan_measurements"]
