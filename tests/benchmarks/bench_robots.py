"""CPU time of correcting and proving programs of 10,000 targets on a six-axis arm with a payload:
`python tests/benchmarks/bench_robots.py [TARGETS] [LANGUAGE ...]`.

Straight moves of some mm in each language of robots, half of the targets declared where it declares them. All
from the bytes of the program to those of the corrected one, read again, with the collector of the command."""

from __future__ import annotations

import gc
import resource
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from judge.arm_files import MACHINE
from workflows.test_robots_on_arms import WRITERS, Step, stated

import olp
from olp.__main__ import _COLLECT_AFTER

MIDDLE = np.array([10.0, 15.0, 35.0, 20.0, 50.0, -30.0])
JOB = """schema = "olp-job-1"
machine = "machine.toml"
payload_kg = 6.5
payload_centre_mm = [15.0, 0.0, 90.0]
"""


def steps(count: int) -> list[Step]:
    """A move of joints, then straight ones, to joints that swing by some degrees."""
    wave, phase = np.arange(1, 4)[:, None], np.random.default_rng(1).uniform(0.0, 6.0, (3, 1, 6))
    angle = 2.0 * np.pi * 20.0 * np.arange(count)[None, :, None] / 10_000
    joints = MIDDLE + 3.0 * np.sum(np.sin(wave[..., None] * angle + phase) / wave[..., None], axis=0)
    return [("L" if k else "J", row) for k, row in enumerate(joints.round(3))]


def measured(language: str, text: bytes, folder: Path) -> None:
    for file in MACHINE.parent.iterdir():
        shutil.copyfile(file, folder / file.name)
    machine, job = stated(folder / "machine.toml", language), folder / "job.toml"
    job.write_text(JOB, "utf-8")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    result = olp.correct_joints(text, machine, job, outside_box="hold")
    seconds = resource.getrusage(resource.RUSAGE_SELF).ru_utime - before
    print(f"{language:8s} {seconds:6.2f} s  proved {result.report['verdict']['ok']}")


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    gc.set_threshold(_COLLECT_AFTER)
    for language in sys.argv[2:] or WRITERS:
        with tempfile.TemporaryDirectory() as place:
            measured(language, WRITERS[language](steps(count)), Path(place))


if __name__ == "__main__":
    main()
