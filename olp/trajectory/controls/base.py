"""What a profile of a control states, and the time that it gives for a program."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import UsageError
from olp.core.values import dataclass
from olp.program.program import Program
from olp.trajectory.controls.bells import bell_seconds
from olp.trajectory.controls.moves import Moves
from olp.trajectory.controls.planner import Pieces, seconds, speeds
from olp.trajectory.controls.said import Said


@dataclass(frozen=True, slots=True, eq=False)
class AxisSpeeds:
    """(3,) largest velocity mm/s, acceleration mm/s^2 and jerk mm/s^3 of X, Y and Z."""

    velocity: Array
    acceleration: Array
    jerk: Array


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number that the control has a setting for: its value where you state none, its unit, and the setting
    in words."""

    value: float
    unit: str
    text: str


@dataclass(frozen=True, slots=True)
class Control:
    """A control whose planner is published.

    `pieces` makes what it drives of moves, limits and the values of `parameters`. It looks `ahead` over so
    many pieces, in cycles of `cycle_s`, of which a stop takes `stop_cycles`. `bare_mm` is its path tolerance
    where a program states none, None for that of `olp`. `chord_mm` names the parameter by which arcs become
    chords, "" for a control that drives arcs. `corners` names the parameter that makes corners faster where
    it is larger, "" where only the program does. `said` finds the words of a program that only this control
    acts on, None where there are none beside path modes. `bells` says whether jerk is limited, so that speed
    rises as a bell, not as a trapezoid. `source` is where all that is published.
    """

    key: str
    title: str
    source: str
    parameters: Mapping[str, Parameter]
    pieces: Callable[[Moves, AxisSpeeds, Mapping[str, float]], Pieces]
    ahead: int
    cycle_s: float
    stop_cycles: float
    bare_mm: float | None = None
    chord_mm: str = ""
    corners: str = ""
    said: Callable[[Program], Said] | None = None
    bells: bool = False

    def values(self, stated: Mapping[str, float]) -> dict[str, float]:
        """The parameters, as stated or else by default. Raises UsageError for others, and for values that are
        not above 0."""
        for name, value in stated.items():
            if name not in self.parameters:
                known = ", ".join(self.parameters)
                raise UsageError(f"{self.title} has no setting {name!r} here; expected one of {known}")
            if not 0.0 < value < np.inf:
                raise UsageError(f"{name} is {value:g}; expected a number above 0")
        return {name: stated.get(name, one.value) for name, one in self.parameters.items()}


def move_seconds(control: Control, part: Moves, limits: AxisSpeeds, values: Mapping[str, float]) -> Array:
    """(m,) the time of each move of a stretch."""
    pieces = control.pieces(part, limits, values)
    if control.bells:
        time = bell_seconds(pieces, control.ahead)
    else:
        time = seconds(pieces, speeds(pieces, control.ahead), control.cycle_s, control.stop_cycles)
    return np.bincount(pieces.move, weights=time, minlength=len(part)).astype(np.float64)
