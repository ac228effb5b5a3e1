"""User CPU and memory of reports, of results of a measuring machine, and of uncertainty.

    python tests/benchmarks/bench_reports.py [LINES [POINTS]]

Whole commands, each beside the one without what is measured, in one run (the least of two). Inputs are made
from seeds.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from bench_correct import BOX, ENVIRONMENT, ROOT, machine, user_seconds

_TOUCHES = {"X": (0.0, 1200.0), "Y": (0.0, 900.0), "Z": (-50.0, 50.0)}


def with_sigmas(described: Path, folder: Path) -> Path:
    """The same machine with standard uncertainties of 0.5 um, 0.6 urad and 1 urad of squareness."""
    folder.mkdir()
    for axis in BOX:
        name = f"{axis.lower()}.csv"
        head, *rows = (described.parent / name).read_text().splitlines()
        columns = [f"sigma_{column}" for column in head.split(",")[1:]]
        lines = [",".join([head, *columns]), *(f"{row},0.5,0.5,0.5,0.6,0.6,0.6" for row in rows)]
        (folder / name).write_text("\n".join(lines) + "\n")
    calibration = (described.parent / "calibration.toml").read_text()
    sigmas = "".join(f"sigma_{name}_urad = 1.0\n" for name in ("C0Y", "B0Z", "A0Z"))
    (folder / "calibration.toml").write_text(calibration + sigmas)
    target = folder / "machine.toml"
    target.write_text(described.read_text())
    return target


def without_limits(described: Path, folder: Path) -> Path:
    """The same machine without limits of motion, so that its pages have no motion."""
    shutil.copytree(
        described.parent, folder, ignore=shutil.ignore_patterns("*.ngc", "*.html", "unsure", "bytecode")
    )
    target = folder / "machine.toml"
    limits = ("velocity_mm_s", "acceleration_mm_s2", "jerk_mm_s3")
    lines = described.read_text().splitlines()
    target.write_text("\n".join(line for line in lines if not line.startswith(limits)) + "\n")
    return target


def touches(folder: Path, count: int) -> tuple[Path, Path]:
    """Points with directions that a measuring machine reported, as a table and as DMIS output."""
    rng = np.random.default_rng(7)
    low, high = np.array(list(_TOUCHES.values())).T
    normal = rng.normal(size=(count, 3))
    rows = np.column_stack((rng.uniform(low, high, (count, 3)), normal))
    rows[:, 3:] /= np.linalg.norm(normal, axis=1)[:, None]
    table, dmis = folder / "points.csv", folder / "points.dmi"
    with table.open("w") as file:
        file.write("# frame=machine\nX_mm,Y_mm,Z_mm,I,J,K\n")
        np.savetxt(file, rows, "%.4f,%.4f,%.4f,%.6f,%.6f,%.6f")
    with dmis.open("w") as file:
        file.write("UNITS/MM,ANGDEC\n")
        numbered = np.column_stack((np.arange(count), rows))
        np.savetxt(file, numbered, "FA(P%d)=FEAT/POINT,CART,%.4f,%.4f,%.4f,%.6f,%.6f,%.6f")
    return table, dmis


def measured(what: str, words: list[str | Path], base: float | None = None) -> float:
    """Print the figures of a command, and return its user CPU."""
    cpu, peak = user_seconds([sys.executable, "-m", "olp", *map(str, words), "--force", "--quiet"], 2)
    ratio = "" if base is None else f", {cpu / base:.2f} x without"
    print(f"{what}: {cpu:.2f} s user CPU, peak {peak / 1024:.0f} MB{ratio}", flush=True)
    return cpu


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("lines", nargs="?", default="1e5")
    parser.add_argument("points", nargs="?", default="1e6")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ENVIRONMENT["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
        described = machine(folder)
        unsure = with_sigmas(described, folder / "unsure")
        program, out = folder / "raster.ngc", folder / "out.ngc"
        generate = [str(ROOT / "programs" / "generate.py"), "raster", options.lines, "-o", str(program)]
        subprocess.run([sys.executable, *generate], check=True, capture_output=True)
        correct: list[str | Path] = ["correct", program, "-o", out, "-m"]
        plain = measured(f"{options.lines} lines", [*correct, described])
        measured("  with an HTML report", [*correct, described, "--report", folder / "r.html"], plain)
        measured("  with --review", [*correct, described, "--review", folder / "v.html"], plain)
        still = without_limits(described, folder / "still")
        measured("  with --review, no motion", [*correct, still, "--review", folder / "v.html"], plain)
        measured("  with sigma columns", [*correct, unsure], plain)
        measured("  and a part tolerance", [*correct, unsure, "--part-tolerance-um", "10"], plain)
        table, dmis = touches(folder, int(float(options.points)))
        shared = ["-m", described, "--tip-radius-mm", "1", "--frame", "machine", "--tool", "1"]
        measured(f"{options.points} results, table", ["results", table, "-o", folder / "o.csv", *shared])
        measured(f"{options.points} results, DMIS", ["results", dmis, "-o", folder / "o.dmi", *shared])


if __name__ == "__main__":
    main()
