"""Contours under cutter compensation: no move of the corrected one is refused that the nominal one passes."""

from __future__ import annotations

import numpy as np

from olp.compensation.corners import gouging
from olp.core.arrays import Index, distinct
from olp.core.errors import ProgramError
from olp.core.toolpath import Toolpath


def check_contours(nominal: Toolpath, written: Toolpath, groups: Index) -> None:
    """Raise ProgramError with its line where the control would refuse a move of the `written` contour and not
    of the nominal one. `groups` (n,) is the last written move of each nominal one."""
    if not gouging(written).any():
        return
    new = distinct(np.concatenate([_new(nominal, written, groups, seen) for seen in (False, True)]))
    if not new.size:
        return
    compensation = nominal.frames[int(nominal.frame[new[0]])].compensation
    radius_mm = 0.0 if compensation is None else compensation.radius_mm
    raise ProgramError(
        f"the control would refuse this block once corrected: a cutter radius of {radius_mm:g} mm does not "
        "fit into its corners, and uncorrected it only just fits; make the block longer, or use a smaller "
        "cutter",
        line=int(nominal.line[new[0]]),
        code="OLP561",
    )


def _new(nominal: Toolpath, written: Toolpath, groups: Index, seen: bool) -> Index:
    """Nominal moves that can be cut, but not as written."""
    mine = distinct(np.searchsorted(groups, np.flatnonzero(gouging(written, seen=seen))))
    return np.asarray(mine[~gouging(nominal, seen=seen)[mine]])
