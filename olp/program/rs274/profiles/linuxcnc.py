"""LinuxCNC and other RS274/NGC interpreters."""

from __future__ import annotations

from olp.core.patterns import pattern
from olp.program.rs274.block_rules import NGC_RULES
from olp.program.rs274.block_text import BlockText
from olp.program.rs274.codes import THREAD
from olp.program.rs274.cycle_rules import NGC_CYCLES
from olp.program.rs274.entry import keep_blocks, read_blocks, touching_blocks, unroll_blocks
from olp.program.rs274.flatten.language import NGC
from olp.program.rs274.profiles.base import (
    ARC_DISTANCE,
    ISO_M,
    NGC_M_REFUSALS,
    REFUSALS,
    Act,
    Profile,
    g_codes,
)
from olp.program.text.line_ends import STRAY_CR

_EVENTS = dict.fromkeys((431, 432, 591, 592, 593, 611, 921, 922, 923), Act.EVENT)

DIALECT = Profile(
    name="linuxcnc",
    title="LinuxCNC and other RS274/NGC interpreters",
    reader=read_blocks,
    folder_endings=("ngc", "nc", "tap", "cnc", "gcode"),
    unroller=unroll_blocks,
    keeper=keep_blocks,
    toucher=touching_blocks,
    touch_log=True,
    codes=g_codes(unchanged={80}, extra={**_EVENTS, **ARC_DISTANCE, THREAD: Act.MOTION}),
    refusals=REFUSALS,
    harmless_m=ISO_M | {50, 51, 52, 53} | frozenset(range(62, 69)),
    m_refusals=NGC_M_REFUSALS,
    initial_retract=990,
    g52_is_g92=True,
    g10_offsets=9,
    g10_active=True,
    turns_offsets=True,
    m61_sets_tool=True,
    length_of_spindle_tool=True,
    lengths_keep_unit=True,
    feed_words_end=True,
    feed_before_unit=True,
    least_inverse_feed=0.1,
    m_with_motion=frozenset({62, 63, 67}),
    g10_tools=frozenset({1}),
    text=BlockText(
        odd_bytes=pattern(rb"\x00|" + STRAY_CR.pattern),
        skips_control=False,
        nested_comments=False,
        marks_in_pairs=True,
        unread=pattern(rb"\$[ \t]*-?\d+"),
        unread_mark=ord("$"),
        longest=252,
    ),
    rules=NGC_RULES,
    cycles=NGC_CYCLES,
    language=NGC,
    path_mode="G64 without tolerance, LinuxCNC's default",
    path_tolerance=True,
    written_ending="ngc",
)
