"""Drilling cycles of Sinumerik controls: the strokes of CYCLE81 to CYCLE89 behind the motion of a block.

Pecks are not made one by one: they lie on the line of the stroke. Source: Siemens, Programming Manual Cycles.
"""

from __future__ import annotations

from collections.abc import Sequence

from olp.core.errors import ProgramError
from olp.core.toolpath import Kind
from olp.program.rs274.flatten.language import UNROLL
from olp.program.rs274.translation import NOWHERE, Drilling, Span
from olp.program.sinumerik.blocks import NUMBER, Piece, argument_spans, arguments

#: Arguments of the level to which the tool goes back, of the one from which a hole begins, and of its bottom.
_RTP = 0
_RFP = 1
_DP = 3
#: Cycles that come back to the safety distance at a feed.
_FEED_BACK = frozenset({"CYCLE84", "CYCLE840", "CYCLE85", "CYCLE89"})
#: Where the argument is that says whether the depth is a position or a distance (AMODE), and the one before
#: the last of these three (GMODE), which refers it to a diameter.
_MODES = {
    "CYCLE81": 8,
    "CYCLE82": 8,
    "CYCLE83": 19,
    "CYCLE84": 23,
    "CYCLE840": 19,
    "CYCLE85": 10,
    "CYCLE86": 13,
}
#: CYCLE86: arguments RPA, RPO and RPAP, by which the tool leaves the wall of the hole.
_LIFT_OFF = slice(7, 10)


def called(code: bytes, start: int, call: Piece, cycle: Piece, *, always: bool = False) -> Drilling:
    """A cycle that is called from a piece on, in a line that begins at byte `start`. Raises as `drilling`."""
    spans = [(start + a, start + b) for a, b in argument_spans(code, cycle)]
    text = start + call.start, start + cycle.end
    return drilling(cycle.name, arguments(code, cycle), always=always, text=text, spans=spans)


def drilling(
    name: str,
    arguments: Sequence[bytes],
    *,
    always: bool = False,
    text: Span = NOWHERE,
    spans: Sequence[Span] = (),
) -> Drilling:
    """The strokes of a cycle, whose call is the bytes `text`, with the `spans` of its arguments.

    Raises ProgramError, without a line, for arguments that are no numbers, and for cycles whose strokes they
    do not give."""
    values = [_number(name, text) for text in arguments[:5]]
    rtp, rfp, sdis, dp, dpr = [*values, *[None] * 5][:5]
    dp, dpr = _stated(name, arguments, dp, dpr)
    if rtp is None or rfp is None or (dp is None and dpr is None):
        raise ProgramError(
            f"{name} needs RTP, RFP, and DP or DPR as its first, second, fourth and fifth argument",
            code="OLP531",
        )
    if name == "CYCLE86" and any(_number(name, text) for text in arguments[_LIFT_OFF]):
        raise ProgramError(
            "CYCLE86 moves the tool off the wall of the hole inside the control; program it without RPA, RPO "
            "and RPAP",
            code="OLP544",
        )
    if dpr is not None:
        bottom = rfp - abs(dpr) if dp is None or dp < rfp else rfp + abs(dpr)
        if dp is not None and abs(bottom - dp) > 1e-9:
            raise ProgramError(
                f"{name} states its depth twice: DP {dp:g} and DPR {dpr:g} from RFP {rfp:g}; give one",
                code="OLP531",
            )
    else:
        assert dp is not None
        bottom = dp
    if bottom == rfp:
        raise ProgramError(f"{name} has no depth: its bottom is at RFP {rfp:g}", code="OLP531")
    clear = rfp + abs(sdis or 0.0) * (1.0 if bottom < rfp else -1.0)
    strokes = [(Kind.RAPID, clear), (Kind.LINE, bottom)]
    if name in _FEED_BACK:
        strokes.append((Kind.LINE, clear))
    if rtp != strokes[-1][1]:
        strokes.append((Kind.RAPID, rtp))
    levels = (NOWHERE, NOWHERE, NOWHERE)
    if spans:
        levels = (spans[_RTP], spans[_RFP], spans[_DP] if dp is not None else NOWHERE)
    return Drilling(name, tuple(strokes), always, text, levels)


def _stated(
    name: str, arguments: Sequence[bytes], dp: float | None, dpr: float | None
) -> tuple[float | None, float | None]:
    """DP and DPR of a cycle, None for the one that does not count. Where both are given, one
    that is 0 is none."""
    last = _MODES.get(name, len(arguments))
    tail = [_number(name, text) or 0.0 for text in arguments[max(last - 2, 0) : last + 1]]
    if len(arguments) > last - 2 and last in _MODES.values():
        shank, plane, mode = [*tail, 0.0, 0.0, 0.0][:3]
        if shank or plane % 10 > 1:
            raise ProgramError(
                f"{name} refers its depth to a diameter, or selects another plane; program its tip and G17",
                code="OLP544",
            )
        if (mode % 10 == 1 and not dpr) or (mode % 10 == 2 and dp is None):
            raise ProgramError(
                f"AMODE of {name} says where its depth is, and there is none: 1 takes DPR, 2 takes DP",
                code="OLP531",
            )
        if mode % 10:
            return (dp or None, dpr) if mode % 10 == 1 else (dp, dpr or None)
    if dpr == 0.0 and dp is not None:
        return dp, None
    return (None, dpr) if dpr and dp == 0.0 else (dp, dpr)


def _number(name: str, text: bytes) -> float | None:
    if not text:
        return None
    if NUMBER.fullmatch(text) is None:
        raise ProgramError(
            f"`{text.decode('latin-1')}` of {name} uses parameters or expressions", hint=UNROLL, code="OLP511"
        )
    return float(text.replace(b" ", b""))
