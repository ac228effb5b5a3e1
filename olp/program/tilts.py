"""Moves by which a control turns rotary axes until the tool stands on a tilted plane."""

from __future__ import annotations

from typing import Literal

from olp.core.turns import Turn
from olp.core.values import dataclass

#: Which of two positions of the axis nearest the tool: the one at a positive angle, at a negative one, or
#: not stated.
Branch = Literal[-1, 0, 1]


@dataclass(frozen=True, slots=True)
class Tilt:
    """A `move` that brings the rotary axes `letters` to where the tool is along the normal of a plane. `turn`
    is the plane in the workpiece, None where nothing turns. A `move` of -1 is that of the `line`. With
    `by_swivel` the branch counts larger and smaller positions of the axis that the swivel data of the control
    name, else signs of that nearest the tool. With `by_table` a table that turns about the tool takes the
    turn of the plane over."""

    move: int
    line: int
    letters: str
    turn: Turn | None
    branch: Branch
    by_swivel: bool = False
    by_table: bool = False
