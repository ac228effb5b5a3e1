"""Points in space as rows of the adjustment: places of the reflector in a frame that nobody knows.

The best-fit rigid transform brings them near the machine's frame; what it leaves of the six motions of the
frame, and of the instrument's scale, are unknowns of these points alone.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from olp.calibration.normal import Block, Chunk
from olp.calibration.observations import Points
from olp.calibration.parameters import Unknowns
from olp.errormodel.base import Array
from olp.measured.rigid import fit_frame

#: Points whose rows are made at once: 30 MB with 600 parameters.
CHUNK = 2000
#: Turns of the frame count per metre of lever, so that all unknowns are of one size.
LEVER_MM = 1000.0


def points_block(points: Points, parameters: Unknowns) -> Block:
    """The readings of one set-up: three rows a point. Raises CannotCompute where they make no frame."""
    nominal = points.axis_mm + points.tool_mm
    near = nominal + deviations(points)
    centre = nominal.mean(axis=0)
    local = frame_columns(nominal - centre, scale=points.sigma_scale > 0.0)
    precision = np.zeros(local.shape[2])
    if points.sigma_scale > 0.0:
        precision[6] = 1.0 / (points.sigma_scale * LEVER_MM) ** 2
    size = parameters.size

    def chunks() -> Iterator[Chunk]:
        for start in range(0, len(nominal), CHUNK):
            part = slice(start, start + CHUNK)
            rows = parameters.design(points.axis_mm[part], points.tool_mm[part])
            deviation = (near[part] - nominal[part]).reshape(-1)
            yield Chunk(
                rows.reshape(-1, size),
                deviation,
                np.full(len(deviation), points.sigma),
                local[part].reshape(-1, local.shape[2]),
            )

    return Block(np.arange(size), precision, chunks, points.source or "points")


def deviations(points: Points) -> Array:
    """(n, 3) measured less commanded places of the reflector in mm, in the frame that fits best. Raises
    CannotCompute where the points make no frame."""
    nominal = points.axis_mm + points.tool_mm
    return np.asarray(fit_frame(points.measured_mm, nominal)(points.measured_mm) - nominal)


def frame_columns(arm: Array, *, scale: bool = False) -> Array:
    """(n, 3, 6 or 7) what shifts, turns and the scale of the frame do to points at `arm` from the centre."""
    out = np.zeros((len(arm), 3, 7 if scale else 6))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        out[:, k, k] = 1.0
        out[:, i, 3 + k] = -arm[:, j] / LEVER_MM
        out[:, j, 3 + k] = arm[:, i] / LEVER_MM
    if scale:
        out[:, :, 6] = arm / LEVER_MM
    return out
