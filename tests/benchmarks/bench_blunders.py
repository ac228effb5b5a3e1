"""Planted blunders: how many pass in silence, how many are named, and how often clean readings raise alarms.

    python tests/benchmarks/bench_blunders.py [MACHINES] [BLUNDERS] [FIRST]

Machines of five families (tests/judge/families.py) are measured by lines with 9 to 13 targets, and with
points, lengths of stations, directions of pods, or diagonals and circles. Their seeds follow FIRST. The sizes
of all blunders of each (tests/cases/blunders.py) are computed, and so many are planted one at a time. Half
of them are drawn from those that are just loud: larger ones hardly pass in silence. With 0 blunders only
clean readings are fitted.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from cases.blunders import (
    ALARMS,
    LOUD,
    MIXTURES,
    Blunder,
    Outcome,
    Size,
    blunders,
    clean_fit,
    outcome,
    size_of,
)
from judge import families

#: Non-centrality up to which a blunder is just loud.
NEAR = 20.0
#: Redundancy below which the report has to say beforehand what may stay hidden.
CHECKED = 0.1

_GROUPS = ((0.0, LOUD), (LOUD, NEAR), (NEAR, np.inf))


def main(machines: int = 20, each: int = 6, first: int = 0) -> None:
    begin = time.process_time()
    counts: Counter[str] = Counter()
    odds: list[float] = []
    rng = np.random.default_rng(5)
    for seed in range(first, first + machines):
        family = list(families.FAMILIES)[seed % len(families.FAMILIES)]
        mixture = MIXTURES[seed // len(families.FAMILIES) % len(MIXTURES)]
        where = f"{family} with {mixture}, seed {seed}"
        taken, clean = clean_fit(seed, family, mixture)
        false = sorted({finding.code for finding in clean.findings} & set(ALARMS))
        counts["clean fits"] += 1
        rows = clean.report["agreement"]
        odds.append(max((row["log10_odds_of_a_mistake"] or -99.0) for row in rows))
        if false:
            counts["clean fits with false alarms"] += 1
            print(f"  FALSE {where}: {', '.join(false)}", flush=True)
        every = blunders(seed, family, mixture) if each else []
        sizes = [size_of(taken, clean.fit, one) for one in every]
        count = [int(np.sum([low <= one.noncentrality < high for one in sizes])) for low, high in _GROUPS]
        print(f"  {where}: odds 10^{odds[-1]:.1f}; blunders quiet, just loud, louder: {count}", flush=True)
        for k in _drawn(rng, sizes, each):
            said = outcome(taken, clean, every[k])
            for what in _counted(every[k], said):
                counts[what] += 1
            words = _words(every[k], said)
            if words:
                print(f"  {words} {where}: {_figures(every[k], said)}", flush=True)
    for name, count in sorted(counts.items()):
        print(f"{name}: {count}")
    print("largest odds of a mistake in clean fits, 10^: " + ", ".join(f"{x:.1f}" for x in sorted(odds)[-5:]))
    print(f"{(time.process_time() - begin) / machines / (each + 1):.1f} s of CPU a fit")


def _drawn(rng: np.random.Generator, sizes: Sequence[Size], each: int) -> Iterator[int]:
    """Half of them just loud, the rest from all others."""
    near = np.array([LOUD <= one.noncentrality < NEAR for one in sizes], bool)
    for of, count in ((np.flatnonzero(near), each // 2), (np.flatnonzero(~near), each - each // 2)):
        yield from rng.choice(of, min(count, len(of)), replace=False).tolist()


def _counted(one: Blunder, said: Outcome) -> Iterator[str]:
    """What a blunder counts for."""
    checked = "" if said.redundancy >= CHECKED else ", hardly checked"
    loud = "loud" if said.loud else "quiet"
    yield f"{loud}{checked}"
    if not said.alarms:
        yield f"{loud}{checked}, silent"
        yield f"silent, harm {'told' if said.told else 'not told'} beforehand"
        if said.silent and not (said.told and said.redundancy < CHECKED):
            yield "against the bar: loud, silent, and checked or not told"
    if said.loud and one.words:
        yield "loud, can be named"
        if said.named:
            yield "loud, can be named: named"


def _words(one: Blunder, said: Outcome) -> str:
    if said.silent:
        return "SILENT, TOLD" if said.told and said.redundancy < CHECKED else "SILENT, AGAINST THE BAR"
    if not said.alarms:
        return "" if said.told else "not told"
    return "not named" if said.loud and one.words and not said.named else ""


def _figures(one: Blunder, said: Outcome) -> str:
    return (
        f"{one.kind} of {one.planted.source}, {said.noncentrality:.1f}, redundancy {said.redundancy:.2g}, "
        f"harm {said.harm_um:.3g} um, stated {said.stated_um:.3g} um {' '.join(said.alarms)}"
    )


if __name__ == "__main__":
    main(*(int(value) for value in sys.argv[1:4]))
