"""Parts of a line: laws, recovery, and periods that are not observable; reversal from both sides."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from olp.calibration.iso230.go_return import backlash_toml, findings_of, program, reversal_of
from olp.calibration.iso230.separation import (
    LEAST_OBSERVABLE_SHARE,
    Separation,
    aliased,
    observable_share,
    separate,
)
from olp.calibration.observations.lines import Line
from olp.core.errors import ConfigError, UsageError
from olp.core.machine import Axis, Machine

#: mm per um.
UM = 1e-3


def line(x: np.ndarray, up: np.ndarray, down: np.ndarray | None = None, runs: int = 5) -> Line:
    """Values in um at targets; the same in every run, in both directions."""
    down = up if down is None else down
    n = len(x)
    return Line(
        "EXX",
        np.tile(np.concatenate((x, x[::-1])), runs),
        np.tile(np.concatenate((up, down[::-1])), runs) * UM,
        np.repeat(np.arange(1, runs + 1), 2 * n),
        np.tile(np.repeat([1, -1], n), runs),
        (0.0, 0.0, 0.0),
    )


def add(one: Line, value: np.ndarray) -> Line:
    return Line("EXX", one.target_mm, one.value + value, one.run, one.direction, one.line_mm)


@given(st.integers(5, 60), st.floats(2.0, 30.0), st.integers(1, 9), st.integers(1, 2), st.floats(-900, 900))
def test_multiples_of_a_period_or_of_its_half_are_aliased(
    n: int, period: float, times: int, half: int, start: float
) -> None:
    x = start + np.arange(n) * times * period / half
    reason = aliased(x, period)
    assert reason is not None
    if n >= 5:
        assert "times the period" in reason


@given(st.integers(12, 60), st.sampled_from([5.0, 10.0, 20.0]), st.integers(1, 9), st.floats(0.994, 1.006))
def test_nearly_a_multiple_is_aliased_too(n: int, period: float, times: int, off: float) -> None:
    """The phase then creeps from target to target, and the error looks like a slow curve."""
    assert aliased(np.arange(n) * times * period * off, period) is not None


def test_random_offsets_and_fine_sweeps_are_seen() -> None:
    random = np.random.default_rng(5)
    failed = 0
    for _ in range(200):
        n, period = int(random.integers(12, 41)), float(random.choice([2.0, 5.0, 10.0, 20.0]))
        grid = np.arange(n) * period * int(random.integers(2, 9))
        failed += aliased(grid + random.uniform(0, period, n), period) is not None
    assert failed <= 4
    for period in (2.0, 10.0):
        assert aliased(np.arange(0, 2 * period + 1e-9, period / 10), period) is None
        assert aliased(np.arange(0, 2 * period + 1e-9, period / 10), period / 2) is None


def test_few_targets_say_so() -> None:
    assert "4 targets" in str(aliased([0, 3, 17, 31], 10.0))
    with pytest.raises(ConfigError, match="expected more than 0"):
        aliased([0, 1, 2], 0.0)


@settings(max_examples=40)
@given(
    st.integers(0, 2**31), st.floats(0.5, 9.0), st.floats(-3.1, 3.1), st.floats(-6, 6),
    st.sampled_from([8.0, 10.0]),
)  # fmt: skip
def test_recovery(seed: int, amplitude: float, phase: float, backlash: float, period: float) -> None:
    """A smooth curve, a cyclic error and backlash are separated again."""
    random = np.random.default_rng(seed)
    x = np.arange(0.0, 1000.0, 40.0) + random.uniform(0, period, 25)
    assume(observable_share([x], period) > LEAST_OBSERVABLE_SHARE)
    assume(observable_share([x], period / 2, [period]) > LEAST_OBSERVABLE_SHARE)
    smooth = 8.0 * (x / 1000.0) - 3.0
    cyclic = amplitude * np.sin(2 * np.pi * x / period + phase)
    result = separate(line(x, smooth + cyclic - backlash / 2, smooth + cyclic + backlash / 2), [period])
    first, second = result.harmonics
    assert first.amplitude / UM == pytest.approx(amplitude, abs=1e-6)
    assert np.cos(first.phase_rad - phase) == pytest.approx(1.0, abs=1e-9)
    assert second.amplitude / UM == pytest.approx(0.0, abs=1e-6)
    assert result.noncyclic / UM == pytest.approx(smooth, abs=1e-6)
    assert result.reversal is not None
    assert result.reversal.constant
    assert result.reversal.backlash / UM == pytest.approx(backlash, abs=1e-6)
    assert first.cyclic.period_mm == period


def parts(result: Separation) -> np.ndarray:
    assert result.reversal is not None
    waves = [h.at(result.target_mm) for h in result.harmonics]
    return np.concatenate([result.mean, result.noncyclic, *waves, result.reversal.at])


@settings(max_examples=30)
@given(st.integers(0, 2**31))
def test_superposition_and_order(seed: int) -> None:
    """The parts of a sum of readings are the sums of their parts; the order of readings does not matter."""
    random = np.random.default_rng(seed)
    x = np.arange(0.0, 800.0, 40.0) + random.uniform(0, 10, 20)
    one = line(x, random.normal(0, 5, 20), random.normal(0, 5, 20), runs=2)
    other = random.normal(0, 5e-3, len(one.value))
    zero = add(one, -one.value)
    total = parts(separate(add(one, other), [10.0]))
    each = parts(separate(one, [10.0])), parts(separate(add(zero, other), [10.0]))
    assert total == pytest.approx(each[0] + each[1], abs=1e-9)
    order = random.permutation(len(one.value))
    mixed = Line(
        "EXX", one.target_mm[order], one.value[order] + other[order], one.run[order], one.direction[order],
        one.line_mm,
    )  # fmt: skip
    separated = separate(add(one, other), [10.0], drift=False)
    assert parts(separate(mixed, [10.0], drift=False)) == pytest.approx(parts(separated), abs=1e-9)


def test_an_aliased_period_is_never_fitted() -> None:
    """4 um at 10 mm pitch, targets at 50 mm: the readings show nothing of it, and it must not be claimed."""
    x = np.arange(0.0, 1001.0, 50.0)
    result = separate(line(x, 4.0 * np.sin(2 * np.pi * x / 10.0 + 0.7)), [10.0])
    assert result.harmonics == ()
    assert [period for period, _ in result.refused] == [10.0, 5.0]
    assert {f.code for f in result.findings} == {"OLP853"}
    assert "5 times the period" in result.findings[0].message


def test_a_fine_sweep_rescues_an_aliased_line() -> None:
    random = np.random.default_rng(3)
    x, s = np.arange(0.0, 1001.0, 50.0), np.arange(300.0, 320.1, 1.0)

    def truth(q: np.ndarray) -> np.ndarray:
        curve = 6.0 * np.sin(q / 400.0) + 4.0 * np.sin(2 * np.pi * q / 10.0 + 0.7)
        return np.asarray(curve + random.normal(0, 0.15, len(q)))

    result = separate(line(x, truth(x)), [10.0], [line(s, truth(s), runs=1)])
    assert result.refused == ()
    first, second = result.harmonics
    assert first.amplitude / UM == pytest.approx(4.0, abs=4 * first.sigma_amplitude / UM + 0.02)
    assert first.sigma_amplitude / UM < 0.2
    assert first.phase_rad == pytest.approx(0.7, abs=0.06)
    assert second.amplitude < 4 * second.sigma_amplitude + 1e-4
    assert result.noncyclic / UM == pytest.approx(6.0 * np.sin(x / 400.0), abs=0.8)


def test_two_periods_that_look_alike_are_not_both_fitted() -> None:
    """At steps of a third of the period, it and its half lie at the same phases."""
    x = np.arange(0.0, 400.0, 10.0)
    result = separate(line(x, np.zeros(len(x))), [30.0])
    assert len(result.harmonics) == 1
    assert "looks like the period of 30 mm" in result.findings[0].message


def test_stated_uncertainty_covers() -> None:
    """Amplitude and backlash against the truth, in units of their stated standard uncertainty."""
    random = np.random.default_rng(11)
    z = []
    for _ in range(60):
        x = np.arange(0.0, 1000.0, 40.0) + random.uniform(0, 10, 25)
        one = line(x, 3 * np.sin(2 * np.pi * x / 10.0) - 2, 3 * np.sin(2 * np.pi * x / 10.0) + 2)
        result = separate(add(one, random.normal(0, 1e-3, len(one.value))), [10.0])
        assert result.reversal is not None
        z.append((result.harmonics[0].amplitude - 3e-3) / result.harmonics[0].sigma_amplitude)
        z.append((result.reversal.backlash - 4e-3) / result.reversal.sigma)
    assert 0.75 < np.std(z) < 1.3


def test_reversal_along_the_axis_differs_from_a_constant_one() -> None:
    random = np.random.default_rng(2)
    x = np.linspace(0.0, 900.0, 10)
    constant = line(x, np.full(10, -2.0), np.full(10, 2.0))
    growing = line(x, -x / 300.0, x / 300.0)
    noise = random.normal(0, 0.3e-3, len(constant.value))
    one, other = reversal_of(add(constant, noise)), reversal_of(add(growing, noise))
    assert one.constant and list(findings_of(one)) == []
    assert one.backlash / UM == pytest.approx(4.0, abs=0.2)
    assert not other.constant
    assert [f.code for f in findings_of(other)] == ["OLP854"]
    assert other.at / UM == pytest.approx(-x / 150.0, abs=1.0)
    text = backlash_toml([one, other])
    assert text.startswith("[backlash]\nX_um = ")
    assert "direction column" in text


def test_a_drift_is_no_reversal() -> None:
    """2 um an hour, steady: each run returns later than it went, which would look like 0.9 um of reversal."""
    x = np.linspace(0.0, 900.0, 10)
    one = line(x, np.zeros(10))
    drifting = add(one, np.arange(100) * 0.05e-3 + np.random.default_rng(0).normal(0, 1e-6, 100))
    assert np.abs(reversal_of(drifting, drift=False).at).max() / UM > 0.9
    assert np.abs(reversal_of(drifting).at).max() / UM < 0.02
    assert reversal_of(drifting).drift / UM == pytest.approx(4.95, abs=0.05)


def test_over_compensation_and_missing_sides() -> None:
    x = np.linspace(0.0, 900.0, 10)
    over = add(line(x, np.full(10, 3.0), np.full(10, -3.0)), np.random.default_rng(0).normal(0, 1e-4, 100))
    assert [f.code for f in findings_of(reversal_of(over))] == ["OLP855"]
    one = line(x, np.zeros(10))
    kept = ~((one.target_mm == 300.0) & (one.direction == -1))
    lacking = Line("EXX", one.target_mm[kept], one.value[kept], one.run[kept], one.direction[kept], (0, 0, 0))
    with pytest.raises(ConfigError, match=r"300 mm was never approached in -"):
        reversal_of(lacking)


def test_program_of_go_and_return() -> None:
    axis = Axis((0.0, 500.0), 0.001, 500.0, 2000.0, 20000.0)
    machine = Machine("m", "FXYZ", "linuxcnc", {"X": axis, "Y": axis, "Z": axis})
    text = program(machine, "X", [100, 300], over_mm=2.0, feed_mm_min=1000, runs=1)
    moves = [row.split()[2] for row in text.splitlines() if row.startswith("G53")]
    values = [float(word[1:]) for word in moves]
    assert values == [98, 100, 298, 300, 302, 300, 102, 100]
    with pytest.raises(UsageError, match="leave the travel of X"):
        program(machine, "X", [1, 300], over_mm=2.0, feed_mm_min=1000)


@settings(max_examples=25)
@given(st.integers(0, 2**31), st.booleans())
def test_reversal_is_the_least_squares_of_all_readings(seed: int, drift: bool) -> None:
    """Held against one large system: a mean and a reversal per target, and a drift with a knot per run."""
    random = np.random.default_rng(seed)
    m, runs = int(random.integers(2, 6)), int(random.integers(2, 5))
    x = np.cumsum(random.uniform(10, 50, m))
    one = add(line(x, np.zeros(m), runs=runs), random.normal(0, 1e-3, 2 * m * runs))
    result = reversal_of(one, drift=drift)
    place = np.searchsorted(x, one.target_mm)
    own = np.eye(m)[place]
    knots = np.append(np.arange(runs) * 2 * m, 2 * m * runs - 1)
    hats = [np.interp(np.arange(len(place)), knots, hat) for hat in np.eye(runs + 1)[1:]]
    extra = np.array(hats).T if drift else np.zeros((len(place), 0))
    system = np.hstack((own, own * 0.5 * one.direction[:, None], extra))
    inverse = np.linalg.pinv(system)
    estimate = inverse @ one.value
    assert result.at == pytest.approx(estimate[m : 2 * m], abs=1e-9)
    dof = len(place) - np.linalg.matrix_rank(system)
    noise = np.sqrt(((one.value - system @ estimate) ** 2).sum() / dof)
    assert result.noise == pytest.approx(noise, rel=1e-6)
    sigma = noise * np.sqrt(np.diag(inverse @ inverse.T)[m : 2 * m])
    assert result.sigma_at == pytest.approx(sigma, rel=1e-6)


def test_a_drift_that_swings_within_a_run_makes_no_reversal_along_the_axis() -> None:
    random = np.random.default_rng(9)
    x = np.linspace(0.0, 1500.0, 17)
    time = np.arange(170) / 169
    flagged = 0
    for _ in range(60):
        swing = random.normal() * np.sin(2 * np.pi * time * random.uniform(1.0, 3.0) + random.uniform(0, 6))
        noise = swing * 1e-3 + random.normal(0, 0.5e-3, 170)
        flagged += not reversal_of(add(line(x, np.full(17, -3.0), np.full(17, 3.0)), noise)).constant
    assert flagged <= 4


@pytest.mark.slow
def test_a_recording_of_many_targets_needs_no_large_system() -> None:
    """20,000 targets in each direction: as one dense system this would be 6 GB."""
    random = np.random.default_rng(1)
    x = np.arange(20_000) * 0.1
    one = add(line(x, np.full(20_000, -2.0), np.full(20_000, 2.0), runs=2), random.normal(0, 1e-3, 80_000))
    result = separate(one, [10.0])
    assert result.reversal is not None
    assert result.reversal.backlash / UM == pytest.approx(4.0, abs=0.1)
    assert result.refused == ()
