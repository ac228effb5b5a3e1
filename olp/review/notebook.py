"""The layers of a review in a meshcat visualizer, for notebooks and scripts."""

from __future__ import annotations

from typing import Any

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.errors import UsageError
from olp.review.job import Review
from olp.review.manifest import LAYERS

#: Metres per mm: meshcat's camera and lights are made for metres.
_METRE = 1e-3
#: Most samples of a layer, as it is one message to the browser; of longer paths every k-th is drawn.
_MOST = 200_000


def add_layers(visualizer: Any, review: Review, *, exaggeration: float = 1000.0, under: str = "olp") -> None:
    """Add paths and bodies of a review to a `meshcat.Visualizer`, below the node `under`.

    Each layer is a separate node (`olp/nominal`, `olp/result` ...) in metres, at the nominal path plus its
    deviations times `exaggeration`. Raises UsageError for an exaggeration that is not a number of 0 or above.
    """
    if not (np.isfinite(exaggeration) and exaggeration >= 0.0):
        raise UsageError(f"the exaggeration is {exaggeration}; expected a number of 0 or above")
    import meshcat.geometry as shapes

    scene = review.scene
    centre = np.round(scene.position_mm.mean(axis=0))
    root = visualizer[under]
    deltas = {
        "nominal": np.zeros((1, 3)),
        "uncorrected": scene.samples.uncorrected,
        "command": scene.samples.correction,
        "corrected": scene.samples.corrected,
    }
    for name, _, colour, _ in LAYERS:
        points = scene.position_mm - centre + exaggeration * deltas[name]
        _put(root[name], shapes, _segments(points, scene.samples.joined), colour)
    for k, measured in enumerate(scene.measured):
        points = measured.base_mm - centre + exaggeration * measured.delta_mm
        lines = _segments(points, np.arange(len(points)) > 0)
        _put(root[f"measured-{k + 1}"], shapes, lines, MEASURED[k % len(MEASURED)])
    for body in scene.bodies:
        mesh = shapes.TriangularMeshGeometry((body.vertices - centre) * _METRE, body.faces)
        material = shapes.MeshLambertMaterial(
            color=int(body.colour[1:], 16), opacity=body.opacity, transparent=True
        )
        root["bodies"][body.name].set_object(mesh, material)


def _segments(points: Array, joined: Mask) -> Array:
    """(3, 2 m) starts and ends of segments along samples, in metres; gaps are not bridged."""
    every = -(-len(points) // _MOST)
    begins = ~joined
    keep = (np.arange(len(points)) % every == 0) | begins | np.append(begins[1:], True)
    kept, run = points[keep], np.cumsum(begins)[keep]
    end = np.flatnonzero(np.diff(run, prepend=-1) == 0)
    pairs = np.stack((kept[end - 1], kept[end]), axis=1).reshape(-1, 3)
    return np.asarray(pairs.T * _METRE)


def _put(node: Any, shapes: Any, points: Array, colour: str) -> None:
    material = shapes.LineBasicMaterial(color=int(colour[1:], 16))
    node.set_object(shapes.LineSegments(shapes.PointsGeometry(points.astype(np.float32)), material))
