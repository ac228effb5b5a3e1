"""Which runs of a route are planned together, and by which solvers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.values import dataclass
from olp.trajectory.cells import MOST_CELLS, cells_of
from olp.trajectory.contest import stops_of
from olp.trajectory.forecast import straight
from olp.trajectory.route import AxisLimits, Route
from olp.trajectory.solvers import SOLVERS, Candidate
from olp.trajectory.speedgrid import CELL_S

#: runs with no more segments than this are planned by the overlapping solver only
_FEW_SEGMENTS = 1
#: a solver whose least time is below this share of all others' wins without a contest
_CLEAR_WIN = 0.8
#: pieces per waypoint
_PIECES = 3
#: segments of a short run, at most
SHORT = 64
#: pieces that take as long as the fixed cost of optimising one run
_CALL = 500
#: waypoints that are forecast together
_BLOCK = 1 << 15
#: waypoints of runs that are planned together, as a call costs more than a move
_TOGETHER = 1 << 15
#: cells of tubes at most, about 12 s for each time that all are searched
_CELLS = 4000
#: cells that take as long as the fixed cost of a tube
_OF_TUBE = 30


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """`runs` that are planned together, from waypoint `first` to `last` (both at rest), in about `least_s`,
    and the solvers that may win there, the most promising first. In a tube of `cells` (0: none) path and
    speed are planned together after them. Whether to `optimise` speeds is decided later."""

    first: int
    last: int
    candidates: tuple[Candidate, ...]
    runs: int = 1
    cells: float = 0.0
    least_s: float = 0.0
    optimise: bool = False

    @property
    def tube(self) -> bool:
        return self.cells > 0.0

    @property
    def segments(self) -> int:
        return self.last - self.first

    @property
    def bends(self) -> bool:
        return any(candidate.solver.bends for candidate in self.candidates)

    @property
    def alone(self) -> bool:
        """Whether it is planned by itself, for the sake of its bends."""
        return self.bends and (self.optimise or self.segments > SHORT)

    def cost(self) -> float:
        """About the number of pieces to optimise."""
        if not self.bends:
            return 0.0
        seconds = max(candidate.least_s for candidate in self.candidates if candidate.solver.bends)
        return _CALL + _PIECES * self.segments + seconds / CELL_S


def runs_of(route: Route, limits: AxisLimits, *, tubes: float = 0.0) -> list[Stretch]:
    """The runs from each stop to the next, and the solvers that may win, the most promising first. With
    `tubes`, a share of the cells that are afforded, those that lose most time are planned in them."""
    stops = stops_of(route)
    if len(stops) < 2:
        return []
    least_s = _forecast(route, limits, stops)
    order = np.argsort(least_s, axis=0, kind="stable")
    first = np.take_along_axis(least_s, order[:1], axis=0)[0]
    # straight moves take the forecast time; a path that bends may take far longer
    bends = np.array([solver.bends for solver in SOLVERS])[order[0]]
    keep = least_s <= np.where(bends, np.inf, first / _CLEAR_WIN)
    # a program of exact stops has as many runs as waypoints
    alone = [(Candidate(solver, 0.0),) for solver in SOLVERS]
    cells = _tubed(route, limits, stops, first, tubes) if tubes else np.zeros(len(first))
    runs = []
    for begin, end, ranks, fits, some, tube, about_s in zip(
        stops[:-1].tolist(), stops[1:].tolist(), order.T.tolist(), keep.T.tolist(), least_s.T.tolist(),
        cells.tolist(), first.tolist(), strict=True,
    ):  # fmt: skip
        if sum(fits) == 1:
            candidates = alone[ranks[0]]
        else:
            candidates = tuple(Candidate(SOLVERS[i], some[i]) for i in ranks if fits[i])
        runs.append(Stretch(begin, end, candidates, 1, tube, about_s))
    return runs


def together(runs: list[Stretch]) -> Iterator[Stretch]:
    """The runs; straight ones, and short ones that are not optimised, are joined, as they may be many. Those
    in tubes are not."""
    begin = 0
    group: list[Stretch] = []
    for run in [*runs, None]:
        small = run is not None and not run.tube and not run.alone
        if group and (run is None or not small or run.last - begin > _TOGETHER):
            candidates = max((some.candidates for some in group), key=len)
            yield Stretch(begin, group[-1].last, candidates, len(group))
            group = []
        if run is not None and not small:
            yield run
        elif run is not None:
            if not group:
                begin = run.first
            group.append(run)


def _forecast(route: Route, limits: AxisLimits, stops: Index) -> Array:
    """(s, r) about the least seconds of each solver for each run."""
    count = len(route) - 1
    each = np.empty((len(SOLVERS), count))
    for a in range(0, count, _BLOCK):
        b = min(a + _BLOCK, count)
        # the segments before and behind matter at the ends of the block
        c, d = max(a - 1, 0), min(b + 1, count)
        some = Route(
            route.point_mm[c : d + 1], route.feed_mm_s[c:d], route.line[c:d], route.tolerance_mm[c : d + 1],
            route.dwell_s[c : d + 1],
        )  # fmt: skip
        for i, solver in enumerate(SOLVERS):
            each[i, a:b] = solver.least_s(some, limits)[a - c : b - c]
    seconds: Array = np.add.reduceat(each, stops[:-1], axis=1)
    few = np.diff(stops) <= _FEW_SEGMENTS
    seconds[[solver.bends for solver in SOLVERS]] += np.where(few, np.inf, 0.0)
    return seconds


def _tubed(route: Route, limits: AxisLimits, stops: Index, least_s: Array, share: float) -> Array:
    """(r,) cells of the runs that are planned in tubes: those that lose most time beside a straight move for
    each cell, as many as the `share` affords; 0 of others. `least_s` (r,): about the seconds of each run."""
    segment_s, straight_s = straight(route, limits, stops)
    count = np.maximum(cells_of(segment_s, route.tolerance_mm, limits, stops), 1.0)
    order = np.argsort((straight_s - least_s) / count, kind="stable")
    fits = (np.diff(stops) > 1) & (count <= MOST_CELLS)
    order = order[fits[order]]
    tubed = order[np.cumsum(_OF_TUBE + count[order]) <= share * _CELLS]
    found = np.zeros(len(least_s))
    found[tubed] = count[tubed]
    return found
