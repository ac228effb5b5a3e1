"""Random programs re-timed and judged: python tests/fuzz/fuzz_retime.py FIRST COUNT [--write FOLDER]

Prints every seed whose motion breaks a law or that raises, and the largest ratios over all seeds; ends with 1
if there was any. `--write` keeps the programs of those seeds. Seeds are independent: run parts side by side.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import traceback
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fuzz import retime as retime_fuzz
from judge import retime_programs

RATIOS = ("velocity", "acceleration", "jerk", "feed", "differences", "tolerance")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("first", type=int)
    parser.add_argument("count", type=int)
    parser.add_argument("--write", type=Path)
    options = parser.parse_args()
    most = dict.fromkeys(RATIOS, 0.0)
    bad = waypoints = 0
    motion_s = 0.0
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as name:
        base = retime_fuzz.setup(Path(name))
        for seed in range(options.first, options.first + options.count):
            try:
                outcome = retime_fuzz.outcome(seed, base)
                wrong = outcome.wrong
                waypoints += len(outcome.verdicts) and outcome.waypoints
                motion_s += outcome.duration_s
                for key in RATIOS:
                    most[key] = max(most[key], *(getattr(v, key) for v in outcome.verdicts), 0.0)
            except Exception:
                wrong = (traceback.format_exc(limit=-3),)
            if wrong:
                bad += 1
                print(f"seed {seed}:", *wrong, sep="\n  ", flush=True)
                if options.write:
                    options.write.mkdir(parents=True, exist_ok=True)
                    (options.write / f"{seed}.ngc").write_bytes(retime_programs.program(seed))
    spent = time.process_time() - begun
    print(f"{options.count} programs, {waypoints} waypoints, {motion_s:.0f} s of motion, {bad} wrong")
    print(", ".join(f"{key} {value:.9f}" for key, value in most.items()), f"in {spent:.0f} s of CPU")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
