"""Points whose coordinates have uncertainties of their own, as a network of stations gives them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from olp.calibration.observations.points import Points
from olp.core.errors import ConfigError
from olp.files.measurements.checkpoints import load_checkpoints
from olp.files.measurements.point_readings import COVARIANCE, SIGMA
from olp.files.measurements.reader import load_measurements

AXES = "X_mm,Y_mm,Z_mm,measured_X_mm,measured_Y_mm,measured_Z_mm"
PLACES = [(0, 0, 0), (900, 0, 0), (0, 700, 0), (900, 700, -400), (450, 300, -200)]


def written(folder: Path, names: tuple[str, ...], values: list[tuple[float, ...]], keys: str = "") -> Points:
    """Points of a plan with some columns, the same values in each row."""
    rows = [[*place, *place, *own] for place, own in zip(PLACES, values, strict=True)]
    text = "\n".join([",".join((AXES, *names)), *(",".join(map(str, row)) for row in rows)])
    (folder / "t.csv").write_text(text + "\n", "utf-8")
    (folder / "measurements.toml").write_text(
        'schema = "olp-measurements-1"\nmachine = "m"\nmeasured = 2026-05-14\ntemperature_degC = 20.0\n'
        f'[[points]]\nfile = "t.csv"\ntool_mm = [0, 0, 0]\n{keys}',
        "utf-8",
    )
    (points,) = load_measurements([folder]).of(Points)
    return points


def test_covariances_of_points_are_read(tmp_path: Path) -> None:
    points = written(tmp_path, COVARIANCE, [(25.0, 3.0, -2.0, 16.0, 1.0, 9.0)] * 5)
    matrix = np.array([[25.0, 3.0, -2.0], [3.0, 16.0, 1.0], [-2.0, 1.0, 9.0]]) * 1e-6
    assert points.covariance_mm2 is not None
    assert points.covariance_mm2 == pytest.approx(np.tile(matrix, (5, 1, 1)))
    assert points.sigma == pytest.approx(np.sqrt(50.0 / 3.0) * 1e-3)
    again, _ = load_checkpoints(tmp_path / "t.csv", tool_mm=(0.0, 0.0, 0.0))
    assert again.covariance_mm2 == pytest.approx(points.covariance_mm2)


def test_uncertainties_of_coordinates_are_read(tmp_path: Path) -> None:
    points = written(tmp_path, SIGMA, [(5.0, 4.0, 3.0)] * 5)
    assert points.covariance_mm2 is not None
    assert points.covariance_mm2[2] == pytest.approx(np.diag([25e-6, 16e-6, 9e-6]))


@pytest.mark.parametrize(
    ("names", "values", "keys", "words"),
    [
        (SIGMA, (5.0, 4.0, 3.0), "sigma_um = 8.0\n", "sigma_um is stated here and in columns"),
        ((), (), "", "sigma_um is missing"),
        (SIGMA, (5.0, 0.0, 3.0), "", "line 2: the covariance of the point is not positive"),
        (SIGMA, (5.0, -4.0, 3.0), "", "line 2: the covariance of the point is not positive"),
        (
            COVARIANCE,
            (25e-6, 0.0, 0.0, 25e-6, 0.0, 36e-6),
            "",
            "which no instrument reaches; expected columns",
        ),
        (SIGMA, (5e-3, 5e-3, 6e-3), "", "which no instrument reaches; expected columns in um or um"),
        (COVARIANCE, (1.0, 2.0, 0.0, 1.0, 0.0, 1.0), "", "line 2: the covariance of the point is not"),
        (SIGMA[:2], (5.0, 4.0), "", "sigma_Z_um"),
        ((*SIGMA, *COVARIANCE), (1, 1, 1, 1, 0, 0, 1, 0, 1), "", "expected one of both kinds"),
    ],
)
def test_uncertainties_that_cannot_be_are_refused(
    names: tuple[str, ...], values: tuple[float, ...], keys: str, words: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError) as refused:
        written(tmp_path, names, [values] * 5, keys)
    assert words in str(refused.value)
