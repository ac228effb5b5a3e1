"""Siemens Sinumerik in ISO mode (G291), mills.

Differs from Fanuc: G290 changes to Siemens's own language and is refused, G291 stays. G54 P is the further
work offset that Fanuc calls G54.1 P. G5.1 is not read.

Source: function manual "ISO dialects" of Sinumerik 840D sl, 828D and 802D sl.
"""

from __future__ import annotations

from dataclasses import replace

from olp.program.rs274.flatten.language import MACRO_B
from olp.program.rs274.profiles.base import Act, g_codes
from olp.program.rs274.profiles.iso import ISO, ISO_EXTRA, ISO_UNCHANGED

#: The unit of the factors of G51 is a setting.
_OWN = {2900: Act.REFUSE, 510: Act.REFUSE, 500: Act.UNCHANGED}

DIALECT = replace(
    ISO,
    name="siemens-iso",
    title="Siemens Sinumerik in ISO mode (G291), mills",
    languages=frozenset({"Sinumerik (Siemens)"}),
    folder_endings=("mpf", "spf", "nc"),
    codes=g_codes(unchanged={*ISO_UNCHANGED, 2910}, extra={**ISO_EXTRA, **_OWN}),
    refusals={
        **ISO.refusals,
        921: "G92.1 presets offsets that are not known off line",
        2900: "G290 changes to the language of Siemens, which is not read in this dialect; post for ISO mode",
    },
    offset_words={**ISO.offset_words, 540: "P"},
    offset_names={540: "G54.1"},
    offsets_alone=frozenset({540}),
    # which variables have the offsets there is not stated
    # what a chamfer takes there is a setting
    language=replace(MACRO_B, work_offsets=False, corners=frozenset({",r"})),
    path_mode="G64 of the control, unless a compressor or a smoothing mode is on",
)
