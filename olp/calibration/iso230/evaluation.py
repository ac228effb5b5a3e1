"""All figures that the readings of a machine give without a fit: ISO 230-2 figures, parts of the lines,
squareness of straightness pairs, and what is wrong with how they were taken."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from olp.calibration.iso230 import go_return
from olp.calibration.iso230 import positioning as iso230_2
from olp.calibration.iso230.conventions import angle_words
from olp.calibration.iso230.go_return import Reversal, reversal_of
from olp.calibration.iso230.positioning import Evaluation, Zone
from olp.calibration.iso230.separation import Separation, separate
from olp.calibration.iso230.squareness import component_of, from_straightness_pair, pairs_of
from olp.calibration.observations.lines import Line
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.references import Square
from olp.calibration.observations.squareness import SquarenessReading
from olp.core.errors import ConfigError
from olp.core.units import RAD_PER_URAD
from olp.core.values import dataclass
from olp.findings.catalogue import Finding

#: A line shorter than this share of the longest one of its component, on an axis with periods, is a sweep.
SWEEP = 0.3


@dataclass(frozen=True, slots=True)
class Pair:
    """Two straightness lines read against one square, and the squareness that they give."""

    first: Line
    second: Line
    square: Square
    reading: SquarenessReading


@dataclass(frozen=True, slots=True, eq=False)
class Evaluated:
    """The figures of `measurements`. `sweeps` are lines over few periods, taken for cyclic errors alone;
    lines that could not be evaluated are named in `findings`."""

    measurements: Measurements
    evaluations: tuple[Evaluation, ...]
    separations: tuple[Separation, ...]
    reversals: tuple[Reversal, ...]
    pairs: tuple[Pair, ...]
    sweeps: tuple[Line, ...]
    findings: tuple[Finding, ...]

    def of(self, component: str) -> tuple[Evaluation, ...]:
        """The evaluations of a component."""
        return tuple(e for e in self.evaluations if e.component == component)

    def as_dict(self) -> dict[str, Any]:
        """As JSON, in the form "olp-evaluation-1"."""
        return {
            "schema": "olp-evaluation-1",
            "machine": self.measurements.machine,
            "measured": self.measurements.measured,
            "temperature_degC": self.measurements.temperature_degC,
            "lines": [e.as_dict() for e in self.evaluations],
            "reversals": [r.as_dict() for r in self.reversals],
            "cyclic": [s.as_dict() for s in self.separations],
            "squareness": [
                {
                    "component": pair.reading.component,
                    "value_urad": pair.reading.value_rad / RAD_PER_URAD,
                    "sigma_urad": pair.reading.sigma_rad / RAD_PER_URAD,
                    "angle": angle_words(pair.reading.component, pair.reading.value_rad),
                    "square": pair.square.name,
                    "lines": [pair.first.component, pair.second.component],
                    "line_mm": list(pair.reading.line_mm),
                    "tool_mm": list(pair.reading.tool_mm),
                }
                for pair in self.pairs
            ],
            "sweeps": [{"component": line.component, "file": line.source} for line in self.sweeps],
            "findings": [finding.as_dict() for finding in self.findings],
        }


def evaluate_all(measurements: Measurements, zone: Zone = "least-squares") -> Evaluated:
    """Evaluate every line of a calibration. A line that cannot be evaluated becomes a finding; where none can
    be, the first reason is raised as ConfigError."""
    lines = measurements.lines
    sweeps = tuple(line for line in lines if _is_sweep(line, measurements))
    evaluations: list[Evaluation] = []
    separations: list[Separation] = []
    reversals: list[Reversal] = []
    findings: list[Finding] = []
    reasons: list[ConfigError] = []
    for line in lines:
        if any(line is sweep for sweep in sweeps):
            continue
        try:
            evaluation = iso230_2.evaluate(line, zone)
        except ConfigError as error:
            reasons.append(error)
            findings.append(Finding("OLP858", str(error)))
            continue
        evaluations.append(evaluation)
        periods = measurements.periods_mm[line.axis]
        own = [sweep for sweep in sweeps if sweep.component == line.component]
        # periods and sweeps deal with cyclic errors at equal steps
        findings += [
            f for f in iso230_2.findings_of(evaluation) if not (f.code == "OLP852" and (own or periods))
        ]
        if periods:
            separation = separate(line, periods, own)
            separations.append(separation)
            findings += separation.findings
        if len(evaluation.sides) == 2:
            reversal = separations[-1].reversal if periods else reversal_of(line)
            if reversal is not None:
                reversals.append(reversal)
                findings += go_return.findings_of(reversal)
    if not evaluations and reasons:
        raise reasons[0]
    pairs = tuple(_pairs(measurements, findings))
    return Evaluated(
        measurements, tuple(evaluations), tuple(separations), tuple(reversals), pairs, sweeps, tuple(findings)
    )


def _is_sweep(line: Line, measurements: Measurements) -> bool:
    longest = max(np.ptp(o.target_mm) for o in measurements.lines if o.component == line.component)
    return bool(measurements.periods_mm[line.axis]) and bool(np.ptp(line.target_mm) < SWEEP * longest)


def _pairs(measurements: Measurements, findings: list[Finding]) -> Iterator[Pair]:
    """One pair per square and plane. Lines with another tool vector or position may serve another purpose, so
    they are reported only where the square gives no pair."""
    squares = {square.name: square for square in measurements.squares}
    refused: dict[tuple[str, str], str] = {}
    made: set[tuple[str, str]] = set()
    for first, second in pairs_of(measurements.lines):
        name = first.square or ""
        key = name, component_of(first, second)
        try:
            reading = from_straightness_pair(first, second, squares.get(name, Square(name)))
        except ConfigError as error:
            refused[key] = str(error)
            continue
        made.add(key)
        yield Pair(first, second, squares.get(name, Square(name)), reading)
    findings += [Finding("OLP858", sentence) for key, sentence in refused.items() if key not in made]
