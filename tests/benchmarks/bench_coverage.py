"""Coverage of 2 sigma, rms error against the best linear estimator and stated sigma, by family of machines.

    python tests/benchmarks/bench_coverage.py [SEEDS] [FIRST] [FAMILY ...] [lines] [MIXTURE ...]

Simulated machines of 3 x 2 x 1 m (tests/judge/families.py) are measured by lines with 3 to 20 targets, or by
instruments all over the volume and mixtures of them with lines (tests/cases/volumetric.py). Lines are judged
curve by curve, at fresh positions on the line: rms and stated sigma are in units of what the best linear
estimator reaches that knows the covariance of the family. The others are judged at fresh poses with a fresh
tool, beside that estimator from the same readings. It shows what no estimator can know, and how far so few
machines scatter. Nothing is wrong with the readings, so every alarm is a false one. Without lines or
a mixture all are measured. Seeds begin with FIRST.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from cases import volumetric
from cases.coverage import Judged, Scores, lines_of, volume_of
from judge import families

#: Lines alone, curve by curve.
LINES = "lines"
#: Targets a line.
TARGETS = (3, 5, 8, 12, 20)


def told(what: str, total: Scores, rms: str, more: str) -> None:
    print(
        f"{what}: {100 * total.coverage:5.1f} % inside 2 sigma, rms {rms}, mean sigma/rms "
        f"{total.mean / total.rms:.2f}; {more}",
        flush=True,
    )


def judged(what: str, machines: Sequence[Judged]) -> None:
    """What machines say together: those of a family, or all, each in units of what is best in its family."""
    own, best = (Scores.of([getattr(one, name) for one in machines]) for name in ("own", "best"))
    alarms = Counter(alarm for one in machines for alarm in one.alarms)
    told(
        what, own, f"{own.rms / best.rms:.2f} of the best",
        f"the best covers {100 * best.coverage:.1f} % by {best.mean / best.rms:.2f}; mean square of errors "
        f"over sigma {own.square:.2f}, {best.square:.2f}; {len(machines)} machines, "
        f"false alarms {dict(alarms)}",
    )  # fmt: skip


def main(seeds: range, names: Sequence[str], mixtures: Sequence[str]) -> None:
    for family in names if LINES in mixtures else ():
        for count in TARGETS:
            begin = time.process_time()
            total = Scores.of([lines_of(family, count, seed) for seed in seeds])
            took = (time.process_time() - begin) / len(seeds)
            rms = f"{total.rms:.2f} of the best"
            told(f"{family:9s} {count:8d} targets", total, rms, f"{took:.1f} s a fit")
    for mixture in [one for one in mixtures if one != LINES]:
        every: list[Judged] = []
        for family in names:
            machines = [volume_of(family, mixture, seed) for seed in seeds]
            judged(f"{family:9s} {mixture:>16s}", machines)
            size = Scores.of([one.best for one in machines]).rms
            every += [one.in_units(size) for one in machines]
        judged(f"{'all':9s} {mixture:>16s}", every)


if __name__ == "__main__":
    words = sys.argv[1:]
    numbers = [int(word) for word in words if word.isdigit()]
    seeds, first = (*numbers, *(20, 0)[len(numbers) :])
    every = [LINES, *volumetric.MIXTURES]
    main(
        range(first, first + seeds),
        [word for word in words if word in families.DRAWS] or list(families.FAMILIES),
        [word for word in words if word in every] or every,
    )
