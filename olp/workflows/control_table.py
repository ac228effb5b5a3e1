"""What reading and writing of control tables need from a machine and a call."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from olp.core.machine import Machine
from olp.core.units import AXES
from olp.errormodel.calibration import Reference
from olp.files.control_tables.base import Given, Sense


def given_of(
    machine: Machine | None,
    chain: str | None,
    sense: Sense | None,
    axis: str | None,
    comp_type: int | None,
    names: Mapping[str, str] | None,
    reference: Reference | None,
    most: int | None,
) -> Given:
    """The machine's name, chain and travel, and the values of the call; a table has at most `most` rows."""
    travel = None if machine is None else np.array([machine.axes[a].travel_mm for a in AXES])
    return Given(
        machine="machine" if machine is None else machine.name,
        chain=chain or ("FXYZ" if machine is None else machine.chain),
        travel_mm=travel, sense=sense, axis=axis, kind=comp_type, names=dict(names or {}),
        reference=reference, most=most,
    )  # fmt: skip
