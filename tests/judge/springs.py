"""The judge's sagging arm: each joint is a torsion spring, and the whole rests where its energy is least.

Only heights of weights are used: the turn of a joint is its compliance times the work that a small turn of it
does against gravity, by differences, repeated until it rests. No torques, no sums of angles.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

GRAVITY = 9.80665
#: rad: half the difference by which heights are compared, and how often the rest is looked for again.
HALF, ROUNDS = 1e-4, 6

#: The joint that carries it, kg, its centre with all axes at zero in mm.
Weight = tuple[int, float, Sequence[float]]


def carried(
    directions: np.ndarray, points_mm: np.ndarray, angles_rad: np.ndarray, on: int, place_mm: Sequence[float]
) -> np.ndarray:
    """(n, 3) mm where a place of the body behind joint `on` is, at angles (n, joints)."""
    place = np.broadcast_to(np.asarray(place_mm, float), (len(angles_rad), 3))
    for joint in range(on, -1, -1):
        turn = Rotation.from_rotvec(angles_rad[:, joint, None] * directions[joint])
        place = turn.apply(place - points_mm[joint]) + points_mm[joint]
    return place


def at_rest(
    directions: np.ndarray,
    points_mm: np.ndarray,
    angles_rad: np.ndarray,
    compliance_rad_Nm: Mapping[int, float],
    weights: Sequence[Weight],
) -> np.ndarray:
    """(n, joints) rad by which the joints of an arm turn under weights; down is -Z."""

    def energy(angles: np.ndarray) -> np.ndarray:
        heights = [carried(directions, points_mm, angles, on, place)[:, 2] for on, _, place in weights]
        return sum((kg * GRAVITY * 1e-3 * h for h, (_, kg, _) in zip(heights, weights, strict=True)), 0.0)

    turned = np.zeros_like(angles_rad)
    for _ in range(ROUNDS):
        new = np.zeros_like(turned)
        for joint, compliance in compliance_rad_Nm.items():
            step = HALF * np.eye(angles_rad.shape[1])[joint]
            now = angles_rad + turned
            new[:, joint] = -compliance * (energy(now + step) - energy(now - step)) / (2.0 * HALF)
        turned = new
    return turned
