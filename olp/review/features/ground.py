"""What features are found in: the moves of a scene, their chains, the areas that they cover, and circles."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from olp.core.arrays import Array, Index, Mask
from olp.review.features.areas import Areas, areas_of
from olp.review.features.chains import Chains, chains_of, there_and_back
from olp.review.features.circles import Circular, arcs_of, chords_of
from olp.review.features.moves import Moves
from olp.review.scene import Scene


class Ground:
    """A scene for the search for features. Each part is worked out when a kind first asks for it."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.moves = Moves(scene)

    @cached_property
    def chains(self) -> Chains:
        """Connected feed moves of one level."""
        return chains_of(self.moves)

    @cached_property
    def areas(self) -> Areas:
        """The areas that the chains cover."""
        return areas_of(self.moves, self.chains)

    @cached_property
    def outer(self) -> Mask:
        """(m,) moves of chains that may be walls: they do not only clear an area."""
        return ~self.areas.inner[self.chains.chain]

    @cached_property
    def circular(self) -> Circular:
        """Circular moves, arcs and chords, without those that only clear an area."""
        both = Circular.joined([arcs_of(self.moves), chords_of(self.moves, self.chains)])
        return both.take(~np.isin(both.row, self.chains.row[~self.outer]))

    @cached_property
    def chords(self) -> Mask:
        """(m,) moves of chains that are chords of circles."""
        return np.isin(self.chains.row, self.circular.row) & self.chains.straight

    @cached_property
    def touches(self) -> Mask:
        """(c,) chains that go from a rapid along one line and back to its start: touches of a probe, or
        strokes across the tool axis."""
        return there_and_back(self.moves, self.chains)

    def centre(self, rows: Index) -> tuple[float, ...]:
        """The middle of the box around moves, in the frame shown."""
        return middle(np.concatenate(self.moves.tips(rows)))


def middle(points: Array) -> tuple[float, ...]:
    """The middle of the box around points (n, 3)."""
    return tuple(((points.min(axis=0) + points.max(axis=0)) / 2.0).tolist())
