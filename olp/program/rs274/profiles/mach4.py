"""Mach4 mills.

Differs from Mach3: further offsets G54.1 P, which G10 L20 writes; a local offset G52 of its own; G44; macros
as those of Fanuc; units by G20 and G21 alone. Settings of arcs and cycles are as in Mach3.

Source: the mill G-code programming guide of Mach4.
"""

from __future__ import annotations

from dataclasses import replace

from olp.program.rs274.flatten.language import MACRO_B
from olp.program.rs274.profiles.base import ARC_DISTANCE, M_REFUSALS, Act, g_codes
from olp.program.rs274.profiles.mach3 import DIALECT as MACH3

DIALECT = replace(
    MACH3,
    name="mach4",
    title="Mach4 mills",
    codes=g_codes(
        unchanged={90, 150, 500, 670, 690},
        extra={**ARC_DISTANCE, **dict.fromkeys((440, 541, 921, 922, 923), Act.EVENT)},
        without=frozenset({382, 383, 384, 385, 740, 840}),
    ),
    aliases={},
    m_refusals=M_REFUSALS,
    g52_is_g92=False,
    g10_stores=False,
    offset_words={**MACH3.offset_words, 541: "P"},
    language=replace(
        MACRO_B,
        modal_variables=False,
        work_offsets=False,
        counts_in_p=False,
        increments_open=False,
        rounds_words=False,
    ),
)
