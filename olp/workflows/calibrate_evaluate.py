"""Measurements of a machine, from files to what they say: lines, circles, diagonals, postures, and go and
return."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from olp.calibration.iso230 import ballbar, diagonals, postures
from olp.calibration.iso230.ballbar import CircleFit
from olp.calibration.iso230.diagonals import DiagonalFit
from olp.calibration.iso230.evaluation import Evaluated, evaluate_all
from olp.calibration.iso230.go_return import Reversal, reversal_of
from olp.calibration.iso230.positioning import Zone
from olp.calibration.iso230.postures import PostureFit
from olp.calibration.observations.circles import SKIP_DEG
from olp.core.errors import ConfigError
from olp.core.machine import Setup
from olp.files.measurements.instruments.ballbars import read_circles
from olp.files.measurements.instruments.diagonals import read_diagonal
from olp.files.measurements.postures import read_postures
from olp.files.measurements.reader import load_measurements
from olp.workflows.session import load, setup_of

PathLike = str | Path


def evaluate_lines(
    sources: Sequence[PathLike], machine: PathLike | Setup | None = None, *, zone: Zone = "least-squares"
) -> Evaluated:
    """ISO 230-2 figures, cyclic errors, reversal and squareness of measured lines.

    `sources` are plans, folders and files as `olp calibrate fit` takes them; with a machine, what they say of
    moving tables is checked against its chain. Raises InputError, ConfigError.
    """
    chain = None if machine is None else setup_of(machine, None).machine.chain
    found = load_measurements(sources, chain)
    if not found.lines:
        raise ConfigError(
            "no lines to evaluate; expected [[lines]] in a plan, or files of readings along axes"
        )
    return evaluate_all(found, zone)


def fit_ballbar(sources: Sequence[PathLike], *, skip_deg: float = SKIP_DEG) -> tuple[CircleFit, ...]:
    """Squareness, scale and servo mismatch and lost motion from circles, a file each. Raises InputError,
    ConfigError."""
    return tuple(ballbar.fit(read_circles(source), skip_deg=skip_deg) for source in sources)


def fit_diagonals(
    sources: Sequence[PathLike], known: Mapping[str, tuple[float, float]] | None = None
) -> DiagonalFit:
    """Squareness and scales from face and body diagonals, a file each; `known` as in
    `olp.calibration.iso230.diagonals.fit`. Raises InputError, ConfigError."""
    return diagonals.fit([read_diagonal(source) for source in sources], known)


def fit_postures(
    source: PathLike, machine: PathLike | Setup | None = None, *, reference: str | None = None
) -> PostureFit:
    """Errors of tool vectors from a point held in several postures. With a machine its tools give the nominal
    vectors, and where it has a calibration, the errors at each posture are taken out first. Raises
    InputError, ConfigError."""
    setup = None if machine is None else setup_of(machine, None)
    found = read_postures(source, None if setup is None else setup.machine.tools)
    error = None
    if setup is not None and setup.machine.calibration is not None:
        model = load(setup, None, "refuse").model
        outside = ~model.inside(found.axis_mm)
        if outside.any():
            row = int(np.flatnonzero(outside)[0])
            raise ConfigError(
                f"posture {row + 1} is outside the calibrated box; leave it out, or call without the machine",
                file=str(source),
            )
        error = model.error(found.axis_mm, found.lever_mm)
    return postures.fit(found, error, reference)


def go_return(sources: Sequence[PathLike], machine: PathLike | Setup | None = None) -> tuple[Reversal, ...]:
    """The reversal of every positioning line that was approached from both sides. Raises InputError,
    ConfigError."""
    chain = None if machine is None else setup_of(machine, None).machine.chain
    lines = [line for line in load_measurements(sources, chain).lines if line.quantity == "positioning"]
    if not lines:
        raise ConfigError(
            "no line of positioning; expected EXX, EYY or EZZ, approached from both sides",
            file=str(sources[0]) if sources else None,
        )
    return tuple(reversal_of(line) for line in lines)
