"""Simulated measurements as the project takes them, and the residual errors of a machine after a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from judge import simulated

from olp.calibration.estimator.fitted import Fit
from olp.calibration.observations.lengths import Lengths
from olp.calibration.observations.lines import Line
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.pods import Pods
from olp.calibration.observations.points import Points
from olp.calibration.observations.references import Square

CHAINS = ("FXYZ", "YFXZ", "XYFZ", "FYXZ", "XFYZ", "ZFXY")
#: tools of the judgement: the one measured with, and one with which no line was measured
TOOLS = (simulated.TOOL, (200.0, -60.0, -400.0))


def line_of(taken: simulated.Taken, sigma: float = 0.0) -> Line:
    """A simulated line as the project's value; its file is named by its component."""
    return Line(
        taken.component, taken.target, taken.value, taken.run, taken.direction, taken.line, taken.tool,
        taken.reference, taken.square, sigma, taken.scale_sigma, f"{taken.component.lower()}.csv",
    )  # fmt: skip


def measurements_of(taken: Sequence[simulated.Taken], periods: Sequence[float] | None = None) -> Measurements:
    """All lines, squares of 5 urad, and a period an axis where the screw has one."""
    names = sorted({t.square for t in taken if t.square})
    x, y, z = ((p,) for p in periods) if periods else ((), (), ())
    squares = tuple(Square(name, 0.0, simulated.SQUARE_SIGMA) for name in names)
    return Measurements("simulated", tuple(line_of(t) for t in taken), squares, (x, y, z))


def case(seed: int, family: str, chain: str | None = None) -> tuple[simulated.Machine, Measurements]:
    """A machine of a family and its full set of lines; of every third the reflector is on its tables."""
    chain = chain or CHAINS[seed % len(CHAINS)]
    machine = simulated.machine(seed, family, chain)
    tables = chain[: chain.index("F")] if seed % 3 == 1 else ""
    taken = simulated.all_lines(machine, seed, tables=tables)
    return machine, measurements_of(taken, simulated.PITCH if family == "rough" else None)


#: tools of the judgement of points: none of those of the plan
FRESH = ((0.0, 0.0, -180.0), (90.0, 60.0, -220.0))


def cloud(
    machine: simulated.Machine, seed: int, n: int, sigma_um: float, tools: Sequence[object] | None = None
) -> Points:
    """Points of a tracker in a Latin hypercube, with three offsets of the reflector."""
    tools = simulated.OFFSETS if tools is None else tools
    axis_mm, tool, place = simulated.points(machine, seed, n, sigma_um * 1e-3, tools)
    return Points(axis_mm, tool, place, sigma_um * 1e-3, source="points.csv")


def rays(
    machine: simulated.Machine, seed: int, count: int, n: int, tools: Sequence[object] | None = None
) -> tuple[Lengths, ...]:
    """n lengths of 0.2 um + 0.3 um/m from each of so many stations."""
    tools = simulated.OFFSETS if tools is None else tools
    places = simulated.stations(machine, seed, count)
    return tuple(
        Lengths(*simulated.lengths(machine, seed, place, k, n, tools), source=f"station-{k}.csv")
        for k, place in enumerate(places)
    )


def two_pods(machine: simulated.Machine, seed: int, n: int, tools: Sequence[object] | None = None) -> Pods:
    """Angles of 10 urad from two pods, whose distance is known within 10 um."""
    tools = simulated.OFFSETS if tools is None else tools
    places = np.array(simulated.PODS)
    apart = float(np.linalg.norm(places[1] - places[0]))
    taken = simulated.directions(machine, seed, n, places, 10e-6, tools)
    return Pods(*taken, 10e-6, ((0, 1, apart, 0.01),), "pods.csv")


@dataclass(frozen=True)
class Residual:
    """rms lengths in um over fresh places in the box: before and after, in the machine's own frame and in the
    rigid frame that fits best; and the standard deviation of error over stated uncertainty."""

    before: float
    before_framed: float
    after: float
    after_framed: float
    z: float


def residual_of(machine: simulated.Machine, fit: Fit, tool: Sequence[float], n: int = 1500) -> Residual:
    """The residual errors of a machine with a tool after a fit."""
    rng = np.random.default_rng(4711)
    axis_mm = rng.uniform(machine.box[:, 0], machine.box[:, 1], (n, 3))
    vector = np.array(tool, float)
    before = machine.error(axis_mm, vector)
    after = before - fit.error(axis_mm, vector)
    z = after[:200] / fit.sigma(axis_mm[:200], vector)
    rms, off = simulated.rms_um, simulated.off_frame
    framed = rms(off(axis_mm, before)), rms(off(axis_mm, after))
    return Residual(rms(before), framed[0], rms(after), framed[1], float(np.sqrt(np.mean(z**2))))
