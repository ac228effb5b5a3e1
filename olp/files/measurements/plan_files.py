"""The files of a plan of measurements yet to be taken: measurements.toml and CSV files to fill in."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from olp.calibration.design.layout import Scattered, scattered
from olp.calibration.design.prediction import Planned
from olp.calibration.observations.lengths import Lengths
from olp.calibration.observations.lines import Line
from olp.calibration.observations.points import Points
from olp.core.arrays import Array
from olp.core.machine import Machine
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.files.measurements.point_readings import AXIS, LENGTH, MEASURED, TOOL, directions
from olp.files.starter import PLACEHOLDER_DATE
from olp.files.toml_text import comment, toml_lines

PLAN = "measurements.toml"
_UM_M = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Pass:
    """One run of the machine: axis positions (n, 3) and the wait after each, words on its set-up; `rows` are
    the points of `source` in the order of visiting. `repeats` runs are needed."""

    name: str
    places_mm: Array
    wait_s: Sequence[float]
    words: str
    source: str
    rows: npt.NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, np.intp))
    repeats: int = 1


def plan_files(
    machine: Machine, planned: Planned, passes: Sequence[Pass], title: str, date: datetime.date | None
) -> Iterator[tuple[str, bytes]]:
    """(name, bytes) of measurements.toml and of every CSV file, whose cells of readings are empty."""
    taken = planned.measurements
    text = [*comment(f"{title}. Fill in the CSV files in the order of their rows, then: olp calibrate fit.")]
    text += toml_lines({"schema": "olp-measurements-1", "machine": machine.name, "chain": machine.chain})
    text.append(f"measured = {date or PLACEHOLDER_DATE}  # the day of measuring")
    text.append("temperature_degC = 20.0  # of the scales while measuring")
    text.append("active_during_measurement = []  # errors that the control corrects meanwhile")
    if any(taken.periods_mm):
        text += ["", "[periods_mm]"]
        text += toml_lines({a: list(p) for a, p in zip(AXES, taken.periods_mm, strict=True) if p})
    for square in taken.squares:
        text += ["", "[[squares]]"]
        values = {"name": square.name, "error_urad": 0.0, "sigma_urad": square.sigma_rad / RAD_PER_URAD}
        text += toml_lines(values)
    used: set[str] = set()
    for line in taken.lines:
        name = _unused(line.source, used)
        text += ["", "[[lines]]", *toml_lines(_line_keys(line, name))]
        yield name, _line_csv(line)
    for cloud in scattered(taken):
        # stations see the same points one after the other
        source = taken.lengths[0].source if isinstance(cloud, Lengths) else cloud.source
        rows = np.concatenate([run.rows for run in passes if run.source == source])
        name = f"{cloud.source.replace(' ', '-')}.csv"
        text += ["", *toml_table(cloud, name)]
        yield name, _points_csv(cloud, rows)
    yield PLAN, ("\n".join(text) + "\n").encode()


def _unused(name: str, used: set[str]) -> str:
    stem, k = name.removesuffix(".csv"), 1
    while name in used:
        k += 1
        name = f"{stem}-{k}.csv"
    used.add(name)
    return name


def _line_keys(line: Line, name: str) -> dict[str, object]:
    angle = line.quantity == "angle"
    at = {a: line.line_mm[k] for k, a in enumerate(AXES) if a != line.component[2]}
    return {
        "file": name,
        "component": line.component,
        "line_mm": at,
        "tool_mm": list(line.tool_mm),
        "sense": "actual-minus-commanded",
        "square": line.square,
        "sigma_urad" if angle else "sigma_um": round(
            line.sigma / RAD_PER_URAD if angle else line.sigma * UM_PER_MM, 6
        ),
        "sigma_scale_um_m": round(line.sigma_scale * _UM_M, 6) if line.sigma_scale else None,
    }


def _line_csv(line: Line) -> bytes:
    unit = "urad" if line.quantity == "angle" else "um"
    rows = [f"target_mm,run,direction,value_{unit}"]
    columns = zip(line.target_mm.tolist(), line.run.tolist(), line.direction.tolist(), strict=True)
    rows += [f"{q:g},{run},{side}," for q, run, side in columns]
    return ("\n".join(rows) + "\n").encode()


def toml_table(cloud: Scattered, name: str) -> list[str]:
    """The table of a plan that names the file of points, lengths or directions."""
    if isinstance(cloud, Points):
        return ["[[points]]", *toml_lines({"file": name, "sigma_um": round(cloud.sigma * UM_PER_MM, 6)})]
    if isinstance(cloud, Lengths):
        far = float(np.polyfit(cloud.length_mm, cloud.sigma_mm, 1)[0])
        least = float(np.mean(cloud.sigma_mm - far * cloud.length_mm))
        values = {"file": name, "sigma_um": round(least * UM_PER_MM, 4), "sigma_um_m": round(far * _UM_M, 4)}
        return ["[[stations]]", *toml_lines(values)]
    i, j, length, sigma = cloud.baselines[0]
    return [
        "[[pods]]",
        *toml_lines({"file": name, "pods": cloud.count, "sigma_urad": round(cloud.sigma / RAD_PER_URAD, 4)}),
        "[[pods.baselines]]  # measure it: this is only where they are meant to stand",
        *toml_lines({"between": [i + 1, j + 1], "length_mm": round(length, 1),
                     "sigma_um": round(sigma * UM_PER_MM, 3)}),
    ]  # fmt: skip


def _points_csv(cloud: Scattered, rows: Array) -> bytes:
    if isinstance(cloud, Points):
        wanted = MEASURED
    else:
        wanted = LENGTH if isinstance(cloud, Lengths) else directions(cloud.count)
    lines = [",".join((*AXIS, *TOOL, *wanted))]
    for k in rows.astype(int).tolist():
        cells = [f"{v:g}" for v in (*cloud.axis_mm[k].tolist(), *cloud.tool_mm[k].tolist())]
        lines.append(",".join(cells) + "," * len(wanted))
    return ("\n".join(lines) + "\n").encode()
