"""A small plant: two machines with calibrations, programs in a tree of folders, and jobs."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from cases.acceptance import TRUE_ZERO, machine

from olp.workflows.batch import Batch, batch

#: um/m of squareness; the error of the programs is this times their size.
SQUARENESS = "[squareness]\nC0Y_urad = {}\n"
START = "start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }\n"


def program(size: int) -> str:
    """A square path, whose deviation without correction grows with its size."""
    return f"G21 G90 G54 G64 P0.02\nG1 X{size} Y0 Z0 F3000\nX{size} Y{size}\nX0 Y{size}\nX0 Y0\nM2\n"


def plant(folder: Path) -> Path:
    """Two machines, three programs in two folders, and a job for one of them on the second machine."""
    machine(folder / "mill", SQUARENESS.format(203.3), tables=TRUE_ZERO)
    machine(folder / "router", SQUARENESS.format(-503.7), tables=TRUE_ZERO)
    for name in ("mill", "router"):
        for file, key in (("machine.toml", "name"), ("calibration.toml", "machine")):
            path = folder / name / file
            path.write_text(path.read_text().replace(f'{key} = "m"', f'{key} = "{name}"'))
    (folder / "parts" / "brackets").mkdir(parents=True)
    (folder / "parts" / "one.ngc").write_text(program(100))
    (folder / "parts" / "brackets" / "two.ngc").write_text(program(200))
    (folder / "parts" / "brackets" / "board.nc").write_text(program(300))
    (folder / "parts" / "brackets" / "board.toml").write_text(
        f'schema = "olp-job-1"\nprogram = "board.nc"\nmachine = "../../router/machine.toml"\n{START}'
    )
    return folder


def correct_all(folder: Path, **words: Any) -> Batch:
    """The plant corrected by this process."""
    words = {"machine": folder / "mill" / "machine.toml", "workers": 1, "reports": ""} | words
    machine = words.pop("machine")
    return batch([folder / "parts"], machine, output=folder / "out", **words)


def states(result: Batch) -> dict[str, str]:
    """What became of each program."""
    return {row["program"]: row["state"] for row in result.report["programs"]}


def contents(folder: Path) -> dict[str, bytes]:
    """All files of a folder by their path."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def moved(folder: Path, name: str) -> Path:
    """A copy of a plant, in another folder beside it."""
    return Path(shutil.copytree(folder, folder.with_name(name)))
