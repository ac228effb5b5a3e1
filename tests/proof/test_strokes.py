"""Strokes of holes whose errors are known by hand: across the axis, at the bottom, and at the start."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from cases.paths import CYCLE, NAN, PER_TOOL_MM, Known, Move, columns, hole, line, program, rapid, toolpath

from olp.core.arrays import Array
from olp.core.toolpath import Frame, Toolpath
from olp.program.holes import Hole
from olp.proof.strokes import strokes_mm

BEND_MM = 1e-4
#: plane to the axes across a hole and along it
ROLL = ((0, 1, 2), (2, 0, 1), (1, 2, 0))


def drilled(*depths: float, plane: int = 0, x: float = 0.0, r: float = 5.0, frame: int = 0) -> list[Move]:
    """Rapids to the hole at `x` of the first axis, from 20 mm down to `r`; a stroke to each depth, back."""

    def at(level: float) -> tuple[float, ...]:
        place = np.zeros(3)
        place[[ROLL[plane][0], ROLL[plane][2]]] = x, level
        return tuple(place.tolist())

    moves = [rapid(*at(20.0), frame=frame), rapid(*at(r), flag=CYCLE, frame=frame)]
    for depth in depths:
        moves += [line(*at(depth), flag=CYCLE, frame=frame), rapid(*at(r), flag=CYCLE, frame=frame)]
    return moves


def off(*error: float, between: tuple[float, float] = (-math.inf, math.inf), axis: int = 2) -> Known:
    """An error at these positions of an axis alone."""

    def of(axis_mm: Array) -> Array:
        some = (axis_mm[:, axis] >= between[0]) & (axis_mm[:, axis] <= between[1])
        return np.where(some[:, None], error, 0.0)

    return Known(of)


def stated(
    moves: list[Move],
    model: Known,
    theirs: list[Move] | None = None,
    *,
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0),
    frames: tuple[Frame, ...] = (Frame(),),
    **more: float,
) -> tuple[int, float]:
    """The move to the bottom of one hole, and um."""
    plane = int(more.get("plane", 0))
    path = toolpath(*moves, frames=frames)
    other = path if theirs is None else toolpath(*theirs, frames=frames)
    r, z = more.get("r", 5.0), more.get("z", -10.0)
    mine = program(path, hole(1, len(path), plane=plane, r=r, z=z))
    holes = columns(hole(1, len(other), plane=plane, r=r, z=z))
    move, worst = strokes_mm(mine, path.end_mm + np.array(shift), other, holes, model, BEND_MM)
    return int(move[0]), 1e3 * float(worst[0])


PECKS = drilled(-4.0, -8.0, -10.0)


def test_a_right_hole_is_not_off() -> None:
    assert stated(PECKS, Known()) == (6, 0.0)
    # of other pecks neither
    assert stated(PECKS, Known(), drilled(-5.0, -10.0)) == (6, 0.0)


def test_pecks_shorter_than_the_clearance_begin_above_r() -> None:
    """With Q 0.2 the return to 0.254 above the peck ends 0.054 above R: that is no deviation."""
    turned = [rapid(0.0, 0.0, 5.054, flag=CYCLE), line(0.0, 0.0, -10.0, flag=CYCLE)]
    short = [*drilled(4.8), *turned]
    assert stated(short, Known())[1] < 1e-9
    # across the axis it counts there as well
    assert stated(short, off(0.003, 0.0, 0.0, between=(5.01, 6.0)))[1] == pytest.approx(3.0, abs=1e-4)


@pytest.mark.parametrize("plane", (0, 1, 2))
@pytest.mark.parametrize("turned", (1.0, -1.0))
def test_across_its_axis_and_at_its_bottom(plane: int, turned: float) -> None:
    """3 um aside and 4 um too high or too deep at the bottom; elsewhere the depth does not count. With
    `turned` below 0 the hole is drilled from below."""
    moves = drilled(-4.0 * turned, -10.0 * turned, plane=plane, r=5.0 * turned)
    first, _, along = ROLL[plane]
    at = {"plane": plane, "r": 5.0 * turned, "z": -10.0 * turned}
    error = np.zeros(3)
    error[first] = 0.003
    assert stated(moves, off(*error), **at) == (4, pytest.approx(3.0, rel=1e-5))
    for sign in (1, -1):
        error[along] = sign * 0.004
        bottom = sorted((-10.0 * turned - 1, -10.0 * turned + 1))
        model = off(*error, between=(bottom[0], bottom[1]), axis=along)
        assert stated(moves, model, **at) == (4, pytest.approx(5.0, rel=1e-5))
        model = off(*(error * (np.arange(3) == along)), between=(-4.5, 4.5), axis=along)
        assert stated(moves, model, **at)[1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("level", (5.0, -4.0, -8.0))
def test_a_stroke_counts_where_it_begins_and_ends(level: float) -> None:
    assert stated(PECKS, off(0.003, 0.004, 0.0, between=(level - 0.1, level + 0.1)))[1] == pytest.approx(5.0)


def test_a_stroke_counts_in_between() -> None:
    def of(axis_mm: Array) -> Array:
        return np.outer(np.sin(np.pi * (axis_mm[:, 2] + 10) / 15), [0.0, 0.007, 0.0])

    model = Known(of, 0.007 * (np.pi / 15) ** 2)
    assert stated(drilled(-10.0), model)[1] == pytest.approx(7.0, abs=0.1)


def test_the_rapids_of_a_hole_do_not_count() -> None:
    assert stated(PECKS, off(0.003, 0.004, 0.0, between=(6.0, 30.0)))[1] == 0.0


@pytest.mark.parametrize(("error_um", "um"), [(9.0, 9.0), (-9.0, 0.0)])
@pytest.mark.parametrize("turned", (1.0, -1.0))
def test_a_stroke_that_begins_before_its_hole_counts(error_um: float, um: float, turned: float) -> None:
    level = 5.0 * turned
    model = off(0.0, 0.0, 1e-3 * turned * error_um, between=(level - 0.1, level + 0.1))
    moves = drilled(-10.0 * turned, r=level)
    assert stated(moves, model, r=level, z=-10.0 * turned)[1] == pytest.approx(um, abs=1e-5)


def test_the_hole_begins_at_its_level_or_where_its_strokes_are() -> None:
    """Strokes from 8 mm on, above the level of 5 mm; with one to 9 mm, nothing below that is before it."""
    high = off(0.0, 0.0, 0.006, between=(7.9, 8.1))
    # of the corrected hole alone: they begin 3 mm above the nominal one
    assert stated(drilled(-10.0), high, drilled(-10.0, r=8.0))[1] == pytest.approx(3006.0, abs=1e-2)
    # of both
    assert stated(drilled(-10.0, r=8.0), high)[1] == pytest.approx(6.0, abs=1e-2)
    assert stated(drilled(9.0, -10.0, r=8.0), high)[1] == pytest.approx(0.0, abs=1e-5)


def test_the_deepest_stroke_counts_wherever_it_stands() -> None:
    """The stroke to -10 mm is 2 mm short in the corrected hole, and the one before it reaches -9 mm."""
    other = drilled(-4.0, -9.0, -8.0)
    assert stated(PECKS, Known(), other)[1] == pytest.approx(1000.0)
    assert stated(PECKS, Known(), drilled(-4.0, -11.0, -10.0))[1] == pytest.approx(1000.0)


def test_the_zero_may_lie_elsewhere() -> None:
    assert stated(PECKS, Known(), shift=(0.003, 0.0, 0.004))[1] == pytest.approx(5.0)
    model = off(0.003, 0.0, 0.004)
    assert stated(PECKS, model, shift=(0.003, 0.0, 0.004))[1] == pytest.approx(0.0, abs=1e-6)


def test_each_stroke_has_its_tool() -> None:
    frames = (Frame(), Frame(tool_mm=(300.0, 0.0, 0.0)), Frame(tool_mm=(0.0, 400.0, 0.0)))
    moves = [*drilled(-4.0, frame=1), *drilled(-10.0, frame=2)[1:]]
    assert stated(moves, Known(), frames=frames)[1] == pytest.approx(400e3 * PER_TOOL_MM)
    moves = [*drilled(-4.0, frame=2), *drilled(-10.0, frame=1)[1:]]
    assert stated(moves, Known(backlash_mm=(1e-9, 0.0, 0.0)), frames=frames)[1] == pytest.approx(
        400e3 * PER_TOOL_MM, rel=1e-4
    )


# -- backlash --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("before", "um"), [(-50.0, 5.0), (50.0, 5.0), (None, 0.0)])
def test_a_hole_lies_behind_in_the_direction_it_was_reached_from(before: float | None, um: float) -> None:
    moves = drilled(-10.0)[1:]
    head = rapid(0.0 if before is None else before, 0, 20)
    assert stated([head, *moves], Known(backlash_mm=(0.01, 0.0, 0.0)))[1] == pytest.approx(um, rel=1e-5)


def test_a_stroke_begins_and_ends_above_with_backlash_along_it() -> None:
    """Reached from above the tip is 5 um too high at the start and at the bottom; a stroke that begins where
    a rapid rose to is 5 um too low there."""
    model = Known(backlash_mm=(0.0, 0.0, 0.01))
    assert stated(PECKS, model)[1] == pytest.approx(5.0, rel=1e-5)
    below = [rapid(0, 0, -20), rapid(0, 0, 5, flag=CYCLE), line(0, 0, -10, flag=CYCLE)]
    model = Known(off(0.0, 0.0, -0.005, between=(-11.0, -9.0)).of, backlash_mm=(0.0, 0.0, 0.01))
    assert stated(below, model)[1] == pytest.approx(0.0, abs=1e-5)


@dataclass(eq=False)
class Leaning(Known):
    """The tip goes aside as Z takes up its backlash, by 10 um at 5 mm and not at -10 mm."""

    def error(self, axis_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
        assert play is not None
        error = super().error(axis_mm, tool_mm, play)
        error[:, 0] += 0.005 * (1 - play[:, 2]) * (axis_mm[:, 2] + 10) / 15
        return error


def test_a_stroke_counts_where_it_has_taken_up_its_backlash() -> None:
    """10 um below its start, where the tip is 10 um aside."""
    moves = [rapid(0, 0, -20), rapid(0, 0, 5, flag=CYCLE), line(0, 0, -10, flag=CYCLE)]
    got = stated(moves, Leaning(backlash_mm=(0.0, 0.0, 0.01)))[1]
    assert got == pytest.approx(10.0 * (1 - 0.01 / 15), abs=0.001)


def test_a_stroke_that_is_shorter_than_its_backlash_takes_up_a_part_of_it() -> None:
    """8 um of 10 um: the tip is 8 um aside at its end."""
    moves = [rapid(0, 0, -20), rapid(0, 0, 5, flag=CYCLE), line(0, 0, 4.992, flag=CYCLE)]
    got = stated(moves, Leaning(backlash_mm=(0.0, 0.0, 0.01)), z=4.992)[1]
    # and 3 um above the bottom, where the play is 0.6 of its range
    assert got == pytest.approx(math.hypot(8.0, 3.0), abs=0.01)


# -- what has no figure ----------------------------------------------------------------------------------


def test_a_hole_at_an_unknown_place_has_none() -> None:
    moves = drilled(-10.0, x=NAN)
    move, um = stated(moves, Known())
    assert (move, math.isnan(um)) == (2, True)


def test_a_hole_without_strokes_has_none() -> None:
    path = toolpath(rapid(0, 0, 20), rapid(0, 0, 5, flag=CYCLE), rapid(0, 0, -10, flag=CYCLE))
    mine = program(path, hole(1, 3, r=5.0, z=-10.0))
    move, worst = strokes_mm(mine, path.end_mm, path, mine.holes, Known(), BEND_MM)
    assert (move.tolist(), np.isnan(worst).tolist()) == ([2], [True])


@pytest.mark.parametrize("holes", ((), (hole(1, 3, r=5.0, z=-10.0),) * 2))
def test_other_numbers_of_holes_are_not_compared(holes: tuple[Hole, ...]) -> None:
    path = toolpath(*drilled(-10.0))
    mine = program(path, hole(1, 4, r=5.0, z=-10.0))
    assert [len(part) for part in strokes_mm(mine, path.end_mm, path, columns(*holes), Known(), BEND_MM)] == [
        0,
        0,
    ]
    none = program(path)
    assert [len(part) for part in strokes_mm(none, path.end_mm, path, columns(), Known(), BEND_MM)] == [0, 0]


def both(first: list[Move], second: list[Move]) -> tuple[Toolpath, tuple[Hole, ...]]:
    """Two holes one behind the other."""
    count = len(first)
    holes = (hole(1, count, r=5.0, z=-10.0), hole(count + 1, count + len(second), r=5.0, z=-6.0))
    return toolpath(*first, *second), holes


def test_each_hole_has_its_own_figure_and_its_own_bottom() -> None:
    path, holes = both(drilled(-10.0), drilled(-4.0, -6.0, x=30.0))
    mine = program(path, *holes)
    model = off(0.003, 0.0, 0.0, between=(20.0, 40.0), axis=0)
    other, theirs = both(drilled(-3.0, -10.0), drilled(-6.0, x=30.0))
    move, worst = strokes_mm(mine, path.end_mm, other, columns(*theirs), model, BEND_MM)
    assert move.tolist() == [2, 8]
    assert 1e3 * worst == pytest.approx([0.0, 3.0], abs=1e-5)


def test_a_rapid_at_the_bottom_is_no_stroke_to_it() -> None:
    start = rapid(0, 0, -10, flag=CYCLE)
    path = toolpath(rapid(0, 0, 20), start, rapid(0, 0, 5, flag=CYCLE), line(0, 0, -10, flag=CYCLE))
    mine = program(path, hole(1, 4, r=5.0, z=-10.0))
    move, _ = strokes_mm(mine, path.end_mm, path, mine.holes, Known(), BEND_MM)
    assert move.tolist() == [3]


def test_a_hole_that_misses_its_bottom_ends_with_its_last_move() -> None:
    path = toolpath(*drilled(-9.0))
    mine = program(path, hole(1, 4, r=5.0, z=-10.0))
    move, _ = strokes_mm(mine, path.end_mm, path, mine.holes, Known(), BEND_MM)
    assert move.tolist() == [3]
    near = toolpath(*drilled(-9.9999999999, -10.0))
    mine = program(near, hole(1, 6, r=5.0, z=-10.0))
    assert strokes_mm(mine, near.end_mm, near, mine.holes, Known(), BEND_MM)[0].tolist() == [2]


def test_a_stroke_is_sampled_so_often_at_most() -> None:
    model = Known(curvature=1e9)
    stated(drilled(-10.0), model)
    assert [len(points) for points, _ in model.asked] == [257]
    assert model.asked[0][0][:, 2] == pytest.approx(np.linspace(5.0, -10.0, 257))
