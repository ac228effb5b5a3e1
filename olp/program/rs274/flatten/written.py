"""How numbers and strokes of an unrolled program are written."""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Decimal

from olp.core.errors import ProgramError
from olp.core.units import AXES
from olp.program.rs274.cycles import Stroke
from olp.program.rs274.flatten.expressions import whole
from olp.program.rs274.flatten.language import Language


def number_text(value: float, letter: str, language: Language, exact: bool = False) -> str:
    """A number from an expression: 10 significant digits, and no more decimals than the control takes.

    `exact` gives all digits: the centre of an arc with R is the square root of a difference of its ends,
    which loses half of them. Where a number without a point counts least increments, lengths get one.
    """
    if letter in language.counts and letter != "g":
        return str(whole(value, f"the value of {letter.upper()}"))
    if not math.isfinite(value):
        raise ProgramError(f"the value of {letter.upper()} is not finite", code="OLP540")
    most = language.decimals
    decimals = 0 if value == 0 else min(most, max(0, 9 - math.floor(math.log10(abs(value)))))
    text = f"{Decimal(repr(value)):f}" if exact and language.all_digits else f"{value:.{decimals}f}"
    if "." in text:
        text = text.rstrip("0")
    if not language.points or letter == "g":
        text = text.rstrip(".")
    elif "." not in text:
        text += "."
    return text[1:] if text in ("-0", "-0.") else text


def stroke_blocks(
    strokes: Sequence[Stroke], position: list[float], spindle: int | None, language: Language
) -> list[str]:
    """The blocks of strokes in G90, from `position`, where M3 or M4 is in force as `spindle`. Raises
    ProgramError where a cycle turns the spindle round, and it does not turn."""
    lines: list[str] = []
    for stroke in strokes:
        if stroke.kind in ("rapid", "feed"):
            words = [
                AXES[i] + number_text(v, "x", language)
                for i, v in enumerate(stroke.point)
                if not math.isnan(v) and v != position[i]
            ]
            position = list(stroke.point)
            if words:
                lines.append(" ".join(["G0" if stroke.kind == "rapid" else "G1", *words]))
        elif stroke.kind == "dwell":
            if stroke.seconds > 0:
                lines.append("G4 P" + number_text(stroke.seconds, "p", language))
        elif stroke.spindle == "stop":
            lines.append("M5")
        else:
            if spindle not in (3, 4):
                raise ProgramError(
                    "the cycle reverses the spindle, whose direction is not set; give M3 or M4 before",
                    code="OLP532",
                )
            lines.append(f"M{spindle if stroke.spindle == 'restore' else 7 - spindle}")
    return lines
