"""Map of a two-pod tracker against equation (1) against one estimator, on the same simulated gantries.

    python tests/benchmarks/bench_two_pods.py [SEEDS] [--picture viewer/pictures/two-pods.png]

Gantries of 3 x 2 x 1 m, chain FXYZ, which equation (1) is for. Two pods of 10 urad per angle, 4 m apart, see
the reflector; their distance is known within 10 um. Lines are a full set (laser 0.5 um + 0.5 um/m, angles
1 urad, squares 5 urad, five runs in both directions, drift) through one point off the datum, with a reflector
120 mm below.

- raw map: deviations on a lattice, triangulated with the true poses of the pods, which flatters it; trilinear
- equation (1): the mean of each line as a curve, straightness less its slope, squareness from the slopes;
  levers from machine zero, or from where the lines were taken (`model = "huddersfield"`)
- estimator: `olp calibrate fit` of lines, of directions at places in a Latin hypercube with three offsets of
  the reflector, of both; with a map of the non-rigid part where the directions show one

Judged at fresh positions with the tool of the lattice and the lines, and with another, after the rigid frame
that fits best (what a work offset absorbs).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from cases.calibration import measurements_of, two_pods
from judge import simulated

from olp.calibration.estimator.adjustment import fit
from olp.calibration.estimator.nonrigid import NonRigid, nonrigid
from olp.calibration.observations.measurements import Measurements
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve
from olp.errormodel.sources.maps import DeviationMap

SEEDS = 6
CHAIN = "FXYZ"
URAD = 10e-6
LATTICES = {"raw map of 252 points": (7, 6, 6), "raw map of 990 points": (11, 10, 9)}
TOOLS = {"same tool": simulated.TOOL, "other tool": (90.0, 60.0, -220.0)}
MACHINES = ("smooth", "rough", "bent")
Errors = Callable[[np.ndarray, np.ndarray], np.ndarray]
#: squareness by the lines of its pair, and its sign
PAIRS = {"C0Y": ("EXY", "EYX", -1.0), "B0Z": ("EXZ", "EZX", 1.0), "A0Z": ("EYZ", "EZY", -1.0)}


def gantry(kind: str, seed: int) -> simulated.Machine:
    """A machine of a kind."""
    made = simulated.machine(seed, "rough" if kind == "rough" else "smooth", CHAIN)
    return simulated.bent(made) if kind == "bent" else made


def triangulated(place: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(n, 3) positions as two pods of known poses find them from their angles, by least squares."""
    table, right = np.zeros((len(place), 3, 3)), np.zeros((len(place), 3))
    for pod in np.array(simulated.PODS):
        x, y, z = (place - pod).T
        azimuth = np.arctan2(y, x) + rng.normal(0.0, URAD, len(place))
        elevation = np.arctan2(z, np.hypot(x, y)) + rng.normal(0.0, URAD, len(place))
        flat = np.cos(elevation)
        ray = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])
        across = np.eye(3) - ray[:, :, None] * ray[:, None, :]
        across /= (x**2 + y**2 + z**2)[:, None, None]
        table += across
        right += across @ pod
    return np.linalg.solve(table, right[:, :, None])[:, :, 0]


def raw_map(m: simulated.Machine, rng: np.random.Generator, counts: tuple[int, ...]) -> Errors:
    """The deviations at the nodes of a lattice, interpolated at run time."""
    knots = [np.linspace(*side, n) for side, n in zip(m.box, counts, strict=True)]
    position = np.stack(np.meshgrid(*knots, indexing="ij"), axis=-1).reshape(-1, 3)
    tool = np.array(simulated.TOOL)
    deviation = triangulated(position + tool + m.error(position, tool), rng) - position - tool
    described = DeviationMap(
        (knots[0], knots[1], knots[2]), deviation.reshape(*counts, 3), "total", simulated.TOOL
    )
    return build(Calibration("gantry", m.box, maps=(described,)), CHAIN).error


def equation_1(
    m: simulated.Machine, lines: list[simulated.Taken], origin_mm: tuple[float, float, float]
) -> Errors:
    """The curves as read, put into equation (1); levers count from `origin_mm`."""
    curves, slopes = [], {}
    for axis, letter in enumerate("XYZ"):
        columns = {}
        for taken in lines:
            if taken.component[2] != letter or taken.component in columns:
                continue
            q = np.unique(taken.target)
            value = np.array([taken.value[taken.target == target].mean() for target in q])
            slope = np.polyfit(q, value, 1)[0]
            if taken.component[1] in "XYZ" and taken.component[1] != letter:
                slopes[taken.component] = slope
                value = value - slope * q
            columns[taken.component] = value - np.interp(origin_mm[axis], q, value)
        curves.append(Curve(letter, q, columns, line_mm=origin_mm))
    square = {name: sign * (slopes[a] + slopes[b]) for name, (a, b, sign) in PAIRS.items()}
    return build(Calibration("gantry", m.box, "huddersfield", origin_mm, tuple(curves), square), CHAIN).error


def mapped(fitted: NonRigid) -> Errors:
    """Curves and map together."""
    return lambda position, tool: fitted.fit.error(position, tool) + fitted.value(position)


def methods(m: simulated.Machine, seed: int, kind: str) -> dict[str, Errors]:
    """The errors of a machine by each method of calibration, as functions of axis position and tool."""
    rng = np.random.default_rng([seed, 23])
    lines = simulated.all_lines(m, seed)
    laser = measurements_of(lines, simulated.PITCH if kind == "rough" else None)
    errors: dict[str, Errors] = {"nothing": lambda position, tool: np.zeros(position.shape)}
    for name, counts in LATTICES.items():
        errors[name] = raw_map(m, rng, counts)
    errors["equation (1), levers from zero"] = equation_1(m, lines, (0.0, 0.0, 0.0))
    errors["equation (1), levers from the lines"] = equation_1(m, lines, simulated.LINE)
    errors["estimator, lines"] = fit(laser, CHAIN).error
    for n in (250, 1000):
        pods = Measurements("gantry", (two_pods(m, seed, n),))
        fitted = fit(pods, CHAIN)
        errors[f"estimator, two pods, {n} points"] = fitted.error
        if n == 1000:
            errors["the same, map where evident"] = mapped(nonrigid(fitted))
    taken = (*laser.lines, two_pods(m, seed, 250))
    both = Measurements("gantry", taken, laser.squares, periods_mm=laser.periods_mm)
    errors["estimator, lines and two pods"] = fit(both, CHAIN).error
    return errors


@dataclass(frozen=True)
class Row:
    """rms in um by tool: one number per machine."""

    method: str
    residual: dict[str, list[float]]


def compared(kind: str, seeds: int) -> list[Row]:
    """The residual errors of machines of a kind, by method."""
    rows: dict[str, Row] = {}
    for seed in range(seeds):
        m = gantry(kind, seed)
        position = np.random.default_rng(4711).uniform(m.box[:, 0], m.box[:, 1], (1500, 3))
        for name, errors in methods(m, seed, kind).items():
            row = rows.setdefault(name, Row(name, {tool: [] for tool in TOOLS}))
            for tool, vector in TOOLS.items():
                rest = m.error(position, np.array(vector)) - errors(position, np.array(vector))
                row.residual[tool].append(simulated.rms_um(simulated.off_frame(position, rest)))
    return list(rows.values())


def picture(results: dict[str, list[Row]], target: Path) -> None:
    """Medians as bars from 10 % to 90 % of the machines."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, plots = plt.subplots(1, len(results), figsize=(11, 4.2), sharey=True, sharex=True)
    titles = {
        "smooth": "rigid, smooth curves",
        "rough": "rigid, kinks and steps",
        "bent": "bends: 30 um sag, 15 um twist",
    }
    for plot, (kind, rows) in zip(np.atleast_1d(plots), results.items(), strict=True):
        level = np.arange(len(rows))[::-1]
        for k, (tool, colour) in enumerate(zip(TOOLS, ("#1f6fb2", "#c0453a"), strict=True)):
            values = np.array([np.percentile(row.residual[tool], [10, 50, 90]) for row in rows])
            y = level + 0.18 - 0.36 * k
            plot.barh(y, values[:, 1], 0.34, color=colour, label=tool)
            plot.hlines(y, values[:, 0], values[:, 2], color="0.15", lw=1.0)
        plot.set_xscale("log")
        plot.set_xlim(0.8, 150.0)
        plot.set_xticks([1, 3, 10, 30, 100], ["1", "3", "10", "30", "100"])
        plot.set_yticks(level, [row.method for row in rows])
        plot.set_title(titles[kind], fontsize=10)
        plot.set_xlabel("residual, um rms")
        plot.grid(axis="x", alpha=0.3)
        plot.set_axisbelow(True)
    np.atleast_1d(plots)[-1].legend(fontsize=8, loc="lower right")
    figure.tight_layout()
    figure.savefig(target, dpi=110, metadata={"Software": None})


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("seeds", nargs="?", type=int, default=SEEDS)
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args()
    print("rms in um at fresh positions: median of machines (10 % to 90 %)")
    results = {}
    for kind in MACHINES:
        results[kind] = compared(kind, options.seeds)
        print(f"{kind}, {options.seeds} machines")
        for row in results[kind]:
            cells = []
            for tool in TOOLS:
                low, middle, high = np.percentile(row.residual[tool], [10, 50, 90])
                cells.append(f"{tool} {middle:5.1f} ({low:.1f} to {high:.1f})")
            print(f"  {row.method:38s}" + "   ".join(cells), flush=True)
    if options.picture:
        picture(results, options.picture)


if __name__ == "__main__":
    main()
