"""Programmable frames: what the arguments of TRANS, ROT, SCALE and MIRROR make of a point.

Source: Siemens, Programming Manual Fundamentals, section "Coordinate transformations (frames)".
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from olp.core.errors import ProgramError
from olp.core.turns import about_z, rows_of
from olp.program.sinumerik.actions import ChangeFrame

#: Each statement of the programmable frame, and whether it adds to the frame in force.
STATEMENTS: Mapping[str, tuple[str, bool]] = {
    "TRANS": ("TRANS", False), "ATRANS": ("TRANS", True), "ROT": ("ROT", False), "AROT": ("ROT", True),
    "SCALE": ("SCALE", False), "ASCALE": ("SCALE", True), "MIRROR": ("MIRROR", False),
    "AMIRROR": ("MIRROR", True),
}  # fmt: skip


def frame_of(name: str, values: Mapping[str, float], plane_angle: float | None) -> ChangeFrame | None:
    """What a statement does, by its values of X, Y and Z and its RPL; None for nothing. Raises ProgramError,
    without a line, for what is not read."""
    kind, adds = STATEMENTS[name]
    given = [values.get(axis) for axis in "XYZ"]
    if plane_angle is not None and (kind != "ROT" or values):
        raise ProgramError(
            f"RPL stands alone behind ROT or AROT, found it beside other words of {name}",
            code="OLP518",
            word=name,
        )
    if not values and plane_angle is None:
        return None if adds else ChangeFrame()
    if kind == "TRANS":
        x, y, z = (v or 0.0 for v in given)
        return ChangeFrame(shift=(x, y, z), adds=adds)
    if kind == "ROT":
        if given[0] or given[1]:
            raise ProgramError(
                f"{name} about X or Y tilts the plane, which is not read; post the operation for three axes",
                code="OLP512",
                word=name,
            )
        angle = given[2] or 0.0 if plane_angle is None else plane_angle
        return ChangeFrame(turn=rows_of(about_z(angle)), adds=adds, in_plane=plane_angle is not None)
    if kind == "SCALE":
        factors = [1.0 if v is None else v for v in given]
        if min(factors) <= 0.0:
            raise ProgramError(
                f"a factor of {name} is not above zero; expected a factor such as 0.5", code="OLP516"
            )
        return ChangeFrame(turn=rows_of(np.diag(factors)), adds=adds)
    signs = [1.0 if v is None else -1.0 for v in given]
    return ChangeFrame(turn=rows_of(np.diag(signs)), adds=adds)
