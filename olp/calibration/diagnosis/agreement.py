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

import numpy as np

from olp.calibration.estimator.fitted import Fit
from olp.calibration.estimator.normal import Normal
from olp.calibration.observations.base import Alternative, State
from olp.core.arrays import Array, Index
from olp.core.errors import CannotCompute
from olp.core.values import dataclass
from olp.errormodel.quality import Fitted

#: Directions count in which a source says at least this share of what all others say.
_LEAST_SHARE = 1e-3
#: Nats by which something is named as wrong with a source: a difference of six standard deviations.
NAMED = 0.5 * 6.0**2
#: Nats by which the others have to confirm what is named: 20 to 1.
_CONFIRMED = math.log(20.0)
#: Such a cause explains at least this share of what a source contradicts, by the evidence.
_EXPLAINS = 0.9
#: Nats by which something is excluded: 100 to 1.
EXCLUDED = math.log(100.0)
#: Where values change by a factor, so does the roughness learnt from them, by these shares of it: that of
#: values below the resolution of readings was learnt larger than it is.
_SHARES = 1.0, 0.1, 0.01
#: At most so many sources of a fit are put right, one after the other.
_MOST = 4


@dataclass(frozen=True, slots=True)
class Tried:
    """Something that may be wrong with a source, its kind and in words, and its log odds (nats) against what
    was read. `support` are its log odds against a source that says nothing: whether the others confirm it.
    What is `sought` may be named; the rest is excluded or not."""

    kind: str
    words: str
    log_odds: float
    support: float
    sought: bool = True

    @property
    def beyond_doubt(self) -> bool:
        """Whether the readings name it."""
        return self.sought and self.log_odds > NAMED and self.support > _CONFIRMED


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """A source against all others: `misfit` is the sum of z^2 over as many directions as freedom, `tried` is
    what may be wrong with it, the most probable first. `against` is the log odds (nats) that it says nothing
    of this machine."""

    label: str
    component: str
    misfit: Fitted
    tried: tuple[Tried, ...]
    against: float

    @property
    def named(self) -> Tried | None:
        """What is wrong with it beyond doubt."""
        return next((tried for tried in self.tried if tried.beyond_doubt), None)

    @property
    def contradicts(self) -> bool:
        """Whether it is better to leave it out than to believe it, whatever is wrong with it."""
        return self.misfit.failed and self.against > NAMED

    @property
    def possible(self) -> tuple[str, ...]:
        """The kinds of what may be wrong with it without notice, as the readings do not exclude it."""
        return tuple(sorted({tried.kind for tried in self.tried if tried.log_odds > -EXCLUDED}))


@dataclass(frozen=True, slots=True, eq=False)
class _Source:
    """A result of the fit as normal equations."""

    state: State
    normal: Normal

    @staticmethod
    def of(state: State, fit: Fit) -> _Source:
        normal = Normal.of(fit.parameters.size)
        normal.add(fit.block(state))
        return _Source(state, normal)


@dataclass(frozen=True, slots=True, eq=False)
class _Given:
    """What all other readings and the prior say of the unknowns `columns` (k,) of a source: `mean` (k,) and
    `covariance` (k, k)."""

    columns: Index
    mean: Array
    covariance: Array

    def log_evidence(self, source: _Source) -> float:
        """The log probability of the readings of a source, up to a constant."""
        H, g = self._of(source)
        away = g - H @ self.mean
        root = _root(self.covariance)
        inner = np.eye(len(g)) + root.T @ H @ root
        solved = np.linalg.solve(inner, root.T @ away)
        square = source.normal.square - 2.0 * self.mean @ g + self.mean @ H @ self.mean
        explained = float((root.T @ away) @ solved)
        return -0.5 * (float(square) - explained + float(np.linalg.slogdet(inner)[1]))

    def z(self, source: _Source) -> Array:
        """(m,) differences of source and prediction in the directions that it measures."""
        H, g = self._of(source)
        root = _root(self.covariance)
        share, directions = np.linalg.eigh(root.T @ H @ root)
        away = directions.T @ (root.T @ (g - H @ self.mean))
        some = share > _LEAST_SHARE
        return np.asarray(away[some] / np.sqrt(share[some] * (1.0 + share[some])))

    def scaled(self, part: Index, precision: Array, factor: float) -> tuple[_Given, float]:
        """The same where the prior of some unknowns, `part` of `columns`, is of curves `factor` times as
        large, and the log evidence of the others that this adds."""
        change = np.zeros_like(self.covariance)
        change[np.ix_(part, part)] = (factor**-2 - 1.0) * precision
        inverse = np.linalg.inv(self.covariance)
        eta = inverse @ self.mean
        covariance = np.linalg.inv(inverse + change)
        covariance = 0.5 * (covariance + covariance.T)
        mean = covariance @ eta
        more = 0.5 * (np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(self.covariance)[1])
        more += 0.5 * float(eta @ mean - eta @ self.mean) - len(part) * math.log(abs(factor))
        return _Given(self.columns, mean, covariance), float(more)

    def _of(self, source: _Source) -> tuple[Array, Array]:
        return source.normal.H[np.ix_(self.columns, self.columns)], source.normal.g[self.columns]


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """Every source of a fit against all others, in their order. `wrong` are the sources with which something
    is wrong beyond doubt, each compared after those before it were put right. `unlike` are those that
    contradict the others without a cause that is known. At most four are looked for."""

    sources: tuple[Agreement, ...]
    wrong: tuple[Agreement, ...]
    unlike: tuple[Agreement, ...]


def compared(fit: Fit, states: Sequence[State] | None = None) -> Compared:
    """Compare each source of a fit, or each of these `states` of it, with all others."""
    states = [result.state for result in fit.results] if states is None else states
    sources = [_Source.of(state, fit) for state in states]
    first = now = _agreements(fit, sources)
    wrong: list[Agreement] = []
    unlike: list[Agreement] = []
    left = set(range(len(sources)))
    while left and len(wrong) + len(unlike) < _MOST:
        index, found = _worst(now, left)
        if index < 0:
            break
        left.discard(index)
        if found is None:
            unlike.append(now[index])
            sources[index] = _Source(sources[index].state, Normal.of(fit.parameters.size))
        else:
            wrong.append(now[index])
            sources[index] = _put_right(fit, sources[index], found.words)
        now = _agreements(fit, sources)
    return Compared(first, tuple(wrong), tuple(unlike))


def _worst(now: tuple[Agreement, ...], left: set[int]) -> tuple[int, Tried | None]:
    """The source that contradicts the others most, and what is wrong with it where that is known; -1 where
    none does. A wrong source makes the others look wrong too, so a cause has to explain nearly all."""
    against = [now[k].against if k in left and now[k].contradicts else -np.inf for k in range(len(now))]
    named = {k: found for k in left if (found := now[k].named) is not None}
    most = max(against)
    best = max(named, key=lambda k: named[k].log_odds, default=-1)
    if best >= 0 and named[best].log_odds > _EXPLAINS * most:
        return best, named[best]
    return (int(np.argmax(against)), None) if np.isfinite(most) else (-1, None)


def _put_right(fit: Fit, source: _Source, words: str) -> _Source:
    alternatives = source.state.observation.alternatives()
    return _as(fit, next(one for one in alternatives if one.words == words))


def _as(fit: Fit, alternative: Alternative) -> _Source:
    state = alternative.observation.start(alternative.observation.screened().noise)
    return _Source.of(state, fit)


def _agreements(fit: Fit, sources: list[_Source]) -> tuple[Agreement, ...]:
    # a curve that is rougher between its targets than was expected contradicts nothing
    prior, _ = fit.prior.rougher().precision()
    means = Normal.of(fit.parameters.size)
    fit.prior.push(means)
    total = prior + sum(source.normal.H for source in sources)
    right = means.g + sum(source.normal.g for source in sources)
    found = []
    for source in sources:
        columns = np.flatnonzero(source.normal.H.any(axis=0))
        if not len(columns):
            # it was left out
            label = source.state.label
            found.append(Agreement(label, source.state.component, Fitted(label, 0.0, 0.0), (), 0.0))
            continue
        # all of a curve, whatever part of it was read: its scale is that of all
        columns = np.union1d(columns, _curve(fit, source))
        rest = total - source.normal.H, right - source.normal.g
        both = _given(*rest, columns), _given(prior, means.g, columns)
        z = both[0].z(source)
        misfit = Fitted(source.state.label, float(z @ z), float(len(z)))
        as_read = both[0].log_evidence(source) - both[1].log_evidence(source)
        off = misfit.failed and -as_read > NAMED
        tries = tuple(_alternatives(fit, source))
        # another component depends on other unknowns
        wider = np.union1d(columns, np.flatnonzero(sum(other.normal.H.any(axis=0) for _, other in tries)))
        if len(wider) > len(columns):
            both = _given(*rest, wider), _given(prior, means.g, wider)
        tried = sorted(
            (_tried(fit, prior, both, source, one, as_read, off=off) for one in tries),
            key=lambda one: -one.log_odds,
        )
        label, component = source.state.label, source.state.component
        found.append(Agreement(label, component, misfit, tuple(tried), -as_read))
    return tuple(found)


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


def _tried(
    fit: Fit,
    prior: Array,
    both: tuple[_Given, _Given],
    source: _Source,
    alternative: tuple[Alternative, _Source],
    as_read: float,
    *,
    off: bool,
) -> Tried:
    """What may be wrong with a source, `off` or not: how much better the others predict it then. `both` are
    what they and the prior alone say; what the prior makes of its size is taken off."""
    one, other = alternative
    columns = _curve(fit, source)
    values = []
    for here in both:
        if abs(one.factor) == 1.0 or not len(columns):
            values.append(here.log_evidence(other))
            continue
        # the roughness of a curve was learnt from these readings, and is of another size then
        part, own = np.searchsorted(here.columns, columns), prior[np.ix_(columns, columns)]
        shares = _SHARES if off else _SHARES[:1]
        sizes = [share * one.factor for share in shares if share == 1.0 or share * abs(one.factor) > 1.0]
        scaled = [here.scaled(part, own, size) for size in sizes]
        each = np.array([given.log_evidence(other) + more for given, more in scaled])
        values.append(float(each.max() + np.log(np.mean(np.exp(each - each.max())))))
    support = values[0] - values[1]
    return Tried(one.kind, one.words, support - as_read, support, off or not one.where_off)


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
    return _Given(columns, mean, 0.5 * (covariance + covariance.T))


def _root(covariance: Array) -> Array:
    """A factor of a covariance, which may be singular to rounding."""
    variance = np.diag(covariance)
    # below zero by rounding: nothing is left to know of it
    scale = np.sqrt(np.maximum(variance, np.finfo(float).eps * variance.max()))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
