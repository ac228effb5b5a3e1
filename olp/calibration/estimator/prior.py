"""The prior of an adjustment: curves of a size and character that machines have, learnt from their own lines
where there are some, else by class."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from olp.calibration.estimator.basis import Scales, slope_grid
from olp.calibration.estimator.character import class_of
from olp.calibration.estimator.normal import Normal, evidence
from olp.calibration.estimator.parameters import Parameters
from olp.calibration.estimator.smoothing import AMPLITUDE, FEATURE, HALF, Shape
from olp.calibration.observations.points import FRAME_MM
from olp.calibration.observations.sensors import per_kelvin, shapes_of
from olp.core.arrays import Array
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.core.values import dataclass

#: Standard deviation of a squareness, rad.
SQUARE = 1e-3
#: Size and scales (mm or rad) of a curve without lines, if no other curve of its class has any.
UNKNOWN = {
    "positioning": (0.1, Scales(0.0, 0.1, 0.01, 1e-3)),
    "straightness": (0.03, Scales(0.0, 0.05, 0.005, 5e-4)),
    "angle": (6e-5, Scales(0.0, 1e-4, 1e-5, 1e-6)),
}
#: No curve is smaller than this (mm, rad).
LEAST_SIZE = 1e-4, 1e-7
#: How far a scale of a class may differ from its start, as a standard deviation of its logarithm.
LOOSE = 1.5
#: How much rougher than expected a curve may be, where it is compared with what other sources say.
ROUGHER = 2.5
#: Steps of the logarithm of a scale that are tried.
STEPS = (-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0)

#: Size and scales of the curves of a class.
Class = tuple[float, Scales]


def known_to(shapes: Mapping[str, Shape], kind: str) -> bool:
    """Whether some curve of a class has lines of its own."""
    return any(class_of(name) == kind for name in shapes)


@dataclass(slots=True)
class Prior:
    """Scales and amplitude of every curve. `shapes` are those that lines gave; `squares` the prior mean
    and standard deviation of shared nuisances; `classes` (amplitude, scales) for the other curves."""

    parameters: Parameters
    shapes: Mapping[str, Shape]
    squares: Mapping[str, tuple[float, float]]
    classes: dict[str, tuple[float, Scales]] = field(default_factory=lambda: dict(UNKNOWN))

    def precision(self, classes: Mapping[str, tuple[float, Scales]] | None = None) -> tuple[Array, float]:
        """(n, n) prior precision and its log determinant; the prior mean of all but squares is zero."""
        p = self.parameters
        precision = np.zeros((p.size, p.size))
        logdet = 0.0
        classes = self.classes if classes is None else classes
        for name in COMPONENTS:
            shape = self.shapes.get(name)
            size, scales = classes[class_of(name)]
            # coefficients that move together share one size
            amplitude = size * np.sqrt(p.spaces[name].size)
            if shape is not None:
                amplitude, scales = AMPLITUDE[name[1] in "ABC"], shape.scales
            block = p.spaces[name].process(scales, amplitude)
            precision[p.slices[name], p.slices[name]] = block
            logdet += float(np.linalg.slogdet(block)[1])
        for name, space in p.halves.items():
            part = p.slices[f"half {name}"]
            precision[part, part] = space.prior(
                self.shapes[name].half_roughness or 1.0, HALF[name[1] in "ABC"]
            )
        for name in p.waves:
            part = p.slices[f"wave {name}"]
            precision[part, part] = np.eye(part.stop - part.start) / FEATURE[name[1] in "ABC"] ** 2
        for name in p.warm:
            part = p.slices[f"warm {name}"]
            sizes = per_kelvin(name, len(p.sensors_degC), shapes_of(name, p.warm))
            precision[part, part] = np.diag(sizes**-2.0)
        for name in SQUARENESS:
            precision[p.slices[name], p.slices[name]] = 1.0 / SQUARE**2
        for name in p.shared:
            precision[p.slices[name], p.slices[name]] = 1.0 / self.squares[name][1] ** 2
        if p.framed:
            precision[p.slices["frame"], p.slices["frame"]] = np.eye(9) / FRAME_MM**2
        return precision, logdet

    def rougher(self) -> Prior:
        """The same with curves of lines as rough as may still be."""
        shapes = {
            name: replace(shape, scales=Scales.of(ROUGHER * shape.scales.values))
            for name, shape in self.shapes.items()
        }
        return replace(self, shapes=shapes)

    def push(self, normal: Normal) -> None:
        """Add the prior means to the right side."""
        for name in self.parameters.shared:
            mean, sigma = self.squares[name]
            normal.g[self.parameters.slices[name]] += mean / sigma**2

    def learn(self, normal: Normal) -> None:
        """Scales of classes from the curves that lines gave, else their scales and size by evidence, for the
        curves without lines of their own that some reading depends on."""
        p = self.parameters
        for kind in self.classes:
            known = [s.scales for name, s in self.shapes.items() if class_of(name) == kind]
            if known:
                self.classes[kind] = (self.classes[kind][0], _middle(known))
        for kind in self.classes:
            names = [
                name
                for name in COMPONENTS
                if class_of(name) == kind
                and name not in self.shapes
                and normal.H[p.slices[name], p.slices[name]].any()
            ]
            if names:
                self._choose(kind, normal, _rougher)
                self._choose(kind, normal, _stepped)
                if not known_to(self.shapes, kind):
                    # only these readings determine the size of such curves
                    for moved in (_larger, _rougher, _stepped):
                        self._choose(kind, normal, moved)

    def size_from(self, theta: Array) -> bool:
        """Take the size of curves without lines of their own to be that of the largest of their class with
        lines; True where there are such curves."""
        changed = False
        for kind, (_, scales) in self.classes.items():
            own = [name for name in self.shapes if class_of(name) == kind]
            if own and any(class_of(name) == kind and name not in self.shapes for name in COMPONENTS):
                self.classes[kind] = (max(self.rms(name, theta) for name in own), scales)
                changed = True
        return changed

    def rms(self, name: str, theta: Array) -> float:
        """Root mean square of a curve over its length."""
        space = self.parameters.spaces[name]
        q = slope_grid(space.spline)
        values = space.values(q) @ theta[self.parameters.slices[name]]
        return max(float(np.sqrt(np.mean(values**2))), LEAST_SIZE[class_of(name) == "angle"])

    def _choose(self, kind: str, normal: Normal, moved: Callable[[Class, float], Class]) -> None:
        """Moves a class by the expected logarithm of the factor: not at all where no reading says any."""
        start = self.classes[kind]
        values = np.array([
            evidence(normal, *self.precision({**self.classes, kind: moved(start, math.exp(step))}))
            - 0.5 * (step / LOOSE) ** 2
            for step in STEPS
        ])  # fmt: skip
        weight = np.exp(values - values.max())
        factor = math.exp(float(weight @ np.array(STEPS) / weight.sum()))
        self.classes = {**self.classes, kind: moved(start, factor)}


def _larger(one: Class, factor: float) -> Class:
    return factor * one[0], one[1]


def _rougher(one: Class, factor: float) -> Class:
    """The smooth parts by a factor, steps and ripple as they are."""
    return one[0], one[1].times(factor, 1.0)


def _stepped(one: Class, factor: float) -> Class:
    """Steps and ripple by a factor, the smooth parts as they are. They never grow: points and lengths cannot
    tell them from noise and from readings that slipped."""
    less = min(factor, 1.0)
    return one[0], one[1].times(1.0, less)


def _middle(scales: Sequence[Scales]) -> Scales:
    """The root mean square of each scale."""
    return Scales.of(np.sqrt(np.mean([one.values**2 for one in scales], axis=0)))
