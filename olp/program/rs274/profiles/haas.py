"""Haas mills."""

from __future__ import annotations

from dataclasses import replace

from olp.core.patterns import pattern
from olp.program.rs274.block_text import counting
from olp.program.rs274.codes import HOLE_PATTERNS, MIRROR
from olp.program.rs274.cycle_rules import HAAS_CYCLES
from olp.program.rs274.flatten.language import MACRO_B
from olp.program.rs274.profiles.base import NO_CODE, Act, g_codes
from olp.program.rs274.profiles.iso import ISO, ISO_EXTRA, ISO_UNCHANGED, STILL_LINES

_OFFSETS = dict.fromkeys((1540, *range(1100, 1300, 10)), Act.EVENT)
#: G77 bores from below, and with G87 an operator leaves the bore; G70 to G72 make patterns of holes. Where
#: G12 and G13 enter and leave the circle, and how they step out from I to K by Q, manuals show in a picture.
_INSIDE = {
    120: "cuts a circular pocket", 130: "cuts a circular pocket", 470: "engraves text", 1500: "cuts a pocket"
}  # fmt: skip
#: G101 and G100 switch mirror images on and off.
_MIRROR = {MIRROR: Act.EVENT, 501: Act.EVENT}
_CYCLES = {770: Act.MOTION, **dict.fromkeys((700, 710, 720, 870, *_INSIDE), Act.REFUSE)}
#: The next generation control numbers common variables from 10000, and knows these older numbers of them.
_COMMON_AGAIN = (range(100, 200), range(500, 700), range(800, 1000))
_AROUND = "makes holes around the present position inside the control"
_ALONG = "G72 makes holes along a line inside the control; post each hole with its place"

DIALECT = replace(
    ISO,
    name="haas",
    title="Haas mills",
    codes=g_codes(
        unchanged={*ISO_UNCHANGED, 1030, 1870}, extra={**ISO_EXTRA, **_OFFSETS, **_CYCLES, **_MIRROR}
    ),
    aliases={1010: MIRROR, 1000: 501, MIRROR: NO_CODE},
    mirrors_at_zero=True,
    # D00 cancels the D before it, says the list of address codes in the manual
    radius_holds=True,
    refusals={
        **ISO.refusals,
        921: "G92.1 is not a code of this control",
        870: "G87 waits for the operator inside the cycle",
        **{code: f"G{code // 10} {_AROUND}" for code in HOLE_PATTERNS},
        720: _ALONG,
        **{
            code: f"G{code // 10} {what} inside the control; post the moves" for code, what in _INSIDE.items()
        },
    },
    # a mill states the limit of its spindle as G92 S or a setting
    lathe_words={280: ("UW", "sends both slides home"), 500: ("S", "limits the spindle")},
    harmless_m=ISO.harmless_m | {10, 11, 29, 31, 33, 34, 35, 41, 42, 59, 69, 83, 84, 88, 89},
    g10_tools=frozenset({10, 11, 12, 13}),
    further_offsets=("G154", "G54.1"),
    first_further=110,
    tip_codes=frozenset({2340}),
    cycles=HAAS_CYCLES,
    inert=pattern(STILL_LINES + counting(rb"(?:10\d|[1-9])\d\d")),
    # the manual 96-8000 says of L of G65 that arguments are set on the first repetition only
    language=replace(MACRO_B, hole_patterns=True, common_again=_COMMON_AGAIN, repeats_keep_locals=True),
    path_mode="the control's own smoothing (G187)",
)
