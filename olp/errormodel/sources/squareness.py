"""Squareness: each axis line tilts against those before it; (-C0Y y + B0Z z, -A0Z z, 0) from the datum.

Its model is the shear of a body (`olp.errormodel.bodies`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from olp.core.interpolation import Column
from olp.core.machine import SQUARENESS, ZERO, Vector
from olp.core.schema import NotNegative, Table
from olp.core.schema_keys import Field
from olp.core.units import RAD_PER_URAD, in_unit, shifted
from olp.errormodel.entry import AxisState, Entry, Numbers, alone
from olp.errormodel.sources.base import ErrorSource, Example, Frame, Reading, Schema, Sigmas, Writing, digits

#: Angles C0Y, B0Z, A0Z in rad.
Angles = Mapping[str, float]

#: Row and sign of what an angle adds, times the distance of its axis from the datum.
_SHEAR = {"C0Y": (0, -1.0), "B0Z": (0, 1.0), "A0Z": (1, -1.0)}


def shears(angles: Angles, skip: frozenset[str]) -> dict[str, Vector]:
    """By axis, the error that each mm from the datum adds."""
    square = {name: 0.0 if name in skip else angle for name, angle in angles.items()}
    c0y, b0z, a0z = (square.get(name, 0.0) for name in ("C0Y", "B0Z", "A0Z"))
    return {"X": ZERO, "Y": (0.0 - c0y, 0.0, 0.0), "Z": (b0z, 0.0 - a0z, 0.0)}


class SquarenessTable(Table):
    C0Y_urad: float = Field(
        default=0.0,
        description="the squareness of Y to X, in urad; + where the angle between "
        "+X and +Y is above 90 degrees",
    )
    B0Z_urad: float = Field(
        default=0.0,
        description="the squareness of Z to X, in urad; + where the angle between "
        "+X and +Z is below 90 degrees",
    )
    A0Z_urad: float = Field(
        default=0.0,
        description="the squareness of Z to Y, in urad; + where the angle between "
        "+Y and +Z is above 90 degrees",
    )
    sigma_C0Y_urad: NotNegative = Field(default=0.0, description="the standard uncertainty of C0Y, in urad")
    sigma_B0Z_urad: NotNegative = Field(default=0.0, description="the standard uncertainty of B0Z, in urad")
    sigma_A0Z_urad: NotNegative = Field(default=0.0, description="the standard uncertainty of A0Z, in urad")


class Tilt(Numbers):
    """One angle."""

    kind = "squareness"
    names = SQUARENESS

    def acts(self, entry: Entry, state: AxisState) -> Iterator[tuple[int, Column]]:
        row, sign = _SHEAR[entry.name]
        yield row, sign * (state.q - state.datum_mm)


class Squareness(ErrorSource[SquarenessTable, Angles]):
    """The table [squareness]."""

    key = "squareness"
    field = "squareness"
    numbers = (Tilt(),)
    schema: Schema = (
        SquarenessTable,
        Field(default_factory=SquarenessTable, description="the table [squareness]"),
    )

    def example(self, by: float) -> Example:
        angles = {"C0Y": 40.0 * by, "B0Z": 25.0 * by, "A0Z": 60.0 * by}
        lines = (f"{n}_urad = {v}\nsigma_{n}_urad = {0.1 * v}\n" for n, v in angles.items())
        return Example("[squareness]\n" + "".join(lines))

    def read(self, stated: SquarenessTable, reading: Reading) -> Angles:
        return {name: shifted(getattr(stated, f"{name}_urad"), -6) for name in SQUARENESS}

    def write(self, values: Angles, writing: Writing) -> None:
        writing.table(
            "[squareness]",
            {f"{name}_urad": in_unit(values.get(name, 0.0), -6) for name in SQUARENESS},
        )

    def sigmas(self, stated: SquarenessTable, reading: Reading) -> Sigmas:
        sigma = {name: shifted(getattr(stated, f"sigma_{name}_urad"), -6) for name in SQUARENESS}
        return {name: value for name, value in sigma.items() if value}

    def entries(self, values: Angles, sigmas: Sigmas) -> list[Entry]:
        return [alone("squareness", name, value) for name, value in sigmas.items()]

    def fingerprint(self, values: Angles, datum_mm: Vector) -> Iterator[str]:
        yield " ".join(f"{name} {digits(values.get(name, 0.0))}" for name in SQUARENESS)

    def inspect(self, values: Angles, frame: Frame) -> dict[str, Any]:
        return {"squareness": {f"{name}_urad": values.get(name, 0.0) / RAD_PER_URAD for name in SQUARENESS}}
