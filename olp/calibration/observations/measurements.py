"""All readings of one calibration, in the one sense of this package: actual minus commanded, of the tool
relative to the workpiece, right-handed, mm and rad, by axis position.

Readers turn units, senses and instruments' habits into these types; nothing after them knows another sense.
"""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from typing import Literal

from olp.calibration.observations.circles import Circles
from olp.calibration.observations.diagonals import Diagonal
from olp.calibration.observations.lengths import Lengths
from olp.calibration.observations.lines import Line, Square
from olp.calibration.observations.pods import Pods
from olp.calibration.observations.points import Points
from olp.calibration.observations.squareness import SquarenessReading


@dataclass(frozen=True, slots=True)
class MapWish:
    """That errors which no rigid bodies make are to be mapped: whether the readings scale the stated noise,
    and what interpolation of the map may lose, in mm."""

    noise: Literal["learnt", "stated"] = "learnt"
    within_mm: float = 2e-4


@dataclass(frozen=True, slots=True)
class Measurements:
    """All readings of one calibration, as taken: what `fit` takes.

    `map` asks for a map of what is not rigid.
    `periods_mm` are the periods of screws and scales by axis, where cyclic errors are looked for;
    `active_during_measurement` are the errors that the control corrected then.
    """

    machine: str
    lines: tuple[Line, ...] = ()
    squares: tuple[Square, ...] = ()
    squareness: tuple[SquarenessReading, ...] = ()
    periods_mm: tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]] = ((), (), ())
    temperature_degC: float = 20.0
    active_during_measurement: frozenset[str] = frozenset()
    measured: datetime.date | None = None
    chain: str | None = None
    points: tuple[Points, ...] = ()
    lengths: tuple[Lengths, ...] = ()
    pods: tuple[Pods, ...] = ()
    map: MapWish | None = None
    diagonals: tuple[Diagonal, ...] = ()
    circles: tuple[Circles, ...] = ()
