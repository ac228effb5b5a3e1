"""Repeatability: the random part of each axis. No correction removes it, so it has no model. A stated
uncertainty includes it (`olp.uncertainty`)."""

from __future__ import annotations

from typing import Any

from olp.core.machine import Vector
from olp.core.schema import NotNegative, Table
from olp.core.schema_keys import Field
from olp.core.units import AXES, UM_PER_MM, in_unit, shifted
from olp.errormodel.sources.base import ErrorSource, Example, Frame, Reading, Schema, Writing, vector


class RepeatabilityTable(Table):
    X_um: NotNegative = Field(default=0.0, description="the standard deviation of axis X, in um")
    Y_um: NotNegative = Field(default=0.0, description="the standard deviation of axis Y, in um")
    Z_um: NotNegative = Field(default=0.0, description="the standard deviation of axis Z, in um")


class Repeatability(ErrorSource[RepeatabilityTable | None, Vector | None]):
    """The table [repeatability]; values are standard deviations in mm at one position."""

    key = "repeatability"
    field = "repeatability_mm"
    correctable = False
    schema: Schema = (
        RepeatabilityTable | None,
        Field(
            default=None,
            description="the table [repeatability]: the random part of each axis, which no correction "
            "removes",
        ),
    )
    covered = False

    def example(self, by: float) -> Example:
        return Example(f"[repeatability]\nX_um = {0.8 * by}\nY_um = {0.5 * by}\n")

    def read(self, stated: RepeatabilityTable | None, reading: Reading) -> Vector | None:
        if stated is None:
            return None
        return vector([shifted(getattr(stated, f"{axis}_um"), -3) for axis in AXES])

    def write(self, values: Vector | None, writing: Writing) -> None:
        if values is not None:
            writing.table(
                "[repeatability]", {f"{a}_um": in_unit(s, -3) for a, s in zip(AXES, values, strict=True)}
            )

    def inspect(self, values: Vector | None, frame: Frame) -> dict[str, Any]:
        if values is None:
            return {}
        return {
            "repeatability": {f"{a}_um": sigma * UM_PER_MM for a, sigma in zip(AXES, values, strict=True)}
        }
