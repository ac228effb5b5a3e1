"""Deflection and slope of a beam under a load that moves along it, as compliance tables.

A load P at a from one end and b from the other of a beam of length L = a + b, downward deflection and slope
of the elastic line at the load (Euler-Bernoulli; solved from E I w'''' = 0 with the conditions of each
support):

    simple       P a^2 b^2 / (3 E I L)        P a b (b - a) / (3 E I L)
    fixed        P a^3 b^3 / (3 E I L^3)      P a^2 b^2 (b - a) / (2 E I L^3)
    cantilever   P a^3 / (3 E I)              P a^2 / (2 E I)           a from the clamped end
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import ZERO, Vector
from olp.core.units import AXES
from olp.errormodel.gridded import COVER_MM, ComponentTable

#: Standard gravity (CGPM 1901), in N per kg.
GRAVITY_N_KG = 9.80665
#: Nodes of the table of a beam: a cubic misses less than 1e-4 of the deflection between them.
_NODES = 65


def tube_mm4(width_mm: float, height_mm: float, wall_mm: float) -> float:
    """Second moment of area in mm4 of a rectangular tube, bent in the direction of its height."""
    inner = max(width_mm - 2.0 * wall_mm, 0.0) * max(height_mm - 2.0 * wall_mm, 0.0) ** 3
    return (width_mm * height_mm**3 - inner) / 12.0


@dataclass(frozen=True, slots=True)
class Beam:
    """A beam along `axis`, loaded where the axis stands; `span_mm` holds the axis positions over its two ends
    (a cantilever is clamped at the first). `line_mm` and `tool_mm` say where the neutral line lies: there
    the tip moves by the deflection alone. `direction` is where the weight pulls. Raises ConfigError."""

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
            raise ConfigError(f"beam of axis {self.axis}: expected a span, modulus and section above 0")

    def bends(self, q: Array) -> tuple[Array, Array]:
        """Deflection in mm and slope in rad, both per kg and along `direction`, at axis positions q (n,)."""
        first, second = self.span_mm
        sense = np.sign(second - first)
        length = abs(second - first)
        a = (q - first) * sense
        b = length - a
        # N/kg over N/mm2 mm4
        unit = GRAVITY_N_KG / (self.youngs_modulus_GPa * 1e3 * self.second_moment_mm4)
        if self.support == "simple":
            return unit * a**2 * b**2 / (3.0 * length), sense * unit * a * b * (b - a) / (3.0 * length)
        if self.support == "fixed":
            return (
                unit * a**3 * b**3 / (3.0 * length**3),
                sense * unit * a**2 * b**2 * (b - a) / (2.0 * length**3),
            )
        return unit * a**3 / 3.0, sense * unit * a**2 / 2.0

    def problems(self, box_mm: Array) -> list[str]:
        low, high = box_mm[AXES.index(self.axis)]
        least, most = sorted(self.span_mm)
        if low >= least - COVER_MM and high <= most + COVER_MM:
            return []
        return [
            f"beam of axis {self.axis} spans {least:g} to {most:g} mm; expected all of the box, {low:g} "
            f"to {high:g} mm, "
            "between its ends"
        ]

    def table(self, box_mm: Array, chain: str) -> ComponentTable:
        """The compliance that it makes. On an axis that carries the workpiece the beam takes the workpiece
        down, so the tool up; its slope is seen along a coordinate that runs against the table."""
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
