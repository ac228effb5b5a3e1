"""Which errors of a machine readings leave open, by rank: written from the contract, without the project's
code.

Every curve is four polynomials, zero at the datum and straightness without slope; readings are differences of
what `simulated` says, so that a column is what an instrument would read of one of them. A set of unknowns is
open where some change of it, with changes of all the others and of the nuisances, changes no reading.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from judge.simulated import AXES, BOX, NAMES, Machine

SQUARE = ("C0Y", "B0Z", "A0Z")
_DEGREES = 4
_OPEN = 1e-6
Reading = Callable[[Machine], np.ndarray]


def blank(chain: str) -> Machine:
    curves = {name: (lambda q: 0.0 * np.asarray(q, float)) for name in NAMES}
    return Machine(chain, np.array(BOX), np.zeros(3), curves, dict.fromkeys(SQUARE, 0.0))


def _polynomial(name: str, degree: int) -> Callable[[np.ndarray], np.ndarray]:
    low, high = BOX[AXES.index(name[2])]
    size = 1e-6 if name[1] in "ABC" else 1e-3
    grid = np.linspace(low, high, 2001)
    raw = (grid / (high - low)) ** degree
    straight = name[1] in AXES and name[1] != name[2]
    slope = float(np.polyfit(grid, raw, 1)[0]) if straight else 0.0
    return lambda q: size * ((np.asarray(q, float) / (high - low)) ** degree - slope * np.asarray(q, float))


def columns(chain: str, reading: Reading) -> tuple[np.ndarray, list[str]]:
    """(n, p) what one micrometre or microradian of each unknown does to the readings, and their names."""
    start = reading(blank(chain))
    changes, names = [], []
    for name in NAMES:
        straight = name[1] in AXES and name[1] != name[2]
        for degree in range(2 if straight else 1, _DEGREES + 1 + straight):
            machine = blank(chain)
            machine.curves[name] = _polynomial(name, degree)
            changes.append(reading(machine) - start)
            names.append(name)
    for name in SQUARE:
        machine = blank(chain)
        machine.square[name] = 1e-6
        changes.append(reading(machine) - start)
        names.append(name)
    return np.stack(changes, axis=1), names


def open_changes(table: np.ndarray, nuisances: np.ndarray) -> np.ndarray:
    """(d, p) changes of unknowns that no reading sees, with nuisances (n, k) free."""
    basis, size, _ = np.linalg.svd(nuisances, full_matrices=False)
    basis = basis[:, size > 1e-10 * size[0]] if nuisances.size else nuisances
    rest = table - basis @ (basis.T @ table)
    norm = np.linalg.norm(table, axis=0)
    norm = np.maximum(norm, 1e-6 * norm.max())
    _, size, right = np.linalg.svd(rest / norm)
    rank = int((size > _OPEN).sum())
    return np.asarray(right[rank:] / norm)


def open_names(changes: np.ndarray, names: list[str]) -> set[str]:
    """Unknowns of which no part is observable."""
    if not len(changes):
        return set()
    opened = set()
    for name in dict.fromkeys(names):
        own = np.array([n == name for n in names])
        rest = changes[:, own] / np.abs(changes).max()
        size = np.linalg.svd(rest, compute_uv=False)
        if (size > 1e-4).sum() == own.sum():
            opened.add(name)
    return opened


def frame(places: np.ndarray) -> np.ndarray:
    """(3 n, 6) what a rigid motion does to places (n, 3)."""
    centred = (places - places.mean(axis=0)) / 1000.0
    table = np.zeros((len(places), 3, 6))
    for k in range(3):
        table[:, k, k] = 1.0
        table[:, :, 3 + k] = np.cross(np.eye(3)[k], centred)
    return table.reshape(-1, 6)
