"""Programs that touch with a probe (G38.2), for one control."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array
from olp.core.units import AXES
from olp.program.rs274.positions import COMMENT_WIDTH, plain_note
from olp.program.rs274.profiles.base import Profile
from olp.program.touches import Touches


def probing_program(profile: Profile, touches: Touches, digits: int, notes: Sequence[str], log: str) -> bytes:
    """Touches in machine coordinates: the last work offset of the control is set to zero and chosen. A
    comment at the top says what is lost by that.

    `digits` are the decimals of words, `notes` become comments. A control that logs writes the file `log`,
    one line for each touch.
    """
    opening, closing = (mark.decode() for mark in profile.comment)
    offset = _LAST_OFFSET[profile.g10_offsets]
    lost = f"Sets work offset {offset} to zero and ends G92: what they held is lost."
    lines = [
        f"{opening}{line}{closing}"
        for note in (lost, *notes)
        for line in textwrap.wrap(plain_note(note), COMMENT_WIDTH)
    ]
    lines += [
        f"{profile.metric} G90 G94 {profile.cleared}",
        "G92.1",
        f"G10 L2 P{profile.g10_offsets} X0 Y0 Z0{' R0' if profile.turns_offsets else ''}",
        offset,
    ]
    logs = profile.touch_log
    if logs:
        lines += [f"(LOGOPEN,{log})", "(LOG,touch,X_mm,Y_mm,Z_mm)"]
    places, number = touches.moves()
    lines.append(f"G0 {_word('Z', touches.clear_mm, digits)}")
    for place, touch in zip(np.round(places, digits), number.tolist(), strict=True):
        if touch < 0:
            lines.append(f"G0 {_words(place, digits)}")
            continue
        lines.append(f"G38.2 {_words(place, digits)} F{touches.feed_mm_min:g}")
        if logs:
            lines.append(f"(LOG,{touches.labels[touch]},#5061,#5062,#5063)")
    lines += ["(LOGCLOSE)"] if logs else []
    return ("\n".join([*lines, "M30"]) + "\n").encode()


#: The word of the last work offset, by its number in G10 L2.
_LAST_OFFSET = {6: "G59", 9: "G59.3"}


def _words(place: Array, digits: int) -> str:
    return " ".join(_word(axis, value, digits) for axis, value in zip(AXES, place.tolist(), strict=True))


def _word(axis: str, value: float, digits: int) -> str:
    return f"{axis}{round(value, digits) + 0.0:.{digits}f}"
