"""Settable offsets that a program writes: $P_UIFR[1]=CTRANS(X,5,Y,6), and $P_UIFR[1,X,TR]=5.

Index 1 is G54, 5 is G505. Source: Siemens, Programming Manual Job Planning, section on predefined frames.
"""

from __future__ import annotations

import re

from olp.core.units import AXES
from olp.program.sinumerik.actions import WriteOffset
from olp.program.sinumerik.blocks import NUMBER, Piece
from olp.program.sinumerik.refusals import refused, unroll

_INDEX = re.compile(r"\$P_UIFR\[(\d+)(?:,([XYZ]),TR)?\]")
_CTRANS = re.compile(rb"CTRANS[ \t]*\(([^()]*)\)", re.IGNORECASE)
#: a rotation by nothing, which some posts put behind the shift
_UNTURNED = re.compile(
    rb"[ \t]*:[ \t]*CROT[ \t]*\([ \t]*(?:[XYZ][ \t]*,[ \t]*[-+]?0*\.?0*[ \t]*,?[ \t]*)*\)", re.IGNORECASE
)
#: index from which names are G505 and on
_FIRST_FURTHER = 5
#: indices, up to that of G599
_MOST = 100


def written_offset(code: bytes, piece: Piece) -> WriteOffset:
    """What an assignment writes. Raises ProgramError, without a line, for other than shifts of X, Y and Z."""
    unturned = _UNTURNED.search(code, piece.value, piece.value_end)
    end = piece.value_end if unturned is None or unturned.end() < piece.value_end else unturned.start()
    found, shift = _INDEX.fullmatch(piece.name), _CTRANS.fullmatch(code, piece.value, end)
    if found is None or not 1 <= int(found[1]) < _MOST or bool(found[2]) == bool(shift):
        raise refused("$P_UIFR")
    values: dict[str, float] = {axis: 0.0 for axis in AXES if shift}
    texts = [code[piece.value : piece.value_end]]
    names = [found[2]]
    if shift is not None:
        parts = [part.strip() for part in shift[1].split(b",")] if shift[1].strip() else []
        names, texts = [name.decode("latin-1").upper() for name in parts[::2]], parts[1::2]
    if len(names) != len(texts) or not set(names) <= set(AXES):
        raise refused("$P_UIFR")
    for name, text in zip(names, texts, strict=True):
        if NUMBER.fullmatch(text) is None:
            raise unroll(f"`{code[piece.start : piece.end].decode('latin-1')}`")
        values[name] = float(text.replace(b" ", b""))
    index = int(found[1])
    x, y, z = (values.get(axis) for axis in AXES)
    return WriteOffset(f"G{53 + index}" if index < _FIRST_FURTHER else f"G{500 + index}", (x, y, z))
