"""Marlin 2, on printers, and on routers and lasers that run it.

Differs from Klipper: G90 and G91 hold for the extruder too, until M82 or M83. Arcs may have R; their P
counts turns before the arc and is not read. G18 and G19 are options of the firmware, as RS-274 has them.
"""

from __future__ import annotations

from dataclasses import replace

from olp.program.rs274.commands import Commands
from olp.program.rs274.profiles.base import Act
from olp.program.rs274.profiles.printer import PRINTER, PRINTER_CODES, PRINTER_REFUSALS, TEXTS

_MOVING = (120, 260, 270, 310, 320, 330, 340, 350, 420, 610, 760)

DIALECT = replace(
    PRINTER,
    name="marlin",
    brackets_by_option=True,
    title="Marlin 2",
    codes={
        **PRINTER_CODES, **dict.fromkeys(_MOVING, Act.CONTROL), 180: Act.PLANE, 190: Act.PLANE,
        600: Act.UNCHANGED, 800: Act.CONTROL, 60: Act.REFUSE,
        **dict.fromkeys((382, 383, 384, 385), Act.REFUSE),
    },
    refusals={
        **{code: why for code, why in PRINTER_REFUSALS.items() if code not in (180, 190)},
        **{
            code: f"G{code / 10:g} (probing) ends where a signal arrives; measure in a program of its own"
            for code in (382, 383, 384, 385)
        },
    },
    # with a time M18 and M84 say how long the motors stay on
    commands=Commands(text=TEXTS, still_with={18: "S", 84: "S"}, extruder_follows=True, arc_words="IJKR"),
)  # fmt: skip
