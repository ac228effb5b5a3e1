"""The kinds of features, in the order in which a container is sought for what lies in it."""

from __future__ import annotations

from olp.review.features.arcs import Arc, Circle
from olp.review.features.base import FeatureKind
from olp.review.features.contours import Contour
from olp.review.features.flats import Flat
from olp.review.features.holes import Hole
from olp.review.features.points import Points
from olp.review.features.walls import Wall

#: Every kind of feature; nothing else lists them.
KINDS: tuple[FeatureKind, ...] = (Hole(), Flat(), Contour(), Wall(), Arc(), Circle(), Points())
BY_NAME = {kind.name: kind for kind in KINDS}
