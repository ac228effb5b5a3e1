"""A program whose contours under cutter compensation became the path of the tool."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from olp.core.arrays import Index
from olp.program.contours.rules import ContourRules
from olp.program.program import ArcSlots, Program


def with_tool_path(program: Program, rules: ContourRules) -> Program:
    """The program with the path of the tool, where it has contours of a known radius. Raises ProgramError
    where the control refuses them."""
    path = program.toolpath
    if not (path.offset_by_radius() and (path.compensated_radius_mm() > 0).any()):
        return program
    from olp.program.contours.tool_path import follow

    done = follow(path, rules)
    last = np.searchsorted(done.block, np.arange(len(path)), "right") - 1
    # the first move behind n moves of the text comes behind as many of the tool
    behind = np.concatenate(([0], last + 1))
    slot = program.slot
    if len(slot):
        slot = np.where(done.corner[:, None], -1, slot[done.block]).astype(slot.dtype)
    holes = replace(
        program.holes, first=behind[program.holes.first], last=behind[program.holes.last]
    )  # fmt: skip
    called = replace(program.called, strokes=last[program.called.strokes])
    captures = tuple(replace(c, moves=int(behind[c.moves])) for c in program.captures)
    return replace(
        program, toolpath=done.path, slot=slot, arc_slots=_arc_slots(program, done.path.arcs.move, last),
        holes=holes, called=called, captures=captures, programmed=program, blocks=done.block,
    )  # fmt: skip


def _arc_slots(program: Program, move: Index, last: Index) -> ArcSlots:
    """The words of the arcs of the tool's path, none of those about corners."""
    given = program.arc_slots
    if program.words is None:
        return given
    at = np.searchsorted(move, last[program.toolpath.arcs.move])
    word = np.full((len(move), 5), -1, given.word.dtype)
    absolute = np.zeros(len(move), bool)
    word[at], absolute[at] = given.word, given.absolute
    return ArcSlots(word, absolute)
