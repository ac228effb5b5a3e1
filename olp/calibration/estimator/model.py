"""The unknowns that the readings of a machine need: the ranges of its curves, their cells and shapes, cyclic
terms, and where displacements were measured. Most of it follows from lines, as each reads one curve only."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from olp.calibration.estimator.basis import CurveSpace, Scales, Spline, Step, Wave
from olp.calibration.estimator.between import Hidden, hidden
from olp.calibration.estimator.character import of_others
from olp.calibration.estimator.parameters import MeasuringLine, Parameters
from olp.calibration.estimator.rail_joints import Joints
from olp.calibration.estimator.smoothing import AMPLITUDE, Features, Hides, Shape, features_of, shapes_of
from olp.calibration.iso230.separation import aliased
from olp.calibration.observations.base import Noise, Observation, Scattered
from olp.calibration.observations.lines import Line, shared_names, targets_of
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.references import known_of, sense_of
from olp.calibration.observations.sensors import middle_of, ranges_of
from olp.core.arrays import Array
from olp.core.errors import CannotCompute
from olp.core.machine import COMPONENTS, ZERO, Vector
from olp.core.progress import Progress
from olp.core.units import AXES
from olp.core.values import dataclass

#: Cells of the spline of a curve between two targets: its steps are somewhere between them.
BETWEEN = 2
#: At most so many cells for what is between targets: more of them only where there are more targets.
ENOUGH = 36
#: Cells of the spline of a curve, at least.
FEWEST = 24
#: Cells of the spline of a curve, at most.
MOST = 48
#: Cells of the spline of a half difference.
HALF_CELLS = 5
#: A line shorter than this share of the longest one of its axis is a sweep: it does not limit the box.
SWEEP = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """What holds throughout an adjustment. `lines` each with its noise, `box_mm` (3, 2) what the readings
    cover, `others` the character of curves without lines (`character.of_others`), `hides` what cells hide of
    a curve with lines. `waves` are the cyclic terms to begin with, `unobservable` says why others are not
    observable."""

    chain: str
    datum_mm: Vector
    box_mm: Array
    lines: Sequence[tuple[Line, Noise]]
    splines: Sequence[Spline]
    shapes: Mapping[str, Shape]
    others: Mapping[str, Array]
    hides: Hides
    waves: Mapping[str, tuple[Wave, ...]]
    unobservable: Mapping[tuple[str, float], str]
    framed: bool

    @classmethod
    def of(
        cls, measurements: Measurements, observations: Sequence[Observation],
        lines: Sequence[tuple[Line, Noise]], chain: str, travel_mm: Sequence[tuple[float, float]] | None,
        datum_mm: Vector | None, cells: int, tell: Progress,
    ) -> Model:  # fmt: skip
        """The model for observations; `cells` are those of axes without lines. Raises CannotCompute where
        no reading depends on an axis."""
        own = [line for line, _ in lines]
        ranges_of([(line.source, line.sensors_degC) for line in own if line.sensors_degC])
        ranges, box = _ranges(own, observations, travel_mm)
        x, y, z = datum_mm or (float(np.clip(0.0, *side)) for side in box)
        splines = [_spline(own, axis, ranges[axis], cells) for axis in range(3)]
        waves, unobservable = _waves(measurements, own, observations)
        shapes, others, hides = _shapes(_without_form(lines), splines, waves, (x, y, z), tell)
        framed = any(taken.framed for taken in observations)
        return cls(chain, (x, y, z), box, lines, splines, shapes, others, hides, waves, unobservable, framed)

    def parameters(self, waves: Mapping[str, tuple[Wave, ...]], joints: Joints) -> Parameters:
        """The layout of theta with some cyclic terms, and with joints of curves without lines."""
        own_lines = [line for line, _ in self.lines]
        spaces, halves, lines = {}, {}, {}
        for name in COMPONENTS:
            axis = AXES.index(name[2])
            spline, shape = self.splines[axis], self.shapes.get(name)
            kind = "straight" if name[1] in AXES and name[1] != name[2] else "zero"
            features = shape.features if shape else tuple(one.step for one in joints.get(name, ()))
            spaces[name] = CurveSpace.of(spline, features, self.datum_mm[axis], kind)
            if shape is not None and shape.half != "none":
                half = _half(spline)
                gauge = np.eye(half.count) if shape.half == "curve" else np.ones((half.count, 1))
                halves[name] = CurveSpace(half, (), gauge)
            if name[1] in AXES:
                own = [line for line in own_lines if line.component == name]
                near = own or [line for line in own_lines if line.axis == axis and line.quantity != "angle"]
                line_of = _measuring_line(near[0]) if near else MeasuringLine(self.datum_mm, ZERO)
                line_mm = list(line_of.line_mm)
                line_mm[axis] = self.datum_mm[axis]
                lines[name] = MeasuringLine((line_mm[0], line_mm[1], line_mm[2]), line_of.tool_mm)
        shared = sorted({name for line in own_lines for name in shared_names(line)})
        warm = tuple(name for name in COMPONENTS if any(one.component == name for one in self.heated))
        return Parameters(
            self.chain, self.datum_mm, spaces, lines, halves, dict(waves), tuple(shared), self.framed, warm,
            middle_of([one.sensors_degC for one in self.heated]),
        )  # fmt: skip

    @property
    def heated(self) -> list[Line]:
        """The lines with sensors beside them."""
        return [line for line, _ in self.lines if line.sensors_degC]


def artefacts_of(measurements: Measurements, parameters: Parameters) -> dict[str, tuple[float, float]]:
    """Prior mean and standard deviation of the shared nuisances, rad or mm."""
    return known_of(parameters.shared, measurements.squares, measurements.straightedges)


def _ranges(
    lines: Sequence[Line],
    observations: Sequence[Observation],
    travel_mm: Sequence[tuple[float, float]] | None,
) -> tuple[list[tuple[float, float]], Array]:
    """The range of all readings of each axis, and the box: what every component with lines covers, or the
    points where an axis has no lines."""
    ranges, box = [], np.zeros((3, 2))
    for axis in range(3):
        own = [line for line in lines if line.axis == axis]
        reached = [q for q in (taken.reach(axis) for taken in observations) if len(q)]
        low = min((float(q.min()) for q in reached), default=np.inf)
        high = max((float(q.max()) for q in reached), default=-np.inf)
        if low >= high:
            # nothing is known of this axis, or one position of it, such as that of a circle: all its errors
            # are zero over its travel, with their uncertainty
            box[axis] = _travel_of(axis, observations, travel_mm)
            ranges.append((min(low, box[axis, 0]), max(high, box[axis, 1])))
            continue
        ranges.append((low, high))
        sides = [] if own else [(low, high)]
        for name in {line.component for line in own}:
            same = [line for line in own if line.component == name]
            side = (
                min(float(line.target_mm.min()) for line in same),
                max(float(line.target_mm.max()) for line in same),
            )
            if side[1] - side[0] > SWEEP * (high - low):
                sides.append(side)
        limits = travel_mm[axis] if travel_mm is not None else (-np.inf, np.inf)
        box[axis] = max(*(s[0] for s in sides), limits[0]), min(*(s[1] for s in sides), limits[1])
        if box[axis, 0] >= box[axis, 1]:
            raise CannotCompute(
                f"the readings along {AXES[axis]} have no common range within the travel; expected all "
                "of them over one range"
            )
    return ranges, box


def _travel_of(
    axis: int, observations: Sequence[Observation], travel_mm: Sequence[tuple[float, float]] | None
) -> tuple[float, float]:
    """The travel of an axis without readings. Raises CannotCompute where it is not known, or where no axis
    has readings."""
    letter = AXES[axis]
    if not any(len(taken.reach(other)) for taken in observations for other in range(3)):
        raise CannotCompute("no reading was taken along any axis; expected lines or points")
    if travel_mm is None:
        raise CannotCompute(
            f"no line along {letter}, and its travel is not known; give the machine file (-m), or at least "
            f"the positioning E{letter}{letter}"
        )
    low, high = travel_mm[axis]
    return float(low), float(high)


def _spline(lines: Sequence[Line], axis: int, span: tuple[float, float], cells: int) -> Spline:
    own = [len(targets_of(line)) for line in lines if line.axis == axis]
    long = [
        len(targets_of(line))
        for line in lines
        if line.axis == axis and np.ptp(line.target_mm) > SWEEP * (span[1] - span[0])
    ]
    if not own:
        return Spline(*span, cells)
    gaps = max(long or own) - 1
    return Spline(*span, int(np.clip(max(gaps, min(BETWEEN * gaps, ENOUGH)), FEWEST, MOST)))


def _half(spline: Spline) -> Spline:
    return Spline(spline.low_mm, spline.high_mm, HALF_CELLS)


def _shapes(
    lines: Sequence[tuple[Line, Noise]],
    splines: Sequence[Spline],
    waves: Mapping[str, tuple[Wave, ...]],
    datum_mm: Vector,
    tell: Progress,
) -> tuple[dict[str, Shape], dict[str, Array], Hides]:
    """The shape of every component with lines: the features of each by itself, then again where others have
    their steps; then the scales of all curves of a class. Also what curves without lines are like, by class,
    and what cells hide of those with lines."""
    found: dict[str, Features] = {}
    # angles first: a reflector on the table reads their steps, too
    order = sorted(COMPONENTS, key=lambda name: name[1] in AXES)
    for again in (False, True):
        for k, name in enumerate(order):
            tell("shapes of curves", (k + again * len(order)) / (2 * len(order)))
            own = _own_lines(name, lines)
            steps = {
                other: [f for f in one.features if isinstance(f, Step)]
                for other, one in found.items()
                if other[2] == name[2] and other != name
            }
            joints = _all_of(steps.values())
            turns = _all_of(some for other, some in steps.items() if other[1] not in AXES)
            if own and (joints or not again):
                spline = splines[AXES.index(name[2])]
                found[name] = features_of(
                    own, spline, _half(spline), waves.get(name, ()),
                    joints if again else (), turns if again and _on_table(own) else (),
                )  # fmt: skip

    def hides(name: str, scales: Scales) -> Hidden:
        axis = AXES.index(name[2])
        amplitude = AMPLITUDE[name[1] in "ABC"]
        return hidden(_own_lines(name, lines), splines[axis], scales, amplitude, datum_mm[axis])

    return shapes_of(found, hides), of_others({name: own.values for name, own in found.items()}), hides


def _on_table(lines: Sequence[tuple[Line, Noise]]) -> bool:
    return any(line.reference == "table" and line.quantity != "angle" for line, _ in lines)


def _all_of(steps: Iterable[Sequence[Step]]) -> list[Step]:
    return sorted({step for some in steps for step in some}, key=lambda step: step.low_mm)


def _waves(
    measurements: Measurements, lines: Sequence[Line], observations: Sequence[Observation]
) -> tuple[dict[str, tuple[Wave, ...]], dict[tuple[str, float], str]]:
    """Cyclic terms that are observable at the targets, and why others are not."""
    waves: dict[str, tuple[Wave, ...]] = {}
    unobservable: dict[tuple[str, float], str] = {}
    for name in COMPONENTS:
        own = [targets_of(line) for line in lines if line.component == name]
        if name[1] == name[2]:
            scattered = [taken for taken in observations if isinstance(taken, Scattered)]
            own += [np.unique(taken.reach(AXES.index(name[2]))) for taken in scattered]
        for period in measurements.periods_mm[AXES.index(name[2])] if own else ():
            reasons = [aliased(targets, period) for targets in own]
            if None in reasons:
                waves[name] = (*waves.get(name, ()), Wave(period))
            else:
                unobservable[name, period] = str(reasons[0])
    return waves, unobservable


def _without_form(lines: Sequence[tuple[Line, Noise]]) -> list[tuple[Line, Noise]]:
    """Lines less the form of straightedges, as reversals show it at single targets: so it does not count as
    the shape of curves."""

    def means(line: Line, turned: bool) -> Array:
        """(n, 2) targets and mean readings of all lines of a component with the straightedge this way up."""
        own = [
            one for one, _ in lines
            if (one.straightedge, one.component, one.turned) == (line.straightedge, line.component, turned)
        ]  # fmt: skip
        if not own:
            return np.zeros((0, 2))
        q = np.round(np.concatenate([one.target_mm for one in own]), 1)
        value = np.concatenate([one.value - one.value.mean() for one in own])
        targets, inverse = np.unique(q, return_inverse=True)
        return np.stack([targets, np.bincount(inverse, value) / np.bincount(inverse)], axis=1)

    less: list[tuple[Line, Noise]] = []
    for line, noise in lines:
        less.append((line, noise))
        if line.straightedge is None:
            continue
        direct, turned = means(line, False), means(line, True)
        if len(direct) > 2 and len(turned) > 2:
            form = 0.5 * (direct[:, 1] - np.interp(direct[:, 0], turned[:, 0], turned[:, 1]))
            form = form - np.polyval(np.polyfit(direct[:, 0], form, 1), direct[:, 0])
            shown = sense_of(line.turned) * np.interp(line.target_mm, direct[:, 0], form)
            less[-1] = replace(line, value=line.value - shown), noise
    return less


def _own_lines(name: str, lines: Sequence[tuple[Line, Noise]]) -> list[tuple[Line, Noise]]:
    """The lines of a component that were taken where its first line was."""
    own = [(line, noise) for line, noise in lines if line.component == name]
    if not own:
        return []
    first = _measuring_line(own[0][0])
    return [(line, noise) for line, noise in own if name[1] in "ABC" or _measuring_line(line) == first]


def _measuring_line(line: Line) -> MeasuringLine:
    line_mm = list(line.line_mm)
    line_mm[line.axis] = 0.0
    return MeasuringLine((line_mm[0], line_mm[1], line_mm[2]), line.tool_mm)
