"""What findings are given: lines of frames, and blocks that move another axis."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from olp.checks.base import beside_axes, first_lines
from olp.core.toolpath import Flag, Frame, Toolpath
from olp.program.text import columns


@given(moves=st.lists(st.tuples(st.integers(0, 3), st.integers(1, 9)), max_size=12), size=st.integers(1, 5))
def test_frames_have_the_first_line_of_their_moves(moves: list[tuple[int, int]], size: int) -> None:
    frame, line = np.array(moves, np.int32).reshape(-1, 2).T
    none = np.zeros(len(moves), np.uint8)
    path = Toolpath(none, none, line, frame, np.zeros((len(moves), 3)), (Frame(),) * 4)
    expected = {number: min(at for own, at in moves if own == number) for number, _ in moves}
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(columns, "_MOST", size)
        found = first_lines(path)
    assert found == expected and list(found) == sorted(found)


@pytest.mark.parametrize("size", range(1, 8))
def test_a_block_that_calls_a_cycle_moves_no_other_axis(size: int) -> None:
    """Sinumerik: `X10` behind MCALL is whole, and its hole follows in that line, even in the next part."""
    flag = [0, Flag.WHOLE, Flag.CYCLE, Flag.CYCLE, Flag.WHOLE, Flag.CYCLE, Flag.WHOLE]
    line = [1, 2, 2, 2, 3, 4, 5]
    none = np.zeros(7, np.uint8)
    frame = np.zeros(7, np.int32)
    path = Toolpath(none, np.array(flag, np.uint8), np.array(line), frame, np.zeros((7, 3)), (Frame(),))
    found = [beside_axes(path, slice(a, min(a + size, 7))) for a in range(0, 7, size)]
    # a cycle in the next line is not called by this one
    assert np.flatnonzero(np.concatenate(found)).tolist() == [4, 6]
