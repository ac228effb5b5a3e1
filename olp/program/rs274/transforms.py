"""Rotation, scaling and mirror images that a program switches on: G68, G51 and G51.1 of ISO controls.

After each change the position in the program is not known until it is stated: controls take a move of one
axis there in different ways. So the axes that a transform moves count as unknown until then.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from olp.core.errors import ProgramError
from olp.core.turns import about_z, rows_of
from olp.program.rs274.codes import MIRROR, ROTATION, SCALING, UNDOES, UNDONE_BY
from olp.program.rs274.flatten.language import UNROLL
from olp.program.rs274.offset_state import OffsetState, Word
from olp.program.rs274.offsets import Transform

#: Largest and smallest factor of a scaling.
_FACTORS = (1e-3, 1e4)


def change(
    state: OffsetState,
    code: int,
    line: int,
    by_letter: Mapping[str, Word],
    axis_words: Sequence[tuple[int, Word]],
) -> tuple[int, ...]:
    """Switch a transform on or off in the state; returns the axes whose positions are not known then."""
    now = state.offsets.transform
    if code in UNDOES:
        off = now is not None and UNDOES[code] == now.code
        new = _less(now, [i for i, _ in axis_words]) if off and now is not None else now
    else:
        _check(state, code, line)
        new = _MADE[code](state, line, by_letter, axis_words)
    if new == now:
        return ()
    state.offsets.transform = new
    return tuple(sorted({axis for transform in (now, new) if transform for axis in transform.axes}))


def _check(state: OffsetState, code: int, line: int) -> None:
    """Refuse transforms of which it is not certain what the control makes."""
    now, name = state.offsets.transform, f"G{code / 10:g}"
    if not state.absolute:
        raise _refusal(f"{name} in G91 depends on a parameter of the control; give G90 before it", line)
    if now is not None and not now.code == code == MIRROR:
        raise _refusal(
            f"{name} comes in addition to G{now.code / 10:g}, and how they add up is not certain; give "
            f"{state.profile.name_of(UNDONE_BY[now.code])} before it",
            line,
        )


def _rotation(
    state: OffsetState, line: int, by_letter: Mapping[str, Word], axis_words: Sequence[tuple[int, Word]]
) -> Transform | None:
    """G68 X Y R: about a centre, counter-clockwise."""
    if state.plane != 170:
        raise _refusal("G68 is read in the plane of X and Y only; give G17 before it", line)
    if set(by_letter) & {"I", "J", "K", "Z"}:
        raise _refusal("G68 with I, J, K or Z turns in space, which is not read; give X, Y and R", line)
    if "R" not in by_letter:
        raise _refusal("G68 without R turns by a setting of the control; give R", line)
    _check_centre("G68", "XY", by_letter, state, line)
    angle = by_letter["R"]
    if not angle.pointed and angle.value and state.profile.increments_without_point:
        raise _refusal(
            "R of G68 has no decimal point, so a parameter of the control decides what it counts; write the "
            "point",
            line,
        )
    if not angle.value % 360.0:
        return None
    x, y = (state.length_mm(by_letter[letter]) for letter in "XY")
    return Transform(ROTATION, rows_of(about_z(angle.value)), (x, y, 0.0), (0, 1))


def _check_centre(
    name: str, letters: str, by_letter: Mapping[str, Word], state: OffsetState, line: int
) -> None:
    """Refuse a centre that is not stated: the present position is another one in a corrected program."""
    given = [letter for letter in letters if letter in by_letter]
    if not given:
        unroll = UNROLL if state.profile.unroller is not None else "give it"
        none = f"{', '.join(letters[:-1])} and {letters[-1]}"
        raise ProgramError(
            f"{name} without {none} takes the present position for its centre",
            hint=unroll,
            line=line,
            code="OLP511",
        )
    if len(given) < len(letters):
        missing = next(letter for letter in letters if letter not in given)
        raise _refusal(f"{name} has no {missing} for its centre, which is not certain then; give it", line)


def _scaling(
    state: OffsetState, line: int, by_letter: Mapping[str, Word], axis_words: Sequence[tuple[int, Word]]
) -> Transform | None:
    """G51 X Y Z P, or with a factor per axis: I, J, K."""
    _check_centre("G51", "XYZ", by_letter, state, line)
    letters = ("P",) if "P" in by_letter else ("I", "J", "K") if state.profile.scales_axes else ()
    if not letters or not set(letters) <= set(by_letter):
        own = "P, or I, J and K" if state.profile.scales_axes else "P"
        raise _refusal(f"G51 without its factors takes a setting of the control; give {own}", line)
    factors = [_factor(state, by_letter[letter], line) for letter in letters]
    scale = factors * 3 if len(factors) == 1 else factors
    if scale == [1.0, 1.0, 1.0]:
        return None
    x, y, z = (state.length_mm(word) for _, word in axis_words)
    axes = tuple(axis for axis in range(3) if scale[axis] != 1.0)
    return Transform(SCALING, rows_of(np.diag(scale)), (x, y, z), axes)


def _factor(state: OffsetState, word: Word, line: int) -> float:
    """A factor as the control counts it: with a decimal point, or in units that a parameter sets."""
    unit = state.setup.machine.scaling_unit
    factor = word.value
    if state.profile.scales_by_parameter:
        if word.pointed:
            raise _refusal(
                f"{word.letter} of G51 has a decimal point, which this control does not take; write an "
                "integer",
                line,
            )
        if unit is None:
            raise _refusal(
                f"{word.letter} of G51 counts in units that a parameter of the control sets; give "
                "scaling_unit in the machine file, 0.001 or 0.00001",
                line,
                "OLP541",
            )
        factor *= unit
    elif not word.pointed:
        raise _refusal(
            f"{word.letter} of G51 has no decimal point, so what it counts is not certain; write it", line
        )
    if not _FACTORS[0] <= abs(factor) <= _FACTORS[1]:
        raise _refusal(
            f"G51 scales by {factor:g}; expected a factor from {_FACTORS[0]:g} to {_FACTORS[1]:g}", line
        )
    return factor


def _mirror(
    state: OffsetState, line: int, by_letter: Mapping[str, Word], axis_words: Sequence[tuple[int, Word]]
) -> Transform | None:
    """G51.1 X Y Z: mirrored at these coordinates, beside axes that are mirrored already."""
    now = state.offsets.transform
    at_zero, name = state.profile.mirrors_at_zero, state.profile.name_of(MIRROR)
    if not axis_words:
        raise _refusal(f"{name} needs X, Y or Z, the coordinate of its mirror", line)
    if at_zero and any(word.value for _, word in axis_words):
        raise _refusal(f"{name} mirrors at the zero of the work offset; give its axes with 0, as in X0", line)
    if at_zero and any(state.offsets.local):
        raise _refusal(f"where {name} mirrors under G52 is not known; give G52 X0 Y0 Z0 before it", line)
    about = [0.0] * 3 if now is None else list(now.about)
    axes = set() if now is None else set(now.axes)
    for axis, word in axis_words:
        about[axis] = state.length_mm(word)
        axes.add(axis)
    return _mirrored(axes, about)


def _mirrored(axes: set[int], about: Sequence[float]) -> Transform | None:
    if not axes:
        return None
    turn = np.diag([-1.0 if axis in axes else 1.0 for axis in range(3)])
    x, y, z = (about[axis] if axis in axes else 0.0 for axis in range(3))
    return Transform(MIRROR, rows_of(turn), (x, y, z), tuple(sorted(axes)))


def _less(now: Transform, axes: Sequence[int]) -> Transform | None:
    """The transform once it is switched off, for some axes where it is a mirror image."""
    if now.code != MIRROR or not axes:
        return None
    return _mirrored(set(now.axes) - set(axes), now.about)


def _refusal(why: str, line: int, code: str = "OLP518") -> ProgramError:
    return ProgramError(why, line=line, code=code)


_MADE = {ROTATION: _rotation, SCALING: _scaling, MIRROR: _mirror}
