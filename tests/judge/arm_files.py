"""Files of an arm with wrong zeros of its joints, for tests."""

from __future__ import annotations

import shutil
from pathlib import Path

MACHINE = Path(__file__).resolve().parents[2] / "programs" / "arm-payload" / "machine.toml"
#: urad by joint
ZEROS = (300.0, 420.0, -510.0, 600.0, -380.0, 250.0)


def arm_files(folder: Path, zeros: tuple[float, ...] = ZEROS) -> Path:
    """The arm of the shipped job with wrong zeros of its joints alone."""
    shutil.copy(MACHINE, folder)
    tables = [f"[location.J{k + 1}]\nzero_urad = {zero}\n" for k, zero in enumerate(zeros)]
    box = ", ".join(f"J{k}_deg = [-400, 400]" for k in range(1, 7))
    head = MACHINE.with_name("calibration.toml").read_text("utf-8").partition("box =")[0]
    text = f"{head}box = {{ {box} }}\n" + "".join(tables)
    (folder / "calibration.toml").write_text(text, "utf-8")
    return folder / "machine.toml"
