"""Coverage of 2 sigma, rms error against the best linear estimator, and stated sigma, on families of machines.

    python tests/benchmarks/bench_coverage.py [SEEDS] [FAMILY ...]

Simulated machines of 3 x 2 x 1 m (tests/judge/families.py) are measured by lines with 3 to 20 targets, or by
points, lengths of stations or directions of pods. Lines are judged curve by curve, at fresh positions on the line: rms and
stated sigma are in units of what the best linear estimator reaches that knows the covariance of the family.
Volumetric readings are judged at fresh poses with a fresh tool; there stated sigma is in units of the rms.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from cases.calibration import FRESH, cloud, measurements_of, rays, two_pods
from judge import families, simulated

from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.curves import sigma_of

#: Targets a line.
TARGETS = (3, 5, 8, 12, 20)
#: Readings all over the volume.
VOLUMES = ("points", "stations", "pods")
POSITIONS = 40


@dataclasses.dataclass(frozen=True)
class Scores:
    """Errors and stated sigma (n,) in units of `best` (n,), which the best linear estimator reaches."""

    error: np.ndarray
    sigma: np.ndarray

    @property
    def coverage(self) -> float:
        return float(np.mean(np.abs(self.error) <= 2.0 * self.sigma))

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def stated(self) -> float:
        return float(np.sqrt(np.mean(self.sigma**2)))

    @classmethod
    def of(cls, parts: Sequence[Scores]) -> Scores:
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("error", "sigma")))


def lines_of(family: str, count: int, seed: int) -> Scores:
    """A machine measured by lines through the datum, judged curve by curve."""
    machine = families.machine(seed, family)
    datum = (0.0, 0.0, 0.0)
    taken = simulated.all_lines(machine, seed, line_mm=datum, tool=datum, count=(count,) * 3)
    fitted = fit(measurements_of(taken), machine.chain)
    rng = np.random.default_rng(seed)
    parts = []
    for line in {line.component: line for line in taken}.values():
        name = line.component
        side = machine.box["XYZ".index(name[2])]
        q = rng.uniform(*side, POSITIONS)
        even = np.linspace(*side, 64)
        best = np.sqrt(np.mean(best_of(family, name, count) ** 2))
        off = fitted.curve(name, q) @ fitted.theta - machine.curves[name](q)
        parts.append(Scores(off / best, sigma_of(fitted, name, q) / best))
    return Scores.of(parts)


_BEST: dict[tuple[str, str, int], np.ndarray] = {}


def best_of(family: str, name: str, count: int) -> np.ndarray:
    key = family, name, count
    if key not in _BEST:
        side = simulated.BOX["XYZ".index(name[2])]
        _BEST[key] = families.best_linear(family, name, np.linspace(*side, count), np.linspace(*side, 97))
    return _BEST[key]


def volume_of(family: str, kind: str, seed: int) -> Scores:
    """A machine measured by points, stations or pods, judged at poses."""
    machine = families.machine(seed, family)
    taken = {
        "points": lambda: (cloud(machine, seed, 120, 5.0),),
        "stations": lambda: rays(machine, seed, 6, 150),
        "pods": lambda: (two_pods(machine, seed, 250),),
    }[kind]()
    fitted = fit(dataclasses.replace(measurements_of(()), observations=taken), machine.chain)
    rng = np.random.default_rng(seed)
    position, tool = rng.uniform(*machine.box.T, (POSITIONS * 3, 3)), np.array(FRESH[1])
    error = fitted.error(position, tool)
    free = 7 if kind == "pods" else 6
    off = fitted.error(position, tool) - machine.error(position, tool)
    return Scores(off.ravel(), fitted.sigma(position, tool).ravel())


def main(seeds: int, names: Sequence[str]) -> None:
    for family in names:
        for count in TARGETS:
            begin = time.process_time()
            total = Scores.of([lines_of(family, count, seed) for seed in range(seeds)])
            took = (time.process_time() - begin) / seeds
            print(
                f"{family:7s} {count:2d} targets: {100 * total.coverage:5.1f} % inside 2 sigma, rms {total.rms:.2f} and "
                f"stated {total.stated:.2f} of the best, stated/rms {total.stated / total.rms:.2f}; {took:.1f} s",
                flush=True,
            )
        for kind in VOLUMES:
            begin = time.process_time()
            total = Scores.of([volume_of(family, kind, seed) for seed in range(seeds)])
            took = (time.process_time() - begin) / seeds
            print(
                f"{family:7s} {kind}: {100 * total.coverage:5.1f} % inside 2 sigma, rms {1e3 * total.rms:.2f} um, "
                f"stated/rms {total.stated / total.rms:.2f}; {took:.1f} s",
                flush=True,
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20, sys.argv[2:] or list(families.FAMILIES))
