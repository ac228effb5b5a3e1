"""What to know about a calibration of a machine of any joints, and what may be wrong with its readings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import PurePath

import numpy as np

from olp.calibration.joints.adjustment import JointFit, adjusted, fit_joints, starts_of
from olp.calibration.joints.readings import Reading
from olp.calibration.joints.unknowns import Model
from olp.core.errors import CannotCompute, ConfigError
from olp.findings.catalogue import Finding
from olp.kinematics.structure import Structure

#: Reduced chi-square above which the readings are not those of the machine.
ABSURD = 1e3
#: Chi-square is more than so many standard deviations above its expectation.
_MISFIT = 5.0
#: An unknown whose uncertainty is above this share of its prior is held by the prior.
_HELD = 0.5
#: Readings put right have at most this share of chi-square.
_RIGHT = 0.05
#: Reduced chi-square of readings that may be those of the machine.
_PLAUSIBLE = 25.0
#: Readings put right settle within so many steps.
_QUICK = 7
#: At most so many names are listed.
_NAMED = 8
#: Values that may be radians are at most this large: two turns and a half.
_RADIANS = 16.0


def joint_findings(fit: JointFit, readings: Sequence[Reading]) -> tuple[Finding, ...]:
    """What to know about a fit."""
    return tuple(_findings(fit, readings))


def fit_or_refuse(model: Model, readings: Sequence[Reading]) -> JointFit:
    """The fit of readings that are those of the machine. Raises ConfigError where they are not, with the one
    mistake that explains it, and as `fit_joints`."""
    try:
        fit = fit_joints(model, readings)
    except CannotCompute as error:
        causes = [words for words, _ in _mistake(model, readings, _PLAUSIBLE)]
        if not causes:
            raise
        raise ConfigError(f"these readings are not those of this machine: {causes[0]}") from error
    reduced = fit.chi_square / fit.freedom
    if reduced <= ABSURD:
        return fit
    causes = [words for words, _ in _mistake(model, readings, _RIGHT * reduced)]
    raise ConfigError(
        f"these readings are not those of this machine: reduced chi-square is {reduced:.3g}; expected about "
        "1. " + (causes[0] if causes else "Check units, signs, directions of axes and tool vectors")
    )


def _findings(fit: JointFit, readings: Sequence[Reading]) -> Iterator[Finding]:
    for source in dict.fromkeys(out.source for out in fit.left_out):
        rows = [out for out in fit.left_out if out.source == source]
        lines = ", ".join(str(out.row) for out in rows[:_NAMED])
        worst = max(out.deviations for out in rows)
        yield Finding(
            "OLP802",
            f"{PurePath(source).name}: {len(rows)} readings left out (lines {lines}), up to {worst:.0f} "
            "standard deviations off",
        )
    reduced = fit.chi_square / fit.freedom
    if reduced > 1.0 + _MISFIT * np.sqrt(2.0 / fit.freedom):
        yield Finding(
            "OLP808",
            f"reduced chi-square is {reduced:.3g}; expected about 1: the stated uncertainty covers this by a "
            f"factor of {np.sqrt(reduced):.3g}",
        )
        for words, then in _mistake(fit.model, readings, _RIGHT * reduced):
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


def _mistake(model: Model, readings: Sequence[Reading], below: float) -> list[tuple[str, float]]:
    """The one mistake with which the readings fit best, and reduced chi-square then; none where it stays
    above a bound."""
    best, words = below, ""
    for what, mended in _alternatives(model.structure, readings):
        try:
            other = adjusted(model, starts_of(model, mended), _QUICK)
        except (CannotCompute, ConfigError):
            continue
        if other.chi_square / other.freedom < best:
            best, words = other.chi_square / other.freedom, what
    return [(words, best)] if words else []


def _alternatives(structure: Structure, readings: Sequence[Reading]) -> Iterator[tuple[str, list[Reading]]]:
    """What may be wrong, in words, and the readings put right."""
    for column, (name, joint) in enumerate(structure.joints.items()):
        factors = {"runs the other way": -1.0}
        largest = max(float(np.abs(reading.values[:, column]).max()) for reading in readings)
        if joint.kind == "rotary" and largest < _RADIANS:
            factors["is in radians"] = float(np.degrees(1.0))
        for words, factor in factors.items():
            scale = np.ones(len(structure.order))
            scale[column] = factor
            mended = [replace(reading, values=reading.values * scale) for reading in readings]
            yield f"axis {name} {words} in these readings", mended
    for index, reading in enumerate(readings):
        for step, words in ((1, "later"), (-1, "earlier")):
            moved = list(readings)
            moved[index] = replace(reading, values=np.roll(reading.values, -step, axis=0))
            yield f"{PurePath(reading.source).name}: each reading belongs one posture {words}", moved
        for k in range(len(reading.names)):
            for other in range(k):
                swapped = np.where(
                    reading.which == k, other, np.where(reading.which == other, k, reading.which)
                )
                moved = list(readings)
                moved[index] = replace(reading, which=swapped)
                yield (
                    f"{PurePath(reading.source).name}: {reading.names[k]} and {reading.names[other]} are "
                    "swapped",
                    moved,
                )
