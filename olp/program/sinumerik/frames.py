"""Programmable frames: what the arguments of TRANS, ROT, SCALE and MIRROR make of a point.

Source: Siemens, Programming Manual Fundamentals, section "Coordinate transformations (frames)".
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from olp.core.errors import ProgramError
from olp.core.turns import about_z, rows_of
from olp.core.units import AXES
from olp.program.sinumerik.actions import ChangeFrame

#: Each statement of the programmable frame, and whether it adds to the frame in force.
STATEMENTS: Mapping[str, tuple[str, bool]] = {
    "TRANS": ("TRANS", False), "ATRANS": ("TRANS", True), "ROT": ("ROT", False), "AROT": ("ROT", True),
    "SCALE": ("SCALE", False), "ASCALE": ("SCALE", True), "MIRROR": ("MIRROR", False),
    "AMIRROR": ("MIRROR", True),
}  # fmt: skip


class Parts:
    """The absolute and the additive part of the programmable offset, in numbers of the program, which G58 and
    G59 change one by one. They are followed while the frame is an offset alone."""

    def __init__(self) -> None:
        self._parts: list[list[float]] = [[0.0] * 3, [0.0] * 3]
        self._alone = True
        self._changed = ""

    def frame(self, name: str, values: Mapping[str, float], plane_angle: float | None) -> ChangeFrame | None:
        """What TRANS, ROT, SCALE, MIRROR or one of the additive statements does, as `frame_of`."""
        kind, adds = STATEMENTS[name]
        given = [values.get(axis, 0.0) for axis in AXES]
        if self._changed == "G59" and kind == "TRANS" and values:
            raise ProgramError(
                f"{name} comes behind G59, and manuals differ on whether it keeps that part; program "
                "TRANS without values before it",
                code="OLP518",
                word=name,
            )
        if not adds:
            self._parts = [given if kind == "TRANS" else [0.0] * 3, [0.0] * 3]
            self._alone, self._changed = kind == "TRANS" or not (values or plane_angle), ""
        elif kind == "TRANS":
            self._parts[1] = [a + b for a, b in zip(self._parts[1], given, strict=True)]
        else:
            self._alone &= not (values or plane_angle)
        return frame_of(name, values, plane_angle)

    def part(self, name: str, values: Mapping[str, float]) -> ChangeFrame:
        """G58 changes axes of the absolute part, G59 those of the additive one."""
        if not self._alone:
            raise ProgramError(
                f"{name} changes a frame that is turned, scaled or mirrored, which is not read; "
                "program TRANS and ATRANS",
                code="OLP512",
                word=name,
            )
        self._changed = name
        mine = self._parts[name == "G59"]
        mine[:] = [values.get(axis, old) for axis, old in zip(AXES, mine, strict=True)]
        x, y, z = (a + b for a, b in zip(*self._parts, strict=True))
        return ChangeFrame(shift=(x, y, z))

    def unit_changes(self) -> None:
        """Another unit of lengths: what is in force has other numbers."""
        if any(map(any, self._parts)):
            self._alone = False


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
