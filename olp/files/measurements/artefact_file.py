"""Reads an artefact that the machine touches with its own probe: olp-artefact-1."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np

from olp.calibration.design.probing import Feature, Pose, Probing
from olp.core.machine import Vector
from olp.core.patterns import pattern
from olp.core.rigid_fit import Rigid, rotation_of
from olp.core.schema import NotNegative, Positive, Table, Text, Triple
from olp.core.schema_keys import Field
from olp.core.units import MM_PER_UM
from olp.files.problems import Problem, config_error, validate
from olp.files.toml_text import line_of, read_toml
from olp.files.write import PathLike, read_bytes

#: Names that every control takes in a comment, and DMIS as a label.
_NAME = pattern(rb"[A-Za-z][A-Za-z0-9-]*\Z")
#: Touches on a sphere: around it and on top, or with four more between.
TOUCHES = (5, 9)
#: A direction has a length of 1 within this.
_UNIT = 1e-3


class FeatureTable(Table):
    name: Text = Field(description="its name: letters, digits and hyphens, such as B1")
    kind: Literal["sphere", "hole", "face"] = Field(description='"sphere", "hole" or "face"')
    place_mm: Triple = Field(
        description="the centre of a sphere, the middle of a hole in the face around it, or a place on a "
        "face, [X, Y, Z] in mm in the frame of the artefact"
    )
    diameter_mm: Positive | None = Field(default=None, description="the diameter of a sphere or hole, in mm")
    depth_mm: Positive | None = Field(
        default=None, description="how deep below its face the wall of a hole is touched, in mm"
    )
    direction: Triple | None = Field(
        default=None, description="the direction out of a face, [X, Y, Z] of length 1; of a hole [0, 0, 1]"
    )
    sigma_um: NotNegative | None = Field(
        default=None,
        description="the standard uncertainty of a coordinate of its place, in um; that of the artefact if "
        "left out",
    )
    count: int = Field(
        default=1, description="how many there are in a row; they are named B1-1, B1-2 and so on"
    )
    step_mm: Triple = Field(
        default=(0.0, 0.0, 0.0), description="the way from each of them to the next, [X, Y, Z] in mm"
    )


class PoseTable(Table):
    origin_mm: Triple = Field(
        description="the place of the artefact's origin: axis positions plus tool_mm there, [X, Y, Z] in mm"
    )
    turn_deg: Triple = Field(
        default=(0.0, 0.0, 0.0),
        description="the turns about X, then Y, then Z of the machine, [A, B, C] in degrees",
    )
    turned_over: bool = Field(
        default=False, description="whether a straightedge was turned over about its length"
    )


class ArtefactFile(Table):
    """olp-artefact-1: an artefact, how it lies on the machine, and the probe that touches it."""

    schema_: Literal["olp-artefact-1"] = Field(alias="schema", description='the format, "olp-artefact-1"')
    name: Text = Field(description="the name of the artefact")
    tool_mm: Triple = Field(
        description="the vector from the gauge point to the centre of the tip, [X, Y, Z] in mm"
    )
    tip_diameter_mm: Positive = Field(description="the diameter of the tip of the stylus, in mm")
    sigma_radius_um: Positive = Field(
        default=20.0, description="the standard uncertainty of the effective radius of the tip, in um"
    )
    sigma_touch_um: Positive = Field(description="the standard uncertainty of a touch, in um")
    sigma_certificate_um: NotNegative = Field(
        default=0.0,
        description="the standard uncertainty of a coordinate of the artefact, in um; 0: as drawn",
    )
    approach_mm: Positive = Field(
        default=5.0, description="how far before a surface a touch begins, and behind it gives up, in mm"
    )
    clear_mm: Positive = Field(
        default=20.0, description="the height above all features where nothing is in the way, in mm"
    )
    feed_mm_min: Positive = Field(default=60.0, description="the feed of a touch, in mm/min")
    sphere_touches: int = Field(
        default=5, description="touches on each sphere: 5 (four around it, one from above), or 9"
    )
    features: list[FeatureTable] = Field(description="tables [[features]]")
    poses: list[PoseTable] = Field(description="tables [[poses]]: how the artefact lies, one after the other")


def load_artefact(path: PathLike) -> Probing:
    """The artefact of a file. Raises InputError, ConfigError with every problem."""
    values, lines = read_toml(read_bytes(path), str(path))
    stated = validate(ArtefactFile, values, lines, str(path))
    problems = [
        *(
            (line_of(("features", k), lines), f"features[{k}] {sentence}")
            for k, table in enumerate(stated.features)
            for sentence in _feature_problems(table, stated)
        ),
        *_whole_problems(stated),
    ]
    if problems:
        raise config_error(problems, str(path))
    features = tuple(one for table in stated.features for one in _features(table, stated))
    names = [feature.name for feature in features]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise config_error([(None, f'feature "{name}" is stated twice') for name in twice], str(path))
    return Probing(
        name=stated.name,
        features=features,
        poses=tuple(Pose(_frame(table), table.turned_over) for table in stated.poses),
        tool_mm=stated.tool_mm,
        radius_mm=0.5 * stated.tip_diameter_mm,
        approach_mm=stated.approach_mm,
        clear_mm=stated.clear_mm,
        sigma_mm=stated.sigma_touch_um * MM_PER_UM,
        sigma_radius_mm=stated.sigma_radius_um * MM_PER_UM,
        feed_mm_min=stated.feed_mm_min,
    )


def _whole_problems(stated: ArtefactFile) -> Iterator[Problem]:
    if stated.sphere_touches not in TOUCHES:
        yield None, f"sphere_touches = {stated.sphere_touches}; expected 5 or 9"
    if not stated.features:
        yield None, "features is empty; expected at least one table [[features]]"
    if not stated.poses:
        yield None, "poses is empty; expected at least one table [[poses]]"


def _feature_problems(table: FeatureTable, stated: ArtefactFile) -> Iterator[str]:
    """What is wrong with a feature beyond its types."""
    if not _NAME.match(table.name.encode()):
        yield f'name = "{table.name}"; expected a letter, then letters, digits and hyphens'
    if table.count < 1:
        yield f"count = {table.count}; expected 1 or more"
    elif table.count > 1 and not any(table.step_mm):
        yield "step_mm is missing; expected the way to the next feature, because count is above 1"
    for key, kinds in (
        ("diameter_mm", ("sphere", "hole")),
        ("depth_mm", ("hole",)),
        ("direction", ("face",)),
    ):
        given = getattr(table, key) is not None
        if given != (table.kind in kinds):
            yield f"{key} is {'of' if given else 'missing; expected it for'} a {table.kind}" + (
                f"; expected it for a {' or a '.join(kinds)} only" if given else ""
            )
    if table.direction is not None and abs(float(np.linalg.norm(table.direction)) - 1.0) > _UNIT:
        yield "direction is not of length 1"
    if table.diameter_mm is None:
        return
    radius, tip = 0.5 * table.diameter_mm, 0.5 * stated.tip_diameter_mm
    if table.kind == "hole" and radius <= tip + stated.approach_mm:
        yield (
            f"diameter_mm = {table.diameter_mm:g} leaves no room for the tip; expected more than "
            f"{2.0 * (tip + stated.approach_mm):g}, or a smaller approach_mm"
        )
    if table.kind == "sphere" and radius <= stated.approach_mm:
        yield (
            f"approach_mm = {stated.approach_mm:g} goes beyond the middle of a sphere of "
            f"{table.diameter_mm:g} mm; expected less than {radius:g}"
        )


def _features(table: FeatureTable, stated: ArtefactFile) -> Iterator[Feature]:
    """The features of a row."""
    sigma = stated.sigma_certificate_um if table.sigma_um is None else table.sigma_um
    for k in range(table.count):
        x, y, z = (p + k * s for p, s in zip(table.place_mm, table.step_mm, strict=True))
        yield Feature(
            name=table.name if table.count == 1 else f"{table.name}-{k + 1}",
            kind=table.kind,
            place_mm=(x, y, z),
            diameter_mm=table.diameter_mm or 0.0,
            direction=table.direction or (0.0, 0.0, 1.0),
            depth_mm=table.depth_mm or 0.0,
            touches=stated.sphere_touches,
            sigma_mm=sigma * MM_PER_UM,
        )


def _frame(table: PoseTable) -> Rigid:
    a, b, c = (
        rotation_of(np.radians(angle) * axis) for angle, axis in zip(table.turn_deg, np.eye(3), strict=True)
    )
    origin: Vector = table.origin_mm
    return Rigid(c @ b @ a, np.array(origin))
