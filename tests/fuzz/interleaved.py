"""Random programs with interleaved modal state against LinuxCNC.

    python tests/fuzz/interleaved.py --count N --seed S [--any-words | --bent] [--write FOLDER]

`--any-words` draws programs of any words instead. Every difference is made as small as possible; one of each
cause is shown, and written with `--write FOLDER`.
`--bent` judges the corrected text on machines with errors. Ends with 1 if there was any difference. Seeds are
independent: run parts side by side.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fuzz import any_words, bent, grammar, minimise, nominal
from fuzz.grammar import Drawn
from fuzz.nominal import Outcome

#: programs of one kind of difference that are made smaller
_EACH = 12
_NUMBER = re.compile(r"[-+]?\d*\.?\d+(e-?\d+)?|\[.*?\]")


def topic(outcome: Outcome) -> tuple[str, str]:
    """What differs, without the numbers: what a smaller program still has to show."""
    text = outcome.text if outcome.kind == nominal.LOOSER else re.sub(r"\b[XYZ]\b", "A", outcome.text)
    return outcome.kind, _NUMBER.sub("#", text.partition(": start=")[0])[:70]


@dataclass(slots=True)
class Found:
    """Differences by topic and signature: how many, and the smallest program of one."""

    counts: Counter[str] = field(default_factory=Counter)
    topics: Counter[tuple[str, str]] = field(default_factory=Counter)
    causes: dict[tuple[tuple[str, str], str], tuple[int, Drawn, Outcome]] = field(default_factory=dict)
    refusals: Counter[str] = field(default_factory=Counter)

    def add(self, judge: nominal.Judge | bent.Judge, seed: int, drawn: Drawn) -> None:
        outcome = judge.outcome(drawn)
        self.counts[outcome.kind] += 1
        if outcome.kind == nominal.REFUSED:
            self.refusals[_NUMBER.sub("#", re.sub("`.*`", "``", outcome.text))[:100]] += 1
        if outcome.kind not in nominal.WRONG:
            return
        what = topic(outcome)
        self.topics[what] += 1
        if self.topics[what] > _EACH:
            return
        small = minimise.minimised(drawn, lambda trial: topic(judge.outcome(trial)) == what)
        cause = what, minimise.signature(small.data)
        if cause not in self.causes:
            self.causes[cause] = seed, small, judge.outcome(small)

    def write(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        for number, (seed, small, _) in enumerate(self.causes.values(), 1):
            (folder / f"{number:03}-{seed}.ngc").write_bytes(small.data)


def more_programs() -> list[Path]:
    """Folders of programs beside those that LinuxCNC installs: the value of OLP_LINUXCNC_TESTS."""
    name = os.environ.get("OLP_LINUXCNC_TESTS")
    return [Path(name)] if name else []


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--bent", action="store_true")
    which.add_argument("--any-words", action="store_true")
    parser.add_argument("--write", type=Path)
    options = parser.parse_args()
    found, begun = Found(), time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        judge = bent.Judge if options.bent else nominal.Judge
        draw = any_words.program if options.any_words else grammar.legal if options.bent else grammar.program
        judges = judge.of(Path(name))
        # what was found until then is shown after Ctrl-C, too
        with contextlib.suppress(KeyboardInterrupt):
            for seed in range(options.seed, options.seed + options.count):
                found.add(judges, seed, draw(seed))
    spent = time.monotonic() - begun
    for (what, _), (seed, small, outcome) in sorted(found.causes.items()):
        switch = " with block delete" if small.deletes else ""
        print(f"{what[0]}: seed {seed}, line {outcome.line}{switch}: {outcome.text}\n    {small.data!r}")
    for reason, count in found.refusals.most_common(30):
        print(f"refused {count}: {reason}")
    for what, count in found.topics.most_common():
        print(f"{what[0]} {count}: {what[1]}")
    print(", ".join(f"{count} {kind}" for kind, count in found.counts.most_common()), f"in {spent:.0f} s")
    if options.write:
        found.write(options.write)
    return int(bool(found.topics))


if __name__ == "__main__":
    sys.exit(main())
