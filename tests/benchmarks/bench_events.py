"""CPU time and memory of `olp correct` on programs of one kind of line, compared with LinuxCNC.

    python tests/benchmarks/bench_events.py [--lines 12000] [kind ...]

A row for each kind of `cases.event_lines`: user CPU seconds of the whole command (the least of three), that
of `rs274 -g` on the same file in the same minute, their ratio, and the peak memory. Kinds are all by default;
`long` has 1e5 lines at 12,000 of the others.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench_correct import ENVIRONMENT, machine, user_seconds
from cases.event_lines import KINDS, program

#: as many more lines of a kind
MORE = {"long": 25 / 3, "deleted": 4 / 3}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("kinds", nargs="*", default=list(KINDS), metavar="kind")
    parser.add_argument("--lines", type=float, default=12_000, help="of most kinds")
    parser.add_argument("--times", type=int, default=3)
    options = parser.parse_args()
    print("| kind | lines | olp correct s | rs274 s | ratio | us a line | peak MB |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        described = machine(folder)
        described.write_text(described.read_text() + '[work_offsets.G55]\nset_by = "true"\nX_mm = 2.0\n')
        ENVIRONMENT["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
        (folder / "tool.tbl").write_text("T1 P1 Z60\nT2 P2 Z60\n")
        for kind in options.kinds:
            lines = round(options.lines * MORE.get(kind, 1.0))
            text = folder / "part.ngc"
            text.write_text(program(kind, lines))
            out = str(folder / "out.ngc")
            call = ["correct", str(text), "-m", str(described), "-o", out, "--force", "--quiet"]
            cpu, peak = user_seconds([sys.executable, "-m", "olp", *call], options.times)
            listing = float("nan")
            if shutil.which("rs274"):
                rs274 = ["rs274", "-g", "-t", str(folder / "tool.tbl"), str(text), str(folder / "canon.txt")]
                listing, _ = user_seconds(rs274, options.times)
            print(
                f"| {kind} | {lines} | {cpu:.2f} | {listing:.3f} | {cpu / listing:.1f} x "
                f"| {cpu / lines * 1e6:.0f} | {peak / 1024:.0f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
