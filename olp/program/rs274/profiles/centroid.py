"""Centroid mills (CNC11, CNC12).

Differs from Fanuc: M25 moves Z to its home. G43 without H takes the length of the H that a later block
states, and a move before it is refused. G10 with P73 and P83 sets the clearances of pecks, G4 counts seconds.
G92 changes the work offset itself, and G51 and G68 have words of their own: these are refused, as are macros.
How the control makes corners under G41 and G42 is not in its manual, so they are refused, too.

Source: the operator's manual of the M-series, chapters "CNC program codes" and "M functions".
"""

from __future__ import annotations

from dataclasses import replace

from olp.core.patterns import pattern
from olp.program.rs274.cycle_rules import ISO_CYCLES
from olp.program.rs274.profiles.base import M_REFUSALS, Act, g_codes
from olp.program.rs274.profiles.iso import ISO
from olp.program.rs274.profiles.words import OPEN_CONTOURS

_LACKING = frozenset({382, 383, 384, 385, 541, 860, 870, 880})
_REFUSED = {
    110: "G11 is not a code of this control",
    290: "G29 moves back from the reference position in moves of the control's own; post the move",
    500: "G50 belongs to G51, which is not read; post the coordinates",
    510: "G51 (scaling and mirror images) is not read here; post the coordinates",
    680: "G68 (rotation) is not read here; post the coordinates",
    690: "G69 belongs to G68, which is not read; post the coordinates",
    920: "G92 changes the work offset in force; give that offset in the machine or job file, and take it out",
    **{
        code: f"G{code // 10} turns the plane of arcs, which is not read; post them as moves"
        for code in (1170, 1180, 1190)
    },
    **OPEN_CONTOURS,
}

DIALECT = replace(
    ISO,
    name="centroid",
    title="Centroid mills",
    folder_endings=("cnc", "nc", "tap"),
    unroller=None,
    keeper=None,
    codes=g_codes(
        unchanged={90},
        extra={440: Act.EVENT, **dict.fromkeys(_REFUSED, Act.REFUSE)},
        without=_LACKING,
    ),
    refusals={**ISO.refusals, **_REFUSED},
    harmless_m=ISO.harmless_m | {10, 11, 41, 42, 43},
    m_refusals={**M_REFUSALS, 260: "makes the present position the home of an axis"},
    home_m=frozenset({250}),
    motion=0,
    feed_without_point=True,
    dwell_in_seconds=True,
    dwell_words="PX",
    length_awaits_number=True,
    g10_clearances=frozenset({73, 83}),
    g10_offsets=0,
    offset_words={},
    # a comment that is shown begins with a colon
    inert=pattern(rb"[ \t]*:[^\r\n]*"),
    cycles=replace(ISO_CYCLES, repeat_words="", stores=False, new_code_forgets=True),
    program_number=False,
    path_mode="the control's own smoothing, where it is on",
)
