"""What could be measured next with an instrument: points of a tracker, or stations of lengths."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from olp.calibration.design import layout
from olp.calibration.design.choosing import Candidates, alone, standardised
from olp.calibration.design.known import Known
from olp.calibration.design.prediction import Planned
from olp.calibration.observations.lengths import LengthsState
from olp.calibration.observations.points import Points, PointsState, points_block
from olp.core.arrays import Array, Index
from olp.core.machine import Vector
from olp.core.units import AXES
from olp.core.values import dataclass

#: Levels of each axis in a lattice: ends and middle, where points tell most of slopes.
_LEVELS = 3
#: Axis positions in addition, of a Latin hypercube.
_AMONG = 200
#: Places around the box where a station may stand.
_PLACES = 24


@dataclass(frozen=True, slots=True, eq=False)
class Offer:
    """Candidates of one instrument. `planned` are chosen ones as measurements, `row` is one of them in a
    report. At least `fewest` of them make a set that can be used."""

    candidates: Candidates
    planned: Callable[[Index], Planned]
    row: Callable[[int], Mapping[str, object]]
    fewest: int


def points(
    machine: str, known: Known, box_mm: Array, tools: Sequence[Vector], sigma: float, seed: int
) -> Offer:
    """Points of a tracker in one unknown instrument frame, each with one of the tool vectors."""
    levels = [np.linspace(low, high, _LEVELS) for low, high in box_mm.tolist()]
    lattice = np.round(np.array(list(itertools.product(*levels))), 1)
    places = np.concatenate([lattice, layout.hypercube(box_mm, _AMONG, seed)])
    axis = np.tile(places, (len(tools), 1))
    tool = np.repeat(np.array(tools, float), len(places), axis=0)

    def planned(index: Index) -> Planned:
        return Planned(machine, (PointsState(Points(*_at(axis, tool, index), sigma, source="points")),))

    def row(one: int) -> Mapping[str, object]:
        return {**_place(axis[one]), "reflector": 1 + one // len(places)}

    rows, local = standardised(points_block(Points(axis, tool, axis + tool, sigma), known))
    n = len(axis)
    return Offer(Candidates(rows.reshape(n, 3, -1), local.reshape(n, 3, -1)), planned, row, 4)


def stations(machine: str, known: Known, box_mm: Array, tools: Sequence[Vector], n: int, seed: int) -> Offer:
    """Places of a tracking interferometer around the box, each with lengths to the same n points."""
    places = np.round(layout.around(box_mm, _PLACES))
    axis, tool = layout.scattered(box_mm, tools, n, seed)

    def planned(index: Index) -> Planned:
        return layout.lengths_from(machine, axis, tool, places[index], layout.LENGTH)

    def readings(state: LengthsState) -> Array:
        block = state.block(known, np.zeros(known.size))
        return alone(*standardised(block), block.precision)

    states = [state for state in planned(np.arange(_PLACES)).states if isinstance(state, LengthsState)]
    rows = np.stack([readings(state) for state in states])
    nothing = np.zeros((*rows.shape[:2], 0))
    return Offer(Candidates(rows, nothing), planned, lambda one: _place(places[one]), 1)


def _at(axis: Array, tool: Array, index: Index) -> tuple[Array, Array, Array]:
    return axis[index], tool[index], axis[index] + tool[index]


def _place(place_mm: Array) -> dict[str, object]:
    return {f"{name}_mm": float(value) for name, value in zip(AXES, place_mm, strict=True)}
