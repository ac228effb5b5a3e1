"""CPU time of the error model on one core: python tests/benchmarks/bench_errormodel.py"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np

from olp.compensation.invert import invert
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve
from olp.errormodel.gridded import ComponentTable
from olp.errormodel.reversal import play_states
from olp.errormodel.sources.maps import DeviationMap

BOX = np.array([[0.0, 2000.0], [0.0, 1000.0], [-600.0, 0.0]])


def full_calibration(spacing_mm: float = 50.0, jitter_mm: float = 0.0) -> Calibration:
    """18 curves and 3 squareness errors of a machine of 2 x 1 x 0.6 m, about 20 um and 40 urad."""
    rng = np.random.default_rng(1)
    curves = []
    for axis, (low, high) in zip("XYZ", BOX, strict=True):
        position = np.linspace(low, high, round((high - low) / spacing_mm) + 1)
        position[1:-1] += jitter_mm * rng.uniform(-1.0, 1.0, len(position) - 2)
        columns = {
            f"E{d}{axis}": np.cumsum(rng.normal(size=len(position))) * (3e-3 if d in "XYZ" else 8e-6)
            for d in "XYZABC"
        }
        curves.append(Curve(axis, position, columns, line_mm=(0.0, 0.0, 0.0)))
    square = {"C0Y": 20e-6, "B0Z": -8e-6, "A0Z": 12e-6}
    return Calibration("bench", BOX, curves=tuple(curves), squareness=square)


def gridded(interpolation: str) -> dict[str, Calibration]:
    """A map of 21 x 11 x 7 nodes, and the sag of a gantry over two arguments."""
    rng = np.random.default_rng(3)
    levels = [np.linspace(low, high, n) for (low, high), n in zip(BOX, (21, 11, 7), strict=True)]
    values = rng.normal(size=(21, 11, 7, 3)) * 5e-3
    described = DeviationMap(tuple(levels), values, interpolation=interpolation)
    columns = {"EZY": rng.normal(size=(11, 7)) * 1e-3, "EAY": rng.normal(size=(11, 7)) * 1e-6}
    load = ComponentTable("Y", ("Y", "Z"), tuple(levels[1:]), columns, interpolation=interpolation)
    return {
        "map": Calibration("bench", BOX, maps=(described,)),
        "load": Calibration("bench", BOX, compliance=(load,)),
    }


def best(run: Callable[[], object], repeat: int = 5) -> float:
    times = []
    for _ in range(repeat):
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
    return min(times)


def report(label: str, run: Callable[[], object], n: int) -> None:
    print(f"  {label}: {best(run) / n * 1e9:.0f} ns each")


def main() -> None:
    rng = np.random.default_rng(2)
    n = 1_000_000
    random = rng.uniform(BOX[:, 0], BOX[:, 1], (n, 3))
    walk = np.clip(np.cumsum(rng.normal(size=(n, 3)) * 0.2, axis=0) + BOX.mean(axis=1), BOX[:, 0], BOX[:, 1])
    delta = np.diff(walk, axis=0)
    tool = np.array([5.0, 130.0, -240.0])
    tools = np.tile(tool, (n, 1))
    play = np.sign(rng.normal(size=(n, 3)))
    for label, jitter_mm in (("uniform knots", 0.0), ("irregular knots", 3.0)):
        calibration = full_calibration(jitter_mm=jitter_mm)
        print(f"{label}: build {best(partial(build, calibration, 'FXYZ')) * 1e3:.0f} ms")
        for chain in ("FXYZ", "YFXZ"):
            model = build(calibration, chain)
            report(f"{chain} error at random points", partial(model.error, random, tool), n)
            report(f"{chain} error along a path", partial(model.error, walk, tool), n)
            report(f"{chain} error along a path, a tool per point", partial(model.error, walk, tools), n)
        inner = 1.0 + 0.998 * (walk - 1.0)
        report("command for a position of the tip", partial(invert, model, inner, tool), n)
        report("error with play", partial(model.error, walk, tool, play), n)
        report("chord_bound", partial(model.chord_bound, delta, tool), n)
    loaded = np.append(tool, 30.0)
    for interpolation in ("linear", "cubic"):
        for name, calibration in gridded(interpolation).items():
            model = build(calibration, "FXYZ")
            report(f"{interpolation} {name}, error along a path", partial(model.error, walk, loaded), n)
            report(f"{interpolation} {name}, chord_bound", partial(model.chord_bound, delta, loaded), n)
    for label, step_mm in (("moves of 1 mm", 1.0), ("moves of 1 um", 1e-3)):
        path = np.cumsum(rng.normal(size=(n, 3)) * step_mm, axis=0)
        report(f"play_states, {label}", partial(play_states, path, np.full(3, 4e-3)), n)


if __name__ == "__main__":
    main()
