"""What remains after a correction, by where it comes from; and the random part as statistics."""

from __future__ import annotations

import datetime
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from click.testing import CliRunner

import olp
from olp.cli import main
from olp.core.errors import ConfigError
from olp.errormodel.calibration import Calibration
from olp.files.calibration.reader import load_calibration
from olp.files.calibration.writer import calibration_files
from olp.files.write import write_files

REPEATS = "[repeatability]\nX_um = 0.3\nY_um = 0.4\nZ_um = 1.2\n"
PROGRAM = b"G21 G90 G54 G64 P0.001 Q0\nG0 X0 Y0 Z0\nG1 X100 F600\nM2\n"


def test_the_parts_of_the_budget_worked_by_hand(tmp_path: Path) -> None:
    path = machine(tmp_path, REPEATS, tables=TRUE_ZERO)
    report = olp.correct(PROGRAM, path).report
    expected = {"model_and_chords": 0.0, "inversion": 1e-6, "rounding": 0.87, "increment": 0.0}
    # sqrt(0.3^2 + 0.4^2 + 1.2^2) = 1.3; digits of 0.001 mm are increments of 0.001 mm
    assert report["budget_um"] == pytest.approx({**expected, "random_2_sigma": 2.6})
    beside = olp.retime(PROGRAM, path, proof=report).report["proof"]
    assert beside["budget_um"] == report["budget_um"]


def test_inches_are_rounded_by_the_control_once_more(tmp_path: Path) -> None:
    """0.00001 in are 0.254 um, no multiple of 1 um: up to half an increment an axis on top."""
    path = machine(tmp_path, tables=TRUE_ZERO)
    budget = olp.correct(PROGRAM.replace(b"G21", b"G20").replace(b"X100", b"X4"), path).report["budget_um"]
    assert budget["rounding"] == pytest.approx(0.87 * 0.254, rel=1e-6)
    assert budget["increment"] == pytest.approx(0.5 * 3**0.5, rel=1e-6)
    assert "random_2_sigma" not in budget


def test_the_random_part_is_two_deviations_of_a_machine_that_scatters() -> None:
    """A machine that scatters so leaves 95 % of its visits within the figure along each of its axes."""
    sigma = np.array([0.3, 0.4, 1.2])
    away = np.linalg.norm(np.random.default_rng(1).normal(0.0, sigma, (100_000, 3)), axis=1)
    assert 0.93 < np.mean(away <= 2.0 * np.linalg.norm(sigma)) < 1.0


def test_the_texts_of_a_correction_state_it(tmp_path: Path) -> None:
    path = machine(tmp_path, REPEATS, tables=TRUE_ZERO)
    (tmp_path / "p.ngc").write_bytes(PROGRAM)
    words = ["correct", str(tmp_path / "p.ngc"), "-m", str(path), "-o", str(tmp_path / "o.ngc")]
    done = CliRunner().invoke(main, [*words, "--report", str(tmp_path / "r.md")])
    assert done.exit_code == 0, done.output
    for text in (done.output, (tmp_path / "r.md").read_text()):
        assert "random: repeatability, two standard deviations" in text
        assert "least increment of the control" in text
        assert "inversion of the model" in text


def test_it_is_written_and_read_back_and_never_below_zero(tmp_path: Path) -> None:
    box = np.array([[0.0, 1.0]] * 3)
    whole = Calibration("m", box, repeatability_mm=(3e-4, 0.0, 1e-3), measured=datetime.date(2026, 1, 1))
    write_files(calibration_files(whole, tmp_path / "c.toml"))
    assert load_calibration(tmp_path / "c.toml").repeatability_mm == (3e-4, 0.0, 1e-3)
    with pytest.raises(ConfigError, match=r"repeatability.X_um = -1"):
        text = (tmp_path / "c.toml").read_text().replace("X_um = 0.3", "X_um = -1.0")
        (tmp_path / "c.toml").write_text(text)
        load_calibration(tmp_path / "c.toml")
