"""The judge's beam: deflection under a point load by finite differences of E I w'''' = q; no formulas.

Ghost nodes beyond both ends carry the conditions there: w = 0 and w'' = 0 (simple), w = 0 and w' = 0 (fixed),
w'' = 0 and E I w''' = -P (the loaded free end of a cantilever).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import diags_array, lil_array
from scipy.sparse.linalg import spsolve

GRAVITY = 9.80665


def elastic_line(
    support: str, length_mm: float, at_mm: float, load_n: float, stiffness_n_mm2: float, nodes: int = 800
) -> tuple[np.ndarray, float]:
    """(nodes + 1,) deflection in mm along the load, and the step in mm; a cantilever is loaded at its end."""
    h, size = length_mm / nodes, nodes + 5
    matrix = lil_array(
        diags_array([1.0, -4.0, 6.0, -4.0, 1.0], offsets=[-2, -1, 0, 1, 2], shape=(size, size))
    )
    right = np.zeros(size)
    simple, flat = (1.0, -2.0, 1.0), (-1.0, 0.0, 1.0)

    def condition(row: int, first: int, weights: tuple[float, ...], value: float = 0.0) -> None:
        matrix[[row]] = 0.0
        for k, weight in enumerate(weights):
            matrix[row, first + k] = weight
        right[row] = value

    condition(0, 1, simple if support == "simple" else flat)
    condition(1, 2, (1.0,))
    matrix[[2]] = 0.0
    matrix[2, 2] = 1.0
    # the field equation of the first node gives way to w = 0; row 1 fixes the outer ghost, which nothing uses
    condition(1, 0, (1.0,))
    if support == "cantilever":
        condition(size - 2, size - 4, simple)
        condition(size - 1, size - 5, (-1.0, 2.0, 0.0, -2.0, 1.0), -2.0 * h**3 * load_n / stiffness_n_mm2)
    else:
        condition(size - 3, size - 3, (1.0,))
        condition(size - 2, size - 4, simple if support == "simple" else flat)
        condition(size - 1, size - 1, (1.0,))
        node = at_mm / h + 2.0
        low = int(np.floor(node))
        # between two nodes the load is shared by distance
        for k, share in ((low, 1.0 - (node - low)), (low + 1, node - low)):
            if 2 < k < size - 3:
                right[k] += share * load_n * h**3 / stiffness_n_mm2
    return np.asarray(spsolve(matrix.tocsc(), right))[2:-2], h


def under_the_load(
    support: str, length_mm: float, at_mm: float, mass_kg: float, stiffness_n_mm2: float
) -> tuple[float, float]:
    """Deflection in mm and slope in rad where the load stands."""
    line, h = elastic_line(support, length_mm, at_mm, GRAVITY * mass_kg, stiffness_n_mm2)
    x = h * np.arange(len(line))
    slope = np.gradient(line, h, edge_order=2)
    return float(np.interp(at_mm, x, line)), float(np.interp(at_mm, x, slope))
