"""Commands of whole paths, worked by hand: what stays as it is, what is split, what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cases.toy import Move, Toy, arc, constant_backlash, feed, linear, parabola, rapid, toolpath

from olp.compensation.plan import Limits, Plan
from olp.compensation.planning import plan
from olp.core.errors import OutsideBox, ProgramError
from olp.core.toolpath import Flag, Frame, Kind

NAN = math.nan
#: X is off by 1e-3 of Y, and by 7 um everywhere
LEANING = linear(
    [[0, 1e-3, 0], [0, 0, 0], [0, 0, 0]],
    (0.007, 0.0, 0.0),
    depends_on=np.array([[False, True, False], [False, False, False], [False, False, False]]),
)


def planned(*moves: Move, model: Toy = LEANING, limits: Limits | None = None, **more: object) -> Plan:
    return plan(toolpath(*moves, **more), model, limits or Limits(0.001))  # type: ignore[arg-type]


def test_each_move_is_commanded_where_its_tip_gets_there() -> None:
    rows = planned(rapid(0.0, 0.0, 0.0), feed(5.0, 20.0, 3.0), feed(5.0, -10.0, 3.0))
    assert rows.command_mm == pytest.approx(
        np.array([[-0.007, 0.0, 0.0], [4.973, 20.0, 3.0], [5.003, -10.0, 3.0]]), abs=1e-9
    )
    assert rows.move.tolist() == [0, 1, 2]
    assert not rows.raw.any() and not rows.take_up.any() and not rows.uncorrected.size
    assert rows.reach.tolist() == [1.0] * 3
    assert rows.play is None and rows.target_mm.shape == (0, 3)


@pytest.mark.parametrize("flag", (Flag.PASS, Flag.CONTROL, Flag.MACHINE))
def test_what_the_program_sends_elsewhere_is_left_as_it_is(flag: Flag) -> None:
    rows = planned(rapid(0.0, 0.0, 0.0), feed(5.0, 20.0, 0.0, flag=flag), feed(5.0, 20.0, 1.0))
    assert rows.raw.tolist() == [[False] * 3, [True] * 3, [False] * 3]
    assert rows.command_mm[1].tolist() == [5.0, 20.0, 0.0]
    assert rows.command_mm[2, 0] == pytest.approx(4.973)


def test_a_rapid_that_needs_an_unknown_axis_is_left_uncorrected_in_what_needs_it() -> None:
    """X needs Y; Z needs nothing."""
    rows = planned(rapid(0.0, NAN, 5.0), rapid(3.0, 2.0, 5.0))
    assert rows.uncorrected.tolist() == [0]
    assert rows.raw.tolist() == [[True, True, False], [False] * 3]
    assert rows.command_mm[1, 0] == pytest.approx(2.991)


def test_an_unknown_axis_that_nothing_needs_stays_unknown() -> None:
    rows = planned(rapid(0.0, 0.0, NAN), feed(1.0, 0.0, NAN))
    assert not rows.uncorrected.size
    assert rows.raw.tolist() == [[False, False, True]] * 2
    assert rows.command_mm[:, 0].tolist() == pytest.approx([-0.007, 0.993])
    # X has an error though it needs no axis: unknown, it would need a word
    rows = planned(rapid(NAN, 0.0, 0.0))
    assert (rows.uncorrected.tolist(), rows.raw.tolist()) == ([0], [[True, False, False]])


@pytest.mark.parametrize(
    ("end", "axes"), [((1.0, NAN, 0.0), "Y"), ((NAN, NAN, 0.0), "X and Y"), ((NAN, 1.0, NAN), "X and Z")]
)
def test_a_feed_that_needs_an_unknown_axis_is_refused(end: tuple[float, float, float], axes: str) -> None:
    with pytest.raises(ProgramError) as caught:
        planned(rapid(*end), feed(*end, line=17), feed(*end, line=18))
    assert (caught.value.code, caught.value.line) == ("OLP524", 17)
    assert f"the position of {axes} is not known at this feed move" in str(caught.value)


def test_a_feed_that_is_left_as_it_is_may_need_an_unknown_axis() -> None:
    rows = planned(rapid(0.0, 0.0, 0.0), feed(1.0, NAN, 0.0, flag=Flag.PASS))
    assert not rows.uncorrected.size and rows.raw[1].all()


def test_the_error_of_an_unknown_axis_is_that_with_its_tool() -> None:
    """X is off by 1e-4 of the tool's Z: without a tool it has no error, so it needs no word."""
    model = Toy(
        lambda p, tool: np.outer(1e-4 * tool[:, 2], [1.0, 0.0, 0.0]), depends_on=np.zeros((3, 3), dtype=bool)
    )
    frames = (Frame(), Frame(tool_mm=(0.0, 0.0, 50.0)))
    rows = planned(rapid(NAN, 0.0, 0.0), rapid(NAN, 0.0, 0.0, frame=1), model=model, frames=frames)
    assert rows.uncorrected.tolist() == [1]
    assert not planned(rapid(NAN, 0.0, 0.0), model=model, frames=frames[:1]).uncorrected.size


# -- G53 ----------------------------------------------------------------------------------------------


def held(*moves: Move, **more: object) -> tuple[list[int], list[list[str]]]:
    """The moves left uncorrected, and the axes of each move that stay as they are."""
    rows = planned(*moves, **more)
    return rows.uncorrected.tolist(), [["XYZ"[a] for a in np.flatnonzero(row)] for row in rows.raw]


G53 = {"flag": Flag.MACHINE}


def test_rapids_keep_an_axis_where_g53_sent_it() -> None:
    got = held(
        rapid(0.0, 0.0, 0.0), rapid(0.0, 0.0, 90.0, **G53), rapid(5.0, 0.0, 90.0), rapid(6.0, 0.0, 90.0),
        feed(7.0, 0.0, 90.0), rapid(8.0, 0.0, 90.0),
    )  # fmt: skip
    assert got == ([2, 3], [[], ["X", "Y", "Z"], ["Z"], ["Z"], [], []])


def test_an_axis_that_moves_again_is_held_no_longer() -> None:
    got = held(
        rapid(0.0, 0.0, 0.0), rapid(9.0, 0.0, 90.0, **G53), rapid(9.0, 1.0, 80.0), rapid(9.0, 1.0, 90.0)
    )  # fmt: skip
    assert got == ([2, 3], [[], ["X", "Y", "Z"], ["X"], ["X"]])


def test_g53_as_the_first_move_and_as_the_last() -> None:
    first = rapid(1.0, 2.0, 3.0, **G53)
    assert held(first, rapid(1.0, 2.0, 4.0)) == ([1], [["X", "Y", "Z"], ["X", "Y"]])
    # it moves Z alone from where the job has the axes
    assert held(first, rapid(1.0, 2.0, 3.0), start=(1.0, 2.0, 0.0)) == ([1], [["X", "Y", "Z"], ["Z"]])
    assert held(rapid(0.0, 0.0, 0.0), first) == ([], [[], ["X", "Y", "Z"]])


def test_all_rapids_without_a_position_are_listed_once_and_in_order() -> None:
    got = held(rapid(0.0, NAN, 0.0), rapid(9.0, 8.0, 7.0, **G53), rapid(9.0, 8.0, 7.0))
    assert got[0] == [0, 2]


# -- splitting ----------------------------------------------------------------------------------------


def bent(depth: float) -> Toy:
    """A line of 80 mm along X is off by `depth` um across it in its middle."""
    return parabola(depth * 1e-3 / 40.0**2)


def parts(*moves: Move, um: float = 2.0, backlash: bool = False, **limits: float) -> list[int]:
    """The number of parts of each move, the first of which goes to X 0."""
    model = bent(um)
    model = Toy(model.error_mm, model.bound, constant_backlash(0.0, 0.0, 0.01) if backlash else None)
    rows = planned(rapid(0.0, 0.0, 0.0), *moves, model=model, limits=Limits(0.001, **limits))  # type: ignore[arg-type]
    return np.bincount(rows.move[~rows.take_up]).tolist()[1:]


THERE = feed(80.0, 0.0, 0.0)


def test_a_move_that_bends_is_split_and_each_part_is_commanded_where_its_tip_gets_there() -> None:
    rows = planned(rapid(0.0, 0.0, 0.0), THERE, feed(80.0, 9.0, 0.0), model=bent(1.5))
    assert rows.move.tolist() == [0, 1, 1, 2]
    # sqrt(0.95 / 1.5) of the line, as one of 32 positions
    assert rows.reach.tolist() == [1.0, 25 / 32, 1.0, 1.0]
    x = 80 * 25 / 32
    expected = [[0, 0, 0], [x, -1.5e-3 * (x / 40) ** 2, 0], [80, -6e-3, 0], [80, 9 - 6e-3, 0]]
    assert rows.command_mm == pytest.approx(np.array(expected), abs=1e-9)


@pytest.mark.parametrize(
    ("um", "backlash", "count"), [(0.94, False, 1), (0.96, False, 2), (0.69, True, 1), (0.71, True, 2)]
)
def test_a_chord_may_use_95_hundredths_of_the_tolerance_or_70_beside_the_dead_band(
    um: float, backlash: bool, count: int
) -> None:
    assert parts(THERE, um=um, backlash=backlash) == [count]


@pytest.mark.parametrize("flag", (Flag.PASS, Flag.CONTROL, Flag.MACHINE, Flag.CYCLE, Flag.WHOLE))
def test_what_may_not_be_split_is_whole(flag: Flag) -> None:
    assert parts(feed(80.0, 0.0, 0.0, flag=flag)) == [1]
    assert parts(feed(80.0, 0.0, 0.0, flag=Flag.INCREMENTAL)) == [2]


def test_an_axis_that_stays_as_it_is_leaves_its_move_whole() -> None:
    model = Toy(bent(2.0).error_mm, bent(2.0).bound, depends_on=np.zeros((3, 3), dtype=bool))
    for z, count in ((NAN, 1), (0.0, 2)):
        rows = planned(rapid(0.0, 0.0, z), feed(80.0, 0.0, z), model=model)
        assert rows.move.tolist() == [0] + [1] * count


def test_rapids_and_probes_are_split_only_on_request() -> None:
    back = rapid(0.0, 0.0, 0.0)
    assert parts(THERE, back) == [2, 1]
    assert parts(THERE, back, split_rapids=True) == [2, 2]
    probe = Move(Kind.PROBE, (80.0, 0.0, 0.0))
    assert parts(probe, split_rapids=True) == [1]


def test_behind_a_block_that_may_be_deleted_no_move_is_split() -> None:
    deleted = {"flag": Flag.DELETED}
    back, again = feed(0.0, 0.0, 0.0), feed(80.0, 0.0, 0.0)
    assert parts(feed(80.0, 0.0, 0.0, **deleted), back, again) == [2, 1, 2]
    assert parts(feed(80.0, 0.0, 0.0, **deleted), feed(0.0, 0.0, 0.0, **deleted), again) == [2, 2, 1]
    assert parts(THERE, feed(0.0, 0.0, 0.0, **deleted), again, back) == [2, 2, 1, 2]


def test_cuts_of_lines_and_of_arcs_come_in_the_order_of_the_path() -> None:
    half = arc(40.0, 0.0, 0.0, centre=(60.0, 0.0, 0.0), degrees=180.0)
    rows = planned(rapid(0.0, 0.0, 0.0), THERE, half, feed(120.0, 0.0, 0.0), model=bent(200.0))
    assert (np.diff(rows.move) >= 0).all()
    assert all(np.bincount(rows.move)[1:] > 2)
    inner = np.diff(rows.move) == 0
    assert (np.diff(rows.reach)[inner] > 0).all()
    assert (rows.reach[np.append(~inner, True)] == 1.0).all()


def test_targets_are_kept_where_there_is_backlash() -> None:
    frames = (Frame(), Frame(tool_mm=(0.0, 0.0, 3.0)))
    bend = bent(1.5)
    model = Toy(bend.error_mm, bend.bound, constant_backlash(0.0, 0.0, 0.01))
    rows = planned(rapid(0.0, 0.0, 0.0), feed(80.0, 0.0, 5.0, frame=1), model=model, frames=frames)
    own = rows.move == 1
    share = rows.reach[own]
    assert own.sum() >= 3
    assert rows.target_mm[own] == pytest.approx(np.outer(share, [80.0, 0.0, 5.0]))
    # with its own tool: three times the bend
    assert rows.command_mm[own, 1] == pytest.approx(-3 * 1.5e-3 * (80.0 * share / 40) ** 2, abs=1e-9)


# -- touch-off ----------------------------------------------------------------------------------------


def test_the_error_of_the_touch_off_is_held() -> None:
    """Touched at Y 30, where X is off by 37 um: that is where X 0 is."""
    frames = (Frame(touched=((5.0, 30.0, 0.0), (0.0, 0.0, 0.0))), Frame())
    rows = planned(rapid(0.0, 0.0, 0.0), rapid(0.0, 0.0, 0.0, frame=1), frames=frames)
    assert rows.command_mm[:, 0].tolist() == pytest.approx([0.030, -0.007])
    assert rows.shift_mm == pytest.approx(np.array([[0.037, 0, 0], [0, 0, 0]]))


# -- the box ------------------------------------------------------------------------------------------


BOX = np.array([[-5.0, 10.0], [-20.0, 20.0], [-1.0, 2.0]])
BOXED = Toy(lambda p, tool: np.full((len(p), 3), (0.001, 0.0, -0.001)), box_mm=BOX)


@pytest.mark.parametrize(
    ("end", "says"),
    [
        ((10.002, 0.0, 0.0), "axis X would be commanded to 10.001 mm, outside the calibrated box -5 to 10"),
        ((-5.0, 0.0, 0.0), "axis X would be commanded to -5.001 mm, outside the calibrated box -5 to 10 mm"),
        ((0.0, 21.0, 0.0), "axis Y would be commanded to 21.000 mm, outside the calibrated box -20 to 20 mm"),
        ((0.0, -21.0, 0.0), "axis Y would be commanded to -21.000 mm"),
        ((0.0, 21.0, 2.0), "axis Y would be commanded to 21.000 mm"),
        ((0.0, 0.0, 2.0), "axis Z would be commanded to 2.001 mm, outside the calibrated box -1 to 2 mm"),
        ((10.001, 20.0, 1.999), None), ((-4.999, -20.0, -1.001), None), ((NAN, 0.0, 0.0), None),
    ],
)  # fmt: skip
def test_a_command_outside_the_box_is_refused(end: tuple[float, float, float], says: str | None) -> None:
    moves = (rapid(0.0, 0.0, 0.0), rapid(*end, line=7), rapid(50.0, 50.0, 50.0, line=8))
    if says is None:
        planned(*moves[:2], model=BOXED)
        return
    with pytest.raises(OutsideBox) as caught:
        planned(*moves, model=BOXED)
    assert caught.value.line == 7
    assert says in str(caught.value)
    assert len(planned(*moves, model=BOXED, limits=Limits(0.001, refuse_outside=False))) == 3


@pytest.mark.parametrize("flag", (Flag.PASS, Flag.CONTROL, Flag.MACHINE))
def test_what_is_left_as_it_is_may_lie_outside_the_box(flag: Flag) -> None:
    assert len(planned(rapid(0.0, 0.0, 0.0), feed(50.0, 0.0, 0.0, flag=flag), model=BOXED)) == 2
