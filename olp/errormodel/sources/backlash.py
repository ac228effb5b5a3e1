"""Backlash of each axis. Its model is a play (`olp.errormodel.reversal`) in the component errors of the axis
(`olp.errormodel.components`)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from olp.core.interpolation import Column
from olp.core.machine import Vector
from olp.core.schema import NotNegative, Table
from olp.core.schema_keys import Field
from olp.core.units import AXES, UM_PER_MM, in_unit, shifted
from olp.errormodel.entry import AxisState, Entry, Numbers, alone
from olp.errormodel.sources.base import ErrorSource, Example, Reading, Schema, Sigmas, Writing, digits, vector


class BacklashTable(Table):
    X_um: float = Field(default=0.0, description="the backlash of axis X, in um")
    Y_um: float = Field(default=0.0, description="the backlash of axis Y, in um")
    Z_um: float = Field(default=0.0, description="the backlash of axis Z, in um")
    sigma_X_um: NotNegative = Field(default=0.0, description="the standard uncertainty of X_um, in um")
    sigma_Y_um: NotNegative = Field(default=0.0, description="the standard uncertainty of Y_um, in um")
    sigma_Z_um: NotNegative = Field(default=0.0, description="the standard uncertainty of Z_um, in um")


class BacklashNumbers(Numbers):
    """The backlash of one axis."""

    kind = "backlash"
    names = tuple(AXES)

    def acts(self, entry: Entry, state: AxisState) -> Iterator[tuple[int, Column]]:
        if state.play is not None:
            yield state.axis, -0.5 * state.play


class Backlash(ErrorSource[BacklashTable, Vector]):
    """The table [backlash]; values are in mm."""

    key = "backlash"
    field = "backlash_mm"
    numbers = (BacklashNumbers(),)
    schema: Schema = (BacklashTable, Field(default_factory=BacklashTable, description="the table [backlash]"))

    def example(self, by: float) -> Example:
        backlash_um = {"X": 6.0 * by, "Z": 9.0 * by}
        lines = (f"{a}_um = {b}\nsigma_{a}_um = {0.1 * b}\n" for a, b in backlash_um.items())
        return Example("[backlash]\n" + "".join(lines))

    def read(self, stated: BacklashTable, reading: Reading) -> Vector:
        return vector([shifted(getattr(stated, f"{axis}_um"), -3) for axis in AXES])

    def write(self, values: Vector, writing: Writing) -> None:
        if any(values):
            keys = {f"{a}_um": in_unit(b, -3) for a, b in zip(AXES, values, strict=True)}
            writing.table("[backlash]", keys)

    def sigmas(self, stated: BacklashTable, reading: Reading) -> Sigmas:
        sigma = {axis: shifted(getattr(stated, f"sigma_{axis}_um"), -3) for axis in AXES}
        return {axis: value for axis, value in sigma.items() if value}

    def entries(self, values: Vector, sigmas: Sigmas) -> list[Entry]:
        return [alone("backlash", axis, value) for axis, value in sigmas.items()]

    def fingerprint(self, values: Vector, datum_mm: Vector) -> Iterator[str]:
        yield digits(values)

    def inspect_axis(self, values: Vector, axis: str) -> dict[str, Any]:
        return {"lost_motion_um": values[AXES.index(axis)] * UM_PER_MM}
