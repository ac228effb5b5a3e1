"""The prior of an adjustment: smooth curves of a size that machines have, learnt from their own lines where
there are some, else by class."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace

import numpy as np

from olp.calibration.estimator.basis import slope_grid
from olp.calibration.estimator.normal import Normal, evidence
from olp.calibration.estimator.parameters import Parameters
from olp.calibration.estimator.smoothing import AMPLITUDE, FEATURE, HALF, Shape
from olp.calibration.observations.points import FRAME_MM
from olp.core.arrays import Array
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.core.values import dataclass

#: Standard deviation of a squareness, rad.
SQUARE = 1e-3
#: Standard deviation of the unknown pose of a square, rad.
POSE = 0.1
#: Size and second differences (mm or rad) of a curve without lines, if no other curve of its class has any.
UNKNOWN = {"positioning": (0.1, 2e-3), "straightness": (0.03, 1e-3), "angle": (6e-5, 2e-6)}
#: No curve is smaller than this (mm, rad).
LEAST_SIZE = 1e-4, 1e-7
#: How far the roughness of a class may differ from its start, as a standard deviation of its logarithm.
LOOSE = 1.5


def class_of(name: str) -> str:
    """positioning, straightness or angle."""
    if name[1] in "ABC":
        return "angle"
    return "positioning" if name[1] == name[2] else "straightness"


def known_to(shapes: Mapping[str, Shape], kind: str) -> bool:
    """Whether some curve of a class has lines of its own."""
    return any(class_of(name) == kind for name in shapes)


@dataclass(slots=True)
class Prior:
    """Roughness and amplitude of every curve. `shapes` are those that lines gave; `squares` the prior mean
    and standard deviation of shared nuisances; `classes` (amplitude, roughness) for the other curves."""

    parameters: Parameters
    shapes: Mapping[str, Shape]
    squares: Mapping[str, tuple[float, float]]
    classes: dict[str, tuple[float, float]] = field(default_factory=lambda: dict(UNKNOWN))

    def precision(self, classes: Mapping[str, tuple[float, float]] | None = None) -> tuple[Array, float]:
        """(n, n) prior precision and its log determinant; the prior mean of all but squares is zero."""
        p = self.parameters
        precision = np.zeros((p.size, p.size))
        logdet = 0.0
        classes = self.classes if classes is None else classes
        for name in COMPONENTS:
            shape = self.shapes.get(name)
            size, roughness = classes[class_of(name)]
            # coefficients that move together share one size
            amplitude = size * np.sqrt(p.spaces[name].size)
            if shape is not None:
                amplitude, roughness = AMPLITUDE[name[1] in "ABC"], shape.roughness
            block = p.spaces[name].prior(roughness, amplitude)
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
        for name in SQUARENESS:
            precision[p.slices[name], p.slices[name]] = 1.0 / SQUARE**2
        for name in p.shared:
            precision[p.slices[name], p.slices[name]] = 1.0 / self.squares[name][1] ** 2
        if p.framed:
            precision[p.slices["frame"], p.slices["frame"]] = np.eye(9) / FRAME_MM**2
        return precision, logdet

    def roughest(self) -> Prior:
        """The same with curves as rough as their lines do not exclude."""
        shapes = {name: replace(shape, roughness=shape.roughest) for name, shape in self.shapes.items()}
        return replace(self, shapes=shapes)

    def push(self, normal: Normal) -> None:
        """Add the prior means to the right side."""
        for name in self.parameters.shared:
            mean, sigma = self.squares[name]
            normal.g[self.parameters.slices[name]] += mean / sigma**2

    def learn(self, normal: Normal) -> None:
        """Amplitude of classes from the curves that lines gave, then roughness by evidence, for the curves
        without lines of their own that some reading depends on."""
        p = self.parameters
        for kind in self.classes:
            known = [s for name, s in self.shapes.items() if class_of(name) == kind]
            if known:
                rough = float(np.exp(np.median([np.log(shape.roughness) for shape in known])))
                self.classes[kind] = (self.classes[kind][0], rough)
        for kind in self.classes:
            names = [
                name
                for name in COMPONENTS
                if class_of(name) == kind
                and name not in self.shapes
                and normal.H[p.slices[name], p.slices[name]].any()
            ]
            if names:
                self._choose(kind, normal, 1)
                if not known_to(self.shapes, kind):
                    # only these readings determine the size of such curves
                    for _ in range(2):
                        self._choose(kind, normal, 0)
                        self._choose(kind, normal, 1)

    def size_from(self, theta: Array) -> bool:
        """Take the size of curves without lines of their own to be that of the largest of their class with
        lines; True where there are such curves."""
        changed = False
        for kind, (_, roughness) in self.classes.items():
            own = [name for name in self.shapes if class_of(name) == kind]
            if own and any(class_of(name) == kind and name not in self.shapes for name in COMPONENTS):
                self.classes[kind] = (max(self.rms(name, theta) for name in own), roughness)
                changed = True
        return changed

    def rms(self, name: str, theta: Array) -> float:
        """Root mean square of a curve over its length."""
        space = self.parameters.spaces[name]
        q = slope_grid(space.spline)
        values = space.values(q) @ theta[self.parameters.slices[name]]
        return max(float(np.sqrt(np.mean(values**2))), LEAST_SIZE[class_of(name) == "angle"])

    def _choose(self, kind: str, normal: Normal, which: int) -> None:
        """Take the size (0) or roughness (1) of a class that the evidence prefers."""
        start = self.classes[kind]
        steps = np.linspace(-3.0, 3.0, 7)

        def moved(step: float) -> dict[str, tuple[float, float]]:
            pair = [*start]
            pair[which] *= float(np.exp(step))
            return {**self.classes, kind: (pair[0], pair[1])}

        values = [
            evidence(normal, *self.precision(moved(step))) - 0.5 * (step / LOOSE) ** 2
            for step in steps.tolist()
        ]
        k = int(np.clip(np.argmax(values), 1, len(steps) - 2))
        a, b, c = values[k - 1 : k + 2]
        bend = a - 2.0 * b + c
        shift = 0.5 * (a - c) / bend if bend < 0.0 else 0.0
        self.classes = moved(float(steps[k] + np.clip(shift, -1.0, 1.0) * (steps[1] - steps[0])))
