"""The motion of tool and machine as an animation of meshcat's, in real time."""

from __future__ import annotations

from typing import Any

import numpy as np

from olp.core.arrays import Array
from olp.review.notebook import drawing
from olp.review.notebook.framing import View
from olp.review.notebook.keys import key_frames
from olp.review.notebook.pictures import rgb
from olp.review.scene import Scene

#: Largest distance of an animated thing from its place, as a share of the size of the job: half a pixel.
TOLERANCE = 0.0005
#: Colour of the tip.
_TIP = "#17202b"
#: Size of the tip in pixels.
_TIP_PIXELS = 9.0


def animate(visualizer: Any, root: Any, scene: Scene, view: View, *, play: bool) -> None:
    """Put the tip at the node "tool", and load the motion: the tip moves along the nominal path, and each
    node of the machine by its axis. Times are those of the samples, in s."""
    from meshcat.animation import Animation, AnimationClip

    root["tool"]["tip"].set_object(drawing.dots(np.zeros((1, 3)), rgb([_TIP]), _TIP_PIXELS, in_front=True))
    root["tool"].set_property("position", scene.position_mm[0].tolist())
    tolerance = TOLERANCE * view.job_mm
    clips = {root["tool"].path: [_track("position", "vector3", scene.time_s, scene.position_mm, tolerance)]}
    for part in scene.nodes:
        node = root
        for name in part.path:
            node = node[name]
        place, turn = part.placed(scene.axes[:, part.axis] - scene.drawn_at[part.axis])
        clips[node.path] = [_track("position", "vector3", scene.time_s, place, tolerance)]
        if part.kind == "rotary":
            clips[node.path].append(_track("quaternion", "quaternion", scene.time_s, turn, TOLERANCE))
    # one frame is one second
    animation = Animation(
        {path: AnimationClip({t.name: t for t in tracks}, fps=1) for path, tracks in clips.items()}
    )
    visualizer.set_animation(animation, play=play)


def _track(name: str, kind: str, time_s: Array, value: Array, tolerance: float) -> Any:
    from meshcat.animation import AnimationTrack

    kept = key_frames(time_s, value, tolerance)
    values = value[kept] if value.shape[1] > 1 else value[kept, 0]
    return AnimationTrack(name, kind, np.asarray(time_s[kept], float).tolist(), values.tolist())
