"""What Fanuc, Haas and compatible ISO controls have in common."""

from __future__ import annotations

from collections.abc import Mapping

from olp.program.rs274.profiles.base import Act

#: G codes that mean nothing to the path on these controls.
ISO_CARRY = frozenset({80, 90, 150, 500, 501, 620, 630, 670, 690, 691, 131, 231, 250})
#: G44 and G54.1; G92.1 needs offsets that are not known off line.
ISO_EXTRA: Mapping[int, Act] = {440: Act.EVENT, 541: Act.EVENT, 921: Act.REFUSE}
