"""The path of the tool along contours, worked by hand, and of what no interpreter here can judge."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine

from olp.core.errors import ProgramError
from olp.core.toolpath import Frame, Kind
from olp.files.config import load_setup
from olp.program.contours.rules import ISO_CONTOURS, NGC_CONTOURS
from olp.program.contours.tool_path import follow
from olp.program.program import Program
from olp.program.registry import DIALECTS, read

HEAD = b"G21 G90 G54 F600\nG0 X0 Y0 Z10\n"
TOOL = f"{TRUE_ZERO}[tools.1]\nZ_mm = 0.0\nradius_mm = 4.5\nwear_mm = 0.5\n[job_defaults]\ntool = 1\n"


def program(folder: Path, text: bytes, control: str = "linuxcnc") -> Program:
    keys = "" if control == "linuxcnc" else 'decimal_point = "calculator"\n'
    path = machine(folder, tables=TOOL, controller=control, keys=keys)
    return read(HEAD + text + b"M2\n", load_setup(path), DIALECTS[control])


def moves(read_program: Program) -> list[tuple[str, float, float, float]]:
    path = read_program.toolpath
    return [
        (Kind(int(kind)).name, *(round(float(v), 4) for v in end))
        for kind, end in zip(path.kind, path.end_mm, strict=True)
    ]  # fmt: skip


def refused(folder: Path, text: bytes, control: str = "linuxcnc") -> tuple[int | None, str]:
    with pytest.raises(ProgramError) as caught:
        program(folder, text, control)
    return caught.value.line, caught.value.message


def test_round_a_square_and_in_it(tmp_path: Path) -> None:
    """Right of a square that is gone round to the left: arcs about its corners; left of it, inside."""
    text = b"G42 D1 G1 X20 Y0\nX50\nY30\nX20\nY0\nG40 G1 X0\n"
    around = moves(program(tmp_path, text))
    assert around[1:] == [
        ("LINE", 20, -5, 10), ("LINE", 50, -5, 10), ("ARC_CCW", 55, 0, 10), ("LINE", 55, 30, 10),
        ("ARC_CCW", 50, 35, 10), ("LINE", 20, 35, 10), ("ARC_CCW", 15, 30, 10), ("LINE", 15, 0, 10),
        ("LINE", 0, 0, 10),
    ]  # fmt: skip
    within = moves(program(tmp_path, text.replace(b"G42", b"G41").replace(b"X50\nY30", b"X50 (a)\nY30")))
    assert within[1:] == [
        ("LINE", 20, 5, 10), ("LINE", 45, 5, 10), ("LINE", 45, 25, 10), ("LINE", 25, 25, 10),
        ("LINE", 25, 0, 10), ("LINE", 0, 0, 10),
    ]  # fmt: skip


def test_controls_of_the_other_kind_extend_corners_and_begin_beside_the_next_move(tmp_path: Path) -> None:
    within = moves(program(tmp_path, b"G42 D1 G1 X20. Y-1.\nY30.\nX50.\nG40 X60.\n", "fanuc"))
    assert within[1:] == [
        ("LINE", 25, -1, 10), ("LINE", 25, 25, 10), ("LINE", 50, 25, 10), ("LINE", 60, 30, 10),
    ]  # fmt: skip
    right = moves(program(tmp_path, b"G41 D1 G1 X20. Y0.\nY30.\nX50.\nG40 X60.\n", "haas"))
    assert right[1:] == [
        ("LINE", 15, 0, 10), ("LINE", 15, 30, 10), ("LINE", 15, 35, 10), ("LINE", 15, 35, 10),
        ("LINE", 20, 35, 10), ("LINE", 50, 35, 10), ("LINE", 60, 30, 10),
    ]  # fmt: skip
    # beyond a sharp corner both sides are extended by the radius
    sharp = moves(program(tmp_path, b"G41 D1 G1 X20. Y0.\nY30.\nX50. Y0.\nG40 X60.\n", "haas"))
    assert sharp[3:6] == [
        ("LINE", 15, 35, 10), ("LINE", 20, 37.0711, 10), ("LINE", 23.5355, 33.5355, 10)
    ]  # fmt: skip


def test_the_first_move_behind_a_contour_goes_to_all_that_is_programmed_on_some_controls(
    tmp_path: Path,
) -> None:
    text = b"G41 D1 G1 X20 Y0\nX50\nG40\nZ20\nG1 X0 Y0\n"
    assert moves(program(tmp_path, text))[-2:] == [("LINE", 50, 0, 20), ("LINE", 0, 0, 20)]
    assert moves(program(tmp_path, text, "fanuc"))[-2:] == [("LINE", 50, 5, 20), ("LINE", 0, 0, 20)]


def test_each_move_knows_its_block_and_its_words(tmp_path: Path) -> None:
    done = program(tmp_path, b"G42 D1 G1 X20 Y0\nX50\nG3 X60 Y10 J10\nG1 X20\nG40 G1 X0\n")
    assert done.programmed is not None
    assert done.blocks is not None
    assert done.blocks.tolist() == [0, 1, 2, 3, 4, 4, 5]
    assert (done.slot[4] == -1).all() and (done.slot[5] == done.programmed.slot[4]).all()
    assert done.arc_slots.word[:, 1].tolist() == [done.programmed.arc_slots.word[0, 1], -1]
    assert done.toolpath.arcs.move.tolist() == [3, 4]
    assert done.toolpath.arcs.sweep_rad == pytest.approx([np.pi / 2, np.pi / 2])
    plain = program(tmp_path, b"G1 X20 Y0\nX50\n")
    assert plain.programmed is None and plain.blocks is None


def test_a_rapid_goes_round_a_corner_as_a_rapid(tmp_path: Path) -> None:
    around = moves(program(tmp_path, b"G42 D1 G1 X20 Y0\nG0 X50\nY30\nG40 G1 X0\n"))
    assert around[2:5] == [("RAPID", 50, -5, 10), ("RAPID", 55, 0, 10), ("RAPID", 55, 30, 10)]


def test_holes_and_presets_behind_a_contour_count_the_moves_of_the_tool(tmp_path: Path) -> None:
    text = b"G42 D1 G1 X20 Y0\nX50\nY30\nG40 X90 Y60\nG81 X95 Z5 R9\nX99\nG80\nG92 X1\n"
    done = program(tmp_path, text)
    assert done.programmed is not None
    behind = done.programmed.holes
    assert done.holes.first.tolist() == (behind.first + 1).tolist()
    assert done.holes.last.tolist() == (behind.last + 1).tolist()
    assert [c.moves for c in done.captures] == [c.moves + 1 for c in done.programmed.captures]
    assert len(done.captures) == 1


@pytest.mark.parametrize(("level", "first"), [("0", (50, 0, 10)), ("10", (50, 0, 10)), ("12", (50, 0, 12))])
def test_a_hole_where_a_contour_ended_is_reached_across_the_plane_first(
    tmp_path: Path, level: str, first: tuple[int, int, int]
) -> None:
    """From beside the contour at Z10; a retract level above is reached on the way there."""
    text = b"G42 D1 G1 X20 Y0\nX50\nG40\n"
    done = program(tmp_path, text + b"G98 G81 X50 Y0 Z-5 R%s\nG80\n" % level.encode())
    after = moves(done)[3:]
    assert after[0] == ("RAPID", *first)
    assert after[-2:] == [("LINE", 50, 0, -5), ("RAPID", 50, 0, max(int(level), 10))]
    assert len(after) == (4 if level == "0" else 3)
    assert done.holes.first.tolist() == [3]
    # a move between them has gone there already
    between = moves(program(tmp_path, text + b"G0 Z9\nG81 X50 Y0 Z-5 R0\nG80\n"))
    assert between[3:5] == [("RAPID", 50, 0, 9), ("RAPID", 50, 0, 0)]


def test_a_hole_where_a_contour_ended_is_refused_on_other_controls(tmp_path: Path) -> None:
    text = b"G42 D1 G1 X20. Y0.\nX50.\nG40\n%sG99 G81 X50. Y0. Z-5. R1.\nG80\n"
    line, why = refused(tmp_path, text % b"", "fanuc")
    assert line == 6
    assert "drills where the contour ended" in why
    assert refused(tmp_path, text % b"Z20.\n", "fanuc")[0] == 7
    program(tmp_path, text % b"X51.\n", "fanuc")


def test_a_move_along_the_tool_axis_before_a_contour_stays_where_it_was(tmp_path: Path) -> None:
    """Some controls begin beside the next move, whatever is before it."""
    text = b"G42 D1 G1 X20. Y0.\nX50.\nG40 X90. Y60.\nG41 D1 Z5.\nX70.\nY90.\nG40 X0.\n"
    assert moves(program(tmp_path, text, "fanuc"))[3:6] == [
        ("LINE", 90, 60, 10), ("LINE", 90, 60, 5), ("LINE", 65, 60, 5)
    ]  # fmt: skip


REFUSED = {
    b"G41 D1 G1 X4 Y3\nX60\n": (3, "first move of a contour is not longer than the cutter radius of 5 mm"),
    b"G41 D1 G2 X20 Y0 I10\nG1 X60 Y-90\n": (3, "turns inward behind the arc that enters it"),
    b"G41 D1 G2 X4 Y0 I2\nG1 X60\n": (
        3,
        "first move of a contour is not longer than the cutter radius of 5 mm",
    ),
    b"G41 D1 G1 X20 Y0\nX60\nG3 X60 Y8 J4\nG1 X20\n": (5, "does not fit into this arc"),
    b"G41 D1 G1 X20 Y0\nX60\nY4\nX20\nY40\n": (5, "does not fit into the corners of this move"),
    b"G41 D1 G1 X20 Y0\nX60\nG40 G2 X70 Y10 I10\n": (5, "the move behind a contour"),
    b"G41 D1\nG1 Z0\nX20 Y0\nX60\n": (4, "does not go across its plane"),
    b"G41 D1\nG0 Z0\nX20 Y0\nX60\nG40 X90\nG41 D1 Z9\nX120\n": (4, "does not go across its plane"),
    # tangents that differ by 0.001 let the circle end behind its begin
    b"G41 D1 G1 X20 Y0\nX60\nG2 X60 Y0 I-0.02 J-20\nG1 X90\n": (5, "this circle ends beyond its begin"),
}
IN_CONTOUR = {
    b"M0": "M0 stops the control", b"M1": "M1 stops the control", b"M60": "M60 stops the control",
    b"X30 M1": "M1 stops the control", b"G64 P0.1": "G64 is not taken", b"G61": "G61 is not taken",
    b"G98": "G98 is not taken", b"M48": "M48 is not taken", b"M64 P0": "M64 is not taken",
    b"G43 H1": "G43 is not taken", b"G49": "G49 is not taken", b"G18": "a change of plane is",
}  # fmt: skip


@pytest.mark.parametrize("control", ["fanuc", "mazak"])
def test_a_contour_without_d_takes_the_last_one(tmp_path: Path, control: str) -> None:
    """In whatever block it is; one that changes within the contour is refused, as is H under a length."""
    with_d = b"G41 D1 G1 X20. Y0.\nY30.\nX50.\nG40 X60.\n"
    stated = moves(program(tmp_path, with_d, control))
    for before in (b"G0 X0. D1\n", b"D9 M8\nF60. D1\n"):
        text = before + with_d.replace(b" D1", b"")
        assert moves(program(tmp_path, text, control))[-len(stated) + 1 :] == stated[1:]
    line, why = refused(tmp_path, with_d.replace(b"X50.", b"X50. D2"), control)
    assert (line, why[:40]) == (5, "D2 alone is in the block while D1 is in ")
    assert program(tmp_path, with_d.replace(b"X50.", b"X50. D1"), control)
    assert refused(tmp_path, b"/X5. D1\n" + with_d, control)[0] == 3


def test_a_contour_that_only_goes_along_the_tool_has_nothing_to_stay_beside(tmp_path: Path) -> None:
    """Neither where it is the first of a program, nor behind another contour."""
    along = b"G41 D1 G1 Z5\nG40 Z8\nZ9\n"
    assert moves(program(tmp_path, along, "fanuc"))[1:] == [("LINE", 0, 0, z) for z in (5, 8, 9)]
    first = b"G41 D1 G1 X0 Y20\nX50\nG40 G1 X60 Y60\n"
    behind = moves(program(tmp_path, first + along, "fanuc"))
    assert behind[-4:] == [("LINE", 60, 60, z) for z in (10, 5, 8, 9)]


@pytest.mark.parametrize("block", IN_CONTOUR)
def test_blocks_that_a_control_does_not_take_along_a_contour(tmp_path: Path, block: bytes) -> None:
    line, why = refused(tmp_path, b"G41 D1 G1 X20 Y0\n%s\nX60 Y20\nG40 G1 X90\n" % block)
    assert line == 4
    assert IN_CONTOUR[block] in why
    program(tmp_path, b"G41 D1 G1 X20 Y0\nX60 Y20\nG40 G1 X90\n%s\n" % block)


def test_codes_of_g40_and_stops_of_a_cutter_without_radius_are_taken(tmp_path: Path) -> None:
    program(tmp_path, b"G41 D1 G1 X20 Y0\nX60 Y20\nG40 G49 G64 M1\n")
    program(tmp_path, b"G41.1 D0 G1 X20 Y0\nM1\nX60 Y20\nG40 X80\n")
    line, _ = refused(tmp_path, b"G64 G1 X9 Y9\nG41 D1 G61 X20 Y0\nX60 Y20\nG40\n")
    assert line == 4


def test_round_a_point_where_the_path_turns_back_the_tool_goes_outside(tmp_path: Path) -> None:
    """By a little more than half a turn, and by a little less."""
    for y in (1, -1):
        path = program(tmp_path, b"G42 D1 G1 X20 Y0\nX60\nX20 Y%d\nG40 X0\n" % y).toolpath
        off = np.arctan2(y, -40) % (2 * np.pi)
        assert path.arcs.sweep_rad == pytest.approx([off]), y


def line_and_arc(corner: float, sweep: float, radius: float, unit: float = 1.0) -> bytes:
    """A line, and an arc to the left with a corner of some rad before it; the tool is on its inner side."""
    begin, centre = 60 + 0j, 60 + radius * 1j * np.exp(1j * corner)
    end = centre + (begin - centre) * np.exp(1j * sweep)
    x, i = end / unit, (centre - begin) / unit
    text = b"G41 D1 G1 X%.6f Y0\nX%.6f\nG3 X%.6f Y%.6f I%.6f J%.6f\nG1 X%.6f Y%.6f\nG40 X0\n"
    far = end + 30 * np.exp(1j * (corner + sweep))
    return text % (20 / unit, 60 / unit, x.real, x.imag, i.real, i.imag, far.real / unit, far.imag / unit)


def test_how_much_longer_an_arc_may_be_depends_on_the_unit(tmp_path: Path) -> None:
    """The tool's arc is longer than the programmed one by 0.03 rad x 5 / 12, and a corner behind it makes it
    look there."""
    behind = b"G40 G1 X0\n"

    def text(corner: float, radius: float, unit: float = 1.0) -> bytes:
        return line_and_arc(corner, 0.7, radius, unit).rpartition(b"G1 X")[0] + behind

    assert len(program(tmp_path, text(-0.03, 17.0)).toolpath) == 5
    assert "corners of this move" in refused(tmp_path, b"G20\n" + text(-0.03, 17.0, 25.4))[1]
    assert "corners of this move" in refused(tmp_path, text(-0.04, 11.0))[1]
    assert len(program(tmp_path, b"G20\n" + text(0.03, 17.0, 25.4)).toolpath) == 5


def test_a_short_arc_that_the_tool_would_go_back_is_refused(tmp_path: Path) -> None:
    """Between corners that are none, a control would go round nearly a whole turn."""
    assert len(program(tmp_path, line_and_arc(0.04, 0.1, 8.0)).toolpath) == 6
    line, why = refused(tmp_path, line_and_arc(0.04, 0.05, 8.0))
    assert (line, "corners of this move" in why) == (5, True)


@pytest.mark.parametrize("text", REFUSED)
def test_what_a_control_refuses_is_refused_with_its_line(tmp_path: Path, text: bytes) -> None:
    line, why = refused(tmp_path, text)
    assert (line, REFUSED[text][1] in why) == (REFUSED[text][0], True)


def test_a_contour_from_an_unknown_position_is_refused(tmp_path: Path) -> None:
    line, why = refused(tmp_path, b"M6 T1\nG41 D1 G1 X20\nX60 Y0\n")
    assert line == 4
    assert "has not been commanded yet" in why


@pytest.mark.parametrize(
    ("turn", "good"),
    [
        (((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)), True),
        (((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), False),
        (((2.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 2.0)), False),
        (((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)), False),
    ],
)
def test_a_frame_that_is_more_than_turned_in_its_plane_is_refused(
    tmp_path: Path, turn: tuple[tuple[float, float, float], ...], good: bool
) -> None:
    from dataclasses import replace

    done = program(tmp_path, b"G41 D1 G1 X20 Y0\nX60\n")
    assert done.programmed is not None
    path = done.programmed.toolpath

    def turned(frame: Frame) -> Frame:
        return replace(frame, turn=turn)  # type: ignore[arg-type]

    path = replace(path, frames=tuple(turned(frame) for frame in path.frames))
    if good:
        assert len(follow(path, NGC_CONTOURS).path) == 3
        return
    with pytest.raises(ProgramError, match="scaled, mirrored or turned"):
        follow(path, ISO_CONTOURS)


def test_sinumerik_begins_beside_the_next_move_and_goes_round_corners_on_arcs(tmp_path: Path) -> None:
    text = b"G41 D1 G1 X20 Y0\nY30\nX50\nG40 X60\n"
    path = machine(tmp_path, tables=TOOL, controller="sinumerik")
    head = b"G71 G90 G54 F600\nT1 M6\nG0 X0 Y0 Z10\n"
    done = moves(read(head + text + b"M2\n", load_setup(path), DIALECTS["sinumerik"]))
    assert done[-5:] == [
        ("LINE", 15, 0, 10), ("LINE", 15, 30, 10), ("ARC_CW", 20, 35, 10), ("LINE", 50, 35, 10),
        ("LINE", 60, 30, 10),
    ]  # fmt: skip
    # a move along the tool axis alone leaves the tool beside the contour, as one axis of the plane does not
    behind = moves(
        read(
            head + text.replace(b"G40 X60", b"G40 Z20\nX60") + b"M2\n",
            load_setup(path),
            DIALECTS["sinumerik"],
        )
    )
    assert behind[-2:] == [("LINE", 50, 35, 20), ("LINE", 60, 30, 20)]


@pytest.mark.parametrize("seed", range(4))
def test_every_point_of_a_sinumerik_contour_is_the_radius_away_from_it(tmp_path: Path, seed: int) -> None:
    """On the side that G41 and G42 say: the path of the tool as a place, whatever made it."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 7))[:: int(rng.choice([-1, 1]))]
    if np.abs(np.diff(angle)).min() < 0.3:
        angle = np.linspace(0, 5.5, 7)
    corner = rng.uniform(60, 100, (7, 1)) * np.column_stack((np.cos(angle), np.sin(angle)))
    rows = "".join(f"X{x:.4f} Y{y:.4f}\n" for x, y in corner)
    x, y = corner[0] * 1.5
    away = f"X{x:.4f} Y{y:.4f}"
    text = f"G71 G90 G54 F600\nT1 M6\nG0 {away} Z0\nG1 G{41 + seed % 2} D1\n{rows}G40 {away}\nM2\n"
    path = machine(tmp_path, tables=TOOL, controller="sinumerik")
    tool = read(text.encode(), load_setup(path), DIALECTS["sinumerik"]).toolpath
    points = [np.linspace(a, b, 50) for a, b in pairwise(tool.end_mm[1:-1, :2])]
    for arc, centre, sweep in zip(tool.arcs.move, tool.arcs.centre_mm, tool.arcs.sweep_rad, strict=True):
        away = tool.end_mm[arc - 1, :2] - centre[:2]
        turn = np.linspace(0, sweep, 50)[:, None]
        points[arc - 2] = centre[:2] + np.cos(turn) * away + np.sin(turn) * np.array([-away[1], away[0]])
    every = np.concatenate(points)
    a, d = corner[:-1], np.diff(corner, axis=0)
    share = np.clip(((every[:, None] - a) * d).sum(axis=2) / (d**2).sum(axis=1), 0, 1)
    gap = every[:, None] - (a + share[:, :, None] * d)
    size = np.hypot(gap[..., 0], gap[..., 1])
    assert np.abs(size.min(axis=1) - 5.0).max() < 1e-3
    nearest = size.argmin(axis=1)
    cross = (
        d[nearest, 0] * gap[np.arange(len(every)), nearest, 1]
        - d[nearest, 1] * gap[np.arange(len(every)), nearest, 0]
    )
    assert (cross > -1e-6).all() if seed % 2 == 0 else (cross < 1e-6).all()


def test_an_arc_that_enters_ends_beside_its_end_on_an_arc_from_where_the_tool_is(tmp_path: Path) -> None:
    """By hand: from (0, 0) round (20, 0) to (20, -20), inside, so that the tool ends 5 mm above that."""
    path = program(tmp_path, b"G41 D1 G3 X20 Y-20 I20\nG1 X60\n").toolpath
    arc = path.arcs.move[0]
    assert path.end_mm[arc, :2] == pytest.approx([20, -15])
    # as far from both ends: 20^2 + y^2 = (y + 15)^2
    assert path.arcs.centre_mm[0, :2] == pytest.approx([20, 175 / 30])
    assert path.arcs.sweep_rad[0] == pytest.approx(np.arctan2(20, 175 / 30))
    assert path.end_mm[arc + 1, :2] == pytest.approx([60, -15])
    other = program(tmp_path, b"G42 D1 G3 X20 Y-20 I20\nG1 X60\n").toolpath
    assert other.end_mm[arc, :2] == pytest.approx([20, -25])
    assert other.arcs.centre_mm[0, :2] == pytest.approx([20, -4.5])
