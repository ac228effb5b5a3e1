"""Backlash along a path, worked by hand: 6 um in X, so a drive that has moved leads by 3 um.

The numerical tolerance is 1 um, so an axis may lag by a quarter of it. At the start nothing is known of the
side: a rapid goes past its end by half of the backlash and 1 um before a cut begins.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from cases.toy import Move, Toy, arc, constant_backlash, feed, linear, parabola, rapid, toolpath

from olp.compensation.plan import Limits, Plan
from olp.compensation.planning import Planning, plan
from olp.compensation.reversal import Reversal
from olp.core.toolpath import Flag, Frame

PLAY = Toy(backlash=constant_backlash(0.006, 0.0, 0.0))
LIMITS = Limits(0.001)
NAN = math.nan


def planned(*moves: Move, model: Toy = PLAY, limits: Limits = LIMITS, **more: object) -> Plan:
    return plan(toolpath(*moves, **more), model, limits)  # type: ignore[arg-type]


def x_um(rows: Plan) -> list[float]:
    """Commands of X in um."""
    return [round(1e3 * x, 6) for x in rows.command_mm[:, 0].tolist()]


def along_x(*x_mm: float) -> list[Move]:
    return [feed(x, 0.0, 0.0) for x in x_mm]


def test_a_rapid_takes_up_the_play_before_a_cut_and_a_step_takes_it_up_at_a_turn() -> None:
    rows = planned(rapid(0.0, 0.0, 0.0), *along_x(10.0, 20.0, 5.0))
    assert rows.move.tolist() == [0, 0, 1, 2, 3, 3]
    assert x_um(rows) == [-4.0, 3.0, 10003.0, 20003.0, 19997.0, 4997.0]
    assert rows.take_up.tolist() == [False, False, False, False, True, False]
    assert rows.reach.tolist() == [pytest.approx(1.0), 1.0, 1.0, 1.0, 0.0, 1.0]
    assert rows.reach[0] < 1.0
    assert rows.target_mm[:, 0].tolist() == [-0.004, 0.0, 10.0, 20.0, 20.0, 5.0]
    assert rows.play is not None
    assert rows.play[:, 0].tolist() == [0.0, 1.0, 1.0, 1.0, -1.0, -1.0]
    assert not rows.play[:, 1:].any() and not rows.raw.any()


@pytest.mark.parametrize(
    ("moves", "first_um"),
    [
        # the side is that of the next motion, however far it is and however small
        ([feed(0.0, 7.0, 0.0), *along_x(0.0, 0.0, -1.0)], 4.0),
        ([feed(0.0, 7.0, 0.0), *along_x(0.0, 1e-6, -1.0)], -4.0),
        # none at all: any side
        ([feed(0.0, 7.0, 0.0)], -4.0),
        # a position that is not known is no motion
        ([feed(0.0, 7.0, 0.0), rapid(NAN, 7.0, 0.0, flag=Flag.CONTROL), rapid(-5.0, 7.0, 0.0)], 4.0),
    ],
)
def test_a_rapid_takes_up_the_play_for_the_motion_that_follows(moves: list[Move], first_um: float) -> None:
    assert x_um(planned(rapid(0.0, 0.0, 0.0), *moves))[0] == first_um


@pytest.mark.parametrize(
    ("digit_mm", "first_um"), [(0.0004, -4.0), (0.0005, -4.0), (0.001, -5.0), (0.01, -23.0)]
)
def test_a_rapid_goes_past_its_end_by_two_digits_more(digit_mm: float, first_um: float) -> None:
    rows = planned(rapid(0.0, 0.0, 0.0), *along_x(10.0), limits=Limits(0.001, digit_mm))
    assert x_um(rows) == [first_um, 3.0, 10003.0]


@pytest.mark.parametrize(
    ("low", "high", "x", "first_um"),
    [
        (-0.004, 100.0, 10.0, -4.0),
        (-0.0039, 100.0, 10.0, 4.0),
        (-100.0, 10.5, -10.0, 4.0),
        (-100.0, 0.0039, -10.0, -4.0),
    ],
)
def test_a_rapid_goes_past_its_end_within_the_box(low: float, high: float, x: float, first_um: float) -> None:
    box = np.array([[low, high], [-9.0, 9.0], [-9.0, 9.0]])
    model = Toy(backlash=PLAY.backlash, box_mm=box)
    rows = planned(rapid(0.0, 0.0, 0.0), *along_x(x), model=model, limits=Limits(0.001, refuse_outside=False))
    assert x_um(rows)[0] == first_um


def inserted(*moves: Move, **more: object) -> list[int]:
    """The moves that got a further row, in front of their last."""
    rows = planned(*moves, **more)  # type: ignore[arg-type]
    return [int(m) for m, take in zip(rows.move[:-1], rows.move[1:] == rows.move[:-1], strict=True) if take]


CUT = along_x(10.0, 20.0)
AWAY = rapid(NAN, NAN, NAN, flag=Flag.CONTROL)


def test_a_side_that_is_known_is_not_taken_up_again() -> None:
    assert inserted(rapid(0.0, 0.0, 0.0), *CUT, rapid(30.0, 0.0, 0.0), feed(40.0, 0.0, 0.0)) == [0]
    # a rapid that is longer than the backlash says it too, a shorter one does not
    assert inserted(rapid(0.0, 0.0, 0.0), rapid(0.0061, 0.0, 0.0), *CUT) == []
    assert inserted(rapid(0.0, 0.0, 0.0), rapid(0.0059, 0.0, 0.0), *CUT) == [1]


def test_after_a_tool_change_the_side_is_taken_up_again() -> None:
    back = rapid(0.0, 0.0, 0.0)
    assert inserted(back, *CUT, AWAY, back, *CUT) == [0, 4]
    assert inserted(back, *CUT, AWAY, back, feed(0.0, 5.0, 0.0), back, *CUT) == [0, 4]


@pytest.mark.parametrize(
    ("before", "limits"),
    [
        (feed(0.0, 0.0, 0.0), LIMITS),
        (rapid(0.0, 0.0, 0.0), Limits(0.001, insert=False)),
        (rapid(0.0, 0.0, 0.0, flag=Flag.PASS), LIMITS),
        (rapid(0.0, 0.0, 0.0, flag=Flag.WHOLE), LIMITS),
        (rapid(0.0, 0.0, 0.0, flag=Flag.DELETED), LIMITS),
        (rapid(0.0, 0.0, 0.0, flag=Flag.MACHINE), LIMITS),
        (rapid(0.0, NAN, 0.0), LIMITS),
    ],
)  # fmt: skip
def test_no_row_comes_where_none_may(before: Move, limits: Limits) -> None:
    assert inserted(before, *CUT, limits=limits) == []


def test_no_row_comes_behind_a_block_that_may_be_deleted() -> None:
    deleted = rapid(1.0, 0.0, 0.0, flag=Flag.DELETED)
    assert inserted(deleted, rapid(1.001, 0.0, 0.0), *CUT) == []
    assert inserted(rapid(1.0, 0.0, 0.0), rapid(1.001, 0.0, 0.0), *CUT) == [1]


def test_the_rapids_of_a_hole_take_up_what_the_rapid_before_them_can() -> None:
    hole = [rapid(0.0, 0.0, -k, flag=Flag.CYCLE) for k in (1.0, 2.0)] + [
        feed(0.0, 0.0, -5.0, flag=Flag.CYCLE)
    ]
    assert inserted(rapid(0.0, 0.0, 0.0), *hole, *CUT) == [0]
    # there is none before
    assert inserted(*hole, *CUT) == []


def test_without_rapids_there_is_nothing_before_a_cut() -> None:
    assert inserted(rapid(0.0, 0.0, 0.0), rapid(5.0, 0.0, 0.0)) == []
    assert inserted() == []


def commands_um(*x_mm: float) -> list[float]:
    """Commands of feeds along X in um, from a start whose side is not known."""
    rows = planned(*along_x(*x_mm), limits=Limits(0.001, insert=False))
    return x_um(rows)


@pytest.mark.parametrize(
    ("x_um", "expected"),
    [
        # the middle of what the play can be: -1 to 1, 1/3 to 1, 1
        ((0, 2, 3), (0.0, 4.0, 6.0)),
        ((0, -2, -3), (0.0, -4.0, -6.0)),
        # 3 um at once
        ((0, 3), (0.0, 6.0)),
        ((0, -3), (0.0, -6.0)),
        ((0, 2.999), (0.0, 5.998)),
        # from 1/3 to 1: the way back narrows it to -1 .. -2/3
        ((0, 2, 1.5), (0.0, 4.0, -0.5, -1.0)),
        ((0, -2, -1.5), (0.0, -4.0, 0.5, 1.0)),
        ((0, 2, 1), (0.0, 4.0, -1.0, -2.0)),
        # the dead band holds a load that would have to turn by at most a quarter of a micrometre
        ((0, 10, 9.751, 9.8), (0.0, 13.0, 13.0, 13.0)),
        ((0, 10, 9.749, 9.8), (0.0, 13.0, 7.0, 6.749, 6.749)),
        ((0, -10, -9.751, -9.8), (0.0, -13.0, -13.0, -13.0)),
        ((0, -10, -9.749, -9.8), (0.0, -13.0, -7.0, -6.749, -6.749)),
        # what goes on is no turn, however small
        ((0, 10, 10.1), (0.0, 13.0, 13.1)),
        ((0, 10, 10), (0.0, 13.0, 13.0)),
        # steps in the dead band count from where the load is held
        ((0, 10, 9.9, 9.8, 9.7), (0.0, 13.0, 13.0, 13.0, 7.0, 6.7)),
    ],
)
def test_commands_follow_the_middle_of_the_play(x_um: Sequence[float], expected: Sequence[float]) -> None:
    assert commands_um(*(x / 1e3 for x in x_um)) == pytest.approx(expected, abs=1e-6)


def test_a_load_counts_again_from_where_it_is_known() -> None:
    """After a tool change the play is anything between its sides."""
    rows = planned(*along_x(0.0, 1.0), AWAY, *along_x(0.0, 0.002), limits=Limits(0.001, insert=False))
    assert x_um(rows)[-2:] == [0.0, 4.0]
    assert rows.play is not None
    assert rows.play[[0, 1, 3, 4], 0].tolist() == pytest.approx([0.0, 1.0, 0.0, 2 / 3])


BACK = (rapid(0.0, 0.0, 0.0), *along_x(10.0))
TURNS_MM = (10.0, 5.0)


@pytest.mark.parametrize(
    ("back", "limits", "steps"),
    [
        (feed(5.0, 0.0, 0.0), LIMITS, 1),
        (feed(5.0, 0.0, 0.0, flag=Flag.WHOLE), LIMITS, 1),
        (feed(5.0, 0.0, 0.0, flag=Flag.WHOLE), Limits(0.001, insert=False), 0),
        (feed(5.0, 0.0, 0.0), Limits(0.001, insert=False), 1),
        (rapid(5.0, 0.0, 0.0), LIMITS, 0),
        (feed(5.0, 0.0, 0.0, flag=Flag.CYCLE), LIMITS, 0),
        (feed(5.0, 0.0, 0.0, flag=Flag.PASS), LIMITS, 0),
        (arc(0.0, 0.0, 0.0, centre=(5.0, 0.0, 0.0), degrees=180.0), LIMITS, 1),
    ],
)
def test_a_step_comes_before_corrected_feeds_alone(back: Move, limits: Limits, steps: int) -> None:
    rows = planned(*BACK, back, limits=limits)
    assert rows.take_up.sum() == steps
    if steps:
        assert rows.move[rows.take_up].tolist() == [2]


def test_no_step_comes_at_the_start_or_behind_an_unknown_position() -> None:
    path = (feed(0.0, 0.0, 0.0), rapid(10.0, NAN, 0.0), feed(5.0, 0.0, 0.0), feed(9.0, 0.0, 0.0))
    assert planned(*path).move[planned(*path).take_up].tolist() == [3]


def test_rows_behind_cuts_are_those_of_their_part() -> None:
    """Y is off by -1e-5 x^2 and has backlash: it goes down to the middle of the move, and up behind it."""
    bend = parabola(-1e-5)
    model = Toy(bend.error_mm, bend.bound, constant_backlash(0.0, 0.006, 0.0))
    rows = planned(rapid(-60.0, 0.0, 0.0), feed(60.0, 0.0, 0.0), model=model)
    down, up = np.flatnonzero(rows.take_up).tolist()
    assert rows.move[rows.take_up].tolist() == [1, 1]
    assert rows.reach[down] == 0.0 and rows.reach[down - 1] == 1.0
    assert 0.4 < rows.reach[up] == rows.reach[up - 1] < rows.reach[up + 1]
    for row, way in ((down, -1.0), (up, 1.0)):
        assert rows.command_mm[row] - rows.command_mm[row - 1] == pytest.approx([0.0, 0.006 * way, 0.0])
    # half of the backlash ahead in the direction in which it goes
    x, y = rows.command_mm[down:].T[:2]
    assert y == pytest.approx(1e-5 * x**2 + np.where(np.arange(down, len(rows)) < up, -0.003, 0.003))


def test_the_steps_of_one_move_have_the_tool_of_that_move() -> None:
    frames = (Frame(), Frame(tool_mm=(0.0, 0.0, 50.0)))
    # X is off by 1e-4 of the tool's Z
    model = Toy(lambda p, tool: np.outer(1e-4 * tool[:, 2], [1.0, 0.0, 0.0]), backlash=PLAY.backlash)
    rows = planned(*BACK, feed(5.0, 0.0, 0.0, frame=1), model=model, frames=frames)
    assert x_um(rows) == [-4.0, 3.0, 10003.0, 9992.0, 4992.0]


@pytest.mark.parametrize(("backlash_um", "counts"), [(1.9, False), (2.1, True), (-2.1, True)])
def test_backlash_counts_where_half_of_it_is_more_than_the_band(backlash_um: float, counts: bool) -> None:
    model = Toy(backlash=constant_backlash(0.0, backlash_um / 1e3, 0.0))
    found = Reversal.of(model, 1e-3)
    assert (found is not None) == counts
    if found is not None:
        assert found.axes.tolist() == [False, True, False]
        assert found.band_mm == 1e-3


def test_backlash_counts_wherever_in_the_box_it_is() -> None:
    """10 um in Z between 80 and 100 mm, where the box ends; the tool has no length in this."""

    def backlash(point: np.ndarray) -> np.ndarray:
        return np.column_stack([0 * point[:, :2], np.where(point[:, 2] > 80.0, 0.01, 0.0)])

    assert Reversal.of(Toy(backlash=backlash, box_mm=np.tile([-100.0, 79.0], (3, 1))), 1e-3) is None
    found = Reversal.of(Toy(backlash=backlash, box_mm=np.array([[0.0, 1.0], [0.0, 1.0], [0.0, 100.0]])), 1e-3)
    assert found is not None and found.axes.tolist() == [False, False, True]
    assert Reversal.of(linear(np.eye(3)), 1e-3) is None


def test_backlash_on_a_250th_of_an_axis_is_found() -> None:
    box = np.array([[0.0, 1.0], [0.0, 1.0], [0.0, 100.0]])
    backlash = lambda p: np.where(np.abs(p - 50.5) < 0.25, [0.0, 0.0, 0.01], 0.0)  # noqa: E731
    assert Reversal.of(Toy(backlash=backlash, box_mm=box), 1e-3) is not None


def test_the_strokes_of_a_hole_move_no_axis_across_them() -> None:
    """X is off by 1e-3 of Z: over a stroke of 10 mm the load would move by 10 um, and turn."""
    model = linear([[0, 0, 1e-3], [0, 0, 0], [0, 0, 0]], backlash=PLAY.backlash)
    strokes = [feed(5.0, 0.0, -10.0, flag=Flag.CYCLE, line=3), rapid(5.0, 0.0, 0.0, flag=Flag.CYCLE, line=3)]
    rows = planned(rapid(0.0, 0.0, 0.0), rapid(5.0, 0.0, 0.0, line=2), *strokes, model=model)
    assert rows.play is not None
    assert rows.play[:, 0].tolist() == [0.0, 1.0, 1.0, 1.0]
    # strokes of two blocks are two holes
    apart = [strokes[0], rapid(5.0, 0.0, 0.0, flag=Flag.CYCLE, line=4)]
    rows = planned(rapid(0.0, 0.0, 0.0), rapid(5.0, 0.0, 0.0, line=2), *apart, model=model)
    assert rows.play is not None
    assert rows.play[:, 0].tolist() == [0.0, 1.0, 1.0, -1.0]


@pytest.mark.parametrize("cut", (3, 4))
def test_a_plan_in_two_parts_is_that_of_the_whole(cut: int) -> None:
    """Y never moves, so its side stays unknown. It is taken up before the first cut alone."""
    model = Toy(backlash=constant_backlash(0.006, 0.004, 0.0))
    moves = (
        rapid(0.0, 0.0, 0.0),
        *along_x(10.0, 20.0, 15.0, 30.0),
        rapid(40.0, 0.0, 0.0),
        *along_x(50.0, 45.0),
    )
    path = toolpath(*moves)
    whole = plan(path, model, LIMITS)
    assert np.bincount(whole.move).tolist() == [2, 1, 1, 2, 2, 1, 1, 2]
    planning = Planning(model, LIMITS)
    parts = [planning.rows(path.part(0, cut), path.end_mm[cut:])]
    parts.append(planning.rows(path.part(cut, len(path)), np.zeros((0, 3))))
    np.testing.assert_array_equal(np.concatenate((parts[0].move, parts[1].move + cut)), whole.move)
    for name in ("target_mm", "command_mm", "raw", "reach", "take_up", "play"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name))
