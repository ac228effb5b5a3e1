"""Planted blunders on machines of any joints: how many pass in silence, and how many are named.

    python tests/benchmarks/bench_joint_blunders.py [SEEDS] [STRUCTURE ...]

Machines of nine structures (tests/cases/joint_campaigns.py) are measured by each instrument that a shop has
for them. Every blunder (tests/cases/joint_blunders.py) is planted in each campaign, one at a time.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from cases.joint_blunders import ALARMS, JointOutcome, blunders, outcome
from cases.joint_campaigns import STRUCTURES, Campaign, instruments_of

import olp


def main(seeds: int, structures: tuple[str, ...]) -> None:
    begin, counts = time.process_time(), Counter[str]()
    for structure in structures:
        for instrument in instruments_of(structure):
            for seed in range(seeds):
                with tempfile.TemporaryDirectory() as folder:
                    campaign = Campaign(Path(folder) / structure, structure, instrument, seed)
                    machine = campaign.folder / "machine.toml"
                    clean = olp.fit_joint_calibration(campaign.written(), machine)
                    false = [one for one in clean.findings if one.code in ALARMS]
                    counts["clean"] += 1
                    print(f"{structure}, {instrument}, seed {seed}", flush=True)
                    counts["clean, false alarms"] += bool(false)
                    for one in false:
                        print(f"  FALSE {structure}, {instrument}, seed {seed}: {one.code} {one.message}")
                    for blunder in blunders(campaign):
                        said = outcome(campaign, blunder)
                        counts["planted"] += 1
                        counts["clear effect"] += said.loud
                        counts["clear effect, silent"] += said.silent
                        counts["clear effect, silent, told beforehand"] += said.silent and said.told
                        counts["clear effect, named"] += said.loud and said.named
                        counts["no clear effect, named"] += said.named and not said.loud
                        if said.silent or (said.loud and not said.named):
                            print(
                                f"  {_word(said)} {structure}, {instrument}, "
                                f"seed {seed}: {blunder.kind}, {said.size:.1f}, {' '.join(said.alarms)}: "
                                f"{said.said}",
                                flush=True,
                            )
    for name, count in sorted(counts.items()):
        print(f"{name}: {count}")
    print(f"{(time.process_time() - begin) / max(1, counts['planted'] + counts['clean']):.1f} s of CPU a fit")


def _word(said: JointOutcome) -> str:
    if said.silent:
        return "silent, told" if said.told else "SILENT"
    return "not named"


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1, tuple(sys.argv[2:]) or STRUCTURES)
