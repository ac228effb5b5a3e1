"""`calibrate postures`: a point held in several postures, from a file to errors of tool vectors."""

from __future__ import annotations

import numpy as np

from olp.calibration.iso230 import postures
from olp.calibration.iso230.postures import PostureFit
from olp.core.errors import ConfigError
from olp.core.machine import Setup
from olp.files.measurements.postures import read_postures
from olp.workflows.session import PathLike, Session


def fit_postures(
    source: PathLike, machine: PathLike | Setup | None = None, *, reference: str | None = None
) -> PostureFit:
    """Errors of tool vectors from a point held in several postures. The tools of a machine give the nominal
    vectors; where it has a calibration, the errors at each posture are removed first. Raises InputError,
    ConfigError."""
    session = None if machine is None else Session.start(machine)
    held = read_postures(source, None if session is None else session.setup.machine.tools)
    error = None
    if session is not None and session.setup.machine.calibration is not None:
        model = session.loaded("refuse").model
        outside = ~model.inside(held.axis_mm)
        if outside.any():
            row = int(np.flatnonzero(outside)[0])
            raise ConfigError(
                f"posture {row + 1} is outside the calibrated box; leave it out, or call without the machine",
                file=str(source),
            )
        error = model.error(held.axis_mm, held.tool_vector_mm)
    return postures.fit(held, error, reference)
