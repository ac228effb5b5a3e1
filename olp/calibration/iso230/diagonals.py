"""Positioning along face and body diagonals (ISO 230-6), and the scales and squareness that follow from
it.

The elongation of a diagonal of direction u is  u_x^2 S_x + u_y^2 S_y + u_z^2 S_z - u_x u_y C0Y + u_x u_z B0Z
- u_y u_z A0Z, with S the scale errors. Angular errors and straightness of the axes contribute too, and no set
of diagonals separates them. So diagonals check a machine; they give squareness where the angles are small.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from types import MappingProxyType
from typing import Any

import numpy as np

from olp.calibration.iso230.conventions import AXES_OF, LEAN
from olp.calibration.observations.diagonals import Diagonal
from olp.calibration.observations.squareness import SquarenessReading
from olp.core.arrays import Array
from olp.core.errors import ConfigError
from olp.core.machine import SQUARENESS
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.core.values import dataclass
from olp.findings.catalogue import Finding

SCALES = ("SX", "SY", "SZ")
UNKNOWNS = (*SCALES, *SQUARENESS)
#: Share of an unknown in the null space above which it is not determined.
_SHARE = 1e-6
#: Singular values below this share of the largest count as zero.
_RANK = 1e-9
#: A residual sum of squares so many standard deviations above its expectation is reported.
_TOO_MUCH = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class DiagonalFit:
    """The fit of diagonals: (6,) `value` and `sigma` of UNKNOWNS in rad or mm/mm, those that are determined
    in `determined`. `free` lists the changes of all six that change no reading; `elongation` by diagonal has
    its uncertainty and residual."""

    diagonals: tuple[Diagonal, ...]
    value: Array
    sigma: Array
    determined: frozenset[str]
    free: tuple[Mapping[str, float], ...]
    elongation: Array
    sigma_elongation: Array
    residual: Array
    chi_square: float
    dof: int
    stated: Mapping[str, tuple[float, float]] = field(default_factory=lambda: MappingProxyType({}))

    def readings(self) -> tuple[SquarenessReading, ...]:
        """The squareness that is determined, as at the middle of the diagonals and over their extent."""
        ends = np.array([d.start_mm for d in self.diagonals] + [d.end_mm for d in self.diagonals], float)
        low, high = ends.min(axis=0), ends.max(axis=0)
        middle = (low + high) / 2.0
        readings = []
        for k, name in enumerate(SQUARENESS):
            if name in self.determined:
                spans = [(float(low[i]), float(high[i])) for i in AXES_OF[name]]
                readings.append(
                    SquarenessReading(
                        name,
                        float(self.value[3 + k]),
                        (float(middle[0]), float(middle[1]), float(middle[2])),
                        (spans[0], spans[1]),
                        self.diagonals[0].tool_mm,
                        float(self.sigma[3 + k]),
                        ", ".join(dict.fromkeys(d.source for d in self.diagonals if d.source)),
                    )
                )
        return tuple(readings)

    @property
    def findings(self) -> Iterator[Finding]:
        missing = [name for name in UNKNOWNS if name not in self.determined]
        if missing:
            changes = ", or ".join(_words(change) for change in self.free)
            yield Finding(
                "OLP856",
                f"{', '.join(missing)} not determined by diagonals {self.names}: no reading changes with "
                f"{changes}; measure face diagonals, or state scales with their uncertainty",
            )
        if self.dof > 0 and self.chi_square > self.dof + _TOO_MUCH * np.sqrt(2.0 * self.dof):
            worst = int(np.argmax(np.abs(self.residual) / self.sigma_elongation))
            micro = float(self.residual[worst]) * self.diagonals[worst].length_mm * UM_PER_MM
            yield Finding(
                "OLP857",
                f"diagonals: chi-square {self.chi_square:.1f} at {self.dof} degrees of freedom, most on "
                f"{self.diagonals[worst].name} ({micro:+.2f} um at its end)",
            )

    @property
    def names(self) -> str:
        return ", ".join(d.name for d in self.diagonals)

    def as_dict(self) -> dict[str, Any]:
        rows = []
        for i, d in enumerate(self.diagonals):
            row: dict[str, Any] = {
                "name": d.name, "file": d.source, "length_mm": d.length_mm,
                "elongation_um_m": self.elongation[i] / RAD_PER_URAD,
                "sigma_um_m": self.sigma_elongation[i] / RAD_PER_URAD,
                "left_um_m": self.residual[i] / RAD_PER_URAD,
            }  # fmt: skip
            # one run has no spread, and gives its elongation all the same
            with contextlib.suppress(ConfigError):
                row |= {f"{k}_um": v * UM_PER_MM for k, v in d.evaluate().figures().items()}
            rows.append(row)
        return {
            "diagonals": rows,
            "found": [
                {
                    "name": name,
                    "value_urad" if name in SQUARENESS else "value_um_m": self.value[k] / RAD_PER_URAD,
                    "sigma_urad" if name in SQUARENESS else "sigma_um_m": self.sigma[k] / RAD_PER_URAD,
                }
                for k, name in enumerate(UNKNOWNS)
                if name in self.determined
            ],
            "not_determined": [name for name in UNKNOWNS if name not in self.determined],
            "unseen_changes": [dict(change) for change in self.free],
            "chi_square": self.chi_square,
            "degrees_of_freedom": self.dof,
        }


def row_of(unit: Array) -> Array:
    """(6,) elongation of a diagonal of direction `unit` (3,) for one unit of each of UNKNOWNS."""
    shear = [LEAN[name] * unit[i] * unit[j] for name, (i, j) in AXES_OF.items()]
    return np.concatenate((unit * unit, shear))


def fit(diagonals: Sequence[Diagonal], known: Mapping[str, tuple[float, float]] | None = None) -> DiagonalFit:
    """Scales and squareness from diagonals by least squares; `known` gives (value, standard uncertainty) of
    any of UNKNOWNS from other instruments, in mm/mm or rad.

    The laser's scale error is one unknown with its stated uncertainty, common to all diagonals. Raises
    ConfigError.
    """
    known = dict(known or {})
    for name, (_, spread) in known.items():
        if name not in UNKNOWNS or not spread > 0.0:
            raise ConfigError(
                f"known {name} with uncertainty {spread:g}; expected one of {', '.join(UNKNOWNS)} with an "
                "uncertainty above zero"
            )
    if not diagonals:
        raise ConfigError("no diagonals; expected face or body diagonals")
    lever_arms = np.array([d.tool_mm for d in diagonals], float)
    if np.ptp(lever_arms, axis=0).max() > 1.0:
        raise ConfigError(
            "the diagonals have different tool vectors, so angular errors differ between them; expected one",
            file=diagonals[-1].source,
        )
    pairs = [d.elongation() for d in diagonals]
    elongation, sigma = np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs])
    if (sigma == 0.0).any():
        bare = diagonals[int(np.argmin(sigma))]
        raise ConfigError(
            f"diagonal {bare.name}: nothing is repeated and sigma_um is not stated; expected repeated runs, "
            "or the uncertainty of a reading",
            file=bare.source,
        )
    design = np.array([row_of(d.unit) for d in diagonals])
    stated = np.array([[float(u == name) for u in UNKNOWNS] for name in known]).reshape(-1, len(UNKNOWNS))
    design = np.vstack((design, stated))
    value = np.concatenate((elongation, [v for v, _ in known.values()]))
    weight = 1.0 / np.concatenate((sigma, [s for _, s in known.values()]))
    scale = max(d.sigma_scale for d in diagonals)
    system, right = design * weight[:, None], value * weight
    # a laser that reads a share too much stretches every diagonal; weighted by its own uncertainty
    laser = np.concatenate((np.full(len(diagonals), scale), np.zeros(len(known)))) * weight
    full = np.vstack((np.column_stack((system, laser)), [*np.zeros(len(UNKNOWNS)), 1.0]))
    columns = np.asarray(np.linalg.norm(design, axis=0))
    _, singular, v = np.linalg.svd(design / np.where(columns > 0, columns, 1.0))
    rank = int((singular > _RANK * singular[0]).sum())
    null = _sparse(v[rank:] / np.where(columns > 0, columns, 1.0))
    inverse = np.linalg.pinv(full, rcond=1e-12)
    estimate = inverse @ np.append(right, 0.0)
    covariance = inverse @ inverse.T
    determined = frozenset(
        name for k, name in enumerate(UNKNOWNS) if not len(null) or np.abs(null[:, k]).max() < _SHARE
    )
    rest = np.append(right, 0.0) - full @ estimate
    residual = elongation - design[: len(diagonals)] @ estimate[:6]
    return DiagonalFit(
        tuple(diagonals), estimate[:6], np.sqrt(np.diag(covariance)[:6]), determined,
        tuple(_change(row) for row in null), elongation, sigma, residual, float(rest @ rest),
        len(value) - rank, MappingProxyType(known),
    )  # fmt: skip


def _sparse(rows: Array) -> Array:
    """A basis of the same space whose rows have few parts (Gauss-Jordan)."""
    rows = np.array(rows)
    for k in range(len(rows)):
        pivot = int(np.argmax(np.abs(rows[k])))
        rows[k] /= rows[k, pivot]
        for other in range(len(rows)):
            if other != k:
                rows[other] -= rows[other, pivot] * rows[k]
    rows[np.abs(rows) < _SHARE] = 0.0
    return rows


def _change(row: Array) -> Mapping[str, float]:
    """A change that changes no reading, with a largest part of 1."""
    row = row / row[np.argmax(np.abs(row))]
    return MappingProxyType({name: float(v) for name, v in zip(UNKNOWNS, row, strict=True) if abs(v) > 1e-6})


def _words(change: Mapping[str, float]) -> str:
    return " and ".join(
        f"{value:+.3g} {'um/m' if name in SCALES else 'urad'} in {name}" for name, value in change.items()
    )


def place_words(diagonal: Diagonal) -> str:
    """Start and end as text."""
    a, b = (
        " ".join(f"{axis}{v:g}" for axis, v in zip(AXES, p, strict=True))
        for p in (diagonal.start_mm, diagonal.end_mm)
    )
    return f"{a} to {b}"
