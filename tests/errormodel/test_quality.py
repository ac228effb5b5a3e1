"""How well an adjustment fits: the bounds of a misfit, by hand."""

from __future__ import annotations

import pytest

from olp.errormodel.quality import Fitted, Quality


def test_noise_as_stated_deviates_by_nothing() -> None:
    assert Fitted("a", 100.0, 100.0).reduced == 1.0
    assert abs(Fitted("a", 1e6, 1e6).deviations) < 1e-3


def test_the_deviations_are_those_of_wilson_and_hilferty() -> None:
    """With 10 degrees of freedom: (2 ** (1/3) - 1 + 1/45) / sqrt(1/45)."""
    assert Fitted("a", 20.0, 10.0).deviations == pytest.approx((2 ** (1 / 3) - 1 + 1 / 45) * 45**0.5)


@pytest.mark.parametrize(
    ("chi_square", "freedom", "failed"),
    # four times the noise in 100 degrees is a misfit; in 2 it is chance; above 1 and below 4 it is not gross
    [
        (401.0, 100.0, True),
        (400.0, 100.0, False),
        (8.2, 2.0, False),
        (3900.0, 1000.0, False),
        (40.0, 0.5, True),
        # five standard deviations in 10 degrees: ten times (5 / sqrt(45) + 1 - 1 / 45)^3 = 51.17
        (51.3, 10.0, True),
        (51.0, 10.0, False),
    ],
)
def test_a_misfit_is_gross_and_no_chance(chi_square: float, freedom: float, failed: bool) -> None:
    assert Fitted("a", chi_square, freedom).failed is failed


def test_what_fails_comes_with_the_worst_first() -> None:
    total, good = Fitted("all", 500.0, 100.0), Fitted("good", 90.0, 100.0)
    bad, worse = Fitted("bad", 600.0, 100.0), Fitted("worse", 700.0, 100.0)
    assert Quality(total, (bad, good, worse)).failed() == (worse, bad, total)
    assert Quality(good).failed() == ()


def test_less_than_one_degree_of_freedom_counts_as_one() -> None:
    assert [Fitted("a", 6.0, freedom).reduced for freedom in (0.0, 0.5, 1.0, 1.5)] == [6.0, 6.0, 6.0, 4.0]
    assert Fitted("a", 6.0, 0.5).deviations == Fitted("a", 6.0, 1.0).deviations
    assert Fitted("a", 8.0, 1.0).deviations == pytest.approx((2.0 - 7.0 / 9.0) / (2.0 / 9.0) ** 0.5)


def test_a_quality_without_sources_is_its_total() -> None:
    assert Quality(Fitted("all", 500.0, 100.0)).failed() == (Fitted("all", 500.0, 100.0),)
    assert Quality(Fitted("all", 90.0, 100.0)).sources == ()
