"""Texts that may be long. A long one waits in a temporary file, and its pages are in memory while they are
looked at, until `unload`. Columns of numbers wait there as well.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import mmap
import re
import sys
import weakref
from collections.abc import Iterator
from typing import IO, TypeVar

_Kind = TypeVar("_Kind", bound=mmap.mmap)

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
    import shutil
    import tempfile

    try:
        return shutil.disk_usage(tempfile.gettempdir()).free
    except OSError:
        return 0


class Mapped(mmap.mmap):
    """A long text in a temporary file, with what is asked of `bytes`. Nothing changes it."""

    def parts(self) -> Iterator[bytes]:
        """The text in parts."""
        for first in range(0, len(self), _PART):
            yield self[first : first + _PART]
            unload()

    def count(self, sub: bytes, start: int = 0, end: int | None = None) -> int:
        """As of `bytes`."""
        count, end = 0, len(self) if end is None else end
        while start < end:
            stop = min(start + _PART, end)
            part = self[start : min(stop + len(sub) - 1, end)]
            count += part.count(sub)
            # one that reaches into the next part is not counted again
            last = part.rfind(sub, max(stop - start - len(sub) + 1, 0))
            start = stop if last < 0 else max(stop, start + last + len(sub))
            unload()
        return count

    def startswith(self, prefix: bytes | tuple[bytes, ...]) -> bool:
        """As of `bytes`."""
        return self[:_PART].startswith(prefix)

    def endswith(self, suffix: bytes | tuple[bytes, ...]) -> bool:
        """As of `bytes`."""
        return self[-_PART:].endswith(suffix)

    def __contains__(self, sub: object) -> bool:
        return isinstance(sub, bytes) and self.find(sub, 0) >= 0


#: A text in memory, or a long one in a file. Both are sliced, searched and looked at alike.
Text = bytes | Mapped


def whole(text: Text) -> bytes:
    """A text in memory."""
    return text if isinstance(text, bytes) else text[:]


def in_parts(text: Text) -> Iterator[bytes]:
    """A text in parts, which are in memory one by one."""
    return iter((text,) if text else ()) if isinstance(text, bytes) else text.parts()


def sha256_of(text: Text) -> str:
    """The digest of a text."""
    digest = hashlib.sha256()
    for part in in_parts(text):
        digest.update(part)
    return digest.hexdigest()


def matches(pattern: re.Pattern[bytes], text: Text) -> Iterator[re.Match[bytes]]:
    """The places in a text that a pattern matches, each of which stands on one line."""
    if isinstance(text, bytes):
        yield from pattern.finditer(text)
        return
    first = 0
    while first < len(text):
        last = text.find(b"\n", first + _PART) + 1 or len(text)
        yield from pattern.finditer(text, first, last)
        unload()
        first = last


def text_of(file: IO[bytes]) -> Text:
    """The rest of a stream."""
    start = file.read(LONG)
    if len(start) < LONG:
        return start
    spool = Spool(start)
    while part := file.read(_PART):
        spool.write(part)
    return spool.text()


class Spool:
    """A text that grows at its end; `size` is the number of its bytes. It is in memory while it has fewer
    than `long` bytes, and where the system has no room for a temporary file. The file ends with it."""

    def __init__(self, text: Text = b"", long: int | None = None) -> None:
        self._long = LONG if long is None else long
        self._file: IO[bytes] = io.BytesIO()
        self._moved = False
        self._text: Text | None = None
        self.size = 0
        for part in in_parts(text):
            self.write(part)

    def write(self, data: bytes | memoryview) -> None:
        """Put bytes behind those that are there."""
        if not self._moved and self.size + len(data) >= self._long:
            import tempfile

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

    def text(self) -> Text:
        """The whole text; a long one stays in its file. Nothing grows any more."""
        if self._text is None:
            short = isinstance(self._file, io.BytesIO)
            self._text = self.read() if short else self._map(Mapped, mmap.ACCESS_READ)
        return self._text

    def mapped(self) -> mmap.mmap | memoryview:
        """The whole text without reading it, which may be written over; nothing grows any more. It stays when
        the spool ends."""
        if isinstance(self._file, io.BytesIO):
            return self._file.getbuffer()
        return self._map(mmap.mmap)

    def _map(self, kind: type[_Kind], access: int = mmap.ACCESS_DEFAULT) -> _Kind:
        try:
            mapped = kind(self._file.fileno(), self.size, access=access)
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
