"""What the name of a file means to the system: devices of Windows, letters that it drops, paths too long."""

from __future__ import annotations

import os
from pathlib import PureWindowsPath

#: Whether the system is Windows.
WINDOWS = os.name == "nt"
#: The device of Windows that swallows what is written to it; it may be written to, by this name alone.
_NULL = "NUL"
#: Names of devices of Windows, with any ending and in any folder.
_DEVICES = frozenset((
    *("CON", "PRN", "AUX", _NULL, "CONIN$", "CONOUT$"),
    *(f"{kind}{digit}" for kind in ("COM", "LPT") for digit in "123456789\u00b9\u00b2\u00b3"),
))  # fmt: skip
#: Letters that no name of Windows has.
_REFUSED = frozenset('<>"|?*')
#: Characters of a path, with its last zero, that Windows takes where long paths are not turned on.
_LONGEST = 260


def wrong_on_windows(path: str) -> str:
    """Why Windows would not write to the file of that name, but elsewhere or nowhere; "" where it would."""
    pure = PureWindowsPath(path)
    if pure.name.upper() == _NULL:
        return ""
    if str(pure).startswith("\\\\.\\"):
        return "is a device of Windows; take the name of a file"
    for part in pure.parts[bool(pure.anchor) :]:
        stem = part.partition(".")[0].rstrip(" ").upper()
        if stem in _DEVICES:
            return f"has the name of a device of Windows ({stem}); take another name"
        if part not in (".", "..") and part.endswith((".", " ")):
            return f"has a part that ends in a point or a blank ({part!r}), which Windows drops; leave it out"
        letter = next((c for c in part if c in _REFUSED or c == ":" or c < " "), None)
        if letter is not None:
            return f"has a letter that no name on Windows has ({letter!r}); take another name"
    return ""


def not_found(path: str, *, windows: bool = WINDOWS) -> str:
    """What a message says of a file that is not there, with what is likely wrong with its path."""
    length = len(os.path.realpath(path)) if windows else 0
    if length >= _LONGEST:
        return (
            f"no such file, or its path of {length} characters is too long for Windows; turn on long paths "
            "there, or move the file up"
        )
    if not windows and "\\" in path:
        return "no such file; write the path with / between folders, as all systems read it"
    return "no such file; check the path"
