"""Many cases of one test: some of them in the fast suite, all of them in the slow one."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable
from itertools import count
from typing import Any, TypeVar

import pytest

Case = TypeVar("Case")


def some_fast(cases: Iterable[Any], each: int, of_slow: int = 1) -> list[Any]:
    """The cases, all but one in `each` marked as slow; a tuple is the values of several names. Of the slow
    ones all but one in `of_slow` are left to a campaign before a release."""
    marked, slow = _others_marked(cases, each, pytest.mark.slow), count()
    return [
        pytest.param(*case.values, marks=pytest.mark.campaign)
        if case.marks and next(slow) % of_slow
        else case
        for case in marked
    ]


def some_of_a_campaign(cases: Iterable[Any], each: int) -> list[Any]:
    """The cases of a slow test, all but one in `each` left to a campaign before a release."""
    return _others_marked(cases, each, pytest.mark.campaign)


def left_to_a_campaign(cases: Iterable[Any], left: Container[Any]) -> list[Any]:
    """The cases of a slow test, those that are in `left` left to a campaign before a release."""
    return [_marked(case, case in left, pytest.mark.campaign) for case in cases]


def _others_marked(cases: Iterable[Any], each: int, mark: pytest.MarkDecorator) -> list[Any]:
    return [_marked(case, bool(k % each), mark) for k, case in enumerate(cases)]


def _marked(case: Any, marked: bool, mark: pytest.MarkDecorator) -> Any:
    return pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=mark if marked else ())


def in_each(cases: Iterable[Case], name: Callable[[Case], str]) -> Callable[[Callable[[Case], None]], Any]:
    """One test for a law of many cases that takes no time each: what broke it, by the name of its case."""

    def decorated(function: Callable[[Case], None]) -> Callable[[], None]:
        def test() -> None:
            wrong = []
            for case in cases:
                try:
                    function(case)
                except AssertionError as error:
                    wrong.append(f"{name(case)}: {error}")
            if wrong:
                pytest.fail("\n".join(wrong))

        test.__name__, test.__doc__ = function.__name__, function.__doc__
        return test

    return decorated
