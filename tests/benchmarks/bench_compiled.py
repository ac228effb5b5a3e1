"""What a compiled extension for tokens, digits and splice could save at most of `olp correct`.

    python tests/benchmarks/bench_compiled.py [lines]

Prints the share of the CPU time of a correction, of a raster program from `programs/generate.py`, that goes
into reading tokens, choosing digits, and splicing the text. An extension that took no time would save that.
"""

from __future__ import annotations

import cProfile
import pstats
import subprocess
import sys
import tempfile
from pathlib import Path

from bench_correct import ROOT, machine

import olp

#: File and function of each part, as a profile names them.
PARTS = {
    "tokens": ("rs274/lexer.py", ("lex",)),
    "digits": ("compensation/digits.py", ("of", "follow", "incremental")),
    "splice": ("text/edits.py", ("splice", "join")),
}


def main() -> None:
    lines = str(int(float(sys.argv[1]))) if len(sys.argv) > 1 else "1000000"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = folder / "raster.nc"
        generate = [
            sys.executable,
            str(ROOT / "programs" / "generate.py"),
            "raster",
            lines,
            "-o",
            str(program),
        ]
        subprocess.run(generate, check=True, stdout=subprocess.DEVNULL)
        profile = cProfile.Profile()
        profile.runcall(olp.correct, program, machine(folder))
    stats = pstats.Stats(profile)
    total = stats.total_tt  # type: ignore[attr-defined]
    rows = stats.stats.items()  # type: ignore[attr-defined]
    whole = 0.0
    for part, (file, functions) in PARTS.items():
        own = sum(
            row[3] for (path, _, function), row in rows if path.endswith(file) and function in functions
        )
        whole += own
        print(f"{part}: {own:.2f} s of {total:.2f} s, {own / total:.0%}")
    print(f"together: {whole / total:.0%}")


if __name__ == "__main__":
    main()
