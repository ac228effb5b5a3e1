"""A spool gives back what was written, from memory or from a file, and also where a disk is full."""

from __future__ import annotations

import errno
import gc
import hashlib
import io
import tempfile
from typing import IO, Any

import pytest

from olp.core import spool
from olp.core.spool import Spool


class Full(io.BytesIO):
    """A file with room for so many bytes, which takes three at a time."""

    room = 8

    def write(self, data: Any) -> int:
        free = self.room - self.tell()
        if free <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(bytes(data[: min(3, free)]))


def no_file(**_: Any) -> IO[bytes]:
    raise OSError(errno.EROFS, "Read-only file system")


@pytest.mark.parametrize("file", ["memory", "disk", "none", 0, 3, 8, 9, 100])
def test_a_spool_gives_back_what_was_written(file: str | int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spool, "_PART", 5)
    if file != "memory":
        monkeypatch.setattr(spool, "LONG", 6)
    if file == "none":
        monkeypatch.setattr(tempfile, "TemporaryFile", no_file)
    elif isinstance(file, int):
        monkeypatch.setattr(Full, "room", file)
        monkeypatch.setattr(tempfile, "TemporaryFile", lambda **_: Full())
    text = Spool(b"abc")
    expected = b"abc"
    for part in (b"de", b"", b"fghijkl", memoryview(b"mn")):
        text.write(part)
        expected += part
        assert text.read() == b"".join(text.parts()) == expected
        assert text.size == len(expected)
    assert text.sha256() == hashlib.sha256(expected).hexdigest()


def test_a_long_spool_is_in_a_file_which_ends_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[IO[bytes]] = []
    real = tempfile.TemporaryFile
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda **how: made.append(real(**how)) or made[-1])
    monkeypatch.setattr(spool, "LONG", 4)
    text = Spool(b"abc")
    assert not made
    text.write(b"d")
    (file,) = made
    file.seek(0)
    assert file.read() == b"abcd"
    del text
    gc.collect()
    assert file.closed
