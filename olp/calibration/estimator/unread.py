"""The size and character of curves that no line reads, by the evidence of readings all over the volume.

As with lines (`character`), nothing is chosen: the kind of the smooth part, sizes, steps and ripple are
each what is to be expected, given the others. Curves of a class are alike, and ripple is that of the machine.
It is mostly shorter than any cell. So it is noise of readings, and uncertainty at every other position.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, fields, replace
from typing import Any

import numpy as np

from olp.calibration.estimator import lined
from olp.calibration.estimator.basis import Scales
from olp.calibration.estimator.beside import block_of, gains_of, shares_of
from olp.calibration.estimator.character import (
    RIPPLE,
    SIZES,
    SMOOTH,
    STEPS,
    USUAL,
    class_of,
    rms_of_processes,
)
from olp.calibration.estimator.lined import Levels, Lined, level_of
from olp.calibration.estimator.normal import Block, Chunk, Normal, evidence
from olp.calibration.estimator.prior import Class, Prior
from olp.calibration.estimator.rail_joints import Joints
from olp.calibration.estimator.smoothing import Shape
from olp.calibration.observations.base import ScatteredState, State
from olp.calibration.observations.radial import AlongState
from olp.core.arrays import Array
from olp.core.units import AXES
from olp.core.values import dataclass

#: The straight part of a curve against a usual smooth part, or a larger one. Positioning has a scale of its
#: own, of screws, racks and temperature.
STRAIGHT = {"positioning": 4.0, "straightness": 3.0, "angle": 3.0}
#: Smooth part of positioning before any reading, mm, and the standard deviation of its logarithm.
SIZE_BEFORE = 0.03, 0.8
#: How far classes differ from what they usually are to each other, as a standard deviation of a logarithm.
RELATED = 0.8
#: Candidates to begin with: kinds of smooth parts, sizes, steps, ripple, by their number.
FEW = (0, 1, 3), (2, 4, 6), (0, 3), (0, 2, 4)
#: Readings from which all this is learnt, at most: more say the same.
ENOUGH = 1000
#: Where all curves have lines: logarithm of how much less probable factors are that are not tried.
IMPROBABLE = 5.0
#: Logarithm of the probability of ripple above all candidates.
NONE = -1e3
#: Factors of ripple that are tried, and the least ripple that they multiply, mm.
TIMES = 0.0, 0.125, 0.25, 0.5, 1.0, 2.0
LEAST_RIPPLE = 2e-4
#: Sizes that are tried on either side of the present one, once it is known.
_NEAR = 2.0


@dataclass(frozen=True, slots=True)
class _Character:
    """Root mean squares of the curves of a class over the axis, in mm of positioning, and the shares (kinds,)
    of its smooth part."""

    kinds: tuple[float, ...]
    size: float
    steps: float
    ripple: float

    def of(self, kind: str) -> Class:
        row = np.zeros(7)
        row[list(SMOOTH)] = np.sqrt(self.kinds) * self.size
        row[[2, 3]] = self.steps, self.ripple
        # a curve of steps or kinks alone has a small smooth part, and leans as others do
        straight = STRAIGHT[kind] * max(self.size, SIZE_BEFORE[0])
        return straight * USUAL[kind], Scales.of(USUAL[kind] * row / rms_of_processes())


@dataclass(slots=True)
class Unread:
    """Curves without lines. `before` holds the probabilities of their characters by class, as the curves with
    lines show them, if there are such; `lined` are these."""

    before: Mapping[str, Array]
    lined: Lined
    own: dict[str, _Character] = field(init=False)
    sized: bool = field(init=False)
    heard: bool = field(init=False)
    joints: Joints = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.own = {kind: _Character(*_expectations(table)) for kind, table in self.before.items()}
        self.sized, self.heard = bool(self.lined.first), False
        if not self.sized:
            middle, spread = SIZE_BEFORE
            self.own = {
                kind: replace(one, size=middle * math.exp(spread**2)) for kind, one in self.own.items()
            }

    @property
    def classes(self) -> dict[str, Class]:
        return _classes(self.own)

    def learn(self, readings: Readings) -> bool:
        """Adds what readings beside lines say of the classes; False where they say nothing more."""
        normal, prior = readings.normal(self.own, self.lined.shapes()), readings.prior
        p = prior.parameters
        kinds = [
            kind for kind in self.own
            if any(
                class_of(name) == kind and name not in prior.shapes and normal.H[part, part].any()
                for name, part in p.slices.items() if name in p.spaces
            )
        ]  # fmt: skip
        if not kinds and (self.heard or not prior.shapes):
            return False
        if not self.sized:
            self._find(readings, kinds)
        bound = math.inf if kinds else IMPROBABLE
        self._learn_ripple(readings, bound)
        self._learn_kinds(readings, kinds, bound)
        for kind in kinds:
            self._learn_size(readings, kind)
        self._learn_steps(readings, kinds, bound)
        self.sized = self.heard = True
        return True

    def _find(self, readings: Readings, kinds: Sequence[str]) -> None:
        """Where to begin, all classes alike: the most probable of few candidates of everything together. What
        explains kinks is either of a rough kind or full of steps, and from one the other is not found."""
        tables = [self.before[kind] for kind in kinds]
        marginals = [
            _log(np.mean([table.sum(axis=axes) for table in tables], axis=0))
            for axes in ((1, 2, 3), (0, 1, 3), (0, 1, 2))
        ]
        best, most = self.own, -math.inf
        pure = np.eye(len(SMOOTH))
        for j, k in itertools.product(*FEW[2:]):
            rough = {
                kind: replace(one, steps=float(STEPS[j]), ripple=float(RIPPLE[k]))
                for kind, one in self.own.items()
            }
            score = readings.score(rough, self.lined.shapes())
            for i, size in itertools.product(FEW[0], SIZES[list(FEW[1])]):
                smooth = tuple(pure[i].tolist())
                own = {**rough, **{kind: replace(rough[kind], kinds=smooth, size=size) for kind in kinds}}
                value = score(own)
                value += marginals[0][i] + marginals[1][j] + marginals[2][k] + _about(size, *SIZE_BEFORE)
                if value > most:
                    best, most = own, value
        self.own = best

    def _learn_ripple(self, readings: Readings, bound: float) -> None:
        """Ripple of all curves, also of those with lines, by one factor. Cells hide most of it: that is
        noise of readings."""
        now = {kind: max(one.ripple, LEAST_RIPPLE) for kind, one in self.own.items()}
        sizes = {kind: np.multiply(TIMES, size) for kind, size in now.items()}
        values = np.mean(
            [_prior_of(self.before[kind], lined.RIPPLE, RIPPLE, sizes[kind]) for kind in now], axis=0
        )

        def changed(k: int) -> dict[str, _Character]:
            return {kind: replace(one, ripple=float(sizes[kind][k])) for kind, one in self.own.items()}

        levels = {kind: np.array([level_of(RIPPLE, size) for size in sizes[kind]]) for kind in now}
        share = self._shares(readings, lined.RIPPLE, levels, values, changed, bound)
        times = float(np.sqrt(share @ np.square(TIMES)))
        self.own = {kind: replace(one, ripple=times * now[kind]) for kind, one in self.own.items()}

    def _learn_steps(self, readings: Readings, kinds: Sequence[str], bound: float) -> None:
        """Steps of all curves, alike in all classes. Cells hide some of them, too."""
        kinds = kinds or list(self.own)
        values = _log(np.mean([self.before[kind].sum(axis=(0, 1, 3)) for kind in kinds], axis=0))
        if self.heard or (not self.lined.first and self.own[kinds[0]].steps in STEPS):
            near = np.abs(np.arange(len(STEPS)) - np.argmin(np.abs(STEPS - self.own[kinds[0]].steps)))
            values[near > (1 if self.heard else 2)] = NONE

        def changed(k: int) -> dict[str, _Character]:
            return {**self.own, **{kind: replace(self.own[kind], steps=float(STEPS[k])) for kind in kinds}}

        levels = dict.fromkeys(self.own, np.arange(len(STEPS), dtype=float))
        share = self._shares(readings, lined.STEPS, levels, values, changed, bound)
        size = float(np.sqrt(share @ STEPS**2))
        self.own.update({kind: replace(self.own[kind], steps=size) for kind in kinds})

    def _learn_kinds(self, readings: Readings, kinds: Sequence[str], bound: float) -> None:
        """The kind of the smooth part is that of the machine."""
        kinds = kinds or list(self.own)
        values = _log(np.mean([self.before[kind].sum(axis=(1, 2, 3)) for kind in kinds], axis=0))
        pure = [tuple(row) for row in np.eye(len(SMOOTH)).tolist()]

        def changed(k: int) -> dict[str, _Character]:
            return {**self.own, **{kind: replace(self.own[kind], kinds=pure[k]) for kind in kinds}}

        levels = dict.fromkeys(self.own, np.arange(len(SMOOTH), dtype=float))
        share = self._shares(readings, lined.KIND, levels, values, changed, bound)
        self.own.update({kind: replace(self.own[kind], kinds=tuple(share.tolist())) for kind in kinds})

    def _shares(
        self, readings: Readings, axis: int, levels: Levels, values: Array,
        changed: Callable[[int], Mapping[str, _Character]], bound: float,
    ) -> Array:  # fmt: skip
        """(n,) probabilities of levels of an axis, with logarithms `values` (n,) before readings; those less
        probable by `bound` are not tried. Curves with lines hear of them."""
        values, probable = values.copy(), values > max(values.max() - bound, 0.5 * NONE)
        if probable.sum() > 1:
            for k in np.flatnonzero(probable).tolist():
                values[k] += readings.evidence(changed(k), self.lined.at(axis, levels, k))
        share = np.zeros(len(values))
        share[probable] = _weights(values[probable])
        self.lined.hear(axis, levels, share)
        return share

    def _learn_size(self, readings: Readings, kind: str) -> None:
        own = self.own[kind]
        near = np.abs(np.log2(SIZES / own.size)) <= _NEAR + 0.5
        score = readings.score(self.own, self.lined.shapes())
        values = np.array([score({**self.own, kind: replace(own, size=size)}) for size in SIZES[near]])
        if self.lined.first:
            values += _log(self.before[kind].sum(axis=(0, 2, 3)))[near]
        else:
            others = [math.log(one.size) for other, one in self.own.items() if other != kind]
            usual = math.exp(sum(others) / len(others))
            values += [_about(size, *SIZE_BEFORE) + _about(size, usual, RELATED) for size in SIZES[near]]
        self.own[kind] = replace(own, size=_expected(SIZES[near], values))


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """Normal equations of lines, and all other readings (n,) with the precision of their own unknowns. `now`
    (n, curves) is the variance that curves hide at them, `gain` how much they change with each curve where
    they are, at `position` (n, 3)."""

    prior: Prior
    lines: Normal
    chunk: Chunk
    precision: Array
    now: Array
    gain: Array
    position: Array

    @classmethod
    def of(cls, prior: Prior, states: Sequence[State], theta: Array) -> Readings | None:
        """None where no readings are scattered."""
        p, hidden = prior.parameters, prior.hidden
        wide = [state for state in states if isinstance(state, ScatteredState | AlongState) and state.apart]
        if not wide:
            return None
        lines = Normal.of(p.size)
        for state in states:
            if state not in wide:
                lines.add(block_of(state, theta, p, hidden))
        prior.push(lines)
        every = math.ceil(sum(len(state.positions()) for state in wide) / ENOUGH)
        thin = [_thinned(state, every) for state in wide]
        blocks, now = zip(*(shares_of(state, theta, p, hidden) for state in thin), strict=True)
        gain = np.concatenate([gains_of(state, theta, p) for state in thin])
        position = np.concatenate([state.positions() for state in thin])
        chunk = _joined([_joined(list(block.chunks())) for block in blocks], apart=True)
        precision = np.concatenate([block.precision for block in blocks])
        return cls(prior, lines, chunk, precision, np.concatenate(now), gain, position)

    @property
    def names(self) -> list[str]:
        """The curves of the columns of `gain`."""
        return list(self.prior.parameters.spaces)

    def noisy(self, classes: Mapping[str, Class], shapes: Mapping[str, Shape]) -> Chunk:
        """All but lines, with noise as curves of such classes and shapes make it."""
        variance = np.zeros(len(self.chunk.y))
        for k, (name, one) in enumerate(self.prior.hidden_of(classes).items()):
            shape = shapes.get(name)
            if shape is None:
                own_variance = one.at(self.position[:, AXES.index(name[2])])
                variance = variance + self.gain[:, k] ** 2 * own_variance
            else:
                times = shape.hidden.variance.mean() / max(float(one.variance.mean()), 1e-300)
                variance = variance + times * self.now[:, k]
        return replace(self.chunk, beside=np.sqrt(variance))

    def normal(self, own: Mapping[str, _Character], shapes: Mapping[str, Shape]) -> Normal:
        """All of them, with that noise."""
        normal = replace(self.lines, H=self.lines.H.copy(), g=self.lines.g.copy())
        normal.add(Block.of(self.noisy(_classes(own), shapes), np.arange(len(normal.g)), self.precision))
        return normal

    def evidence(self, own: Mapping[str, _Character], shapes: Mapping[str, Shape]) -> float:
        """The log evidence of readings beside lines under curves of such characters and shapes, up to a
        constant."""
        return self.score(own, shapes)(own)

    def score(
        self, own: Mapping[str, _Character], shapes: Mapping[str, Shape]
    ) -> Callable[[Mapping[str, _Character]], float]:
        """The same of other characters, with noise as these make it."""
        normal, prior = self.normal(own, shapes), self.prior.with_shapes(shapes)

        def value(changed: Mapping[str, _Character]) -> float:
            precision = prior.precision(_classes(changed))
            whole = evidence(normal, *precision)
            # what lines say is in the probabilities before
            return whole - evidence(self.lines, *precision) if shapes else whole

        return value


def _classes(own: Mapping[str, _Character]) -> dict[str, Class]:
    return {kind: one.of(kind) for kind, one in own.items()}


def _thinned(state: ScatteredState | AlongState, every: int) -> ScatteredState | AlongState:
    """A state with every so many of its readings. Those along one direction are few."""
    if every == 1 or isinstance(state, AlongState):
        return state
    whole: Any = state
    taken: Any = state.observation
    columns = {one.name: getattr(taken, one.name) for one in fields(taken)}
    fewer = {
        name: value[::every]
        for name, value in columns.items()
        if isinstance(value, np.ndarray) and len(value) == state.count
    }
    thin: ScatteredState = replace(whole, observation=replace(taken, **fewer))
    return thin


def _joined(chunks: Sequence[Chunk], *, apart: bool = False) -> Chunk:
    """One chunk of all; `apart` where each has unknowns of its own."""
    rows, y, sigma = (
        np.concatenate([getattr(chunk, name) for chunk in chunks]) for name in ("rows", "y", "sigma")
    )
    local = [chunk.local for chunk in chunks]
    own = [np.zeros(0, np.intp) if chunk.group is None else chunk.group for chunk in chunks]
    before = np.cumsum([0, *(1 + int(part.max(initial=-1)) for part in own)])
    group = np.concatenate([part + first for part, first in zip(own, before, strict=False)])
    if not apart:
        return Chunk(rows, y, sigma, np.concatenate(local), group=group)
    whole = np.zeros((len(y), sum(part.shape[1] for part in local)))
    row = column = 0
    for part in local:
        n, m = part.shape
        whole[row : row + n, column : column + m] = part
        row, column = row + n, column + m
    return Chunk(rows, y, sigma, whole, group=group)


def _expectations(table: Array) -> tuple[tuple[float, ...], float, float, float]:
    """Shares of kinds, and the root of the expected square of size, steps and ripple."""
    kinds = table.sum(axis=(1, 2, 3))
    grids = (SIZES, (0, 2, 3)), (STEPS, (0, 1, 3)), (RIPPLE, (0, 1, 2))
    size, steps, ripple = (float(np.sqrt(table.sum(axis=axes) @ grid**2)) for grid, axes in grids)
    return tuple(kinds.tolist()), size, steps, ripple


def _prior_of(table: Array, axis: int, grid: Array, sizes: Array) -> Array:
    """(n,) log probabilities of sizes (n,) along an axis of a table; the first candidate is zero."""
    own = _log(table.sum(axis=tuple(other for other in range(4) if other != axis)))
    positive = np.maximum(sizes, 1e-300)
    values = np.interp(np.log(positive), np.log(grid[1:]), own[1:], right=NONE)
    return np.asarray(np.where(sizes == 0.0, own[0], values))


def _weights(values: Array) -> Array:
    weight = np.exp(values - np.max(values))
    return np.asarray(weight / weight.sum())


def _expected(sizes: Array, values: Array) -> float:
    """The root of the expected square of sizes (n,) with log probabilities (n,)."""
    return float(np.sqrt(_weights(values) @ sizes**2))


def _log(table: Array) -> Array:
    return np.asarray(np.log(np.maximum(table, 1e-300)))


def _about(size: float, middle: float, spread: float) -> float:
    return -0.5 * (math.log(size / middle) / spread) ** 2
