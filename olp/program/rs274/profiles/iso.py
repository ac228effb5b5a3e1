"""What Fanuc, Haas and compatible ISO controls have in common."""

from __future__ import annotations

from dataclasses import replace

from olp.core.patterns import pattern
from olp.program.contours.rules import ISO_CONTOURS
from olp.program.rs274.block_rules import ISO_RULES
from olp.program.rs274.block_text import PRINTS, BlockText, counting
from olp.program.rs274.cycle_rules import ISO_CYCLES
from olp.program.rs274.entry import keep_blocks, read_blocks, unroll_blocks
from olp.program.rs274.flatten.language import MACRO_B
from olp.program.rs274.profiles.base import ISO_M, M_REFUSALS, REFUSALS, Act, Profile

#: G codes without effect on the path on these controls.
ISO_UNCHANGED = frozenset({80, 90, 150, 501, 620, 630, 670, 691, 131, 231, 250})
#: G44, G54.1, rotation and scaling, fine and back bores; G92.1 needs offsets that are not known off line.
ISO_EXTRA = {
    **dict.fromkeys((760, 870), Act.MOTION),
    **dict.fromkeys((440, 541, 500, 510, 680, 690), Act.EVENT),
    **dict.fromkeys((411, 421, 921), Act.REFUSE),
}
#: `:1234` is another way to write the number of a program.
STILL_LINES = rb"[ \t]*:[ \t]*\d+[ \t]*(?:\([^)]*\)[ \t]*)?|" + PRINTS + b"|"

#: What they have in common; each control states its name, its codes, and where it differs.
ISO = Profile(
    name="iso",
    title="ISO controls of mills",
    reader=read_blocks,
    folder_endings=("nc", "tap", "cnc", "eia"),
    unroller=unroll_blocks,
    keeper=keep_blocks,
    codes={},
    refusals={
        **REFUSALS,
        411: "G41.1 (normal direction control) turns a rotary axis",
        421: "G42.1 (normal direction control) turns a rotary axis",
    },
    harmless_m=ISO_M,
    m_refusals={**M_REFUSALS, 1980: "calls a subprogram of another store; call it by M98"},
    initial_retract=980,
    increments_without_point=True,
    program_number=True,
    g10_adds=True,
    g10_stores=False,
    cycles_apart=True,
    axis_dwell=True,
    dwell_words="PXU",
    exact_stop=True,
    lengths_along_z=True,
    numbers_hold=True,
    zero_ends_length=True,
    text=BlockText(inner_brackets=True),
    inert=pattern(STILL_LINES + counting(rb"[1-9]\d\d")),
    cycles=ISO_CYCLES,
    contours=ISO_CONTOURS,
    language=replace(MACRO_B, calls_at_q=True),
    rules=ISO_RULES,
    path_mode="not stated",
    contours_assumed="start-up of type A is assumed, with the tool beside the begin of the second move, and "
    "that outside corners are extended",
    inch_decimals=4,
    free_digits=0,
)
