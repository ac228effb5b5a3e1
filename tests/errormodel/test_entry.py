"""Numbers of a covariance: which entries fit, and what an uncertainty of them says."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.errormodel.entry import Entry, alone
from olp.errormodel.sources.registry import NUMBERS
from olp.errormodel.uncertainty import Uncertainty

NAN = float("nan")
X = np.array([0.0, 10.0, 40.0])
MEAN = Entry("mean", "EXX", np.array([[1.0, 0.0], [2.0, 5.0], [4.0, 0.0]]), np.zeros(3), X)
HALF = replace(MEAN, kind="half")
WAVE = Entry("wave", "EXX", np.array([[3.0], [4.0]]), np.array([0.3, 0.4]), period_mm=8.0)
TILT = Entry("squareness", "B0Z", np.array([[2.0]]), np.array([0.5]))
LOST = Entry("backlash", "Y", np.array([[2.0]]), np.array([0.5]))
ALL = (MEAN, HALF, WAVE, TILT, LOST)


@pytest.mark.parametrize("entry", ALL, ids=lambda entry: entry.kind)
def test_a_right_entry_fits(entry: Entry) -> None:
    assert NUMBERS[entry.kind].fits(entry)
    assert NUMBERS[entry.kind].fits(replace(entry, rest=np.zeros(len(entry.rest))))
    assert NUMBERS[entry.kind].fits(replace(entry, factor=np.zeros((len(entry.rest), 0))))
    assert NUMBERS[entry.kind].count(entry) == len(entry.rest)
    assert Uncertainty((entry,), "", "").entries == (entry,)


@pytest.mark.parametrize("entry", ALL, ids=lambda entry: entry.kind)
@pytest.mark.parametrize(
    "change",
    [
        {"name": "EXW"},
        {"factor": np.zeros((4, 2))},
        {"factor": np.zeros(3)},
        {"factor": np.zeros((3, 2, 1))},
        {"factor": "nan"},
        {"rest": np.zeros(4)},
        {"rest": np.zeros((3, 1))},
        {"rest": "nan"},
        {"rest": "inf"},
        {"rest": "below"},
    ],
    ids=str,
)
def test_a_wrong_entry_does_not_fit(entry: Entry, change: dict[str, Any]) -> None:
    ((key, value),) = change.items()
    if isinstance(value, str) and key != "name":
        value = getattr(entry, key).copy()
        value[-1] = {"nan": NAN, "inf": np.inf, "below": -1e-12}[change[key]]
    wrong = replace(entry, **{key: value})
    assert not NUMBERS[entry.kind].fits(wrong)
    with pytest.raises(ConfigError, match=f"covariance of {wrong.kind} {wrong.name}: expected finite"):
        Uncertainty((wrong,), "", "")


@pytest.mark.parametrize("kind", ["mean", "half"])
@pytest.mark.parametrize("position", [[], [0.0], [0.0, 0.0, 1.0], [0.0, 2.0, 1.0], [0.0, 1.0, NAN]])
def test_positions_ascend(kind: str, position: list[float]) -> None:
    n = len(position)
    entry = Entry(kind, "EXX", np.zeros((n, 1)), np.zeros(n), np.array(position))
    assert NUMBERS[kind].count(entry) == 0
    assert not NUMBERS[kind].fits(entry)


def test_two_positions_are_enough_and_a_wave_has_a_period() -> None:
    two = Entry("mean", "EXX", np.zeros((2, 1)), np.zeros(2), np.array([0.0, 1.0]))
    assert NUMBERS["mean"].count(two) == 2
    assert NUMBERS["wave"].count(replace(WAVE, period_mm=0.0)) == 0
    assert NUMBERS["wave"].count(replace(WAVE, period_mm=0.5)) == 2
    assert {kind: numbers.names for kind, numbers in NUMBERS.items()} == {
        "mean": COMPONENTS, "half": COMPONENTS, "wave": COMPONENTS, "squareness": SQUARENESS,
        "backlash": ("X", "Y", "Z"),
    }  # fmt: skip


def test_an_unknown_kind_and_a_second_entry_are_refused() -> None:
    with pytest.raises(ConfigError, match="covariance of mood EXX: expected finite numbers"):
        Uncertainty((replace(MEAN, kind="mood"),), "", "")
    with pytest.raises(ConfigError, match="covariance of mean EXX is defined twice; expected once"):
        Uncertainty((MEAN, replace(HALF, name="EYX"), MEAN), "", "")
    # of another kind, component or period it is another one
    wave = replace(WAVE, factor=np.zeros((2, 2)))
    others = (HALF, replace(MEAN, name="EYX"), wave, replace(wave, period_mm=4.0))
    known = Uncertainty((MEAN, *others), "", "")
    assert known.rank == 2
    assert known.find("half", "EXX") is HALF and known.find("mean", "EYX") is others[1]
    assert known.find("half", "EYX") is None and known.find("mean", "EZX") is None
    with pytest.raises(ConfigError, match="wave EXX: its factor has 1 columns; expected 2, as in the other"):
        Uncertainty((MEAN, WAVE), "", "")
    assert Uncertainty((), "", "").rank == 0


def test_uncertainties_scale_and_grow() -> None:
    known = Uncertainty((MEAN, replace(HALF, rest=np.full(3, 2.0))), "f", "s", 0.1, (1.0, 2.0, 3.0), 0.5)
    twice = known.scaled(2.0)
    np.testing.assert_array_equal(twice.entries[0].factor, 2.0 * MEAN.factor)
    np.testing.assert_array_equal(twice.entries[1].rest, np.full(3, 4.0))
    assert (twice.fingerprint, twice.source, twice.dropped) == ("f", "s", 0.1)
    assert twice.repeatability_mm == (1.0, 2.0, 3.0)
    # sqrt(2^2 + 5^2 + 2^2)
    np.testing.assert_allclose(known.entries[1].sigma, [5.0**0.5, 33.0**0.5, 20.0**0.5])
    assert known.growth(365.25) == 1.5 and known.growth(-1.0) == known.growth(0.0) == known.growth(None) == 1
    assert known.growth(1.0) == pytest.approx(1.0 + 0.5 / 365.25)
    plain = Uncertainty((), "", "")
    assert (plain.dropped, plain.growth_per_year, plain.temperature_K) == (0.0, 0.0, 0.0)
    assert plain.repeatability_mm == (0.0, 0.0, 0.0)


def test_entries_of_standard_uncertainties_alone() -> None:
    one = alone("squareness", "C0Y", 4e-6)
    assert (one.kind, one.name, one.factor.shape, one.rest.tolist()) == ("squareness", "C0Y", (1, 0), [4e-6])
    assert one.position_mm.shape == (0,) and one.period_mm == 0.0
    many = alone("mean", "EXX", np.array([1.0, 2.0, 3.0]), X)
    assert many.factor.shape == (3, 0) and many.rest.tolist() == [1.0, 2.0, 3.0]
    assert many.position_mm is X
    whole = alone("mean", "EXX", np.array([1, 2, 3]), X)
    assert whole.rest.dtype == np.float64
    # of a factor in single precision as well
    single = replace(MEAN, factor=MEAN.factor.astype(np.float32))
    assert single.sigma.dtype == np.float64
