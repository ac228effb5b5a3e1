"""Calibrations with blunders in them, and what the doctor says of them against what was done."""

from __future__ import annotations

import dataclasses
import datetime
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from cases.calibration import CHAINS
from judge import simulated

from olp.calibration.diagnosis.doctor import Diagnosis, diagnose
from olp.calibration.observations.points import Points
from olp.errormodel.calibration import Calibration, Curve

AXES = "XYZ"
ARCSEC = np.pi / 0.648


@dataclass
class Done:
    """What was done to a calibration: the factor that puts each name right, and the axes' blunders."""

    factors: dict[str, float]
    arranged: list[str] = field(default_factory=list)
    tables: str = ""


def true_calibration(machine: simulated.Machine, seed: int, sigma: float = 1.0) -> Calibration:
    """The machine's own curves, each with a smooth error of `sigma` um or urad."""
    rng = np.random.default_rng([seed, 5])
    curves = []
    for axis, letter in enumerate(AXES):
        low, high = machine.box[axis]
        q = np.linspace(low, high, 61)
        columns = {}
        for d in "XYZABC":
            u = np.pi * (q - low) / (high - low)
            wave = sum(rng.normal() * np.sin(k * u + rng.uniform(0, 6)) for k in (1, 2, 3))
            own = machine.curves[f"E{d}{letter}"](q)
            columns[f"E{d}{letter}"] = own + sigma * (1e-6 if d in "ABC" else 1e-3) * wave / 1.2
        curves.append(Curve(letter, q, columns))
    square = {name: value + sigma * 1e-6 * rng.normal() for name, value in machine.square.items()}
    return Calibration(
        "simulated", machine.box, datum_mm=tuple(machine.datum), curves=tuple(curves), squareness=square,
        measured=datetime.date(2026, 5, 14),
    )  # fmt: skip


def spoilt(calibration: Calibration, chain: str, rng: np.random.Generator) -> tuple[Calibration, Done]:
    """A calibration with blunders, and what puts it right."""
    names = [name for curve in calibration.curves for name in curve.names] + list(calibration.squareness)
    factors = {name: -1.0 if rng.random() < 0.15 else 1.0 for name in names}
    done = Done(factors)
    for letter in chain[: chain.index("F")]:
        if rng.random() < 0.3:
            done.tables += letter
            for d in "XYZABC":
                factors[f"E{d}{letter}"] = -1.0
    if rng.random() < 0.4:
        name = names[rng.integers(len(names))]
        angle = name[1] in "ABC0"
        units = [1000.0, 1e-3, *([ARCSEC, 1.0 / ARCSEC] if angle else [])]
        factors[name] *= units[rng.integers(len(units))]
    kind, axis = rng.random(), int(rng.integers(3))
    letter = AXES[axis]
    curves = []
    for curve in calibration.curves:
        columns = {name: values / factors[name] for name, values in curve.columns.items()}
        position = curve.position_mm
        if curve.axis == letter and kind < 0.15:
            a, b = rng.choice(list("ABC"), 2, replace=False)
            a, b = sorted((f"E{a}{letter}", f"E{b}{letter}"))
            columns[a], columns[b] = columns[b], columns[a]
            done.arranged.append(f"{a} and {b} exchanged")
        elif curve.axis == letter and kind < 0.25:
            columns = {name: values[::-1] for name, values in columns.items()}
            done.arranged.append(f"positions of {letter} counted from the other end")
        curves.append(Curve(curve.axis, position, columns, line_mm=curve.line_mm, tool_mm=curve.tool_mm))
    square = {name: value / factors[name] for name, value in calibration.squareness.items()}
    return dataclasses.replace(calibration, curves=tuple(curves), squareness=square), done


@dataclass
class Trial:
    counts: Counter[str]
    wrong: list[str]
    diagnosis: Diagnosis


def trial(seed: int, n: int, sigma: float) -> Trial:
    rng = np.random.default_rng([seed, n, int(1e6 * sigma)])
    chain = CHAINS[seed % len(CHAINS)]
    machine = simulated.machine(seed, ("smooth", "rough")[seed % 2], chain)
    machine.half = {}
    calibration, done = spoilt(true_calibration(machine, seed), chain, rng)
    axis_mm, tool, place = simulated.points(machine, seed, n, sigma)
    diagnosis = diagnose(calibration, chain, Points(axis_mm, tool, place, sigma))
    return judged(diagnosis, done)


def judged(diagnosis: Diagnosis, done: Done) -> Trial:
    counts: Counter[str] = Counter()
    wrong: list[str] = []
    for verdict in diagnosis.verdicts:
        spread = f"factor {verdict.factor:.3f} +- {verdict.sigma:.3f}"
        true = done.factors[verdict.name]
        if verdict.sign == "undecided":
            counts["undecided"] += 1
        elif verdict.sign == ("right" if true > 0 else "flipped"):
            counts["sign right"] += 1
        else:
            wrong.append(f"{verdict.name} is {verdict.sign}, {spread}, true {true:g}")
        if {1.0: "right", -1.0: "flipped"}.get(true) in verdict.excluded:
            wrong.append(f"{verdict.name}: the truth is excluded, {spread}, true {true:g}")
        if verdict.unit not in ("undecided",):
            good = verdict.unit != "no factor explains" and abs(verdict.applied / true - 1.0) < 1e-6
            counts["unit right" if good else "unit wrong"] += 1
            if not good:
                wrong.append(f"{verdict.name}: {verdict.unit}, {spread}, true {true:g}")
    for change in diagnosis.arrangements:
        if change.words not in done.arranged:
            wrong.append(f"{change.words}; done {done.arranged}")
    counts["arrangements found"] += sum(a.words in done.arranged for a in diagnosis.arrangements)
    counts["arrangements made"] += len(done.arranged)
    for letter, convention in diagnosis.senses.items():
        counts[f"table {convention != 'undecided'}"] += 1
        if convention == "of the table itself" and letter not in done.tables:
            wrong.append(f"table sense of {letter}")
    return Trial(counts, wrong, diagnosis)
