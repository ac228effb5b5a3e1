"""The waypoints of a program with the uncertainty of the position of the tip.

Waypoints are ends of moves whose path counts, and bottoms of holes: not of rapids, nor of moves that the
control makes itself. A touch-off on the uncompensated machine contains the same unknown errors, so each
waypoint has the uncertainty of the difference from there; "true" work offsets cancel nothing.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from olp.compensation.plan import zero_shifts
from olp.core.arrays import Array, Index
from olp.core.machine import Vector
from olp.core.progress import Progress
from olp.core.toolpath import Flag, Frame, Kind, Toolpath, Touch
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.reversal import plays
from olp.errormodel.sensitivity import Rows, Sensitivity
from olp.program.program import Program
from olp.uncertainty.probability import normal, within

#: Coverage factor of bands: with normal errors about 95 % of a coordinate.
COVERAGE = 2.0
#: Draws of the whole calibration for probabilities at many waypoints at once, at most.
DRAWS = 2000
#: Draws of the whole calibration, at least.
FEWEST_DRAWS = 250
#: Draws times waypoints, at most, where this leaves more than FEWEST_DRAWS.
WORK = 4e7
#: Seed of the draws.
SEED = 20260514
#: From this probability on a gain counts as probable: it exceeds its standard uncertainty. A number as large
#: as its expanded uncertainty (k = 2) has just this probability of a gain.
PROBABLE_GAIN = 0.8413
#: Waypoints that are computed at once, to limit memory.
_BLOCK = 2048
#: Flags of moves that have no waypoint.
_AWAY = np.uint8(Flag.PASS | Flag.CONTROL | Flag.MACHINE)


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Waypoints of a path: (n,) nominal `move` and (n, 3) nominal `axis_mm`. The others are (n, 3) too.
    `before_mm` and `after_mm` are the deviations of the tip that the model predicts for the nominal and the
    corrected program. `play` is None where no axis has backlash."""

    move: Index
    axis_mm: Array
    before_mm: Array
    after_mm: Array
    play: Array | None

    def __len__(self) -> int:
        return len(self.move)


@dataclass(frozen=True, slots=True, eq=False)
class Unknowns:
    """The uncertainty of a machine: `sensitivity` to the unknown parts of its calibration, and the standard
    deviation of its own scatter at one position by axis."""

    sensitivity: Sensitivity
    repeatability_mm: Vector

    def touches(self, frames: tuple[Frame, ...]) -> tuple[Rows, Array]:
        """(frames, 3, columns): the part of the unknowns in the touch-offs of each frame; and (frames, 3)
        their number by axis. A length that was set on the machine holds those along the tool."""
        rows = np.zeros((len(frames), 3, self.sensitivity.columns), np.float32)
        count = np.zeros((len(frames), 3))

        def of(touch: Touch) -> Rows:
            position, tool_vector = touch
            return self.sensitivity.rows(np.array([position]), np.array(tool_vector, float))[:, 0]

        for k, frame in enumerate(frames):
            if frame.touched is not None:
                rows[k] += of(frame.touched)
                count[k] += 1.0
            for length in frame.lengths:
                if length.touched is not None:
                    along = np.array(length.along, np.float32)
                    rows[k] += along[:, None] * of(length.touched)[2]
                    count[k] += along**2
        return rows, count


@dataclass(frozen=True, slots=True, eq=False)
class Chances:
    """Probabilities of being within a part tolerance. (n,) `before` and `after`: that the tip is within
    `limit_mm` of its nominal position at each waypoint. `lines` (l,) of the program have those that all their
    waypoints are within, `program_before` and `program_after` are those of the whole program, from so many
    `draws`. (n,) `nearer` are probabilities that correction brings the tip nearer to its nominal position,
    and `gain` that the corrected program is better than the nominal one, by the mean square of deviations."""

    limit_mm: float
    before: Array
    after: Array
    lines: Index
    line_before: Array
    line_after: Array
    program_before: float
    program_after: float
    draws: int
    nearer: Array
    gain: float


@dataclass(frozen=True, slots=True, eq=False)
class Confidence:
    """The uncertainty of n waypoints in program order, in mm; see `Points`. `sigma_mm` (n, 3) are standard
    uncertainties along X, Y, Z; `band_mm` (n,) is 2 sigma in the direction where it is longest.
    `expansion_mm` is the largest standard uncertainty from temperatures. `chances` are None without a part
    tolerance."""

    points: Points
    line: Index
    sigma_mm: Array
    band_mm: Array
    expansion_mm: float
    chances: Chances | None

    def __len__(self) -> int:
        return len(self.points)


def waypoints(
    nominal: Program, corrected: Program, groups: Index, uncorrected: Index, model: ErrorModel
) -> Points:
    """The waypoints of a program and of its correction, whose moves up to groups (n,) belong to each nominal
    one. Moves in `uncorrected` are left out; of canned cycles the bottoms of holes count."""
    path, written = nominal.toolpath, corrected.toolpath
    shift = zero_shifts(path.frames, model) if path.frames else np.zeros((1, 3))
    keep = ((path.flag & _AWAY) == 0) & (path.kind != Kind.RAPID)
    keep[uncorrected] = False
    other = groups.copy()
    cycle = (path.flag & np.uint8(Flag.CYCLE)) != 0
    bottom, corrected_bottom = _bottoms(nominal), _bottoms(corrected)
    if len(bottom) == len(corrected_bottom):
        both = (bottom >= 0) & (corrected_bottom >= 0)
        other[bottom[both]] = corrected_bottom[both]
        cycle[bottom[both]] = False
    keep &= ~cycle
    keep &= np.isfinite(path.end_mm).all(axis=1) & np.isfinite(written.end_mm[other]).all(axis=1)
    move = np.flatnonzero(keep)
    tool = path.tool_mm()
    tool = tool if tool.ndim == 1 else tool[move]
    held = path.end_mm[move] + shift[path.frame[move]]

    def deviation(end_mm: Array, rows: Index) -> tuple[Array, Array | None]:
        states = plays(model, end_mm)
        play = None if states is None else states[rows]
        return model.error(end_mm[rows], tool, play) + end_mm[rows] - held, play

    before, play = deviation(path.end_mm, move)
    after, _ = deviation(written.end_mm, other[move])
    known = np.isfinite(before).all(axis=1) & np.isfinite(after).all(axis=1)
    return Points(
        move[known], path.end_mm[move[known]], before[known], after[known],
        None if play is None else play[known],
    )  # fmt: skip


def _bottoms(program: Program) -> Index:
    """The last feed move into each hole of a canned cycle; -1 where there is none."""
    feed = program.toolpath.kind[program.holes.moves()[0]] != Kind.RAPID
    return program.holes.ends(feed)[1]


def covariances(unknowns: Unknowns, path: Toolpath, points: Points) -> Array:
    """(n, 3, 3) covariance of the position of the tip at points of a path, in mm^2."""
    touch, count = unknowns.touches(path.frames)
    covariance = np.zeros((len(points), 3, 3))
    for part in _blocks(np.arange(len(points))):
        covariance[part] = _covariance(unknowns.sensitivity, path, points, part, touch)[0]
    covariance += _scatter(unknowns, count, path, points)
    return covariance


def bands(covariance: Array) -> Array:
    """(n,) expanded uncertainty in the direction where it is largest."""
    return np.asarray(COVERAGE * np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[:, 2], 0.0)))


def confidence(
    unknowns: Unknowns,
    path: Toolpath,
    points: Points,
    limit_mm: float | None,
    *,
    tell: Progress,
    seed: int = SEED,
) -> Confidence:
    """Bands at each waypoint, and with a part tolerance `limit_mm` the probabilities of being within it.

    Those of waypoints are exact for normal errors to first order. Those of lines and of the whole are by
    Monte-Carlo over the calibration's covariance, in memory of blocks."""
    n = len(points)
    line = path.line[points.move].astype(np.int64)
    covariance = np.zeros((n, 3, 3))
    touch, count = unknowns.touches(path.frames)
    expansion = 0.0
    joint = None if limit_mm is None else _Joint(unknowns, path, points, touch, count, limit_mm, seed)
    order, done = np.argsort(line, kind="stable"), 0
    for part in _blocks(order):
        tell("uncertainty", done / n)
        covariance[part], grown = _covariance(unknowns.sensitivity, path, points, part, touch)
        expansion = max(expansion, float(grown.max(initial=0.0)))
        if joint is not None:
            joint.add(part)
        done += len(part)
    covariance += _scatter(unknowns, count, path, points)
    return Confidence(
        points=points,
        line=line,
        sigma_mm=np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)),
        band_mm=bands(covariance),
        expansion_mm=expansion**0.5,
        chances=None if joint is None else joint.chances(covariance),
    )


def _positive(mean: Array, spread: Array) -> Array:
    """(n,) probability that a normal variable is above zero; a half where it is certainly zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(spread > 0.0, normal(mean / spread), 0.5 + 0.5 * np.sign(mean))


def _blocks(which: Index) -> Iterator[Index]:
    return (which[a : a + _BLOCK] for a in range(0, len(which), _BLOCK))


def _covariance(
    sensitivity: Sensitivity, path: Toolpath, points: Points, part: Index, touch: Rows
) -> tuple[Array, Array]:
    """(b, 3, 3) covariance of some points less their touch-off, and (b,) what expansion adds to it."""
    position, tool, play = _states(path, points, part)
    return sensitivity.covariance(position, tool, play, touch, path.frame[points.move[part]])


def _states(path: Toolpath, points: Points, part: Index) -> tuple[Array, Array, Array | None]:
    """Axis positions, tool vectors and play of some points."""
    tool = path.tool_mm()
    play = None if points.play is None else points.play[part]
    return points.axis_mm[part], tool if tool.ndim == 1 else tool[points.move[part]], play


def _scatter(unknowns: Unknowns, count: Array, path: Toolpath, points: Points) -> Array:
    """(n, 3, 3) of the machine's own scatter, at the waypoint and at each touch."""
    own = np.diag(np.array(unknowns.repeatability_mm) ** 2)
    touches = count[path.frame[points.move]] if len(count) else np.zeros((len(points), 3))
    return np.asarray((1.0 + touches)[:, None, :] * own)


def _scatter_of_sum(unknowns: Unknowns, count: Array, path: Toolpath, points: Points, change: Array) -> float:
    """Variance of the sum over waypoints of change times scatter: a touch scatters once for its frame."""
    square = np.array(unknowns.repeatability_mm) ** 2
    total = float((change**2 @ square).sum())
    frame = path.frame[points.move]
    for k in np.flatnonzero(count.any(axis=1)):
        total += float(change[frame == k].sum(axis=0) ** 2 @ (count[k] * square))
    return total


class _Joint:
    """Draws of all unknowns at once, followed through the waypoints in the order of lines."""

    def __init__(
        self, unknowns: Unknowns, path: Toolpath, points: Points, touch: Rows, count: Array,
        limit_mm: float, seed: int,
    ) -> None:  # fmt: skip
        self.draws = int(np.clip(WORK / max(len(points), 1), FEWEST_DRAWS, DRAWS))
        self.path, self.points, self.limit_mm, self.limit = path, points, limit_mm, limit_mm**2
        self.random = np.random.default_rng(seed)
        self.sensitivity = sensitivity = unknowns.sensitivity
        drawn = self.random.standard_normal((sensitivity.columns, self.draws), dtype=np.float32)
        self.values = sensitivity.table @ drawn
        self.scatter = np.array(unknowns.repeatability_mm)
        #: what correction changes, and how the sum of its products with deviations depends on the unknowns
        self.change = points.before_mm - points.after_mm
        self.share = np.zeros(sensitivity.columns)
        self.loose = _scatter_of_sum(unknowns, count, path, points, self.change)
        self.touch, self.held = touch, touch @ drawn
        if self.scatter.any() and count.any():
            noise = self.random.standard_normal(self.held.shape, dtype=np.float32)
            noise *= (np.sqrt(count) * self.scatter)[:, :, None]
            self.held = self.held + noise
        self.touched = bool(count.any())
        self.lines: list[int] = []
        self.good: tuple[list[float], list[float]] = ([], [])
        self.worst = np.zeros((2, self.draws))
        self.last: tuple[int, Rows] | None = None

    def add(self, part: Index) -> None:
        """The next waypoints, in the order of lines."""
        weights = self.sensitivity.weights(*_states(self.path, self.points, part))
        change = self.change[part]
        sides = (self.points.before_mm[part], self.points.after_mm[part])
        square = np.zeros((2, len(part), self.draws), np.float32)
        frame = self.path.frame[self.points.move[part]]
        for i, one in enumerate(weights):
            self.share += (one.T @ change[:, i]) @ self.sensitivity.table
            moved = one @ self.values
            if self.touched:
                moved -= self.held[frame, i]
                self.share -= change[:, i] @ self.touch[frame, i]
            if self.scatter[i]:
                noise = self.random.standard_normal(moved.shape, dtype=np.float32)
                moved += np.float32(self.scatter[i]) * noise
            for k, side in enumerate(sides):
                away = moved + side[:, i, None].astype(np.float32)
                square[k] += away * away
        line = self.path.line[self.points.move[part]]
        starts = np.flatnonzero(np.concatenate(([True], line[1:] != line[:-1])))
        worst = _largest_of_runs(square, starts)
        np.maximum(self.worst, worst.max(axis=1), out=self.worst)
        numbers = line[starts].tolist()
        if self.last is not None and self.last[0] == numbers[0]:
            worst[:, 0] = np.maximum(worst[:, 0], self.last[1])
        else:
            self.end()
        # the last line may continue in the next part
        self.last = (numbers[-1], worst[:, -1].copy())
        self.lines += numbers[:-1]
        shares = (worst[:, :-1] <= self.limit).mean(axis=2).tolist()
        for good, share in zip(self.good, shares, strict=True):
            good.extend(share)

    def chances(self, covariance: Array) -> Chances:
        """The probabilities, with the (n, 3, 3) covariance of the waypoints."""
        self.end()
        points, change = self.points, self.change
        mean = (points.before_mm**2).sum(axis=1) - (points.after_mm**2).sum(axis=1)
        variance = np.einsum("ni,nij,nj->n", change, covariance, change)
        total = 2.0 * float(np.sqrt(self.share @ self.share + self.loose))
        return Chances(
            limit_mm=self.limit_mm,
            before=within(covariance, points.before_mm, self.limit_mm),
            after=within(covariance, points.after_mm, self.limit_mm),
            lines=np.array(self.lines, np.int64),
            line_before=np.array(self.good[0]),
            line_after=np.array(self.good[1]),
            program_before=float((self.worst[0] <= self.limit).mean()),
            program_after=float((self.worst[1] <= self.limit).mean()),
            draws=self.draws,
            nearer=_positive(mean, 2.0 * np.sqrt(np.maximum(variance, 0.0))),
            gain=float(_positive(np.array([mean.sum()]), np.array([total]))[0]),
        )

    def end(self) -> None:
        """Counts the last line, which is complete."""
        if self.last is not None:
            self.lines.append(self.last[0])
            for side, worst in zip(self.good, self.last[1], strict=True):
                side.append(float((worst <= self.limit).mean()))
            self.last = None


def _largest_of_runs(values: Rows, starts: Index) -> Rows:
    """(2, runs, draws) the largest of (2, n, draws) in each run of rows from one start to the next."""
    if len(starts) == values.shape[1]:
        return values
    # ufunc.reduceat along a middle axis is several times slower
    length = np.diff(starts, append=values.shape[1])
    largest = values[:, starts]
    for k in range(1, int(length.max())):
        longer = np.flatnonzero(length > k)
        largest[:, longer] = np.maximum(largest[:, longer], values[:, starts[longer] + k])
    return largest
