"""An independent Monte-Carlo of what unknown curves do to the tip, and readings of simulated machines."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Mapping

import numpy as np

from olp.calibration.observations import Line, Measurements, Square

from . import simulated


def measured(
    machine: simulated.Machine, seed: int, *, periods: bool = True, square_sigma: float = 5e-6
) -> Measurements:
    """The readings of a full set of lines; `square_sigma` is what the plan says of the squares."""
    taken = simulated.all_lines(machine, seed)
    lines = [
        Line(
            t.component, t.target, t.value, t.run, t.direction, t.line, t.tool, t.reference, t.square, 0.0,
            t.scale_sigma,
        )
        for t in taken
    ]  # fmt: skip
    squares = tuple(Square(name, 0.0, square_sigma) for name in sorted({t.square for t in taken if t.square}))
    return Measurements(
        "simulated", tuple(lines), squares, measured=datetime.date(2026, 5, 14),
        periods_mm=tuple((p,) for p in simulated.PITCH) if periods else ((), (), ()),
    )  # fmt: skip


def sampled(
    chain: str,
    draw: Callable[[np.random.Generator], tuple[Mapping[str, np.ndarray], Mapping[str, float]]],
    knots: Mapping[str, np.ndarray],
    at: np.ndarray,
    tool: np.ndarray,
    touch: tuple[np.ndarray, np.ndarray] | None,
    draws: int,
) -> np.ndarray:
    """(n, 3, 3) covariance of the tip at positions (n, 3), less what the touch-off holds, over `draws` of
    curves (values at the knots of their axis, straight between) and squareness. Curves hold at the datum,
    which is zero."""
    rng = np.random.default_rng(7)
    out = np.zeros((draws, len(at), 3))
    for k in range(draws):
        values, square = draw(rng)
        curves = {
            name: (lambda q, x=knots[name[2]], y=values[name]: np.interp(q, x, y)) for name in simulated.NAMES
        }
        machine = simulated.Machine(chain, np.array(simulated.BOX), np.zeros(3), curves, dict(square))
        out[k] = machine.error(at, tool)
        if touch is not None:
            out[k] -= machine.error(touch[0][None], touch[1])
    return np.einsum("kni,knj->nij", out, out) / draws
