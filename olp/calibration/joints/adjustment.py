"""The adjustment of a machine of any joints: all readings in one Gauss-Newton, with priors and covariance.

The same normal equations as for linear axes. Own unknowns of an instrument are eliminated with its readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from olp.calibration.estimator.normal import Block, Chunk, Normal, residuals_of, solve
from olp.calibration.joints.readings import Reading, Start
from olp.calibration.joints.unknowns import NO_PAYLOAD, Model
from olp.core.arrays import Array
from olp.core.errors import CannotCompute
from olp.core.values import dataclass
from olp.kinematics.errors import Payload
from olp.kinematics.poses import Poses, shift, tilts

#: Most steps of Gauss-Newton; from the nominal machine four suffice.
_STEPS = 40
#: Unknowns have settled where they change by less than this share of their uncertainty.
_SETTLED = 1e-3
#: A step of an unknown is at most so many standard deviations of its prior.
_LONGEST = 5.0
#: After so many steps one that goes up is halved: errors multiply each other, and bend the readings.
_FREE = 2
#: Where steps do not end, places are as good where they are this near, in standard deviations.
_ALIKE_SIGMA = 1.0
#: The same in chi-square.
_ALIKE_CHI = 0.2
#: Half the steps of differences of readings by shifts, mm.
_HALF_MM = 1e-3
#: The same by turns, rad.
_HALF_RAD = 1e-6
#: Precision of an own unknown without a prior, 1/mm2: it holds one that no reading is left for.
_LOOSE = 1e-12
#: A reading is left out where it is off by more than so many standard deviations.
OUTLIER = 6.0
#: At most this share of the readings of a source is left out.
_SHARE = 0.05
#: Turns of a best frame count at this distance or more, mm.
_LEVER_MM = 100.0
#: Poses whose tips lie within this share of it determine no turn of a frame.
_SHORT = 1e-2
#: One in so many readings is held out.
HELD_OUT = 5
#: Fewer readings of a source are not held out.
_FEW = 15


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """A reading after the fit: residuals (n, m) in mm and rad and the own unknowns (l,)."""

    start: Start
    residual: Array
    own: Array

    @property
    def off_mm(self) -> Array:
        """(n,) mm."""
        return self.start.off_mm(self.residual)


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A reading that was not used: its file, its line and by how many standard deviations it is off."""

    source: str
    row: int
    deviations: float


@dataclass(frozen=True, slots=True, eq=False)
class JointFit:
    """theta (k,) with its covariance (k, k) in mm, rad, and what it was found from. `determined` is the
    number of combinations of unknowns that the readings alone show better than the prior."""

    model: Model
    theta: Array
    covariance: Array
    sources: tuple[Source, ...]
    left_out: tuple[LeftOut, ...]
    chi_square: float
    freedom: float
    determined: int

    @property
    def sigma(self) -> Array:
        """(k,) standard deviations of the unknowns."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def misfit_mm(self) -> float:
        """Standard deviation of a coordinate by what readings show beyond their noise and the unknowns."""
        rows = [source.off_mm**2 / min(source.residual.shape[1], 3) for source in self.sources]
        noise = [
            np.full(len(part), source.start.reading.sigma**2)
            for part, source in zip(rows, self.sources, strict=True)
        ]
        # unknowns take a part of the noise up
        share = sum(source.residual.size for source in self.sources) / self.freedom
        return float(np.sqrt(max(np.mean(share * np.concatenate(rows) - np.concatenate(noise)), 0.0)))

    @property
    def score(self) -> float:
        """Chi-square of readings and unknowns together."""
        return self.chi_square + float(self.theta @ self.model.precision @ self.theta)

    def sigma_at(self, values: Array, tool_mm: Array) -> tuple[Array, Array]:
        """(n, 3) mm of a tip and (n, 3) rad of the tool, in workpiece coordinates: what is not known of the
        pose at axis values (n, axes). The tip is at `tool_mm` (3,) of the gauge frame."""
        tip, turn, _ = tables_of(self.model, self.theta, values, tool_mm)
        return _spreads((tip, turn), self.covariance)

    def sigma_in_best_frame(self, values: Array, tool_mm: Array) -> tuple[Array, Array]:
        """The same beside one shift and turn of all these poses, which a work offset takes up."""
        tip, turn, place = tables_of(self.model, self.theta, values, tool_mm)
        frame, size = frame_of(place)
        rest, share = left_of(tip, frame)
        return _spreads((rest, turn - share[3:] / size), self.covariance)


def tables_of(
    model: Model, theta: Array, values: Array, tool_mm: Array, payload: Payload = NO_PAYLOAD
) -> tuple[Array, Array, Array]:
    """(n, 3, k) mm of a tip and rad of the tool by each unknown, and (n, 3) mm where the tip is."""
    twists, pose = model.twists(theta, values, payload), model.machine(theta, payload).actual(values)
    place = pose.at(tool_mm)
    arm = place - pose.position
    return twists[:, :3] + np.cross(twists[:, 3:], arm[:, :, None], axis=1), twists[:, 3:], place


def frame_of(place_mm: Array) -> tuple[Array, float]:
    """(n, 3, 6) mm of places (n, 3) by a shift of all of them, and by a turn times their size, in mm."""
    place = place_mm - place_mm.mean(axis=0)
    size = max(float(np.abs(place).max()), _LEVER_MM)
    frame = np.zeros((len(place), 3, 6))
    frame[:, :, :3] = np.eye(3)
    for k in range(3):
        frame[:, :, 3 + k] = np.cross(np.eye(3)[k], place) / size
    return frame, size


def left_of(table: Array, frame: Array) -> tuple[Array, Array]:
    """What a frame (n, 3, 6) leaves of a table (n, 3, k), and the shares (6, k) that it takes up."""
    flat = table.reshape(-1, table.shape[2])
    share = np.asarray(np.linalg.lstsq(frame.reshape(-1, 6), flat, rcond=_SHORT)[0], float)
    return (flat - frame.reshape(-1, 6) @ share).reshape(table.shape), share


def _spreads(tables: tuple[Array, Array], covariance: Array) -> tuple[Array, Array]:
    """(n, 3) standard deviations of what tables (n, 3, k) make of unknowns with a covariance."""
    squares = (np.einsum("nik,kl,nil->ni", table, covariance, table) for table in tables)
    place, turn = (np.sqrt(np.maximum(square, 0.0)) for square in squares)
    return np.asarray(place), np.asarray(turn)


def fit_joints(model: Model, readings: Sequence[Reading]) -> JointFit:
    """The unknowns of a machine from its readings. Readings far off are left out. Raises ConfigError and
    CannotCompute where readings cannot be used."""
    starts, left_out = starts_of(model, readings), list[LeftOut]()
    while True:
        fit = adjusted(model, starts)
        slips = [_slips(source, fit.chi_square / fit.freedom) for source in fit.sources]
        if not any(slips):
            return replace(fit, left_out=tuple(left_out))
        for index, (source, rows) in enumerate(zip(fit.sources, slips, strict=True)):
            reading = source.start.reading
            off = np.abs(source.residual / source.start.sigma).max(axis=1)
            left_out += [LeftOut(reading.source, int(reading.row[k]), float(off[k])) for k in rows]
            kept = np.ones(reading.count, bool)
            kept[rows] = False
            starts[index] = source.start.only(kept)


def starts_of(model: Model, readings: Sequence[Reading]) -> list[Start]:
    """What the adjustment begins with. Raises ConfigError and CannotCompute."""
    nominal = model.machine(np.zeros(len(model.unknowns)))
    return [reading.start(nominal.nominal(reading.values), model.structure) for reading in readings]


def held_out(fit: JointFit) -> tuple[Array, Array] | None:
    """(n,) mm by which readings that had no part in a fit are off: with the nominal machine in the best
    frame, and after a fit of the others. None where there are too few readings."""
    random = np.random.default_rng(0)
    model, train, test = fit.model, [], []
    for source in fit.sources:
        count = source.start.reading.count
        out = np.zeros(count, bool)
        if count >= _FEW:
            out[random.permutation(count)[: count // HELD_OUT]] = True
        train.append(source.start.only(~out))
        test.append(source.start.only(out))
    if not sum(start.reading.count for start in test):
        return None
    offs = []
    for one in (replace(model, unknowns=(), known=None), model):
        part = adjusted(one, train)
        off = []
        for start, source in zip(test, part.sources, strict=True):
            pose = one.machine(part.theta, start.reading.payload).actual(start.reading.values)
            off.append(start.off_mm(start.measured - start.predicted(pose, source.own)))
        offs.append(np.concatenate(off))
    return offs[0], offs[1]


def adjusted(model: Model, starts: Sequence[Start], most: int = _STEPS) -> JointFit:
    """One fit of all readings in at most so many steps. Raises CannotCompute where it does not settle."""
    theta = np.zeros(len(model.unknowns))
    owns = [np.zeros(len(start.prior)) for start in starts]
    precision = model.precision
    before, longest = np.inf, _LONGEST * model.prior
    base, least = (theta, owns), np.inf
    for number in range(most):
        blocks = _blocks(model, theta, starts, owns, closes=number == 0)
        score = _score(blocks, theta, owns) + float(theta @ precision @ theta)
        if not blocks or (number >= _FREE and score > least + _SETTLED):
            theta = 0.5 * (base[0] + theta)
            owns = [0.5 * (one + other) for one, other in zip(base[1], owns, strict=True)]
            continue
        base, least = (theta, owns), score
        normal = Normal.of(len(theta))
        try:
            for block in blocks:
                normal.add(block)
            solved = solve(normal, precision) if len(theta) else None
        except np.linalg.LinAlgError:
            raise _unsettled(model) from None
        new = theta if solved is None else theta + np.clip(solved.theta - theta, -longest, longest)
        sigma = np.ones(0) if solved is None else np.sqrt(np.diag(solved.covariance))
        chi_square = sum(float(np.sum(residuals_of(b, new)[2] ** 2)) for b in blocks)
        owns = [residuals_of(block, new)[0] for block in blocks]
        most_moved = float(np.max(np.abs(new - theta) / sigma, initial=0.0))
        theta, change, before = new, abs(chi_square - before), chi_square
        if most_moved < _SETTLED and change < _SETTLED * (1.0 + _SETTLED * chi_square):
            break
    else:
        # along a curved valley of unknowns that look almost alike all places are as good
        if most_moved > _ALIKE_SIGMA or change > _ALIKE_CHI:
            raise _unsettled(model)
    sources: list[Source] = []
    chi_square = 0.0
    for start, own in zip(starts, owns, strict=True):
        pose = model.machine(theta, start.reading.payload).actual(start.reading.values)
        residual = start.measured - start.predicted(pose, own)
        chi_square += float(np.sum((residual / start.sigma) ** 2))
        sources.append(Source(start, residual, own))
    covariance = np.zeros((0, 0)) if solved is None else solved.covariance
    free = sum(int(np.sum(np.isinf(start.prior))) for start in starts)
    freedom = max(normal.count - float(np.trace(covariance @ normal.H)) - free, 1.0)
    return JointFit(
        model,
        theta,
        _scattered(covariance, precision, max(1.0, chi_square / freedom)),
        tuple(sources),
        (),
        chi_square,
        freedom,
        _rank(blocks, model),
    )


def _blocks(
    model: Model, theta: Array, starts: Sequence[Start], owns: Sequence[Array], *, closes: bool
) -> list[Block]:
    """The rows of all instruments about theta; none where a platform does not close there. Raises
    CannotCompute in that case where it `closes`."""
    try:
        return [block_of(model, theta, start, own) for start, own in zip(starts, owns, strict=True)]
    except CannotCompute:
        if closes:
            raise
        return []


def _score(blocks: Sequence[Block], theta: Array, owns: Sequence[Array]) -> float:
    """Chi-square of the rows of instruments about unknowns theta (k,) and those of their own."""
    total = 0.0
    for block, own in zip(blocks, owns, strict=bool(blocks)):
        (chunk,) = block.chunks()
        total += float(np.sum(((chunk.y - chunk.rows @ theta - chunk.local @ own) / chunk.sigma) ** 2))
    return total


def _scattered(covariance: Array, precision: Array, factor: float) -> Array:
    """The covariance of unknowns where readings scatter by this factor more than stated, in squares. What
    holds an unknown in place of readings holds it as well as before."""
    held = covariance @ precision @ covariance
    return np.asarray(factor * covariance - (factor - 1.0) * held)


def _unsettled(model: Model) -> CannotCompute:
    return CannotCompute(
        f"the unknowns of {model.structure.name!r} do not settle: check units, signs, directions and the "
        "tool vectors of the readings"
    )


def block_of(model: Model, theta: Array, start: Start, own: Array, twists: Array | None = None) -> Block:
    """The rows of one instrument, linear about theta and its own unknowns. `twists` are those of the model
    there, where they are known."""
    reading = start.reading
    pose = model.machine(theta, reading.payload).actual(reading.values)
    if twists is None:
        twists = model.twists(theta, reading.values, reading.payload)
    predicted = start.predicted(pose, own)
    slopes = _by_pose(start, pose, own)
    rows = slopes @ twists
    local = np.zeros((*predicted.shape, len(own)))
    for k in range(len(own)):
        step = np.zeros(len(own))
        step[k] = _HALF_RAD if k in start.turns else _HALF_MM
        local[..., k] = (start.predicted(pose, own + step) - start.predicted(pose, own - step)) / (
            2 * step[k]
        )
    y = start.measured - predicted + rows @ theta + local @ own
    size = y.size
    chunk = Chunk(
        rows.reshape(size, len(theta)),
        y.ravel(),
        np.broadcast_to(start.sigma, y.shape).ravel(),
        local.reshape(size, len(own)),
    )
    loose = np.where(np.isinf(start.prior), _LOOSE, 1.0 / np.where(start.prior > 0.0, start.prior, 1.0) ** 2)
    return Block.of(chunk, np.arange(len(theta)), loose, reading.source)


def _by_pose(start: Start, pose: Poses, own: Array) -> Array:
    """(n, m, 6) readings by mm and rad of the gauge frame, in workpiece coordinates."""
    columns = []
    for k in range(6):
        ends = []
        for sign in (1.0, -1.0):
            if k < 3:
                moved = shift(sign * _HALF_MM * np.eye(3)[k]) @ pose
            else:
                turn = tilts(sign * _HALF_RAD * np.eye(3)[k - 3])
                moved = Poses(turn @ pose.rotation, pose.position)
            ends.append(start.predicted(moved, own))
        columns.append((ends[0] - ends[1]) / (2.0 * (_HALF_MM if k < 3 else _HALF_RAD)))
    return np.stack(columns, axis=2)


def _rank(blocks: Sequence[Block], model: Model) -> int:
    """How many combinations of unknowns the readings alone show better than the prior."""
    if not model.unknowns:
        return 0
    tables = []
    for block in blocks:
        (chunk,) = block.chunks()
        rows = chunk.rows @ model.root / chunk.sigma[:, None]
        local = chunk.local[:, block.precision <= _LOOSE] / chunk.sigma[:, None]
        local = local / np.maximum(np.linalg.norm(local, axis=0), 1e-300)
        inner = np.linalg.qr(local)[0]
        tables.append(rows - inner @ (inner.T @ rows))
    return int(np.sum(np.linalg.svd(np.concatenate(tables), compute_uv=False) > 1.0))


def _slips(source: Source, reduced: float) -> list[int]:
    """Rows that are far off, the worst ones first: by their own noise, or by that of all where the readings
    fit worse than stated."""
    off = np.abs(source.residual / source.start.sigma).max(axis=1) / max(1.0, float(np.sqrt(reduced)))
    worst = np.argsort(-off)[: max(1, int(_SHARE * len(off)))]
    return [int(k) for k in worst if off[k] > OUTLIER and len(off) > 3]
