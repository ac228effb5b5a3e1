"""A real arm: calibrated from some postures of a public set, and judged at all others.

    git clone https://github.com/icelinker/Robot-Calibration-LaserTracker
    python tests/benchmarks/bench_irb120.py Robot-Calibration-LaserTracker [SEEDS]

An ABB IRB 120 held three reflectors, which a FARO tracker read in 982 postures. The set states no licence: it
is fetched, and no part of the project. Dimensions are those of its data sheet. Joints 2 and 3 give way under
the arm, whose weight nobody knows, and joints 2 to 6 under the plate with the reflectors, whose weight is a
guess: they yield in proportion. Frame and nests are found with the arm.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

import olp
from olp.workflows.calibrate_joints import FittedJoints

#: Lines of the data sheet: direction and a point, mm.
LINES = (
    ((0, 0, 1), (0, 0, 290)), ((0, 1, 0), (0, 0, 290)), ((0, 1, 0), (0, 0, 560)),
    ((1, 0, 0), (0, 0, 630)), ((0, 1, 0), (302, 0, 630)), ((1, 0, 0), (374, 0, 630)),
)  # fmt: skip
TRAVEL = ((-165, 165), (-110, 110), (-110, 70), (-160, 160), (-120, 120), (-400, 400))
#: Nests from the flange as its drawing would have them, mm.
NESTS = ((0.0, -1.0, 121.0), (75.0, 90.0, 214.0), (151.0, -2.0, 122.0))
#: The plate with the nests, kg.
PAYLOAD_KG = 1.0
#: urad per Nm, and urad under the weight of the arm: what is usual for small arms.
YIELD, GRAVITY = 300.0, 3000.0
#: um: what a coordinate scatters by beyond the model, and what is known of nests before.
SIGMA_UM, NEST_UM = 60.0, 500.0


def machine_text() -> str:
    lines = [
        'schema = "olp-machine-1"',
        'name = "irb120"',
        'chain = "F J1 J2 J3 J4 J5 J6"',
        'controller = "abb-rapid"',
    ]
    lines += ["compensated_by_controller = []"]
    for k, ((direction, point), travel) in enumerate(zip(LINES, TRAVEL, strict=True), 1):
        lines += [f"[axes.J{k}]", 'kind = "rotary"', f"direction = {list(map(float, direction))}"]
        lines += [f"point_mm = {list(map(float, point))}", f"travel_deg = {list(map(float, travel))}"]
        lines += ["least_increment_deg = 0.001"]
    return "\n".join([*lines, "[gauge]", "point_mm = [374.0, 0.0, 630.0]", "B_deg = 90.0", ""])


def read_set(place: Path) -> tuple[np.ndarray, np.ndarray]:
    """(n, 6) commanded angles, and (n, 3, 3) what was read of each nest."""

    def table(file: str) -> np.ndarray:
        if (place / file).exists():
            return np.loadtxt(place / file)
        # a copy without a work tree
        text = subprocess.run(
            ["git", "-C", str(place), "show", f"HEAD:{file}"], check=True, capture_output=True
        )
        return np.loadtxt(text.stdout.decode().splitlines())

    commanded = table("3-Full Measurement/Input/generated_joints.txt")
    shown = {tuple(row): k for k, row in enumerate(table("4-DataProcess/Input/measured_joints.txt").tolist())}
    rows = [shown[tuple(row)] for row in table("4-DataProcess/Output/processed_joints.txt").tolist()]
    read = np.stack([table(f"4-DataProcess/Output/processed_SMR_{k}.txt") for k in (1, 2, 3)], 1)
    return commanded[rows], read


def fitted(folder: Path, values: np.ndarray, read: np.ndarray) -> FittedJoints:
    """The calibration of the arm from postures (n, 6) and readings (n, 3, 3) of its nests."""
    (folder / "machine.toml").write_text(machine_text())
    lines = ["J1_deg,J2_deg,J3_deg,J4_deg,J5_deg,J6_deg,measured_X_mm,measured_Y_mm,measured_Z_mm,nest"]
    for value, places in zip(values.tolist(), read.tolist(), strict=True):
        lines += [",".join(f"{v:.9g}" for v in (*value, *place)) + f",N{k}" for k, place in enumerate(places)]
    (folder / "points.csv").write_text("\n".join([*lines, ""]))
    nests = "".join(f"N{k} = {list(nest)}\n" for k, nest in enumerate(NESTS))
    (folder / "measurements.toml").write_text(
        'schema = "olp-measurements-1"\nmachine = "irb120"\nmeasured = 2020-01-01\ntemperature_degC = 20.0\n'
        'elasticity = ["J2", "J3", "J4", "J5", "J6"]\ngravity = ["J2", "J3"]\n'
        f"[prior]\nyield_urad_Nm = {YIELD}\ngravity_urad = {GRAVITY}\n"
        f'[[points]]\nfile = "points.csv"\nsigma_um = {SIGMA_UM}\ntool_mm = [0.0, 0.0, 0.0]\n'
        f"nest_sigma_um = {NEST_UM}\npayload_kg = {PAYLOAD_KG}\n"
        f"payload_centre_mm = {np.mean(NESTS, axis=0).tolist()}\n[points.nests_mm]\n{nests}"
    )
    return olp.fit_joint_calibration(folder, folder / "machine.toml")


def off(result: FittedJoints, values: np.ndarray, read: np.ndarray) -> np.ndarray:
    """(n, 3) mm by which nests at other postures are off, in the frame and with the nests of the fit."""
    (source,) = result.fit.sources
    pose = result.fit.model.machine(result.fit.theta, source.start.reading.payload).actual(values)
    misses = []
    for k in range(3):
        other = replace(source.start.reading, values=values, which=np.full(len(values), k))
        misses.append(read[:, k] - replace(source.start, reading=other).predicted(pose, source.own))
    return np.linalg.norm(np.stack(misses, 1), axis=2)


def main(place: Path, seeds: int) -> None:
    values, read = read_set(place)
    for count in (200, 50, 25):
        for seed in range(seeds):
            train = np.zeros(len(values), bool)
            train[np.random.default_rng(seed).permutation(len(values))[:count]] = True
            with tempfile.TemporaryDirectory() as folder:
                result = fitted(Path(folder), values[train], read[train])
            miss = off(result, values[~train], read[~train])
            stated = 1e-3 * result.report["uncertainty_in_best_frame"]["tip_with_misfit_um"]
            covered = 100.0 * np.mean(miss < 2.0 * stated)
            print(
                f"{count:4d} postures, seed {seed}: held out mean {miss.mean():.3f}, max {miss.max():.3f}, "
                f"rms {np.sqrt(np.mean(miss**2)):.3f}, stated {stated:.3f} mm, within twice that "
                f"{covered:.1f} %; reduced chi-square {result.report['reduced_chi_square']:.2f}"
            )


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 3)
