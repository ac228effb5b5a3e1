"""Where the camera stands: the job fills the view, with the legend at its left, whatever its size.

Meshcat's camera and lights are made for things of about a metre. So the job is scaled to that size.
Lengths of the window are in units of its height, as its width is not known.
"""

from __future__ import annotations

import math

import numpy as np

from olp.core.arrays import Array
from olp.core.values import dataclass
from olp.review.notebook.pictures import rapids, touched
from olp.review.scene import Scene

#: Vertical field of view in degrees, that of the page.
FOV_DEG = 30.0
#: From the job to the camera, in the axes of the machine: the isometric view of the page.
TOWARD = np.array([-1.0, -1.5, 1.05]) / np.linalg.norm([-1.0, -1.5, 1.05])
#: Narrowest window that all fits into: width by height.
ASPECT = 4.0 / 3.0
#: Middle of the job, to the right of the middle of the window.
SHIFT = 0.21
#: Half width and half height of what the job may fill.
ROOM = (0.43, 0.38)
#: Left and right edge of the legend, from the middle of the window.
LEGEND = (-0.655, -0.245)
#: Scene units for one unit of the window's height, at a distance of one.
WINDOW = 2.0 * math.tan(math.radians(FOV_DEG / 2.0))
#: Least extent of a framed box, as a share of its diagonal: paths may be flat or straight.
_LEAST = 0.05
#: Size in mm of a job that is a single point, that of the page.
_POINT_MM = 10.0
#: Near plane, as a share of the distance of the camera.
_NEAR = 0.02
#: Room behind the job for zooming out, as a multiple.
_FAR = 5.0
#: Gauge of meshcat's camera, to which its offset refers.
_FILM = 35.0


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A job of the size `job_mm` about `middle_mm` (3,); `distance` is that of the camera in scene units,
    `reach_mm` the distance from the middle that nothing leaves."""

    job_mm: float
    middle_mm: Array
    distance: float
    reach_mm: float

    @staticmethod
    def of(scene: Scene) -> View:
        """The view of the feed moves of a scene, else of all moves."""
        feed = touched(scene.samples.joined & ~rapids(scene))
        shown = scene.position_mm[feed] if feed.any() else scene.position_mm
        low, high = shown.min(axis=0), shown.max(axis=0)
        middle = (low + high) / 2.0
        job = float(np.linalg.norm(high - low)) or _POINT_MM
        far = float(np.linalg.norm(scene.position_mm - middle, axis=1).max())
        # bodies of the machine move with the axes, by at most the size of the path
        bodies = [np.linalg.norm(b.vertices - middle, axis=1).max() + 2.0 * far for b in scene.bodies]
        return View(job, middle, distance((high - low) / job), float(max(far, job, *bodies)))

    @property
    def unit(self) -> float:
        """Scene units of a mm."""
        return 1.0 / self.job_mm

    @property
    def matrix(self) -> Array:
        """(4, 4) from mm of the frame shown to the scene: the middle of the job is where the camera turns."""
        matrix = np.diag([self.unit, self.unit, self.unit, 1.0])
        matrix[:3, 3] = -self.unit * self.middle_mm
        return matrix

    @property
    def camera(self) -> dict[str, float]:
        """Arguments of meshcat's camera. Its offset moves the job to the right of the window's middle."""
        return {
            "fov": FOV_DEG, "aspect": ASPECT, "near": _NEAR * self.distance,
            "far": self.distance + _FAR * self.unit * self.reach_mm, "filmGauge": _FILM,
            "filmOffset": -_FILM * WINDOW * SHIFT,
        }  # fmt: skip

    @property
    def position(self) -> Array:
        """(3,) the camera in its own frame, in which y is up."""
        x, y, z = self.distance * TOWARD
        return np.array([x, z, -y])

    def window(self, point_mm: Array) -> tuple[float, float]:
        """Where a point (3,) is in the window, from its middle: to the right, and up."""
        right, up = axes()
        offset = self.unit * (point_mm - self.middle_mm)
        depth = WINDOW * (self.distance - offset @ TOWARD)
        return SHIFT + float(offset @ right / depth), float(offset @ up / depth)


def axes() -> tuple[Array, Array]:
    """(3,) right and up of the window, in the axes of the machine."""
    right = np.cross([0.0, 0.0, 1.0], TOWARD)
    right /= np.linalg.norm(right)
    return right, np.cross(TOWARD, right)


def distance(extent: Array) -> float:
    """The distance of the camera at which a box of this extent (3,) about its target fills the room."""
    half = np.maximum(extent, _LEAST) / 2.0
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    right, up = axes()
    wide, high = np.abs(corner @ right) / ROOM[0], np.abs(corner @ up) / ROOM[1]
    return float((np.maximum(wide, high) / WINDOW + corner @ TOWARD).max())
