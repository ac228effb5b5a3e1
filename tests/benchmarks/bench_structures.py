"""Random machines of every structure with errors of all sources, and random programs: corrected, and judged
by a computation of its own.

    python tests/benchmarks/bench_structures.py [MACHINES] [--kind KIND] [--form FORM] [--seed FIRST]
        [--play] [--singular]

By structure: programs that are right, refused ones, and the largest residual in tolerances of 1 um and 2 urad
plus the last digit, at and between waypoints. With --play every axis has backlash; then a program whose
report says that it does not hold is counted as said. With --singular programs pass near singular postures and
borders of reach: what the report states as left there is counted as said, too.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from cases.any_judged import LIST, forms_of, judged
from cases.any_machines import KINDS
from cases.any_programs import FORMS, PLANES

MACHINES = 10


def campaign(
    kinds: list[str], forms: list[str], seeds: range, *, play: bool, singular: bool
) -> Iterator[str]:
    """The table, line by line; what is not right is named."""
    for kind in kinds:
        counts: Counter[str] = Counter()
        worst = 0.0
        for seed in seeds:
            for form in forms_of(kind):
                if forms and form not in forms:
                    continue
                if not forms and form not in (LIST, *rotating(forms_of(kind), seed)):
                    continue
                if play and form in PLANES:
                    # its judge follows no play
                    continue
                told = judged(kind, form, seed, play=play, singular=singular)
                counts[told.what] += 1
                worst = max(worst, told.cost if told.what == "right" else 0.0)
                if told.what != "right":
                    yield f"  {told.what}: {kind}, seed {seed}, {form}: {told.cost:.2f}, {told.words}"
        shown = ", ".join(f"{number} {what}" for what, number in sorted(counts.items()))
        yield f"{kind:20s} {shown}; largest residual {worst:.2f} of the tolerance"


def rotating(forms: list[str], seed: int) -> list[str]:
    """Four forms of a machine, others for the next."""
    return [forms[(4 * seed + k) % len(forms)] for k in range(4)]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("machines", nargs="?", type=int, default=MACHINES)
    parser.add_argument("--kind", action="append", choices=KINDS)
    parser.add_argument("--form", action="append", choices=[LIST, *FORMS, *PLANES])
    parser.add_argument("--play", action="store_true")
    parser.add_argument("--singular", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.machines)
    for line in campaign(
        options.kind or list(KINDS), options.form or [], seeds, play=options.play, singular=options.singular
    ):
        print(line, flush=True)


if __name__ == "__main__":
    main()
