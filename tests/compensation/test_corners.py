"""Corners of contours under cutter compensation, by hand: a cutter of 5 mm beside lines and arcs.

At a concave corner of 90 degrees the control loses 5 mm of both moves: the radius times tan 45.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from cases.toy import Move, arc, feed, linear, rapid, toolpath

from olp.compensation.contour import Contour
from olp.compensation.corners import away_from_corners, gouging
from olp.compensation.plan import Limits
from olp.compensation.planning import plan
from olp.core.errors import ProgramError
from olp.core.toolpath import CutterCompensation, Frame, Toolpath

R_MM = 5.0
LEFT, RIGHT = CutterCompensation(0, True, R_MM), CutterCompensation(0, False, R_MM)
ON = {"frame": 1}


def contour(*moves: Move, of: CutterCompensation = LEFT, **more: object) -> Toolpath:
    """A path that begins at the origin; moves with `ON` are along the contour."""
    return toolpath(*moves, frames=(Frame(), Frame(compensation=of)), **more)  # type: ignore[arg-type]


def turned(path: Toolpath, plane: int) -> Toolpath:
    """The path of the XY plane in another plane."""
    order = {0: [0, 1, 2], 1: [1, 2, 0], 2: [2, 0, 1]}[plane]
    frames = tuple(
        f if f.compensation is None else Frame(compensation=replace(f.compensation, plane=plane))
        for f in path.frames
    )
    arcs = replace(
        path.arcs, centre_mm=path.arcs.centre_mm[:, order], plane=np.full(len(path.arcs), plane, np.int8)
    )
    return replace(path, end_mm=path.end_mm[:, order], frames=frames, arcs=arcs)


def bad(*moves: Move, of: CutterCompensation = LEFT, seen: bool = False) -> list[int]:
    path = contour(*moves, of=of)
    found = np.flatnonzero(gouging(path, seen=seen)).tolist()
    for plane in (1, 2):
        assert np.flatnonzero(gouging(turned(path, plane), seen=seen)).tolist() == found
    # seen in a mirror the other side gouges
    end = path.end_mm * (1.0, -1.0, 1.0)
    arcs = replace(
        path.arcs, centre_mm=path.arcs.centre_mm * (1.0, -1.0, 1.0), sweep_rad=-path.arcs.sweep_rad
    )
    frames = (Frame(), Frame(compensation=replace(of, left=not of.left)))
    assert (
        np.flatnonzero(gouging(replace(path, end_mm=end, arcs=arcs, frames=frames), seen=seen)).tolist()
        == found
    )
    return found


def steps(*xy: tuple[float, float]) -> list[Move]:
    return [feed(x, y, 0.0, **ON) for x, y in xy]


@pytest.mark.parametrize(("middle", "expected"), [(9.999, [1]), (10.001, []), (-0.1, [])])
def test_a_move_between_two_concave_corners_is_longer_than_what_both_take(
    middle: float, expected: list[int]
) -> None:
    """Along +X and then up, with the cutter on the left, both corners are concave; downwards neither is."""
    assert bad(*steps((20.0, 0.0), (20.0, middle), (0.0, middle))) == expected


def test_the_last_move_loses_nothing_at_its_end() -> None:
    assert bad(*steps((20.0, 0.0), (20.0, 5.001))) == []
    assert bad(*steps((20.0, 0.0), (20.0, 4.999))) == [1]
    assert bad(*steps((20.0, 0.0), (20.0, 4.999)), of=RIGHT) == []


@pytest.mark.parametrize(("length", "expected"), [(5.0, [0]), (5.001, []), (4.0, [0])])
def test_the_first_move_is_longer_than_the_radius(length: float, expected: list[int]) -> None:
    assert bad(*steps((length, 0.0), (length + 30.0, 0.0))) == expected
    # what its corner takes does not count
    assert bad(*steps((length, 0.0), (length, 30.0))) == expected


def test_a_corner_takes_the_radius_times_the_tangent_of_half_its_angle() -> None:
    """By 60 degrees: 5 tan 30 = 2.887 mm; the bound of the move is where it begins."""
    for length, expected in ((2.886, [1]), (2.888, [])):
        x, y = length * math.cos(math.pi / 3), length * math.sin(math.pi / 3)
        assert bad(*steps((20.0, 0.0), (20.0 + x, y))) == expected


@pytest.mark.parametrize(
    ("angle", "lost"),
    [(0.04, 5 * math.sin(0.04)), (0.049, 5 * math.sin(0.049)), (0.051, 5 * math.tan(0.0255))],
)
def test_a_smooth_corner_takes_of_the_next_move_alone(angle: float, lost: float) -> None:
    """Below 0.05 rad the next move begins where the control ended the last one."""
    for length, expected in ((lost * 0.999, [1]), (lost * 1.001, [])):
        x, y = length * math.cos(angle), length * math.sin(angle)
        assert bad(*steps((20.0, 0.0), (20.0 + x, y))) == expected
    # of the last one, which begins at a smooth corner too, it takes nothing
    straight = steps((20.0, 0.0), (20.05, 0.0), (20.05 + math.cos(angle), math.sin(angle)))
    assert bad(*straight) == ([1] if angle > 0.05 else [])


@pytest.mark.parametrize(("angle", "expected"), [(math.pi - 0.04, []), (math.pi - 0.06, [1])])
def test_a_reversal_is_no_concave_corner(angle: float, expected: list[int]) -> None:
    assert bad(*steps((20.0, 0.0), (20.0 + math.cos(angle), math.sin(angle)))) == expected


def test_a_convex_corner_takes_nothing() -> None:
    for angle in (-0.02, -0.04, -1.0, -3.0):
        assert bad(*steps((20.0, 0.0), (20.0 + 0.1 * math.cos(angle), 0.1 * math.sin(angle)))) == []


def test_moves_that_go_nowhere_in_the_plane_do_not_count() -> None:
    """A descent between two moves of one corner."""
    down = feed(20.0, 0.0, -3.0, **ON)
    assert bad(*steps((20.0, 0.0)), down, *steps((20.0, 4.9), (20.0, 40.0))) == [2]
    assert bad(*steps((20.0, 0.0)), down, *steps((20.0, 5.1), (20.0, 40.0))) == []
    assert bad(feed(0.0, 0.0, -3.0, **ON)) == []


@pytest.mark.parametrize(
    ("radius", "degrees", "of", "expected"),
    [
        # the inside of an arc that is as wide as the cutter or narrower
        (4.9, 90.0, LEFT, [1]), (5.0, 90.0, LEFT, [1]), (5.1, 90.0, LEFT, []), (4.9, 90.0, RIGHT, []),
        (4.9, -90.0, RIGHT, [1]), (5.1, -90.0, RIGHT, []), (4.9, -90.0, LEFT, []), (0.1, -90.0, LEFT, []),
    ],
)  # fmt: skip
def test_the_cutter_has_to_fit_into_an_arc(
    radius: float, degrees: float, of: CutterCompensation, expected: list[int]
) -> None:
    side = math.copysign(1.0, degrees)
    turn = arc(20.0 + radius, side * radius, 0.0, centre=(20.0, side * radius, 0.0), degrees=degrees, **ON)
    assert bad(*steps((20.0, 0.0)), turn, *steps((20.0 + radius, side * 50.0)), of=of) == expected


def test_a_whole_circle_is_a_move_too() -> None:
    circle = arc(20.0, 0.0, 0.0, centre=(20.0, 4.0, 0.0), degrees=360.0, **ON)
    assert bad(*steps((20.0, 0.0)), circle) == [1]
    assert bad(*steps((20.0, 0.0)), circle, of=RIGHT) == []


def test_corners_of_arcs_count_along_their_tangents() -> None:
    """A quarter from (20, 0) to (28, 8), which begins along +X and ends along +Y. The cutter runs along it
    at 3 mm: 4.71 mm. Then to the left: a corner of 90 degrees takes 5 mm."""
    quarter = arc(28.0, 8.0, 0.0, centre=(20.0, 8.0, 0.0), degrees=90.0, **ON)
    assert bad(*steps((20.0, 0.0)), quarter, *steps((28.0, 30.0))) == []
    assert bad(*steps((20.0, 0.0)), quarter, *steps((0.0, 8.0))) == [1]
    # onto it from below: the arc begins to the right of that
    assert bad(*steps((20.0, -20.0), (20.0, 0.0)), quarter, *steps((28.0, 30.0))) == []
    # the same the other way round, beside the outside: it runs from +Y to +X
    other = arc(28.0, 8.0, 0.0, centre=(28.0, 0.0, 0.0), degrees=-90.0, **ON)
    assert bad(*steps((20.0, 0.0)), other, *steps((40.0, 8.0))) == []
    # the first corner, from +X to +Y, is concave, but the move is longer outside: 13 mm by 90 degrees
    assert bad(*steps((5.5, 0.0), (20.0, 0.0)), other) == []
    assert bad(*steps((15.5, 0.0), (20.0, 0.0)), other) == [1]


def test_only_where_the_direction_changes_behind_the_move_is_it_seen() -> None:
    narrow = arc(24.0, 4.0, 0.0, centre=(20.0, 4.0, 0.0), degrees=90.0, **ON)
    goes_on, turns = steps((24.0, 30.0)), steps((44.0, 4.0))
    assert bad(*steps((20.0, 0.0)), narrow, *goes_on, seen=True) == []
    assert bad(*steps((20.0, 0.0)), narrow, *turns, seen=True) == [1]
    # not at the end of the contour; the first move is looked at in any case
    assert bad(*steps((20.0, 0.0)), narrow, seen=True) == []
    assert bad(*steps((4.0, 0.0), (44.0, 0.0)), seen=True) == [0]


def test_each_contour_is_looked_at_alone() -> None:
    first = steps((20.0, 0.0), (20.0, 4.0))
    assert bad(*first, rapid(0.0, 0.0, 0.0), *first) == [1, 4]
    # G40 between: the last move of the first is no neighbour of the next
    assert (
        bad(*steps((20.0, 0.0)), rapid(20.0, 20.0, 0.0), *steps((20.0, 26.0), (40.0, 26.0)), of=RIGHT) == []
    )
    assert bad(rapid(20.0, 0.0, 0.0), *steps((20.0, 4.0))) == [1]
    assert bad(*first, of=replace(LEFT, radius_mm=0.0)) == []


# -- cuts ---------------------------------------------------------------------------------------------


def away(path: Toolpath, *cuts: tuple[int, float]) -> list[bool]:
    move, share = (np.array(column) for column in zip(*cuts, strict=True))
    return away_from_corners(path, move, share).tolist()


def test_parts_end_twice_what_a_corner_takes_away_from_it() -> None:
    """A move of 100 mm between two corners that take 5 mm each: its parts end from 10 to 90 mm."""
    path = contour(*steps((20.0, 0.0), (20.0, 100.0), (0.0, 100.0)))
    shares = (0.099, 0.101, 0.5, 0.899, 0.901)
    assert away(path, *((1, s) for s in shares)) == [False, True, True, True, False]
    # the first has a corner at its end alone, the last at its begin
    assert away(path, (0, 0.001), (0, 0.499), (0, 0.501), (2, 0.499), (2, 0.501), (2, 0.999)) == [
        True, True, False, False, True, True,
    ]  # fmt: skip
    outside = contour(*steps((20.0, 0.0), (20.0, 100.0), (0.0, 100.0)), of=RIGHT)
    assert away(outside, (1, 0.001), (1, 0.999)) == [True, True]


def test_of_arcs_the_radius_of_the_cutter_more_is_kept_away() -> None:
    """A half circle of radius 20, 62.8 mm long, onto which the contour turns left by 90 degrees."""
    half = arc(20.0, 40.0, 0.0, centre=(20.0, 20.0, 0.0), degrees=180.0, **ON)
    path = contour(*steps((20.0, -30.0), (20.0, 0.0)), half, *steps((-30.0, 40.0)))
    # from +Y to +X the first corner is convex, and the half circle goes on along -X
    assert away(path, (2, 0.001), (2, 0.999)) == [True, True]
    path = contour(
        *steps((0.0, 30.0), (20.0, 30.0)), rapid(0.0, 0.0, 0.0), *steps((20.0, 30.0), (20.0, 0.0)), half
    )
    # from -Y to +X: 10 mm, and 5 mm more
    assert away(path, (5, 14.9 / (20 * math.pi)), (5, 15.1 / (20 * math.pi))) == [False, True]
    assert away(path, (4, 1 - 9.9 / 30), (4, 1 - 10.1 / 30)) == [False, True]
    assert away(path, (5, 0.999)) == [True]
    end = contour(*steps((20.0, 0.0)), half, *steps((20.0, 10.0)))
    assert away(end, (1, 1 - 14.9 / (20 * math.pi)), (1, 1 - 15.1 / (20 * math.pi)), (1, 0.001)) == [
        False,
        True,
        True,
    ]


def test_moves_beside_contours_may_be_cut_anywhere() -> None:
    path = contour(feed(20.0, 0.0, 0.0), *steps((20.0, 30.0), (0.0, 30.0)), feed(0.0, 0.0, 0.0))
    assert away(path, (0, 0.99), (3, 0.01), (1, 0.99), (2, 0.01)) == [True, True, False, False]


# -- which moves stay whole, which axes are held --------------------------------------------------------


def columns(path: Toolpath) -> tuple[list[int], list[int], list[str], list[int]]:
    """The whole moves, the steady ones, the held axes of each move, and the rapids beside the contour."""
    found = Contour.of(path)
    assert found is not None
    held = ["".join("XYZ"[a] for a in np.flatnonzero(row)) for row in found.held]
    return (
        np.flatnonzero(found.whole).tolist(),
        np.flatnonzero(found.steady).tolist(),
        held,
        found.beside.tolist(),
    )


def test_the_moves_onto_a_contour_and_off_it_are_whole() -> None:
    path = contour(
        feed(5.0, 5.0, 0.0), *steps((20.0, 0.0), (20.0, 30.0), (0.0, 30.0)),
        feed(0.0, 0.0, 0.0), feed(9.0, 9.0, 0.0), feed(0.0, 0.0, 0.0),
    )  # fmt: skip
    # off it: the move that takes each axis away
    assert columns(path) == ([1, 4, 5], [1, 2, 3, 4, 5], ["", "", "", "", "X", "", ""], [])


def test_until_each_axis_moves_it_is_held() -> None:
    """Down before the entry; up, then X, then Y behind the exit."""
    path = contour(
        rapid(5.0, 5.0, 9.0), feed(5.0, 5.0, 0.0, **ON), *steps((20.0, 0.0), (20.0, 30.0)),
        feed(20.0, 30.0, -2.0, **ON), *steps((0.0, 30.0)), rapid(0.0, 30.0, 9.0), rapid(7.0, 30.0, 9.0),
        rapid(7.0, 0.0, 9.0), rapid(1.0, 1.0, 9.0),
    )  # fmt: skip
    whole, steady, held, beside = columns(path)
    assert held == ["", "XY", "", "", "XY", "", "XY", "Y", "", ""]
    assert whole == [1, 2, 4, 6, 7, 8]
    assert steady == [1, 2, 3, 4, 5, 6, 7, 8]
    assert beside == [6, 7]


def test_axes_of_the_plane_alone_are_held() -> None:
    zx = CutterCompensation(1, True, R_MM)
    path = contour(
        rapid(5.0, 5.0, 9.0),
        feed(20.0, 5.0, 0.0, **ON),
        feed(20.0, 9.0, 0.0, **ON),
        rapid(20.0, 0.0, 0.0),
        of=zx,
    )
    assert columns(path)[2] == ["", "", "XZ", "XZ"]


def test_an_axis_that_never_moves_is_held_to_the_end() -> None:
    path = contour(rapid(5.0, 5.0, 9.0), *steps((20.0, 0.0)), rapid(20.0, 1.0, 9.0), rapid(20.0, 2.0, 9.0))
    assert columns(path) == ([1, 2, 3], [1, 2, 3], ["", "", "X", "X"], [2, 3])
    down = contour(rapid(5.0, 5.0, 9.0), feed(5.0, 5.0, 0.0, **ON))
    assert columns(down) == ([1], [1], ["", "XY"], [])


def test_without_compensation_there_is_no_contour() -> None:
    assert Contour.of(contour(feed(1.0, 0.0, 0.0))) is None


def test_held_axes_keep_their_last_command() -> None:
    """Under G40 a rapid in Z gets no word for X and Y, though the error there would ask for it."""
    path = contour(
        rapid(5.0, 5.0, 0.0),
        *steps((20.0, 0.0), (20.0, 30.0)),
        rapid(20.0, 30.0, 50.0),
        rapid(0.0, 0.0, 50.0),
    )
    leaning = linear([[0, 0, 1e-3], [0, 0, 1e-3], [0, 0, 0]])
    rows = plan(path, leaning, Limits(0.001))
    assert rows.command_mm[3:] == pytest.approx(np.array([[20.0, 30.0, 50.0], [-0.05, -0.05, 50.0]]))
    assert rows.uncorrected.tolist() == [3]


@pytest.mark.parametrize(
    "other", [RIGHT, CutterCompensation(0, True, 6.0), CutterCompensation(1, True, R_MM)]
)
def test_a_contour_that_changes_its_side_is_refused_with_its_line(other: CutterCompensation) -> None:
    frames = (
        Frame(),
        Frame(compensation=LEFT),
        Frame(compensation=other),
        Frame(unit_mm=2.0, compensation=LEFT),
    )

    def path(*frame: int) -> Toolpath:
        return toolpath(
            *(feed(10.0 * k, 0.0, 0.0, frame=f, line=20 + k) for k, f in enumerate(frame)), frames=frames
        )

    with pytest.raises(ProgramError, match="program G40 between the two contours") as caught:
        Contour.of(path(0, 1, 1, 2, 2, 1))
    assert (caught.value.line, caught.value.code) == (23, "OLP524")
    # G40 between them, or another frame with the same compensation, is no change
    assert Contour.of(path(0, 1, 1, 0, 2, 2)) is not None
    assert Contour.of(path(0, 1, 3, 1)) is not None
