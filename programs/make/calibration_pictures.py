"""Draws the pictures of a calibration: python programs/make/calibration_pictures.py viewer/pictures

They show the measured lines of programs/gantry-lines and the fit that `olp calibrate fit` makes of them.
"""

from __future__ import annotations

import sys
from pathlib import Path

import olp
from olp import plots_calibration, report_calibration

FOLDER = Path(__file__).resolve().parents[1] / "gantry-lines"


def pictures() -> dict[str, bytes]:
    """PNG by the name of the file."""
    machine = FOLDER / "machine.toml"
    found = olp.evaluate_lines([FOLDER], machine)
    plots = report_calibration.plots_of(found, "png")
    fitted = olp.fit_calibration(FOLDER, machine)
    lines = report_calibration.fitted_lines(fitted.fit)
    residuals = [(r.line, r.residual) for r in fitted.fit.lines if r.line.axis == 0]
    return {
        "calibrate-positioning.png": plots["positioning-EXX"],
        "calibrate-angles.png": plots["angles-X"],
        "calibrate-straightness.png": plots["straightness-X"],
        "calibrate-squareness.png": plots["squareness-C0Y"],
        "calibrate-fitted.png": plots_calibration.fitted([f for f in lines if f.line.axis == 0], "png"),
        "calibrate-residuals.png": plots_calibration.residuals(residuals, "png"),
    }


if __name__ == "__main__":
    target = Path(sys.argv[1])
    for name, data in pictures().items():
        (target / name).write_bytes(data)
        print(target / name)
