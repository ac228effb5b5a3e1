"""The dialect of Sinumerik 840D programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType

from olp.core.toolpath import Interpolated
from olp.core.values import dataclass
from olp.program.contours.rules import SINUMERIK_CONTOURS
from olp.program.dialect import SKIP_MARK, Row, Support
from olp.program.rs274.block_text import BlockText
from olp.program.rs274.codes import CUTTER_COMPENSATION
from olp.program.rs274.cycle_rules import ISO_CYCLES
from olp.program.rs274.entry import read_blocks
from olp.program.rs274.flatten.language import MACRO_B
from olp.program.rs274.profiles.base import ISO_M, M_REFUSALS, Act, Profile
from olp.program.sinumerik.entry import asked_of, translate_text, unroll_text
from olp.program.sinumerik.table import HARMLESS_G, ROUNDING_G, statements
from olp.program.text.signs import SINUMERIK

_CODES = {
    **dict.fromkeys((0, 10, 20, 30), Act.MOTION),
    **dict.fromkeys((170, 180, 190), Act.PLANE),
    **dict.fromkeys((900, 910), Act.DISTANCE),
    **dict.fromkeys((930, 940, 950), Act.FEED),
    **dict.fromkeys((40, 200, 210, 400, 530, 540, 550, 560, 570, 610, 640), Act.EVENT),
    # what G41 and G42 do needs the edge of their block, which is an action
    **dict.fromkeys((90, 410, 420, 960, 970), Act.UNCHANGED),
}
#: Codes of the words of this family that programs write otherwise.
_WRITTEN = {200: "G70", 210: "G71", 610: "G60"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Sinumerik(Profile):
    """The profile with the table of its own statements."""

    def with_tips(self, tips: Interpolated) -> Sinumerik:
        tipped = Profile.with_tips(self, tips)
        assert isinstance(tipped, Sinumerik)
        return replace(tipped, translator=partial(translate_text, tips=True))

    def comment_marks(self) -> tuple[tuple[bytes, bytes], ...]:
        return ((b";", b""),)

    def rows(self) -> Sequence[Row]:
        support = {Act.MOTION: Support.CORRECTED, Act.UNCHANGED: Support.UNCHANGED}
        words = [
            Row(_WRITTEN.get(c, f"G{c // 10}"), support.get(act, Support.READ))
            for c, act in sorted(self.codes.items())
            if c not in CUTTER_COMPENSATION
        ]
        words += [Row(f"G{code}", Support.UNCHANGED) for code in sorted(HARMLESS_G)]
        words += [Row(f"G{code}", Support.READ) for code in sorted({700, 710} | ROUNDING_G - {64})]
        return [*words, *(Row(name, kind, why) for name, (kind, why) in statements().items())]


DIALECT = Sinumerik(
    name="sinumerik",
    title="Sinumerik 840D",
    reader=read_blocks,
    unroller=unroll_text,
    expands_cycles=True,
    unrolls_with_tools=False,
    translator=translate_text,
    asks=asked_of,
    signs=SINUMERIK,
    folder_endings=("mpf", "spf", "arc"),
    comment=(b"; ", b""),
    skip_mark=SKIP_MARK,
    first=(b"%_N_", b";$PATH"),
    metric="G71",
    cleared="G40 D0",
    dwell="F",
    written_ending="mpf",
    codes=MappingProxyType(_CODES),
    refusals=MappingProxyType({}),
    harmless_m=ISO_M | {17, *range(40, 46)},
    # M96 and M97 are those of the machine's builder here
    m_refusals=MappingProxyType({code: M_REFUSALS[code] for code in (980, 990)}),
    motion=1,
    initial_retract=980,
    exact_stop=True,
    machine_moves_keep_length=True,
    increments_take_offsets=True,
    lengths_follow_plane=True,
    leads="vector",
    tips_from_zero=True,
    direction_words=(b"A3=", b"B3=", b"C3="),
    further_turns=b"TURN=",
    absolute_centre=b"AC",
    text=BlockText(),
    cycles=ISO_CYCLES,
    contours=SINUMERIK_CONTOURS,
    contours_assumed="NORM and G450 are in force, as the control is delivered: the tool begins beside the "
    "begin of the second move, and goes round outside corners on arcs",
    length_of_spindle_tool=True,
    language=MACRO_B,
    path_mode="G64 of the control, with its own tolerance",
)
