"""A long text that is made part by part, and waits in a temporary file until it is read.

Columns of numbers wait there as well. Their pages are in memory while they are looked at, until `unload`."""

from __future__ import annotations

import contextlib
import hashlib
import io
import mmap
import shutil
import sys
import tempfile
import weakref
from collections.abc import Iterator
from typing import IO

#: Bytes from which a text waits in a file: shorter ones cost less than to read them again.
LONG = 1 << 22
#: Bytes that are read at once.
_PART = 1 << 20
#: Files whose pages are in memory where they were looked at; none, of most programs.
_MAPPED: list[weakref.ref[mmap.mmap]] = []


def unload() -> None:
    """Let go the pages of all mapped files; each comes back where it is looked at again."""
    if _MAPPED and sys.platform != "win32":
        for one in tuple(_MAPPED):
            if (mapped := one()) is not None:
                mapped.madvise(mmap.MADV_DONTNEED)


def room() -> int:
    """The bytes that there is room for in temporary files."""
    try:
        return shutil.disk_usage(tempfile.gettempdir()).free
    except OSError:
        return 0


class Spool:
    """A text that grows at its end; `size` is the number of its bytes. It is in memory while it has fewer
    than `long` bytes, and where the system has no room for a temporary file. The file ends with it."""

    def __init__(self, data: bytes = b"", long: int | None = None) -> None:
        self._long = LONG if long is None else long
        self._file: IO[bytes] = io.BytesIO()
        self._moved = False
        self.size = 0
        if data:
            self.write(data)

    def write(self, data: bytes | memoryview) -> None:
        """Put bytes behind those that are there."""
        if not self._moved and self.size + len(data) >= self._long:
            self._moved = True
            with contextlib.suppress(OSError), contextlib.ExitStack() as unless:
                self._move(unless.enter_context(tempfile.TemporaryFile(buffering=0)))
                weakref.finalize(self, unless.pop_all().close)
        try:
            _put(self._file, self.size, data)
        except OSError:
            self._move(io.BytesIO())
            _put(self._file, self.size, data)
        self.size += len(data)

    def _move(self, file: IO[bytes]) -> None:
        """Go on in another file."""
        at = 0
        for part in self.parts():
            _put(file, at, part)
            at += len(part)
        self._file = file

    def parts(self) -> Iterator[bytes]:
        """The text in parts."""
        at = 0
        while at < self.size:
            self._file.seek(at)
            part = self._file.read(min(_PART, self.size - at))
            yield part
            at += len(part)

    def read(self) -> bytes:
        """The whole text."""
        self._file.seek(0)
        return self._file.read()

    def mapped(self) -> mmap.mmap | memoryview:
        """The whole text without reading it, which may be written over; nothing grows any more. It stays when
        the spool ends."""
        if isinstance(self._file, io.BytesIO):
            return self._file.getbuffer()
        try:
            mapped = mmap.mmap(self._file.fileno(), self.size)
        except OSError:
            raise MemoryError from None
        _MAPPED.append(weakref.ref(mapped, _MAPPED.remove))
        return mapped

    def sha256(self) -> str:
        """The digest of the text."""
        digest = hashlib.sha256()
        for part in self.parts():
            digest.update(part)
        return digest.hexdigest()


def _put(file: IO[bytes], at: int, data: bytes | memoryview) -> None:
    """Write bytes at a place of a file that may take a part of them at a time."""
    file.seek(at)
    rest = memoryview(data)
    while len(rest):
        rest = rest[file.write(rest) :]
