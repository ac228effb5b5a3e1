"""Deflection and slope of a beam under a load that moves along it, as compliance tables.

A beam of length L = a + b has a load P at distance a from one end and b from the other. Downward deflection
and slope of the elastic line at the load (Euler-Bernoulli, from E I w'''' = 0 with the conditions of each
support) are:

    simple       P a^2 b^2 / (3 E I L)        P a b (b - a) / (3 E I L)
    fixed        P a^3 b^3 / (3 E I L^3)      P a^2 b^2 (b - a) / (2 E I L^3)
    cantilever   P a^3 / (3 E I)              P a^2 / (2 E I)           a from the clamped end
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import ZERO, Vector
from olp.core.schema import Positive
from olp.core.schema_keys import Field, Known, refusal, rule
from olp.core.units import AXES
from olp.core.values import dataclass
from olp.errormodel.gridded import COVER_MM, ComponentTable
from olp.errormodel.sources.base import (
    ErrorSource,
    Example,
    Frame,
    Reading,
    Schema,
    Writing,
    floats,
    line_at,
    line_key,
)
from olp.errormodel.sources.compliance import OnLine

#: Standard gravity (CGPM 1901), in N per kg.
GRAVITY_N_KG = 9.80665
#: Nodes of the table of a beam: between them a cubic is wrong by less than 1e-4 of the deflection.
_NODES = 65


def tube_mm4(width_mm: float, height_mm: float, wall_mm: float) -> float:
    """Second moment of area in mm4 of a rectangular tube, bent in the direction of its height."""
    inner = max(width_mm - 2.0 * wall_mm, 0.0) * max(height_mm - 2.0 * wall_mm, 0.0) ** 3
    return (width_mm * height_mm**3 - inner) / 12.0


@dataclass(frozen=True, slots=True)
class Beam:
    """A beam along `axis`, loaded at the position of the axis. `span_mm` holds the axis positions over its
    two ends (a cantilever is clamped at the first). `line_mm` and `tool_mm` say where the neutral line lies:
    there the tip moves by the deflection alone. `direction` is that of the weight. Raises ConfigError."""

    axis: str
    support: Literal["simple", "fixed", "cantilever"]
    span_mm: tuple[float, float]
    youngs_modulus_GPa: float
    second_moment_mm4: float
    direction: str = "-Z"
    line_mm: Vector | None = None
    tool_mm: Vector = ZERO

    def __post_init__(self) -> None:
        if self.axis not in AXES or self.direction[1:] not in AXES or self.direction[1:] == self.axis:
            raise ConfigError(
                f"beam of axis {self.axis} with weight along {self.direction}; expected a direction across it"
            )
        if self.span_mm[0] == self.span_mm[1] or min(self.youngs_modulus_GPa, self.second_moment_mm4) <= 0.0:
            raise ConfigError(
                f"beam of axis {self.axis}: expected two different ends, and modulus and section above 0"
            )

    def bends(self, q: Array) -> tuple[Array, Array]:
        """Deflection in mm and slope in rad, both per kg and along `direction`, at axis positions q (n,)."""
        first, second = self.span_mm
        sign = np.sign(second - first)
        length = abs(second - first)
        a = (q - first) * sign
        b = length - a
        # N/kg over N/mm2 mm4
        unit = GRAVITY_N_KG / (self.youngs_modulus_GPa * 1e3 * self.second_moment_mm4)
        if self.support == "simple":
            return unit * a**2 * b**2 / (3.0 * length), sign * unit * a * b * (b - a) / (3.0 * length)
        if self.support == "fixed":
            return (
                unit * a**3 * b**3 / (3.0 * length**3),
                sign * unit * a**2 * b**2 * (b - a) / (2.0 * length**3),
            )
        return unit * a**3 / 3.0, sign * unit * a**2 / 2.0

    def problems(self, box_mm: Array) -> list[str]:
        low, high = box_mm[AXES.index(self.axis)]
        least, most = sorted(self.span_mm)
        if low >= least - COVER_MM and high <= most + COVER_MM:
            return []
        return [
            f"beam of axis {self.axis} spans {least:g} to {most:g} mm; expected all of the box, {low:g} to "
            f"{high:g} mm, between its ends"
        ]

    def table(self, box_mm: Array, chain: str) -> ComponentTable:
        """The compliance of the beam. On an axis that carries the workpiece the beam lowers the workpiece,
        so relative to it the tool rises. The slope is then along a coordinate opposite to the table's."""
        j, i = AXES.index(self.axis), AXES.index(self.direction[1])
        q = np.linspace(float(box_mm[j, 0]), float(box_mm[j, 1]), _NODES)
        deflection, slope = self.bends(q)
        sign = -1.0 if self.direction[0] == "-" else 1.0
        carries = chain.index(self.axis) < chain.index("F")
        # the turn that lifts the axis towards i: its vector is axis x i
        a = 3 - i - j
        turn = sign * (1.0 if (j, i) in ((0, 1), (1, 2), (2, 0)) else -1.0)
        return ComponentTable(
            axis=self.axis,
            arguments=(self.axis,),
            knots_mm=(q,),
            columns={
                f"E{AXES[i]}{self.axis}": deflection * (-sign if carries else sign),
                f"E{'ABC'[a]}{self.axis}": slope * turn,
            },
            line_mm=self.line_mm,
            tool_mm=self.tool_mm,
            name=f"beam of axis {self.axis}",
        )


class BeamTable(OnLine):
    axis: Literal["X", "Y", "Z"] = Field(description="the axis that moves the load along the beam")
    support: Literal["simple", "fixed", "cantilever"] = Field(
        description='"simple" (rests on both ends), "fixed" (clamped at both ends), or "cantilever" '
        "(clamped at the first end of span_mm; a ram that comes out farther)"
    )
    span_mm: tuple[float, float] = Field(
        description="the axis positions at which the load stands over the two supports, [first, second] in mm"
    )
    youngs_modulus_GPa: Positive = Field(description="Young's modulus of the beam, in GPa: 210 for steel")
    second_moment_mm4: Positive | None = Field(
        default=None, description="the second moment of area of the section, in mm4"
    )
    section_mm: tuple[Positive, Positive, Positive] | None = Field(
        default=None,
        check_default=True,
        description="a rectangular tube instead: [width, height in the direction of bending, wall] in mm",
    )
    direction: Literal["+X", "-X", "+Y", "-Y", "+Z", "-Z"] = Field(
        default="-Z", description='the direction of the weight, "-Z" if left out'
    )

    @rule("span_mm")
    @staticmethod
    def _not_empty(value: tuple[float, float], known: Known) -> tuple[float, float]:
        if value[0] == value[1]:
            raise refusal("= is empty; expected the axis positions of two different ends, in mm")
        return value

    @rule("section_mm")
    @staticmethod
    def _one_of_two(
        value: tuple[float, float, float] | None, known: Known
    ) -> tuple[float, float, float] | None:
        if "second_moment_mm4" not in known:
            return value
        if (value is None) == (known["second_moment_mm4"] is None):
            raise refusal("or second_moment_mm4: expected exactly one of the two")
        if value is not None and 2.0 * value[2] > min(value[:2]):
            raise refusal(f"has a wall of {value[2]:g} mm; expected at most half of width and height")
        return value

    @rule("direction")
    @staticmethod
    def _across(value: str, known: Known) -> str:
        if value[1] == known.get("axis"):
            raise refusal(f'= "{value}" is along the beam; expected a direction across it')
        return value


class Beams(ErrorSource[list[BeamTable], tuple[Beam, ...]]):
    """Tables [[compliance_beam]]."""

    key = "compliance_beam"
    field = "beams"
    schema: Schema = (
        list[BeamTable],
        Field(default=[], description="tables [[compliance_beam]], beams that bend under the payload"),
    )
    covered = False

    def example(self, by: float) -> Example:
        # no beam is stiff beyond reason
        modulus = 210.0 / max(by, 1e-30)
        table = '[[compliance_beam]]\naxis = "X"\nsupport = "simple"\nspan_mm = [-100.0, 500.0]\n'
        table += "section_mm = [40.0, 60.0, 5.0]\ntool_mm = [0.0, 0.0, -80.0]\n"
        return Example(f"{table}youngs_modulus_GPa = {modulus}\n")

    def read(self, stated: list[BeamTable], reading: Reading) -> tuple[Beam, ...]:
        return tuple(_beam(table, reading.datum_mm) for table in stated)

    def write(self, values: tuple[Beam, ...], writing: Writing) -> None:
        for beam in values:
            writing.table(
                "[[compliance_beam]]",
                {
                    "axis": beam.axis,
                    "support": beam.support,
                    "span_mm": floats(beam.span_mm),
                    "youngs_modulus_GPa": beam.youngs_modulus_GPa,
                    "second_moment_mm4": beam.second_moment_mm4,
                    "direction": beam.direction,
                    "line_mm": line_key(beam.line_mm, beam.axis),
                    "tool_mm": floats(beam.tool_mm),
                },
            )

    def loads(self, values: tuple[Beam, ...], frame: Frame) -> list[ComponentTable]:
        return [beam.table(frame.box_mm, frame.chain) for beam in values]


def _beam(table: BeamTable, datum_mm: Vector) -> Beam:
    second_moment = table.second_moment_mm4
    if second_moment is None:
        assert table.section_mm is not None
        second_moment = tube_mm4(*table.section_mm)
    return Beam(
        axis=table.axis,
        support=table.support,
        span_mm=table.span_mm,
        youngs_modulus_GPa=table.youngs_modulus_GPa,
        second_moment_mm4=second_moment,
        direction=table.direction,
        line_mm=line_at(table.line_mm, datum_mm),
        tool_mm=table.tool_mm,
    )
