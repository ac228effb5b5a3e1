"""Measured runs on the page: each point with its point of the nominal path, paired as in `olp compare`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from olp.comparison import runs
from olp.comparison.figures import Run
from olp.comparison.nominal import Nominal, nominal_of
from olp.compensation.plan import zero_shifts
from olp.core.arrays import Array, Index, Mask
from olp.core.errors import ConfigError, InputError
from olp.core.machine import Setup
from olp.core.toolpath import Toolpath
from olp.errormodel.base import ErrorModel
from olp.files.points import Points, row_line
from olp.findings.catalogue import Finding
from olp.review.samples import Samples

#: Points farther from the path are left out, in mm.
REACH_MM = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """Of n measured points in the order of the path: (n, 3) `base_mm`, the nearest point of the path,
    `delta_mm` from there, and (n,) the `index` of the sample next to it. `findings` are those of
    `olp compare` on how the run was placed. (n,) `counted` are points of cutting moves: figures are of these,
    `largest_um` of all (None where none counts), `by_line_um` of each line."""

    label: str
    base_mm: Array
    delta_mm: Array
    index: Index
    findings: tuple[Finding, ...]
    counted: Mask
    largest_um: float | None
    rms_um: float | None
    by_line_um: dict[int, float]


class Matcher:
    """Places measured points on the path of a program whose samples are shown about `origin_mm`: the axis
    position, without tool lengths, of the zero of the page."""

    def __init__(
        self, path: Toolpath, samples: Samples, model: ErrorModel, setup: Setup, origin_mm: Array
    ) -> None:
        self._path, self._setup = path, setup
        self._nominal = nominal_of(path, model, "tip")
        self._shift = zero_shifts(path.frames, model)
        self._home = self._zero(int(path.frame[0]))
        self._origin = origin_mm
        self._samples, self._arc_mm = samples, _arc_lengths(self._nominal, samples)

    def match(self, points: Points) -> Matched:
        """The run on the path. Raises InputError with the line of the first point that is not on it, and
        ConfigError for a frame that the machine does not have."""
        point_mm = points.points_mm + self._from_frame(points)
        nominal = self._nominal.path
        placed = runs.place(nominal, [Path(points.file).name], [point_mm], "auto", None, REACH_MM)
        run = placed.runs[0]
        if not placed.right[0]:
            raise _refusal(points, run)
        rows = np.flatnonzero(run.good)
        if placed.orders[0] == "backward":
            rows = rows[::-1]
        elif placed.orders[0] == "free":
            rows = rows[np.argsort(run.pairing.s_mm[rows], kind="stable")]
        foot = run.pairing.foot_mm[rows]
        # the page shows the program's own positions, without the errors of touched zeros
        move = self._nominal.move[run.pairing.segment[rows]]
        base = foot + self._home - self._shift[self._path.frame[move]] - self._origin
        index = np.maximum.accumulate(self._nearest(run.pairing.s_mm[rows], move))
        findings = tuple(runs.findings(nominal, placed))
        across = run.figures(nominal)["across_um"] or {}
        return Matched(
            run.name, base, run.points_mm[rows] - foot, index, findings, run.counted[rows], across.get("max"),
            across.get("rms"), run.largest_by_line(nominal),
        )  # fmt: skip

    def _nearest(self, s_mm: Array, move: Index) -> Index:
        """(n,) the sample next to each arc length, but not the last one of the move before."""
        arc_mm = self._arc_mm
        after = np.clip(np.searchsorted(arc_mm, s_mm), 0, len(arc_mm) - 1)
        before = np.maximum(after - 1, 0)
        nearer = (s_mm - arc_mm[before] < arc_mm[after] - s_mm) & (self._samples.move[before] >= move)
        return np.where(nearer, before, after).astype(np.int64)

    def _zero(self, frame: int) -> Array:
        """The axis position of the zero of a frame of the program, without tool lengths."""
        known = self._path.frames[frame]
        return np.asarray(np.subtract(known.offset_mm, known.length_mm) + self._shift[frame], float)

    def _from_frame(self, points: Points) -> Array:
        """The shift from the frame that a file states into the first frame of the program."""
        first = self._path.frames[int(self._path.frame[0])]
        if points.frame in (None, first.work_offset):
            return np.zeros(3)
        if points.frame == "machine":
            return np.asarray(-self._home, float)
        assert points.frame is not None
        for frame in np.unique(self._path.frame).tolist():
            if self._path.frames[frame].work_offset == points.frame:
                return np.asarray(self._zero(frame) - self._home, float)
        offset = self._setup.work_offset(points.frame)
        if offset is None or any(offset.rotation_deg):
            raise ConfigError(
                f"frame {points.frame!r} is not an unrotated work offset of machine or job; expected "
                f'{first.work_offset!r} or "machine"',
                file=points.file,
            )
        return np.asarray(np.array(offset.offset_mm) - self._home, float)


def _refusal(points: Points, run: Run) -> InputError:
    off = np.flatnonzero(~run.good & ~run.pairing.beyond)
    worst = int(off[0]) if len(off) else int(run.pairing.distance_mm.argmax())
    return InputError(
        f"the point is {run.pairing.distance_mm[worst]:.3g} mm from the path, or the points are not in its "
        f"order; expected points within {REACH_MM:g} mm of it; run olp compare for details",
        file=points.file, line=row_line(points, worst),
    )  # fmt: skip


def _arc_lengths(nominal: Nominal, samples: Samples) -> Array:
    """(n,) arc length on the nominal path at each sample; a move that is not on it has the one before."""
    s, of = nominal.path.s_mm, nominal.move
    begin = s[np.searchsorted(of, samples.move, "left")]
    end = s[np.searchsorted(of, samples.move, "right")]
    return np.maximum.accumulate(begin + samples.share * (end - begin))
