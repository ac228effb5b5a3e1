"""Correction of one way in several dialects, in microseconds a block, once all is loaded:

python tests/benchmarks/bench_dialects.py
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import olp
from olp.files.config import load_setup
from olp.files.described import described

ROOT = Path(__file__).resolve().parents[2]
BLOCKS = 100_000


def texts(points: np.ndarray) -> dict[str, str]:
    """The same way in each dialect."""
    forms = {
        "linuxcnc": ("G21 G90 G54 F600\n", "G1 X{:.4f} Y{:.4f} Z{:.4f}\n", "M2\n"),
        "apt": ("UNITS/MM\nFEDRAT/600,MMPM\n", "GOTO/{:.4f},{:.4f},{:.4f}\n", "FINI\n"),
        "list": ("X_mm,Y_mm,Z_mm,speed\n", "{:.4f},{:.4f},{:.4f},100\n", ""),
        "kawasaki-as": (".PROGRAM a()\n", "LMOVE TRANS({:.4f},{:.4f},{:.4f},0,180,0)\n", ".END\n"),
    }
    rows = points.tolist()
    return {
        name: head + "".join(form.format(*row) for row in rows) + tail
        for name, (head, form, tail) in forms.items()
    }


def main() -> None:
    setup = load_setup(ROOT / "programs" / "bridge-cmm" / "machine.toml")
    steps = np.random.default_rng(0).normal(size=(BLOCKS, 3)) * 0.02
    points = np.clip(np.cumsum(steps, axis=0) + np.array((300, 300, 200)), (20, 20, 20), (700, 900, 500))
    for turn in range(2):
        for name, text in texts(points).items():
            job = replace(setup.job, dialect=name, described=described(name))
            begin = time.perf_counter()
            olp.correct(text.encode(), replace(setup, job=job))
            if turn:
                print(f"{name:12} {(time.perf_counter() - begin) / BLOCKS * 1e6:6.1f} us a block")


if __name__ == "__main__":
    main()
