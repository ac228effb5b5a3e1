"""CPU time of correcting and proving programs of 10,000 targets on a six-axis arm with a payload, and on a
gantry: `python tests/benchmarks/bench_robots.py [TARGETS] [LANGUAGE ...]`.

Straight moves of some mm in each language of robots, half of the targets declared where it declares them. All
from the bytes of the program to those of the corrected one, read again, with the collector of the command.
On the gantry, which cannot turn its tool, targets are turned alike. The pulses among those of INFORM stay as
they are there, so what follows them is not proved."""

from __future__ import annotations

import gc
import resource
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from judge.arm import Arm
from judge.arm_files import MACHINE
from workflows.test_robots_on_arms import FRAME_DEG, ORIGIN, WRITERS, Step, stated

import olp
from olp.__main__ import _COLLECT_AFTER

GANTRY = MACHINE.parents[1] / "gantry-plate" / "machine.toml"
MIDDLE = np.array([10.0, 15.0, 35.0, 20.0, 50.0, -30.0])
ARM_JOB = """schema = "olp-job-1"
machine = "machine.toml"
payload_kg = 6.5
payload_centre_mm = [15.0, 0.0, 90.0]
"""
#: Where the gantry has the arm's own frame by its name in each language, and the frame and the tool that some
#: programs only name.
BASE_MM = np.array([0.0, 300.0, -600.0])
GANTRY_JOB = (
    'schema = "olp-job-1"\nmachine = "machine.toml"\n[tools.2]\ngauge_to_tip_mm = [-36.0, 28.7, -153.6]\n'
)
WORLDS, NAMED = ("BASE0", "wobj0", "base", "world"), ("UFRAME3", "UF3")
#: Targets of the closed path on the gantry.
ROUND = 250


def steps(count: int) -> list[Step]:
    """A move of joints, then straight ones, to joints that swing by some degrees."""
    wave, phase = np.arange(1, 4)[:, None], np.random.default_rng(1).uniform(0.0, 6.0, (3, 1, 6))
    angle = 2.0 * np.pi * 20.0 * np.arange(count)[None, :, None] / 10_000
    joints = MIDDLE + 3.0 * np.sum(np.sin(wave[..., None] * angle + phase) / wave[..., None], axis=0)
    return [("L" if k else "J", row) for k, row in enumerate(joints.round(3))]


def turned_alike(count: int) -> list[Step]:
    """Straight moves along a closed path, round and round, with the tool turned alike in all places."""
    arm, near, joints = Arm(MACHINE), MIDDLE, []
    turn, centre = arm.pose(MIDDLE)
    for angle in 2.0 * np.pi * np.arange(min(count, ROUND)) / ROUND:
        wave = np.sin(angle * np.arange(1, 4) + np.arange(3))
        near = arm.joints(turn, centre + 150.0 * wave, near)
        joints.append(near)
    return [("L" if k else "P", joints[k % ROUND]) for k in range(count)]


def correct_on_arm(text: bytes, folder: Path, language: str) -> dict[str, Any]:
    machine = stated(files_of(MACHINE, folder, ARM_JOB), language)
    return olp.correct_joints(text, machine, folder / "job.toml", outside_box="hold").report


def correct_on_gantry(text: bytes, folder: Path, language: str) -> dict[str, Any]:
    offset = '[work_offsets.{}]\nX_mm = {}\nY_mm = {}\nZ_mm = {}\nC_deg = {}\nset_by = "true"\n'
    frames = [offset.format(name, *BASE_MM, 0.0) for name in WORLDS]
    frames += [offset.format(name, *(BASE_MM + ORIGIN), FRAME_DEG[0]) for name in NAMED]
    machine = files_of(GANTRY, folder, "".join([GANTRY_JOB, *frames]))
    return olp.correct(text, machine, folder / "job.toml", outside_box="hold").report


def files_of(machine: Path, folder: Path, job: str) -> Path:
    """The machine file with those beside it in a folder, and the job file there."""
    for file in machine.parent.iterdir():
        shutil.copyfile(file, folder / file.name)
    (folder / "job.toml").write_text(job, "utf-8")
    return folder / "machine.toml"


MACHINES: dict[str, tuple[Callable[..., dict[str, Any]], Callable[[int], list[Step]]]] = {
    "arm": (correct_on_arm, steps),
    "gantry": (correct_on_gantry, turned_alike),
}


def measured(machine: str, language: str, targets: int) -> None:
    correct, path = MACHINES[machine]
    text = WRITERS[language](path(targets))
    with tempfile.TemporaryDirectory() as place:
        before = resource.getrusage(resource.RUSAGE_SELF).ru_utime
        report = correct(text, Path(place), language)
        seconds = resource.getrusage(resource.RUSAGE_SELF).ru_utime - before
    print(f"{language:8s} {machine:8s} {seconds:6.2f} s  proved {report['verdict']['ok']}", flush=True)


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    gc.set_threshold(_COLLECT_AFTER)
    for language in sys.argv[2:] or WRITERS:
        for machine in MACHINES:
            measured(machine, language, count)


if __name__ == "__main__":
    main()
