"""Haas mills."""

from __future__ import annotations

from olp.program.rs274.cycles import ISO_CYCLES
from olp.program.rs274.entry import read_blocks, unroll_blocks
from olp.program.rs274.flatten.language import MACRO_B
from olp.program.rs274.profiles.base import ISO_M, REFUSALS, Act, Profile, g_codes
from olp.program.rs274.profiles.iso import ISO_CARRY, ISO_EXTRA

_OFFSETS = dict.fromkeys((1540, *range(1100, 1300, 10)), Act.EVENT)

DIALECT = Profile(
    name="haas",
    title="Haas mills",
    reader=read_blocks,
    unroller=unroll_blocks,
    codes=g_codes(carry={*ISO_CARRY, 1030, 1870}, extra={**ISO_EXTRA, **_OFFSETS}),
    refusals={**REFUSALS, 921: "G92.1 is not a code of this control"},
    harmless_m=ISO_M | {10, 11, 29, 31, 33, 34, 35, 41, 42, 59, 69, 83, 84, 88, 89},
    initial_retract=980,
    increments_without_point=True,
    g10_adds=True,
    cycles_apart=True,
    axis_dwell=True,
    exact_stop=True,
    lengths_along_z=True,
    cycles=ISO_CYCLES,
    language=MACRO_B,
    path_mode="the control's own smoothing (G187)",
    inch_decimals=4,
    free_digits=0,
)
