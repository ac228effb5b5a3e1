"""Errors that repeat with the pitch of a screw or the period of a scale.

They act on components, so an angular one has lever arms too (`olp.errormodel.bodies`): those of the curves of
its axis, unless it states where and with what tool it was measured. They are evaluated directly: no table of
affordable size resolves a period of some hundredths of a millimetre.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Literal

import numpy as np

from olp.core.arrays import Array
from olp.core.interpolation import Column
from olp.core.machine import COMPONENTS, Vector
from olp.core.schema import Position, Positive, Table, Triple
from olp.core.schema_keys import Field, Known, refusal, rule
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM, in_unit, shifted
from olp.core.values import dataclass
from olp.errormodel.entry import AxisState, Entry, Numbers, Slot, component_acts
from olp.errormodel.gridded import refuse
from olp.errormodel.sources.base import (
    ErrorSource,
    Example,
    Frame,
    Reading,
    Schema,
    Writing,
    digits,
    floats,
    line_at,
    line_key,
)


@dataclass(frozen=True, slots=True)
class Cyclic:
    """amplitude * sin(2 pi q / period + phase) on a component, q the position of its axis; mm or rad.

    An angular one may have been measured on another line than the curves of its axis, with another tool or
    another reference (see `Curve`); None stands for those of the curves. Raises ConfigError.
    """

    component: str
    period_mm: float
    amplitude: float
    phase_rad: float = 0.0
    line_mm: Vector | None = None
    tool_mm: Vector | None = None
    reference: Literal["functional-point", "table"] | None = None

    def __post_init__(self) -> None:
        problems = []
        if self.component not in COMPONENTS:
            problems.append(f"cyclic component '{self.component}'; expected a name such as EXX or EAX")
        if not (np.isfinite(self.period_mm) and self.period_mm > 0.0):
            problems.append(f"cyclic {self.component}: period {self.period_mm} mm; expected more than 0")
        if not (np.isfinite(self.amplitude) and np.isfinite(self.phase_rad)):
            problems.append(f"cyclic {self.component}: amplitude and phase must be finite")
        if self.component[1:2] in AXES and self.measured():
            problems.append(
                f"cyclic {self.component} has no lever arm; expected no {', '.join(self.measured())}"
            )
        refuse(problems)

    def measured(self) -> dict[str, Any]:
        """What it states of its measurement, by the names that a `Curve` has for it."""
        stated = {"line_mm": self.line_mm, "tool_mm": self.tool_mm, "reference": self.reference}
        return {name: value for name, value in stated.items() if value is not None}


def cyclic_value(term: Cyclic, q: Array) -> Array:
    """(n,) amplitude * sin(2 pi q / period + phase) at axis positions q (n,) in mm; mm or rad."""
    angle = q * (2.0 * math.pi / term.period_mm)
    angle += term.phase_rad
    value = np.sin(angle, out=angle)
    value *= term.amplitude
    return value


class CyclicTable(Table):
    component: Literal[COMPONENTS] = Field(  # type: ignore[valid-type]
        description='the ISO 230-1 name of a component error, such as "EXX"'
    )
    period_mm: Positive = Field(description="the period along the axis, in mm")
    amplitude_um: float | None = Field(
        default=None, description="the amplitude (peak) of a linear error, in um"
    )
    amplitude_urad: float | None = Field(
        default=None, check_default=True, description="the amplitude (peak) of an angular error, in urad"
    )
    phase_rad: float = Field(default=0.0, description="the phase at axis position 0, in rad")
    line_mm: Position | None = Field(
        default=None,
        description="positions of the other axes while an angular error was measured, such as "
        "{ Y = 0.0, Z = 0.0 } in mm; as of the axis's curve if left out, else the datum",
    )
    tool_mm: Triple | None = Field(
        default=None,
        description="the tool vector then, [X, Y, Z] in mm; as of the axis's curve if left out, else zero",
    )
    reference: Literal["functional-point", "table"] | None = Field(
        default=None,
        description='"functional-point" or "table"; as of the axis\'s curve if left out, else '
        '"functional-point"',
    )

    @rule("line_mm", "tool_mm", "reference")
    @staticmethod
    def _only_of_angles(value: object, known: Known) -> object:
        component = known.get("component")
        if value is not None and component is not None and component[1] not in "ABC":
            raise refusal(
                f"does not fit component {component}, which has no lever arm; expected this key left out, or "
                "an angular component such as EAX"
            )
        return value

    @rule("amplitude_urad")
    @staticmethod
    def _unit_fits(urad: float | None, known: Known) -> float | None:
        component = known.get("component")
        if component is None or "amplitude_um" not in known:
            return urad
        um = known["amplitude_um"]
        angular = component[1] in "ABC"
        if (um if angular else urad) is not None or (urad if angular else um) is None:
            wanted = "amplitude_urad, in urad" if angular else "amplitude_um, in um"
            raise refusal(f"does not fit component {component}; expected exactly one amplitude: {wanted}")
        return urad


class Wave(Numbers):
    """The sine and the cosine part of one period."""

    kind = "wave"
    names = COMPONENTS

    def count(self, entry: Entry) -> int:
        return 2 if entry.period_mm > 0.0 else 0

    def acts(self, entry: Entry, state: AxisState) -> Iterator[tuple[int, Column]]:
        yield from component_acts(entry.name, 1.0, state)

    def weights(self, entry: Entry, q: Array) -> Iterator[Slot]:
        angle = q * (2.0 * np.pi / entry.period_mm)
        yield np.zeros(len(q), np.int32), np.sin(angle)
        yield np.ones(len(q), np.int32), np.cos(angle)

    def part_weights(self, entry: Entry, q: Array) -> Iterator[Slot]:
        for part, (number, weight) in enumerate(self.weights(entry, q)):
            yield number, entry.rest[part] * weight


class CyclicErrors(ErrorSource[list[CyclicTable], tuple[Cyclic, ...]]):
    """Tables [[cyclic]]."""

    key = "cyclic"
    field = "cyclic"
    numbers = (Wave(),)
    schema: Schema = (list[CyclicTable], Field(default=[], description="tables [[cyclic]]"))

    def example(self, by: float) -> Example:
        screw = f'[[cyclic]]\ncomponent = "EXX"\nperiod_mm = 10.0\namplitude_um = {2.0 * by}\n'
        roll = f'[[cyclic]]\ncomponent = "EAZ"\nperiod_mm = 40.0\namplitude_urad = {15.0 * by}\n'
        measured = 'line_mm = { X = 50.0, Y = 20.0 }\ntool_mm = [0.0, 10.0, -60.0]\nreference = "table"\n'
        return Example(f"{screw}{roll}phase_rad = 0.7\n{measured}")

    def read(self, stated: list[CyclicTable], reading: Reading) -> tuple[Cyclic, ...]:
        return tuple(
            Cyclic(
                table.component,
                table.period_mm,
                shifted(table.amplitude_urad or 0.0, -6)
                if table.amplitude_um is None
                else shifted(table.amplitude_um, -3),
                table.phase_rad,
                None if table.line_mm is None else line_at(table.line_mm, reading.datum_mm),
                table.tool_mm,
                table.reference,
            )
            for table in stated
        )

    def write(self, values: tuple[Cyclic, ...], writing: Writing) -> None:
        for term in values:
            angular = term.component[1] in "ABC"
            writing.table(
                "[[cyclic]]",
                {
                    "component": term.component,
                    "period_mm": term.period_mm,
                    "amplitude_um": None if angular else in_unit(term.amplitude, -3),
                    "amplitude_urad": in_unit(term.amplitude, -6) if angular else None,
                    "phase_rad": term.phase_rad,
                    "line_mm": line_key(term.line_mm, term.component[2]),
                    "tool_mm": None if term.tool_mm is None else floats(term.tool_mm),
                    "reference": term.reference,
                },
            )

    def fingerprint(self, values: tuple[Cyclic, ...], datum_mm: Vector) -> Iterator[str]:
        for term in values:
            yield f"{term.component} {digits([term.period_mm, term.amplitude, term.phase_rad])}"
            # a term that states nothing keeps the fingerprint that it had before these keys
            for name, value in term.measured().items():
                yield f"{name} {value if name == 'reference' else digits(value)}"

    def inspect(self, values: tuple[Cyclic, ...], frame: Frame) -> dict[str, Any]:
        return {
            f"cyclic_{title}": [
                {
                    "name": term.component,
                    "period_mm": term.period_mm,
                    f"amplitude_{unit}": term.amplitude * scale,
                }
                for term in values
                if term.component[1] in directions
            ]
            for title, directions, unit, scale in (
                ("position_errors", "XYZ", "um", UM_PER_MM),
                ("angular_errors", "ABC", "urad", 1.0 / RAD_PER_URAD),
            )
        }
