"""An error source that `olp` does not have, as its one file would be: a ram that hangs lower the farther it
is out. `test_new_source` puts it into a copy of the package."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.interpolation import Column
from olp.core.machine import Vector
from olp.core.schema import NotNegative, Table
from olp.core.schema_keys import Field
from olp.core.units import UM_PER_MM, in_unit, shifted
from olp.errormodel.base import ErrorModel
from olp.errormodel.boxed import Boxed, as_points
from olp.errormodel.entry import AxisState, Entry, Numbers, Slot, alone
from olp.errormodel.sources.base import ErrorSource, Example, Frame, Reading, Schema, Sigmas, Writing, digits


@dataclass(frozen=True, slots=True)
class Sag:
    """The tip sinks by `per_mm2` (q - `from_mm`)^2 where Y stands at q; 1/mm and mm."""

    per_mm2: float
    from_mm: float


@dataclass(frozen=True, slots=True, eq=False)
class SagErrors(Boxed):
    """The error of it."""

    sag: Sag

    def error(self, axis_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
        points = self.clamped(as_points(axis_mm))
        result = np.zeros(points.shape)
        result[:, 2] = -self.sag.per_mm2 * (points[:, 1] - self.sag.from_mm) ** 2
        return result

    def rotation(self, axis_mm: Array, play: Array | None = None, payload_kg: Array | float = 0.0) -> Array:
        return np.zeros(as_points(axis_mm).shape)

    def contributions(
        self, axis_mm: Array, tool_mm: Array, play: Array | None = None
    ) -> Iterator[tuple[str, Array]]:
        value = self.error(axis_mm, tool_mm)
        if np.any(value != 0.0):
            yield "sag", value

    @property
    def depends_on(self) -> Mask:
        depends = np.zeros((3, 3), np.bool_)
        depends[2, 1] = self.sag.per_mm2 != 0.0
        return depends

    def backlash_at(self, axis_mm: Array) -> Array | None:
        return None

    def chord_bound(self, delta_mm: Array, tool_mm: Array) -> Array:
        return np.asarray(abs(self.sag.per_mm2) * as_points(delta_mm)[:, 1] ** 2 / 4.0)


class SagTable(Table):
    sag_um_m2: float = Field(description="how far the tip sinks, in um per m2")
    from_mm: float = Field(description="the position of Y where it does not sink, in mm")
    sigma_um_m2: NotNegative = Field(default=0.0, description="the standard uncertainty of sag_um_m2")


class SagNumber(Numbers):
    """The one number of it."""

    kind = "sag"
    names = ("SAG_Y",)

    def acts(self, entry: Entry, state: AxisState) -> Iterator[tuple[int, Column]]:
        yield 2, -1.0

    def weights(self, entry: Entry, q: Array) -> Iterator[Slot]:
        yield np.zeros(len(q), np.int32), (q - entry.position_mm[0]) ** 2

    def part_weights(self, entry: Entry, q: Array) -> Iterator[Slot]:
        yield from ((number, entry.rest[0] * weight) for number, weight in self.weights(entry, q))


class Sags(ErrorSource[SagTable | None, Sag | None]):
    """The table [sag]."""

    key = "sag"
    numbers = (SagNumber(),)
    schema: Schema = (SagTable | None, Field(default=None, description="the table [sag]"))

    def example(self, by: float) -> Example:
        return Example(f"[sag]\nsag_um_m2 = {300.0 * by}\nfrom_mm = 20.0\nsigma_um_m2 = {30.0 * by}\n")

    def read(self, stated: SagTable | None, reading: Reading) -> Sag | None:
        return None if stated is None else Sag(shifted(stated.sag_um_m2, -9), stated.from_mm)

    def write(self, values: Sag, writing: Writing) -> None:
        writing.table("[sag]", {"sag_um_m2": in_unit(values.per_mm2, -9), "from_mm": values.from_mm})

    def models(self, values: Sag, frame: Frame) -> list[ErrorModel]:
        return [SagErrors(frame.box_mm, frame.hold, values)]

    def sigmas(self, stated: SagTable | None, reading: Reading) -> Sigmas:
        return {} if stated is None else {"SAG_Y": shifted(stated.sigma_um_m2, -9)}

    def entries(self, values: Sag, sigmas: Sigmas) -> list[Entry]:
        return [alone("sag", name, sigma, np.array([values.from_mm])) for name, sigma in sigmas.items()]

    def fingerprint(self, values: Sag, datum_mm: Vector) -> Iterator[str]:
        yield f"sag {digits([values.per_mm2, values.from_mm])}"

    def inspect(self, values: Sag, frame: Frame) -> dict[str, Any]:
        return {"sag": {"sag_um_m2": values.per_mm2 * UM_PER_MM * 1e6, "from_mm": values.from_mm}}
