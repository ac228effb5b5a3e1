"""The files of a plan of future measurements: measurements.toml and CSV files to fill in."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Sequence
from dataclasses import field

import numpy as np
import numpy.typing as npt

from olp.calibration.design.prediction import Planned
from olp.calibration.observations.base import State
from olp.core.arrays import Array, Index
from olp.core.machine import Machine
from olp.core.units import AXES, RAD_PER_URAD
from olp.core.values import dataclass
from olp.errormodel.calibration import PLACEHOLDER_DATE
from olp.files.measurements.instruments.registry import planner_of
from olp.files.toml_text import comment, toml_lines

PLAN = "measurements.toml"


@dataclass(frozen=True, slots=True, eq=False)
class Pass:
    """One run of the machine: axis positions (n, 3), the wait after each, and words on its set-up. `rows` are
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
    text = [*comment(f"{title}. Fill in the CSV files in the order of their rows, then: olp calibrate fit.")]
    text += toml_lines({"schema": "olp-measurements-1", "machine": machine.name, "chain": machine.chain})
    text.append(f"measured = {date or PLACEHOLDER_DATE}  # the day of measuring")
    text.append("temperature_degC = 20.0  # of the scales while measuring")
    text.append("active_during_measurement = []  # errors that the control corrects meanwhile")
    if any(planned.periods_mm):
        text += ["", "[periods_mm]"]
        text += toml_lines({a: list(p) for a, p in zip(AXES, planned.periods_mm, strict=True) if p})
    for square in planned.squares:
        text += ["", "[[squares]]"]
        values = {"name": square.name, "error_urad": 0.0, "sigma_urad": square.sigma_rad / RAD_PER_URAD}
        text += toml_lines(values)
    used: set[str] = set()
    for state in planned.states:
        taken = state.observation
        instrument = planner_of(taken)
        name = unused_name(f"{taken.source.removesuffix('.csv').replace(' ', '-')}.csv", used)
        text += ["", *instrument.asked(taken, name)]
        yield name, instrument.empty(taken, _rows(state, planned, passes))
    yield PLAN, ("\n".join(text) + "\n").encode()


def _rows(state: State, planned: Planned, passes: Sequence[Pass]) -> Index:
    """The readings in the order of visiting. Without a pass of its own, an observation has the order of the
    first one of its kind, or else its own order."""
    same = [s.observation.source for s in planned.states if type(s) is type(state)]
    for source in (state.observation.source, same[0]):
        runs = [run.rows for run in passes if run.source == source]
        if runs:
            return np.concatenate(runs)
    return np.arange(state.count)


def unused_name(wanted: str, used: set[str]) -> str:
    """The name, or with a number where it is used already; it is used then."""
    first, dot, ending = wanted.partition(".")
    name, k = wanted, 1
    while name in used:
        k += 1
        name = f"{first}-{k}{dot}{ending}"
    used.add(name)
    return name
