"""What to know about a calibration of a machine of any joints, and what may be wrong with its readings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import PurePath

import numpy as np

from olp.calibration.joints.adjustment import (
    OUTLIER,
    JointFit,
    LeftOut,
    adjusted,
    block_of,
    fit_joints,
    starts_of,
)
from olp.calibration.joints.deciding import AGREES, DECIDED, log_odds, odds_in_words
from olp.calibration.joints.hidden import hidden
from olp.calibration.joints.mistakes import RIGHT, Mended, closer, mistakes, row_mistakes
from olp.calibration.joints.payloads import unstated_payloads
from olp.calibration.joints.readings import Reading, Start
from olp.calibration.joints.tools import other_tools
from olp.calibration.joints.unknowns import Model
from olp.calibration.joints.ways import by_way
from olp.core.arrays import Array
from olp.core.errors import CannotCompute, ConfigError
from olp.core.units import UM_PER_MM
from olp.core.values import dataclass
from olp.findings.catalogue import Finding

#: Reduced chi-square above which the readings are not those of the machine.
ABSURD = 1e3
#: Chi-square is more than so many standard deviations above its expectation.
_MISFIT = 5.0
#: Above so many a mistake is looked for; it is named where its odds decide.
_SUSPECT = 2.0
#: An unknown whose uncertainty is above this share of its prior is held by the prior.
_HELD = 0.5
#: Reduced chi-square of readings that may be those of the machine.
_PLAUSIBLE = 25.0
#: Readings put right are not farther from the machine before them than this, as a factor of chi-square.
_WORSE = 2.0
#: Nor than this factor of what errors as usual make of it.
_UNUSUAL = 10.0
#: Readings put right settle within so many steps.
_QUICK = 7
#: At most so many names are listed.
_NAMED = 8
#: Smaller harm of a mistake is not listed, mm.
_LEAST_MM = 1e-4
#: Reduced chi-square of readings that agree better than they can.
_QUIET = 0.1
#: Errors of a machine with other dimensions are so many times as large as usual.
_WIDE = 30.0
#: At least one of its numbers is so many times its usual size.
_FAR = 5.0
#: So many of its numbers are named.
_FEW = 3
#: So many readings are left out in search of wrong ones, or a twentieth where that is more.
_ROWS = 4


def joint_findings(fit: JointFit, readings: Sequence[Reading]) -> tuple[Finding, ...]:
    """What to know about a fit."""
    return tuple(_findings(fit, readings))


def fit_or_refuse(model: Model, readings: Sequence[Reading]) -> JointFit:
    """The fit of readings that are those of the machine. Raises ConfigError where they are not, with the one
    mistake that explains it, and as `fit_joints`."""
    try:
        fit = fit_joints(model, readings)
    except CannotCompute as error:
        cause = _cause(model, readings, None)
        if cause is None:
            raise
        raise ConfigError(f"these readings are not those of this machine: {cause}") from error
    reduced = fit.chi_square / fit.freedom
    if reduced <= ABSURD:
        return fit
    cause = _cause(model, readings, fit)
    raise ConfigError(
        f"these readings are not those of this machine: reduced chi-square is {reduced:.3g}; expected about "
        f"1. {cause or 'Check units, signs, directions of axes and tool vectors'}"
    )


def left_out_findings(fit: JointFit, code: str) -> Iterator[Finding]:
    """The readings of each file that a fit did not use, with their lines."""
    for source in dict.fromkeys(out.source for out in fit.left_out):
        rows = [out for out in fit.left_out if out.source == source]
        lines = ", ".join(str(out.row) for out in rows[:_NAMED])
        worst = max(out.deviations for out in rows)
        yield Finding(
            code,
            f"{PurePath(source).name}: {len(rows)} readings left out (lines {lines}), up to {worst:.0f} "
            "standard deviations off",
        )


def _findings(fit: JointFit, readings: Sequence[Reading]) -> Iterator[Finding]:
    yield from left_out_findings(fit, "OLP802")
    for words, odds in row_mistakes(fit, readings) if fit.left_out else ():
        yield Finding("OLP810", f"{words} ({odds_in_words(odds)})")
    reduced = fit.chi_square / fit.freedom
    misfit = reduced > 1.0 + _MISFIT * np.sqrt(2.0 / fit.freedom)
    if misfit:
        yield Finding(
            "OLP808",
            f"reduced chi-square is {reduced:.3g}; expected about 1: the stated uncertainty covers this by a "
            f"factor of {np.sqrt(reduced):.3g}",
        )
    noisy = reduced > 1.0 + _SUSPECT * np.sqrt(2.0 / fit.freedom)
    suspect = noisy or reduced < _QUIET or _strained(fit)
    cause = _cause(fit.model, readings, fit) if suspect else None
    if cause is not None:
        yield Finding("OLP810", str(cause))
    else:
        yield from _hidden_findings(fit)
    held = [
        (unknown.name, sigma / unknown.prior)
        for unknown, sigma in zip(fit.model.unknowns, fit.sigma.tolist(), strict=True)
        if sigma > _HELD * unknown.prior
    ]
    if held or fit.determined < len(fit.model.unknowns):
        names = ", ".join(name for name, _ in sorted(held, key=lambda one: -one[1])[:_NAMED])
        more = f" and {len(held) - _NAMED} more" if len(held) > _NAMED else ""
        yield Finding(
            "OLP844",
            f"the readings determine {fit.determined} of {len(fit.model.unknowns)} unknowns; held by what is "
            f"usual: {names or 'combinations of them'}{more}",
        )


def _hidden_findings(fit: JointFit) -> Iterator[Finding]:
    """The mistake that explains readings better though they fit well, or those that nothing excludes."""
    found = hidden(fit)
    best = max(found, key=lambda one: one.odds, default=None)
    if best is not None and best.odds > DECIDED:
        before, after = fit.chi_square / fit.freedom, best.fit.chi_square / best.fit.freedom
        yield Finding("OLP810", str(_Cause(best.words, before, after, best.odds)))
        return
    harms = [(one.harm_mm, one.words) for one in found if one.harm_mm > _LEAST_MM]
    if harms:
        words = [f"{words} ({UM_PER_MM * harm:.3g} um)" for harm, words in sorted(harms, reverse=True)]
        more = f" and {len(words) - _NAMED} more" if len(words) > _NAMED else ""
        yield Finding("OLP812", f"{'; '.join(words[:_NAMED])}{more}")


@dataclass(frozen=True, slots=True)
class _Cause:
    """A mistake that explains readings: reduced chi-square as they are (infinite where they do not settle)
    and with it put right, and the log of its odds."""

    words: str
    before: float
    after: float
    odds: float

    def __str__(self) -> str:
        then = f"reduced chi-square {self.after:.3g}"
        then += f" instead of {self.before:.3g}" if np.isfinite(self.before) else ""
        return f"{self.words} ({odds_in_words(self.odds)}: {then})"


def _strained(fit: JointFit) -> bool:
    """Whether the unknowns are farther from what is usual than machines are."""
    count = len(fit.theta)
    return fit.score - fit.chi_square > count + _MISFIT * float(np.sqrt(2.0 * count))


def _cause(model: Model, readings: Sequence[Reading], fit: JointFit | None) -> _Cause | None:
    """The one mistake with which the readings fit best. None where chi-square stays too large beside that of
    `fit`, or where the odds do not decide. `fit` is that of the readings as they are, None where they do not
    settle."""
    before = np.inf if fit is None else fit.chi_square / fit.freedom
    # with the rows that a fit leaves out put back, as those of a mistake are all used
    stated = np.inf if fit is None else fit.score + sum(out.deviations**2 for out in fit.left_out)
    usual = (*mistakes(model.structure, readings), *unstated_payloads(model, readings))
    found = _explaining(model, readings, usual, before, stated)
    if not any(one.after < AGREES for one in found):
        # what has figures of its own explains a little better than what is true, too
        ways = by_way(fit, readings) if fit is not None else ()
        fitted = (*other_tools(model, readings, settles=fit is not None), *ways)
        found += _explaining(model, readings, fitted, before, stated)
    if found:
        return min(found, key=lambda one: one.after)
    return _worst_rows(model, readings, before, stated) or _other_dimensions(model, readings, before, stated)


def _explaining(
    model: Model, readings: Sequence[Reading], offers: Sequence[Mended], before: float, stated: float
) -> list[_Cause]:
    """Those of some mistakes that explain readings, by `_cause`."""
    found = list[_Cause]()
    for words, mended, share in _worth_a_fit(model, readings, offers):
        try:
            other = adjusted(model, starts_of(model, mended), _QUICK)
        except (CannotCompute, ConfigError):
            continue
        then = other.chi_square / other.freedom
        odds = log_odds(stated, other.score, then) + closer(readings, mended)
        explains = then < (max(AGREES, share * before) if np.isfinite(before) else _PLAUSIBLE)
        if explains and odds > DECIDED:
            found.append(_Cause(words, before, then, odds))
    return found


def _worth_a_fit(model: Model, readings: Sequence[Reading], offers: Sequence[Mended]) -> Iterator[Mended]:
    """Of some mistakes those that may be the cause: not what is farther from the nominal machine than
    readings as they are, and than errors as usual have it."""
    far = [_nominal(model, mended) for _, mended, _ in offers]
    now = _nominal(model, readings)
    least = now if np.isfinite(now) else min(far, default=now)
    worst = max(_WORSE * least, _UNUSUAL * _usual(model, readings))
    for offer, away in zip(offers, far, strict=True):
        if away <= worst or closer(readings, offer[1]) > 0.0:
            yield offer


def _usual(model: Model, readings: Sequence[Reading]) -> float:
    """Chi-square that errors as usual make of readings, at most; 0 where these do not settle."""
    whole, zero = 0.0, np.zeros(len(model.unknowns))
    try:
        for start in starts_of(model, readings):
            (chunk,) = block_of(model, zero, start, np.zeros(len(start.prior))).chunks()
            whole += chunk.y.size + float(np.sum((chunk.rows @ model.root / chunk.sigma[:, None]) ** 2))
    except (CannotCompute, ConfigError):
        return 0.0
    return whole


def _other_dimensions(
    model: Model, readings: Sequence[Reading], before: float, stated: float
) -> _Cause | None:
    """A machine of other dimensions than stated, whose readings these are. Each number that may be so large
    makes it less likely."""
    usual, known = model.unknowns, np.square(_WIDE) * np.linalg.inv(model.precision)
    unknowns = tuple(replace(unknown, prior=_WIDE * unknown.prior) for unknown in usual)
    wide = replace(model, unknowns=unknowns, known=known)
    try:
        fit = adjusted(wide, starts_of(wide, readings))
    except (CannotCompute, ConfigError):
        return None
    reduced = fit.chi_square / fit.freedom
    odds = log_odds(stated, fit.score, reduced) - fit.determined * float(np.log(_WIDE))
    if reduced > AGREES or odds < DECIDED:
        return None
    off = sorted(zip(usual, fit.theta.tolist(), strict=True), key=lambda one: -abs(one[1]) / one[0].prior)
    if not off or abs(off[0][1]) < _FAR * off[0][0].prior:
        return None
    named = ", ".join(f"{one.name} {value / one.scale:+.0f}" for one, value in off[:_FEW])
    words = (
        f"they are of another machine, or its dimensions are not those of the machine file: most unusual are "
        f"{named}"
    )
    return _Cause(words, before, reduced, odds)


def _nominal(model: Model, readings: Sequence[Reading]) -> float:
    """Chi-square of readings with the machine as known before them; infinite where they do not settle."""
    try:
        return adjusted(replace(model, unknowns=(), known=None), starts_of(model, readings)).chi_square
    except (CannotCompute, ConfigError):
        return np.inf


def _worst_rows(model: Model, readings: Sequence[Reading], before: float, stated: float) -> _Cause | None:
    """Single readings without which the others fit: what they are, and reduced chi-square without them.
    `before` and `stated` are reduced chi-square and the score with them."""
    fit = without_worst(model, readings, RIGHT * before if np.isfinite(before) else _PLAUSIBLE)
    if fit is None or any(one.deviations < OUTLIER for one in fit.left_out):
        return None
    told = [words for words, _ in row_mistakes(fit, readings)]
    lines = ", ".join(f"{PurePath(one.source).name} line {one.row}" for one in fit.left_out)
    words = ", ".join(told[:_NAMED]) or f"single readings do not belong to their postures: {lines}"
    reduced = fit.chi_square / fit.freedom
    odds = log_odds(stated, fit.score, reduced, len(fit.left_out))
    return _Cause(words, before, reduced, odds) if odds > DECIDED else None


def without_worst(model: Model, readings: Sequence[Reading], below: float) -> JointFit | None:
    """The fit without the fewest readings whose rest is below a reduced chi-square, the worst one left out
    first; None where a few are not enough."""
    try:
        starts, out = starts_of(model, readings), list[LeftOut]()
    except CannotCompute:
        return None
    most = max(_ROWS, sum(start.reading.count for start in starts) // 20)
    for _ in range(most):
        try:
            fit = adjusted(model, starts)
            if out and fit.chi_square / fit.freedom < below:
                return replace(fit, left_out=tuple(out))
            off = [np.abs(source.residual / source.start.sigma).max(axis=1) for source in fit.sources]
        except CannotCompute:
            # what keeps the unknowns from settling is far off the nominal machine, too
            off = [_off_nominal(model, start) for start in starts]
        index = int(np.argmax([one.max() for one in off]))
        row = int(np.argmax(off[index]))
        reading = starts[index].reading
        if reading.count <= _ROWS:
            return None
        out.append(LeftOut(reading.source, int(reading.row[row]), float(off[index][row])))
        starts[index] = starts[index].only(np.arange(reading.count) != row)
    return None


def _off_nominal(model: Model, start: Start) -> Array:
    """(n,) by how many standard deviations readings are off the nominal machine, beside most others."""
    reading = start.reading
    pose = model.machine(np.zeros(len(model.unknowns))).nominal(reading.values)
    off = start.measured - start.predicted(pose, np.zeros(len(start.prior)))
    return np.asarray((np.abs(off - np.median(off, axis=0)) / start.sigma).max(axis=1))
