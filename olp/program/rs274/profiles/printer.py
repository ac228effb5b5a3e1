"""What firmwares of printers have in common: lines are commands, and an extruder feeds along.

Sources: `G-code` pages and sources of Marlin 2 and Klipper; each says where it differs.
"""

from __future__ import annotations

from collections.abc import Mapping

from olp.program.rs274.block_rules import BlockRules
from olp.program.rs274.block_text import BlockText
from olp.program.rs274.commands import Commands
from olp.program.rs274.cycle_rules import NGC_CYCLES
from olp.program.rs274.entry import read_blocks
from olp.program.rs274.flatten.language import PLAIN_NGC
from olp.program.rs274.profiles.base import Act, Profile
from olp.program.text import signs

#: What printers make of G codes. G10 and G11 retract, G60 stores a position, G80 ends a mode.
PRINTER_CODES: Mapping[int, Act] = {
    **dict.fromkeys((0, 10, 20, 30), Act.MOTION),
    **dict.fromkeys((40, 210, 920), Act.EVENT),
    **dict.fromkeys((900, 910), Act.DISTANCE),
    **dict.fromkeys((280, 290, 300), Act.CONTROL),
    170: Act.PLANE,
    **dict.fromkeys((100, 110), Act.UNCHANGED),
    **dict.fromkeys((50, 200, 530, 540, 550, 560, 570, 580, 590), Act.REFUSE),
}
PRINTER_REFUSALS: Mapping[int, str] = {
    50: "G5 is a spline; post straight moves and arcs",
    60: "G6 moves steppers by themselves; post straight moves and arcs",
    180: "G18 (arcs in ZX) is not read on this control; post arcs in XY",
    190: "G19 (arcs in YZ) is not read on this control; post arcs in XY",
    200: "G20 (inches) is an option of the firmware; post millimetres",
    530: "G53 (machine positions) is an option of the firmware; post positions on the bed",
    **{
        code: f"G{code // 10} (work offsets) is an option of the firmware; post positions on the bed"
        for code in range(540, 600, 10)
    },
}
_MOVES_ZERO = "moves the zero of the axes; give it in the settings of the firmware, and its effect in the job"
#: M codes that change what positions mean.
PRINTER_M_REFUSALS: Mapping[int, str] = {
    920: "sets steps per millimetre, so positions mean something else behind it; set them in the firmware",
    2060: _MOVES_ZERO,
    2180: f"(offset of a nozzle) {_MOVES_ZERO}",
    2900: f"(babysteps) {_MOVES_ZERO}",
    4250: "changes how the control takes up backlash; set it in the firmware before measuring",
    4280: _MOVES_ZERO,
    6650: "belongs to machines without linear axes",
    6660: "belongs to machines without linear axes",
    8520: "changes how the control corrects squareness; set it in the firmware before measuring",
}
#: M codes that move no axis on either firmware: temperatures, fans, limits, messages, files, lights.
PRINTER_M = frozenset({
    0, 1, 3, 4, 5, 7, 8, 9, 10, 11, 16, 17, 20, 21, 27, 31, 36, 42, 73, 74, 75, 76, 77, 78, 80, 82, 83, 85,
    86, 87, 100, 104, 105, 106, 107, 108, 109, 110, 111, 113, 114, 115, 117, 118, 119, 120, 121, 123, 126,
    127, 128, 129, 140, 141, 143, 145, 149, 150, 154, 155, 163, 164, 165, 166, 190, 191, 192, 193, 200, 201,
    203, 204, 205, 207, 208, 209, 211, 220, 221, 226, 240, 250, 255, 256, 260, 261, 281, 282, 300, 301, 302,
    304, 305, 309, 350, 355, 400, 403, 404, 405, 406, 407, 412, 413, 420, 430, 486, 500, 503, 504, 512, 524,
    540, 555, 569, 572, 575, 592, 593, 851, 862, 871, 876, 900, 906, 907, 910, 911, 912, 913, 914, 919, 942,
})  # fmt: skip
#: Checks of the printer before a print, M862.1 to M862.6, ten times their number.
PRINTER_M_TENTHS = frozenset(range(8621, 8627))
#: M codes whose parameters are texts: messages, file names, names of objects and printers.
TEXTS = frozenset({16, 23, 28, 30, 32, 115, 117, 118, 486, 862, 928})
#: M codes that wait until the motion has ended.
_WAITING = frozenset({0, 1, 109, 190, 191, 226, 400})

#: Both have these, and each states its name, what names of commands it has, and where it differs.
PRINTER = Profile(
    name="printer",
    title="Firmwares of printers",
    reader=read_blocks,
    folder_endings=("gcode", "gco", "g"),
    codes=PRINTER_CODES,
    refusals=PRINTER_REFUSALS,
    harmless_m=PRINTER_M,
    harmless_m_tenths=PRINTER_M_TENTHS,
    m_refusals=PRINTER_M_REFUSALS,
    m_with_motion=PRINTER_M - _WAITING,
    initial_retract=None,
    written_ending="gcode",
    dwell_ms=True,
    dwell_words="PS",
    text=BlockText(odd_bytes=None, cr_ends_line=True, open_comments=True, brackets=False),
    rules=BlockRules(needs={920: "XYZE"}),
    commands=Commands(text=TEXTS, extruder_follows=True, arc_words="IJ"),
    cycles=NGC_CYCLES,
    language=PLAIN_NGC,
    comment=(b"; ", b""),
    first=(b";FLAVOR|; HEADER|;GENERATED|; GENERATED",),
    signs=signs.PRINTER,
    path_mode="junctions of the firmware: it rounds corners by the speed that it may jump by",
)
