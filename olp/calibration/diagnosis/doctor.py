"""Whether each curve of a calibration has the right sign, unit and arrangement: decided by independent
points, or undecided."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Literal

import numpy as np

from olp.calibration.diagnosis.arrangements import Arrangement, arrangements, scaled
from olp.calibration.diagnosis.factors import (
    CHANGE,
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
from olp.core.values import dataclass
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.errormodel.uncertainty import Uncertainty, fingerprint

#: Log of the prior probability of one arrangement other than stated.
REARRANGED = math.log(0.01)
#: Log of the odds at which an arrangement is decided or excluded.
DECIDED = math.log(2000.0)
#: A factor beyond the list is reported from this probability on.
LIKELY = 0.9995
#: Arrangements whose free fit is worse by so much chi-square are not examined further.
HOPELESS = 80.0
#: Reduced chi-square above which no factor explains the points.
MISFIT = 9.0
#: A factor so many standard deviations from the estimate is excluded.
EXCLUDED = 5.0
#: A residual so many standard deviations long is reported as an outlier.
OUTLIER = 5.0

Sign = Literal["right", "flipped", "absent", "undecided"]
#: The factor of each sign in the unit that is stated.
_FACTORS: Mapping[Sign, float] = MappingProxyType({"right": 1.0, "flipped": -1.0, "absent": 0.0})


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict on one curve or squareness. `factor` with `sigma` is the estimate from the points.
    `applied` is the decided factor: 1 where nothing is decided, and where the curve is absent, as the control
    may correct it. `unit` is "right", "undecided", "no factor explains" or the mistake that was found.
    `effect_mm` is the rms of its effect at the points as stated. `excluded` are those of "right", "flipped"
    and "absent" that the points exclude, also where nothing is decided."""

    name: str
    sign: Sign
    unit: str
    factor: float
    sigma: float
    applied: float
    effect_mm: float
    excluded: tuple[Sign, ...] = ()

    @property
    def z(self) -> float:
        return self.factor / self.sigma


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """All verdicts. `arrangements` are those decided for whole axes; `doubts` names others that the points
    do not exclude. `senses` gives the sign convention of the curves of each axis that carries the workpiece.
    `corrected` is the calibration with all that is decided applied."""

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
    def not_as_stated(self) -> tuple[Verdict, ...]:
        """Those of which no mistake is decided, but that cannot be right."""
        return tuple(v for v in self.undecided if "right" in v.excluded)

    @property
    def wrong(self) -> tuple[Verdict, ...]:
        """Those that are decided not to be as stated."""
        return tuple(v for v in self.verdicts if v.applied != 1.0 or v.sign == "absent")

    def uncertainty_of(self, stated: Uncertainty) -> Uncertainty | None:
        """The uncertainty of the corrected calibration; None where curves were rearranged."""
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
        rows = np.flatnonzero(length > OUTLIER)
        return tuple((int(self.seen.points.row[k]), float(length[k])) for k in rows)

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
    """Judge every curve and squareness of a calibration by points that it was not fitted to.

    With `frame_known` points are in the machine's frame. `skip` are errors that the control corrected while
    the points were taken; `scale` is the standard uncertainty of the instrument's scale against the machine's
    (mm/mm), axis by axis. Raises CannotCompute where the points determine no frame.
    """
    model = build(calibration, chain, outside="hold", skip_components=skip)
    seen = Checkpoints.of(points, model, frame_known=frame_known, scale=scale)
    search = _Search(calibration, chain, seen, skip)
    chosen, candidates = search.arranged()
    arranged = search.applied(chosen)
    base, factors = search.columns(chosen), search.factors(chosen)
    others = [(candidate, search.factors([*chosen, candidate]).marginals) for candidate in candidates]
    verdicts = []
    for name in (*COMPONENTS, *SQUARENESS):
        if name in factors.marginals:
            same = [o.get(name) for candidate, o in others if name not in candidate.renames]
            doubted = any(name in candidate.renames for candidate in candidates)
            verdicts.append(_verdict(factors.marginals[name], base[name], same, doubted=doubted))
    corrected = scaled(arranged, {v.name: v.applied for v in verdicts})
    stated = contributions_of(
        build(corrected, chain, outside="hold", skip_components=skip), points.axis_mm, points.tool_mm
    )
    return Diagnosis(
        calibration, seen, tuple(verdicts), tuple(chosen), tuple(r.words for r in candidates),
        _senses(verdicts, chain), factors, corrected, chain, skip,
        _residual_rms(seen, search.columns([])), _residual_rms(seen, stated),
    )  # fmt: skip


class _Search:
    """Searches the arrangement that explains the points; computes each axis once per change."""

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
        columns: dict[str, Array] = {}
        for axis, letter in enumerate((*AXES, "")):
            key = (letter, *(change.words for change in changes if change.axis == axis))
            if key not in self._of_axis:
                self._of_axis[key] = self._contributions(letter, self.applied(changes))
            columns |= self._of_axis[key]
        return columns

    def _contributions(self, letter: str, calibration: Calibration) -> dict[str, Array]:
        """Contributions of the curves of one axis; "" means squareness and the rest."""
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


def _verdict(
    marginal: Marginal, column: Array, others: Sequence[Marginal | None], *, doubted: bool
) -> Verdict:
    """`others` are the same under arrangements that are not excluded: they must agree. `doubted`: it may not
    even be this curve."""
    decided, sign = marginal.candidate, marginal.sign
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
        elif marginal.odds[-1] > LIKELY:
            unit = "no factor explains"
    return Verdict(
        marginal.name,
        words,
        unit,
        marginal.factor,
        marginal.sigma,
        applied,
        float(np.sqrt(np.mean(column**2))),
        () if doubted else _excluded([marginal, *(o for o in others if o is not None)]),
    )


def _excluded(marginals: Sequence[Marginal]) -> tuple[Sign, ...]:
    """The signs that every arrangement which is not excluded puts far off the estimate; a curve that is as
    stated may have changed by a share of itself since."""
    return tuple(
        sign
        for sign, factor in _FACTORS.items()
        if all(abs(m.factor - factor) > EXCLUDED * math.hypot(m.sigma, CHANGE * factor) for m in marginals)
    )


def _senses(verdicts: Sequence[Verdict], chain: str) -> dict[str, str]:
    """The sign convention of each axis that carries the workpiece: of the table or of the tool."""
    conventions = {}
    for letter in chain[: chain.index("F")]:
        own = [v for v in verdicts if v.name in COMPONENTS and v.name[2] == letter and v.sign != "absent"]
        signs = {v.sign for v in own if v.sign != "undecided"}
        flipped = [v.name for v in own if v.sign == "flipped"]
        turned = any(name[1] in "ABC" for name in flipped) and any(name[1] in AXES for name in flipped)
        if signs == {"flipped"} and len(flipped) > 2 and turned:
            conventions[letter] = "of the table itself"
        elif "right" in signs:
            conventions[letter] = "of the tool relative to the workpiece"
        else:
            conventions[letter] = "undecided"
    return conventions


def _residual_rms(seen: Checkpoints, columns: Mapping[str, Array]) -> float:
    """rms length in mm of the residual of a calibration at the points, in the frame that fits best."""
    rest = seen.deviation_mm - sum(columns.values(), np.zeros(seen.deviation_mm.shape))
    if not seen.frame_known:
        points = seen.points
        table = frame_columns(points.axis_mm + points.tool_mm - seen.centre_mm).reshape(-1, 6)
        flat = rest.reshape(-1)
        rest = (flat - table @ np.linalg.lstsq(table, flat, rcond=None)[0]).reshape(-1, 3)
    return math.sqrt(float((rest**2).sum(axis=1).mean()))
