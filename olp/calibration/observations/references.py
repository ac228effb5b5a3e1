"""What a straightness is read against: squares and straightedges, whose errors change sign as they are turned
over.

A square turned over about one of its legs errs the other way in the plane of the axes. A straightedge turned
over about its own length shows its form with the other sign. Lines read in both ways give the errors of the
machine and those of the artefact apart (R. R. Donaldson, 1972).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass

#: Standard deviation of the form of a straightedge of which nothing is stated, mm.
FORM_MM = 0.1
#: Standard deviation of the unknown pose of a square, rad.
POSE = 0.1


@dataclass(frozen=True, slots=True)
class Square:
    """An optical or mechanical square that two straightness lines share.

    `error_rad` is by how much the angle between its legs, both along + of their axes, differs from 90 degrees
    (more is +), as its certificate says; `sigma_rad` its standard uncertainty.
    """

    name: str
    error_rad: float = 0.0
    sigma_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class Straightedge:
    """A straightedge that lines are read against; `sigma_mm` is how straight it is, a standard uncertainty.
    With 0 nothing is known of it."""

    name: str
    sigma_mm: float = 0.0


def sense_of(turned: bool) -> float:
    """The sign with which the error of an artefact is read."""
    return -1.0 if turned else 1.0


def square_names(square: str, component: str, turned: bool) -> tuple[str, str]:
    """The shared nuisances of a straightness read against a square: its pose in this plane, its error."""
    plane = "".join(sorted((component[1], component[2])))
    return f"pose of square {square}{' turned over' if turned else ''} in {plane}", error_name(square)


def error_name(square: str) -> str:
    """The shared nuisance of the angle of a square."""
    return f"error of square {square}"


def form_name(straightedge: str, target_mm: float) -> str:
    """The shared nuisance of the form of a straightedge at a target."""
    return f"{_form_of(straightedge)}{target_mm + 0.0:.1f}"


def _form_of(straightedge: str) -> str:
    return f"form of straightedge {straightedge} at "


def form_at(straightedge: str, name: str) -> float | None:
    """The target of a shared nuisance that is the form of a straightedge."""
    start = _form_of(straightedge)
    return float(name.removeprefix(start)) if name.startswith(start) else None


def form_columns(straightedge: str, target_mm: Array) -> dict[str, Array]:
    """(n,) shares of readings at targets (n,) of the form there, by the name of the nuisance."""
    names = [form_name(straightedge, q) for q in target_mm.tolist()]
    return {name: np.array([one == name for one in names], float) for name in dict.fromkeys(names)}


def known_of(
    names: Sequence[str], squares: Sequence[Square], straightedges: Sequence[Straightedge]
) -> dict[str, tuple[float, float]]:
    """Mean and standard deviation of shared nuisances before any reading; rad, and mm of form."""
    known = {error_name(s.name): (s.error_rad, max(s.sigma_rad, 1e-9)) for s in squares}
    sigmas = {_form_of(one.name): one.sigma_mm or FORM_MM for one in straightedges}
    form = {name: (0.0, sigma) for name in names for start, sigma in sigmas.items() if name.startswith(start)}
    return {name: known.get(name) or form.get(name) or (0.0, POSE) for name in names}
