"""Inertial deviation: closed forms of one move, superposition, and the bound on it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from cases.fast import left_to_a_campaign
from cases.trajectory import LIMITS, random_route, route
from cli.test_retime import SQUARE, START, TOOLS, program, run
from hypothesis import given, settings
from hypothesis import strategies as st

import olp
from olp.core.machine import Setup
from olp.files.config import load_setup
from olp.trajectory.inertia import Inertial, capped, compliance_of, guaranteed_cap, worst
from olp.trajectory.plan import plan
from olp.trajectory.route import AxisLimits

matrices = st.integers(0, 10_000).map(lambda seed: np.random.default_rng(seed).normal(size=(3, 3)) * 1e-6)


def own(*um_per_m_s2: float) -> np.ndarray:
    return np.diag(um_per_m_s2) * -1e-6


def test_one_straight_move_in_closed_form() -> None:
    """Rest to rest along X with flat tops of acceleration: |a| is A/J of ramps and F/A - A/J of top, twice.

    The integral of a^2 over one such trapezoid is A^2 (F/A - A/J) + 2/3 A^2 (A/J) = A F - A^3 / (3 J).
    """
    feed, length = 400.0, 300.0
    a, j = LIMITS.acceleration[0], LIMITS.jerk[0]
    trajectory = plan(route(np.array([[0.0, 0, 0], [length, 0, 0]]), feed, 0.0), LIMITS)
    duration = length / feed + feed / a + a / j
    result = Inertial.of(trajectory.motion, own(2.0, 5.0, 7.0))
    assert trajectory.duration_s == pytest.approx(duration, rel=1e-6)
    assert result.most_mm == pytest.approx(2e-6 * a, rel=1e-6)
    assert result.rms_mm == pytest.approx(
        2e-6 * np.sqrt(2.0 * (a * feed - a**3 / (3.0 * j)) / duration), rel=1e-5
    )
    # all of it lies along the path
    assert result.across_mm == pytest.approx(0.0, abs=1e-12)
    # an axis that deflects at right angles leaves the path by the whole deflection
    sideways = np.zeros((3, 3))
    sideways[1, 0] = 2e-6
    assert Inertial.of(trajectory.motion, sideways).across_mm == pytest.approx(2e-6 * a, rel=1e-6)


@pytest.mark.slow
@settings(max_examples=8)
@given(st.integers(0, 10_000), matrices)
def test_it_is_what_samples_say(seed: int, compliance: np.ndarray) -> None:
    given_route, limits = random_route(seed)
    trajectory = plan(given_route, limits)
    result = Inertial.of(trajectory.motion, compliance)
    motion = trajectory.motion
    piece = np.repeat(np.arange(len(motion)), 40)
    share = np.tile((np.arange(40) + 0.5) / 40, len(motion))
    width = np.diff(motion.start_s)[piece]
    size = np.linalg.norm(motion.of(piece, share * width)[2] @ compliance.T, axis=1)
    assert size.max() <= result.most_mm * (1 + 1e-4)
    assert size.max() >= result.most_mm * 0.9
    mean = np.sqrt((size**2 * width).sum() / max(width.sum(), 1e-300))
    assert result.rms_mm == pytest.approx(mean, rel=2e-3)
    assert result.rms_mm <= result.most_mm <= worst(limits, compliance) * (1 + 1e-5)
    assert result.across_mm <= result.most_mm * (1 + 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.1, 3.0])
def test_it_is_proportional_to_the_compliance(factor: float) -> None:
    given_route, limits = random_route(5)
    motion = plan(given_route, limits).motion
    one, other = Inertial.of(motion, own(1.0, 2.0, 3.0)), Inertial.of(motion, factor * own(1.0, 2.0, 3.0))
    for name in ("most_mm", "rms_mm", "across_mm"):
        assert getattr(other, name) == pytest.approx(factor * getattr(one, name), rel=1e-9)


@pytest.mark.slow
@given(matrices, st.floats(1e-3, 2.0))
def test_the_guaranteed_cap_holds_whatever_the_axes_do(compliance: np.ndarray, share: float) -> None:
    most = share * worst(LIMITS, compliance)
    cap = guaranteed_cap(LIMITS, compliance, most)
    held = capped(LIMITS, compliance, cap)
    assert (held.acceleration <= LIMITS.acceleration).all()
    assert worst(held, compliance) <= most * (1 + 1e-9)
    # and is the largest one
    if share < 1.0:
        assert worst(capped(LIMITS, compliance, cap * (1 + 1e-6)), compliance) >= most * (1 - 1e-9)
    any_way = np.random.default_rng(1).uniform(-1, 1, (200, 3)) * held.acceleration
    assert np.linalg.norm(any_way @ compliance.T, axis=1).max() <= most * (1 + 1e-9)


KEYS = "compliance_um_per_m_s2 = 3.0\n"


@pytest.fixture
def job(tmp_path: Path) -> Path:
    path = machine(tmp_path / "m", tables=TRUE_ZERO + TOOLS, job=START)
    text = path.read_text()
    path.write_text(text.replace("[axes.Y]", f"{KEYS}[axes.Y]").replace("[axes.Z]", f"{KEYS}[axes.Z]"))
    return path.with_name("job.toml")


def test_the_report_states_it_beside_the_rest(job: Path, tmp_path: Path) -> None:
    part = program(tmp_path)
    result = run("retime", part, "-j", job, "--report", tmp_path / "r.json")
    report = json.loads((tmp_path / "r.json").read_text())
    retimed = olp.retime(part, job.with_name("machine.toml"), job)
    compliance = compliance_of(load_setup(job.with_name("machine.toml")).machine)
    np.testing.assert_allclose(compliance, np.diag([-3e-6, -3e-6, 0.0]), rtol=1e-12)
    want = Inertial.of(retimed.trajectory.motion, compliance)
    stated = report["inertial"]
    assert stated["max_um"] == report["budget_um"]["inertial"] == pytest.approx(want.most_mm * 1e3)
    assert (stated["rms_um"], stated["line"]) == (pytest.approx(want.rms_mm * 1e3), want.line)
    assert "Inertial deviation" in result.stdout
    assert "deflects under acceleration" in result.stdout


@pytest.mark.slow
@pytest.mark.parametrize("share", left_to_a_campaign([0.9, 0.5, 0.2, 0.05], (0.2, 0.9)))
def test_a_bound_holds_and_costs_no_more_than_it_must(share: float, job: Path, tmp_path: Path) -> None:
    path = job.with_name("machine.toml")
    free = olp.retime(program(tmp_path), path, job)
    allowed = share * free.report["inertial"]["max_um"]
    bounded = olp.retime(program(tmp_path), path, job, max_inertial_um=allowed)
    compliance = compliance_of(load_setup(path).machine)
    assert Inertial.of(bounded.trajectory.motion, compliance).most_mm * 1e3 <= allowed
    assert bounded.report["inertial"]["max_um"] <= allowed
    assert bounded.report["inertial"]["max_um"] >= 0.8 * allowed
    assert bounded.duration_s > free.duration_s
    # an axis without compliance keeps its acceleration
    free_limits, bounded_limits = (r.report["limits"]["acceleration_mm_s2"] for r in (free, bounded))
    assert bounded_limits[2] == free_limits[2]
    assert bounded_limits[0] < free_limits[0]
    # no slower than under the limits that guarantee the bound
    axes = load_setup(path, job)
    cap = guaranteed_cap(_limits(free_limits, axes), compliance, allowed * 1e-3)
    limits = capped(_limits(free_limits, axes), compliance, cap)
    names = dict(zip("XYZ", limits.acceleration.tolist(), strict=True))
    capped_axes = {k: replace(a, acceleration_mm_s2=names[k]) for k, a in axes.machine.axes.items()}
    guaranteed = olp.retime(program(tmp_path), replace(axes, machine=replace(axes.machine, axes=capped_axes)))
    assert bounded.duration_s <= guaranteed.duration_s * 1.001


def _limits(acceleration: list[float], setup: Setup) -> AxisLimits:
    axes = [setup.machine.axes[a] for a in "XYZ"]
    return AxisLimits(
        np.array([a.velocity_mm_s for a in axes]),
        np.array(acceleration),
        np.array([a.jerk_mm_s3 for a in axes]),
    )


def test_the_text_says_what_the_bound_holds(job: Path, tmp_path: Path) -> None:
    text = run("retime", program(tmp_path), "-j", job, "--max-inertial-um", "0.5").stdout
    assert "0.5 um are allowed" in " ".join(text.split())
    assert max(map(len, text.splitlines())) <= 100


def test_a_bound_that_does_not_bind_changes_nothing(job: Path, tmp_path: Path) -> None:
    path = job.with_name("machine.toml")
    free = olp.retime(program(tmp_path), path, job)
    bounded = olp.retime(program(tmp_path), path, job, max_inertial_um=1e4)
    assert bounded.duration_s == free.duration_s
    assert bounded.report["limits"] == free.report["limits"]


def test_a_bound_needs_a_compliance(tmp_path: Path) -> None:
    job = machine(tmp_path / "stiff", tables=TRUE_ZERO, job=START).with_name("job.toml")
    result = run("retime", program(tmp_path, SQUARE), "-j", job, "--max-inertial-um", "5")
    assert result.exit_code == 2
    assert "compliance_um_per_m_s2" in result.stderr
    assert "inertial" not in run("retime", program(tmp_path, SQUARE), "-j", job).stdout.lower()
