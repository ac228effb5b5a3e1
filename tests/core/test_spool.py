"""A spool gives back what was written, from memory or from a file, and also where a disk is full."""

from __future__ import annotations

import errno
import gc
import hashlib
import io
import re
import tempfile
from typing import IO, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from olp.core import spool
from olp.core.spool import Mapped, Spool


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


@given(
    text=st.text("ab\r\n", min_size=1, max_size=40).map(str.encode),
    wanted=st.text("ab\n", min_size=1, max_size=3).map(str.encode),
    start=st.integers(0, 41), end=st.integers(0, 41) | st.none(), part=st.integers(1, 9),
)  # fmt: skip
def test_a_text_in_a_file_is_as_bytes_are(
    text: bytes, wanted: bytes, start: int, end: int | None, part: int
) -> None:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(spool, "_PART", part)
        patched.setattr(spool, "LONG", 1)
        mapped = spool.text_of(io.BytesIO(text))
        assert isinstance(mapped, Mapped)
        assert spool.whole(mapped) == b"".join(spool.in_parts(mapped)) == text
        assert spool.sha256_of(mapped) == hashlib.sha256(text).hexdigest()
        stated = text[start:end] if end is None or start <= end else b""
        assert mapped.count(wanted, start, end) == stated.count(wanted)
        assert (wanted in mapped) == (wanted in text)
        pattern = re.compile(rb"a+b|\r(?!\n)")
        own = [match.span() for match in spool.matches(pattern, mapped)]
        assert own == [match.span() for match in pattern.finditer(text)]


def test_the_ends_of_a_text_in_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spool, "LONG", 1)
    mapped = Spool(b"%one\n").text()
    assert mapped.startswith(b"%") and not mapped.startswith((b"a", b"b"))
    assert mapped.endswith(b"e\n") and not mapped.endswith(b"%")
    spool.unload()
    assert mapped[:4] == b"%one" and not isinstance(b"short", Mapped) and spool.whole(b"short") == b"short"
    assert list(spool.in_parts(b"")) == [] and list(spool.in_parts(b"short")) == [b"short"]
