"""The files of folders: which there are, and what they hold in short, without keeping their bytes."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path

from olp.core.errors import InputError
from olp.files.write import PathLike

#: bytes that are read at once
_PART = 1 << 20


def files_below(folder: PathLike, leave_out: Iterable[PathLike] = ()) -> list[Path]:
    """The files in a folder and in those below it, in the order of their names. Hidden ones are left out, as
    are links to folders and the folders of `leave_out`. Raises InputError where there is no such folder, or
    where one of them may not be read."""
    if not Path(folder).is_dir():
        raise InputError("is no folder; name a folder of programs", file=str(folder))
    left_out = {identity(path) for path in leave_out}
    files = []
    for place, folders, names in os.walk(folder, onerror=_refuse):
        folders[:] = sorted(
            name for name in folders if name[0] != "." and identity(Path(place, name)) not in left_out
        )
        files += [Path(place, name) for name in sorted(names) if name[0] != "."]
    return files


def _refuse(error: OSError) -> None:
    reason = f"may not be read ({error.strerror}); allow it, or leave it out with --exclude"
    raise InputError(reason, file=str(error.filename)) from None


def from_root(path: PathLike) -> Path:
    """The path from the root, without detours; links stay."""
    return Path(os.path.normpath(Path(path).absolute()))


def identity(path: PathLike) -> str:
    """The same text for all names of a file."""
    return os.path.normcase(os.path.realpath(path))


def inside(path: PathLike, folder: PathLike) -> bool:
    """Whether a file or folder is that folder, or is in it."""
    own, other = identity(path), identity(folder)
    return own == other or Path(own).is_relative_to(other)


def digest_of(path: PathLike) -> str | None:
    """SHA-256 of a file in hexadecimal digits, None where it cannot be read."""
    digest = hashlib.sha256()
    try:
        with Path(path).open("rb") as stream:
            while part := stream.read(_PART):
                digest.update(part)
    except (OSError, ValueError):
        return None
    return digest.hexdigest()


def state_of(paths: Iterable[PathLike]) -> dict[str, tuple[int, int] | None]:
    """Size and time of the last change of each file, None where it is not there: what differs after a
    change."""
    result: dict[str, tuple[int, int] | None] = {}
    for path in paths:
        try:
            status = Path(path).stat()
        except OSError:
            result[str(path)] = None
        else:
            result[str(path)] = (status.st_size, status.st_mtime_ns)
    return result
