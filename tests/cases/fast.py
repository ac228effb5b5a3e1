"""Many cases of one test: some of them in the fast suite, all of them in the slow one."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def some_fast(cases: Iterable[Any], each: int) -> list[Any]:
    """The cases, all but one in `each` marked as slow."""
    return [
        case if k % each == 0 else pytest.param(case, marks=pytest.mark.slow) for k, case in enumerate(cases)
    ]
