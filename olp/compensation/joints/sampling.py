"""How densely a move is sampled, so that no error of a joint bends unseen between two samples."""

from __future__ import annotations

import numpy as np

from olp.compensation.joints.motion import Motion
from olp.core.arrays import Array, Index
from olp.core.values import dataclass
from olp.kinematics.errors import JointErrors

#: Samples of one period of a harmonic.
_PER_PERIOD = 8
#: Samples of a turn by so many degrees, and of a motion by so many mm, where no error asks for more.
_SMOOTH_DEG = 5.0
#: The same of linear axes.
_SMOOTH_MM = 50.0
#: Samples of a stretch at least, where it is no short one.
_FEWEST = 3
#: A stretch of a step over this has one sample.
_SHORT = 4
#: Samples of one stretch at most, so that a short text makes no work without end.
_MOST = 4096


@dataclass(frozen=True, slots=True, eq=False)
class Resolution:
    """(axes,) how far an axis goes from sample to sample, mm or deg."""

    step: Array

    @staticmethod
    def of(motion: Motion) -> Resolution:
        errors, steps = motion.machines[0].errors.joints, []
        for name, joint in motion.structure.joints.items():
            smooth = _SMOOTH_DEG if joint.unit == "deg" else _SMOOTH_MM
            steps.append(min(smooth, _step(errors[name])) if name in errors else smooth)
        return Resolution(np.array(steps))

    def samples(self, begin: Array, end: Array) -> Index:
        """(s,) how many samples lie between axis values (s, axes). A short stretch bends one way only, so
        the one in its middle shows by how much."""
        steps = np.max(np.abs(end - begin) / self.step, axis=1, initial=0.0)
        fewest = np.clip(np.ceil(_SHORT * steps), 1, _FEWEST)
        return np.asarray(np.clip(np.ceil(steps), fewest, _MOST), np.int64)


def _step(errors: JointErrors) -> float:
    """How far one sample may be from the next for the errors of one joint."""
    steps = [wave.period / _PER_PERIOD for wave in errors.harmonics]
    steps += [float(np.min(np.diff(curve.values.x))) for curve in errors.curves if len(curve.values.x) > 1]
    return min(steps, default=np.inf)


def spread(count: Index) -> tuple[Index, Index]:
    """Of rows that each own `count` (s,) places: the owner of every place, and its number there from 0."""
    owner = np.repeat(np.arange(len(count)), count)
    first = np.cumsum(count) - count
    return owner, np.arange(len(owner)) - first[owner]
