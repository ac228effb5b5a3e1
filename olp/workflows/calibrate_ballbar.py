"""`calibrate ballbar`: circles of a ball-bar, from files to fits."""

from __future__ import annotations

from collections.abc import Sequence

from olp.calibration.iso230 import ballbar
from olp.calibration.iso230.ballbar import CircleFit
from olp.calibration.observations.circles import SKIP_DEG
from olp.files.measurements.instruments.ballbars import read_circles
from olp.workflows.session import PathLike


def fit_ballbar(sources: Sequence[PathLike], *, skip_deg: float = SKIP_DEG) -> tuple[CircleFit, ...]:
    """Squareness, scale and servo mismatch and backlash from circles, one per file. Raises InputError,
    ConfigError."""
    return tuple(ballbar.fit(read_circles(source), skip_deg=skip_deg) for source in sources)
