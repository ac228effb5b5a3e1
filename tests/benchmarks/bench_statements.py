"""CPU time of `olp correct` on one path as G-code and in six other languages, in one run.

    python tests/benchmarks/bench_statements.py [points]

Prints user CPU seconds of whole commands (the least of three), the part of each stage in this process, and
their ratio per line to the G-code one. The path is the raster of `programs/generate.py`; in the others,
each block states a whole point. Then the same, in this process, for arcs and lines in turn, as G-code and as
five CAM systems write them.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench_correct import ENVIRONMENT, ROOT, machine, stages, user_seconds
from cases.posts import FLAVOURS, Step, apt, gcode

import olp
from olp.core.toolpath import Kind
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read


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
    if dialect in ("heidenhain", "sinumerik"):
        sign, name = ("+", "L ") if dialect == "heidenhain" else ("", "")
        form = f"{name}X{{:{sign}.4f}} Y{{:{sign}.4f}} Z{{:{sign}.4f}}"
        form = form if name else form.replace("X", "X=").replace("Y", "Y=").replace("Z", "Z=")
        moves = [form.format(*point) for point in points.tolist()]
        changed = np.flatnonzero(np.diff(rapid.astype(int), prepend=2)).tolist()
        for k in np.flatnonzero(rapid).tolist() if name else ():
            moves[k] += " R0 FMAX"
        for k in changed if not name else ():
            moves[k] = f"G{int(not rapid[k])} {moves[k]}"
        heads = {
            "L ": ["BEGIN PGM R MM", "TOOL CALL 1 Z S1", "F1200"],
            "": ["%_N_R_MPF", "G71 G90 T1 M6", "F1200"],
        }
        return "\n".join([*heads[name], *moves, "END PGM R MM" if name else "M30", ""]).encode()
    goto = [f"GOTO/{x:.4f},{y:.4f},{z:.4f}" for x, y, z in points.tolist()]
    if dialect == "dmis":
        return "\n".join(["DMISMN/'BENCH',05.2", "UNITS/MM,ANGDEC", *goto, "ENDFIL", ""]).encode()
    for k in np.flatnonzero(rapid).tolist():
        goto[k] = "RAPID\n" + goto[k]
    return "\n".join(["PARTNO BENCH", "UNITS/MM", "LOADTL/1", "FEDRAT/1200,MMPM", *goto, "FINI", ""]).encode()


def turns(count: int) -> list[Step]:
    """Arcs of 5 mm and short lines in turn."""
    rng = np.random.default_rng(0)
    here = np.array([100.0, 100.0, 0.0])
    steps = [Step("rapid", here)]
    for k in range(count):
        if k % 2:
            here = np.clip(np.round(here + rng.uniform(-5, 5, 3) * (1, 1, 0.01), 4), 50, 800) * (1, 1, 0)
            steps.append(Step("line", here))
            continue
        begin, sweep = rng.uniform(0, 6.28), float(rng.uniform(0.3, 3) * rng.choice([-1, 1]))
        centre = np.round(here - 5 * np.array([np.cos(begin), np.sin(begin), 0]), 4)
        arm = here - centre
        angle, radius = np.arctan2(arm[1], arm[0]) + sweep, np.hypot(arm[0], arm[1])
        here = np.round(centre + radius * np.array([np.cos(angle), np.sin(angle), 0]), 4)
        steps.append(Step("arc", here, centre, sweep))
    return steps


def arcs(described: Path, count: int) -> None:
    """The same for arcs, in this process."""
    steps = turns(count)
    first = 0.0
    for name, data in (("G-code", gcode(steps)), *((f, apt(steps, f)) for f in FLAVOURS)):
        begin = resource.getrusage(resource.RUSAGE_SELF).ru_utime
        olp.correct(data, described)
        cpu = resource.getrusage(resource.RUSAGE_SELF).ru_utime - begin
        number = sum(not line.startswith((b" ", b"0", b"-", b"$$")) for line in data.splitlines())
        each = cpu / number * 1e6
        first = first or each
        print(f"{name}: {number} statements, {each:.1f} us each, {each / first:.2f} x G-code")


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
        for dialect, ending in (("apt", "apt"), ("dmis", "dmi"), ("list", "csv"), ("kawasaki-as", "as"),
                                ("heidenhain", "h"), ("sinumerik", "mpf")):  # fmt: skip
            files.append(folder / f"raster.{ending}")
            files[-1].write_bytes(posted(tip, rapid, dialect))
        first = 0.0
        for program in files:
            target = folder / f"out{program.suffix}"
            correct = ["correct", str(program), "-m", str(described), "-o", str(target), "--force", "--quiet"]
            correct += ["--dialect", "kawasaki-as"] if program.suffix == ".as" else []
            cpu, peak = user_seconds([sys.executable, "-m", "olp", *correct])
            number = program.read_bytes().count(b"\n")
            each = cpu / number * 1e6
            first = first or each
            share = f"{each:.2f} us per line, {each / first:.2f} x G-code"
            print(f"{program.suffix}: {number} lines, {cpu:.2f} s, {share}, peak {peak / 1024:.0f} MB")
            if program.suffix != ".as":
                stages(program, described)
        arcs(described, 20_000)


if __name__ == "__main__":
    main()
