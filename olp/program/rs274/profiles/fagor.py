"""Fagor 8025 and 8055 mills.

Differs from LinuxCNC: `T2.2` is the tool 2 with its offset 2, and G43 takes the length of that offset; G44
ends it. G70 and G71 are units. G54 to G59 with axes write an offset, canned cycles have words of their own,
and G53 is an offset on some of these controls: all of these are refused.

Source: what the posts of SheetCAM for the 8025 M write, and the programming manual of the 8055, "Tool length
compensation". What neither says is refused.
"""

from __future__ import annotations

from dataclasses import replace

from olp.program.rs274.codes import COMMON_CYCLES, CUTTER_COMPENSATION
from olp.program.rs274.profiles.base import ISO_M, M_REFUSALS, NO_CODE, REFUSALS, Act, g_codes
from olp.program.rs274.profiles.mach3 import DIALECT as MACH3
from olp.program.rs274.profiles.words import OPEN_CONTOURS
from olp.program.rs274.tool_points import translate

_LACKING = frozenset({100, 300, 382, 383, 384, 385, 520, 610, 640, 920, 930})
_POST = "post the moves"
_REFUSED = {
    40: "G4 counts by K in a unit that is not known; take the dwell out",
    50: "G5 rounds corners by an amount that the control sets; post exact corners, and take it out",
    60: "G6 takes centres of arcs as positions, which is not read; post them as distances",
    70: "G7 makes corners exact, which is not read; take it out",
    280: f"G28 is not read on this control; {_POST}",
    530: f"G53 is a work offset on some of these controls, and positions of the machine on others; {_POST}",
    **{code: f"G{code // 10} has words of its own on this control; {_POST}" for code in COMMON_CYCLES},
    **{code: OPEN_CONTOURS[code] for code in (410, 420)},
}

DIALECT = replace(
    MACH3,
    name="fagor",
    title="Fagor mills (8025, 8055)",
    folder_endings=("pim", "nc"),
    unroller=None,
    keeper=None,
    metric="G71",
    cleared="G40 G44",
    codes=g_codes(
        unchanged=set(),
        extra=dict.fromkeys(_REFUSED, Act.REFUSE),
        without=_LACKING | (CUTTER_COMPENSATION - _REFUSED.keys()),
    ),
    refusals={**REFUSALS, **_REFUSED},
    aliases={440: 490, 490: NO_CODE, 700: 200, 200: NO_CODE, 710: 210, 210: NO_CODE},
    harmless_m=ISO_M - {48, 49},
    m_refusals=M_REFUSALS,
    arc_distance=911,
    g52_is_g92=False,
    g10_offsets=0,
    length_of_spindle_tool=True,
    numbers_hold=False,
    offset_words={},
    offsets_alone=frozenset(),
    translator=translate,
    path_mode="not stated",
    written_ending="pim",
)
