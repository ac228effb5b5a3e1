"""What is a feature and what is none; the same part, written otherwise, has the same features."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.part_features import bent, figures, nodes_of, one, rotated, scene_of
from judge.machines import zero_machine

from olp.review.features.nodes import plain
from olp.review.scene import Scene


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    yield zero_machine(tmp_path_factory.mktemp("machine"))


def kinds(scene: Scene) -> Counter[str]:
    return Counter(node["kind"] for node in nodes_of(scene))


def error(p: np.ndarray) -> np.ndarray:
    """A smooth error that no feature is symmetric to."""
    x, y, z = (p / 50.0).T
    return 1e-3 * np.stack((3 * np.sin(x) + 2 * y, x * y - np.cos(y) + z, 2 + np.sin(x - y)), axis=1)


#: A rectangle with two round corners, at two levels.
SIDES = (
    (60, 10, None),
    (60, 30, None),
    (50, 40, (-10, 0)),
    (20, 40, None),
    (10, 30, (0, -10)),
    (10, 10, None),
)


def contour(level: float, *, back: bool = False, turn_deg: float = 0.0, parts: int = 1) -> str:
    """One round of the contour at a level, from (10, 10), perhaps the other way round, rotated, or with every
    line in several parts."""
    points = [(10.0, 10.0), *[(float(x), float(y)) for x, y, _ in SIDES]]
    centres = [
        None if arc is None else (points[k][0] + arc[0], points[k][1] + arc[1])
        for k, (_, _, arc) in enumerate(SIDES)
    ]
    if back:
        points, centres = points[::-1], centres[::-1]

    def place(p: tuple[float, float]) -> str:
        x, y = rotated(p[0] - 60.0, p[1] - 40.0, turn_deg)
        return f"X{x + 60.0:.6f} Y{y + 40.0:.6f}"

    lines = [f"G0 {place(points[0])}", f"G1 Z{level}"]
    for start, end, centre in zip(points[:-1], points[1:], centres, strict=True):
        if centre is None:
            for k in range(1, parts + 1):
                share = k / parts
                between = (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))
                lines.append(f"G1 {place(between)}")
        else:
            i, j = rotated(centre[0] - start[0], centre[1] - start[1], turn_deg)
            lines.append(f"G{2 if back else 3} {place(end)} I{i:.6f} J{j:.6f}")
    return "\n".join([*lines, "G0 Z20"])


def measured(scene: Scene) -> list[tuple[object, ...]]:
    """All features with their figures in nm, whatever their order."""
    rows = [
        (n["kind"], n["detail"].split(", ")[-1], *(round(v, 2) for v in figures(n).values()))
        for n in nodes_of(bent(scene, error))
    ]
    return sorted(rows, key=str)


def test_a_contour_at_two_levels_is_one_with_its_walls_and_arcs(machine: Path) -> None:
    scene = scene_of(contour(-1.0) + "\n" + contour(-2.0), machine)
    assert kinds(scene) == {"contour": 1, "wall": 4, "arc": 2}
    tree = plain(scene)["nodes"]
    top = next(n for n in tree if n["kind"] == "contour")
    assert top["detail"] == "path 50 x 30 mm, closed, 2 levels"
    assert {n["parent"] for n in tree if n["kind"] in ("wall", "arc")} == {top["id"]}
    assert {n["detail"] for n in tree if n["kind"] == "arc"} == {"R 10 mm, 90°, 2 levels"}
    assert [n["moves"] for n in tree if n["kind"] == "wall"] == [2, 2, 2, 2]


def same(first: list[tuple[object, ...]], other: list[tuple[object, ...]], tolerance: float) -> None:
    assert [row[:2] for row in first] == [row[:2] for row in other]
    for mine, theirs in zip(first, other, strict=True):
        np.testing.assert_allclose(mine[2:], theirs[2:], atol=tolerance)  # type: ignore[arg-type]


def test_the_order_of_levels_changes_nothing(machine: Path) -> None:
    down = scene_of(contour(-1.0) + "\n" + contour(-2.0), machine)
    up = scene_of(contour(-2.0) + "\n" + contour(-1.0), machine)
    same(measured(down), measured(up), 1e-6)


def test_the_direction_of_cutting_changes_nothing(machine: Path) -> None:
    same(
        measured(scene_of(contour(-1.0), machine)),
        measured(scene_of(contour(-1.0, back=True), machine)),
        0.02,
    )


def test_the_split_of_lines_changes_nothing(machine: Path) -> None:
    whole, parts = scene_of(contour(-1.0), machine), scene_of(contour(-1.0, parts=7), machine)
    same(measured(whole), measured(parts), 0.02)
    assert kinds(whole) == kinds(parts)


def test_a_part_in_two_directions_and_in_parts_is_still_one(machine: Path) -> None:
    scene = scene_of(contour(-1.0) + "\n" + contour(-2.0, back=True, parts=3), machine)
    assert kinds(scene) == {"contour": 1, "wall": 4, "arc": 2}


@pytest.mark.parametrize("turn_deg", [90.0, 33.0])
def test_a_rotated_part_has_the_same_features(machine: Path, turn_deg: float) -> None:
    def turned(p: np.ndarray) -> np.ndarray:
        c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
        turn = np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))
        middle = np.array((60.0, 40.0, 0.0))
        return np.asarray(error((p - middle) @ turn + middle) @ turn.T)

    def found(scene: Scene, by: object) -> list[tuple[object, ...]]:
        nodes = nodes_of(bent(scene, by))  # type: ignore[arg-type]
        # the sign of a wall is that of the direction named
        return sorted(
            ((n["kind"], "", *(round(abs(v), 2) for v in figures(n).values())) for n in nodes), key=str
        )

    upright, rotated_scene = (scene_of(contour(-1.0, turn_deg=deg), machine) for deg in (0.0, turn_deg))
    same(found(upright, error), found(rotated_scene, turned), 0.02)


def test_walls_say_where_they_are(machine: Path) -> None:
    scene = scene_of("G0 X10 Y40\nG1 Z-1\nX110\nG0 Z20\nG0 X20 Y20\nG1 Z-1\nX20 Y70\nX50 Y100", machine)
    details = [node["detail"] for node in nodes_of(scene, "wall")]
    assert details == [
        "100 mm along X, normal +Y, 1 level", "50 mm along Y, normal +X, 1 level",
        "42.426 mm along 45.00°, normal 135.00°, 1 level",
    ]  # fmt: skip
    first = nodes_of(scene, "wall")[0]
    assert first["centre_mm"] == pytest.approx([60.0, 40.0, -1.0])


def test_walls_of_one_line_with_a_gap_are_two(machine: Path) -> None:
    text = "G0 X0 Y10\nG1 Z-1\nX30\nG0 Z2\nG0 X31\nG1 Z-1\nX60\nG0 Z20"
    assert kinds(scene_of(text, machine)) == {"wall": 2}
    assert kinds(scene_of(text.replace("X31", "X30"), machine)) == {"wall": 1}


@pytest.mark.parametrize("text", ["G81 G99 X20 Y30 Z-12 R2\nX60\nX90\nG80", ""])
def test_holes_of_a_cycle_and_strokes_are_grouped(machine: Path, text: str) -> None:
    strokes = "".join(f"G0 X{x} Y30 Z2\nG1 Z-12\nG0 Z2\n" for x in (20, 60, 90))
    scene = scene_of(text or strokes, machine)
    word = "hole" if text else "stroke"
    assert kinds(scene) == {"holes": 1, "hole": 3}
    group = one(scene, "holes")
    assert group["label"] == f"3 {word}s"
    assert group["detail"] == "tool Ø 10 mm, to Z -12 mm, stroke of 14 mm"
    assert [n["label"] for n in nodes_of(scene, "hole")] == [f"{word} {k}" for k in (1, 2, 3)]
    assert nodes_of(scene, "hole")[1]["centre_mm"] == pytest.approx([60.0, 30.0, -5.0])
    tilted = bent(scene, lambda p: np.stack((1e-4 * p[:, 0], 0 * p[:, 0], -1e-4 * p[:, 0]), axis=1))
    assert figures(one(tilted, "holes")) == pytest.approx({"position": 9.0, "depth": -9.0}, abs=1e-6)


def test_pecks_at_one_place_are_one_stroke(machine: Path) -> None:
    scene = scene_of("G0 X20 Y30 Z2\nG1 Z-4\nG0 Z2\nG0 Z-3.5\nG1 Z-8\nG1 Z2 F3000\nG0 X40", machine)
    (stroke,) = nodes_of(scene)
    assert (stroke["kind"], stroke["moves"], stroke["label"]) == ("hole", 3, "stroke 1")
    assert stroke["detail"].endswith("to Z -8 mm, stroke of 10 mm")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("G0 X20 Y30 Z2\nG1 Z-4\nX40\nG0 Z2", {"wall": 1}),
        ("G0 X20 Y30 Z2\nG1 X40 Z-4\nX20\nG0 Z2", {"wall": 1}),
        ("G0 X20 Y30 Z2\nG3 Z-4 I-6 P4\nG3 I-6\nG0 Z2", {"circle": 1}),
        ("G0 X20 Y30 Z2\nG1 Z-4\nG0 X22\nG0 Z2", {}),
        ("G0 X20 Y30 Z2\nG1 Z3\nG0 Z2", {}),
    ],
)
def test_plunges_ramps_and_helices_are_no_holes(machine: Path, text: str, expected: dict[str, int]) -> None:
    assert kinds(scene_of(text, machine)) == expected


def test_a_touch_across_is_a_stroke_and_a_slot_there_and_back_a_wall(machine: Path) -> None:
    touch = scene_of("G0 X20 Y30\nG0 Z-5\nG1 X26\nG1 X20\nG0 Z20", machine)
    (node,) = nodes_of(touch)
    assert (node["kind"], node["detail"]) == ("hole", "tool Ø 10 mm, to X 26 mm, stroke of 6 mm")
    out = bent(touch, lambda p: np.tile((0.003, 0.004, 0.0), (len(p), 1)))
    assert figures(one(out, "hole")) == pytest.approx({"position": 4.0, "depth": -3.0}, abs=1e-9)
    slot = scene_of("G0 X20 Y30\nG1 Z-5\nG1 X56\nG1 X20\nG0 Z20", machine)
    assert kinds(slot) == {"wall": 1}


def test_a_helix_and_its_last_turn_are_one_circle(machine: Path) -> None:
    scene = scene_of("G0 X50 Y40\nG1 Z0\n" + "G3 Z-2 I-12\nG3 Z-4 I-12\nG3 I-12", machine)
    (node,) = nodes_of(scene)
    assert node["detail"] == "R 12 mm, 360°, 1 level, helix of 2 turns"
    assert node["centre_mm"] == pytest.approx([38.0, 40.0, -2.0])


def test_arcs_about_one_centre_cover_a_circle_or_do_not(machine: Path) -> None:
    half = "G0 X50 Y40\nG1 Z-1\nG3 X30 Y40 I-10\nG0 Z5\n"
    other = "G0 X30 Y40\nG1 Z-1\nG3 X50 Y40 I10\nG0 Z5\n"
    assert kinds(scene_of(half + other, machine)) == {"circle": 1}
    scene = scene_of(half + half.replace("Z-1", "Z-2"), machine)
    assert one(scene, "arc")["detail"] == "R 10 mm, 180°, 2 levels"
    # another radius, and another plane, about the same centre
    rings = half + half.replace("50", "52").replace("30", "28").replace("I-10", "I-12")
    assert kinds(scene_of(rings, machine)) == {"arc": 2}


def chords(
    count: int, radius: float = 20.0, squash: float = 1.0, digits: int = 3, sweep: float = 360.0
) -> str:
    angle = np.radians(np.linspace(0.0, sweep, count + 1))
    x, y = 60.0 + radius * np.cos(angle), 40.0 + squash * radius * np.sin(angle)
    points = [f"X{a:.{digits}f} Y{b:.{digits}f}" for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    return f"G0 {points[0]}\nG1 Z-1\n" + "\n".join(points[1:]) + "\nG0 Z5\n"


@pytest.mark.parametrize("digits", [2, 3, 4])
def test_circles_of_chords_are_found_through_rounding(machine: Path, digits: int) -> None:
    scene = scene_of(chords(72, digits=digits) + chords(72, digits=digits).replace("Z-1", "Z-2"), machine)
    node = one(scene, "circle")
    assert kinds(scene) == {"circle": 1}
    assert node["detail"].split(", ")[1:] == ["360°", "2 levels"]
    assert float(node["detail"].split()[1]) == pytest.approx(20.0, abs=2e-3 + 0.1 * 10.0**-digits)
    # chords are no deviation of the machine
    still = bent(scene, np.zeros_like)
    assert figures(one(still, "circle")) == pytest.approx(
        {"position": 0.0, "size": 0.0, "form": 0.0}, abs=1e-6
    )


def test_what_is_no_circle_of_chords(machine: Path) -> None:
    assert kinds(scene_of(chords(11), machine)) == {"contour": 1, "wall": 11}
    # ellipses, also fine ones that are near a circle everywhere; and a vertex in the middle that is 8 um off
    assert kinds(scene_of(chords(72, squash=0.9), machine)) == {"contour": 1}
    assert kinds(scene_of(chords(720, squash=0.9, digits=4), machine)) == {"contour": 1}
    dented = chords(14, sweep=140.0)
    assert kinds(scene_of(dented, machine)) == {"arc": 1}
    lines = dented.split("\n")
    x, y = lines[8].split()
    lines[8] = f"{x} Y{float(y[1:]) + 0.008:.3f}"
    assert kinds(scene_of("\n".join(lines), machine)) == {"contour": 1}


def test_a_rounded_corner_of_chords_is_an_arc_between_walls(machine: Path) -> None:
    angle = np.radians(np.linspace(-90.0, 0.0, 19))
    corner = "\n".join(f"X{50 + 10 * np.cos(a):.4f} Y{20 + 10 * np.sin(a):.4f}" for a in angle.tolist())
    scene = scene_of(f"G0 X10 Y10\nG1 Z-1\nX50\n{corner}\nY70", machine)
    assert kinds(scene) == {"contour": 1, "wall": 2, "arc": 1}
    assert one(scene, "arc")["detail"] == "R 10 mm, 90°, 1 level"


def test_a_faced_area_is_flat_and_its_passes_are_no_walls(machine: Path) -> None:
    passes = "\n".join(f"Y{8 * k}\nX{80 if k % 2 == 0 else 0}" for k in range(8))
    scene = scene_of(f"G0 X0 Y0\nG1 Z-2\n{passes}", machine)
    (node,) = nodes_of(scene)
    assert (node["kind"], node["detail"]) == ("flat", "Z -2 mm, path 80 x 56 mm, 15 moves")
    # passes farther apart than the tool is wide leave walls
    apart = "\n".join(f"Y{13 * k}\nX{80 if k % 2 == 0 else 0}" for k in range(8))
    comb = scene_of(f"G0 X0 Y0\nG1 Z-2\n{apart}", machine)
    assert "flat" not in kinds(comb)


def ring(size: float, centre: float = 50.0) -> str:
    a, b = centre - size, centre + size
    return f"G0 X{a} Y{a}\nG1 Z-3\nX{b}\nY{b}\nX{a}\nY{a}\nG0 Z5\n"


def test_of_the_rings_of_a_pocket_only_the_outermost_is_a_wall(machine: Path) -> None:
    scene = scene_of("".join(ring(size) for size in (30.0, 25.0, 20.0, 15.0, 10.0, 5.0)), machine)
    assert kinds(scene) == {"flat": 1, "contour": 1, "wall": 4}
    assert one(scene, "contour")["detail"] == "path 60 x 60 mm, closed, Z -3 mm"
    # no radius of the tool, no area
    unknown = replace(scene, tool_radii_mm={})
    assert kinds(unknown) == {"contour": 6, "wall": 24}
    # two rings alone are a wall cut twice
    assert kinds(scene_of(ring(30.0) + ring(29.0), machine)) == {"contour": 2, "wall": 8}


def test_a_freeform_surface_has_no_features(machine: Path) -> None:
    lines = []
    for row in range(6):
        for step in range(60):
            x = step if row % 2 == 0 else 59 - step
            z = np.sin(x / 9.0) - (0 if step % 5 else 1e-3)
            lines.append(f"G1 X{x} Y{2 * row} Z{z:.4f}" if step % 5 else f"X{x}")
    scene = scene_of("\n".join(lines), machine)
    assert kinds(scene) == {}
    assert [n["kind"] for n in plain(scene)["nodes"]] == ["operation"]


def test_a_program_in_a_rotated_frame_speaks_its_own_directions(machine: Path) -> None:
    scene = scene_of("G0 X20 Y20\nG1 Z-1\nX63.3012702 Y45\nX53.3012702 Y62.3205081", machine)
    c, s = np.cos(np.radians(30.0)), 0.5
    path = scene.nominal.toolpath
    turn = ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))
    frames = tuple(replace(frame, turn=turn) for frame in path.frames)
    turned = replace(scene, nominal=replace(scene.nominal, toolpath=replace(path, frames=frames)))
    details = [n["detail"] for n in nodes_of(turned, "wall")]
    assert details == ["50 mm along X, normal +Y, 1 level", "20 mm along Y, normal +X, 1 level"]
    along = bent(turned, lambda p: np.tile(1e-3 * np.array((-s, c, 0.0)), (len(p), 1)))
    assert [figures(n)["position"] for n in nodes_of(along, "wall")] == pytest.approx([1.0, 0.0], abs=1e-6)


def test_moves_without_length_separate_nothing(machine: Path) -> None:
    text = "G0 X10 Y10\nG1 Z-1\nX10 Y10\nX50\nF500\nX50\nY40"
    assert kinds(scene_of(text, machine)) == {"contour": 1, "wall": 2}


def test_three_quarters_of_a_circle_are_an_arc(machine: Path) -> None:
    scene = scene_of("G0 X50 Y40\nG1 Z-1\nG3 X40 Y30 I-10\nG0 Z5", machine)
    assert (kinds(scene), one(scene, "arc")["detail"]) == ({"arc": 1}, "R 10 mm, 270°, 1 level")
    # both halves go beyond the whole
    over = "G0 X50 Y40\nG1 Z-1\nG3 X30 Y40 I-10\nG3 X40 Y50 I10\nG0 Z5"
    assert kinds(scene_of(over, machine)) == {"circle": 1}


def test_a_rapid_to_the_bottom_drills_no_hole(machine: Path) -> None:
    assert kinds(scene_of("G0 X20 Y30 Z2\nG1 Z0\nG0 Z-5\nG0 Z5", machine)) == {}


def test_the_rings_about_an_island_are_a_wall(machine: Path) -> None:
    outer = "".join(ring(size) for size in (40.0, 35.0, 30.0, 25.0))
    island = "G0 X40 Y40\nG1 Z-3\nY60\nX60\nY40\nX40\nG0 Z5\nG0 X35 Y35\nG1 Z-3\nY65\nX65\nY35\nX35\nG0 Z5\n"
    scene = scene_of(outer + island, machine)
    contours = [n["detail"] for n in nodes_of(scene, "contour")]
    assert contours == ["path 80 x 80 mm, closed, Z -3 mm", "path 30 x 30 mm, closed, Z -3 mm"]


def test_the_last_turn_of_a_helix_is_no_contour(machine: Path) -> None:
    turns = "G3 Z-2 I-12\nG3 Z-4 I-12\nG3 X26 I-12\nG3 X50 I12"
    assert kinds(scene_of(f"G0 X50 Y40\nG1 Z0\n{turns}", machine)) == {"circle": 1}


def test_a_flat_on_a_shaft_is_no_part_of_its_circle(machine: Path) -> None:
    """A chord of 28 degrees among such of 2: its ends are on the circle."""
    lines = chords(180).split("\n")
    scene = scene_of("\n".join(lines[:60] + lines[73:]), machine)
    assert one(scene, "arc")["detail"] == "R 20 mm, 332°, 1 level"
    assert len(nodes_of(scene, "wall")) == 1


def test_parts_of_a_wall_at_other_levels_are_the_wall(machine: Path) -> None:
    lines = ("X10 Z-1 X110", "X20 Z-2 X30", "X60 Z-3 X70")
    parts = [line.split() for line in lines]
    text = "\n".join(f"G0 {a} Y40\nG1 {z}\n{b}\nG0 Z5" for a, z, b in parts)
    scene = scene_of(text, machine)
    assert one(scene, "wall")["detail"] == "100 mm along X, normal +Y, 3 levels"


def test_the_tool_says_where_out_of_the_material_is(machine: Path) -> None:
    """A tool that points along Y: a stroke in Y drills, one in Z is a touch across it."""
    scene = scene_of("G0 X20 Y2 Z-5\nG1 Y12\nG0 Y2\nG0 X40\nG1 Y12\nX60\nG0 Y2", machine)
    path = scene.nominal.toolpath
    frames = tuple(replace(frame, tool_mm=(0.0, 120.0, 0.0)) for frame in path.frames)
    drilled = replace(scene, nominal=replace(scene.nominal, toolpath=replace(path, frames=frames)))
    assert kinds(drilled) == {"hole": 1, "wall": 1}
    assert one(drilled, "hole")["detail"] == "tool Ø 10 mm, to Y 12 mm, stroke of 10 mm"
    in_y = bent(drilled, lambda p: np.tile((0.0, -0.002, 0.0), (len(p), 1)))
    assert figures(one(in_y, "hole"))["depth"] == pytest.approx(2.0)
