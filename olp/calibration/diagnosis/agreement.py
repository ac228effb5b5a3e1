"""Each source of readings against all others: does it agree with them, and what could be wrong with it?

All readings but those of one source, with the prior, predict that source. In the directions of the unknowns
that it measures, what it says differs from the prediction by z standard deviations of both together. A source
that others can predict is checked by that; one that nothing else depends on is not, and is believed.

What may be wrong with a source is put as another observation (`Observation.alternatives`), and the two are
compared by the evidence of all readings (D. J. C. MacKay, Neural Computation 4, 1992, p. 415).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from olp.calibration.diagnosis.mistakes import EXCLUDED, EXPLAINS, Agreement, Tried
from olp.calibration.estimator.between import ripple_at_targets
from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.normal import Block, Chunk, Normal
from olp.calibration.observations.base import Alternative, ScatteredState, State
from olp.calibration.observations.lines import LineState, targets_of
from olp.calibration.observations.radial import AlongState
from olp.core.arrays import Array, Index
from olp.core.errors import CannotCompute
from olp.core.values import dataclass
from olp.errormodel.quality import Fitted

#: Directions count in which a source says at least this share of what all others say.
_LEAST_SHARE = 1e-3
#: Directions of the unknowns of which a source says less than this, against the best, count for nothing.
_NOTHING = 1e-13
#: A mistake is sought in a source that differs from what others say by more than so many deviations.
_DIFFERS = 1.0
#: Sources of one kind fit no better than this, as a share of what noise has.
_LEAST_MISFIT = 0.05
#: Curves of two sizes for which evidence is taken differ by this factor at most.
_APART = 10.0
#: At most so many sources of a fit are put right, one after the other.
_MOST = 4


@dataclass(frozen=True, slots=True, eq=False)
class _Source:
    """A result of the fit as normal equations, and as few readings with a noise of 1 that say the same: `y`
    (r,) of `rows` (r, k) of the unknowns `columns` (k,). `left` is the square of what no unknown explains."""

    state: State
    normal: Normal
    columns: Index
    rows: Array
    y: Array
    left: float

    @staticmethod
    def of(state: State, normal: Normal) -> _Source:
        columns = np.flatnonzero(normal.H.any(axis=0))
        values, vectors = np.linalg.eigh(normal.H[np.ix_(columns, columns)])
        some = values > _NOTHING * max(values.max(initial=0.0), _NOTHING)
        root = np.sqrt(values[some])
        rows = (vectors[:, some] * root).T
        y = normal.g[columns] @ vectors[:, some] / root
        return _Source(state, normal, columns, rows, y, normal.square - float(y @ y))

    @staticmethod
    def read(state: State, fit: Fit) -> _Source:
        normal = Normal.of(fit.parameters.size)
        normal.add(_block(state, fit))
        return _Source.of(state, normal)


@dataclass(frozen=True, slots=True, eq=False)
class _Given:
    """What all other readings and the prior say of the unknowns `columns` (k,) of a source: `mean` (k,), and
    `root` (k, k), a factor of the covariance."""

    columns: Index
    mean: Array
    root: Array

    def told(self, source: _Source) -> tuple[float, Array]:
        """The log probability of the readings of a source, up to a constant, and (k,) the mean with them."""
        away, seen = self._away(source)
        inner = np.eye(len(away)) + seen @ seen.T
        solved = np.linalg.solve(inner, away)
        log = -0.5 * (source.left + float(away @ solved) + float(np.linalg.slogdet(inner)[1]))
        return log, self.mean + self.root @ (solved @ seen)

    def z(self, source: _Source) -> Array:
        """(m,) differences of source and prediction in the directions that it measures."""
        away, seen = self._away(source)
        directions, size, _ = np.linalg.svd(seen, full_matrices=False)
        some = size**2 > _LEAST_SHARE
        return np.asarray((away @ directions)[some] / np.sqrt(1.0 + size[some] ** 2))

    def _away(self, source: _Source) -> tuple[Array, Array]:
        """(r,) readings of a source less their prediction, and (r, k) how the roots act on them."""
        own = np.searchsorted(self.columns, source.columns)
        return source.y - source.rows @ self.mean[own], source.rows @ self.root[own]

    def scaled(self, part: Index, precision: Array, factor: float) -> tuple[_Given, float]:
        """The same where the prior of some unknowns, `part` of `columns`, is of curves `factor` times as
        large, and the log evidence of the others that this adds."""
        if factor == 1.0:
            return self, 0.0
        from scipy.linalg import eigh

        change = factor**-2 - 1.0
        basis, inner = np.linalg.qr(self.root[part].T)
        # the QR iteration: divide and conquer fails on some clusters of ones (OpenBLAS)
        share, vectors = eigh(inner @ precision @ inner.T, driver="ev")
        # no curve is known less than before any reading, but for rounding
        more = np.log1p(change * np.clip(share, 0.0, 1.0))
        directions = basis @ vectors
        root = self.root + (self.root @ directions * np.expm1(-0.5 * more)) @ directions.T
        pull = change * precision @ self.mean[part]
        mean = self.mean - root @ (root[part].T @ pull)
        log = -0.5 * float(more.sum()) - len(part) * math.log(factor) - 0.5 * float(pull @ mean[part])
        return _Given(self.columns, mean, root), log


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """Every source of a fit against all others, in their order. `wrong` are the sources with which something
    is wrong beyond doubt, each compared after those before it were put right. `unlike` are those that
    contradict the others without a cause that is known. At most four are looked for."""

    sources: tuple[Agreement, ...]
    wrong: tuple[Agreement, ...]
    unlike: tuple[Agreement, ...]


def _block(state: State, fit: Fit) -> Block:
    """The readings of a state. Where others read beside targets, ripple at the targets of a line is its own
    alone. Several lines of a component share it, and are compared with each other without."""
    block, shape = fit.block(state), fit.prior.shapes.get(state.component)
    others = any(isinstance(result.state, ScatteredState | AlongState) for result in fit.results)
    alone = sum(result.state.component == state.component for result in fit.results) == 1
    if not isinstance(state, LineState) or shape is None or not (others and alone):
        return block
    ripple = ripple_at_targets(fit.parameters.spaces[state.component].spline, shape.scales)
    line = state.observation
    target = np.abs(line.target_mm[:, None] - targets_of(line)).argmin(axis=1)

    def chunks() -> Iterator[Chunk]:
        for chunk in block.chunks():
            yield replace(chunk, beside=np.full(len(chunk.y), ripple), group=target)

    return replace(block, chunks=chunks)


def compared(fit: Fit, states: Sequence[State] | None = None) -> Compared:
    """Compare each source of a fit, or each of these `states` of it, with all others."""
    states = [result.state for result in fit.results] if states is None else states
    sources = [_Source.read(state, fit) for state in states]
    first = now = _agreements(fit, sources)
    wrong: list[Agreement] = []
    unlike: list[Agreement] = []
    left = set(range(len(sources)))
    while left and len(wrong) + len(unlike) < _MOST:
        index, found = _worst(now, left)
        if index < 0:
            break
        left.discard(index)
        before, worst = now, now[index]
        sources[index] = _changed(fit, sources[index], found)
        now = _agreements(fit, sources)
        if found is None:
            either = [index, *(k for k in sorted(left) if _as_doubtful(before[k], worst))]
        else:
            either = [index, *(k for k in sorted(left) if _instead(before[k], worst, now[k]))]
        left.difference_update(either)
        told = wrong if found is not None else unlike
        told += [replace(before[k], rivals=tuple(before[j].name for j in either if j != k)) for k in either]
    return Compared(first, tuple(wrong), tuple(unlike))


def _worst(now: tuple[Agreement, ...], left: set[int]) -> tuple[int, Tried | None]:
    """The source that contradicts the others most, and what is wrong with it where that is known; -1 where
    none does. A wrong source makes the others look wrong too, so a cause has to explain nearly all."""
    against = [now[k].against if k in left and now[k].contradicts else -np.inf for k in range(len(now))]
    named = {k: found for k in left if (found := now[k].named) is not None}
    most = max(against)

    best = max(named, key=lambda k: now[k].explained, default=-1)
    if best >= 0 and named[best].log_odds > EXPLAINS * most:
        return best, named[best]
    return (int(np.argmax(against)), None) if np.isfinite(most) else (-1, None)


def _instead(one: Agreement, named: Agreement, right: Agreement) -> bool:
    """Whether a source may be the wrong one as well as one that is named. Then nothing is wrong with it any
    more when that is put `right`, and a mistake of it explains the readings nearly as well."""
    if one.named is None or named.named is None or right.named is not None or right.contradicts:
        return False
    return one.explained > named.explained - EXCLUDED


def _as_doubtful(one: Agreement, worst: Agreement) -> bool:
    """Whether a source may be the wrong one as well, as where two contradict each other and nothing else
    tells which."""
    return one.contradicts and one.against > worst.against - EXCLUDED


def _changed(fit: Fit, source: _Source, found: Tried | None) -> _Source:
    """A source put right by what is wrong with it, or left out where that is not known."""
    if found is None:
        return _Source.of(source.state, Normal.of(fit.parameters.size))
    alternatives = source.state.observation.alternatives()
    return _as(fit, next(one for one in alternatives if one.words == found.words))


def _as(fit: Fit, alternative: Alternative) -> _Source:
    state = alternative.observation.start(alternative.observation.screened().noise)
    return _Source.read(state, fit)


def _agreements(fit: Fit, sources: list[_Source]) -> tuple[Agreement, ...]:
    # a curve that is rougher between its targets than was expected contradicts nothing
    priors = [prior.precision()[0] for prior in (fit.prior.rougher(), fit.prior)]
    means = Normal.of(fit.parameters.size)
    fit.prior.push(means)
    heard = sum(source.normal.H for source in sources)
    right = means.g + sum(source.normal.g for source in sources)

    def given(source: _Source, columns: Index) -> list[_Views]:
        rest = heard - source.normal.H, right - source.normal.g
        return [
            _Views(prior, _given(prior + rest[0], rest[1], columns), _given(prior, means.g, columns))
            for prior in priors
        ]

    found = []
    for number, source in enumerate(sources):
        label, component = source.state.label, source.state.component
        if not len(source.columns):
            # it was left out
            found.append(Agreement(label, component, Fitted(label, 0.0, 0.0), (), 0.0, (), number))
            continue
        tries = tuple(_alternatives(fit, source))
        # another component depends on other unknowns; and all of a curve, whatever part of it was read: its
        # scale is that of all
        read = [source.columns, *(other.columns for _, other in tries), _curve(fit, source)]
        views = given(source, np.unique(np.concatenate(read)))
        z = views[0].others.z(source)
        misfit = Fitted(label, float(z @ z), float(len(z)))
        as_read = _heard(views, source, _ALIKE, np.zeros(0, np.int64))
        tried = [_tried(fit, views, one, as_read, _curve(fit, source), misfit) for one in tries]
        tried = sorted([*tried, _of_another(fit, views[-1], as_read)], key=lambda one: -one.log_odds)
        found.append(Agreement(label, component, misfit, tuple(tried), -as_read.support, (), number))
    return _beside_their_kind(found, sources)


def _beside_their_kind(found: Sequence[Agreement], sources: Sequence[_Source]) -> tuple[Agreement, ...]:
    """The same, where readings all over the volume of one kind fit better than noise and ripple have it, with
    the misfit of each in units of theirs."""
    kinds = [type(source.state) if isinstance(source.state, ScatteredState) else None for source in sources]
    beside = []
    for k, one in enumerate(found):
        like = [other.misfit for j, other in enumerate(found) if j != k and kinds[j] is kinds[k] is not None]
        freedom = sum(misfit.freedom for misfit in like)
        usual = sum(misfit.chi_square for misfit in like) / max(freedom, 1.0)
        scaled = Fitted(one.label, one.misfit.chi_square / max(usual, _LEAST_MISFIT), one.misfit.freedom)
        beside.append(replace(one, beside=scaled) if freedom and usual < 1.0 else one)
    return tuple(beside)


def _alternatives(fit: Fit, source: _Source) -> Iterator[tuple[Alternative, _Source]]:
    """What may be wrong with a source, put right; without what cannot be at all."""
    tables = fit.parameters.chain.partition("F")[0]
    for alternative in source.state.observation.alternatives():
        if alternative.on_table not in tables:
            continue
        try:
            yield alternative, _as(fit, alternative)
        except CannotCompute:
            continue


@dataclass(frozen=True, slots=True, eq=False)
class _Views:
    """What all others and the prior, and what the prior alone say of a source, where curves are as rough as
    a prior precision says."""

    prior: Array
    others: _Given
    alone: _Given


@dataclass(frozen=True, slots=True, eq=False)
class _Heard:
    """The log evidence of a source by what the others say of it, less that by the prior alone; and (k,) the
    mean of the unknowns with it."""

    support: float
    mean: Array


def _heard(views: Sequence[_Views], source: _Source, sizes: Sequence[float], part: Index) -> _Heard:
    """The readings of a source by all views, where the curve with the unknowns `part` of theta may be of
    several sizes."""
    logs: tuple[list[float], list[float]] = ([], [])
    means = []
    for view in views:
        place, own = np.searchsorted(view.others.columns, part), view.prior[np.ix_(part, part)]
        for size in sizes:
            for log, here in zip(logs, (view.others, view.alone), strict=True):
                given, more = here.scaled(place, own, size)
                value, mean = given.told(source)
                log.append(value + more)
                if here is view.others:
                    means.append(mean)
    others, alone = (float(np.logaddexp.reduce(log)) for log in logs)
    return _Heard(others - alone, means[int(np.argmax(logs[0]))])


#: The curve is of the size that was learnt.
_ALIKE = (1.0,)


def _sizes(factor: float) -> tuple[float, ...]:
    """By how much a curve is larger than was learnt from values that a factor puts right: by all of it
    where they alone told its size, not at all where other curves did."""
    apart = abs(math.log(abs(factor)))
    if not apart:
        return _ALIKE
    return tuple(np.geomspace(1.0, abs(factor), 2 + int(apart / math.log(_APART))).tolist())


def _tried(
    fit: Fit,
    views: Sequence[_Views],
    alternative: tuple[Alternative, _Source],
    as_read: _Heard,
    curve: Index,
    misfit: Fitted,
) -> Tried:
    """What may be wrong with a source: how much better the others predict it then. What the prior makes of
    its size is taken off. `curve` are the unknowns of the curve that it reads. Where it differs from the
    others as chance has it, another one that they predict too is none that is sought."""
    one, other = alternative
    heard = _heard(views, other, _sizes(one.factor) if len(curve) else _ALIKE, curve)
    change = np.zeros(fit.parameters.size)
    change[views[0].others.columns] = heard.mean - as_read.mean
    log_odds = heard.support - as_read.support
    sought = misfit.failed if one.where_off else misfit.deviations > _DIFFERS
    return Tried(one.kind, one.words, log_odds, heard.support, sought, change)


def _of_another(fit: Fit, view: _Views, as_read: _Heard) -> Tried:
    """That a source says nothing of this machine: the others alone are right. It is listed, and never
    named."""
    change = np.zeros(fit.parameters.size)
    change[view.others.columns] = view.others.mean - as_read.mean
    return Tried("machine", "it is of another machine", -as_read.support, 0.0, sought=False, change=change)


def _curve(fit: Fit, source: _Source) -> Index:
    """The unknowns of the curve that a source measures; none where it measures no curve of its own."""
    name = source.state.component
    if name not in fit.prior.shapes:
        return np.zeros(0, np.int64)
    return np.arange(fit.parameters.size)[fit.parameters.slices[name]]


def _given(precision: Array, right: Array, columns: Index) -> _Given:
    from scipy.linalg import cho_factor, cho_solve

    scale = np.sqrt(np.diag(precision))
    factor = cho_factor(precision / np.outer(scale, scale) + 1e-13 * np.eye(len(scale)), lower=True)
    unit = np.zeros((len(scale), len(columns)))
    unit[columns, np.arange(len(columns))] = 1.0
    covariance = cho_solve(factor, unit)[columns] / np.outer(scale[columns], scale[columns])
    mean = (cho_solve(factor, right / scale) / scale)[columns]
    return _Given(columns, mean, _root(0.5 * (covariance + covariance.T)))


def _root(covariance: Array) -> Array:
    """A factor of a covariance, which may be singular to rounding."""
    variance = np.diag(covariance)
    # below zero by rounding: nothing is left to know of it
    scale = np.sqrt(np.maximum(variance, np.finfo(float).eps * variance.max()))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
