"""Unknowns of weight: how much joints give way under what they carry, with masses that are known or not."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from olp.calibration.joints.candidates import Priors, Unknown
from olp.kinematics.errors import Gravity, MachineErrors, Yield
from olp.kinematics.structure import Structure
from olp.kinematics.weight import sums_of_angles

#: Tables of the calibration file whose numbers are unknowns of weight.
TABLES = ("elasticity", "gravity")
#: Keys of a term of gravity.
_SINE = "sin_urad"
_COSINE = "cos_urad"


def of_weight(
    structure: Structure, priors: Priors, yielding: Sequence[str], sagging: Sequence[str]
) -> Iterator[Unknown]:
    """The yield of the joints `yielding` under known weights, and the turn of those `sagging` under unknown
    ones. Raises ConfigError where that follows no sum of angles."""
    for name in yielding:
        yield Unknown("elasticity", name, "own_urad_Nm", priors.yield_rad_Nm)
    for name in sagging:
        for angles in sums_of_angles(structure, name):
            for key in (_SINE, _COSINE):
                yield Unknown("gravity", name, " ".join((key, *angles)), priors.gravity_rad)


def with_weight(errors: MachineErrors, changes: Iterable[tuple[Unknown, float]]) -> MachineErrors:
    """Errors with changes of unknowns of weight added; others are left out."""
    yields, terms = dict(errors.yields), {(term.joint, term.angles): term for term in errors.gravity}
    for unknown, change in changes:
        if unknown.table == "elasticity":
            stiff = yields.get(unknown.part, Yield())
            yields[unknown.part] = replace(stiff, own=stiff.own + change)
        elif unknown.table == "gravity":
            key, *angles = unknown.key.split()
            place = (unknown.part, tuple(angles))
            term = terms.get(place, Gravity(*place))
            if key == _SINE:
                terms[place] = replace(term, sine=term.sine + change)
            else:
                terms[place] = replace(term, cosine=term.cosine + change)
    return replace(errors, yields=yields, gravity=tuple(terms.values()))
