"""Replaces one file by a new one, so that a kill at any moment leaves the old file or the new one."""

from __future__ import annotations

import contextlib
import os
import re
import stat
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from olp.core.errors import OlpError
from olp.core.spool import Mapped, Text, in_parts

#: characters of the name of a target in that of its temporary file; a character is up to 4 of its 255 bytes
_NAME_LENGTH = 40
#: s; a temporary file that has not changed for so long is of no run, whatever runs under its number
_STALE_S = 86_400.0

#: s; how long another program, such as a scanner for viruses, may hold a file on Windows
PATIENCE_S = 2.0
#: s between two tries
_PAUSE_S = 0.05
#: Errors of Windows where another program holds a file: access denied, sharing violation, lock violation.
HELD = frozenset((5, 32, 33))

#: Names of the temporary files of this process that are not replaced yet.
_own: set[str] = set()

_Stamp = tuple[int, int, int, int] | None
#: A whole file, or its parts in order.
Content = Text | Iterable[bytes]


def parts_of(content: Content) -> Iterable[bytes]:
    """A file in parts."""
    return in_parts(content) if isinstance(content, bytes | Mapped) else content


class Replacement:
    """A new state of the file `target`, which is written under a temporary name beside it.

    `final` is the file itself where `target` is a link to it, so that the link is kept.
    """

    def __init__(self, target: Path) -> None:
        self.target = target
        self.final = Path(os.path.realpath(target))
        self._before = _stamp(self.final)
        token = f"{os.getpid()}-{os.urandom(4).hex()}"
        self._temporary = self.final.with_name(f"{_prefix(self.final)}{token}.tmp")

    def write(self, data: Content) -> None:
        """Write the new state, with the owner and the mode of the file. Raises OSError, OlpError."""
        _own.add(self._temporary.name)
        with self._temporary.open("xb") as stream:
            stream.writelines(parts_of(data))
            stream.flush()
            os.fsync(stream.fileno())
        if self._before is not None and hasattr(os, "chown"):
            self._keep_owner(self.final.stat())

    def _keep_owner(self, old: os.stat_result) -> None:
        """On Windows the folder decides who may read the file, and a read-only file cannot be removed."""
        new = self._temporary.stat()
        if hasattr(os, "chown") and (new.st_uid, new.st_gid) != (old.st_uid, old.st_gid):
            try:
                os.chown(self._temporary, old.st_uid, old.st_gid)
            except PermissionError:
                raise OlpError(
                    "belongs to another user or group, which a new file would not; remove it first, or name "
                    "another file",
                    file=str(self.target),
                ) from None
        # after the owner, as a change of owner clears bits of the mode
        self._temporary.chmod(stat.S_IMODE(old.st_mode))

    def replace(self, *, force: bool) -> None:
        """Put the new state in place. Raises OSError, and OlpError where the file is not as it was."""
        if _stamp(self.final) != self._before:
            raise self._changed()
        if self._before is None and not force:
            self._create()
        else:
            _patiently(lambda: self._temporary.replace(self.final))
        _own.discard(self._temporary.name)

    def _create(self) -> None:
        """As a file that did not exist: a link fails where one exists by now, and never replaces it."""
        try:
            os.link(self._temporary, self.final)
        except FileExistsError:
            raise self._changed() from None
        except OSError:
            # a file system without links
            _patiently(lambda: self._temporary.replace(self.final))
        else:
            _patiently(self._temporary.unlink)

    def _changed(self) -> OlpError:
        return OlpError(
            "was changed by another program during this call, and is left as it is; look at it, call again",
            file=str(self.target),
        )

    def discard(self) -> None:
        """Remove what is written so far."""
        self._temporary.unlink(missing_ok=True)
        _own.discard(self._temporary.name)


def _patiently(action: Callable[[], object]) -> None:
    """Try again while another program holds the file. Raises OSError where it holds it too long."""
    end = time.monotonic() + PATIENCE_S
    while True:
        try:
            action()
        except PermissionError as error:
            if getattr(error, "winerror", None) not in HELD or time.monotonic() > end:
                raise
            time.sleep(_PAUSE_S)
        else:
            return


def remove_stale(final: Path) -> None:
    """Remove the temporary files that killed runs left beside a target. One that cannot be removed stays."""
    pattern = re.compile(re.escape(_prefix(final)) + r"(\d+)-[0-9a-f]{8}\.tmp")
    with contextlib.suppress(OSError):
        for path in final.parent.iterdir():
            match = pattern.fullmatch(path.name)
            if match is None or path.name in _own:
                continue
            with contextlib.suppress(OSError):
                if time.time() - path.stat().st_mtime > _STALE_S or not _running(int(match[1])):
                    path.unlink()


def _prefix(final: Path) -> str:
    return f".{final.name[:_NAME_LENGTH]}."


def _running(process: int) -> bool:
    """Whether a process may still run. A temporary file of this one that it does not know is a stale one."""
    if process == os.getpid():
        return False
    if os.name == "nt":
        # the question would end the process there
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True
    return True


def _stamp(path: Path) -> _Stamp:
    """What differs after a change of a file; None where there is none."""
    try:
        status = path.stat()
    except FileNotFoundError:
        return None
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns
