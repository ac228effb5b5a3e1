"""Lines, and targets of lines, that could be measured next: by lasers, levels and squares."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from olp.calibration.design import layout
from olp.calibration.design.choosing import Candidates, alone
from olp.calibration.design.known import Known
from olp.calibration.design.offers import Offer
from olp.calibration.design.prediction import Planned
from olp.calibration.observations.lines import LineState
from olp.calibration.observations.references import Square
from olp.core.arrays import Array, Index
from olp.core.machine import COMPONENTS, Vector
from olp.core.units import AXES, UM_PER_MM
from olp.core.values import dataclass

#: What a laser, levels and straightness optics read one by one. A level cannot read the roll of Z.
READ = tuple(name for name in COMPONENTS if name != "ECZ")
#: Lines stand in the middle of the box, and so far from its sides, as a share.
_ASIDE = 0.1
#: Places along a line where a target may be.
_TARGETS = 41
#: Targets at most of a line that is proposed as a whole.
_MOST = 25
#: Arm of a tool vector by which an angle shows, mm.
_ARM_MM = 1000.0


@dataclass(frozen=True, slots=True, eq=False)
class _Set:
    """Lines that are set up together: one, or the two against the legs of one square. `targets_mm` is of
    each."""

    names: tuple[str, ...]
    place_mm: Vector
    targets_mm: tuple[Array, ...]

    @property
    def square(self) -> str | None:
        """The name of the square."""
        return None if len(self.names) == 1 else f"square {self.names[1][1:]}"


def lines(
    machine: str, known: Known, box_mm: Array, tool: Vector, components: Collection[str], seed: int
) -> Offer:
    """Whole lines of components in the middle of the box and near its four edges, and pairs against a
    square."""
    targets = [layout.line_targets(box_mm[k], (), seed + k)[:: _every(box_mm[k])] for k in range(3)]
    sets = [
        _Set((name,), place, (targets[AXES.index(name[2])],))
        for name in READ
        if name in components
        for place in _places(box_mm, AXES.index(name[2]))
    ]
    middle = _places(box_mm, 0)[0]
    for i, k in itertools.combinations(range(3), 2):
        pair = f"E{AXES[k]}{AXES[i]}", f"E{AXES[i]}{AXES[k]}"
        if set(pair) <= set(components):
            sets.append(_Set(pair, middle, (targets[i], targets[k])))
    rows = [_rows_of_set(known, one, tool, box_mm) for one in sets]
    most = max(map(len, rows))
    padded = np.stack([np.pad(one, ((0, most - len(one)), (0, 0))) for one in rows])
    nothing = np.zeros((*padded.shape[:2], 0))

    def planned(index: Index) -> Planned:
        return _planned(machine, [sets[k] for k in index.tolist()], tool, box_mm)

    def row(one: int) -> Mapping[str, object]:
        return {"line": " and ".join(sets[one].names), **_beside(sets[one])}

    return Offer(Candidates(padded, nothing), planned, row, 1)


def targets(machine: str, known: Known, box_mm: Array, tool: Vector, components: Collection[str]) -> Offer:
    """Targets of lines in the middle of the box. Both ends of a line are read in any case: what a target
    tells is the error there less that of the ends."""
    names = [name for name in READ if name in components]
    middle = _places(box_mm, 0)[0]
    grids = [np.round(np.linspace(low, high, _TARGETS), 1).astype(float) for low, high in box_mm.tolist()]
    rows = np.concatenate([_rows_of_targets(known, name, middle, tool, grids, box_mm) for name in names])
    nothing = np.zeros((len(rows), 1, 0))

    def place(one: int) -> tuple[str, float]:
        name, k = names[one // (_TARGETS - 1)], one % (_TARGETS - 1)
        return name, float(grids[AXES.index(name[2])][1 + k])

    def planned(index: Index) -> Planned:
        chosen: dict[str, set[float]] = {}
        for one in index.tolist():
            name, target = place(one)
            grid = grids[AXES.index(name[2])]
            chosen.setdefault(name, {float(grid[0]), float(grid[-1])}).add(target)
        sets = [_Set((name,), middle, (np.array(sorted(chosen[name])),)) for name in names if name in chosen]
        return _planned(machine, sets, tool, box_mm)

    def row(one: int) -> Mapping[str, object]:
        name, target = place(one)
        return {"line": name, "target_mm": target}

    return Offer(Candidates(rows[:, None, :], nothing), planned, row, 1)


def read_rows(known: Known, name: str, place_mm: Vector, tool: Vector, targets_mm: Array) -> Array:
    """(n, size) what a component reads at targets along its axis, by the unknowns; mm or rad.

    A turn is what the tips of two tool vectors show of it. Its axes at rest add constants, as for a level.
    """
    position = np.tile(np.array(place_mm, float), (len(targets_mm), 1))
    position[:, AXES.index(name[2])] = targets_mm
    vector = np.array(tool, float)
    if name[1] in AXES:
        return known.design(position, vector)[:, AXES.index(name[1])]
    about = "ABC".index(name[1])
    arm, along = np.zeros(3), (about + 2) % 3
    arm[(about + 1) % 3] = _ARM_MM
    tips = known.design(position, vector + arm)[:, along] - known.design(position, vector)[:, along]
    return np.asarray(tips / _ARM_MM)


def _rows_of_set(known: Known, one: _Set, tool: Vector, box_mm: Array) -> Array:
    """Standardised readings of lines that are set up together, beside their zeros, slopes and scale; means
    of all runs, over which a drift averages out."""
    rows, local, precision = [], [], []
    total = sum(map(len, one.targets_mm))
    pose, error = np.zeros(total), np.zeros(total)
    start = 0
    for name, q in zip(one.names, one.targets_mm, strict=True):
        own = slice(start, start + len(q))
        start += len(q)
        from_middle = (q - q.mean()) / UM_PER_MM
        sigma = _mean_sigma(name, box_mm)
        rows.append(read_rows(known, name, one.place_mm, tool, q) / sigma)
        own_columns = [(np.ones(len(q)), 0.0)]
        if name[1] == name[2]:
            own_columns.append((from_middle, 1.0 / (layout.LASER_SCALE * UM_PER_MM) ** 2))
        elif name[1] in AXES and one.square is None:
            own_columns.append((from_middle, 0.0))
        elif one.square is not None:
            first = name == one.names[0]
            pose[own] = (1.0 if first else -1.0) * from_middle / sigma
            error[own] = 0.0 if first else from_middle / sigma
        for values, known_by in own_columns:
            column = np.zeros(total)
            column[own] = values / sigma
            local.append(column)
            precision.append(known_by)
    if one.square is not None:
        local += [pose, error]
        precision += [0.0, 1.0 / (layout.SQUARE * UM_PER_MM) ** 2]
    return alone(np.concatenate(rows), np.stack(local, axis=1), np.array(precision))


def _rows_of_targets(
    known: Known, name: str, place: Vector, tool: Vector, grids: Sequence[Array], box_mm: Array
) -> Array:
    """Standardised readings at all targets but the first, less what the ends of the line tell of them."""
    q = grids[AXES.index(name[2])]
    rows = read_rows(known, name, place, tool, q)
    share = (q - q[0]) / (q[-1] - q[0])
    straight = name[1] in AXES and name[1] != name[2]
    ends = rows[0] + share[:, None] * (rows[-1] - rows[0]) if straight else rows[:1]
    # a reading and that of the ends, each with its noise
    noise = np.sqrt(1.0 + ((1.0 - share) ** 2 + share**2 if straight else 1.0) + 0.0 * share)
    return np.asarray((rows - ends)[1:] / (noise * _mean_sigma(name, box_mm))[1:, None])


def _mean_sigma(name: str, box_mm: Array) -> float:
    """Standard uncertainty of the mean of all runs at a target."""
    return layout.line_sigma(name, box_mm) / float(np.sqrt(2 * layout.RUNS))


def _planned(machine: str, sets: Sequence[_Set], tool: Vector, box_mm: Array) -> Planned:
    states: list[LineState] = []
    squares: dict[str, Square] = {}
    for number, one in enumerate(sets, start=1):
        if one.square is not None:
            squares[one.square] = Square(one.square, 0.0, layout.SQUARE)
        states += [
            layout.line(name, q, one.place_mm, tool, box_mm, one.square, f"{number}-{name.lower()}.csv")
            for name, q in zip(one.names, one.targets_mm, strict=True)
        ]
    return Planned(machine, tuple(states), tuple(squares.values()))


def _places(box_mm: Array, axis: int) -> list[Vector]:
    """Where a line along an axis may stand: in the middle, and near the four edges of the box."""
    middle = np.round(box_mm.mean(axis=1), 1)
    share = np.array([_ASIDE, 1.0 - _ASIDE])
    side = np.round(box_mm[:, :1] + np.ptp(box_mm, axis=1)[:, None] * share, 1)
    places = [middle]
    others = [k for k in range(3) if k != axis]
    for first, second in itertools.product(range(2), repeat=2):
        place = middle.copy()
        place[others[0]], place[others[1]] = side[others[0], first], side[others[1], second]
        places.append(place)
    return [(float(x), float(y), float(z)) for x, y, z in places]


def _beside(one: _Set) -> dict[str, object]:
    """The positions of the axes that rest."""
    moving = {name[2] for name in one.names}
    return {
        f"{name}_mm": None if name in moving else value
        for name, value in zip(AXES, one.place_mm, strict=True)
    }


def _every(side: Array) -> int:
    return 1 + max(layout.FEWEST, int(np.ptp(side) / layout.STEP_MM) + 1) // (_MOST + 1)
