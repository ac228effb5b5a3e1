"""A map from two pods as the paper makes it: rays meet in points, and deviations between them are linear.

Nothing is smoothed, and no model of a machine is used. The poses of the pods come from their own rays: the
rays of a point must meet, and the known distance gives the scale.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from olp.calibration.observations.pods import Pods, Pose, first_poses
from olp.core.arrays import Array
from olp.core.errors import CannotCompute
from olp.core.rigid_fit import fit_frame
from olp.core.values import dataclass

#: A known distance counts as exact within this, mm, where the poses are adjusted.
_LEAST_MM = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class PodMap:
    """Deviations (n, 3) in mm at axis positions (n, 3). Between them the error is linear, beyond them that of
    the nearest point. The tool vector changes nothing, as a map knows only the one it was measured with."""

    axis_mm: Array
    deviation_mm: Array
    _inside: Callable[[Array], Array]
    _outside: Callable[[Array], Array]

    def error(self, axis_mm: Array, tool_mm: Array) -> Array:
        """(n, 3) error in mm."""
        del tool_mm
        value = self._inside(axis_mm)
        missing = np.isnan(value).any(axis=1)
        if missing.any():
            value[missing] = self._outside(axis_mm[missing])
        return value


def pod_map(pods: Pods) -> PodMap:
    """The map of one set of directions from two pods or more. Raises CannotCompute where the rays of one pod
    alone make no points, and where all points lie in a plane."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
    from scipy.spatial import QhullError

    if pods.count < 2:
        raise CannotCompute("a map needs the rays of two pods or more, and there is one")
    place = triangulated(pods, adjusted(pods))
    nominal = pods.axis_mm + pods.tool_mm
    deviation = np.asarray(fit_frame(place, nominal)(place) - nominal)
    try:
        inside = LinearNDInterpolator(pods.axis_mm, deviation, rescale=True)
    except QhullError:
        raise CannotCompute("the points of the pods lie in a plane; a map needs a volume") from None
    return PodMap(pods.axis_mm, deviation, inside, NearestNDInterpolator(pods.axis_mm, deviation))


def adjusted(pods: Pods) -> tuple[Pose, ...]:
    """Poses at which the rays of each point meet best and known distances are kept; the first pod stays where
    the nominal points put it. Without a known distance the nominal one between the first two is kept."""
    from scipy.optimize import least_squares

    start = first_poses(pods)
    apart = float(np.linalg.norm(start[1].place_mm - start[0].place_mm))
    baselines = pods.baselines or ((0, 1, apart, _LEAST_MM),)

    def moved(unknowns: Array) -> tuple[Pose, ...]:
        steps = unknowns.reshape(-1, 6)
        others = [pose.moved(step) for pose, step in zip(start[1:], steps, strict=True)]
        return start[0], *others

    def misses(unknowns: Array) -> Array:
        poses = moved(unknowns)
        place = triangulated(pods, poses)
        rows = []
        for k, pose in enumerate(poses):
            to_point = place - pose.place_mm
            ray = _rays(pods, k, pose)
            across = to_point - (to_point * ray).sum(axis=1)[:, None] * ray
            rows.append((across / np.linalg.norm(to_point, axis=1)[:, None] / pods.sigma).ravel())
        for i, j, length, sigma in baselines:
            distance = float(np.linalg.norm(poses[j].place_mm - poses[i].place_mm))
            rows.append(np.array([(distance - length) / max(sigma, _LEAST_MM)]))
        return np.concatenate(rows)

    solved = least_squares(misses, np.zeros(6 * (pods.count - 1)), x_scale=1.0)
    return moved(np.asarray(solved.x, float))


def triangulated(pods: Pods, poses: tuple[Pose, ...]) -> Array:
    """(n, 3) points in mm that the rays pass with the least sum of squares of angles."""
    n = len(pods.axis_mm)
    table, right = np.zeros((n, 3, 3)), np.zeros((n, 3))
    nominal = pods.axis_mm + pods.tool_mm
    for k, pose in enumerate(poses):
        ray = _rays(pods, k, pose)
        across = np.eye(3) - ray[:, :, None] * ray[:, None, :]
        across /= ((nominal - pose.place_mm) ** 2).sum(axis=1)[:, None, None]
        table += across
        right += across @ pose.place_mm
    return np.asarray(np.linalg.solve(table, right[:, :, None])[:, :, 0])


def _rays(pods: Pods, k: int, pose: Pose) -> Array:
    """(n, 3) directions of a pod in the machine's frame."""
    azimuth, elevation = pods.azimuth_rad[:, k], pods.elevation_rad[:, k]
    flat = np.cos(elevation)
    own = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])
    return np.asarray(own @ pose.rotation)
