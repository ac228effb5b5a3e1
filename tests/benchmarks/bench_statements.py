"""CPU time of `olp correct` on one path as G-code, APT, DMIS, a list and Kawasaki AS, in one run.

    python tests/benchmarks/bench_statements.py [points]

Prints user CPU seconds of whole commands (the least of three), the part of each stage in this process, and
their ratio per block to the G-code one. The path is the raster of `programs/generate.py`; each block of it
says a whole point in the others.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from bench_correct import ENVIRONMENT, ROOT, machine, stages, user_seconds

from olp.files.config import load_setup
from olp.program.dialects import DIALECTS, read
from olp.toolpath import Kind


def posted(points: np.ndarray, rapid: np.ndarray, dialect: str) -> bytes:
    """The points as whole statements."""
    if dialect == "list":
        rows = [f"{x:.4f},{y:.4f},{z:.4f},100" for x, y, z in points.tolist()]
        return "\n".join(["X_mm,Y_mm,Z_mm,speed", *rows, ""]).encode()
    if dialect == "kawasaki-as":
        moves = [
            f"{'JMOVE' if fast else 'LMOVE'} TRANS({x:.4f},{y:.4f},{z:.4f},0,180,0)"
            for (x, y, z), fast in zip(points.tolist(), rapid.tolist(), strict=True)
        ]
        return "\n".join([".PROGRAM raster()", *moves, ".END", ""]).encode()
    said = [f"GOTO/{x:.4f},{y:.4f},{z:.4f}" for x, y, z in points.tolist()]
    if dialect == "dmis":
        return "\n".join(["DMISMN/'BENCH',05.2", "UNITS/MM,ANGDEC", *said, "ENDFIL", ""]).encode()
    for k in np.flatnonzero(rapid).tolist():
        said[k] = "RAPID\n" + said[k]
    return "\n".join(["PARTNO BENCH", "UNITS/MM", "LOADTL/1", "FEDRAT/1200,MMPM", *said, "FINI", ""]).encode()


def main() -> None:
    count = sys.argv[1] if len(sys.argv) > 1 else "1e6"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        described = machine(folder)
        described.write_text(described.read_text() + '[work_offsets.MCS]\nset_by = "true"\n')
        ENVIRONMENT["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
        gcode = folder / "raster.ngc"
        generate = [str(ROOT / "programs" / "generate.py"), "raster", count, "-o", str(gcode)]
        subprocess.run([sys.executable, *generate], check=True, capture_output=True)
        path = read(gcode.read_bytes(), load_setup(described), DIALECTS["linuxcnc"], words=False).toolpath
        whole = np.isfinite(path.end_mm).all(axis=1)
        tip = path.end_mm[whole] - np.array([f.length_mm for f in path.frames])[path.frame[whole]]
        rapid = path.kind[whole] == Kind.RAPID
        files = [gcode]
        for dialect, ending in (("apt", "apt"), ("dmis", "dmi"), ("list", "csv"), ("kawasaki-as", "as")):
            files.append(folder / f"raster.{ending}")
            files[-1].write_bytes(posted(tip, rapid, dialect))
        first = 0.0
        for program in files:
            out = folder / f"out{program.suffix}"
            correct = ["correct", str(program), "-m", str(described), "-o", str(out), "--force", "--quiet"]
            correct += ["--dialect", "kawasaki-as"] if program.suffix == ".as" else []
            cpu, peak = user_seconds([sys.executable, "-m", "olp", *correct])
            number = program.read_bytes().count(b"\n")
            each = cpu / number * 1e6
            first = first or each
            share = f"{each:.2f} us a line, {each / first:.2f} x G-code"
            print(f"{program.suffix}: {number} lines, {cpu:.2f} s, {share}, peak {peak / 1024:.0f} MB")
            if program.suffix != ".as":
                stages(program, described)


if __name__ == "__main__":
    main()
