"""What to know about a calibration of a machine of any joints, and what may be wrong with its readings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import PurePath

import numpy as np

from olp.calibration.joints.adjustment import JointFit, LeftOut, adjusted, fit_joints, starts_of
from olp.calibration.joints.mistakes import RIGHT, mistakes, row_mistakes
from olp.calibration.joints.readings import Reading
from olp.calibration.joints.unknowns import Model
from olp.core.errors import CannotCompute, ConfigError
from olp.findings.catalogue import Finding

#: Reduced chi-square above which the readings are not those of the machine.
ABSURD = 1e3
#: Chi-square is more than so many standard deviations above its expectation.
_MISFIT = 5.0
#: An unknown whose uncertainty is above this share of its prior is held by the prior.
_HELD = 0.5
#: Reduced chi-square of readings that may be those of the machine.
_PLAUSIBLE = 25.0
#: Readings put right are not farther from the machine before them than this, as a factor of chi-square.
_WORSE = 2.0
#: Readings put right settle within so many steps.
_QUICK = 7
#: At most so many names are listed.
_NAMED = 8
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
        causes = [words for words, _ in _mistake(model, readings, None)]
        if not causes:
            raise
        raise ConfigError(f"these readings are not those of this machine: {causes[0]}") from error
    reduced = fit.chi_square / fit.freedom
    if reduced <= ABSURD:
        return fit
    causes = [words for words, _ in _mistake(model, readings, reduced)]
    raise ConfigError(
        f"these readings are not those of this machine: reduced chi-square is {reduced:.3g}; expected about "
        "1. " + (causes[0] if causes else "Check units, signs, directions of axes and tool vectors")
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
    for words in row_mistakes(fit, readings) if fit.left_out else ():
        yield Finding("OLP810", words)
    reduced = fit.chi_square / fit.freedom
    if reduced > 1.0 + _MISFIT * np.sqrt(2.0 / fit.freedom):
        yield Finding(
            "OLP808",
            f"reduced chi-square is {reduced:.3g}; expected about 1: the stated uncertainty covers this by a "
            f"factor of {np.sqrt(reduced):.3g}",
        )
        for words, then in _mistake(fit.model, readings, reduced):
            yield Finding(
                "OLP810", f"{words}: then reduced chi-square is {then:.3g} instead of {reduced:.3g}"
            )
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


def _mistake(model: Model, readings: Sequence[Reading], reduced: float | None) -> list[tuple[str, float]]:
    """The one mistake with which the readings fit best, and reduced chi-square then; none where that stays
    too large beside `reduced`, that of the readings as they are (None where they do not settle)."""
    found = list[tuple[str, float]]()
    # errors of a machine are small beside most mistakes: what is far from the nominal one is not the cause
    worst = _WORSE * _nominal(model, readings)
    for what, mended, share in mistakes(model.structure, readings):
        if _nominal(model, mended) > worst:
            continue
        try:
            other = adjusted(model, starts_of(model, mended), _QUICK)
        except (CannotCompute, ConfigError):
            continue
        then = other.chi_square / other.freedom
        if then < (_PLAUSIBLE if reduced is None else share * reduced):
            found.append((what, then))
    if found:
        return [min(found, key=lambda one: one[1])]
    return list(_worst_rows(model, readings, _PLAUSIBLE if reduced is None else RIGHT * reduced))


def _nominal(model: Model, readings: Sequence[Reading]) -> float:
    """Chi-square of readings with the machine as known before them; infinite where they do not settle."""
    try:
        return adjusted(replace(model, unknowns=(), known=None), starts_of(model, readings)).chi_square
    except (CannotCompute, ConfigError):
        return np.inf


def _worst_rows(model: Model, readings: Sequence[Reading], below: float) -> Iterator[tuple[str, float]]:
    """Single readings without which the others fit: what they are, and reduced chi-square without them."""
    fit = without_worst(model, readings, below)
    if fit is None:
        return
    reduced = fit.chi_square / fit.freedom
    told = list(row_mistakes(fit, readings))
    if told:
        yield ", ".join(told[:_NAMED]), reduced
        return
    lines = ", ".join(f"{PurePath(one.source).name} line {one.row}" for one in fit.left_out)
    yield f"single readings do not belong to their postures: {lines}", reduced


def without_worst(model: Model, readings: Sequence[Reading], below: float) -> JointFit | None:
    """The fit without the fewest readings whose rest is below a reduced chi-square, the worst one left out
    first; None where a few are not enough."""
    starts, out = starts_of(model, readings), list[LeftOut]()
    most = max(_ROWS, sum(start.reading.count for start in starts) // 20)
    for _ in range(most):
        try:
            fit = adjusted(model, starts)
            if out and fit.chi_square / fit.freedom < below:
                return replace(fit, left_out=tuple(out))
        except CannotCompute:
            # what keeps the unknowns from settling is far off the nominal machine, too
            try:
                fit = adjusted(replace(model, unknowns=(), known=None), starts)
            except CannotCompute:
                return None
        off = [np.abs(source.residual / source.start.sigma).max(axis=1) for source in fit.sources]
        index = int(np.argmax([one.max() for one in off]))
        row = int(np.argmax(off[index]))
        reading = starts[index].reading
        if reading.count <= _ROWS:
            return None
        out.append(LeftOut(reading.source, int(reading.row[row]), float(off[index][row])))
        starts[index] = starts[index].only(np.arange(reading.count) != row)
    return None
