"""What an adjustment estimates, and how the error of a pose depends on it: linear, to first order.

A displacement curve is parametrised as it was measured, at the functional point on its own line and with its
own reflector. So an angle that was not measured changes nothing there. The contribution of axis j at axis
positions P with tool t is E_j(q) + eps_j(q) x [L_j(P, t) - L_j(line)], see `olp.errormodel.bodies`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from typing import Protocol

import numpy as np

from olp.calibration.estimator.basis import CurveSpace, Wave, slope_grid, slope_weights
from olp.calibration.observations.sensors import shapes_of, warmed
from olp.core.arrays import Array
from olp.core.machine import COMPONENTS, SQUARENESS, ZERO, Vector
from olp.core.units import AXES
from olp.core.values import dataclass

#: An angle about a adds sign * angle * lever arm k to row i: (i, a, k, sign).
CROSS = ((0, 1, 2, 1.0), (0, 2, 1, -1.0), (1, 2, 0, 1.0), (1, 0, 2, -1.0), (2, 0, 1, 1.0), (2, 1, 0, -1.0))
#: Row, axis and sign of what a squareness adds, times the distance of that axis from the datum.
SHEAR = {"C0Y": (0, 1, -1.0), "B0Z": (0, 2, 1.0), "A0Z": (1, 2, -1.0)}
#: Turns of the frame are multiplied by this lever arm (1 m), so that all unknowns have one size.
LEVER_ARM_MM = 1000.0

Part = tuple[slice, Array]


class Unknowns(Protocol):
    """What a block of points, lengths or directions needs: how its tips depend on theta, (n, 3, size)."""

    @property
    def size(self) -> int: ...

    def design(self, position: Array, tool: Array, /) -> Array: ...


@dataclass(frozen=True, slots=True)
class MeasuringLine:
    """Where a displacement was measured: the other axes' positions and the vector to the reflector."""

    line_mm: Vector
    tool_mm: Vector = ZERO


@dataclass(frozen=True, slots=True, eq=False)
class Parameters:
    """The layout of theta: `spaces` of the means of all 18 curves, `halves` of those whose half difference of
    directions is estimated, `waves` of cyclic terms, the three squareness errors, and `shared` nuisances.

    `measuring_lines` holds that of each displacement curve. `slices` holds the part of theta by name:
    "EXX", "half EXX", "wave EXX", "C0Y" and the names of shared nuisances. With `framed` some points were
    measured in the machine's frame. Theta then has a part "frame" of nine numbers: shift (mm) and turn of the
    axes in that frame, and turn of the tool vectors. Turns are in rad times LEVER_ARM_MM.
    `sensors_degC` are the sensors beside lines with the temperature at which curves hold, `warm` the
    components that change with them: their parts are "warm EXX".

    `slopes` are the mean slopes of the straightness curves on lines through the datum with no tool, as
    functionals of theta. Curves are straight on their own lines. Tool vectors count from the axes as they
    are on lines through the datum. So the frame of the curves is turned against tool vectors, by `turn`.
    """

    chain: str
    datum_mm: Vector
    spaces: Mapping[str, CurveSpace]
    measuring_lines: Mapping[str, MeasuringLine]
    halves: Mapping[str, CurveSpace] = field(default_factory=dict)
    waves: Mapping[str, tuple[Wave, ...]] = field(default_factory=dict)
    shared: tuple[str, ...] = ()
    framed: bool = False
    warm: tuple[str, ...] = ()
    sensors_degC: Mapping[str, float] = field(default_factory=dict)
    slices: Mapping[str, slice] = field(init=False)
    size: int = field(init=False)
    slopes: Mapping[str, Array] = field(init=False)

    def __post_init__(self) -> None:
        slices: dict[str, slice] = {}
        offset = 0
        sizes = [(name, self.spaces[name].size) for name in COMPONENTS]
        sizes += [(f"half {name}", space.size) for name, space in self.halves.items()]
        sizes += [(f"wave {name}", 2 * len(terms)) for name, terms in self.waves.items()]
        sizes += [(f"warm {n}", len(shapes_of(n, self.warm)) * len(self.sensors_degC)) for n in self.warm]
        sizes += [(name, 1) for name in (*SQUARENESS, *self.shared)]
        sizes += [("frame", 9)] if self.framed else []
        for name, size in sizes:
            slices[name] = slice(offset, offset + size)
            offset += size
        object.__setattr__(self, "slices", slices)
        object.__setattr__(self, "size", offset)
        names = [name for name in COMPONENTS if name[1] in AXES and name[1] != name[2]]
        object.__setattr__(self, "slopes", {name: self._mean_slope(name) for name in names})

    @property
    def turn(self) -> Array:
        """(3, size) rotation of the frame that the gauge of the datum asks for, as functionals of theta."""
        return np.stack([-self.slopes["EZY"], self.slopes["EZX"], -self.slopes["EYX"]])

    def _mean_slope(self, name: str) -> Array:
        axis, row = AXES.index(name[2]), AXES.index(name[1])
        spline = self.spaces[name].spline
        grid, weights = slope_grid(spline), slope_weights(spline)
        position = np.tile(np.array(self.datum_mm), (len(grid), 1))
        position[:, axis] = grid
        functional = np.zeros(self.size)
        for part, values in self.displacement(row, axis, position, np.zeros(3)):
            if part != self.slices.get(f"wave {name}"):
                functional[part] += weights @ values
        return functional

    def after(self, axis: int) -> tuple[int, ...]:
        """The axes that `axis` carries toward the tool."""
        order = self.chain.replace("F", "")
        return tuple(AXES.index(name) for name in order[order.index(AXES[axis]) + 1 :])

    def curve(self, name: str, q: Array, direction: Array | None = None) -> list[Part]:
        """The parts of theta that a component depends on at q (n,), and their (n, k) coefficients.

        `direction` (n,) is +1 or -1; without it the mean of both holds.
        """
        parts = [(self.slices[name], self.spaces[name].values(q))]
        if direction is not None and name in self.halves:
            parts.append((self.slices[f"half {name}"], direction[:, None] * self.halves[name].values(q)))
        if name in self.waves:
            values = np.concatenate([wave.values(q) for wave in self.waves[name]], axis=1)
            parts.append((self.slices[f"wave {name}"], values))
        return parts

    def displacement(
        self, row: int, axis: int, position: Array, tool: Array, direction: Array | None = None,
        *, on_table: bool = False,
    ) -> Iterator[Part]:  # fmt: skip
        """The parts of what `axis` adds to displacement `row` at axis positions (n, 3) with tool vectors (3,)
        or (n, 3); `on_table`: as read at a reflector that is fixed on the table. `direction` is (n,)."""
        q = position[:, axis]
        yield from self.curve(f"E{AXES[row]}{AXES[axis]}", q, direction)
        for i, a, k, sign in CROSS:
            if i != row:
                continue
            lever_arm = self.lever_arm(row, axis, k, position, tool)
            if on_table and k == axis:
                lever_arm = lever_arm - (q - self.datum_mm[axis])
            if np.any(lever_arm != 0.0):
                for part, values in self.curve(f"E{'ABC'[a]}{AXES[axis]}", q, direction):
                    yield part, sign * lever_arm[:, None] * values

    def warmed(self, name: str, q: Array, sensors_degC: Mapping[str, Array]) -> list[Part]:
        """The parts of what temperatures (n,) do to a component at q (n,); none without sensors."""
        if name not in self.warm or not sensors_degC:
            return []
        rise = {one: sensors_degC[one] - at for one, at in self.sensors_degC.items()}
        columns = warmed(self.span_mm(name), q, rise, shapes_of(name, self.warm))
        return [(self.slices[f"warm {name}"], columns)]

    def span_mm(self, name: str) -> tuple[float, float]:
        """The axis positions that a component spans."""
        spline = self.spaces[name].spline
        return spline.low_mm, spline.high_mm

    def distortion(
        self, row: int, axis: int, position: Array, tool: Array, sensors_degC: Mapping[str, Array],
        *, on_table: bool,
    ) -> Iterator[Part]:  # fmt: skip
        """As `displacement`, what temperatures (n,) add. A displacement that does not change with them is
        still where the axis was positioned, so its angles act from there."""
        own, q = f"E{AXES[row]}{AXES[axis]}", position[:, axis]
        yield from self.warmed(own, q, sensors_degC)
        seen_from = row if own in self.warm else axis
        for i, a, k, sign in CROSS:
            for part, values in self.warmed(f"E{'ABC'[a]}{AXES[axis]}", q, sensors_degC) if i == row else ():
                lever_arm = self.lever_arm(seen_from, axis, k, position, tool)
                if on_table and k == axis:
                    lever_arm = lever_arm - (q - self.datum_mm[axis])
                yield part, sign * lever_arm[:, None] * values

    def lever_arm(self, row: int, axis: int, k: int, position: Array, tool: Array) -> Array:
        """(n,) coordinate `k` of the lever arm by which angles of `axis` act on displacement `row`."""
        line = self.measuring_lines[f"E{AXES[row]}{AXES[axis]}"]
        lever_arm = np.broadcast_to(tool[..., k] - line.tool_mm[k], (len(position),))
        return lever_arm + (position[:, k] - line.line_mm[k]) if k in self.after(axis) else lever_arm

    def shear(self, row: int, position: Array) -> Iterator[Part]:
        """The parts of what squareness adds to displacement `row` at axis positions (n, 3)."""
        for name, (i, axis, sign) in SHEAR.items():
            if i == row:
                yield self.slices[name], sign * (position[:, axis, None] - self.datum_mm[axis])

    def design(self, position: Array, tool: Array, play: Array | None = None) -> Array:
        """(n, 3, size) dependence of the error on theta at axis positions (n, 3), tool vectors (3,) or
        (n, 3) and directions `play` (n, 3) in [-1, 1]."""
        table = np.zeros((len(position), 3, self.size))
        tool = np.asarray(tool, float)
        for row in range(3):
            for axis in range(3):
                side = None if play is None else play[:, axis]
                for part, values in self.displacement(row, axis, position, tool, side):
                    table[:, row, part] += values
            for part, values in self.shear(row, position):
                table[:, row, part] += values
        if self.framed:
            start = self.slices["frame"].start
            table[:, :, start : start + 6] = frame_columns(position - np.array(self.datum_mm))
            turned = frame_columns(np.broadcast_to(tool, position.shape))[:, :, 3:]
            table[:, :, start + 6 : start + 9] = turned
        elif tool.any():
            table -= turned_by(self.turn, np.broadcast_to(tool, position.shape))
        return table


def turned_by(turn: Array, arm: Array) -> Array:
    """(n, 3, size) by how much a rotation `turn` (3, size) moves the ends of arms (n, 3)."""
    table = np.empty((len(arm), 3, turn.shape[1]))
    for row in range(3):
        k, m = (row + 1) % 3, (row + 2) % 3
        table[:, row] = arm[:, m, None] * turn[k] - arm[:, k, None] * turn[m]
    return table


def frame_columns(arm: Array, *, scale: bool = False) -> Array:
    """(n, 3, 6 or 7) what shifts, turns and the scale of the frame do to points at `arm` from the centre."""
    columns = np.zeros((len(arm), 3, 7 if scale else 6))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        columns[:, k, k] = 1.0
        columns[:, i, 3 + k] = -arm[:, j] / LEVER_ARM_MM
        columns[:, j, 3 + k] = arm[:, i] / LEVER_ARM_MM
    if scale:
        columns[:, :, 6] = arm / LEVER_ARM_MM
    return columns


def gathered(parts: Sequence[Part], n: int) -> tuple[Array, np.ndarray]:
    """Parts as one (n, k) matrix and the (k,) columns of theta that it depends on."""
    used = sorted({(part.start, part.stop) for part, _ in parts})
    columns = np.concatenate([np.arange(*span) for span in used])
    start = dict(zip([span[0] for span in used], np.cumsum([0, *(b - a for a, b in used)]), strict=False))
    rows = np.zeros((n, len(columns)))
    for part, values in parts:
        first = int(start[part.start])
        rows[:, first : first + values.shape[1]] += values
    return rows, columns
