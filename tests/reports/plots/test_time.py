"""Plots of a motion over time."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from cases.trajectory import LIMITS, random_route
from cli.test_retime import CHANGES, START, TOOLS, program, run

from olp.core.errors import UsageError
from olp.reports.plots import time as plots_time
from olp.reports.plots.time import motion_plot
from olp.trajectory.plan import plan

pytest.importorskip("matplotlib")


@pytest.fixture
def job(tmp_path: Path) -> Path:
    return machine(tmp_path / "m", tables=TRUE_ZERO + TOOLS, job=START).with_name("job.toml")


@pytest.mark.slow
def test_the_picture_names_what_it_shows_and_is_the_same_each_time() -> None:
    way, limits = random_route(3)
    trajectory = plan(way, limits)
    first, second = (motion_plot(trajectory, way, "part.ngc on mill") for _ in range(2))
    assert first == second
    text = first.decode()
    for words in ("part.ngc on mill", "speed in mm/s", "acceleration in mm/s2", "jerk in mm/s3", "time in s"):
        assert words in text
    for label in ("speed", "feed", "X", "Y", "Z", "limit of the axis"):
        assert re.search(rf">{label}</text>", text)
    assert motion_plot(trajectory, way, "part", "png").startswith(b"\x89PNG")


def test_bands_of_a_long_motion_reach_as_far_as_its_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    way, limits = random_route(8)
    trajectory = plan(way, limits)
    pieces = np.arange(len(trajectory.motion))
    monkeypatch.setattr(plots_time, "_COLUMNS", 40)
    monkeypatch.setattr(plots_time, "_BLOCK", 7)
    lines = plots_time._lines(trajectory, pieces, 0.0, trajectory.duration_s)
    bands = plots_time._bands(trajectory, pieces, 0.0, trajectory.duration_s)
    assert len(bands[0]) == 40 < len(lines[0])
    for thin, wide in zip(lines[1:], bands[1:], strict=True):
        np.testing.assert_array_equal(thin.max(axis=(1, 2)), wide[:, 1].max(axis=1))
        np.testing.assert_array_equal(thin.min(axis=(1, 2)), wide[:, 0].min(axis=1))
        assert (wide[:, 0] <= wide[:, 1]).all()


@pytest.mark.slow
def test_a_span_cuts_the_motion() -> None:
    way, _ = random_route(3)
    trajectory = plan(way, LIMITS)
    whole = trajectory.duration_s
    first, last = trajectory.motion.piece_at(np.array([0.3, 0.6]) * whole)
    pieces = np.arange(first, last + 1)
    time, *_ = plots_time._lines(trajectory, pieces, 0.3 * whole, 0.6 * whole)
    assert (time[0], time[-1]) == pytest.approx((0.3 * whole, 0.6 * whole))
    assert motion_plot(trajectory, way, "", from_s=0.3 * whole, to_s=0.6 * whole)
    for span in ((-1.0, 1.0), (whole, whole + 1.0), (0.5, 0.5)):
        with pytest.raises(UsageError, match="no motion to draw"):
            motion_plot(trajectory, way, "", from_s=span[0], to_s=span[1])


@pytest.mark.slow
def test_on_the_command_line(job: Path, tmp_path: Path) -> None:
    part, plot = program(tmp_path, CHANGES), tmp_path / "motion.png"
    result = run("retime", part, "-j", job, "--plot", plot)
    assert result.exit_code == 0
    for n in (1, 2, 3):
        assert f"motion-{n}.png" in result.stderr
        assert (tmp_path / f"motion-{n}.png").read_bytes().startswith(b"\x89PNG")
    assert (
        run("retime", part, "-j", job, "--plot", plot, "--stretch", "2", "--plot-span", "0", "0.1").exit_code
        == 0
    )
    assert plot.stat().st_size > 0
    for wrong in (["--plot", tmp_path / "x.gif"], ["--plot-span", "0", "1"], ["--plot", plot]):
        refused = run("retime", part, "-j", job, "--stretch", "2", *wrong)
        assert refused.exit_code == 2
        assert refused.stderr.startswith("olp: error: ")
