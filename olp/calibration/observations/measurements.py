"""All readings of one calibration, in the sign convention of this package: actual minus commanded, of the
tool relative to the workpiece, right-handed, mm and rad, by axis position.

Readers convert units and the conventions of instruments; everything after them uses this convention only.
"""

from __future__ import annotations

import dataclasses
import datetime
from collections.abc import Iterable
from typing import Literal, TypeVar

from olp.calibration.observations.base import Observation, Scattered
from olp.calibration.observations.lines import Line
from olp.calibration.observations.references import Square, Straightedge
from olp.core.values import dataclass

T = TypeVar("T", bound=Observation)


@dataclass(frozen=True, slots=True)
class MapWish:
    """Asks for a map of errors that are not rigid. `noise` says whether the readings scale the stated noise,
    `within_mm` how far interpolation of the map may be off."""

    noise: Literal["learnt", "stated"] = "learnt"
    within_mm: float = 2e-4


@dataclass(frozen=True, slots=True)
class Measurements:
    """All readings of one calibration, as taken; the input of `fit`.

    `observations` are of any kinds; their order is that of the report. `map` asks for a map of what is not
    rigid. `periods_mm` are the periods of screws and scales by axis, for which cyclic errors are fitted;
    `active_during_measurement` are the errors that the control corrected then.
    """

    machine: str
    observations: tuple[Observation, ...] = ()
    squares: tuple[Square, ...] = ()
    periods_mm: tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]] = ((), (), ())
    temperature_degC: float = 20.0
    active_during_measurement: frozenset[str] = frozenset()
    measured: datetime.date | None = None
    chain: str | None = None
    map: MapWish | None = None
    straightedges: tuple[Straightedge, ...] = ()

    def of(self, kind: type[T]) -> tuple[T, ...]:
        """All observations of a kind."""
        return tuple(taken for taken in self.observations if isinstance(taken, kind))

    @property
    def lines(self) -> tuple[Line, ...]:
        return self.of(Line)

    @property
    def scattered(self) -> tuple[Scattered, ...]:
        """Readings all over the volume."""
        return tuple(taken for taken in self.observations if isinstance(taken, Scattered))

    def also(self, observations: Iterable[Observation]) -> Measurements:
        """With more observations."""
        return dataclasses.replace(self, observations=(*self.observations, *observations))

    def with_lines(self, lines: Iterable[Line]) -> Measurements:
        """With these lines in place of its own."""
        others = [taken for taken in self.observations if not isinstance(taken, Line)]
        return dataclasses.replace(self, observations=(*lines, *others))
