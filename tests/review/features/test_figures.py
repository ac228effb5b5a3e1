"""Figures of features against closed forms: what a shift, a scale, a shear and a sag must show."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from cases.part_features import bent, figures, nodes_of, one, scene_of
from judge.machines import zero_machine

from olp.review.scene import Scene

CIRCLE = "G0 X70 Y40\nG1 Z-1\nG3 I-30\nG0 Z20"
WALL = "G0 X10 Y40\nG1 Z-1\nX110"
#: facing passes 8 mm apart with a tool of 10 mm
PASSES = "\n".join(f"G1 Y{8 * k}\nX{80 if k % 2 == 0 else 0}" for k in range(11))
FLAT = f"G0 X0 Y0\nG1 Z-2\n{PASSES}"
SQUARE = "G0 X10 Y10\nG1 Z-1\nX50\nY40\nX10\nY10\nG0 Z20"
HOLES = "G81 G99 X20 Y30 Z-12 R2\nX60\nG80"
SHIFT = np.array((0.012, -0.005, 0.007))


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    yield zero_machine(tmp_path_factory.mktemp("machine"))


@pytest.fixture(scope="module")
def scenes(machine: Path) -> dict[str, Scene]:
    texts = {"circle": CIRCLE, "wall": WALL, "flat": FLAT, "contour": SQUARE, "hole": HOLES}
    return {kind: scene_of(text, machine) for kind, text in texts.items()}


def constant(shift_mm: np.ndarray) -> object:
    return lambda p: np.tile(shift_mm, (len(p), 1))


def approx(value: float, tolerance: float = 1e-3) -> object:
    return pytest.approx(value, abs=tolerance)


def test_a_shift_moves_positions_and_no_form(scenes: dict[str, Scene]) -> None:
    moved = {kind: bent(scene, constant(SHIFT)) for kind, scene in scenes.items()}  # type: ignore[arg-type]
    across = float(np.hypot(12.0, 5.0))
    circle = figures(one(moved["circle"], "circle"))
    assert circle == {"position": approx(across), "size": approx(0.0), "form": approx(0.0)}
    wall = figures(one(moved["wall"], "wall"))
    assert wall == {"position": approx(-5.0), "form": approx(0.0), "angle": approx(0.0)}
    assert figures(one(moved["flat"], "flat")) == {"position": approx(7.0), "form": approx(0.0)}
    # the profile has nothing removed: the larger of both parts of the shift is normal to a side
    assert figures(one(moved["contour"], "contour")) == {"position": approx(across), "form": approx(12.0)}
    for hole in nodes_of(moved["hole"], "hole"):
        assert figures(hole) == {"position": approx(across), "depth": approx(7.0)}
    assert figures(one(moved["circle"], "circle"), "corrected")["position"] == approx(0.0)


def test_a_scale_error_changes_the_diameter(scenes: dict[str, Scene]) -> None:
    scaled = bent(scenes["circle"], lambda p: 1e-4 * p)
    # the diameter of 60 mm by 1e-4, the centre (40, 40) by its own distance
    expected = {"position": approx(5.65685), "size": approx(6.0), "form": approx(0.0)}
    assert figures(one(scaled, "circle")) == expected


def test_a_squareness_error_makes_an_ellipse(scenes: dict[str, Scene]) -> None:
    def shear(p: np.ndarray) -> np.ndarray:
        return np.stack((-1e-4 * (p[:, 1] - 40.0), 0.0 * p[:, 1], 0.0 * p[:, 1]), axis=1)

    # radial deviation -g R sin(2 t) / 2: its range is g R, and its mean 0; g^2 R is 0.3 nm
    found = figures(one(bent(scenes["circle"], shear), "circle"))
    assert found == {"position": approx(0.0), "size": approx(0.0), "form": approx(3.0, 2e-3)}


def test_a_large_shift_leaves_a_circle_round(scenes: dict[str, Scene]) -> None:
    far = bent(scenes["circle"], constant(np.array((1.0, 0.0, 0.0))))  # type: ignore[arg-type]
    expected = {"position": approx(1000.0), "size": approx(0.0), "form": approx(0.0)}
    assert figures(one(far, "circle")) == expected


def sag(p: np.ndarray, height_mm: float, axis: int) -> np.ndarray:
    """A parabola over X from 10 to 110, 0 at its ends."""
    share = (p[:, 0] - 60.0) / 50.0
    result = np.zeros_like(p)
    result[:, axis] = height_mm * (1.0 - share**2)
    return result


def test_a_sag_gives_a_wall_its_straightness(scenes: dict[str, Scene]) -> None:
    # the least-squares line of a parabola is level at two thirds of its height, so the range is the height
    found = figures(one(bent(scenes["wall"], lambda p: sag(p, 0.01, 1)), "wall"))
    assert found == {"position": approx(6.6667, 0.01), "form": approx(10.0, 0.15), "angle": approx(0.0, 0.15)}
    across = figures(one(bent(scenes["wall"], lambda p: sag(p, 0.01, 2)), "wall"))
    assert across == {"position": approx(0.0), "form": approx(0.0), "angle": approx(0.0)}


def test_a_turned_wall_is_straight(scenes: dict[str, Scene]) -> None:
    def turned(p: np.ndarray) -> np.ndarray:
        return np.stack((0.0 * p[:, 0], 1e-4 * (p[:, 0] - 60.0), 0.0 * p[:, 0]), axis=1)

    found = figures(one(bent(scenes["wall"], turned), "wall"))
    assert found == {"position": approx(0.0, 0.02), "form": approx(0.0), "angle": approx(10.0, 0.05)}


def test_a_twisted_face_is_not_flat(scenes: dict[str, Scene]) -> None:
    def twist(p: np.ndarray) -> np.ndarray:
        bump = 1e-5 * (p[:, 0] - 40.0) * (p[:, 1] - 40.0)
        return np.stack((0.0 * bump, 0.0 * bump, bump), axis=1)

    # k x y has no plane over a square about 0, and reaches 16 um in its four corners; its mean is that of the
    # steps of 8 mm between the passes, at X 40 and -40 in turn: -8 x 40 x 40 k over 960 mm of path
    found = figures(one(bent(scenes["flat"], twist), "flat"))
    assert found == {"position": approx(-0.13333), "form": approx(32.0, 0.5)}

    def tilted(p: np.ndarray) -> np.ndarray:
        rise = 1e-4 * (p[:, 0] - 40.0) + 5e-5 * (p[:, 1] - 40.0)
        return np.stack((0.0 * rise, 0.0 * rise, rise), axis=1)

    found = figures(one(bent(scenes["flat"], tilted), "flat"))
    assert found == {"position": approx(0.0, 0.05), "form": approx(0.0)}


def test_a_tilted_axis_moves_the_tip_of_a_hole_most_at_its_end(scenes: dict[str, Scene]) -> None:
    def tilted(p: np.ndarray) -> np.ndarray:
        away = 1e-3 * (p[:, 2] - 2.0)
        return np.stack((away, 0.0 * away, 2e-3 + 0.0 * away), axis=1)

    for hole in nodes_of(bent(scenes["hole"], tilted), "hole"):
        # 14 mm below R
        assert figures(hole) == {"position": approx(14.0, 0.01), "depth": approx(2.0)}


def test_the_depth_of_a_hole_is_that_of_its_bottom(scenes: dict[str, Scene]) -> None:
    stretched = bent(
        scenes["hole"], lambda p: np.stack((0 * p[:, 0], 0 * p[:, 0], 1e-3 * (p[:, 2] + 13)), axis=1)
    )
    assert [figures(hole)["depth"] for hole in nodes_of(stretched, "hole")] == [approx(1.0), approx(1.0)]


def test_a_short_arc_has_its_mean_radial_deviation(machine: Path) -> None:
    scene = scene_of("G0 X70 Y40\nG1 Z-1\nG3 X40 Y70 I-30", machine)

    def radial(p: np.ndarray) -> np.ndarray:
        arm = p - np.array((40.0, 40.0, 0.0))
        angle = np.arctan2(arm[:, 1], arm[:, 0])
        size = 0.004 + 0.002 * angle / (np.pi / 2)
        return np.stack((size * np.cos(angle), size * np.sin(angle), 0.0 * size), axis=1)

    found = figures(one(bent(scene, radial), "arc"))
    assert found == {"position": approx(5.0, 0.01), "form": approx(2.0, 0.02)}


def test_the_profile_of_a_contour_is_normal_to_its_arcs(machine: Path) -> None:
    text = "G0 X10 Y10\nG1 Z-1\nX50\nG3 X50 Y30 J10\nG1 X10\nY10"
    scene = scene_of(text, machine)

    def swollen(p: np.ndarray) -> np.ndarray:
        arm = p[:, :2] - np.array((50.0, 20.0))
        turned = (arm[:, 0] > 1e-6)[:, None]
        # 3 um out on the arc, 50 um along the lines where nothing is normal to them
        flat = np.where(turned, 0.003 * arm / 10.0, 0.0)
        return np.concatenate((flat, 0.0 * flat[:, :1]), axis=1)

    assert figures(one(bent(scene, swollen), "contour"))["form"] == approx(3.0)

    def along_the_arc(p: np.ndarray) -> np.ndarray:
        arm = p[:, :2] - np.array((50.0, 20.0))
        ahead = np.stack((-arm[:, 1], arm[:, 0], 0.0 * arm[:, 0]), axis=1) / 10.0
        return np.where((arm[:, :1] > 1e-6), 0.05 * ahead, 0.0)

    assert figures(one(bent(scene, along_the_arc), "contour"))["form"] == approx(0.0)

    def along(p: np.ndarray) -> np.ndarray:
        return np.where((p[:, :1] > 11.0) & (p[:, :1] < 49.0), np.array((0.05, 0.0, 0.0)), 0.0)

    assert figures(one(bent(scene, along), "contour"))["form"] == approx(0.0)
