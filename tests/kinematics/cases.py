"""Machines of any joints for tests: the golden cases, and small ones written by hand."""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from olp.core.arrays import Array
from olp.files.kinematics.load import JointSetup, load_joint_setup

GOLDEN = Path(__file__).resolve().parents[3] / "shared" / "golden" / "kinematics"
#: The golden cases; they are found where the folder is.
STRUCTURES = (
    *("arm_6r_kr6", "arm_7r_on_track", "gantry_nutating", "gantry_wrist", "hexapod", "linear_delta"),
    *("linuxcnc_5axis", "linuxcnc_puma560", "linuxcnc_scara", "linuxcnc_xyzac", "polar_rppr", "scara"),
    *("tripod", "xyzac_trunnion", "xyzbc_head_table"),
)


def need_golden() -> None:
    """Skips where the golden cases are not there, and fails where they have to be."""
    if not GOLDEN.is_dir():
        assert not os.environ.get("OLP_REQUIRE_CORPUS"), "the golden cases are missing"
        pytest.skip("the golden cases are not there")


@functools.cache
def golden(name: str) -> tuple[JointSetup, dict[str, Any]]:
    """The machine of a golden case, and its figures."""
    need_golden()
    folder = GOLDEN / name
    job = folder / "job.toml"
    figures = json.loads((GOLDEN / f"{name}.json").read_text("utf-8"))
    return load_joint_setup(folder / "machine.toml", job if job.exists() else None), figures


def columns(setup: JointSetup, rows: Sequence[dict[str, float]]) -> Array:
    """(n, axes) axis values of rows by name."""
    return np.array([[row[name] for name in setup.machine.structure.order] for row in rows])


def random_values(setup: JointSetup, count: int, seed: int = 0) -> Array:
    """(n, axes) axis values within the middle of the travels, where platforms close."""
    ends = np.array([joint.travel for joint in setup.machine.structure.joints.values()])
    middle, half = ends.mean(axis=1), 0.5 * np.diff(ends, axis=1)[:, 0]
    if setup.machine.structure.platforms:
        half = 0.1 * half
    return np.random.default_rng(seed).uniform(middle - half, middle + half, (count, len(ends)))
