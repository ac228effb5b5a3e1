"""Simulated campaigns on machines of any joints: readings of true machines with noise, as files of a plan."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from kinematics.cases import golden, random_values

from olp.calibration.joints.adjustment import JointFit, fit_joints
from olp.calibration.joints.candidates import Priors
from olp.calibration.joints.readings import Lengths, Points, Reading, SixD
from olp.calibration.joints.unknowns import Model, model_of
from olp.core.arrays import Array
from olp.core.rigid_fit import rotation_of
from olp.files.toml_text import toml_lines
from olp.kinematics.poses import Poses

TOOL = (30.0, -20.0, 100.0)
#: Three nests that do not lie on one line.
NESTS = np.array(((0.0, 0.0, 0.0), (60.0, 0.0, 0.0), (0.0, 70.0, 20.0)))
CENTRES = np.array(((500.0, 200.0, -300.0), (-600.0, 100.0, 200.0), (0.0, -700.0, 500.0)))
#: mm and rad of a reading.
SIGMA, SIGMA_RAD = 0.02, 5e-5
TURN, SHIFT = rotation_of(np.array((0.3, 1.0, -2.0))), np.array((3000.0, -500.0, 200.0))


def true_machine(name: str, seed: int = 0, count: int = 60, size: float = 1.0) -> tuple[Model, Array, Array]:
    """The model of a golden structure, unknowns as they are usual before measuring, and postures."""
    structure = golden(name)[0].machine.structure
    values = random_values(golden(name)[0], count, seed)
    model = model_of(structure, values, Priors.of(structure))
    return model, size * model.root @ np.random.default_rng(seed + 1).normal(size=len(model.unknowns)), values


def known_machine(name: str, seed: int = 0, kind: str = "points") -> tuple[Model, JointFit, Array, Array]:
    """The model of a golden structure, a fit of 50 readings of a true machine, its unknowns, and 40 other
    postures."""
    model, theta, values = true_machine(name, seed, 50)
    fit = fit_joints(model, [read(kind, model.machine(theta).actual(values), values, seed)])
    return model, fit, theta, random_values(golden(name)[0], 40, seed + 1000)


def read(kind: str, pose: Poses, values: Array, seed: int = 0, names: int = 3, noise: float = 1.0) -> Reading:
    """What an instrument reads at poses of the gauge frame; `noise` scales what is stated."""
    random = np.random.default_rng(seed + 2)
    count = len(values)
    which = random.integers(0, names, count)
    same = {
        "source": f"{kind}.csv", "values": values, "row": np.arange(count) + 2, "tool_mm": TOOL,
        "sigma": SIGMA, "names": tuple(str(k + 1) for k in range(names)), "which": which,
    }  # fmt: skip
    off = noise * SIGMA * random.normal(size=(count, 3))
    if kind == "points":
        at = pose.at(np.array(TOOL) + NESTS[which]) @ TURN.T + SHIFT
        return Points(**same, measured_mm=at + off, nests_mm=NESTS[:names])
    if kind == "poses":
        slips = np.stack([rotation_of(v) for v in noise * SIGMA_RAD * random.normal(size=(count, 3))])
        at = pose.at(np.array(TOOL)) @ TURN.T + SHIFT
        turned = slips @ TURN @ pose.rotation
        return SixD(**same, measured_mm=at + off, measured_turn=turned, sigma_rad=SIGMA_RAD)
    far = np.linalg.norm(pose.at(np.array(TOOL)) - CENTRES[which], axis=1)
    return Lengths(**same, measured_mm=far[:, None] + off[:, :1], centres_mm=CENTRES[:names] + 0.5)


def campaign(folder: Path, name: str, machine: str, readings: dict[str, str], tables: str) -> Path:
    """A plan with its files."""
    head = {"schema": "olp-measurements-1", "machine": machine, "temperature_degC": 20.0}
    text = "\n".join([*toml_lines(head), "measured = 2026-11-20", tables])
    for file, content in readings.items():
        (folder / file).write_text(content)
    (folder / name).write_text(text)
    return folder / name


def as_csv(
    order: list[str], values: Array, columns: list[str], read: Array, which: list[str] | None = None
) -> str:
    """A file of readings."""
    lines = [",".join([*order, *columns, *([which[0]] if which else [])])]
    for k, (value, row) in enumerate(zip(values.tolist(), read.tolist(), strict=True)):
        cells = [f"{v:.9g}" for v in (*value, *row)]
        lines.append(",".join([*cells, *([which[k + 1]] if which else [])]))
    return "\n".join(lines) + "\n"
