"""How a control makes the path of the tool's centre from a contour under cutter compensation."""

from __future__ import annotations

from typing import Literal

from olp.core.values import dataclass


@dataclass(frozen=True, slots=True)
class ContourRules:
    """What controls do in their own way.

    - `entry`: the first move ends beside its programmed end, across its own direction ("own") or across that
      of the next move ("next").
    - `outside`: round an outside corner the tool goes along an arc about it ("arc"), or along both sides,
      extended until they meet ("extended").
    - `smooth_rad`: a smaller change of direction is none: the next move begins where the last one ended.
    - `returns`: the first move after the contour goes to all that is programmed, whatever its words; else a
      move across the plane leaves the tool beside the contour.
    - `planes`: planes (0..2) in which the control compensates.
    - `circles_by_ends`: an arc is a whole circle where it ends at its begin alone, beside the contour.
    - `refused_g`, `refused_m`: codes that the control does not take along contours, ten times their number.
    - `enters_by_arc`: an arc may be the first move.
    """

    entry: Literal["own", "next"]
    outside: Literal["arc", "extended"]
    smooth_rad: float
    returns: bool
    planes: tuple[int, ...]
    enters_by_arc: bool = False
    circles_by_ends: bool = False
    refused_g: frozenset[int] = frozenset()
    refused_m: frozenset[int] = frozenset()


#: LinuxCNC, as its interpreter does it.
NGC_CONTOURS = ContourRules(
    "own", "arc", 0.05, returns=True, planes=(0, 1), circles_by_ends=True,
    enters_by_arc=True,
    refused_g=frozenset({430, 431, 432, 490, 610, 611, 640, 980, 990}),
    refused_m=frozenset({*range(480, 540, 10), *range(620, 690, 10)}),
)  # fmt: skip
#: Fanuc and Haas with start-up of type A and linear corners, as they are delivered.
ISO_CONTOURS = ContourRules("next", "extended", 0.05, returns=False, planes=(0, 1, 2))
#: Sinumerik 840D with NORM and G450, as it is delivered.
SINUMERIK_CONTOURS = ContourRules("next", "arc", 0.05, returns=False, planes=(0, 1, 2))
