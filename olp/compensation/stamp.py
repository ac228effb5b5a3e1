"""The stamp of a program: a comment in front of it, by which a second correction is refused.

`olp-corrected` marks a program with its corrections, `olp-real-time` one without that needs them from the
control. Both name the calibration.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from olp.core.errors import AlreadyCorrected
from olp.core.patterns import pattern
from olp.core.spool import Text, matches
from olp.core.version import __version__

#: The stamp with the first digits of the hash of the calibration.
_STAMP = pattern(rb"olp-corrected ([0-9a-f]{12})")
#: What stands behind it: the version, and the codes of the doubts that were accepted.
_ACCEPTED = pattern(_STAMP.pattern + rb" olp \S+ accepted((?: OLP[0-9]{3})+)")

#: The stamp of a program for a control that corrects in real time.
_REAL_TIME = pattern(rb"olp-real-time ([0-9a-f]{12})")


def find_real_time(text: Text) -> re.Match[bytes] | None:
    """The stamp in a text that needs its corrections from the control."""
    return next(matches(_REAL_TIME, text), None)


def find_stamp(text: Text) -> re.Match[bytes] | None:
    """The stamp in a text that is corrected already."""
    return next(matches(_STAMP, text), None)


def line_of(text: Text, stamp: re.Match[bytes]) -> int:
    """The line of a stamp in its text."""
    return text.count(b"\n", 0, stamp.start()) + 1


def refuse_second(text: Text) -> None:
    """Raises AlreadyCorrected for a text that has the stamp of a correction."""
    stamp = find_stamp(text)
    if stamp is not None:
        raise AlreadyCorrected(
            f"the program has the stamp `{stamp.group().decode()}` of a correction; a second one would apply "
            "the model twice; correct the nominal program",
            line=line_of(text, stamp),
            code="OLP560",
        )


def is_of(stamp: re.Match[bytes], digest: str) -> bool:
    """Whether a stamp is that of the calibration with this hash."""
    return digest.startswith(stamp.group(1).decode())


def accepted_in(text: Text, digest: str | None) -> frozenset[str]:
    """The codes of doubts that the stamp of a corrected text accepts for the calibration with this hash: they
    were accepted for that one alone. Without a calibration (None) every stamp holds."""
    stamp = next(matches(_ACCEPTED, text), None)
    if stamp is None or not (digest is None or is_of(stamp, digest)):
        return frozenset()
    return frozenset(stamp.group(2).decode().split())


def stamp_line(
    digest: str, comment: tuple[bytes, bytes], accepted: Sequence[str] = (), *, real_time: bool = False
) -> bytes:
    """The stamp for the calibration with this hash and the codes of `accepted` doubts, between the marks of a
    comment; `real_time`: the control corrects by it, the program does not."""
    before, after = comment
    kind = "olp-real-time" if real_time else "olp-corrected"
    words = [kind, digest[:12], "olp", __version__, *(["accepted", *accepted] if accepted else [])]
    return before + " ".join(words).encode() + after


def stamped(text: bytes, stamp: bytes, eol: bytes, first: tuple[bytes, ...]) -> bytes:
    """The text with the stamp as a new line in front, behind lines that have to be `first`, such as a tape
    mark and a program number: one of each kind, in this order."""
    position = 3 if text[:3] == b"\xef\xbb\xbf" else 0
    for beginnings in first:
        if text[position : position + 40].lstrip(b" \t").upper().startswith(tuple(beginnings.split(b"|"))):
            position = _line_after(text, position)
    return text[:position] + stamp + eol + text[position:]


def _line_after(text: bytes, position: int) -> int:
    end = text.find(b"\n", position)
    return len(text) if end < 0 else end + 1
