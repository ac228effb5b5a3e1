"""Mach3 mills.

Differs from LinuxCNC: G70 and G71 are units. Whether I, J and K are positions before G90.1 or G91.1 is a
setting, as is the return of cycles before G98 or G99. G43 needs H, and its length counts along Z. G28.1
searches the switches, and G31 probes. G52 writes the offset of G92. G59 P selects further
work offsets. M47 runs the program again.

Source: "Using Mach3Mill", chapter 10. It does not say what cycles keep when their code, their unit or G90
and G91 change, nor how G84 taps: this is refused.
"""

from __future__ import annotations

from olp.program.rs274.block_text import BlockText
from olp.program.rs274.cycle_rules import CycleRules
from olp.program.rs274.entry import keep_blocks, read_blocks, unroll_blocks
from olp.program.rs274.flatten.language import PLAIN_NGC
from olp.program.rs274.profiles.base import (
    ARC_DISTANCE,
    ISO_M,
    M_REFUSALS,
    REFUSALS,
    Act,
    Profile,
    g_codes,
)

#: None of this control: G38.2 to G38.5, G74, G84, G96, G97.
_LACKING = frozenset({382, 383, 384, 385, 740, 840, 960, 970})

DIALECT = Profile(
    name="mach3",
    title="Mach3 mills",
    reader=read_blocks,
    folder_endings=("tap", "nc"),
    unroller=unroll_blocks,
    keeper=keep_blocks,
    codes=g_codes(
        unchanged={150, 500, 690},
        extra={**ARC_DISTANCE, **dict.fromkeys((921, 922, 923), Act.EVENT)},
        without=_LACKING,
    ),
    refusals={
        **REFUSALS,
        281: "G28.1 searches the reference switches",
        120: "G12 cuts a circular pocket inside the control; post it as moves",
        130: "G13 cuts a circular pocket inside the control; post it as moves",
    },
    aliases={700: 200, 710: 210},
    harmless_m=ISO_M - {19},
    m_refusals={**M_REFUSALS, 470: "repeats the program"},
    initial_retract=None,
    arc_distance=None,
    g52_is_g92=True,
    g10_adds=None,
    lengths_along_z=True,
    numbers_hold=True,
    offset_words={590: "P"},
    offsets_alone=frozenset({590}),
    text=BlockText(inner_brackets=True),
    cycles=CycleRules(
        rises_first=True, feeds_home=True, taps_in_any_plane=True, taps_by_control=True,
        peck_by_parameter=True, repeat_words="L", stores=False, dwells=frozenset({820, 860, 890}),
        new_code_forgets=True,
        levels_follow_distance=True, keeps_numbers=False, exact_corners=False,
        other_axes=True, turning={},
    ),
    language=PLAIN_NGC,
    path_mode="constant velocity G64 of the control, unless exact stop is its setting",
    contours_assumed="that contours are made as LinuxCNC makes them is assumed: arcs about outside corners",
    written_ending="tap",
)  # fmt: skip
