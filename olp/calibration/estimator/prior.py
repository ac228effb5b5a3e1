"""The prior of an adjustment: curves of a size and character that machines have, learnt from their own lines
where there are some, else by class (`unread`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace

import numpy as np

from olp.calibration.estimator.basis import Scales
from olp.calibration.estimator.between import Hidden, beside_cells, in_cells
from olp.calibration.estimator.character import class_of
from olp.calibration.estimator.normal import Normal
from olp.calibration.estimator.parameters import Parameters
from olp.calibration.estimator.rail_joints import Joints, size_of
from olp.calibration.estimator.smoothing import AMPLITUDE, FEATURE, HALF, Shape
from olp.calibration.observations.points import FRAME_MM
from olp.calibration.observations.sensors import per_kelvin, shapes_of
from olp.core.arrays import Array
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.core.values import dataclass

#: Standard deviation of a squareness, rad.
SQUARE = 1e-3
#: How much rougher than expected a curve may be, where it is compared with what other sources say.
ROUGHER = 2.5
#: Size (root mean square of the straight part) and scales of the curves of a class, mm or rad.
Class = tuple[float, Scales]


@dataclass(slots=True)
class Prior:
    """Scales and amplitude of every curve. `shapes` are those that lines gave; `squares` the prior mean
    and standard deviation of shared nuisances; `classes` hold for the other curves."""

    parameters: Parameters
    shapes: Mapping[str, Shape]
    squares: Mapping[str, tuple[float, float]]
    classes: Mapping[str, Class]
    joints: Joints = field(default_factory=dict)
    _blocks: dict[tuple[str, Class], tuple[Array, float]] = field(default_factory=dict)

    @property
    def hidden(self) -> Mapping[str, Hidden]:
        """What the cells of each curve hide."""
        return self.hidden_of(self.classes)

    def hidden_of(self, classes: Mapping[str, Class]) -> dict[str, Hidden]:
        """The same with other classes."""
        found = {}
        for name, space in self.parameters.spaces.items():
            if name in self.shapes:
                found[name] = self.shapes[name].hidden
                continue
            found[name] = beside_cells(space.spline, classes[class_of(name)][1])
            for joint in self.joints.get(name, ()):
                found[name] = joint.beside(found[name])
        return found

    def precision(self, classes: Mapping[str, Class] | None = None) -> tuple[Array, float]:
        """(n, n) prior precision and its log determinant; the prior mean of all but squares is zero."""
        p = self.parameters
        precision = np.zeros((p.size, p.size))
        logdet = 0.0
        classes = self.classes if classes is None else classes
        for name in COMPONENTS:
            block, own = self._block(name, classes[class_of(name)])
            precision[p.slices[name], p.slices[name]] = block
            logdet += own
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

    def with_shapes(self, shapes: Mapping[str, Shape]) -> Prior:
        """The same with other shapes of curves with lines."""
        return replace(self, shapes=shapes)

    def _block(self, name: str, one: Class) -> tuple[Array, float]:
        """The precision of a curve and its log determinant. Those without lines are as their class."""
        space, shape = self.parameters.spaces[name], self.shapes.get(name)
        if shape is not None:
            one = AMPLITUDE[name[1] in "ABC"], shape.scales
        else:
            # coefficients that move together share one size
            one = one[0] * np.sqrt(space.size - len(space.features)), in_cells(one[1])
        found = self._blocks.get((name, one))
        if found is None:
            block = space.process(one[1], one[0], None if shape is not None else size_of(name))
            found = self._blocks[name, one] = block, float(np.linalg.slogdet(block)[1])
        return found

    def rougher(self) -> Prior:
        """The same with curves of lines as rough as may still be."""
        shapes = {
            name: replace(shape, scales=Scales.of(ROUGHER * shape.scales.values))
            for name, shape in self.shapes.items()
        }
        return self.with_shapes(shapes)

    def push(self, normal: Normal) -> None:
        """Add the prior means to the right side."""
        for name in self.parameters.shared:
            mean, sigma = self.squares[name]
            normal.g[self.parameters.slices[name]] += mean / sigma**2
