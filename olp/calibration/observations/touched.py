"""Touches of a probe to centres of spheres and holes and to places of faces, by least squares.

The effective radius of the tip differs from its size by the travel until the probe answers. It is found along
X and along Y from all spheres and holes together, and taken as their mean along Z.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from olp.calibration.design.probing import Aimed, Feature, Probing
from olp.core.arrays import Array, Index
from olp.core.errors import CannotCompute
from olp.core.values import dataclass

#: Steps of Gauss-Newton at most, and the change in mm at which they end.
_STEPS = 20
_STILL_MM = 1e-9
#: The effective radius along Z is the mean of those along X and Y within this share of their uncertainty.
_SHARES = np.array([(1.0, 0.0), (0.0, 1.0), (0.5, 0.5)])


@dataclass(frozen=True, slots=True, eq=False)
class Touched:
    """What touches show. `pose`, `feature` (m,) and `place_mm` (m, 3) of the centre of each sphere and hole,
    and of each face; `covariance_mm2` (m, 3, 3). A face shows the coordinate along its axis only, and the
    others of `place_mm` are where it was touched. `radius_mm` (2,) are the effective radii of the tip along
    X and Y and `sigma_radius_mm` their uncertainty. `residual_mm` (n,) is what is left at each touch,
    `sigma_mm` the uncertainty of a touch that was used, `free` the number of touches beyond unknowns."""

    pose: Index
    feature: Index
    place_mm: Array
    covariance_mm2: Array
    radius_mm: Array
    sigma_radius_mm: Array
    residual_mm: Array
    sigma_mm: float
    free: int


def fit_touches(probing: Probing, aimed: Sequence[Aimed], tip_mm: Sequence[Array]) -> Touched:
    """Centres and places from the places of the tip (n, 3) at the touches of each pose.

    Raises CannotCompute where the touches determine no centre.
    """
    problem = _Problem.of(probing, aimed, tip_mm)
    m = 3 * len(problem.keys)
    known = np.zeros((2, problem.size))
    known[:, -2:] = np.eye(2) / probing.sigma_radius_mm
    unknowns = problem.start(probing.radius_mm)
    for _ in range(_STEPS):
        rows, rest = problem.rows(unknowns)
        before = (probing.radius_mm - unknowns[-2:]) / probing.sigma_radius_mm
        table = np.concatenate([rows / probing.sigma_mm, known, problem.hidden])
        right = np.concatenate([rest / probing.sigma_mm, before, np.zeros(len(problem.hidden))])
        step, _, rank, _ = np.linalg.lstsq(table, right, rcond=1e-12)
        if rank < problem.size:
            raise CannotCompute("the touches do not determine every centre; touch all that the program names")
        unknowns = unknowns + step
        if np.abs(step).max() < _STILL_MM:
            break
    rest = problem.rows(unknowns)[1]
    # the effective radii are known before, as well as they are unknown
    free = len(rest) - (problem.size - 2 - len(problem.hidden))
    scatter = float(np.sqrt(rest @ rest / free)) if free > 0 else 0.0
    sigma = max(probing.sigma_mm, scatter)
    covariance = np.linalg.inv(table.T @ table) * (sigma / probing.sigma_mm) ** 2
    blocks = np.stack([covariance[k : k + 3, k : k + 3] for k in range(0, m, 3)])
    return Touched(
        np.array([p for p, _ in problem.keys]), np.array([f for _, f in problem.keys]),
        unknowns[:m].reshape(-1, 3), blocks, unknowns[-2:], np.sqrt(np.diag(covariance)[-2:]), rest, sigma,
        free,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """Touches (n,) and what they may show. `keys` are pose and feature of each centre or face, `owner` (n,)
    the one that was touched. The unknowns are their places, two slopes of the face around each hole, and the
    effective radii. `hidden` (h, unknowns) keeps the places along a face, which no touch shows."""

    keys: tuple[tuple[int, int], ...]
    features: tuple[Feature, ...]
    owner: Index
    part: np.ndarray
    normal: Array
    tip: Array
    slope: Index
    hidden: Array

    @staticmethod
    def of(probing: Probing, aimed: Sequence[Aimed], tip_mm: Sequence[Array]) -> _Problem:
        keys = tuple((p, f) for p, one in enumerate(aimed) for f in dict.fromkeys(one.feature))
        index = {key: k for k, key in enumerate(keys)}
        owner = np.array([index[p, f] for p, one in enumerate(aimed) for f in one.feature])
        normal = np.concatenate([one.normal for one in aimed])
        features = tuple(probing.features[f] for _, f in keys)
        holes = np.array([feature.kind == "hole" for feature in features])
        slope = np.where(holes, 3 * len(keys) + 2 * (np.cumsum(holes) - 1), -1)
        size = 3 * len(keys) + 2 * int(holes.sum()) + 2
        along = [
            3 * k + other
            for k, feature in enumerate(features)
            if feature.kind == "face"
            for other in range(3)
            if other != int(np.abs(normal[owner == k][0]).argmax())
        ]
        part = np.array([name for one in aimed for name in one.part])
        return _Problem(
            keys, features, owner, part, normal, np.concatenate(tip_mm), slope, np.eye(size)[along]
        )

    @property
    def size(self) -> int:
        return int(self.hidden.shape[1])

    def start(self, radius_mm: float) -> Array:
        """The unknowns to begin with."""
        unknowns = np.zeros(self.size)
        unknowns[-2:] = radius_mm
        for k, feature in enumerate(self.features):
            own, part = self.tip[self.owner == k], self.part[self.owner == k]
            middle = own.mean(axis=0)
            if feature.kind == "sphere":
                # touches come in pairs from both sides, and one from above
                flat = own[:4].mean(axis=0)
                middle = np.array([*flat[:2], own[-1, 2] - radius_mm - 0.5 * feature.diameter_mm])
            elif feature.kind == "hole":
                flat = own[part == "wall"].mean(axis=0)
                middle = np.array([*flat[:2], own[part == "face", 2].mean() - radius_mm])
            unknowns[3 * k : 3 * k + 3] = middle
        return unknowns

    def rows(self, unknowns: Array) -> tuple[Array, Array]:
        """(n, unknowns) what each unknown does to the distance of the tip from its surface, and what that
        distance has beyond the effective radius (n,)."""
        n = len(self.tip)
        place = unknowns[: 3 * len(self.keys)].reshape(-1, 3)
        arm = self.tip - place[self.owner]
        wall, face = self.part == "wall", self.part == "face"
        first = self.slope[self.owner]
        hole = first >= 0
        normal = self.normal.copy()
        normal[hole] = np.stack(
            [-unknowns[first[hole]], -unknowns[first[hole] + 1], np.ones(int(hole.sum()))], axis=1
        )
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        height = (arm * normal).sum(axis=1)
        aside = np.where(wall[:, None], arm - height[:, None] * normal, arm)
        length = np.where(face, 1.0, np.linalg.norm(aside, axis=1))
        way = np.where(face[:, None], normal, aside / length[:, None])
        size = np.array([0.5 * feature.diameter_mm for feature in self.features])[self.owner]
        sign = np.where(wall, -1.0, 1.0)
        # the share of each effective radius, by the direction of the touch
        share = (way * way) @ _SHARES
        rest = np.where(face, height, length - size) - sign * (share @ unknowns[-2:])
        rows = np.zeros((n, self.size))
        np.put_along_axis(rows, 3 * self.owner[:, None] + np.arange(3), way, axis=1)
        turned = np.where(wall[:, None], -height[:, None] * way, arm)[:, :2]
        rows[np.flatnonzero(hole)[:, None], first[hole][:, None] + np.arange(2)] = turned[hole]
        rows[:, -2:] = sign[:, None] * share
        return rows, rest
