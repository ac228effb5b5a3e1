"""Many cases of one test: some of them in the fast suite, all of them in the slow one."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def some_fast(cases: Iterable[Any], each: int) -> list[Any]:
    """The cases, all but one in `each` marked as slow; a tuple is the values of several names."""
    values = [case if isinstance(case, tuple) else (case,) for case in cases]
    return [
        pytest.param(*value, marks=pytest.mark.slow if k % each else ()) for k, value in enumerate(values)
    ]
