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

from olp.calibration.estimator.basis import Scales
from olp.calibration.estimator.beside import block_of, shares_of
from olp.calibration.estimator.between import SHORT, Hidden, with_more
from olp.calibration.estimator.character import (
    RIPPLE,
    SIZES,
    SMOOTH,
    STEPS,
    USUAL,
    class_of,
    rms_of_processes,
)
from olp.calibration.estimator.normal import Block, Chunk, Normal, evidence
from olp.calibration.estimator.prior import Class, Prior
from olp.calibration.estimator.smoothing import Shape
from olp.calibration.observations.base import ScatteredState, State
from olp.core.arrays import Array
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
    lines show them, if `lined`."""

    before: Mapping[str, Array]
    lined: bool
    own: dict[str, _Character] = field(init=False)
    first: dict[str, _Character] = field(init=False)
    sized: bool = field(init=False)
    heard: bool = field(init=False)

    def __post_init__(self) -> None:
        self.own = {kind: _Character(*_expectations(table)) for kind, table in self.before.items()}
        self.sized, self.heard = self.lined, False
        if not self.lined:
            middle, spread = SIZE_BEFORE
            self.own = {
                kind: replace(one, size=middle * math.exp(spread**2)) for kind, one in self.own.items()
            }
        self.first = dict(self.own)

    @property
    def classes(self) -> dict[str, Class]:
        return _classes(self.own)

    def learn(self, prior: Prior, states: Sequence[State], theta: Array) -> bool:
        """Adds what readings beside lines say of the classes; False where there are no such readings."""
        readings = _Readings.of(prior, self.own, states, theta)
        if readings is None:
            return False
        normal = readings.normal(self.own)
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
        self._learn_ripple(readings, math.inf if kinds else IMPROBABLE)
        if kinds:
            self._sweep(readings, kinds)
            self._learn_steps(readings, kinds)
        self.sized = self.heard = True
        return True

    def shapes(self, shapes: Mapping[str, Shape]) -> Mapping[str, Shape]:
        """Those of curves with lines, with the ripple that readings beside these lines show."""
        if not self.heard:
            return shapes
        changed = {}
        for name, shape in shapes.items():
            times = self.own[class_of(name)].ripple / self.first[class_of(name)].ripple
            hidden = with_more(shape.hidden, _more(shape.scales, times))
            scales = replace(shape.scales, ripple=times * shape.scales.ripple)
            changed[name] = replace(shape, scales=scales, hidden=hidden)
        return changed

    def _score(self, readings: _Readings) -> Callable[[Mapping[str, _Character]], float]:
        """The log evidence where some classes are changed, with noise as it is now."""
        normal = readings.normal(self.own)
        return lambda changed: evidence(normal, *readings.prior.precision(_classes({**self.own, **changed})))

    def _find(self, readings: _Readings, kinds: Sequence[str]) -> None:
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
            normal = readings.normal(rough)
            for i, size in itertools.product(FEW[0], SIZES[list(FEW[1])]):
                smooth = tuple(pure[i].tolist())
                own = {**rough, **{kind: replace(rough[kind], kinds=smooth, size=size) for kind in kinds}}
                value = evidence(normal, *readings.prior.precision(_classes(own)))
                value += marginals[0][i] + marginals[1][j] + marginals[2][k] + _about(size, *SIZE_BEFORE)
                if value > most:
                    best, most = own, value
        self.own = best

    def _sweep(self, readings: _Readings, kinds: Sequence[str]) -> None:
        score = self._score(readings)
        self._learn_kinds(kinds, score)
        for kind in kinds:
            self._learn_size(kind, score)

    def _learn_ripple(self, readings: _Readings, bound: float) -> None:
        """Ripple of all curves, also of those with lines, by one factor. Cells hide most of it: that is
        noise of readings."""
        now = {kind: max(one.ripple, LEAST_RIPPLE) for kind, one in self.own.items()}
        tried = [{kind: times * size for kind, size in now.items()} for times in TIMES]
        marginals = [(_log(self.before[kind].sum(axis=(0, 1, 2))), size) for kind, size in now.items()]
        grid = np.log(RIPPLE[1:])
        values = [np.mean([own[0] for own, _ in marginals])]
        for times in TIMES[1:]:
            values.append(
                np.mean(
                    [np.interp(np.log(times * size), grid, own[1:], right=NONE) for own, size in marginals]
                )
            )
        probable = np.array(values) > max(values) - bound
        if probable.sum() < 2:
            return
        for k in np.flatnonzero(probable).tolist():
            values[k] += readings.evidence(
                {kind: replace(self.own[kind], ripple=size) for kind, size in tried[k].items()}
            )
        times = _expected(np.array(TIMES)[probable], np.array(values)[probable])
        self.own = {kind: replace(one, ripple=times * now[kind]) for kind, one in self.own.items()}

    def _learn_steps(self, readings: _Readings, kinds: Sequence[str]) -> None:
        """Steps of curves without lines, alike in all classes. Cells hide some of them, too."""
        values = _log(np.mean([self.before[kind].sum(axis=(0, 1, 3)) for kind in kinds], axis=0))
        near = np.ones(len(STEPS), bool)
        if self.heard or self.own[kinds[0]].steps in STEPS:
            near = np.abs(np.arange(len(STEPS)) - np.argmin(np.abs(STEPS - self.own[kinds[0]].steps)))
            near = near <= (1 if self.heard else 2)
        for k in np.flatnonzero(near).tolist():
            changed = {kind: replace(self.own[kind], steps=STEPS[k]) for kind in kinds}
            values[k] += readings.evidence({**self.own, **changed})
        size = _expected(STEPS[near], values[near])
        self.own.update({kind: replace(self.own[kind], steps=size) for kind in kinds})

    def _learn_kinds(self, kinds: Sequence[str], score: Callable[[Mapping[str, _Character]], float]) -> None:
        """The kind of the smooth part is that of the machine."""
        marginal = _log(np.mean([self.before[kind].sum(axis=(1, 2, 3)) for kind in kinds], axis=0))
        pure = [tuple(row) for row in np.eye(len(SMOOTH)).tolist()]
        values = [score({kind: replace(self.own[kind], kinds=row) for kind in kinds}) for row in pure]
        shares = tuple(_weights(values + marginal).tolist())
        self.own.update({kind: replace(self.own[kind], kinds=shares) for kind in kinds})

    def _learn_size(self, kind: str, score: Callable[[Mapping[str, _Character]], float]) -> None:
        own = self.own[kind]
        near = np.abs(np.log2(SIZES / own.size)) <= _NEAR + 0.5
        values = np.array([score({kind: replace(own, size=size)}) for size in SIZES[near]])
        if self.lined:
            values += _log(self.before[kind].sum(axis=(0, 2, 3)))[near]
        else:
            others = [math.log(one.size) for other, one in self.own.items() if other != kind]
            usual = math.exp(sum(others) / len(others))
            values += [_about(size, *SIZE_BEFORE) + _about(size, usual, RELATED) for size in SIZES[near]]
        self.own[kind] = replace(own, size=_expected(SIZES[near], values))


@dataclass(frozen=True, slots=True, eq=False)
class _Readings:
    """Normal equations of lines, and all other readings (n,) with the precision of their own unknowns. `now`
    (n, curves) is the variance that curves hide at them, `each` the same where all hide a variance of 1."""

    prior: Prior
    own: Mapping[str, _Character]
    lines: Normal
    chunk: Chunk
    precision: Array
    now: Array
    each: Array

    @classmethod
    def of(
        cls, prior: Prior, own: Mapping[str, _Character], states: Sequence[State], theta: Array
    ) -> _Readings | None:
        """None where no readings are scattered."""
        p, hidden = prior.parameters, prior.hidden
        unit = dict.fromkeys(hidden, Hidden(np.zeros(1), np.ones(1)))
        # readings along lines and circles are repeated, or near each other: they see no independent ripple
        wide = [state for state in states if isinstance(state, ScatteredState)]
        if not wide:
            return None
        lines = Normal.of(p.size)
        for state in states:
            if not isinstance(state, ScatteredState):
                lines.add(block_of(state, theta, p, hidden))
        prior.push(lines)
        every = math.ceil(sum(_rows(state) for state in wide) / ENOUGH)
        thin = [_thinned(state, every) for state in wide]
        blocks, now = zip(*(shares_of(state, theta, p, hidden) for state in thin), strict=True)
        each = [shares_of(state, theta, p, unit)[1] for state in thin]
        chunk = _joined([_joined(list(block.chunks())) for block in blocks], apart=True)
        precision = np.concatenate([block.precision for block in blocks])
        return cls(prior, dict(own), lines, chunk, precision, np.concatenate(now), np.concatenate(each))

    def normal(self, own: Mapping[str, _Character]) -> Normal:
        """All of them, with noise as curves of such characters make it."""
        variance = np.zeros(len(self.chunk.y))
        for k, (name, one) in enumerate(self.prior.hidden_of(_classes(own)).items()):
            shape = self.prior.shapes.get(name)
            if shape is None:
                variance = variance + self.each[:, k] * one.variance[0]
            else:
                times = own[class_of(name)].ripple / self.own[class_of(name)].ripple
                more = self.each[:, k] * _more(shape.scales, times)
                variance = variance + np.maximum(self.now[:, k] + more, 0.0)
        normal = replace(self.lines, H=self.lines.H.copy(), g=self.lines.g.copy())
        chunk = replace(self.chunk, beside=np.sqrt(variance))
        normal.add(Block.of(chunk, np.arange(len(normal.g)), self.precision))
        return normal

    def evidence(self, own: Mapping[str, _Character]) -> float:
        """The log evidence of all of them under curves of such characters, up to a constant."""
        return evidence(self.normal(own), *self.prior.precision(_classes(own)))


def _more(scales: Scales, times: float) -> float:
    """By how much more variance cells hide of a curve of such scales with so many times its ripple."""
    return float(SHORT * (times**2 - 1.0) * (scales.ripple * rms_of_processes()[3]) ** 2)


def _classes(own: Mapping[str, _Character]) -> dict[str, Class]:
    return {kind: one.of(kind) for kind, one in own.items()}


def _rows(state: ScatteredState) -> int:
    return len(state.spread_over_rows(np.ones(state.count, np.int64)))


def _thinned(state: ScatteredState, every: int) -> ScatteredState:
    """A state with every so many of its readings."""
    if every == 1:
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
