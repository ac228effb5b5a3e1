"""Families of simulated machines of different character, without the project's code, and the best linear
estimator of a curve that knows the covariance of its family.

What is tuned on one family shows on another. All hold as `simulated.Machine`: lengths in mm, angles in rad.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from judge.simulated import AXES, BOX, NAMES, Curve, Machine, _normal, _rough, _waves, drift_of

#: Draws one curve: generator, start and length of the axis, size, whether it is positioning, joints of rails.
Draw = Callable[[np.random.Generator, float, float, float, bool, np.ndarray], Curve]
#: Size of the curves of a class: angles (rad), positioning and straightness (mm).
SIZE = {"angle": 25e-6, "positioning": 0.040, "straightness": 0.016}


def _smooth(
    rng: np.random.Generator, low: float, span: float, size: float, own: bool, joints: np.ndarray
) -> Curve:
    return _waves(rng, low, span, size, own)


def _screws(
    rng: np.random.Generator, low: float, span: float, size: float, own: bool, joints: np.ndarray
) -> Curve:
    """A smooth curve with waves of a screw or scale (5 to 30 mm) and of a gear (60 to 250 mm), whose periods
    are not known."""
    base = _waves(rng, low, span, 0.7 * size, own)
    periods = np.exp(rng.uniform(np.log((5.0, 60.0)), np.log((30.0, 250.0))))
    parts = [(2 * np.pi / p, rng.uniform(0.03, 0.1) * size, rng.uniform(0.0, 2 * np.pi)) for p in periods]

    def curve(q: np.ndarray) -> np.ndarray:
        q = np.asarray(q, float)
        return base(q) + sum(a * np.sin(w * q + phase) for w, a, phase in parts)

    return curve


def _dented(
    rng: np.random.Generator, low: float, span: float, size: float, own: bool, joints: np.ndarray
) -> Curve:
    """A long sag, with local dents of a guide."""
    bow, lean, place = size * rng.normal(), 0.7 * size * rng.normal() * own, rng.uniform(0.3, 0.7)
    count = rng.integers(2, 6)
    middle, width = rng.uniform(0.0, 1.0, count), rng.uniform(0.015, 0.06, count)
    depth = 0.2 * size * rng.normal(size=count)

    def curve(q: np.ndarray) -> np.ndarray:
        u = (np.asarray(q, float) - low) / span
        value = lean * u + bow * (u - place) ** 2 * (3.0 - 2.0 * np.abs(u - place))
        return value + (depth * np.exp(-0.5 * ((u[..., None] - middle) / width) ** 2)).sum(axis=-1)

    return curve


def _tabled(
    rng: np.random.Generator, low: float, span: float, size: float, own: bool, joints: np.ndarray
) -> Curve:
    """Straight between the points of a control's own table, which somebody filled point by point."""
    count = rng.integers(6, 22)
    base = _waves(rng, low, span, 0.7 * size, own)
    nodes = np.linspace(low, low + span, count)
    values = base(nodes) + 0.12 * size * rng.normal(size=count)
    return lambda q: np.interp(q, nodes, values)


def _jointed(
    rng: np.random.Generator, low: float, span: float, size: float, own: bool, joints: np.ndarray
) -> Curve:
    return _rough(rng, low, span, size, own, joints)


FAMILIES: dict[str, Draw] = {
    "smooth": _smooth, "joints": _jointed, "screws": _screws, "dents": _dented, "tables": _tabled,
}  # fmt: skip


def _bowed(
    rng: np.random.Generator, low: float, span: float, size: float, own: bool, joints: np.ndarray
) -> Curve:
    """A guide that heat bows: a parabola and a third power, and next to nothing else."""
    bow, twist, lean = size * rng.normal(size=3) * (1.6, 0.8, 0.7 * own)
    fine = _waves(rng, low, span, 0.03 * size, False)

    def curve(q: np.ndarray) -> np.ndarray:
        u = (np.asarray(q, float) - low) / span - 0.5
        return lean * u + bow * u**2 + twist * u**3 + fine(q)

    return curve


def _railed(
    rng: np.random.Generator, low: float, span: float, size: float, own: bool, joints: np.ndarray
) -> Curve:
    """Rails in pieces of equal length, each straight, with a step and a kink at every joint."""
    count = rng.integers(2, 5)
    ends = low + span * np.arange(1, count) / count
    jumps, slopes = 0.15 * size * rng.normal(size=count - 1), size * rng.normal(size=count)
    base = _waves(rng, low, span, 0.3 * size, own)

    def curve(q: np.ndarray) -> np.ndarray:
        q = np.asarray(q, float)
        nodes = np.linspace(low, low + span, count + 1)
        heights = np.concatenate([[0.0], np.cumsum(slopes) / count])
        return base(q) + np.interp(q, nodes, heights) + (jumps * (q[..., None] > ends)).sum(axis=-1)

    return curve


def _racked(
    rng: np.random.Generator, low: float, span: float, size: float, own: bool, joints: np.ndarray
) -> Curve:
    """Racks in pieces of 250 to 500 mm whose pitch is off: a sawtooth, under a smooth curve."""
    piece, height, start = rng.uniform(250.0, 500.0), 0.15 * size * rng.normal(), rng.uniform()
    base = _waves(rng, low, span, 0.6 * size, own)

    def curve(q: np.ndarray) -> np.ndarray:
        q = np.asarray(q, float)
        return base(q) + height * (((q - low) / piece + start) % 1.0)

    return curve


def _worn(
    rng: np.random.Generator, low: float, span: float, size: float, own: bool, joints: np.ndarray
) -> Curve:
    """A guide worn where parts are usually clamped, with soft edges."""
    a, b = np.sort(rng.uniform(0.15, 0.85, 2))
    depth, edge = 0.6 * size * rng.normal(), rng.uniform(0.02, 0.08)
    base = _waves(rng, low, span, 0.4 * size, own)

    def curve(q: np.ndarray) -> np.ndarray:
        u = (np.asarray(q, float) - low) / span
        return base(q) + 0.5 * depth * (np.tanh((u - a) / edge) - np.tanh((u - b) / edge))

    return curve


#: How much smaller the errors of a very good machine are, and how much larger those of a bad one.
OTHER_SIZE = 5.0


def _harmonic(
    rng: np.random.Generator, low: float, span: float, size: float, own: bool, joints: np.ndarray
) -> Curve:
    """Waves of a rack (20 to 120 mm) and of a long gear (120 to 500 mm), each with two harmonics."""
    base = _waves(rng, low, span, 0.6 * size, own)
    parts = [
        (2 * np.pi * k / period, height / k, rng.uniform(0.0, 2 * np.pi))
        for period, height in zip(
            np.exp(rng.uniform(np.log((20.0, 120.0)), np.log((120.0, 500.0)))),
            rng.uniform(0.05, 0.12, 2) * size,
            strict=True,
        )
        for k in (1, 2, 3)
    ]

    def curve(q: np.ndarray) -> np.ndarray:
        q = np.asarray(q, float)
        return base(q) + sum(a * np.sin(w * q + phase) for w, a, phase in parts)

    return curve


def _good(
    rng: np.random.Generator, low: float, span: float, size: float, own: bool, joints: np.ndarray
) -> Curve:
    """Screws of a very good machine."""
    return _screws(rng, low, span, size / OTHER_SIZE, own, joints)


def _bad(
    rng: np.random.Generator, low: float, span: float, size: float, own: bool, joints: np.ndarray
) -> Curve:
    """Joints of a bad machine."""
    return _jointed(rng, low, span, size * OTHER_SIZE, own, joints)


#: Families on which nothing was tuned.
UNTUNED: dict[str, Draw] = {
    "bows": _bowed, "rails": _railed, "racks": _racked, "wear": _worn, "harmonics": _harmonic,
}  # fmt: skip
#: Families of other size: how steps and ripple go with the size of a machine was looked at on these.
SIZED: dict[str, Draw] = {"good": _good, "bad": _bad}
#: All of them.
DRAWS = FAMILIES | UNTUNED | SIZED


def class_of(name: str) -> str:
    """angle, positioning or straightness."""
    return "angle" if name[1] in "ABC" else "positioning" if name[1] == name[2] else "straightness"


def _curve(rng: np.random.Generator, family: str, name: str, joints: np.ndarray) -> Curve:
    low, high = BOX[AXES.index(name[2])]
    kind = class_of(name)
    raw = DRAWS[family](rng, low, high - low, SIZE[kind], kind == "positioning", joints)
    return _normal(raw, low, high, 0.0, kind == "straightness")


def _joints(rng: np.random.Generator, axis: int) -> np.ndarray:
    low, high = BOX[axis]
    inside = 0.1 * (high - low)
    return np.sort(rng.uniform(low + inside, high - inside, rng.integers(1, 3)))


def machine(seed: int, family: str, chain: str = "FXYZ") -> Machine:
    """A random machine of a family over `simulated.BOX`, datum zero; its joints are those of all six errors
    of an axis."""
    rng = np.random.default_rng([seed, list(DRAWS).index(family), 31])
    curves: dict[str, Curve] = {}
    for axis, letter in enumerate(AXES):
        joints = _joints(rng, axis)
        for d in "XYZABC":
            curves[f"E{d}{letter}"] = _curve(rng, family, f"E{d}{letter}", joints)
    square = dict(zip(("C0Y", "B0Z", "A0Z"), 30e-6 * rng.normal(size=3), strict=True))
    half = {f"E{a}{a}": -0.5 * rng.uniform(2e-3, 8e-3) for a in AXES}
    return Machine(chain, np.array(BOX, float), np.zeros(3), curves, square, half)


@cache
def covariance(family: str, name: str, count: int = 1500, cells: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """Positions (cells + 1,) over an axis, and the covariance of the curves of a family at them."""
    rng = np.random.default_rng([NAMES.index(name), 37])
    grid = np.linspace(*BOX[AXES.index(name[2])], cells + 1)
    values = np.stack(
        [_curve(rng, family, name, _joints(rng, AXES.index(name[2])))(grid) for _ in range(count)]
    )
    return grid, values.T @ values / count


def best_linear(family: str, name: str, target: np.ndarray, q: np.ndarray, runs: int = 5) -> np.ndarray:
    """(m,) standard deviation at q of the best linear estimator from targets (n,) read in both directions,
    `runs` times, as `simulated.take` reads them with no tool on lines through the datum."""
    grid, K = covariance(family, name)
    kind = class_of(name)
    n = len(target)
    order = np.tile(np.concatenate([np.arange(n), np.arange(n)[::-1]]), runs)
    at, where = np.eye(len(grid)), np.array(target)[order]
    rows = np.stack([np.interp(where, grid, column) for column in at], axis=1)
    wanted = np.stack([np.interp(q, grid, column) for column in at], axis=1)
    rng = np.random.default_rng(41)
    unit = 1e-6 if kind == "angle" else 1e-3
    drift = np.stack([2.0 * unit * drift_of(rng, np.linspace(0.0, 1.0, len(order))) for _ in range(400)])
    far = np.abs(where - target[0]) / 1000.0
    noise = unit * (1.0 if kind == "angle" else 0.5 + 0.5 * far * (kind == "straightness"))
    side = np.tile(np.repeat([1.0, -1.0], n), runs)
    free = [1e3 * unit * np.ones(len(order))]
    if kind == "straightness":
        free.append(1e-3 * where)
    if kind == "positioning":
        free += [0.5e-6 * (where - target[0]), 1e-2 * side]
    local = np.stack(free)
    inner = rows @ K @ rows.T + drift.T @ drift / len(drift) + local.T @ local
    inner += np.diag(np.broadcast_to(noise, len(order)) ** 2)
    across = wanted @ K @ rows.T
    left = np.einsum("ij,jk,ik->i", wanted, K, wanted) - np.einsum(
        "ij,ji->i", across, np.linalg.solve(inner, across.T)
    )
    return np.sqrt(np.maximum(left, 0.0))
