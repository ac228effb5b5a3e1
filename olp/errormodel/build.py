"""Error models: what the tool really does, relative to the workpiece, for every axis position.

`build` makes the model of a calibration; `total` adds models. See `base` for what every model offers.
"""

from __future__ import annotations

from typing import Literal

from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.errormodel.base import ErrorModel
from olp.errormodel.bodies import build_bodies
from olp.errormodel.calibration import Calibration
from olp.errormodel.chain import RigidBody
from olp.errormodel.total import total


def build(
    calibration: Calibration,
    chain: str,
    *,
    outside: Literal["refuse", "hold"] = "refuse",
    skip_components: frozenset[str] = frozenset(),
) -> ErrorModel:
    """The model of a calibration on a chain such as "FXYZ" (workpiece to tool, F the frame).

    `outside` "hold" evaluates the model at the nearest point of the box; with "refuse" the caller tests
    `inside`. `skip_components` are ISO 230-1 names that the control corrects already: their curves, cyclic
    terms and squareness are left out. Raises ConfigError.
    """
    unknown = sorted(skip_components.difference(COMPONENTS, SQUARENESS))
    if unknown:
        raise ConfigError(f"component '{unknown[0]}' to skip; expected ISO 230-1 names such as EXX or C0Y")
    if skip_components and any(m.kind == "total" for m in calibration.maps):
        raise ConfigError(
            f'a map of kind "total" also holds {", ".join(sorted(skip_components))}, which the control '
            "corrects. Switch the tables of the control off, or measure the map with them on and name them "
            "in active_during_measurement"
        )
    hold = outside == "hold"
    if calibration.model == "huddersfield":
        from olp.errormodel.huddersfield import huddersfield

        bodies = huddersfield(calibration, chain, hold, skip_components)
    else:
        bodies = RigidBody(calibration.box_mm, hold, build_bodies(calibration, chain, skip_components))
    models: list[ErrorModel] = [bodies]
    frame = calibration.frame(chain, hold=hold)
    for source, values in calibration.sources():
        models += source.models(values, frame)
    return total(models)
