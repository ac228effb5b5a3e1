"""How far the tip is off, of paths and errors that are known in closed form, and against a slow judge."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from cases.paths import (
    CYCLE,
    NAN,
    PER_TOOL_MM,
    WHOLE,
    Known,
    Move,
    arc,
    drawn,
    farthest,
    line,
    rapid,
    toolpath,
    wave,
)

from olp.core.arrays import Array
from olp.core.toolpath import Flag, Frame, Kind, Toolpath
from olp.proof import deviation
from olp.proof.deviation import Deviation, Tracer, cutting_moves, measure

BEND_MM = 1e-4


def of(
    path: Toolpath,
    model: Known,
    corrected: Toolpath | None = None,
    groups: list[int] | None = None,
    shift: Array | None = None,
    counted: int | None = None,
) -> Deviation:
    """The deviation of a path, or of its correction; the bend of one move is `counted`, or of all."""
    target = path.end_mm if shift is None else path.end_mm + shift
    ends = np.arange(len(path)) if groups is None else np.array(groups)
    counts = np.arange(len(path)) == counted if counted is not None else np.ones(len(path), bool)
    other = path if corrected is None else corrected
    return measure(path, target, other, ends, counts, model, BEND_MM)


def bends(path: Toolpath, model: Known) -> list[float]:
    """The bend of each move of a path."""
    return [of(path, model, counted=move).bend_mm for move in range(len(path))]


def linear(component: int, axis: int, slope: float) -> Known:
    def error(axis_mm: Array) -> Array:
        result = np.zeros(axis_mm.shape)
        result[:, component] = slope * axis_mm[:, axis]
        return result

    return Known(error)


# -- which moves count along their path ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "flag", "cuts"),
    [
        (Kind.RAPID, 0, False), (Kind.LINE, 0, True), (Kind.ARC_CW, 0, True), (Kind.ARC_CCW, WHOLE, True),
        (Kind.PROBE, 0, True), (Kind.PROBE, WHOLE, False), (Kind.PROBE, int(Flag.PASS), True),
        (Kind.LINE, WHOLE, True), (Kind.LINE, CYCLE, False), (Kind.LINE, CYCLE | WHOLE, False),
        (Kind.RAPID, CYCLE, False), (Kind.LINE, int(Flag.PASS | Flag.MACHINE), True),
    ],
)  # fmt: skip
def test_feed_moves_cut_but_cycles_and_touches_of_the_control_do_not(
    kind: Kind, flag: int, cuts: bool
) -> None:
    path = toolpath(line(1, 0, 0), Move(kind, (2.0, 0.0, 0.0), flag))
    assert cutting_moves(path).tolist() == [True, cuts]


# -- by hand ---------------------------------------------------------------------------------------------


def test_the_end_the_path_and_the_bend_of_a_line() -> None:
    """Half a wave of 10 um across a line: nothing at its ends, all of it between them."""
    path = toolpath(rapid(0, 0, 0), line(50, 0, 0), line(50, 9, 0), rapid(0, 9, 0))
    got = of(path, wave(1, 0, 0.01, 100.0))
    assert got.waypoint == pytest.approx([0.0] * 4, abs=1e-8)
    assert got.path == pytest.approx([0.0, 0.01, 0.0, 0.0], abs=1e-4)
    assert bends(path, wave(1, 0, 0.01, 100.0)) == pytest.approx([0.0, 0.01, 0.0, 0.0], abs=1e-4)
    assert got.side.tolist() == [0.0] * 4
    assert {part.dtype for part in (got.waypoint, got.path)} == {np.dtype(np.float32)}


def test_strokes_that_are_compared_elsewhere_have_no_samples_here() -> None:
    """A split stroke, and one of the same program behind it that is compared here, half a wave each."""
    path = toolpath(
        rapid(0, 0, 0), line(0, 0, -50, flag=CYCLE), rapid(0, 0, 0, flag=CYCLE), line(0, 0, -50, flag=CYCLE)
    )
    elsewhere = np.array([False, True, True, False])
    moves = rapid(0, 0, 0), line(0, 0, -9), line(0, 0, -50), rapid(0, 0, 0), line(0, 0, -50)
    groups, counted = np.array([0, 2, 3, 4]), np.ones(4, bool)
    model, other = wave(1, 2, 0.01, 100.0), toolpath(*moves)
    with_them, without = (
        measure(path, path.end_mm, other, groups, counted, model, BEND_MM, elsewhere=own)
        for own in (None, elsewhere)
    )
    assert with_them.path == pytest.approx([0.0, 0.01, 0.0, 0.01], abs=1e-4)
    # of the stroke only the ends of its parts count
    assert without.path == pytest.approx([0.0, 0.01 * math.sin(0.09 * math.pi * 2), 0.0, 0.01], abs=1e-4)


def test_the_first_move_bends_as_any_other() -> None:
    got = of(toolpath(line(50, 0, 0)), wave(1, 0, 0.01, 100.0))
    assert got.bend_mm == pytest.approx(0.01, abs=1e-4)


def test_a_bend_is_measured_from_the_chord_between_the_actual_ends() -> None:
    """A quarter of a wave rises from 0 to 10 um; its chord is 2.105 um below it at the most."""
    path = toolpath(rapid(0, 0, 0), line(25, 0, 0))
    got = of(path, wave(1, 0, 0.01, 100.0))
    share = 2 / math.pi * math.acos(2 / math.pi)
    most = math.sin(share * math.pi / 2) - share
    assert got.path[1] == pytest.approx(0.01, rel=1e-6)
    assert got.bend_mm == pytest.approx(0.01 * most, abs=5e-5)


def test_an_arc_has_no_bend_of_chords() -> None:
    path = toolpath(rapid(0, 0, 0), arc(20, 0, 0, centre=(10, 0, 0), sweep=-math.pi))
    got = of(path, wave(2, 0, 0.01, 40.0))
    assert got.path[1] == pytest.approx(0.01, abs=1e-4)
    assert got.bend_mm == 0.0


def test_the_error_goes_with_the_tool_of_each_move() -> None:
    frames = (Frame(), Frame(tool_mm=(0.0, 300.0, 0.0)), Frame(tool_mm=(0.0, 0.0, -400.0)))
    path = toolpath(rapid(0, 0, 0), line(9, 0, 0, frame=1), line(0, 0, 0, frame=2), frames=frames)
    got = of(path, Known())
    assert got.waypoint == pytest.approx([0.0, 300 * PER_TOOL_MM, 400 * PER_TOOL_MM], rel=1e-5)
    # the last one begins where the tool before it ended, though it is off in another direction
    assert got.path == pytest.approx([0.0, 300 * PER_TOOL_MM, 400 * PER_TOOL_MM], rel=1e-5)


def test_a_cut_begins_where_the_move_before_it_left_the_tip() -> None:
    """The tip ends the first cut 30 um short of its line and 3 um aside: the second is off there."""
    frames = (Frame(tool_mm=(0.0, 0.0, 300.0)), Frame())
    path = toolpath(
        rapid(0, 0, 0), rapid(9, 0, 0), line(9, 9, 0, frame=1), rapid(9, 0, 0, frame=1), frames=frames
    )
    got = of(path, Known())
    assert got.waypoint == pytest.approx([0.003, 0.003, 0.0, 0.0], abs=1e-8)
    assert got.path == pytest.approx([0.003, 0.003, 0.003, 0.0], abs=1e-8)


def test_a_cut_begins_where_it_was_left_along_the_axes_that_are_known() -> None:
    """The rapid to it ends 10 um aside, and Z is not known yet."""
    tail = line(20, 0, NAN), rapid(20, 0, 5), line(0, 0, 5)
    start = (0.0, 0.0, NAN)
    nominal = toolpath(rapid(0, 0, NAN), *tail, start=start)
    corrected = toolpath(rapid(0, 0.01, NAN), *tail, start=start)
    got = of(nominal, Known(), corrected, [0, 1, 2, 3])
    assert got.path == pytest.approx([0.01, 0.01, 0.0, 0.0], abs=1e-8)


def test_steps_between_moves_belong_to_the_later_one() -> None:
    """A step of 2 um beside its line and one of 4 um beyond its end count at the ends of their parts."""
    nominal = toolpath(rapid(0, 0, 0), line(20, 0, 0), line(20, 30, 0))
    corrected = toolpath(
        rapid(0, 0, 0), line(5, 0.002, 0), line(20, 0, 0), line(20.003, 0, 0), line(20, 30, 0)
    )
    got = of(nominal, Known(), corrected, [0, 2, 4])
    assert got.waypoint == pytest.approx([0.0] * 3, abs=1e-8)
    assert got.path == pytest.approx([0.0, 0.002, 0.003], abs=1e-8)


def test_the_target_of_a_move_may_lie_elsewhere_than_its_end() -> None:
    """The zero has an error of 7 um in Y: corrected commands follow it, nominal ones do not."""
    shift = np.array([0.0, 0.007, 0.0])
    half = {"centre": (15.0, 0.0, 0.0), "sweep": math.pi}
    nominal = toolpath(rapid(0, 0, 0), line(10, 0, 0), arc(20, 0, 0, **half), start=(0, 0, 0))
    moved = toolpath(
        rapid(0, 0.007, 0), line(10, 0.007, 0),
        arc(20, 0.007, 0, centre=(15.0, 0.007, 0.0), sweep=math.pi), start=(0, 0, 0),
    )  # fmt: skip
    assert of(nominal, Known(), moved, [0, 1, 2], shift).path == pytest.approx([0.0] * 3, abs=1e-8)
    assert of(nominal, Known(), shift=shift).path == pytest.approx([0.007] * 3, abs=1e-6)


@pytest.mark.parametrize("unknown", (0, 1, 2))
def test_an_axis_that_is_never_known_does_not_count(unknown: int) -> None:
    start, ends = np.zeros(3), np.array([[10.0, 20.0, 30.0], [40.0, 20.0, 50.0]])
    start[unknown], ends[:, unknown] = NAN, NAN
    path = toolpath(rapid(*ends[0]), line(*ends[1]), start=tuple(start.tolist()))

    def error(axis_mm: Array) -> Array:
        return np.where(np.isnan(axis_mm), NAN, [0.003, 0.004, 0.012])

    known = [size for axis, size in enumerate((0.003, 0.004, 0.012)) if axis != unknown]
    got = of(path, Known(error))
    assert got.waypoint == pytest.approx([math.hypot(*known)] * 2, rel=1e-5)
    assert got.path == pytest.approx([math.hypot(*known)] * 2, rel=1e-5)


def test_a_place_that_is_wholly_unknown_has_no_figure() -> None:
    none = (NAN, NAN, NAN)
    path = toolpath(line(1, 0, 0), rapid(*none, flag=int(Flag.CONTROL)), line(5, 0, 0), start=none)
    got = of(path, linear(1, 0, 1e-3))
    assert got.waypoint == pytest.approx([0.001, 0.0, 0.005], rel=1e-5)
    assert got.path[[0, 2]] == pytest.approx([0.001, 0.005], rel=1e-5)


def test_parts_between_count_along_the_axes_that_are_known() -> None:
    """Z is not known at first: half a wave across a line and across an arc, 5 mm above nothing."""
    moves = (
        rapid(0, 0, NAN), line(50, 0, NAN), arc(50, 30, NAN, centre=(50, 15, NAN), sweep=math.pi),
        rapid(50, 30, 5), line(0, 30, 5), line(0, 0, 5),
    )  # fmt: skip
    path = toolpath(*moves, start=(0.0, 0.0, NAN))
    got = of(path, wave(1, 0, 0.01, 100.0))
    # the sine at X 65, across the arc there and then along it
    assert got.path[[0, 1, 3, 4, 5]] == pytest.approx([0.0, 0.01, 0.0, 0.01, 0.0], abs=1e-4)
    angle = np.linspace(-math.pi / 2, math.pi / 2, 2001)
    across = 0.01 * np.sin(2 * np.pi * (50 + 15 * np.cos(angle)) / 100) * np.sin(angle)
    assert got.path[2] == pytest.approx(np.abs(across).max(), rel=0.01)
    each = bends(path, wave(1, 0, 0.01, 100.0))
    assert each == pytest.approx([0.0, 0.01, 0.0, 0.0, 0.01, 0.0], abs=1e-4)
    assert 1e3 * of(path, wave(2, 0, 0.01, 100.0)).path == pytest.approx([0, 0, 0, 0, 10, 0], abs=0.1)


def test_the_first_cut_begins_where_the_path_does() -> None:
    path = toolpath(line(25, 0, 0), line(25, 9, 0))
    assert of(path, wave(1, 0, 0.01, 100.0, phase=math.pi / 2)).path == pytest.approx([0.01, 0.0], abs=1e-8)


@pytest.mark.parametrize(("error_um", "um"), [(10.0, 0.0), (-10.0, 10.0)])
def test_a_first_cut_that_begins_along_its_line_is_not_off(error_um: float, um: float) -> None:
    model = Known(lambda axis_mm: 1e-3 * error_um * np.outer(1 - axis_mm[:, 0] / 25, (1.0, 0.0, 0.0)))
    assert 1e3 * of(toolpath(line(25, 0, 0)), model).path == pytest.approx([um], abs=1e-5)


def test_a_group_without_moves_has_the_end_before_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hole with a peck less: its last stroke ends where the one before it did."""
    nominal = toolpath(rapid(0, 0, 0), line(0, 0, -5), line(0, 0, -7), line(0, 9, -7))
    corrected = toolpath(rapid(0, 0, 0), line(0, 0.001, -5), line(0, 9, -7))
    for block in (1, 2, 3, 9):
        monkeypatch.setattr(deviation, "_BLOCK", block)
        got = of(nominal, Known(), corrected, [0, 1, 1, 2])
        assert got.waypoint == pytest.approx([0.0, 0.001, math.hypot(2.0, 0.001), 0.0])
        assert got.path[:3] == pytest.approx([0.0, 0.001, math.hypot(2.0, 0.001)])
        # from there the last cut begins
        assert got.path[3] == pytest.approx(2.0, abs=1e-6)


# -- from where an axis is unknown -----------------------------------------------------------------------

PARTLY = (0.0, NAN, 0.0)


def test_a_cut_from_an_unknown_place_counts_with_the_largest_of_the_box() -> None:
    path = toolpath(line(0, 50, 0), line(0, 60, 0), start=PARTLY)
    got = of(path, wave(0, 1, 0.02, 37.0))
    assert got.path[0] == pytest.approx(0.02, abs=1e-4)
    assert got.path[1] < 0.018
    # a rapid does not
    assert of(toolpath(rapid(0, 50, 0), start=PARTLY), wave(0, 1, 0.02, 37.0)).path[0] < 0.018


def test_a_line_over_an_unknown_axis_is_tried_at_its_ends_and_between() -> None:
    """What is straight over the box needs 8 steps; the known axes are at their command."""
    model = Known()
    of(toolpath(line(3, 50, 4), start=(3.0, NAN, 4.0)), model)
    tried = model.asked[-1][0]
    assert tried[:, 1] == pytest.approx(np.linspace(-100, 100, 9))
    assert (tried[:, [0, 2]] == (3.0, 4.0)).all()


@pytest.mark.parametrize(("start", "most"), [((0.0, NAN, 0.0), 1025), ((0.0, NAN, NAN), 129**2)])
def test_what_bends_much_is_tried_so_often_and_no_more(start: tuple[float, ...], most: int) -> None:
    model = Known(curvature=1e9)
    of(toolpath(line(0, 50, 5), start=start), model)  # type: ignore[arg-type]
    assert len(model.asked[-1][0]) == most


def test_a_cut_with_two_unknown_axes_counts_along_the_third() -> None:
    def error(axis_mm: Array) -> Array:
        result = np.zeros(axis_mm.shape)
        result[:, 0] = 1e-4 * (axis_mm[:, 1] + axis_mm[:, 2])
        return result

    got = of(toolpath(line(0, 50, 50), start=(0.0, NAN, NAN)), Known(error))
    assert got.path[0] == pytest.approx(0.02, rel=1e-5)


def test_an_unknown_place_within_a_program_counts_too() -> None:
    """Y is lost before line 4, as X goes back to 4 mm: with its play, its tool, and where the zero lies."""
    frames = (Frame(), Frame(tool_mm=(200.0, 0.0, 0.0)))
    lost = rapid(4, NAN, 0, flag=int(Flag.CONTROL))
    moves = (rapid(0, 0, 0), line(10, 0, 0), lost, line(4, 30, 0, frame=1), line(4, 40, 0, frame=1))
    path = toolpath(*moves, frames=frames)
    model = wave(0, 1, 0.02, 400.0)
    model.backlash_mm = (0.006, 0.0, 0.0)
    # 20 um at an end of the box, 3 um behind, 2 um of the tool, and 5 um the zero
    shift = np.array([-0.005, 0.0, 0.0])
    got = of(path, model, shift=shift)
    assert got.path[3] == pytest.approx(0.02 + 0.003 + 0.002 + 0.005, abs=1e-5)
    other = of(path, model, shift=-shift)
    assert other.path[3] == pytest.approx(0.02 + 0.003 + 0.002 - 0.005, abs=1e-5)


def test_what_is_worse_than_the_box_remains() -> None:
    """The end of the cut is off by more than its start may be."""
    nominal, wrong = (toolpath(line(x, 50, 0), start=PARTLY) for x in (0.0, 0.5))
    assert of(nominal, wave(0, 1, 0.02, 37.0), wrong, [0]).path[0] > 0.48


# -- the side of the backlash ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("steps", "side"),
    [
        ((1.0,), (7.0, 7.0, 0.0)),
        ((0.014,), (7.0, 7.0, 0.0)),
        ((0.007,), (7.0, 7.0, 3.5)),
        ((0.007, -0.007), (7.0, 7.0, 3.5, 3.5)),
        ((0.007, -0.0105), (7.0, 7.0, 3.5, 1.75)),
        ((0.0035, 0.0035, 0.014), (7.0, 7.0, 5.25, 3.5, 0.0)),
    ],
)  # fmt: skip
def test_an_unknown_side_shrinks_as_the_axis_moves(steps: tuple[float, ...], side: tuple[float, ...]) -> None:
    """Half of the 14 um, until X has moved by them; each move has the larger of its start and its end."""
    ends = np.cumsum((0.0, *steps))
    path = toolpath(rapid(0, 0, 0), *(line(x, 0, 0) for x in ends.tolist()[1:]), line(0, 90, 0))
    unknown = 1e3 * of(path, Known(backlash_mm=(0.014, 0.0, 0.0))).side
    assert unknown[: len(side) - 1] == pytest.approx(side[:-1], abs=1e-6)
    assert unknown[-1] == pytest.approx(side[-1] if len(side) > len(steps) + 1 else 0.0, abs=1e-6)


def test_the_sides_of_several_axes_add_and_a_lost_axis_has_none() -> None:
    path = toolpath(rapid(0, 0, 0), line(0, 0, 9), line(0, 5, 9), line(NAN, 5, 9), line(5, 5, 9))
    got = of(path, Known(backlash_mm=(0.004, 0.006, 0.002)))
    assert 1e3 * got.side == pytest.approx([6.0, 6.0, 5.0, 2.0, 2.0], abs=1e-6)


def test_the_side_of_a_group_is_the_largest_at_its_start_and_its_end() -> None:
    nominal = toolpath(rapid(0, 0, 0), line(30, 0, 0), line(30, 20, 0))
    corrected = toolpath(rapid(0, 0, 0), line(0.007, 0, 0), line(20, 0, 0), line(30, 0, 0), line(30, 20, 0))
    got = of(nominal, Known(backlash_mm=(0.014, 0.0, 0.0)), corrected, [0, 3, 4])
    assert 1e3 * got.side == pytest.approx([7.0, 7.0, 0.0], abs=1e-6)


def test_without_moves_there_is_nothing() -> None:
    got = of(toolpath(), Known(backlash_mm=(0.1, 0.1, 0.1)))
    assert [len(part) for part in (got.waypoint, got.path, got.side)] == [0] * 3


def test_a_turn_counts_where_the_backlash_is_taken_up() -> None:
    """X turns within the circle, and 10 um behind lies its end of the play; the cut along Y is half of it
    off, and one that goes back along X begins half of it beyond."""
    path = toolpath(rapid(0, 0, 0), line(20, 0, 0), line(20, 30, 0), line(0, 30, 0))
    got = of(path, Known(backlash_mm=(0.01, 0.0, 0.0)))
    assert 1e3 * got.path[1:] == pytest.approx([5.0, 5.0, 5.0], abs=1e-5)


def test_the_end_of_the_play_is_met_within_a_line() -> None:
    """X turns round and takes up 10 um on the first 20 um of the cut: 15 um are off there in X, 5 um before
    it, and nothing at its end."""

    def error(axis_mm: Array) -> Array:
        result = np.zeros(axis_mm.shape)
        result[:, 0] = 0.01 - 0.00075 * axis_mm[:, 1]
        return result

    path = toolpath(rapid(0, 0, 0), rapid(20, 0, 0), line(10, 20, 0))
    got = of(path, Known(error, backlash_mm=(0.01, 0.0, 0.0)))
    assert 1e3 * got.path[2] == pytest.approx((15 - 0.015) * 2 / math.sqrt(5), abs=1e-3)
    # and not along a rapid
    path = toolpath(rapid(0, 0, 0), rapid(20, 0, 0), rapid(10, 20, 0))
    assert 1e3 * of(path, Known(error, backlash_mm=(0.01, 0.0, 0.0))).path[2] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("plane", (0, 1, 2))
@pytest.mark.parametrize(("begin", "sweep", "passed"), [
    (0.3, 1.2, ()), (0.3, 1.3, (1,)), (0.3, -0.2, ()), (0.3, -0.4, (0,)), (0.0, 1.6, (1,)),
    (-0.1, 9.0, (0, 1, 2, 3, 4, 5)), (2.0, -9.0, (1, 0, -1, -2, -3, -4)), (3.0, 3.0, (2, 3)),
])  # fmt: skip
def test_with_backlash_an_arc_is_sampled_where_an_axis_turns_round(
    plane: int, begin: float, sweep: float, passed: tuple[int, ...]
) -> None:
    first, second = [(0, 1), (2, 0), (1, 2)][plane]

    def at(angle: float) -> np.ndarray:
        place = np.zeros(3)
        place[[first, second]] = 3 + 10 * math.cos(angle), 4 + 10 * math.sin(angle)
        return place

    centre = np.zeros(3)
    centre[[first, second]] = 3, 4
    move = arc(*at(begin + sweep), centre=tuple(centre), sweep=sweep, plane=plane)
    path = toolpath(rapid(*at(begin)), move, rapid(*at(0)), line(*at(1)), start=tuple(at(begin)))
    model = Known(backlash_mm=(0.01, 0.01, 0.01))
    of(path, model)
    asked = next(points for points, _ in model.asked if len(points) > 8)
    steps = 8
    while steps < abs(sweep) / 0.1:
        steps = steps * 2 if steps * 2 < abs(sweep) / 0.1 else math.ceil(abs(sweep) / 0.1)
    expected = [at(begin), *(at(begin + sweep * k / steps) for k in range(1, steps + 1)), at(0), at(1)]
    expected += [at(quarter * math.pi / 2) for quarter in passed]
    key = np.round(np.array(expected), 6) + 0.0
    got = np.round(asked, 6) + 0.0
    np.testing.assert_allclose(got[np.lexsort(got.T)], key[np.lexsort(key.T)], atol=2e-6)


# -- against the slow judge ------------------------------------------------------------------------------


def both(seed: int, model: Known) -> tuple[Array, Array]:
    """What is stated of a drawn program, and what the judge finds."""
    path, corrected, groups = drawn(seed)
    shift = np.random.default_rng(seed).uniform(-0.01, 0.01, 3)
    stated = of(path, model, corrected, groups, shift)
    return stated.path, farthest(path, shift, corrected, np.array(groups), model)


@pytest.mark.parametrize("seed", range(4))
def test_the_largest_deviation_is_that_of_the_whole_cut(seed: int) -> None:
    model = wave(seed % 3, (seed // 2) % 3, 0.03, 45.0, phase=seed)
    stated, largest = both(seed, model)
    assert stated == pytest.approx(largest, rel=0.005, abs=1.5e-4)


@pytest.mark.parametrize("seed", (1, 2, 3, 5))
def test_with_backlash_too(seed: int) -> None:
    model = wave(seed % 3, (seed // 2) % 3, 0.01, 60.0, phase=seed)
    model.backlash_mm = ((0.03, 0.0, 0.0), (0.02, 0.03, 0.01))[seed % 2]
    stated, largest = both(seed, model)
    assert stated == pytest.approx(largest, rel=0.005, abs=1.5e-4)


@pytest.mark.parametrize("plane", (0, 1, 2))
@pytest.mark.parametrize("turns", (1.0, -2.5, 3.0))
def test_helices_of_several_turns_count_turn_by_turn(plane: int, turns: float) -> None:
    """In parts of other lengths, one of which lies 30 um aside at the height of another turn."""
    first, second, third = [(0, 1, 2), (2, 0, 1), (1, 2, 0)][plane]

    def at(share: float, radius: float = 20.0) -> tuple[float, ...]:
        place, angle = np.zeros(3), 0.4 + 2 * math.pi * turns * share
        place[[first, second, third]] = radius * math.cos(angle), radius * math.sin(angle), 12 * share
        return tuple(place.tolist())

    def part(begin: float, end: float) -> Move:
        centre = np.zeros(3)
        centre[third] = 12 * begin
        sweep = 2 * math.pi * turns * (end - begin)
        return arc(*at(end, 20.03 if end == 0.6 else 20.0), centre=tuple(centre), sweep=sweep, plane=plane)

    nominal = toolpath(rapid(*at(0)), part(0, 1), line(*at(0)), start=at(0))
    shares = (0, 0.15, 0.35, 0.6, 1)
    parts = [part(a, b) for a, b in itertools.pairwise(shares)]
    corrected = toolpath(rapid(*at(0)), *parts, line(*at(0)), start=at(0))
    model = wave(third, first, 0.01, 70.0)
    groups = [0, 4, 5]
    got = of(nominal, model, corrected, groups)
    largest = farthest(nominal, np.zeros(3), corrected, np.array(groups), model)
    assert got.path == pytest.approx(largest, rel=0.01, abs=2e-4)
    assert got.path[1] > 0.03


@pytest.mark.parametrize("block", (1, 2, 3))
def test_blocks_of_a_path_with_an_unknown_axis_do_not_matter(
    block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    moves = (
        rapid(0, 0, NAN), line(50, 0, NAN), arc(50, 30, NAN, centre=(50, 15, NAN), sweep=math.pi),
        rapid(50, 30, 5), line(0, 30, 5), arc(0, 0, 5, centre=(0, 15, 5), sweep=math.pi), line(0, 0, NAN),
        line(30, 0, NAN),
    )  # fmt: skip
    path = toolpath(*moves, start=(0.0, 0.0, NAN))
    whole = of(path, wave(1, 0, 0.01, 70.0))
    assert whole.path.min() >= 0.0
    monkeypatch.setattr(deviation, "_BLOCK", block)
    parts = of(path, wave(1, 0, 0.01, 70.0))
    for name in ("waypoint", "path", "bend_mm", "side"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))


@pytest.mark.parametrize("block", (1, 3))
@pytest.mark.parametrize("play", (0.0, 0.03))
def test_blocks_do_not_matter(block: int, play: float, monkeypatch: pytest.MonkeyPatch) -> None:
    path, corrected, groups = drawn(2)
    model = wave(1, 0, 0.03, 45.0)
    model.backlash_mm = (play, play, 0.0)
    whole = of(path, model, corrected, groups)
    monkeypatch.setattr(deviation, "_BLOCK", block)
    parts = of(path, model, corrected, groups)
    for name in ("waypoint", "path", "bend_mm", "side"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))


# -- how finely it samples -------------------------------------------------------------------------------


def sampled(path: Toolpath, model: Known) -> Array:
    """All positions at which the model was asked."""
    of(path, model)
    return np.concatenate([points for points, _ in model.asked])


@pytest.mark.parametrize(
    ("sweep", "count", "played"),
    [(0.3, 4, 8), (0.81, 4, 9), (-1.7, 6, 17), (3.1, 11, 31), (-6.2, 21, 62)],
)
@pytest.mark.parametrize("play", (0.0, 0.01))
def test_how_near_the_samples_of_an_arc_are(sweep: float, count: int, played: int, play: float) -> None:
    """0.3 rad where a curve goes through them, four at least; 0.1 rad and eight with backlash."""
    end = (10 * math.cos(sweep), 10 * math.sin(sweep), 0.0)
    path = toolpath(rapid(10, 0, 0), arc(*end, centre=(0, 0, 0), sweep=sweep), start=(10, 0, 0))
    points = sampled(path, Known(backlash_mm=(0.0, 0.0, play)))
    angle = np.unique(np.round(np.mod(np.arctan2(points[:, 1], points[:, 0]) * np.sign(sweep), 2 * np.pi), 9))
    steps = played if play else count
    equal = np.linspace(0, abs(sweep), steps + 1)
    assert np.abs(angle[:, None] - equal).min(axis=0) == pytest.approx(0, abs=1e-8)
    # and where an axis turns round
    assert len(angle) - len(equal) == (int(abs(sweep) / (math.pi / 2)) if play else 0)


@pytest.mark.parametrize(
    ("move", "count"),
    [(line(20, 0, 0), 4096), (rapid(20, 0, 0), 1), (arc(0, 10, 0, centre=(0, 0, 0), sweep=1.5), 4096)],
)
def test_what_bends_much_is_sampled_so_often_and_no_more(move: Move, count: int) -> None:
    start = (10.0, 0.0, 0.0)
    points = sampled(toolpath(rapid(*start), move, start=start), Known(curvature=1e9))
    assert len(np.unique(points, axis=0)) - 1 == count


@pytest.mark.parametrize(("length", "count"), [(4.0, 1), (4.1, 2), (8.0, 2), (8.1, 4), (16.1, 8)])
def test_a_line_is_halved_until_it_bends_no_more_than_that(length: float, count: int) -> None:
    """An error with a curvature of 1/20000 mm leaves its chord by 0.1 um on 4 mm."""
    points = sampled(toolpath(rapid(0, 0, 0), line(length, 0, 0)), Known(curvature=5e-5))
    assert np.unique(points[:, 0]) == pytest.approx(np.linspace(0, length, count + 1))


@pytest.mark.parametrize(
    ("end", "sweep", "count"),
    [
        ((16, 0, 0), math.pi, 44),
        ((16, 0, 32), math.pi, 88),
        ((0, 0, 0), 2 * math.pi, 84),
        ((8, -8, 0), math.pi / 2, 24),
    ],
)
def test_an_arc_is_halved_until_it_bends_no_more_than_that(
    end: tuple[float, ...], sweep: float, count: int
) -> None:
    """As if each axis of the plane moved as far as the arc is long, 25 mm for half a turn here, and the third
    one as the helix rises."""
    path = toolpath(rapid(0, 0, 0), arc(*end, centre=(8, 0, 0), sweep=sweep))
    points = sampled(path, Known(curvature=9e-4))
    assert len(np.unique(np.round(points, 7), axis=0)) - (end != (0, 0, 0)) == count


def test_moves_with_other_tools_are_sampled_together() -> None:
    frames = (Frame(), Frame(tool_mm=(0.0, 300.0, 0.0)), Frame(tool_mm=(0.0, 0.0, -400.0)))
    turn = arc(0, 20, 0, centre=(0, 10, 0), sweep=-math.pi, frame=2)
    moves = (rapid(0, 0, 0), line(50, 0, 0, frame=1), rapid(0, 0, 0, frame=2), turn)
    got = of(toolpath(*moves, frames=frames), Known(curvature=1e-4))
    assert got.path == pytest.approx([0.0, 300 * PER_TOOL_MM, 400 * PER_TOOL_MM, 400 * PER_TOOL_MM], rel=1e-4)


# -- the trace of a simulation ---------------------------------------------------------------------------


def test_a_trace_goes_along_every_move_in_equal_steps() -> None:
    path = toolpath(
        line(9, 0, 0), line(9, 0, 0), arc(9, 20, 0, centre=(9, 10, 0), sweep=math.pi), rapid(9, 20, 4.5)
    )
    tip, move = Tracer.trace(path, linear(2, 1, 1e-3), 3.0)
    # 9 mm, nothing, 31.4 mm and 4.5 mm, in steps of 3 mm at most
    assert np.bincount(move).tolist() == [3, 1, 11, 2]
    angle = math.pi * np.arange(1, 12) / 11
    ends = [
        *((x, 0.0, 0.0) for x in (3.0, 6.0, 9.0, 9.0)),
        *((9 + 10 * math.sin(a), 10 - 10 * math.cos(a), 0.0) for a in angle),
        (9.0, 20.0, 2.25), (9.0, 20.0, 4.5),
    ]  # fmt: skip
    nominal = np.array(ends)
    assert tip == pytest.approx(nominal + np.outer(1e-3 * nominal[:, 1], (0, 0, 1)), abs=1e-9)


def test_a_trace_of_a_whole_circle_and_of_an_unknown_start() -> None:
    """The ends of a circle are one point; where the start is unknown the move has its end alone."""
    path = toolpath(line(6, 0, 0), arc(6, 0, 0, centre=(0, 0, 0), sweep=-2 * math.pi), start=(NAN,) * 3)
    tip, move = Tracer.trace(path, Known(), 10.0)
    assert np.bincount(move).tolist() == [1, 4]
    assert tip == pytest.approx(np.array([[6, 0, 0], [0, -6, 0], [-6, 0, 0], [0, 6, 0], [6, 0, 0]]), abs=1e-9)


def test_a_trace_has_the_tool_and_the_play_of_each_move() -> None:
    frames = (Frame(), Frame(tool_mm=(0.0, 0.0, 100.0)))
    path = toolpath(rapid(0, 0, 0), line(4, 0, 0, frame=1), line(0, 0, 0), frames=frames)
    tip, move = Tracer.trace(path, Known(backlash_mm=(0.01, 0.0, 0.0)), 2.0)
    assert move.tolist() == [0, 1, 1, 2, 2]
    assert tip[:, 0] == pytest.approx([0.0, 1.995, 3.995, 2.005, 0.005], abs=1e-9)
    assert tip[:, 2] == pytest.approx([0.0, 0.001, 0.001, 0.0, 0.0], abs=1e-9)


def test_a_trace_of_a_helix_is_as_long_as_its_turn_or_its_chord() -> None:
    """A quarter of a turn of 4 mm that rises by 30 mm, and one that rises by 1 mm."""
    steep = arc(0, 4, 30, centre=(0, 0, 0), sweep=math.pi / 2)
    path = toolpath(steep, arc(-4, 0, 31, centre=(0, 0, 30), sweep=math.pi / 2), start=(4.0, 0.0, 0.0))
    tip, move = Tracer.trace(path, Known(), 2.0)
    # sqrt(900 + 32) = 30.53 mm, and 6.28 mm, which is longer than its chord
    assert np.bincount(move).tolist() == [16, 4]
    assert tip[:, 2] == pytest.approx([*(30 * np.arange(1, 17) / 16), *(30 + np.arange(1, 5) / 4)])


def test_a_helix_that_became_chords_behind_an_arc_is_met_at_its_own_turn() -> None:
    """Of the arcs in the corrected path only those of the move itself say where on it a sample lies."""
    first = arc(10.0, 0.0, 0.0, centre=(5.0, 0.0, 0.0), sweep=-np.pi)
    helix = arc(30.0, 0.0, -10.0, centre=(25.0, 0.0, 0.0), sweep=-np.pi)
    nominal = toolpath(line(0.0, 0.0, 0.0), first, line(20.0, 0.0, 0.0), helix)
    turn = np.pi * np.arange(1, 181) / 180
    chords = [line(25.0 - 5.0 * np.cos(a), 5.0 * np.sin(a), -10.0 * a / np.pi) for a in turn.tolist()]
    corrected = toolpath(line(0.0, 0.0, 0.0), first, line(20.0, 0.0, 0.0), *chords)
    away = of(nominal, Known(), corrected, [0, 1, 2, 182])
    assert away.path[3] < 1e-3
