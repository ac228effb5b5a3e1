"""Fanuc and compatible ISO controls."""

from __future__ import annotations

from dataclasses import replace

from olp.program.rs274.codes import ALIGNED, TILTED
from olp.program.rs274.cycle_rules import ISO_CYCLES
from olp.program.rs274.profiles.base import Act, g_codes
from olp.program.rs274.profiles.iso import ISO, ISO_EXTRA, ISO_UNCHANGED

DIALECT = replace(
    ISO,
    name="fanuc",
    title="Fanuc and compatible ISO controls (system A words of mills)",
    codes=g_codes(
        unchanged={*ISO_UNCHANGED, 51, 110},
        extra={**ISO_EXTRA, 51: Act.UNCHANGED, 501: Act.EVENT, 511: Act.EVENT},
    ),
    tip_codes=frozenset({434, 435}),
    direction_codes=frozenset({435}),
    direction_words=(b"I", b"J", b"K"),
    plane_codes=frozenset({TILTED, ALIGNED}),
    g10_tools=frozenset({10, 11, 12, 13}),
    polar=True,
    radius_holds=True,
    offset_words={**ISO.offset_words, 540: "P"},
    offset_names={540: "G54.1"},
    offsets_alone=frozenset({540}),
    scales_axes=True,
    scales_by_parameter=True,
    refusals={**ISO.refusals, 921: "G92.1 presets offsets that are not known off line"},
    harmless_m=ISO.harmless_m | {10, 11, 29, 13, 88, 89},
    cycles=replace(ISO_CYCLES, levels_stay=True),
    feed_without_point=True,
    # G5 switches the high-speed mode; other numbers call cycles
    still_with={50: ("P", frozenset({0.0, 10000.0}))},
    # a mill limits its spindle by G92 S
    lathe_words={280: ("UW", "sends both slides home"), 500: ("S", "limits the spindle")},
    path_mode="cutting mode G64 of the control, unless a smoothing mode is on",
)
