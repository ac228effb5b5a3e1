"""An independent Monte-Carlo of what unknown curves do to the tip."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from . import simulated


def sampled(
    chain: str,
    draw: Callable[[np.random.Generator], tuple[Mapping[str, np.ndarray], Mapping[str, float]]],
    knots: Mapping[str, np.ndarray],
    axis_mm: np.ndarray,
    tool: np.ndarray,
    touch: tuple[np.ndarray, np.ndarray] | None,
    draws: int,
) -> np.ndarray:
    """(n, 3, 3) covariance of the tip at positions (n, 3), less what the touch-off holds, over `draws` of
    curves (values at the knots of their axis, straight between) and squareness. Curves hold at the datum,
    which is zero."""
    rng = np.random.default_rng(7)
    errors = np.zeros((draws, len(axis_mm), 3))
    for k in range(draws):
        values, square = draw(rng)
        curves = {
            name: (lambda q, x=knots[name[2]], y=values[name]: np.interp(q, x, y)) for name in simulated.NAMES
        }
        machine = simulated.Machine(chain, np.array(simulated.BOX), np.zeros(3), curves, dict(square))
        errors[k] = machine.error(axis_mm, tool)
        if touch is not None:
            errors[k] -= machine.error(touch[0][None], touch[1])
    return np.einsum("kni,knj->nij", errors, errors) / draws
