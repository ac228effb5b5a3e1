"""The size and character of curves that no line reads, by the evidence of readings all over the volume.

As with lines (`character`), nothing is chosen: the kind of the smooth part, sizes, steps and ripple are
each what is to be expected, given the others. Curves of a class are alike, and ripple is that of the machine.
It is mostly shorter than any cell. So it is noise of readings, and uncertainty at every other position.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from olp.calibration.estimator.basis import Scales
from olp.calibration.estimator.beside import block_of, shares_of
from olp.calibration.estimator.between import Hidden
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
from olp.calibration.observations.base import ScatteredState, State
from olp.calibration.observations.radial import AlongState
from olp.core.arrays import Array
from olp.core.values import dataclass

#: The straight part of a curve against the smooth rest, root mean squares. Positioning has a scale of its own,
#: of screws, racks and temperature.
STRAIGHT = {"positioning": 3.0, "straightness": 1.5, "angle": 1.5}
#: Smooth part of positioning before any reading, mm, and the standard deviation of its logarithm.
SIZE_BEFORE = 0.03, 0.8
#: How far classes differ from what they usually are to each other, as a standard deviation of a logarithm.
RELATED = 0.8
#: Readings from which all this is learnt, at most: more say the same.
ENOUGH = 3000
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
        return STRAIGHT[kind] * self.size * USUAL[kind], Scales.of(USUAL[kind] * row / rms_of_processes())


@dataclass(slots=True)
class Unread:
    """Curves without lines. `before` holds the probabilities of their characters by class, as the curves with
    lines show them."""

    before: Mapping[str, Array]
    own: dict[str, _Character] = field(init=False)
    lined: bool = field(init=False)
    sized: bool = field(init=False)
    heard: bool = field(init=False)

    def __post_init__(self) -> None:
        self.own = {kind: _Character(*_expectations(table)) for kind, table in self.before.items()}
        sizes = [table.sum(axis=(0, 2, 3)) for table in self.before.values()]
        # before any reading all sizes are alike
        self.lined = any(np.ptp(share) > 0.01 for share in sizes)
        self.sized, self.heard = self.lined, False
        if not self.lined:
            middle, spread = SIZE_BEFORE
            self.own = {
                kind: replace(one, size=middle * math.exp(spread**2)) for kind, one in self.own.items()
            }

    @property
    def classes(self) -> dict[str, Class]:
        return {kind: one.of(kind) for kind, one in self.own.items()}

    def learn(self, prior: Prior, states: Sequence[State], theta: Array) -> bool:
        """Adds what readings beside lines say of the classes; False where there are no such readings."""
        readings = _Readings.of(prior, states, theta)
        normal = readings.normal(self.classes)
        p = prior.parameters
        kinds = [
            kind for kind in self.own
            if any(
                class_of(name) == kind and name not in prior.shapes and normal.H[part, part].any()
                for name, part in p.slices.items() if name in p.spaces
            )
        ]  # fmt: skip
        if not kinds or not readings.scattered:
            return False
        self._sweep(readings, kinds)
        self.sized = self.heard = True
        return True

    def _sweep(self, readings: _Readings, kinds: Sequence[str]) -> None:
        normal = readings.normal(self.classes)

        def score(changed: Mapping[str, _Character]) -> float:
            classes = {kind: one.of(kind) for kind, one in {**self.own, **changed}.items()}
            return evidence(normal, *readings.prior.precision(classes))

        if not self.sized:
            tried = [{kind: replace(self.own[kind], size=size) for kind in kinds} for size in SIZES]
            values = [score(one) + _about(size, *SIZE_BEFORE) for one, size in zip(tried, SIZES, strict=True)]
            self.own.update(tried[int(np.argmax(values))])
        self._learn_kinds(kinds, score)
        for kind in kinds:
            self._learn_size(kind, score)
        for part, sizes, axes in (("ripple", RIPPLE, (0, 1, 2)), ("steps", STEPS, (0, 1, 3))):
            self._learn_rough(part, sizes, axes, readings, kinds)

    def _learn_rough(
        self, part: str, sizes: Array, axes: tuple[int, ...], readings: _Readings, kinds: Sequence[str]
    ) -> None:
        """Ripple or steps, of which cells hide some: that is noise of readings."""
        values = []
        if self.heard:
            now = getattr(self.own[kinds[0]], part)
            near = np.abs(np.arange(len(sizes)) - np.argmin(np.abs(sizes - now))) <= 2
        else:
            near = np.ones(len(sizes), bool)
        for size in sizes[near]:
            own = {**self.own, **{kind: replace(self.own[kind], **{part: size}) for kind in kinds}}
            classes = {kind: one.of(kind) for kind, one in own.items()}
            values.append(evidence(readings.normal(classes), *readings.prior.precision(classes)))
        marginal = _log(np.mean([self.before[kind].sum(axis=axes) for kind in kinds], axis=0))
        size = _expected(sizes[near], values + marginal[near])
        self.own.update({kind: replace(self.own[kind], **{part: size}) for kind in kinds})

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
    """Normal equations of lines, and blocks of other readings with the variance (n, curves) that each curve
    without lines adds to each of them, per variance that its cells hide."""

    prior: Prior
    lines: Normal
    scattered: Sequence[tuple[Block, Array]]
    names: Sequence[str]

    @classmethod
    def of(cls, prior: Prior, states: Sequence[State], theta: Array) -> _Readings:
        p, hidden = prior.parameters, prior.hidden
        names = [name for name in hidden if name not in prior.shapes]
        unit = {**hidden, **dict.fromkeys(names, Hidden(np.zeros(1), np.ones(1)))}
        columns = [k for k, name in enumerate(unit) if name in names]
        lines, scattered = Normal.of(p.size), []
        wide = [state for state in states if isinstance(state, ScatteredState | AlongState)]
        for state in states:
            if state not in wide:
                lines.add(block_of(state, theta, p, hidden))
        every = math.ceil(sum(state.count for state in wide) / ENOUGH) or 1
        for state in wide:
            block, shares = shares_of(state, theta, p, unit)
            chunk = _joined(list(block.chunks()), np.delete(shares, columns, axis=1).sum(axis=1), every)
            scattered.append((Block.of(chunk, block.columns, block.precision), shares[::every, columns]))
        prior.push(lines)
        return cls(prior, lines, scattered, names)

    def normal(self, classes: Mapping[str, Class]) -> Normal:
        """All of them, where curves without lines hide what such classes do."""
        hidden = self.prior.hidden_of(classes)
        variance = np.array([float(hidden[name].variance[0]) for name in self.names])
        normal = replace(self.lines, H=self.lines.H.copy(), g=self.lines.g.copy())
        for block, shares in self.scattered:
            (chunk,) = block.chunks()
            sigma = np.sqrt(chunk.sigma**2 + shares @ variance)
            normal.add(Block.of(replace(chunk, sigma=sigma), block.columns, block.precision))
        return normal


def _joined(chunks: Sequence[Chunk], more: Array, every: int) -> Chunk:
    """One chunk with every so many readings, and more (n,) of variance."""
    rows, y, sigma, local = (
        np.concatenate([getattr(chunk, name) for chunk in chunks])[::every]
        for name in ("rows", "y", "sigma", "local")
    )
    return Chunk(rows, y, np.sqrt(sigma**2 + more[::every]), local)


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
