"""Grbl 1.1 and its descendants, which have no canned cycles."""

from __future__ import annotations

from dataclasses import replace

from olp.core.patterns import pattern
from olp.program.rs274.block_text import BlockText
from olp.program.rs274.codes import CYCLES
from olp.program.rs274.cycle_rules import NGC_CYCLES
from olp.program.rs274.entry import keep_blocks, read_blocks, touching_blocks, unroll_blocks
from olp.program.rs274.flatten.language import PLAIN_NGC
from olp.program.rs274.profiles.base import ISO_M, NGC_M_REFUSALS, REFUSALS, Act, Profile, g_codes

_EXTRA = {400: Act.UNCHANGED, 431: Act.EVENT, 911: Act.ARC_DISTANCE, 921: Act.EVENT, 611: Act.REFUSE}
_LACKING = {
    *(281, 300, 301, 330, 331, 410, 411, 420, 421, 430, 520, 640, 760, 870, 880, 950, 960, 970, 980, 990),
    *CYCLES,
}
#: What the control answers or unlocks, and the start after a hold: senders keep such lines in files.
_ASKS = pattern(rb"[ \t]*(?:\$[$#GINX]?|[?~])[ \t]*(?:;[^\r\n]*|\([^)\r\n]*\)[ \t]*)?")
#: System commands that are no blocks. The firmware refuses them unless it is idle, a jog also behind a jog
#: (system.c: error 8).
_OUTSIDE = {
    "$J=": (
        pattern(rb"(?i)[ \t]*\$J"),
        "is a jog, which the control takes only when it is idle, so whether it moves is not known; "
        "write the move as G0 or G1",
    ),
    "$H": (pattern(rb"(?i)[ \t]*\$H"), "homes the machine; send it before the program"),
    "$100= and other settings": (
        pattern(rb"(?i)[ \t]*\$(?:\d+|N\d*|RST)[ \t]*="),
        "changes a setting of the control; send it before the program",
    ),
}

DIALECT = Profile(
    name="grbl",
    title="Grbl 1.1 and its descendants",
    reader=read_blocks,
    folder_endings=("nc", "ngc", "gcode", "gc", "tap"),
    unroller=unroll_blocks,
    keeper=keep_blocks,
    toucher=touching_blocks,
    codes=g_codes(unchanged=set(), extra=_EXTRA, without=_LACKING),
    refusals=REFUSALS,
    harmless_m=ISO_M | {56},
    m_refusals=NGC_M_REFUSALS,
    motion=0,
    initial_retract=990,
    g10_active=True,
    machine_moves_absolute=True,
    # senders take comments out before they send a line
    text=BlockText(
        odd_bytes=None, cr_ends_line=True, open_comments=True, inner_brackets=True, outside=_OUTSIDE
    ),
    cycles=replace(NGC_CYCLES, exact_corners=False),
    inert=_ASKS,
    # grblHAL saves modes
    language=replace(PLAIN_NGC, saved_modes=True),
    path_mode="junction deviation of the control ($11)",
)
