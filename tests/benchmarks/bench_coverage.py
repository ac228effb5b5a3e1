"""Coverage of 2 sigma, rms error against the best linear estimator and stated sigma, by family of machines.

    python tests/benchmarks/bench_coverage.py [SEEDS] [FAMILY ...] [MIXTURE ...]

Simulated machines of 3 x 2 x 1 m (tests/judge/families.py) are measured by lines with 3 to 20 targets, or by
instruments all over the volume and mixtures of them with lines (tests/cases/volumetric.py). Lines are judged
curve by curve, at fresh positions on the line: rms and stated sigma are in units of what the best linear
estimator reaches that knows the covariance of the family. The others are judged at fresh poses with a fresh
tool, beside that estimator from the same readings. It shows what no estimator can know, and how far so few
machines scatter. Without a mixture all are measured, lines too.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from cases import volumetric
from cases.coverage import Scores, lines_of, volume_of
from judge import families

#: Targets a line.
TARGETS = (3, 5, 8, 12, 20)
#: Readings all over the volume.
VOLUMES = ("points", "stations", "pods")


def told(what: str, total: Scores, rms: str, more: str) -> None:
    print(
        f"{what}: {100 * total.coverage:5.1f} % inside 2 sigma, rms {rms}, mean sigma/rms "
        f"{total.mean / total.rms:.2f}; {more}",
        flush=True,
    )


def main(seeds: int, names: Sequence[str], mixtures: Sequence[str]) -> None:
    for family in names:
        for count in () if mixtures else TARGETS:
            begin = time.process_time()
            total = Scores.of([lines_of(family, count, seed) for seed in range(seeds)])
            took = (time.process_time() - begin) / seeds
            told(
                f"{family:7s} {count:8d} targets",
                total,
                f"{total.rms:.2f} of the best",
                f"{took:.1f} s a fit",
            )
        for mixture in mixtures or volumetric.MIXTURES:
            pairs = [volume_of(family, mixture, seed) for seed in range(seeds)]
            total, best = (Scores.of([pair[k] for pair in pairs]) for k in range(2))
            rms = f"{1e3 * total.rms:.2f} um, {total.rms / best.rms:.2f} of the best"
            limit = f"the best covers {100 * best.coverage:.1f} % by {best.mean / best.rms:.2f}"
            told(f"{family:7s} {mixture:>16s}", total, rms, limit)


if __name__ == "__main__":
    words = sys.argv[2:]
    chosen = [word for word in words if word in volumetric.MIXTURES]
    main(
        int(sys.argv[1]) if len(sys.argv) > 1 else 20,
        [word for word in words if word not in chosen] or list(families.FAMILIES), chosen,
    )  # fmt: skip
