"""Control code of a machine with three linear axes, and its test vectors: states of the machine, and the
error that `olp` finds there."""

from __future__ import annotations

import numpy as np

from olp.core.arrays import Array
from olp.core.units import AXES
from olp.errormodel.calibration import Calibration
from olp.files.control_code.base import Bounds, Code
from olp.files.control_code.carried import Carried, carried
from olp.files.control_code.linear_tables import linear_tables
from olp.files.control_code.tables import written

#: Vectors in a file.
COUNT = 2000
#: K; temperatures differ by so much from the first ones of the sensors.
_WARMER = 6.0
#: kg; the largest payload beyond that while measuring.
_HEAVIER = 50.0
#: mm; by which vectors lie outside of the calibrated box at most.
_OUTSIDE = 5.0
#: mm; the longest tool along each axis.
_TOOL = 200.0
#: Temperatures of the file: building the model for another one takes time.
_STATES = 8


def vectors(kept: Carried, count: int = COUNT, seed: int = 1) -> Array:
    """(n, 13 + sensors) axis position, tool vector, payload, play, temperatures, error; mm, kg, degC."""
    random = np.random.default_rng(seed)
    low, high = np.asarray(kept.model.box_mm, float).T
    sensors = len(kept.sensors)
    rows = np.zeros((count, 13 + sensors))
    rows[:, :3] = random.uniform(low - _OUTSIDE, high + _OUTSIDE, (count, 3))
    rows[:, 3:6] = random.uniform(-_TOOL, _TOOL, (count, 3))
    rows[:, 6] = kept.calibration.payload_kg + random.uniform(0.0, _HEAVIER, count)
    rows[:, 7:10] = random.choice([-1.0, 0.0, 0.5, 1.0], (count, 3))
    for part in np.array_split(np.arange(count), _STATES if sensors else 1):
        degC = [s.start_degC + random.uniform(-_WARMER, _WARMER) for s in kept.sensors]
        rows[part, 10 : 10 + sensors] = degC
        model = kept.at(degC) if sensors else kept.model
        one = rows[part]
        rows[part, -3:] = model.error(one[:, :3], one[:, 3:7], one[:, 7:10])
    return rows


def linear_code(calibration: Calibration, chain: str, digest: str) -> Code:
    """The code of a machine with three linear axes. Raises ConfigError for what C code cannot hold."""
    kept = carried(calibration, chain)
    rows = vectors(kept)
    return Code(
        machine=kept.calibration.machine,
        chain=chain,
        digest=digest,
        axes=tuple(AXES),
        units=("mm", "mm", "mm"),
        shapes=("common", "shapes"),
        tables=tuple(linear_tables(kept)),
        engine=("engine", "follower"),
        tips=(),
        poses=False,
        self_test="self_test",
        vectors=written(rows),
        sensors=kept.sensors,
        payload_kg=kept.calibration.payload_kg,
        centred=False,
        linear=Bounds.of(rows[:, -3:], kept.backlash_mm(), "mm"),
        rotary=Bounds.of(np.zeros(1), 0.0, "deg"),
    )
