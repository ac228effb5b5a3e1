"""CPU time of correcting and proving 1e5 poses: `python tests/benchmarks/bench_joints.py [POSES]`.

Five axes on a trunnion with errors of all axes, once with tool centre point control and once in axis words;
and a list of axis values of the arm KR 6 with weights, a twentieth of it near singular postures. All from the
bytes of the program to those of the corrected one, read again."""

from __future__ import annotations

import re
import resource
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from cases.joint_machines import machine_file
from kinematics.cases import GOLDEN, golden, random_values

import olp

ARM = "arm_6r_kr6"


def five_axes(poses: int, tips: bool) -> bytes:
    """A spiral of short moves with a tool that swings."""
    share = np.linspace(0.0, 1.0, poses)
    angle = 60.0 * np.pi * share
    columns = {
        "X": 10.0 + 60.0 * np.cos(angle) * (0.3 + share),
        "Y": -20.0 + 60.0 * np.sin(angle) * (0.3 + share),
        "Z": 30.0 + 10.0 * np.sin(0.78 * angle),
        "A": -25.0 + 10.0 * np.sin(angle / 3.0),
        "C": 40.0 + 60.0 * np.sin(angle / 5.0),
    }
    rows = np.stack(list(columns.values()), axis=1).tolist()
    words = [" ".join(f"{name}{value:.3f}" for name, value in zip(columns, row, strict=True)) for row in rows]
    words[0] = ("G43.4 H1 " if tips else "G0 ") + words[0]
    words[1] = f"G1 {words[1]} F500."
    tail = ["G0 Z150.", "G49", "M30"] if tips else ["G0 Z150.", "M30"]
    return "\n".join(["G21 G90 G54", "G0 X0. Y0. Z0. A0. C0.", *words, *tail, ""]).encode()


def arm(folder: Path, poses: int) -> tuple[Path, bytes]:
    for file in (GOLDEN / ARM).iterdir():
        shutil.copyfile(file, folder / file.name)
    machine = folder / "machine.toml"
    machine.write_text(re.sub(r"(least_increment_\w+) = .*", r"\1 = 0.0001", machine.read_text()))
    case = golden(ARM)[0]
    values, rng = random_values(case, 8, 3), np.random.default_rng(0)
    share, wave = np.linspace(0.0, 1.0, poses)[:, None, None], np.arange(1, 5)[None, :, None]
    phase = rng.uniform(0.0, 6.0, (1, 4, values.shape[1]))
    swing = np.sum(np.sin(6.0 * np.pi * wave * share + phase) / wave, axis=1)
    rows = values.mean(axis=0) + 0.08 * np.ptp(values, axis=0) * swing
    head = ",".join(f"{name}_deg" for name in case.machine.structure.order)
    lines = [",".join(f"{value:.4f}" for value in row) for row in rows.tolist()]
    return machine, "\n".join([head, *lines, ""]).encode()


def measured(name: str, machine: Path, text: bytes, job: Path | None) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    result = olp.correct_joints(text, machine, job, tolerance_urad=2.0, outside_box="hold")
    seconds = resource.getrusage(resource.RUSAGE_SELF).ru_utime - before
    singular = result.report["orientation"]["near_singular"]
    print(f"{name:24s} {seconds:6.2f} s  proved {result.report['verdict']['ok']}  near singular {singular}")


def main() -> None:
    poses = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for name, tips in (("tool centre point", True), ("axis words", False)):
            own = folder / name.replace(" ", "-")
            machine = machine_file(own, "C A Y F X Z", control="fanuc" if tips else "linuxcnc", seed=7)
            measured(name, machine, five_axes(poses, tips), None)
        own = folder / ARM
        own.mkdir()
        machine, text = arm(own, poses)
        job = own / "job.toml"
        measured("arm", machine, text, job if job.exists() else None)


if __name__ == "__main__":
    main()
