"""The time that measuring takes: the runs of the machine, and what people do in between."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from olp.calibration.design.visiting import move_s, order
from olp.calibration.observations.lengths import Lengths
from olp.calibration.observations.lines import Line
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.pods import Pods
from olp.calibration.observations.points import Points
from olp.core.arrays import Array
from olp.core.machine import Machine
from olp.files.measurements.plan_files import Pass, unused_name

#: Minutes to set up a line, an instrument at a station, and another reflector.
SET_UP_MIN = {"line": 30.0, "station": 45.0, "reflector": 5.0}
#: Seconds of a reading, by instrument.
DWELL_S = {
    "lines": 3.0,
    "targets": 3.0,
    "tracker": 3.0,
    "lines-and-tracker": 3.0,
    "pods": 5.0,
    "multilateration": 2.0,
}
#: Lines overrun their first and last target by this, in mm, so that backlash is taken up.
OVERRUN_MM = 5.0


def passes_of(measurements: Measurements, machine: Machine, wait_s: float, box: Array) -> Iterator[Pass]:
    """Runs of the machine, each with one instrument at one station and one reflector."""
    together: dict[tuple[int, bytes, tuple[float, ...]], list[Line]] = {}
    for line in sorted(measurements.lines, key=lambda line: line.axis):
        beside = (*line.line_mm[: line.axis], 0.0, *line.line_mm[line.axis + 1 :])
        together.setdefault((line.axis, line.target_mm.tobytes(), beside), []).append(line)
    names: set[str] = set()
    for own in together.values():
        yield _line_pass(own, machine, wait_s, box, unused_name(f"line-{own[0].component[2].lower()}", names))
    rays = measurements.of(Lengths)
    for cloud in measurements.scattered:
        if any(cloud is later for later in rays[1:]):
            # stations measure the same points one after the other
            continue
        vectors = list(dict.fromkeys(map(tuple, cloud.tool_mm.tolist())))
        for number, vector in enumerate(vectors, start=1):
            rows = np.flatnonzero((cloud.tool_mm == np.array(vector)).all(axis=1))
            rows = rows[order(cloud.axis_mm[rows], machine.motion_limits())]
            label = "stations" if rays else cloud.source
            yield Pass(
                f"{label}-{number}", _approached(cloud.axis_mm[rows], box), _waits(len(rows), wait_s),
                f"reflector at X {vector[0]:g} Y {vector[1]:g} Z {vector[2]:g} from the gauge point",
                cloud.source, rows, max(1, len(rays)),
            )  # fmt: skip


def _line_pass(lines: Sequence[Line], machine: Machine, wait_s: float, box: Array, name: str) -> Pass:
    """The run of lines along one axis at one place with the same targets."""
    line = lines[0]
    axis, k = line.component[2], line.axis
    target, run = line.target_mm, line.run
    low, high = machine.axes[axis].travel_mm
    first, last = float(target.min()), float(target.max())
    ends = max(first - OVERRUN_MM, low), min(last + OVERRUN_MM, high)
    stops: list[tuple[float, float]] = []
    for number in np.unique(run):
        own = target[run == number]
        half = len(own) // 2
        stops += [(ends[0], 0.0), *((q, wait_s) for q in own[:half].tolist())]
        stops += [(ends[1], 0.0), *((q, wait_s) for q in own[half:].tolist())]
    points = np.tile(np.array(line.line_mm, float), (len(stops), 1))
    points[:, k] = [q for q, _ in stops]
    waits = [0.0, *(wait for _, wait in stops)]
    runs = len(np.unique(run))
    errors = ", ".join(line.component for line in lines)
    words = f"lines along {axis}: {runs} runs in both directions, once for each of {errors}"
    return Pass(name, _approached(points, box), waits, words, name, repeats=len(lines))


def _approached(points: Array, box: Array) -> Array:
    """The points, with a first one above them, from which the program descends."""
    above = points[:1].copy()
    above[0, 2] = box[2, 1]
    return np.concatenate([above, points])


def _waits(n: int, wait_s: float) -> list[float]:
    return [0.0, *([wait_s] * n)]


def seconds_of(run: Pass, machine: Machine) -> float:
    """Seconds that the machine takes for a run. Raises ConfigError where its limits are not stated."""
    once = float(move_s(np.diff(run.places_mm, axis=0), machine.motion_limits()).sum()) + sum(run.wait_s)
    return once * run.repeats


def set_up_min(measurements: Measurements) -> float:
    """Minutes that people need beside the machine."""
    minutes = SET_UP_MIN["line"] * len(measurements.lines)
    minutes += SET_UP_MIN["station"] * (len(measurements.of(Points)) + len(measurements.of(Lengths)))
    minutes += sum(SET_UP_MIN["station"] * pods.count for pods in measurements.of(Pods))
    for cloud in measurements.scattered:
        minutes += SET_UP_MIN["reflector"] * len(np.unique(cloud.tool_mm, axis=0))
    return minutes
