"""All instruments whose readings a plan can name. A new instrument is one line here."""

from __future__ import annotations

from typing import Any

from olp.calibration.observations.base import Observation
from olp.files.measurements.instruments.artefacts import ArtefactFiles
from olp.files.measurements.instruments.ballbars import BallbarFiles
from olp.files.measurements.instruments.base import Instrument
from olp.files.measurements.instruments.diagonals import DiagonalFiles
from olp.files.measurements.instruments.lines import LineFiles
from olp.files.measurements.instruments.pods import PodFiles
from olp.files.measurements.instruments.points import PointFiles
from olp.files.measurements.instruments.polar import PolarFiles
from olp.files.measurements.instruments.squareness import SquarenessTables
from olp.files.measurements.instruments.stations import StationFiles

#: In the order of their readings in an adjustment and in its report.
INSTRUMENTS: tuple[Instrument[Any, Any], ...] = (
    LineFiles(),
    PointFiles(),
    PolarFiles(),
    ArtefactFiles(),
    StationFiles(),
    PodFiles(),
    DiagonalFiles(),
    BallbarFiles(),
    SquarenessTables(),
)


def rank_of(taken: Observation) -> int:
    """The rank of an observation among the others: that of the first instrument that gives its type."""
    return next(k for k, instrument in enumerate(INSTRUMENTS) if isinstance(taken, instrument.gives))


def planner_of(taken: Observation) -> Instrument[Any, Any]:
    """The instrument that writes a plan for a future observation."""
    return next(i for i in INSTRUMENTS if i.plans and isinstance(taken, i.gives))
