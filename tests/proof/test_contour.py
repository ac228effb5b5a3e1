"""A contour under cutter compensation that the control would refuse as it is written."""

from __future__ import annotations

import numpy as np
import pytest
from cases.paths import line, rapid, toolpath

from olp.core.errors import ProgramError
from olp.core.toolpath import CutterCompensation, Frame, Toolpath
from olp.proof.contour import check_contours

FRAMES = (Frame(), Frame(compensation=CutterCompensation(0, True, 5.0)))


def pocket(width: float, *, split: bool = False, radius: float = 5.0) -> Toolpath:
    """Inside of a pocket of so many mm, to the left of it: the cutter of 10 mm has to fit into its end."""
    frames = (Frame(), Frame(compensation=CutterCompensation(0, True, radius)))
    moves = [rapid(0, 0, 0), line(20, 0, 0, frame=1), line(40, 0, 0, frame=1)]
    if split:
        moves.append(line(41, 0, 0, frame=1))
    moves += [line(50, 0, 0, frame=1), line(50, width, 0, frame=1, line=40), line(20, width, 0, frame=1)]
    return toolpath(*moves, frames=frames)


def test_a_corner_that_only_just_fits_is_refused_once_it_does_not() -> None:
    for written, groups in (
        (pocket(9.99), np.arange(6)),
        (pocket(9.99, split=True), np.array([0, 1, 2, 4, 5, 6])),
    ):
        with pytest.raises(ProgramError) as caught:
            check_contours(pocket(10.01), written, groups)
        assert str(caught.value) == (
            "40: the control would refuse this block once corrected: a cutter radius of 5 mm does not fit "
            "into its corners, and uncorrected it only just fits; make the block longer, or use a smaller "
            "cutter"
        )
        assert (caught.value.line, caught.value.code) == (40, "OLP561")


@pytest.mark.parametrize(("nominal", "written"), [(10.01, 10.01), (9.99, 9.98), (9.99, 10.01)])
def test_what_fits_or_does_not_fit_in_both_is_no_matter(nominal: float, written: float) -> None:
    check_contours(pocket(nominal), pocket(written), np.arange(6))


def test_each_block_is_looked_at_by_itself() -> None:
    """The nominal contour has a corner that does not fit, and the written one another."""

    def steps(first: float, second: float) -> Toolpath:
        rows = ((20, 0), (50, 0), (50, first), (20, first), (20, first + 30), (50, first + 30))
        moves = [line(x, y, 0, frame=1) for x, y in rows]
        end = line(50, first + 30 + second, 0, frame=1, line=77)
        return toolpath(rapid(0, 0, 0), *moves, end, line(20, first + 30 + second, 0, frame=1), frames=FRAMES)

    with pytest.raises(ProgramError) as caught:
        check_contours(steps(9.99, 10.01), steps(9.99, 9.99), np.arange(9))
    assert caught.value.line == 77


def test_a_first_move_that_is_shorter_than_the_cutter_is_refused() -> None:
    def begun(length: float) -> Toolpath:
        return toolpath(
            rapid(0, 0, 0),
            line(length, 0, 0, frame=1, line=9),
            line(length + 30, 0, 0, frame=1),
            frames=FRAMES,
        )

    check_contours(begun(5.01), begun(5.01), np.arange(3))
    with pytest.raises(ProgramError) as caught:
        check_contours(begun(5.01), begun(4.99), np.arange(3))
    assert caught.value.line == 9
