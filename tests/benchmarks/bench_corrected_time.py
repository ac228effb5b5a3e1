"""What a correction costs in time, on each shipped job.

    python tests/benchmarks/bench_corrected_time.py [program ...]
    python tests/benchmarks/bench_corrected_time.py --circles [RADIUS,FEED,TOLERANCE ...]

Prints the re-timed seconds of the nominal and of the corrected program, and by how much the corrected one is
slower in percent. Jobs of machines that re-timing does not take are named with its reason.

`--circles` plans circles of mm radius at mm/s feed with um path tolerance, as chords, without and with the
steps of a correction for 5 um of backlash.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from cases.trajectory import route
from trajectory.test_merge import circle
from trajectory.test_plan import LIMITS

import olp
from olp.core.errors import OlpError
from olp.files.config import load_job
from olp.trajectory.plan import plan

#: mm radius, mm/s feed, um path tolerance
CIRCLES = (
    (3, 20, 5), (3, 50, 5), (3, 100, 5), (3, 100, 10), (6, 100, 5), (6, 200, 10), (12, 100, 5), (12, 200, 5),
    (12, 200, 10), (12, 200, 20), (12, 200, 50), (25, 200, 5), (50, 100, 5), (50, 200, 5), (50, 200, 50),
)  # fmt: skip
BACKLASH_MM = 0.005

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


def of_circle(radius_mm: float, feed: float, tolerance_um: float) -> str:
    """One line of the table for a circle."""
    nominal, corrected = (
        plan(route(circle(step, radius_mm), feed, tolerance_um * 1e-3), LIMITS) for step in (0.0, BACKLASH_MM)
    )
    share = 100.0 * (corrected.duration_s / nominal.duration_s - 1.0)
    name = f"r {radius_mm:g} mm, {feed:g} mm/s, {tolerance_um:g} um"
    solver = corrected.legs[0].solver
    return f"{name:32s} {nominal.duration_s:10.4f} {corrected.duration_s:10.4f} {share:+8.3f} %  {solver}"


def main() -> None:
    if sys.argv[1:2] == ["--circles"]:
        asked = [tuple(map(float, some.split(","))) for some in sys.argv[2:]]
        for radius_mm, feed, tolerance_um in asked or CIRCLES:
            print(of_circle(radius_mm, feed, tolerance_um), flush=True)
        return
    for path in sorted(PROGRAMS.glob("*/job*.toml")):
        program = load_job(path).program
        if program and (len(sys.argv) < 2 or Path(program).name in sys.argv[1:]):
            print(row(path), flush=True)


if __name__ == "__main__":
    main()
