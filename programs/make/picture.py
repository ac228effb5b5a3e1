"""Draws the picture of the README: python programs/make/picture.py viewer/pictures/gantry-plate.png

The nominal path is that of the same machine without errors. Where the real machine leaves it, with the
program as it was and with the corrected one, comes from `olp.simulate`;
distances are to the nearest point of the path.
"""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

import olp

FOLDER = Path(__file__).resolve().parents[1] / "gantry-plate"
STEP_MM = 0.1
NEIGHBOURS = 16
EXAGGERATED = 1000.0
BEFORE, AFTER, NOMINAL = "#d1495b", "#1f6fb2", "#9a9a9a"


def without_errors(folder: Path) -> Path:
    """A copy of the machine whose calibration holds no error; returns its machine file."""
    shutil.copytree(FOLDER, folder, dirs_exist_ok=True)
    calibration = folder / "calibration.toml"
    text = calibration.read_text("utf-8")
    calibration.write_text(re.split(r"^\[", text, maxsplit=1, flags=re.MULTILINE)[0], "utf-8")
    return folder / "machine.toml"


def away_from(nominal: np.ndarray, actual: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m, 3) nearest points on the nominal path, and (m, 3) how far each actual point is beside it."""
    # Passes cross and run side by side: the nearest path is not always that of the nearest sample.
    _, near = cKDTree(nominal).query(actual, k=NEIGHBOURS)
    best, offset, foot = np.full(len(actual), np.inf), np.empty_like(actual), np.empty_like(actual)
    for first in (column + step for column in near.T for step in (-1, 0)):
        first = np.clip(first, 0, len(nominal) - 2)
        begin, along = nominal[first], nominal[first + 1] - nominal[first]
        square = np.maximum((along * along).sum(axis=1), 1e-18)
        share = np.clip(((actual - begin) * along).sum(axis=1) / square, 0.0, 1.0)
        point = begin + share[:, None] * along
        distance = np.linalg.norm(actual - point, axis=1)
        better = distance < best
        best[better], foot[better], offset[better] = distance[better], point[better], (actual - point)[better]
    return foot, offset


def line(axes: object, points: np.ndarray, **style: object) -> None:
    """A path in plan view, broken where the tool is lifted."""
    gap = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1) > 5.0
    axes.add_collection(LineCollection(np.split(points[:, :2], np.flatnonzero(gap) + 1), **style))


def main(target: str) -> None:
    program, machine = FOLDER / "plate.ngc", FOLDER / "machine.toml"
    with tempfile.TemporaryDirectory() as folder:
        nominal = olp.simulate(program, without_errors(Path(folder)), step_mm=STEP_MM).points_mm
    corrected = olp.correct(program, machine)
    paths = {}
    for name, data in (("before", program.read_bytes()), ("after", corrected.data)):
        real = olp.simulate(data, machine, step_mm=STEP_MM).points_mm
        foot, offset = away_from(nominal, real)
        cutting = foot[:, 2] < 0
        paths[name] = foot[cutting], offset[cutting]

    figure = Figure(figsize=(9.0, 8.2), layout="constrained")
    plan, size = figure.subplots(2, 1, height_ratios=(2.6, 1.0))
    line(plan, nominal[nominal[:, 2] < 0], colors=NOMINAL, linewidths=2.4, label="nominal path")
    for name, colour in (("before", BEFORE), ("after", AFTER)):
        foot, offset = paths[name]
        label = {"before": "uncorrected path", "after": "corrected path"}[name]
        label += f", error x {EXAGGERATED:.0f}"
        line(plan, foot + EXAGGERATED * offset, colors=colour, linewidths=0.8, label=label)
        length = np.linspace(0.0, len(foot) * STEP_MM / 1e3, len(foot))
        um = np.linalg.norm(offset, axis=1) * 1e3
        size.semilogy(length, np.maximum(um, 1e-2), ".", markersize=0.7, color=colour, rasterized=True)
        print(f"{name}: {um.max():.2f} um at most, {np.sqrt((um * um).mean()):.2f} um rms, {len(um)} points")
    plan.set(aspect="equal", xlabel="X in mm", ylabel="Y in mm")
    plan.autoscale_view()
    plan.legend(loc="upper center", bbox_to_anchor=(0.5, 1.09), ncols=3, frameon=False)
    tolerance = corrected.report["tolerance_um"]
    size.axhline(tolerance, color="0.2", linewidth=0.8, linestyle="--")
    size.text(1.005, tolerance, "tolerance", transform=size.get_yaxis_transform(), va="center", fontsize=8)
    size.set(xlabel="path in the material, in m", ylabel="distance from the\nnominal path, in um")
    size.set(xlim=(0.0, length[-1]), ylim=(1e-2, 100.0))
    size.grid(color="0.9", linewidth=0.5)
    figure.savefig(target, dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main(sys.argv[1])
