"""What a correction costs in time, on each shipped job.

    python tests/benchmarks/bench_corrected_time.py [program ...]

Prints the re-timed seconds of the nominal and of the corrected program, and by how much the corrected one is
slower in percent. Jobs of machines that re-timing does not take are named with its reason.
"""

from __future__ import annotations

import sys
from pathlib import Path

import olp
from olp.core.errors import OlpError
from olp.files.config import load_job

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"


def row(path: Path) -> str:
    """One line of the table for the job file at `path`."""
    stated = load_job(path)
    assert stated.program and stated.machine
    name = f"{path.parent.name}/{Path(stated.program).name}"
    try:
        nominal = olp.retime(stated.program, stated.machine, path).duration_s
        corrected = olp.correct(stated.program, stated.machine, path).data
        after = olp.retime(corrected, stated.machine, path).duration_s
    except OlpError as error:
        return f"{name:32s} {str(error)[:120]}"
    return f"{name:32s} {nominal:10.3f} {after:10.3f} {100.0 * (after / nominal - 1.0):+8.3f} %"


def main() -> None:
    for path in sorted(PROGRAMS.glob("*/job*.toml")):
        program = load_job(path).program
        if program and (len(sys.argv) < 2 or Path(program).name in sys.argv[1:]):
            print(row(path), flush=True)


if __name__ == "__main__":
    main()
