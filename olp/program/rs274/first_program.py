"""The first program of a new machine: a square and a circle in the air, in the middle of the travel.

Where a setting of the control that no block changes says what I and J count from, it is the square alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from olp.core.machine import Machine
from olp.core.units import AXES
from olp.program.rs274.profiles.base import Act, Profile

#: Modes that the program states, and their codes.
_MODES = (("G90", 900), ("G94", 940), ("G17", 170))
_G54 = 540
_CENTRES_AS_DISTANCES = 911
#: mm/min; slow enough to follow by eye.
_FEED = 600.0
#: Share of the travel on either side of its middle that the square takes.
_SHARE = 0.5
#: mm; half a side, and height: more is not needed to see that it works.
_MOST_HALF_MM = 50.0
_MOST_HEIGHT_MM = 20.0
#: mm; less room shows nothing.
_LEAST_MM = 1.0


def first_program(profile: Profile, machine: Machine, offset: str = "G54") -> bytes | None:
    """A program that runs along a square and a circle in it, in the middle of the travel. None where the
    travel is too short, or the work offset is turned. No tool length and no spindle is switched on."""
    frame = machine.work_offsets[offset]
    travel = [machine.axes[axis].travel_mm for axis in AXES]
    half = _round(min(_SHARE * 0.5 * (high - low) for low, high in travel[:2]), _MOST_HALF_MM)
    height = _round(_SHARE * 0.5 * (travel[2][1] - travel[2][0]), _MOST_HEIGHT_MM)
    if half is None or height is None or any(frame.rotation_deg):
        return None
    middle = [
        round(0.5 * (low + high) - zero) for (low, high), zero in zip(travel, frame.offset_mm, strict=True)
    ]
    opening, closing = (mark.decode() for mark in profile.comment)
    lines = ["%", "O0001"] if profile.program_number else []
    centres_open = profile.arc_distance is None
    circle = not centres_open or _CENTRES_AS_DISTANCES in profile.codes
    lines += [f"{opening}square of {2 * half:g} mm{' and circle' if circle else ''} in the air{closing}"]
    # codes that the control has, each in its own line where lines are commands
    modes = [profile.metric] if 210 in profile.codes else []
    modes += [word for word, code in _MODES if code in profile.codes]
    modes += ["G91.1"] if centres_open and circle else []
    lines += modes if profile.commands is not None else [" ".join(modes)]
    lines += ["G64 P0.01"] if profile.path_tolerance else []
    lines += [offset] if profile.codes.get(_G54) is Act.EVENT else []
    lines += _moves(middle, half, height, circle=circle)
    lines += ["M30"] if profile.commands is None else []
    return ("\n".join([*lines, *(["%"] if profile.program_number else [])]) + "\n").encode()


def _moves(middle: Sequence[float], half: float, height: float, *, circle: bool) -> list[str]:
    """A square, and a circle that touches its sides."""
    left, right = _word(middle[0] - half), _word(middle[0] + half)
    near, far = _word(middle[1] - half), _word(middle[1] + half)
    low, high = _word(middle[2] + 0.5 * height), _word(middle[2] + height)
    begin = [f"G0 Z{high}", f"G0 X{left} Y{near}", f"G1 Z{low} F{_word(_FEED)}"]
    square = [f"G1 X{right}", f"G1 Y{far}", f"G1 X{left}", f"G1 Y{near}"]
    inside = [f"G0 X{right} Y{_word(middle[1])}", f"G1 Z{low}", f"G2 I{_word(-half)}", f"G0 Z{high}"]
    return [*begin, *square, f"G0 Z{high}", *(inside if circle else [])]


def _word(value: float) -> str:
    """A number with its decimal point, which some controls need."""
    return f"{value + 0.0:.3f}".rstrip("0")


def _round(value: float, most: float) -> float | None:
    """The largest of 1, 2, 5 times a power of ten that is not above a length or `most`; None if it is too
    short."""
    if value < _LEAST_MM:
        return None
    power = 10.0 ** math.floor(math.log10(value) + 1e-9)
    return min(most, max(step * power for step in (1.0, 2.0, 5.0) if step * power <= value * (1.0 + 1e-9)))
