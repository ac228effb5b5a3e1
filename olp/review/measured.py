"""Measured runs on the page: each point with its nominal point, paired as in `olp compare`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from olp.comparison import runs
from olp.comparison.figures import Run
from olp.comparison.frames import Frames
from olp.comparison.pairing import Order
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import InputError
from olp.core.machine import Setup
from olp.core.values import dataclass
from olp.files.points import Points, row_line
from olp.proof import judgement
from olp.proof.judgement import Judgements
from olp.review.samples import Samples
from olp.workflows.compare_runs import Ground, Judged


@dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """Of n measured points in the order of the path: (n, 3) `base_mm`, the nominal point of each, `delta_mm`
    from there, and (n,) the `index` of the sample next to it. (n,) `counted` are the points that count."""

    label: str
    base_mm: Array
    delta_mm: Array
    index: Index
    counted: Mask


#: Positions (n, 3) on the page of points (n, 3) in the frame of a nominal path, which belong to moves (n,).
Placing = Callable[[Array, Index], Array]


def from_frames(ground: Ground, setup: Setup, origin_mm: Array) -> Placing:
    """Where a page shows points on three linear axes: about `origin_mm`, the axis position, without tool
    lengths, of its zero. It shows the program's own positions, without the errors of touched zeros."""
    assert ground.program is not None and ground.loaded is not None
    path = ground.program.toolpath
    frames, first = Frames.of(path, ground.loaded.model, setup), int(path.frame[0])

    def place(points: Array, move: Index) -> Array:
        return np.asarray(frames.on_machine(points, first) - frames.shift_mm[path.frame[move]] - origin_mm)

    return place


class Matcher:
    """Puts measured runs, placed on the path of a program, among its samples, where `place` shows them."""

    def __init__(self, ground: Ground, samples: Samples, place: Placing) -> None:
        self._ground, self._place = ground, place
        self._samples, self._arc_mm = samples, _arc_lengths(ground, samples)

    def match(self, run: Run, order: Order) -> Matched:
        """A run whose points are measured in an order along the path."""
        rows = np.flatnonzero(run.good)
        if order == "backward":
            rows = rows[::-1]
        elif order == "free":
            rows = rows[np.argsort(run.pairing.s_mm[rows], kind="stable")]
        move = self._ground.row(run)[rows]
        base = self._place(run.nominal_mm[rows], move)
        delta = self._place(run.points_mm[rows], move) - base
        index = np.maximum.accumulate(self._nearest(run.pairing.s_mm[rows], move))
        return Matched(run.name, base, delta, index, run.counted[rows])

    def _nearest(self, s_mm: Array, move: Index) -> Index:
        """(n,) the sample next to each arc length, but not the last one of the move before."""
        arc_mm = self._arc_mm
        after = np.clip(np.searchsorted(arc_mm, s_mm), 0, len(arc_mm) - 1)
        before = np.maximum(after - 1, 0)
        nearer = (s_mm - arc_mm[before] < arc_mm[after] - s_mm) & (self._samples.move[before] >= move)
        return np.where(nearer, before, after).astype(np.int64)


def refuse_unplaced(files: Sequence[Points], placed: runs.Placed, reach_mm: float) -> None:
    """Raise InputError with the line of the first point that is not on the path: what cannot be paired cannot
    be shown."""
    for points, run, right in zip(files, placed.runs, placed.right, strict=True):
        if not right:
            raise _refusal(points, run, reach_mm)


def with_measured(report: dict[str, Any], table: Judgements, done: Judged) -> dict[str, Any]:
    """The report of a proof with the figures, the findings and the verdict of measured runs."""
    return report | {
        "judgement": table.report(),
        "measured": done.figures["after"],
        "findings": [*report["findings"], *(finding.as_dict() for finding in done.findings)],
        "verdict": judgement.with_measured(report["verdict"], done.verdict),
    }


def _refusal(points: Points, run: Run, reach_mm: float) -> InputError:
    off = np.flatnonzero(~run.good & ~run.pairing.beyond)
    worst = int(off[0]) if len(off) else int(run.pairing.distance_mm.argmax())
    return InputError(
        f"the point is {run.pairing.distance_mm[worst]:.3g} mm from the path, or the points are not in its "
        f"order; expected points within {reach_mm:g} mm of it; run olp compare for details",
        file=points.file, line=row_line(points, worst),
    )  # fmt: skip


def _arc_lengths(ground: Ground, samples: Samples) -> Array:
    """(n,) arc length on the nominal path at each sample; a move that is not on it has the one before."""
    s, of = ground.path.s_mm, ground.move
    begin = s[np.searchsorted(of, samples.move, "left")]
    end = s[np.searchsorted(of, samples.move, "right")]
    return np.maximum.accumulate(begin + samples.share * (end - begin))
