"""Fanuc and compatible ISO controls."""

from __future__ import annotations

from olp.program.rs274.cycles import ISO_CYCLES
from olp.program.rs274.entry import read_blocks, unroll_blocks
from olp.program.rs274.flatten.language import MACRO_B
from olp.program.rs274.profiles.base import ISO_M, REFUSALS, Act, Profile, g_codes
from olp.program.rs274.profiles.iso import ISO_CARRY, ISO_EXTRA

DIALECT = Profile(
    name="fanuc",
    title="Fanuc and compatible ISO controls (system A words of mills)",
    reader=read_blocks,
    unroller=unroll_blocks,
    codes=g_codes(carry={*ISO_CARRY, 51, 110}, extra={**ISO_EXTRA, 51: Act.CARRY}),
    refusals={**REFUSALS, 921: "G92.1 presets offsets that are not known off line"},
    harmless_m=ISO_M | {10, 11, 29, 13, 88, 89},
    initial_retract=980,
    increments_without_point=True,
    feed_without_point=True,
    g10_adds=True,
    cycles_apart=True,
    axis_dwell=True,
    exact_stop=True,
    lengths_along_z=True,
    cycles=ISO_CYCLES,
    language=MACRO_B,
    path_mode="cutting mode G64 of the control, unless a smoothing mode is on",
    inch_decimals=4,
    free_digits=0,
)
