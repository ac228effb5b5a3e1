"""Okuma mills (OSP).

Differs from Fanuc: G15 H selects the work offset, G56 H calls up a tool length along Z and G53 ends it. HA
and DA name the offsets of the tool in the spindle. G54, G55 and G57 to G59 are lengths of other axes. G62
mirrors. The time of G4 is F. Canned cycles return to the level of G71 with M53, and to R with M54. G284 and
G274 are synchronous taps. Parametric programs are user tasks: VC1, CALL, RTS, IF, GOTO. Names of programs
and labels in letters stay.

Source: programming manuals of OSP-E10M, OSP-E100M and OSP-P200M.
"""

from __future__ import annotations

from dataclasses import replace

from olp.core.patterns import pattern
from olp.program.rs274.flatten.language import USER_TASKS
from olp.program.rs274.profiles.base import M_REFUSALS, NO_CODE, Act, g_codes
from olp.program.rs274.profiles.iso import ISO
from olp.program.text.signs import OKUMA

_LACKING = frozenset({382, 383, 384, 385, 280, 980, 990, 520, 920, 540, 550, 560, 570, 580, 590, 640})
_LENGTHS = (540, 550, 570, 580, 590)
#: G10 ends the shift that G11 begins; G9, G23, G60 to G64 are modes of exact stop and limits.
_UNCHANGED = frozenset({90, 100, 230, 640})
_OTHER_BORES = "is a bore with a shift or a stop, which is not read; post its strokes as moves"

DIALECT = replace(
    ISO,
    name="okuma",
    title="Okuma mills (OSP)",
    folder_endings=("min", "nc", "tap"),
    signs=OKUMA,
    keeper=None,
    spindle_words=True,
    zero_ends_length=False,
    radius_holds=True,
    codes=g_codes(
        unchanged=set(_UNCHANGED),
        extra={
            541: Act.EVENT,
            710: Act.EVENT,
            **dict.fromkeys((*_LENGTHS, 110, 620, 870, 1160), Act.REFUSE),
        },
        without=_LACKING - set(_LENGTHS),
    )
    | {640: Act.UNCHANGED, 100: Act.UNCHANGED},
    refusals={
        **{code: why for code, why in ISO.refusals.items() if code not in (281, 301)},
        **{code: f"G{code / 10:g} {_OTHER_BORES}" for code in (760, 870, 880)},
        **{
            code: f"G{code // 10} (tool length along another axis than Z) is not read; use G56"
            for code in _LENGTHS
        },
        1160: "G116 changes the tool by a macro of the machine's builder; post T and M6",
        110: "G11 (shift and rotation of coordinates) is not read; post the coordinates",
        160: "G16 (a work offset for one block) is not read; use G15",
        620: "G62 (mirror image) is not read; post the coordinates",
    },
    aliases={150: 541, 560: 430, 530: 490, 2740: 740, 2840: 840, 541: NO_CODE, 430: NO_CODE, 490: NO_CODE},
    offset_words={541: "H"},
    offset_names={541: "G15"},
    harmless_m=ISO.harmless_m - {48, 49} | {50, 51, 53, 54},
    m_refusals={**M_REFUSALS, 520: "returns cycles to the upper limit of Z, whose position is not known"},
    return_level=710,
    return_modes={53: 980, 54: 990},
    initial_retract=None,
    cycles_apart=False,
    axis_dwell=False,
    dwell_words="F",
    g10_stores=False,
    inert=pattern(rb"[ \t]*(?:\$[^()%]*%?|[ON][A-Z][A-Z0-9]*(?:[ \t]*\([^)]*\))?)[ \t]*"),
    # its user tasks have `X=` as Sinumerik has it
    languages=frozenset({"Okuma OSP", "Sinumerik (Siemens)"}),
    program_number=False,
    language=USER_TASKS,
    path_mode="G64 of the control, unless a high-speed function is on",
)
