"""Deviations of the shipped jobs as a table: python tests/benchmarks/figures.py"""

from __future__ import annotations

from pathlib import Path

import olp
from olp.files.config import load_job

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
JOBS = (
    "gantry-plate/job.toml",
    "bridge-cmm/job.toml",
    "table-router/job.toml",
    "table-router/job-drill.toml",
    "table-router/job-outline.toml",
    "haas-mill/job.toml",
    "haas-mill/job-manifold.toml",
)
HEAD = (
    "| program | moves: corrected, approximated, left uncorrected | waypoints uncorrected | corrected "
    "| between uncorrected | corrected | allowed |",
    "|---|---|---|---|---|---|---|",
)


def row(job: str) -> str:
    """One line of the table."""
    path = PROGRAMS / job
    stated = load_job(path)
    assert stated.program and stated.machine
    report = olp.correct(stated.program, stated.machine, path).report
    deviation, moves = report["deviation"], report["moves"]
    counts = ", ".join(str(moves[name]) for name in ("corrected", "approximated", "passed"))
    values = [
        f"{deviation[when][where]['max_um']:.2f} / {deviation[when][where]['rms_um']:.2f}"
        for where in ("waypoints", "between")
        for when in ("before", "after")
    ]
    name = f"`{path.parent.name}/{Path(stated.program).name}`"
    return f"| {name} | {counts} | {' | '.join(values)} | {deviation['allowed_um']:.2f} |"


def table() -> str:
    return "\n".join([*HEAD, *map(row, JOBS)])


if __name__ == "__main__":
    print(table())
