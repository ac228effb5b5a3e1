"""Which postures of a machine of any joints to measure: those that lower what is not known of its tip most.

Readings are points of a tracker whose place is not known. They are chosen as those of three axes are.
"""

from __future__ import annotations

import numpy as np

from olp.calibration.design.choosing import Candidates, Choice, Criterion, choose
from olp.calibration.joints.adjustment import frame_of, left_of, tables_of
from olp.calibration.joints.unknowns import Model
from olp.core.arrays import Array, Index
from olp.core.machine import Vector
from olp.core.values import dataclass

#: Standard deviation of the place of a tracker in mm, and of its turn in mm at the reach: far more than any
#: reading leaves.
_ANYWHERE_MM = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class Postures:
    """n postures as candidates, and (1, 3 n, k) `judged`, the tip at all of them in the best frame."""

    candidates: Candidates
    judged: Array

    @staticmethod
    def of(model: Model, values: Array, tool_mm: Vector, sigma_mm: float) -> Postures:
        """Those at axis values (n, axes), with a reflector at `tool_mm` of the gauge frame that is read with
        `sigma_mm` in each coordinate."""
        tip, _, place = tables_of(model, np.zeros(len(model.unknowns)), values, np.array(tool_mm))
        frame, _ = frame_of(place)
        rest, _ = left_of(tip, frame)
        return Postures(
            Candidates(tip @ model.root / sigma_mm, frame * (_ANYWHERE_MM / sigma_mm)),
            (rest @ model.root).reshape(1, -1, rest.shape[2]),
        )

    def chosen(self, count: int, criterion: Criterion) -> Choice:
        """The postures to read."""
        return choose(self.candidates, self.judged, count, criterion)

    def tip_mm(self, rows: Index) -> float:
        """mm: what is not known of the tip (rms over all postures) once some of them are read."""
        return float(choose(self.candidates.only(rows), self.judged, len(rows), "A").rms_mm[-1])
