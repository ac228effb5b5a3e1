"""The languages of parametric RS-274 programs: O-words of LinuxCNC, Custom Macro B, user tasks of Okuma."""

from __future__ import annotations

from dataclasses import replace

from olp.core.values import dataclass
from olp.program.rs274.flatten import expressions
from olp.program.rs274.flatten.expressions import Arithmetic

#: What to do where the unroller helps.
UNROLL = "unroll the program with --flatten"


@dataclass(frozen=True, slots=True, kw_only=True)
class Language:
    """How the parametric programs of a control are read, and how plain blocks are written for it.

    - `macro_b`: IF, WHILE, DO, END and GOTO control the run without O-words, and the right side of an
      assignment needs no brackets. Variables are numbered as in Macro B: #1 to #33 local, vacant until set.
    - `user_tasks`: variables have names, words take their value behind `=`, and CALL runs a subprogram.
    - `common_again`: common variables with a second number, 10,000 more; #10000 to #10999 are common then.
    - `modal_variables`: #4001 to #4010 and #4107 to #4120 have what is in force before a block.
    - `work_offsets`: #5221 and on have the work offsets G54 and on, which a program in Macro B may set.
      `hole_patterns`: G70 and G71 make holes around a centre.
    - `tool_variables`: #5400 to #5410 and #5220 have the tool in the spindle and the work offset in force.
    - `corners`: what rounds or chamfers a corner between two moves (`,r`, `,c`).
    - `saved_modes`: M70 to M73 save and restore modal codes. `profile_cycles`: G70 to G72 name a subprogram.
    - `splines`: G5 to G5.3 are splines, and `@` and `^` radius and angle.
    - `repeats_keep_locals`: G65 with L sets its arguments for the first repetition only.
    - `counts_in_p`: P of M98 has the count in front of four digits of the number. `shared_locals`: M98 keeps
      the local variables of its caller. `calls_none`: L0 of M98 calls nothing. `calls_at_q`: Q of M98 is the
      block at which the subprogram begins, in the same program without P.
    - `increments_open`: the unit of a number without a point is not known off line. `rounds_words`: ROUND in
      a word rounds to the least increment, which is not known either.
    - Numbers are written with at most `decimals`, or with `all_digits` where that is needed; `counts` are
      letters of integers, `points` whether others get a point.
    """

    arithmetic: Arithmetic
    macro_b: bool
    user_tasks: bool = False
    common_again: tuple[range, ...] = ()
    modal_variables: bool
    work_offsets: bool = False
    hole_patterns: bool = False
    tool_variables: bool = False
    corners: frozenset[str] = frozenset()
    saved_modes: bool
    profile_cycles: bool
    splines: bool
    counts_in_p: bool
    shared_locals: bool
    repeats_keep_locals: bool = False
    calls_none: bool
    calls_at_q: bool = False
    increments_open: bool
    rounds_words: bool = False
    decimals: int
    all_digits: bool
    counts: frozenset[str]
    points: bool


NGC = Language(
    arithmetic=expressions.NGC, macro_b=False, work_offsets=True, tool_variables=True, modal_variables=False,
    saved_modes=True, profile_cycles=True, splines=True, counts_in_p=False, shared_locals=False,
    calls_none=True, increments_open=False, decimals=12, all_digits=True, counts=frozenset(), points=False,
)  # fmt: skip
#: Without splines, radius and angle, cycles with a profile and saved modes, as other controls have RS-274.
PLAIN_NGC = replace(
    NGC, splines=False, work_offsets=False, tool_variables=False, profile_cycles=False, saved_modes=False
)
MACRO_B = Language(
    arithmetic=expressions.MACRO_B, macro_b=True, work_offsets=True, modal_variables=True, saved_modes=False,
    profile_cycles=False, splines=False, counts_in_p=True, shared_locals=True, calls_none=False,
    increments_open=True, rounds_words=True, decimals=4, all_digits=False, counts=frozenset("gmnpltdhos"),
    points=True, corners=frozenset({",r", ",c"}),
)  # fmt: skip
USER_TASKS = replace(
    MACRO_B, arithmetic=expressions.USER_TASKS, user_tasks=True, modal_variables=False, work_offsets=False,
       corners=frozenset(), counts_in_p=False, counts=frozenset("ghmnosdt"),
)  # fmt: skip
