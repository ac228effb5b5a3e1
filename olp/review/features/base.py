"""What a kind of feature is: how it is found in a program, and what its figures mean."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

from olp.core.arrays import Array, Index
from olp.core.values import dataclass
from olp.review.features.ground import Ground


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of a kind of feature, for people: its label, and what it means."""

    label: str
    meaning: str


@dataclass(frozen=True, slots=True, eq=False)
class Deviations:
    """Deviations of a layer at k points of a feature. (k,) `move` is the move of the feature that each is on.
    (k, 3) `nominal_mm`, in the frame shown, and `delta_mm`. (k,) `weight` is the length of path of each point
    in mm, or 1 where points are measured. A point at which two moves meet is there for both."""

    move: Index
    nominal_mm: Array
    delta_mm: Array
    weight: Array

    def __len__(self) -> int:
        return len(self.move)

    def mean(self, values: Array) -> float:
        """The mean of values (k,) over the length of path."""
        return float(values @ self.weight / self.weight.sum())


@dataclass(frozen=True, slots=True, eq=False)
class Feature:
    """A feature of a program. `moves` are the rows of its feed moves, rising, and `shape` is what its kind
    needs to measure it. `label` is what it is called, `detail` what the program states of it in plain words.
    `centre_mm` is in the frame shown. Features with one text `alike` are listed below one node; an empty one
    is no group."""

    kind: str
    moves: Index
    shape: Any
    label: str
    detail: str
    centre_mm: tuple[float, ...]
    alike: str = ""


class FeatureKind(ABC):
    """A kind of feature. `name` is its key in the manifest, `label` is for people, and `figures` says what
    each of its figures means. A `container` holds the features whose moves are all its own."""

    name: ClassVar[str]
    label: ClassVar[str]
    figures: ClassVar[Mapping[str, Figure]]
    container: ClassVar[bool] = False

    @abstractmethod
    def find(self, ground: Ground) -> Iterable[Feature]:
        """The features of this kind, in any order."""

    @abstractmethod
    def measure(self, feature: Feature, deviations: Deviations) -> Mapping[str, float | None]:
        """The figures in mm from the deviations of a layer, None where there are too few points."""
