"""`calibrate evaluate`: measured lines, from files to ISO 230-2 figures."""

from __future__ import annotations

from collections.abc import Sequence

from olp.calibration.iso230.evaluation import Evaluated, evaluate_all
from olp.calibration.iso230.positioning import Zone
from olp.core.errors import ConfigError
from olp.core.machine import Setup
from olp.files.measurements.reader import load_measurements
from olp.workflows.session import PathLike, Session


def evaluate_lines(
    sources: Sequence[PathLike], machine: PathLike | Setup | None = None, *, zone: Zone = "least-squares"
) -> Evaluated:
    """ISO 230-2 figures, cyclic errors, reversal and squareness of measured lines.

    `sources` are plans, folders and files as `olp calibrate fit` takes them; with a machine, their
    statements on moving tables are checked against its chain. Raises InputError, ConfigError.
    """
    chain = None if machine is None else Session.start(machine).setup.machine.chain
    measurements = load_measurements(sources, chain)
    if not measurements.lines:
        raise ConfigError(
            "there are no lines to evaluate; expected [[lines]] in a plan, or files of readings along axes"
        )
    return evaluate_all(measurements, zone)
