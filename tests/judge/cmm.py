"""A simulated coordinate measuring machine: what it reports of points whose true places are known.

Written from the contract's definitions, without `olp`. The machine stops where the real tip centre, command
plus error, is one tip radius off the true surface point; it reports the centre of its scales less the radius
along the direction out of the surface.
"""

from __future__ import annotations

import numpy as np

from judge.model import JudgeModel


def turn(angles_deg: tuple[float, float, float]) -> np.ndarray:
    """(3, 3) about X first, then Y, then Z."""
    a, b, c = np.radians(angles_deg)
    x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    return z @ y @ x


def report(
    model: JudgeModel,
    true_mm: np.ndarray,
    normal: np.ndarray,
    *,
    offset_mm: np.ndarray,
    angles_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
    stylus_mm: np.ndarray,
    radius_mm: float,
    zero_shift_mm: np.ndarray | None = None,
    noise_mm: float = 0.0,
    seed: int = 0,
    play: bool = False,
    ram: bool = False,
) -> np.ndarray:
    """(n, 3) reported surface points, in the part frame, of true ones with directions `normal`, both (n, 3).

    `stylus_mm` (3,) or (n, 3) runs from gauge point to tip; scales count at the tip, or at the end of
    the ram.
    `zero_shift_mm` is where the part really lies off what its offset says.
    """
    rotation = turn(angles_deg)
    shift = np.zeros(3) if zero_shift_mm is None else zero_shift_mm
    centre = (true_mm + radius_mm * normal) @ rotation.T + offset_mm + shift
    state = -np.sign(np.round(normal @ rotation.T, 12)) if play else None
    arm = stylus_mm if ram else np.zeros(3)
    scales = model.command_for(centre - arm, stylus_mm, state) + arm
    scales = scales + np.random.default_rng(seed).normal(0.0, 1.0, scales.shape) * noise_mm
    return (scales - offset_mm) @ rotation - radius_mm * normal


def sphere(count: int, seed: int, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) points in a box, and unit directions."""
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=(count, 3))
    return rng.uniform(low, high, (count, 3)), normal / np.linalg.norm(normal, axis=1)[:, None]
