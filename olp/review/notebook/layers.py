"""A review in a meshcat visualizer: its pictures, its bodies, its motion, and the camera on them."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np

from olp.core.errors import UsageError
from olp.core.values import dataclass
from olp.review.job import Review
from olp.review.notebook import drawing
from olp.review.notebook.framing import LEGEND, SHIFT, View
from olp.review.notebook.legend import Legend, board, callout
from olp.review.notebook.motion import animate
from olp.review.notebook.pictures import MOST, Picture, names_of, pictures_of, rapids, rgb, segments
from olp.review.scene import Scene

#: The picture that is shown first.
_FIRST = "corrected"
_NOMINAL = "#a3adba"
_RAPID = "#ccd3db"
_COMMAND = "#8c60a2"
#: Largest opacity by role of what is in front of the path.
_MOST_OPAQUE = {"machine": 0.13, "tool": 0.3}
#: Turn of meshcat's node of the camera, whose y is up.
_UPRIGHT = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
#: Width of the enlarged path in pixels: lines of the browser have one pixel.
_WIDE = 2.5
#: Colours of the ground of the scene, above and below, from 0 to 1.
_GROUND = {"top_color": [0.984, 0.988, 0.996], "bottom_color": [0.89, 0.914, 0.941]}


@dataclass(frozen=True, slots=True, eq=False)
class Layers:
    """The pictures of a review in a visualizer, by name: `legends` says what each shows."""

    legends: Mapping[str, Legend]
    _root: Any
    _shown: list[str]

    @property
    def shown(self) -> str:
        """The name of the picture that was shown last."""
        return self._shown[0]

    def show(self, picture: str) -> None:
        """Show one picture alone. Raises UsageError for one that is not there."""
        _refuse_unknown(picture, list(self.legends))
        for name in self.legends:
            self._root[name].set_property("visible", name == picture)
        self._shown[:] = [picture]

    def _repr_html_(self) -> str:
        """The legend of the picture shown, for a notebook."""
        return self.legends[self.shown]._repr_html_()


def add_layers(
    visualizer: Any,
    review: Review,
    *,
    exaggeration: float | None = None,
    under: str = "olp",
    picture: str = _FIRST,
    play: bool = False,
) -> Layers:
    """Show a review in a `meshcat.Visualizer`, below the node `under`, in place of what was there.

    One of the pictures "uncorrected", "corrected" and "measured" ("measured-1" and so on where there are
    several runs) is shown, the others are nodes of the same name to switch on. A picture is the enlarged path
    and whiskers from the nominal path to it, coloured by bands of the deviation, with its legend and its
    worst place. `exaggeration` enlarges the deviations of all; without it each picture has a round factor of
    its own, at which its largest deviation is about 3 % of the size of the job. The corrected command is the
    node "command", not shown. Below `under` lengths are mm of the frame of the program.

    The camera is set to the job, in windows of 4:3 or wider, and meshcat's grid and axes are hidden. The
    motion of tool and machine is loaded as animation in real time. With `play` it starts; else "play" in
    meshcat's controls starts it, and the slider of the time follows only after that.

    Returns the `Layers`, which a notebook shows as the legend. Raises UsageError for an exaggeration that is
    not a number of 0 or above, and for a picture that is not there.
    """
    number = isinstance(exaggeration, Real) and np.isfinite(exaggeration) and exaggeration >= 0.0
    if exaggeration is not None and not number:
        raise UsageError(f"the exaggeration is {exaggeration}; expected a number of 0 or above")
    scene = review.scene
    _refuse_unknown(picture, names_of(scene))
    view, root = View.of(scene), visualizer[under]
    root.delete()
    root.set_transform(view.matrix)
    pictures = {p.name: p for p in pictures_of(scene, view.job_mm, exaggeration)}
    _put_paths(root, scene, pictures["uncorrected"].exaggeration)
    legends = {name: Legend.of(one, scene) for name, one in pictures.items()}
    for name, one in pictures.items():
        _put_picture(root[name], one, legends[name], view)
    _put_bodies(root, scene)
    animate(visualizer, root, scene, view, play=play)
    _set_stage(visualizer, view)
    layers = Layers(legends, root, [picture])
    layers.show(picture)
    return layers


def _refuse_unknown(picture: str, names: list[str]) -> None:
    if picture not in names:
        raise UsageError(f"there is no picture {picture!r}; expected one of {', '.join(names)}")


def _put_paths(root: Any, scene: Scene, exaggeration: float) -> None:
    """The nominal path, its rapids, and the corrected command, which is not shown."""
    rapid, joined = rapids(scene), scene.samples.joined
    points, command = scene.position_mm, scene.position_mm + exaggeration * scene.samples.correction
    for name, base, drawn, colour in (
        ("nominal", points, joined & ~rapid, _NOMINAL),
        ("rapids", points, joined & rapid, _RAPID),
        ("command", command, joined & ~rapid, _COMMAND),
    ):
        ends = segments(drawn, MOST)
        root[name].set_object(drawing.lines(base[ends], rgb([colour])))
    root["command"].set_property("visible", False)


def _put_picture(node: Any, picture: Picture, legend: Legend, view: View) -> None:
    colours = rgb(picture.colours)
    enlarged = picture.enlarged_mm
    ends, band = picture.path(MOST)
    node["path"].set_object(drawing.lines(enlarged[ends], colours[band]))
    points, own = picture.dots(view.job_mm, MOST)
    node["wide"].set_object(drawing.dots(points, colours[own], _WIDE))
    which = picture.whiskers(view.job_mm, MOST)
    both = np.stack((picture.base_mm[which], enlarged[which]), axis=1)
    node["whiskers"].set_object(drawing.lines(both, colours[picture.bands(picture.size_um[which])]))
    left, right = (edge - SHIFT for edge in LEGEND)
    drawing.put_image(node["legend"], board(legend, left, right), view.middle_mm, view)
    if picture.worst is not None:
        place = enlarged[picture.worst]
        to_right = view.window(place)[0] < SHIFT
        drawing.put_image(node["worst"], callout(picture.flag, to_right=to_right), place, view)


def _put_bodies(root: Any, scene: Scene) -> None:
    for body in scene.bodies:
        node = root
        for name in (*(body.path or (body.role,)), body.name):
            node = node[name]
        opacity = min(body.opacity, _MOST_OPAQUE.get(body.role, 1.0))
        node.set_object(*drawing.solid(body.vertices, body.faces, body.colour, opacity))


def _set_stage(visualizer: Any, view: View) -> None:
    # meshcat's viewer fails where a camera is replaced twice, so its node is made new, with its turn about X
    node = visualizer["/Cameras/default/rotated"]
    node.delete()
    node.set_transform(_UPRIGHT)
    node.set_object(drawing.camera(view))
    for name in ("/Grid", "/Axes"):
        visualizer[name].set_property("visible", False)
    for key, colour in _GROUND.items():
        visualizer["/Background"].set_property(key, colour)
