"""The present position as the centre of G68 and G51, where the program states none.

Fanuc and Haas controls turn and scale about the position before the block then. A corrected program stands
elsewhere, so the unroller states the position of the program.
"""

from __future__ import annotations

from collections.abc import Sequence

from olp.program.rs274.codes import ABSOLUTE, INCREMENTAL, ROTATION, SCALING
from olp.program.rs274.flatten.state import ProgramState, Value
from olp.program.rs274.profiles.base import Act

#: The letters of the centre, by code.
LETTERS = {ROTATION: "xy", SCALING: "xyz"}


def centre(words: Sequence[Value], state: ProgramState) -> tuple[int, dict[str, float]] | None:
    """The code of a block that takes the present position for its centre, and that position by letter, in
    program units; None for other blocks. Raises ProgramError where it is not known."""
    codes = state.codes(words)
    code = next((code for code in LETTERS if code in codes), None)
    if code is None or state.profile.codes.get(code) is not Act.EVENT:
        return None
    absolute = ABSOLUTE in codes or (state.absolute and INCREMENTAL not in codes)
    letters = LETTERS[code]
    if not absolute or any(letter in letters for letter, _ in words):
        return None
    return code, {letter: state.position_of("xyz".index(letter)) for letter in letters}
