"""A sum of models is a model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from olp.core.arrays import Array, Mask
from olp.core.errors import UsageError
from olp.core.values import dataclass
from olp.errormodel.base import ErrorModel
from olp.errormodel.boxed import as_points


@dataclass(frozen=True, slots=True, eq=False)
class Total:
    """Errors, rotations, backlash and bounds add; the box is what all models share."""

    models: tuple[ErrorModel, ...]

    def error(self, axis_mm: Array, tool_mm: Array, play: Array | None = None) -> Array:
        return self._added(lambda model: model.error(axis_mm, tool_mm, play))

    def rotation(self, axis_mm: Array, play: Array | None = None, payload_kg: Array | float = 0.0) -> Array:
        return self._added(lambda model: model.rotation(axis_mm, play, payload_kg))

    def contributions(
        self, axis_mm: Array, tool_mm: Array, play: Array | None = None
    ) -> Iterator[tuple[str, Array]]:
        for model in self.models:
            yield from model.contributions(axis_mm, tool_mm, play)

    @property
    def depends_on(self) -> Mask:
        return np.asarray(np.any([model.depends_on for model in self.models], axis=0))

    def backlash_at(self, axis_mm: Array) -> Array | None:
        parts = [part for model in self.models if (part := model.backlash_at(axis_mm)) is not None]
        return sum(parts[1:], parts[0]) if parts else None

    def chord_bound(self, delta_mm: Array, tool_mm: Array) -> Array:
        return self._added(lambda model: model.chord_bound(delta_mm, tool_mm))

    @property
    def box_mm(self) -> Array:
        boxes = np.array([model.box_mm for model in self.models])
        return np.stack([boxes[:, :, 0].max(axis=0), boxes[:, :, 1].min(axis=0)], axis=1)

    def inside(self, axis_mm: Array) -> Mask:
        points, box = as_points(axis_mm), self.box_mm
        return (points >= box[:, 0]) & (points <= box[:, 1])

    def _added(self, part: Callable[[ErrorModel], Array]) -> Array:
        first, *others = self.models
        result = part(first)
        for model in others:
            result += part(model)
        return result


def total(models: Sequence[ErrorModel]) -> ErrorModel:
    """The sum of one or more models; raises UsageError for none."""
    if not models:
        raise UsageError("no error model to add; expected at least one")
    return models[0] if len(models) == 1 else Total(tuple(models))
