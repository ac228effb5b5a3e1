"""`calibrate diagonals`: face and body diagonals, from files to a fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from olp.calibration.iso230 import diagonals
from olp.calibration.iso230.diagonals import DiagonalFit
from olp.files.measurements.instruments.diagonals import read_diagonal
from olp.workflows.session import PathLike


def fit_diagonals(
    sources: Sequence[PathLike], known: Mapping[str, tuple[float, float]] | None = None
) -> DiagonalFit:
    """Squareness and scales from face and body diagonals, one per file; `known` as in
    `olp.calibration.iso230.diagonals.fit`. Raises InputError, ConfigError."""
    return diagonals.fit([read_diagonal(source) for source in sources], known)
