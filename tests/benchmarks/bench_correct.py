"""CPU time and memory of `olp correct`, compared with LinuxCNC listing the same file, in one run.

    python tests/benchmarks/bench_correct.py [lines [python]]

Prints user CPU seconds of whole commands (the least of three), their ratio, and the peak memory. First come a
program of ten lines and one of 1e4 lines as multiples of `python -c "import numpy"`, taken in turn. Peers are
timed where that python has them (pip install gcode-lib pygcode). Needs LinuxCNC's rs274 for the ratio.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np

import olp

ROOT = Path(__file__).resolve().parents[2]
_PAIRS = 9
TEN_LINES = """G21 G90 G17 G54
T1 M6
G43 H1
S12000 M3
G0 X10 Y10 Z5
G1 Z-1 F600
G1 X100 Y20
G2 X120 Y40 I0 J20
G0 Z5
M30
"""
BOX = {"X": (-10.0, 1250.0), "Y": (-10.0, 1000.0), "Z": (-60.0, 130.0)}


def machine(folder: Path) -> Path:
    """A machine with all 21 errors, 50 to 100 um in its box."""
    rng = np.random.default_rng(3)
    for axis, (low, high) in BOX.items():
        position = np.linspace(low, high, 33)
        u = (position - low) / (high - low)
        columns = [position]
        for k in range(6):
            waves = sum(rng.normal() / (n + 1) ** 1.5 * np.sin(np.pi * (n + 1) * u + n) for n in range(4))
            columns.append((25.0 if k < 3 else 30.0) * waves)
        header = [f"{axis}_mm", *(f"E{d}{axis}_um" for d in "XYZ"), *(f"E{d}{axis}_urad" for d in "ABC")]
        rows = np.column_stack(columns)
        lines = [",".join(header), *(",".join(f"{v:.6f}" for v in row) for row in rows)]
        (folder / f"{axis.lower()}.csv").write_text("\n".join(lines) + "\n")
    box = ", ".join(f"[{low}, {high}]" for low, high in BOX.values())
    curves = "".join(f'[[curves]]\nfile = "{a}.csv"\n' for a in "xyz")
    (folder / "calibration.toml").write_text(
        'schema = "olp-calibration-1"\nmachine = "bench"\nmeasured = 2026-11-01\nvalid_until = 2099-01-01\n'
        'temperature_degC = 20.0\nsign = "actual-minus-commanded"\nmodel = "rigid-body"\n'
        f"datum_mm = [0.0, 0.0, 0.0]\nbox_mm = [{box}]\n{curves}"
        "[squareness]\nC0Y_urad = 20.0\nB0Z_urad = -15.0\nA0Z_urad = 12.0\n"
    )
    axes = "".join(
        f"[axes.{a}]\ntravel_mm = [-2000.0, 2000.0]\nleast_increment_mm = 0.0001\nvelocity_mm_s = 500.0\n"
        "acceleration_mm_s2 = 2000.0\njerk_mm_s3 = 20000.0\n"
        for a in BOX
    )
    path = folder / "machine.toml"
    path.write_text(
        'schema = "olp-machine-1"\nname = "bench"\nchain = "FXYZ"\ncontroller = "linuxcnc"\n'
        f'calibration = "calibration.toml"\n{axes}[work_offsets.G54]\nset_by = "true"\n'
        "[tools.1]\nZ_mm = 60.0\n[tools.2]\nZ_mm = 60.0\n[job_defaults]\ntool = 1\n"
    )
    return path


# As of an installed package, whose bytecode is there.
ENVIRONMENT = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}


def user_seconds(command: list[str], times: int = 3) -> tuple[float, int]:
    """The least user CPU of a command, and its peak memory in kB."""
    best, peak = float("inf"), 0
    for _ in range(times):
        with Path(os.devnull).open("w") as sink:
            process = subprocess.Popen(command, stdout=sink, stderr=sink, env=ENVIRONMENT)
            _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode not in (0, 1):
            raise SystemExit(f"{command[0]} ended with {process.returncode}")
        best, peak = min(best, usage.ru_utime), max(peak, usage.ru_maxrss)
    return best, peak


def start_up(folder: Path, described: Path) -> None:
    """User CPU of short runs as multiples of that of `import numpy`: the median of pairs."""
    ten, many = folder / "ten.ngc", folder / "raster_1e4.ngc"
    ten.write_text(TEN_LINES)
    generate = [str(ROOT / "programs" / "generate.py"), "raster", "1e4", "-o", str(many)]
    subprocess.run([sys.executable, *generate], check=True, capture_output=True)
    output = ["-m", str(described), "-o", str(folder / "out.ngc"), "--force", "--quiet"]
    runs = {
        "olp --help": ["--help"],
        "10 lines": ["correct", str(ten), *output],
        "1e4 lines": ["correct", str(many), *output],
    }
    for name, words in runs.items():
        command = [sys.executable, "-m", "olp", *words]
        user_seconds(command, 1)
        pairs = [
            (user_seconds(command, 1)[0], user_seconds([sys.executable, "-c", "import numpy"], 1)[0])
            for _ in range(_PAIRS)
        ]
        ratio = statistics.median(own / numpy_own for own, numpy_own in pairs)
        least = min(own for own, _ in pairs)
        print(f"{name}: {least:.3f} s user CPU, {ratio:.2f} x `python -c 'import numpy'`")


def stages(program: Path, described: Path) -> None:
    """CPU of the parts of one run, in this process."""
    marks: list[tuple[str, float]] = []

    def tell(what: str, share: float) -> None:
        marks.append((what, resource.getrusage(resource.RUSAGE_SELF).ru_utime))

    start = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    olp.correct(program, described, progress=tell)
    tell("end", 1.0)
    parts: dict[str, float] = {}
    for (name, since), (_, until) in pairwise(marks):
        parts[name] = parts.get(name, 0.0) + until - since
    print(
        f"  load {marks[0][1] - start:.2f}", *(f"{k} {v:.2f}" for k, v in parts.items()), sep=", ", end=" s\n"
    )


def peers(program: Path, number: int, python: str) -> None:
    """Other readers of G-code on the same file, where they are installed: only reading."""
    code = {
        "pygcode": "from pygcode import Line\nfor line in open(F): str(Line(line))",
        "gcode_lib": "import gcode_lib\ngcode_lib.load(F)",
    }
    for name, text in code.items():
        if subprocess.run([python, "-c", f"import {name}"], capture_output=True, check=False).returncode:
            print(f"  {name}: not installed")
            continue
        cpu, _ = user_seconds([python, "-c", f"F={str(program)!r}\n{text}"], 1)
        print(f"  {name}: {cpu:.1f} s to read it, {cpu / number * 1e6:.1f} us per line")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("lines", nargs="?", default="1e6")
    parser.add_argument("peers_python", nargs="?", default=sys.executable)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        described = machine(folder)
        ENVIRONMENT["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
        start_up(folder, described)
        for count in ("1e4", options.lines):
            program = folder / f"raster_{count}.ngc"
            generate = [str(ROOT / "programs" / "generate.py"), "raster", count, "-o", str(program)]
            subprocess.run([sys.executable, *generate], check=True, capture_output=True)
            target = folder / "out.ngc"
            correct = ["correct", str(program), "-m", str(described), "-o", str(target), "--force", "--quiet"]
            cpu, peak = user_seconds([sys.executable, "-m", "olp", *correct])
            number = program.read_bytes().count(b"\n")
            memory = f"peak {peak / 1024:.0f} MB, {peak * 1024 / number:.0f} B/line"
            print(f"{number} lines: olp correct {cpu:.2f} s user CPU, {memory}")
            if shutil.which("rs274"):
                table = folder / "tool.tbl"
                table.write_text("T1 P1 Z60\nT2 P2 Z60\n")
                rs274 = ["rs274", "-g", "-t", str(table), str(program), str(folder / "canon.txt")]
                listing, _ = user_seconds(rs274)
                print(f"  {cpu / listing:.2f} x rs274 -g listing it ({listing:.2f} s)")
            stages(program, described)
        peers(program, number, options.peers_python)


if __name__ == "__main__":
    main()
