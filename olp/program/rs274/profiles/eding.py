"""Eding CNC mills.

Differs from LinuxCNC: whether I, J and K are positions is a setting, as is the return of cycles before G98
or G99. Lines of MSG show a text. Whether contours have the corners of LinuxCNC under G41 and G42 is not
known, so these are refused, as are programs with SUB, IF and WHILE.

Source: what the posts of Fusion 360, Estlcam and SheetCAM write for this control. What they do not write is
refused.
"""

from __future__ import annotations

from dataclasses import replace

from olp.core.patterns import pattern
from olp.program.rs274.codes import CUTTER_COMPENSATION
from olp.program.rs274.profiles.base import ISO_M, M_REFUSALS, REFUSALS, Act, g_codes
from olp.program.rs274.profiles.mach3 import DIALECT as MACH3
from olp.program.rs274.profiles.words import OPEN_CONTOURS

#: None of the codes that its posts write.
_UNWRITTEN = frozenset({100, 382, 383, 384, 385, 520, 730, 740, 840, 901, 911, 930, 960, 970})
_CONTOURS = {code: OPEN_CONTOURS[code] for code in (410, 420)}

DIALECT = replace(
    MACH3,
    name="eding",
    title="Eding CNC mills",
    folder_endings=("nc", "cnc", "tap"),
    unroller=None,
    keeper=None,
    codes=g_codes(
        unchanged={500, 690},
        extra=dict.fromkeys((591, 592, 593), Act.EVENT) | dict.fromkeys(_CONTOURS, Act.REFUSE),
        without=_UNWRITTEN | (CUTTER_COMPENSATION - _CONTOURS.keys()),
    ),
    refusals={**REFUSALS, **_CONTOURS},
    aliases={},
    harmless_m=ISO_M - {19, 48, 49},
    m_refusals=M_REFUSALS,
    g52_is_g92=False,
    g10_offsets=0,
    length_of_spindle_tool=True,
    numbers_hold=False,
    offset_words={},
    offsets_alone=frozenset(),
    inert=pattern(rb'[ \t]*(?:[Nn][ \t]*\d+[ \t]*)?(?i:MSG)[ \t]*"[^"\r\n]*"[ \t]*(?:;[^\r\n]*)?'),
    path_mode="the look-ahead of the control, unless G61 is on",
    written_ending="cnc",
)
