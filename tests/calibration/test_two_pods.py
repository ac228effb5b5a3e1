"""The comparison of an uncorrected map of two pods, equation (1) and the estimator, on one machine."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))
import bench_two_pods as bench
from judge import simulated


def test_rays_without_noise_meet_where_they_came_from(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "URAD", 0.0)
    place = np.random.default_rng(1).uniform(0.0, 2000.0, (20, 3))
    assert bench.triangulated(place, np.random.default_rng(2)) == pytest.approx(place, abs=1e-6)


def test_equation_1_of_a_machine_that_it_describes_leaves_its_noise() -> None:
    """With no tool and lines through its zero, equation (1) is complete to first order."""
    m = simulated.machine(3, "smooth", "FXYZ")
    lines = simulated.all_lines(m, 3, line_mm=(0.0, 0.0, 0.0), tool=(0.0, 0.0, 0.0))
    position = np.random.default_rng(5).uniform(m.box[:, 0], m.box[:, 1], (500, 3))
    residual = m.error(position, np.zeros(3)) - bench.equation_1(m, lines, (0.0, 0.0, 0.0))(
        position, np.zeros(3)
    )
    # squares of 5 urad over 2 m are 10 um
    assert simulated.rms_um(simulated.off_frame(position, residual)) < 8.0


@pytest.mark.slow
def test_the_conclusions_hold_on_a_machine() -> None:
    rows_by_method = {row.method: row.residual for row in bench.compared("smooth", 2)}
    median = {
        name: {tool: float(np.median(v)) for tool, v in residuals.items()}
        for name, residuals in rows_by_method.items()
    }
    for tool in bench.TOOLS:
        raw_map, zero = (median[k][tool] for k in ("raw map of 990 points", "equation (1), levers from zero"))
        pods, both = (
            median[k][tool] for k in ("estimator, two pods, 1000 points", "estimator, lines and two pods")
        )
        assert both < pods < zero < median["nothing"][tool]
        assert pods < 0.5 * raw_map
    lines, placed = median["estimator, lines"], median["equation (1), levers from the lines"]
    assert lines["other tool"] < placed["other tool"]
