"""Whether each curve of a calibration is stated in the right sense and unit, and at its place: decided by
independent points, or said to be undecided."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from olp.calibration.diagnosis.arrangements import Arrangement, arrangements, scaled
from olp.calibration.diagnosis.factors import (
    Checkpoints,
    Factors,
    Marginal,
    chi_square,
    contributions_of,
    factors_of,
)
from olp.calibration.estimator.parameters import frame_columns
from olp.calibration.observations.points import Points
from olp.core.arrays import Array
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.core.units import AXES
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.errormodel.uncertainty import Uncertainty, fingerprint

#: Prior probability of one arrangement other than stated, and the odds at which one is decided or excluded.
REARRANGED, DECIDED = math.log(0.01), math.log(2000.0)
#: A factor beyond the list is told at this probability.
LIKELY = 0.9995
#: Free fits worse by so much chi-square need no closer look.
HOPELESS = 80.0
#: Chi-square a degree of freedom beyond which nothing here explains the points.
MISFIT = 9.0
#: A residual so many standard deviations long is told as an outlier.
OUTLIER = 5.0

Sign = Literal["right", "flipped", "absent", "undecided"]


@dataclass(frozen=True, slots=True)
class Verdict:
    """Of one curve or squareness. `factor` with `sigma` is what the points say, `applied` the factor that is
    decided (1 where nothing is, and where the curve is absent: whoever lists it as corrected by the control
    keeps it), `unit` "right", "undecided", "no factor explains" or what happened, and
    `effect_mm` the rms of what it does at the points as stated."""

    name: str
    sign: Sign
    unit: str
    factor: float
    sigma: float
    applied: float
    effect_mm: float

    @property
    def z(self) -> float:
        return self.factor / self.sigma


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """All verdicts. `arrangements` are what is decided about whole axes; `doubts` pairs of words that the
    points do not tell apart. `senses` says by axis that carries the workpiece in which sense its curves are
    stated. `corrected` is the calibration with all that is decided put right."""

    calibration: Calibration
    seen: Checkpoints
    verdicts: tuple[Verdict, ...]
    arrangements: tuple[Arrangement, ...]
    doubts: tuple[str, ...]
    senses: Mapping[str, str]
    factors: Factors
    corrected: Calibration
    chain: str
    skip: frozenset[str]
    before_mm: float
    after_mm: float

    @property
    def undecided(self) -> tuple[Verdict, ...]:
        return tuple(v for v in self.verdicts if v.sign == "undecided")

    @property
    def wrong(self) -> tuple[Verdict, ...]:
        """Those that are decided not to be as stated."""
        return tuple(v for v in self.verdicts if v.applied != 1.0 or v.sign == "absent")

    def uncertainty_of(self, stated: Uncertainty) -> Uncertainty | None:
        """What is known of the corrected calibration; None where curves have changed places."""
        if self.arrangements:
            return None
        applied = {verdict.name: verdict.applied for verdict in self.verdicts}
        return dataclasses.replace(
            stated,
            entries=tuple(
                dataclasses.replace(
                    entry,
                    factor=entry.factor * applied.get(entry.name, 1.0),
                    rest=entry.rest * abs(applied.get(entry.name, 1.0)),
                )
                for entry in stated.entries
            ),
            fingerprint=fingerprint(self.corrected),
        )

    @property
    def outliers(self) -> tuple[tuple[int, float], ...]:
        """Row of the file and standard deviations of points that lie far off."""
        length = np.sqrt(((self.factors.residual_mm / self.factors.sigma_mm) ** 2).sum(axis=1) / 3.0)
        found = np.flatnonzero(length > OUTLIER)
        return tuple((int(self.seen.points.row[k]), float(length[k])) for k in found)

    @property
    def explained(self) -> bool:
        """Whether factors explain the points within a small multiple of what was stated."""
        return self.factors.inflation**2 < MISFIT


def diagnose(
    calibration: Calibration,
    chain: str,
    points: Points,
    *,
    frame_known: bool = False,
    skip: frozenset[str] = frozenset(),
    scale: float | None = None,
) -> Diagnosis:
    """Judge every curve and squareness of a calibration by points that had no part in it.

    With `frame_known` points count in the machine's frame. `skip` are errors that the control corrected while
    the points were taken; `scale` is the standard uncertainty of the instrument's scale against the machine's
    (mm/mm), axis by axis. Raises CannotCompute where the points make no frame.
    """
    model = build(calibration, chain, outside="hold", skip_components=skip)
    seen = Checkpoints.of(points, model, frame_known=frame_known, scale=scale)
    search = _Search(calibration, chain, seen, skip)
    chosen, candidates = search.arranged()
    arranged = search.applied(chosen)
    base, found = search.columns(chosen), search.factors(chosen)
    others = [(candidate, search.factors([*chosen, candidate]).marginals) for candidate in candidates]
    verdicts = []
    for name in (*COMPONENTS, *SQUARENESS):
        if name in found.marginals:
            same = [o.get(name) for candidate, o in others if name not in candidate.renames]
            doubted = any(name in candidate.renames for candidate in candidates)
            verdicts.append(_verdict(found.marginals[name], base[name], same, doubted=doubted))
    corrected = scaled(arranged, {v.name: v.applied for v in verdicts})
    stated = contributions_of(
        build(corrected, chain, outside="hold", skip_components=skip), points.axis_mm, points.tool_mm
    )
    return Diagnosis(
        calibration, seen, tuple(verdicts), tuple(chosen), tuple(r.words for r in candidates),
        _senses(verdicts, chain), found, corrected, chain, skip,
        _left(seen, search.columns([])), _left(seen, stated),
    )  # fmt: skip


class _Search:
    """Looks for the arrangement that the points speak for; what one axis adds is computed once a change."""

    def __init__(self, calibration: Calibration, chain: str, seen: Checkpoints, skip: frozenset[str]) -> None:
        self.calibration, self.chain, self.seen, self.skip = calibration, chain, seen, skip
        self.known = list(arrangements(calibration, chain))
        self._of_axis: dict[tuple[str, ...], dict[str, Array]] = {}
        self._chi: dict[frozenset[str], float] = {}
        self._factors: dict[frozenset[str], Factors] = {}
        chi, self.freedom = chi_square(seen, self.columns([]))
        self.inflation = math.sqrt(max(1.0, chi / max(self.freedom, 1.0)))

    def applied(self, changes: Sequence[Arrangement]) -> Calibration:
        calibration = self.calibration
        for change in changes:
            calibration = change.apply(calibration)
        return calibration

    def columns(self, changes: Sequence[Arrangement]) -> dict[str, Array]:
        found: dict[str, Array] = {}
        for axis, letter in enumerate((*AXES, "")):
            key = (letter, *(change.words for change in changes if change.axis == axis))
            if key not in self._of_axis:
                self._of_axis[key] = self._contributions(letter, self.applied(changes))
            found |= self._of_axis[key]
        return found

    def _contributions(self, letter: str, calibration: Calibration) -> dict[str, Array]:
        """Of the curves of one axis; "" stands for squareness and the rest."""
        whole = letter == ""
        part = dataclasses.replace(
            calibration,
            curves=calibration.curves_of(letter) if letter else (),
            cyclic=tuple(c for c in calibration.cyclic if c.component[2] == letter),
            squareness=calibration.squareness if whole else {},
            thermal=calibration.thermal if whole else None,
        )
        model = build(part, self.chain, outside="hold", skip_components=self.skip)
        return contributions_of(model, self.seen.points.axis_mm, self.seen.points.tool_mm)

    def chi(self, changes: Sequence[Arrangement]) -> float:
        key = frozenset(change.words for change in changes)
        if key not in self._chi:
            self._chi[key] = chi_square(self.seen, self.columns(changes))[0]
        return self._chi[key]

    def factors(self, changes: Sequence[Arrangement]) -> Factors:
        key = frozenset(change.words for change in changes)
        if key not in self._factors:
            self._factors[key] = factors_of(self.seen, self.columns(changes), self.inflation)
        return self._factors[key]

    def score(self, changes: Sequence[Arrangement]) -> float:
        """Log odds of an arrangement; hopeless ones are minus infinity."""
        if self.chi(changes) > self.least + HOPELESS * self.inflation**2:
            return -math.inf
        return self.factors(changes).evidence + REARRANGED * len(changes)

    def arranged(self) -> tuple[list[Arrangement], list[Arrangement]]:
        """What is decided, the largest gain first; and what the points do not exclude beside it."""
        chosen: list[Arrangement] = []
        while True:
            rest = [a for a in self.known if a not in chosen]
            self.least = min(self.chi(chosen), *(self.chi([*chosen, a]) for a in rest))
            scatter = math.sqrt(max(1.0, self.least / max(self.freedom, 1.0)))
            if scatter != self.inflation:
                self.inflation = scatter
                self._factors.clear()
            own, scores = self.score(chosen), [self.score([*chosen, a]) for a in rest]
            best = int(np.argmax(scores)) if rest else 0
            if not rest or scores[best] < own + DECIDED:
                break
            chosen = [*chosen, rest[best]]
        # a change holds only where neither its absence nor another one instead explains the points
        doubtful = []
        for change in chosen:
            others = [a for a in chosen if a is not change]
            tries = [others, *([*others, a] for a in rest)]
            if max(map(self.score, tries)) > own - DECIDED:
                doubtful.append(change)
        if doubtful:
            chosen = [a for a in chosen if a not in doubtful]
            own, rest = self.score(chosen), [a for a in self.known if a not in chosen]
            scores = [self.score([*chosen, a]) for a in rest]
        return chosen, [a for a, score in zip(rest, scores, strict=True) if score > own - DECIDED]


def _verdict(found: Marginal, column: Array, others: Sequence[Marginal | None], *, doubted: bool) -> Verdict:
    """`others` are the same under arrangements that are not excluded: they must agree. `doubted`: it may not
    even be this curve."""
    decided, sign = found.candidate, found.sign
    if doubted:
        decided, sign = None, 0
    if any(o is not None and o.sign != sign for o in others):
        sign = 0
    if any(o is not None and o.candidate != decided for o in others):
        decided = None
    words: Sign = "undecided"
    applied, unit = 1.0, "undecided"
    if decided is not None and decided.factor == 0.0:
        words = "absent"
    elif sign:
        words = "right" if sign > 0 else "flipped"
        applied = float(sign)
        if decided is not None:
            applied = decided.factor
            unit = decided.words or "right"
        elif found.odds[-1] > LIKELY:
            unit = "no factor explains"
    return Verdict(
        found.name, words, unit, found.factor, found.sigma, applied, float(np.sqrt(np.mean(column**2)))
    )


def _senses(verdicts: Sequence[Verdict], chain: str) -> dict[str, str]:
    """Of each axis that carries the workpiece: stated as the table moves, or as the tool does against it."""
    found = {}
    for letter in chain[: chain.index("F")]:
        own = [v for v in verdicts if v.name in COMPONENTS and v.name[2] == letter and v.sign != "absent"]
        signs = {v.sign for v in own if v.sign != "undecided"}
        flipped = [v.name for v in own if v.sign == "flipped"]
        turned = any(name[1] in "ABC" for name in flipped) and any(name[1] in AXES for name in flipped)
        if signs == {"flipped"} and len(flipped) > 2 and turned:
            found[letter] = "of the table itself"
        elif "right" in signs:
            found[letter] = "of the tool relative to the workpiece"
        else:
            found[letter] = "undecided"
    return found


def _left(seen: Checkpoints, columns: Mapping[str, Array]) -> float:
    """rms length in mm of what a calibration leaves at the points, in the frame that fits best."""
    rest = seen.deviation_mm - sum(columns.values(), np.zeros(seen.deviation_mm.shape))
    if not seen.frame_known:
        points = seen.points
        table = frame_columns(points.axis_mm + points.tool_mm - seen.centre_mm).reshape(-1, 6)
        flat = rest.reshape(-1)
        rest = (flat - table @ np.linalg.lstsq(table, flat, rcond=None)[0]).reshape(-1, 3)
    return math.sqrt(float((rest**2).sum(axis=1).mean()))
