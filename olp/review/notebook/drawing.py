"""Shapes of meshcat: lines with colours, solids, images that face the camera, and the camera itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.review.notebook.framing import WINDOW, View
from olp.review.notebook.legend import Image

#: three.js' number for the front side of faces.
_FRONT = 0
#: Order of drawing of what is in front of all else; 0 is that of bodies.
_IN_FRONT = 2
#: three.js' number for both sides of faces.
_BOTH = 2


def lines(ends_mm: Array, colours: npt.NDArray[np.float32]) -> Any:
    """Segments with ends (m, 2, 3), each in its colour (m, 3), or all in one (1, 3)."""
    from meshcat import geometry

    place = ends_mm.reshape(-1, 3).astype(np.float32).T
    if len(colours) == len(ends_mm):
        shape = geometry.PointsGeometry(place, np.repeat(colours, 2, axis=0).T)
        return geometry.LineSegments(shape, geometry.LineBasicMaterial(vertexColors=True))
    red, green, blue = np.round(255.0 * colours[0]).astype(int).tolist()
    material = geometry.LineBasicMaterial(color=red << 16 | green << 8 | blue)
    return geometry.LineSegments(geometry.PointsGeometry(place), material)


def dots(points_mm: Array, colours: npt.NDArray[np.float32], pixels: float, *, in_front: bool = False) -> Any:
    """Points (n, 3) with colours (n, 3) and a size in pixels; those in front of all else are never hidden."""
    from meshcat import geometry

    material = geometry.MeshBasicMaterial(
        vertexColors=True, size=pixels, sizeAttenuation=False, depthTest=not in_front, transparent=in_front
    )
    material._type = "PointsMaterial"
    shape = geometry.PointsGeometry(points_mm.astype(np.float32).T, colours.T)
    return _with(geometry.Points(shape, material), renderOrder=_IN_FRONT if in_front else 0)


def solid(vertices_mm: Array, faces: npt.NDArray[np.int64], colour: str, opacity: float) -> tuple[Any, Any]:
    """A body of (v, 3) vertices and (f, 3) faces, and its material; what is behind shines through."""
    from meshcat import geometry

    # separate corners, so that each face has its own normal
    shape = geometry.TriangularMeshGeometry(
        vertices_mm[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    )
    clear = opacity < 1.0
    material = geometry.MeshLambertMaterial(
        color=int(colour[1:], 16), opacity=opacity, transparent=clear, depthWrite=not clear,
        side=_FRONT if clear else _BOTH,
        # pushed back a little, so that paths on a face are in front of it
        polygonOffset=True, polygonOffsetFactor=1, polygonOffsetUnits=2,
    )  # fmt: skip
    return shape, material


def put_image(node: Any, image: Image, place_mm: Array, view: View) -> None:
    """Put an image with its middle at a place (3,). It faces the camera, and keeps its size in the window."""
    from meshcat import geometry

    texture = geometry.ImageTexture(geometry.PngImage(image.png))
    material = geometry.MeshBasicMaterial(
        map=texture, transparent=True, sizeAttenuation=False, depthTest=False, depthWrite=False
    )
    # a sprite of three.js, which meshcat passes on; its geometry is not used
    material._type = "SpriteMaterial"
    sprite = geometry.Object(geometry.PointsGeometry(np.zeros((3, 1), np.float32)), material)
    sprite._type = "Sprite"
    node.set_object(_with(sprite, renderOrder=_IN_FRONT))
    size = WINDOW / view.unit * np.array([image.width, image.height, 1.0])
    matrix = np.diag([*size, 1.0])
    matrix[:3, 3] = place_mm
    node.set_transform(matrix)


def camera(view: View) -> Any:
    """meshcat's camera where the view has it, in one message: a message for its place alone could come
    before the camera."""
    from meshcat import geometry

    matrix = np.eye(4)
    matrix[:3, 3] = view.position
    return _with(geometry.PerspectiveCamera(**view.camera), matrix=matrix.T.ravel().tolist())


def _with(shape: Any, **keys: Any) -> Any:
    """A shape with more keys of three.js' object, which meshcat's Python does not know."""
    lower = shape.lower

    def extended() -> dict[str, Any]:
        data: dict[str, Any] = lower()
        data["object"].update(keys)
        return data

    shape.lower = extended
    return shape
