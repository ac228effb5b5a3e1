"""What findings are given: lines of frames."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from olp.checks.base import first_lines
from olp.core.toolpath import Frame, Toolpath
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
