"""How controls make the canned cycles G73, G74, G81-G86 and G89.

The sequence is that of RS-274/NGC (NIST IR 6556, section 3.5.16) as LinuxCNC carries it out (`NGC_CYCLES`).
`ISO_CYCLES` are those of Fanuc and Haas controls, which differ here:

- an initial level below R: LinuxCNC goes straight to R first; Fanuc positions in the plane at its present
  level, then goes to R.
- a start at or below R in a series: LinuxCNC rises on the diagonal move to the hole, to R with G99, to the
  initial level with G98. Fanuc positions at its present level.
- tapping (G84, G74) and G89 feed up to R on Fanuc, then go to the initial level as a rapid; LinuxCNC
  feeds up to the end.
- G82, G86 and G89 need a dwell P on LinuxCNC.
- pecks: the clearance is 0.010 inch (0.254 mm) in LinuxCNC and a parameter of the control on Fanuc
  (5114, 5115) and Haas (settings 22, 52). Where it is not known the end points of the hole hold and the
  pecks between them do not.

Grbl has no canned cycles. On ISO controls the spindle stops at an angle in G76 and G87 (G77 of Haas), and
is shifted aside in a direction that a parameter sets. The strokes along the hole are read; the shift is in
rapids beside the wall. G87 bores from R up to Z, and ends at the initial level. G76 and G87 of other
controls are refused, and so is G88, in which an operator moves the axes by hand. So is tapping outside G17
on LinuxCNC: its release 2.9 makes the feed strokes of G84 and G74 there along the wrong axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from olp.core.values import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleRules:
    """How a control makes canned cycles.

    - `rises_first`: it leaves a level below R before it goes to the hole.
    - `feeds_home`: G84, G74 and G89 feed up to the end, else to R only.
    - `taps_in_any_plane`: else G84 and G74 go along the wrong axes outside G17.
    - `taps_by_control`: it synchronises G84 and G74, and orients the spindle in G76 and G87, so that plain
      moves cannot replace them.
    - `peck_by_parameter`: a parameter of the control gives the clearance of pecks.
    - `repeat_words`: these count the holes of a block, the first of them that is there.
    - `stores`: zero holes store the words of the cycle, else they are an error.
    - `dwells`: these cycles need a P. `first_peck`: the letter of the first peck where there is no Q; the
      following ones are smaller, which is not followed, and K beside it counts no holes.
    - `new_code_forgets`: another cycle of a series takes no words from the one before.
    - `levels_follow_distance`: after a change between G90 and G91 a series needs R and depth again.
      `levels_stay`: blocks without R and depth keep the levels, whatever the mode was that these were in.
    - `keeps_numbers`: a series keeps its initial level, R and depth as numbers of the program. Offsets and
      units may change, and G28 may come between. Else it has to end there.
    - `turning`: how the spindle has to turn in these cycles, M3 or M4.
    - `other_axes`: words of further axes may be in the block of a cycle.
    - `exact_corners`: all corners of a cycle are exact, whatever the path mode.
    """

    rises_first: bool
    feeds_home: bool
    taps_in_any_plane: bool
    taps_by_control: bool
    peck_by_parameter: bool
    repeat_words: str
    stores: bool
    dwells: frozenset[int]
    first_peck: str = ""
    new_code_forgets: bool
    levels_follow_distance: bool
    levels_stay: bool = False
    keeps_numbers: bool
    exact_corners: bool
    other_axes: bool
    turning: Mapping[int, tuple[int, ...]]

    def counter(self, words: Mapping[str, int]) -> int | None:
        """Of the words of a block by letter the one that counts its holes."""
        return next((words[letter] for letter in self.repeat_words if letter in words), None)


NGC_CYCLES = CycleRules(
    rises_first=True, feeds_home=True, taps_in_any_plane=False, taps_by_control=False,
    peck_by_parameter=False, repeat_words="L", stores=False, dwells=frozenset({820, 860, 890}),
    new_code_forgets=True,
    levels_follow_distance=False, keeps_numbers=True, exact_corners=True,
    other_axes=False, turning={740: (4,), 840: (3,), 860: (3, 4)},
)  # fmt: skip
ISO_CYCLES = CycleRules(
    rises_first=False, feeds_home=False, taps_in_any_plane=True, taps_by_control=True,
    peck_by_parameter=True, repeat_words="LK", stores=True, dwells=frozenset(), new_code_forgets=False,
    levels_follow_distance=True, keeps_numbers=False, exact_corners=False,
    other_axes=True, turning={},
)  # fmt: skip
#: Haas counts I, J and K as the first peck, what each is smaller, and the least one (mill operator's manual).
HAAS_CYCLES = replace(ISO_CYCLES, first_peck="I", levels_stay=True)
