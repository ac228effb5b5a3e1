"""CPU time of `olp correct` on holes of canned cycles and on arcs, compared with LinuxCNC listing the file.

    python tests/benchmarks/bench_cycles.py [holes [arcs]]

Prints user CPU seconds of whole commands (the least of three), their ratio to LinuxCNC's rs274, and what one
hole or arc costs beyond a program of a few lines.
"""

from __future__ import annotations

import argparse
import math
import random
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from bench_correct import ENVIRONMENT, machine, user_seconds

START = "G21 G17 G90 G94 G40 G49 G80\nG54\nT1 M6\nG43 H1\nS1200 M3\nG0 X0.000 Y0.000 Z50.000\nF300\n"
END = "G80\nG0 Z50.000\nM5\nM30\n"
CYCLES = ("G81 Z-8. R2.", "G83 Z-12. R2. Q3.", "G73 Z-9. R2. Q4.", "G82 Z-5. R1. P0.5")


def holes(count: int, seed: int = 1) -> str:
    """Series of 20 to 200 holes, mostly with X and Y."""
    draw = random.Random(seed)
    lines: list[str] = []
    while len(lines) < count:
        lines.append(f"G80\nG0 Z50.\n{draw.choice(('G98', 'G99'))} {draw.choice(CYCLES)} X10. Y10.")
        for _ in range(draw.randint(20, 200)):
            x, y = f"X{draw.uniform(0, 1000):.3f}", f"Y{draw.uniform(0, 600):.3f}"
            lines.append(draw.choice((f"{x} {y}", f"{x} {y}", f"{x} {y}", x, y)))
    return START + "\n".join(lines) + "\n" + END


def arcs(count: int, seed: int = 2) -> str:
    """Arcs and helices of 2 to 40 mm, ten on each circle."""
    draw = random.Random(seed)
    lines = ["G1 Z0."]
    while len(lines) < count:
        middle = complex(draw.uniform(100, 900), draw.uniform(100, 500))
        radius, angle = draw.uniform(2, 40), draw.uniform(0, 6.28)
        here = rounded(middle, radius, angle)
        lines.append(f"G1 X{here.real:.3f} Y{here.imag:.3f}")
        for _ in range(10):
            angle += draw.uniform(0.3, 2.5)
            there, arm = rounded(middle, radius, angle), middle - here
            z = f" Z{draw.uniform(-10, 0):.3f}" if draw.random() < 0.2 else ""
            lines.append(f"G3 X{there.real:.3f} Y{there.imag:.3f}{z} I{arm.real:.4f} J{arm.imag:.4f}")
            here = there
    return START + "\n".join(lines) + "\n" + END


def rounded(middle: complex, radius: float, angle: float) -> complex:
    """A point of a circle as a program states it."""
    point = middle + radius * complex(math.cos(angle), math.sin(angle))
    return complex(round(point.real, 3), round(point.imag, 3))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("holes", nargs="?", type=float, default=2e4)
    parser.add_argument("arcs", nargs="?", type=float, default=1e5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        described = machine(folder)
        ENVIRONMENT["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
        (folder / "tool.tbl").write_text("T1 P1 Z60\nT2 P2 Z60\n")
        texts = {
            "lines": (10, START + "G1 X1\n" + END),
            "holes": (int(options.holes), holes(int(options.holes))),
            "arcs": (int(options.arcs), arcs(int(options.arcs))),
        }
        start_up = 0.0
        for kind, (count, text) in texts.items():
            program = folder / f"{kind}.ngc"
            program.write_text(text)
            correct = ["correct", str(program), "-m", str(described), "-o", str(folder / "out.ngc")]
            command = [sys.executable, "-m", "olp", *correct, "--force", "--quiet"]
            subprocess.run(command, check=False, capture_output=True)
            cpu, peak = user_seconds(command)
            start_up = start_up or cpu
            each = f", {(cpu - start_up) / count * 1e6:.1f} us each" if cpu > start_up else ""
            print(f"{count} {kind}: olp correct {cpu:.2f} s user CPU{each}, peak {peak / 1024:.0f} MB")
            if shutil.which("rs274"):
                listing, _ = user_seconds(
                    ["rs274", "-g", "-t", str(folder / "tool.tbl"), str(program), str(folder / "canon.txt")]
                )
                print(f"  {cpu / listing:.1f} x rs274 -g listing it ({listing:.2f} s)")


if __name__ == "__main__":
    main()
