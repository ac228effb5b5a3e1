"""Planted blunders: how many pass in silence, how many are named, and how often clean readings raise alarms.

    python tests/benchmarks/bench_blunders.py [MACHINES] [BLUNDERS]

Machines of five families (tests/judge/families.py) are measured by lines with 9 to 13 targets, and with
points, lengths of stations, directions of pods, or diagonals and circles. Of each, so many blunders are drawn
from all (tests/cases/blunders.py) and planted one at a time.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from cases.blunders import ALARMS, LOUD, MIXTURES, blunders, clean_fit, outcome
from judge import families


def main(machines: int = 20, each: int = 6) -> None:
    begin = time.process_time()
    counts: Counter[str] = Counter()
    rng = np.random.default_rng(5)
    for seed in range(0, 7 * machines, 7):
        family = list(families.FAMILIES)[seed % len(families.FAMILIES)]
        mixture = MIXTURES[seed // len(families.FAMILIES) % len(MIXTURES)]
        taken, clean = clean_fit(seed, family, mixture)
        false = sorted({finding.code for finding in clean.findings} & set(ALARMS))
        counts["clean fits"] += 1
        if false:
            counts["false alarms"] += 1
            print(f"  FALSE {family} with {mixture}, seed {seed}: {', '.join(false)}", flush=True)
        every = blunders(seed, family, mixture)
        for k in rng.choice(len(every), min(each, len(every)), replace=False).tolist():
            one = every[k]
            said = outcome(taken, clean, one)
            loud = said.noncentrality >= LOUD
            counts["loud" if loud else "quiet"] += 1
            counts["quiet, told"] += bool(said.alarms) and not loud
            counts["loud, silent"] += said.silent
            counts["loud, can be named"] += loud and bool(one.words)
            counts["loud, named"] += loud and bool(one.words) and said.named
            if said.silent or (loud and one.words and not said.named):
                print(
                    f"  {'SILENT' if said.silent else 'not named'} {family} with {mixture}, seed {seed}: "
                    f"{one.kind} of {one.planted.source}, {said.noncentrality:.1f}, {' '.join(said.alarms)}",
                    flush=True,
                )
    for name, count in sorted(counts.items()):
        print(f"{name}: {count}")
    print(f"{(time.process_time() - begin) / machines / (each + 1):.1f} s of CPU a fit")


if __name__ == "__main__":
    main(*(int(value) for value in sys.argv[1:3]))
