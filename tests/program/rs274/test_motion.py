"""Arcs by hand: centre and signed sweep of what the words state, and what no control accepts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from olp.core.errors import ProgramError
from olp.program.rs274 import motion

NAN = math.nan
QUARTER = math.pi / 2
LINE = 17


def arc(
    end: tuple[float, float, float],
    *,
    start: tuple[float, float, float] = (10.0, 0.0, 5.0),
    i: float = NAN,
    j: float = NAN,
    k: float = NAN,
    r: float = NAN,
    p: float = NAN,
    clockwise: bool = False,
    plane: int = 0,
    absolute: bool = False,
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> tuple[list[float], float]:
    centre, sweep = motion.arc_geometry(
        np.array([start]),
        np.array([end]),
        np.array([[i, j, k, r, p]]),
        clockwise=np.array([clockwise]),
        plane=np.array([plane]),
        absolute=np.array([absolute]),
        offset=np.array([offset]),
        line=np.array([LINE]),
    )
    return centre[0].tolist(), float(sweep[0])


def refusal(end: tuple[float, float, float], **words: float) -> str:
    with pytest.raises(ProgramError) as caught:
        arc(end, **words)  # type: ignore[arg-type]
    assert caught.value.line == LINE
    return str(caught.value)


@pytest.mark.parametrize(("clockwise", "sweep"), [(False, QUARTER), (True, -3 * QUARTER)])
def test_the_centre_counts_from_the_start(clockwise: bool, sweep: float) -> None:
    centre, turned = arc((0.0, 10.0, 7.0), i=-10.0, clockwise=clockwise)
    assert centre == [0.0, 0.0, 5.0]
    assert turned == pytest.approx(sweep)


@pytest.mark.parametrize("plane", (0, 1, 2))
def test_each_plane_has_its_axes_and_its_direction(plane: int) -> None:
    """G17 is XY, G18 is ZX, G19 is YZ: a quarter turn from the first axis to the second is G3."""
    first, second = ((0, 1), (2, 0), (1, 2))[plane]
    start, end, words = np.zeros(3), np.zeros(3), {"ijk"[first]: -10.0}
    start[first], end[second] = 10.0, 10.0
    a = (float(start[0]), float(start[1]), float(start[2]))
    b = (float(end[0]), float(end[1]), float(end[2]))
    centre, turned = arc(b, start=a, plane=plane, **words)  # type: ignore[arg-type]
    assert centre == [0.0, 0.0, 0.0]
    assert turned == pytest.approx(QUARTER)


def test_g90_1_names_the_centre_in_the_program() -> None:
    centre, turned = arc((0.0, 10.0, 5.0), i=-3.0, j=2.0, absolute=True, offset=(3.0, -2.0, 100.0))
    assert centre == [0.0, 0.0, 5.0]
    assert turned == pytest.approx(QUARTER)
    assert "both centre words" in refusal((0.0, 10.0, 5.0), i=0.0, absolute=True)


@pytest.mark.parametrize(
    ("r", "clockwise", "centre", "sweep"),
    [
        (10.0, False, (0.0, 0.0), QUARTER),
        (10.0, True, (10.0, 10.0), -QUARTER),
        (-10.0, False, (10.0, 10.0), 3 * QUARTER),
        (-10.0, True, (0.0, 0.0), -3 * QUARTER),
    ],
)
def test_a_radius_above_zero_is_the_shorter_arc(
    r: float, clockwise: bool, centre: tuple[float, float], sweep: float
) -> None:
    got, turned = arc((0.0, 10.0, 5.0), r=r, clockwise=clockwise)
    assert got[:2] == pytest.approx(centre)
    assert turned == pytest.approx(sweep)


def test_an_arc_that_ends_where_it_starts_is_a_whole_turn() -> None:
    assert arc((10.0, 0.0, 5.0), i=-10.0)[1] == pytest.approx(4 * QUARTER)
    assert arc((10.0, 0.0, 5.0), i=-10.0, clockwise=True)[1] == pytest.approx(-4 * QUARTER)
    assert "ends where it starts" in refusal((10.0, 0.0, 9.0), r=10.0)


@pytest.mark.parametrize(("p", "turns"), [(1.0, 0), (2.0, 1), (5.0, 4)])
def test_p_counts_turns_and_the_first_may_be_a_part(p: float, turns: int) -> None:
    assert arc((0.0, 10.0, 5.0), i=-10.0, p=p)[1] == pytest.approx((1 + 4 * turns) * QUARTER)
    back = arc((0.0, 10.0, 5.0), i=-10.0, p=p, clockwise=True)[1]
    assert back == pytest.approx(-(3 + 4 * turns) * QUARTER)


@pytest.mark.parametrize("p", (0.0, -1.0, 1.5))
def test_p_is_an_integer_from_one(p: float) -> None:
    assert "expected an integer from 1" in refusal((0.0, 10.0, 5.0), i=-10.0, p=p)


def test_the_two_radii_may_differ_by_a_thousandth_or_by_what_linuxcnc_accepts() -> None:
    """0.0283 mm up to a radius of 28.3 mm, a thousandth of the radius above."""
    assert arc((0.0, 10.028, 5.0), i=-10.0)[1] == pytest.approx(QUARTER)
    assert "does not accept" in refusal((0.0, 10.029, 5.0), i=-10.0)
    far = (1000.0, 0.0, 5.0)
    assert arc((0.0, 1000.99, 5.0), start=far, i=-1000.0)[1] == pytest.approx(QUARTER)
    assert "at its start and 1001.0100 mm at its end" in refusal(
        (0.0, 1001.01, 5.0),
        start=far,
        i=-1000.0,  # type: ignore[arg-type]
    )


def test_a_radius_may_be_too_small_by_as_much() -> None:
    """The chord of 20 mm needs a radius of 10 mm, less half of 0.0283 mm."""
    centre, turned = arc((-10.0, 0.0, 5.0), r=9.986)
    assert centre == [0.0, 0.0, 5.0]
    assert turned == pytest.approx(2 * QUARTER)
    assert "reach its end, 20.0000 mm away" in refusal((-10.0, 0.0, 5.0), r=9.985)


def test_an_arc_needs_a_start_a_centre_and_a_size() -> None:
    assert "not been commanded" in refusal((0.0, NAN, 5.0), i=-10.0)
    assert "neither centre words" in refusal((0.0, 10.0, 5.0), k=-10.0)
    assert "zero radius" in refusal((0.0, 0.0, 5.0), i=-10.0)
    assert "zero radius" in refusal((0.0, 0.0, 5.0), i=0.0)


def test_omitted_words_keep_their_axis_in_absolute_and_in_incremental_blocks() -> None:
    """Rows: X1 (G90), Y2 (G91), X3 (G91), X4 (G90), nothing; in inches, with offset 100, 200, 300."""
    value = np.array([1.0, 2.0, 3.0, 4.0])
    slot = np.array([[0, -1, -1], [-1, 1, -1], [2, -1, -1], [3, -1, -1], [-1, -1, -1]])
    offset, start = np.array([100.0, 200.0, 300.0]), [7.0, 8.0, 9.0]
    incremental = np.array([False, True, True, False, True])
    end = motion.fill(slot, value, incremental, offset, 25.4, start)
    x = [100 + 25.4, 100 + 25.4, 100 + 4 * 25.4, 100 + 4 * 25.4, 100 + 4 * 25.4]
    y = [8.0, 8.0 + 50.8, 8.0 + 50.8, 8.0 + 50.8, 8.0 + 50.8]
    assert end[:, 0] == pytest.approx(x)
    assert end[:, 1] == pytest.approx(y)
    assert end[:, 2].tolist() == [9.0] * 5
    absolute = motion.fill(slot, value, None, np.tile(offset, (5, 1)), np.full(5, 2.0), start)
    assert absolute[:, 0].tolist() == [102.0, 102.0, 106.0, 108.0, 108.0]
    assert absolute[:, 1].tolist() == [8.0, 204.0, 204.0, 204.0, 204.0]
    assert absolute[:, 2].tolist() == [9.0] * 5


def test_a_modal_code_is_in_force_from_its_line_on() -> None:
    lines, codes = np.array([1, 3]), np.array([910, 900])
    assert motion.modal(5, lines, codes, 900).tolist() == [900, 910, 910, 900, 900]
    assert motion.modal(3, lines[:0], codes[:0], 910).tolist() == [910] * 3
