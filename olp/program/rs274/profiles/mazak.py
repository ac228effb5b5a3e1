"""Mazak mills, EIA/ISO programs.

Differs from Fanuc: `T1 T2 M6` changes to the first tool and makes the second one ready. G5 is a high-speed
mode and no spline. G84.2 and G84.3 are synchronous taps, as is G84 with `,R1`. G61.1 keeps shapes and does
not stop between blocks.

Source: programming manuals "EIA/ISO program" of Mazatrol Matrix and Smooth controls.
"""

from __future__ import annotations

from dataclasses import replace

from olp.core.patterns import pattern
from olp.program.rs274.cycle_rules import ISO_CYCLES
from olp.program.rs274.profiles.base import Act, g_codes
from olp.program.rs274.profiles.iso import ISO, ISO_EXTRA, ISO_UNCHANGED

#: `,R0` and `,R1` of a tap: whether spindle and feed are synchronous.
_SYNCHRONOUS = pattern(
    rb"(?im)^[^;(\r\n]*G[ \t]*0*(?:84|74)(?:\.[23])?(?![\d.])[^;(,\r\n]*(,[ \t]*R[ \t]*[01](?![\d.]))"
)
#: Scaling and rotation take other words than those of Fanuc.
_OWN = dict.fromkeys((510, 680), Act.REFUSE) | dict.fromkeys((50, 500, 690), Act.UNCHANGED)

DIALECT = replace(
    ISO,
    name="mazak",
    title="Mazak mills, EIA/ISO programs",
    codes=g_codes(unchanged={*ISO_UNCHANGED, 611}, extra={**ISO_EXTRA, **_OWN}),
    # synchronous taps
    aliases={842: 840, 843: 740},
    text=replace(ISO.text, unread=_SYNCHRONOUS, unread_mark=ord(",")),
    refusals={
        **ISO.refusals,
        680: "G68 turns in the plane or in space, by the series of G codes that is set; post the coordinates",
        921: "G92.1 presets offsets that are not known off line",
        51: "G5.1 is a spline of this control",
    },
    harmless_m=ISO.harmless_m | {10, 11, 50, 51},
    cycles=replace(ISO_CYCLES, levels_stay=True),
    tools_in_block=True,
    radius_holds=True,
    rules=replace(ISO.rules, several="GMT"),
    # G5 switches the high-speed mode; other numbers call cycles
    still_with={50: ("P", frozenset({0.0, 2.0}))},
    path_mode="cutting mode G64 of the control, unless G5 P2 or G61.1 is on",
)
