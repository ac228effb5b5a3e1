"""`calibrate go-return`: the reversal of axes from targets approached from both sides."""

from __future__ import annotations

from collections.abc import Sequence

from olp.calibration.iso230.go_return import Reversal, reversal_of
from olp.core.errors import ConfigError
from olp.core.machine import Setup
from olp.files.measurements.reader import load_measurements
from olp.workflows.session import PathLike, Session


def go_return(sources: Sequence[PathLike], machine: PathLike | Setup | None = None) -> tuple[Reversal, ...]:
    """The reversal of every positioning line that was approached from both sides. Raises InputError,
    ConfigError."""
    chain = None if machine is None else Session.start(machine).setup.machine.chain
    lines = [line for line in load_measurements(sources, chain).lines if line.quantity == "positioning"]
    if not lines:
        raise ConfigError(
            "there is no line of positioning; expected EXX, EYY or EZZ, approached from both sides",
            file=str(sources[0]) if sources else None,
        )
    return tuple(reversal_of(line) for line in lines)
