"""Error models: what the tool really does, relative to the workpiece, for every axis position.

`build` makes the model of a calibration; `total` adds models. See `base` for what every model offers.
"""

from __future__ import annotations

from typing import Literal

from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.errormodel.base import ErrorModel
from olp.errormodel.bodies import build_bodies
from olp.errormodel.calibration import Calibration, Curve, Cyclic, Thermal
from olp.errormodel.chain import RigidBody
from olp.errormodel.compliance import GridErrors
from olp.errormodel.gridded import ComponentTable, DeviationMap
from olp.errormodel.huddersfield import huddersfield
from olp.errormodel.maps import MapErrors
from olp.errormodel.reversal import play_interval, play_states, plays
from olp.errormodel.thermal import ThermalExpansion
from olp.errormodel.total import total

__all__ = [
    "Calibration",
    "ComponentTable",
    "Curve",
    "Cyclic",
    "DeviationMap",
    "ErrorModel",
    "Thermal",
    "build",
    "play_interval",
    "play_states",
    "plays",
    "total",
]


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
            f'the control corrects {", ".join(sorted(skip_components))}, and a map of kind "total" holds '
            f"them; they "
            "cannot be taken out of it: switch the control's tables off, or measure the map with them on "
            "and name "
            "them in active_during_measurement"
        )
    hold, box = outside == "hold", calibration.box_mm
    models: list[ErrorModel] = []
    if calibration.model == "huddersfield":
        models.append(huddersfield(calibration, chain, hold, skip_components))
    else:
        models.append(RigidBody(box, hold, build_bodies(calibration, chain, skip_components)))
    models += [MapErrors.of(described, box, hold) for described in calibration.maps]
    beams = [beam.table(box, chain) for beam in calibration.beams]
    if calibration.compliance or beams:
        models.append(
            GridErrors.of(
                "load", calibration.compliance, chain, calibration.datum_mm, box, hold=hold,
                apart=beams, mass_kg=calibration.payload_kg, tool_terms=calibration.model != "huddersfield",
            )
        )  # fmt: skip
    if calibration.thermal is not None:
        models.append(ThermalExpansion.of(calibration.thermal, box, hold))
    if calibration.structure is not None:
        tables = calibration.structure.tables(hold=hold)
        if tables:
            models.append(
                GridErrors.of(
                    "thermal", tables, chain, calibration.datum_mm, box, hold=hold,
                    tool_terms=calibration.model != "huddersfield",
                )
            )  # fmt: skip
    return total(models)
