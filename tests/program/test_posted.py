"""Programs as CAM systems and people write them for both controls: accepted, and judged pose by pose.

Two readers that share no code with the package read the nominal text, as it is or unrolled, and the
corrected one.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.posted_controls import BESIDE, HEIDENHAIN, NAMES, SINUMERIK
from judge import heidenhain, machines, sinumerik_words
from judge.linuxcnc import CanonMoves
from judge.machines import Recipe

import olp
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read

ORIGIN = np.array([5.0, 2.0, -200.0])
LENGTHS = {number: 100.0 + number for number in range(1, 8)}
RECIPE = {
    "travel": ((-900.0, 900.0),) * 3,
    "tools": {n: {"Z_mm": z, "radius_mm": 4.0, "name": NAMES[n]} for n, z in LENGTHS.items()},
    "work_offsets": {"G54": {"X_mm": 5.0, "Y_mm": 2.0, "Z_mm": -200.0, "set_by": "true"}},
}  # fmt: skip
CASES = [*(("heidenhain", name) for name in HEIDENHAIN), *(("sinumerik", name) for name in SINUMERIK)]


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shop")
    for control in ("heidenhain", "sinumerik"):
        machines.random_machine(folder / control, 5, Recipe(controller=control, **RECIPE))
    for name, text in {**HEIDENHAIN, **SINUMERIK, **BESIDE}.items():
        (folder / name).write_text(text)
    return folder


def canon(text: bytes, control: str) -> CanonMoves:
    if control == "heidenhain":
        for number, name in NAMES.items():
            text = text.replace(f'"{name}"'.encode(), str(number).encode())
        return heidenhain.read(text, ORIGIN, LENGTHS).canon()
    numbers = {name: number for number, name in NAMES.items()}
    return sinumerik_words.read(text, {"G54": ORIGIN, "G500": np.zeros(3)}, LENGTHS, numbers).canon()


@pytest.mark.parametrize(("control", "name"), CASES)
def test_a_program_is_accepted_and_its_poses_are_right(control: str, name: str, shop: Path) -> None:
    machine, unrolled = shop / control / "machine.toml", not name.startswith("cam")
    result = olp.correct(shop / name, machine, flatten=unrolled)
    assert result.report["deviation"]["holds"]
    nominal = bytes(olp.flatten(shop / name, machine)) if unrolled else (shop / name).read_bytes()
    for text in (nominal, result.data):
        own = read(text, load_setup(machine), DIALECTS[control]).toolpath.end_mm
        other = np.array(canon(text, control).axis)
        assert own[np.isfinite(own).all(axis=1)] == pytest.approx(
            other[np.isfinite(other).all(axis=1)], abs=1e-6
        )
