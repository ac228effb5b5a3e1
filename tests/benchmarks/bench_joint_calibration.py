"""Calibrations of machines of any joints beside the information limit, by structure and instrument.

    python tests/benchmarks/bench_joint_calibration.py [SEEDS] [SIZE] [STRUCTURE ...]

Machines of nine structures with other dimensions and errors each time are measured as in
tests/cases/joint_campaigns.py and calibrated as by `olp calibrate fit`, which is told their noise alone. SIZE
is that of their errors beside what is usual. The tip is judged at other postures with a longer tool, in the
best frame. The best estimate knows how large such errors are, and how the readings depend on those there are.
The limit is what it is off by on average. Any other estimate is off by as much, and by what parts the two.
That gives `ratio`, which a few machines tell well, also where their readings leave numbers open.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from cases.joint_campaigns import STRUCTURES, Campaign, Score, instruments_of


def campaign(structure: str, instrument: str, seed: int, size: float) -> Score:
    with tempfile.TemporaryDirectory() as folder:
        return Campaign(Path(folder) / structure, structure, instrument, seed, size).score()


def row(structure: str, instrument: str, seeds: int, size: float) -> str:
    """What is printed of one structure and one instrument."""
    begin = time.process_time()
    scores = [campaign(structure, instrument, seed, size) for seed in range(seeds)]
    off, beside, least, stated = (
        float(np.sqrt(np.mean([value**2 for value in values])))
        for values in zip(*((s.off_um, s.beside_um, s.limit_um, s.stated_um) for s in scores), strict=True)
    )
    covered = 100.0 * sum(s.covered for s in scores) / sum(s.components for s in scores)
    took = (time.process_time() - begin) / seeds
    return (
        f"{structure:13s} {instrument:10s} off {off:7.2f} um, limit {least:7.2f}, "
        f"off/limit {off / least:5.2f}, ratio {np.hypot(least, beside) / least:5.3f}, "
        f"stated/limit {stated / least:5.2f}, inside 2 sigma {covered:5.1f} %; {took:.1f} s"
    )


def main(seeds: int = 10, size: float = 1.0, structures: Sequence[str] = STRUCTURES) -> None:
    for structure in structures:
        for instrument in instruments_of(structure):
            print(row(structure, instrument, seeds, size), flush=True)


if __name__ == "__main__":
    given = sys.argv[1:]
    main(int(given[0]) if given else 10, float(given[1]) if len(given) > 1 else 1.0, given[2:] or STRUCTURES)
