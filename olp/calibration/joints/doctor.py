"""Whether a calibration of any joints is right: its numbers and new readings against each other.

Each number may be right, of the other sign, absent or in another unit; so may those of an axis, or all. Each
reading may be wrong as in `mistakes`. What is said has odds of 2000 to 1 against the calibration as stated.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from olp.calibration.diagnosis.factors import ARCSEC
from olp.calibration.estimator.normal import Normal
from olp.calibration.joints.adjustment import adjusted, block_of, starts_of
from olp.calibration.joints.candidates import Unknown
from olp.calibration.joints.deciding import AGREES, DECIDED, UNLIKELY, log_odds
from olp.calibration.joints.findings import without_worst
from olp.calibration.joints.mistakes import RIGHT, mistakes, row_mistakes, shown
from olp.calibration.joints.readings import Reading
from olp.calibration.joints.refinement import spare_of
from olp.calibration.joints.unknowns import Model
from olp.core.arrays import Array
from olp.core.errors import CannotCompute, ConfigError
from olp.core.values import dataclass

#: At most so many mistakes of numbers are put right.
_MOST = 6
#: Reduced chi-square of readings that a mistake explains.
_EXPLAINED = 4.0
#: Steps within which frames settle on readings that are not those of the machine, too.
_PATIENT = 100

#: Units in each other's place: the factor that numbers need, in words, and whether of angles alone.
_UNITS = (
    (1e3, "mm or mrad stated as um or urad", False),
    (1e-3, "um or urad stated as mm or mrad", False),
    (ARCSEC, "arcsec stated as urad", True),
    (1.0 / ARCSEC, "urad stated as arcsec", True),
)

Sign = Literal["right", "flipped", "absent", "another unit", "undecided"]


@dataclass(frozen=True, slots=True)
class Mistake:
    """A mistake of numbers: what it is, the unknowns that it is of, and the factor that they need."""

    words: str
    sign: Sign
    rows: tuple[int, ...]
    factor: float


@dataclass(frozen=True, slots=True)
class Number:
    """A number of a calibration by new readings: what is stated, in mm or rad, and the factor that it needs
    with its standard deviation, infinite where they say nothing."""

    unknown: Unknown
    stated: float
    factor: float
    sigma: float
    sign: Sign


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """What is wrong. `mistakes` of numbers are decided; `of_readings` is what is wrong with the readings
    instead, `single` where it is single rows that nothing explains, and `doubts` what explains them as well.
    `before` and `after` are reduced chi-square as stated and with all of it put right, `shown` that with the
    values that the control showed, None where none were noted. `odds` is the log of the odds of what was
    decided. `before` and `odds` are infinite where the readings settle nowhere as stated. `numbers` are
    judged with the readings put right. `other` names the numbers that another machine, or a changed one,
    would have, with their standard deviations off. `factors` (k,) are those of all `unknowns`, 1 where
    nothing is decided."""

    numbers: tuple[Number, ...]
    mistakes: tuple[Mistake, ...]
    of_readings: str
    single: bool
    doubts: tuple[str, ...]
    before: float
    after: float
    odds: float
    other: tuple[tuple[str, float], ...]
    factors: Array
    unknowns: tuple[Unknown, ...]
    shown: float | None = None


def diagnose_joints(model: Model, stated: Array, readings: Sequence[Reading], usual: Model) -> Diagnosis:
    """Judge a calibration, the base of a model whose `known` says how far it may be off. `stated` (k,) are
    its numbers in mm and rad. `usual` is the model of any machine of this structure. Raises ConfigError, and
    CannotCompute where the readings settle neither as stated nor with a mistake put right."""
    search = _Search(model, stated, readings)
    first, chosen = search.score, list[Mistake]()
    if math.isfinite(first):
        chosen = search.decided()
        if search.reduced > max(_EXPLAINED, RIGHT * first / search.spare):
            # better than as stated, but it explains nothing
            search, chosen = _Search(model, stated, readings), []
    told, doubts = None, list[str]()
    if search.reduced > AGREES:
        found = _of_readings(model, readings, first)
        if found is not None:
            scatter = max(1.0, min(found.reduced, search.reduced))
            gain = 0.5 * (search.score - found.score) / scatter + UNLIKELY * (1 - len(chosen))
            if gain > DECIDED:
                told, chosen, search = found, [], _Search(model, stated, found.readings)
            elif gain > -DECIDED:
                doubts.append(found.words)
    if not math.isfinite(search.score):
        # the reason, in the words of what could not be computed
        _about(model, readings)
    after = search.reduced
    count = len(chosen) + (told is not None)
    odds = log_odds(first, search.score, after, count) if count else 0.0
    return Diagnosis(
        tuple(search.numbers(chosen, max(1.0, after))),
        tuple(chosen),
        told.words if told else "",
        told.single if told else False,
        tuple(doubts),
        first / search.spare,
        after,
        odds,
        () if told or after <= _EXPLAINED else _of_another(usual, model, readings),
        search.factors,
        model.unknowns,
        _with_shown(model, readings),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Mended:
    """What is wrong with readings, these put right, and how well they agree with the calibration then:
    `score` is chi-square, of `spare` numbers. `single` where it is single rows that nothing explains, which
    are left out."""

    words: str
    readings: list[Reading]
    score: float
    spare: int
    single: bool = False

    @property
    def reduced(self) -> float:
        return self.score / self.spare


def _of_readings(model: Model, readings: Sequence[Reading], first: float) -> _Mended | None:
    """The mistake of the readings with which they agree best with the calibration; none where nothing
    explains them. `first` is chi-square as stated."""
    found = list[_Mended]()
    for words, mended, share in mistakes(model.structure, readings):
        score, spare = _score(model, mended)
        if math.isfinite(score) and score < max(_EXPLAINED * spare, share * first):
            found.append(_Mended(words, mended, score, spare))
    best = min(found, key=lambda one: one.reduced, default=None)
    if math.isinf(first):
        return best
    frames = replace(model, unknowns=(), known=None)
    try:
        below = max(AGREES, RIGHT * first / spare_of(starts_of(model, readings)))
        rows = without_worst(frames, readings, below)
    except CannotCompute:
        return best
    if rows is None:
        return best
    left = [source.start.reading for source in rows.sources]
    score, spare = _score(model, left)
    if (best is not None and best.reduced <= score / spare) or score > max(_EXPLAINED * spare, RIGHT * first):
        return best
    named = ", ".join(words for words, _ in row_mistakes(rows, readings))
    lines = ", ".join(str(one.row) for one in sorted(rows.left_out, key=lambda one: one.row))
    words = named or f"single readings do not belong to their postures: lines {lines}"
    return _Mended(words, left, score, spare, not named)


def _with_shown(model: Model, readings: Sequence[Reading]) -> float | None:
    """Reduced chi-square with the values that the control showed; None where none were noted, or where the
    readings do not settle with them."""
    if all(one.read_back is None for one in readings):
        return None
    score, spare = _score(model, shown(readings))
    return score / spare if math.isfinite(score) else None


def _of_another(usual: Model, model: Model, readings: Sequence[Reading]) -> tuple[tuple[str, float], ...]:
    """The numbers that differ most, by standard deviations of what is known of them, where a machine with
    other numbers explains the readings; none where no machine of this structure does."""
    try:
        fit = adjusted(usual, starts_of(usual, readings))
    except CannotCompute:
        return ()
    if fit.chi_square / fit.freedom > _EXPLAINED:
        return ()
    sigma = np.sqrt(np.diag(np.asarray(model.known)))
    names = [unknown.name for unknown in model.unknowns]
    off = {
        unknown.name: abs(float(change)) / float(np.hypot(sigma[names.index(unknown.name)], own))
        for unknown, change, own in zip(usual.unknowns, fit.theta, fit.sigma, strict=True)
    }
    return tuple(sorted(off.items(), key=lambda one: -one[1]))


def _about(model: Model, readings: Sequence[Reading]) -> tuple[Normal, int]:
    """The readings about the base of a model, whose unknowns change little, with frames and centres of
    instruments found; and how many numbers were read beyond these. Raises CannotCompute where they do not
    settle."""
    starts = starts_of(model, readings)
    found = adjusted(replace(model, unknowns=(), known=None), starts, _PATIENT)
    normal, zero = Normal.of(len(model.unknowns)), np.zeros(len(model.unknowns))
    for source in found.sources:
        normal.add(block_of(model, zero, source.start, source.own))
    return normal, spare_of(starts)


def _score(model: Model, readings: Sequence[Reading]) -> tuple[float, int]:
    """Chi-square of readings and changes of numbers together, infinite where the readings do not settle; and
    how many numbers were read beyond frames and centres."""
    try:
        normal, spare = _about(model, readings)
    except (CannotCompute, ConfigError):
        return math.inf, 1
    return normal.square - float(normal.g @ np.linalg.solve(normal.H + model.precision, normal.g)), spare


class _Search:
    """The factors of numbers that explain readings, found one after the other."""

    def __init__(self, model: Model, stated: Array, readings: Sequence[Reading]) -> None:
        self.model, self.stated, self.readings = model, stated, readings
        self.factors = np.ones(len(stated))
        self._look()

    def _look(self) -> None:
        """The readings about the calibration with the factors so far: exactly."""
        theta = (self.factors - 1.0) * self.stated
        now = replace(self.model, base=self.model.errors(theta))
        self.score, self.spare = math.inf, 1
        self.G, self.q = np.zeros((len(theta), len(theta))), np.zeros(len(theta))
        try:
            normal, self.spare = _about(now, self.readings)
        except CannotCompute:
            return
        H, g = normal.H, normal.g
        seen = np.linalg.solve(H + now.precision, np.column_stack((H, g)))
        self.score = normal.square - float(g @ seen[:, -1])
        # what the readings say of numbers beyond what is known of them
        self.G = H - H @ seen[:, :-1]
        self.q = g - H @ seen[:, -1]

    @property
    def reduced(self) -> float:
        return self.score / self.spare

    def gain(self, mistake: Mistake) -> float:
        """By how much the score falls, linear about the present numbers."""
        shift = np.zeros(len(self.stated))
        rows = list(mistake.rows)
        shift[rows] = (mistake.factor - self.factors[rows]) * self.stated[rows]
        return float(2.0 * shift @ self.q - shift @ self.G @ shift)

    def decided(self) -> list[Mistake]:
        """All mistakes that are decided."""
        chosen = list[Mistake]()
        while len(chosen) < _MOST:
            known = [one for one in self._mistakes() if all(self.factors[k] == 1.0 for k in one.rows)]
            if not known:
                break
            best = max(known, key=lambda one: (self.gain(one), -len(one.rows)))
            before, factors = self.score, self.factors.copy()
            self.factors[list(best.rows)] = best.factor
            self._look()
            if log_odds(before, self.score, self.reduced) < DECIDED:
                self.factors = factors
                self._look()
                break
            chosen.append(best)
        return chosen

    def _mistakes(self) -> Iterator[Mistake]:
        """Of each number, of those of each axis or leg, and of all."""
        unknowns = self.model.unknowns
        rows = [k for k, value in enumerate(self.stated) if value]
        groups = {unknowns[k].name: [k] for k in rows}
        for part in dict.fromkeys(unknowns[k].part for k in rows):
            groups[f"all numbers of {part}"] = [k for k in rows if unknowns[k].part == part]
        groups["all numbers"] = rows
        for words, group in groups.items():
            if len(group) > 1 or words in (unknowns[k].name for k in group):
                yield Mistake(f"{words}: the other sign", "flipped", tuple(group), -1.0)
                yield Mistake(f"{words}: not on the machine", "absent", tuple(group), 0.0)
            for factor, what, angles in _UNITS:
                turned = tuple(k for k in group if not angles or "urad" in unknowns[k].key)
                if turned:
                    yield Mistake(f"{words}: {what}", "another unit", turned, factor)

    def numbers(self, chosen: Sequence[Mistake], scatter: float) -> Iterator[Number]:
        """Each number that is stated, with what the readings say of it."""
        for k, (unknown, stated) in enumerate(zip(self.model.unknowns, self.stated, strict=True)):
            if not stated:
                continue
            slope = self.G[k, k]
            sigma = math.sqrt(scatter / slope) / abs(stated) if slope > 0.0 else math.inf
            factor = float(self.factors[k] + (self.q[k] / (slope * stated) if slope > 0.0 else 0.0))
            mine = [one.sign for one in chosen if k in one.rows]
            flip = Mistake("", "flipped", (k,), -float(self.factors[k]))
            sure = -0.5 * self.gain(flip) / scatter > DECIDED
            sign: Sign = mine[0] if mine else "right" if sure else "undecided"
            yield Number(unknown, float(stated), factor, sigma, sign)
