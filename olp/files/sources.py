"""The inputs of a run: each file is opened once, and every later reader gets the same bytes."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

from olp.core.errors import OlpError, naming
from olp.files.write import PathLike, read_bytes


class Sources:
    """Reads files and keeps their bytes for a run, so that the whole run uses one state of each file."""

    def __init__(self) -> None:
        self._bytes: dict[Path, bytes] = {}

    def read(self, path: PathLike) -> bytes:
        """The bytes of a file, opened the first time only. Raises InputError where it cannot be read."""
        key = Path(path)
        if key not in self._bytes:
            self._bytes[key] = read_bytes(path)
        return self._bytes[key]

    def read_last(self, path: PathLike) -> bytes:
        """As `read`, for a large file that is not read again: its bytes are no longer kept."""
        known = self._bytes.pop(Path(path), None)
        return read_bytes(path) if known is None else known

    def digest(self, path: PathLike) -> bytes:
        """SHA-256 of a file. Raises as `read`."""
        return hashlib.sha256(self.read(path)).digest()

    def source(self, given: PathLike | bytes | Source) -> Source:
        """A source from what the caller gave. A file is opened when its bytes are first needed."""
        if isinstance(given, Source):
            return given
        if isinstance(given, bytes):
            return Source("", lambda: given)
        return Source(str(given), functools.partial(self.read, given))


@dataclass(frozen=True, slots=True)
class Source:
    """A program or results: a file, or bytes from a caller or a stream. `name` is the path of the file, ""
    for bytes. `data` can be read again and again."""

    name: str
    _read: Callable[[], bytes]

    @staticmethod
    def stream(read: Callable[[], bytes]) -> Source:
        """The contents of a stream, which can be read only once. It is read when it is first needed."""
        return Source("", functools.cache(read))

    def load(self) -> None:
        """Read it now. Raises InputError where it cannot be read."""
        self._read()

    def holding(self, data: bytes) -> Source:
        """The same name with other bytes."""
        return Source(self.name, lambda: data)

    @property
    def data(self) -> bytes:
        return self._read()

    @property
    def short(self) -> str:
        """The name without its folder, as reports state it."""
        return Path(self.name).name if self.name else ""

    def errors(self, role: str | None = None) -> AbstractContextManager[None]:
        """Adds the name of the source to errors that name no file. With `role`, such as "<program>", to all
        of them, and `role` is the name of bytes. Without it, to those with a line, and bytes have no name."""
        return naming(self.name) if role is None else _named(self.name or role)


@contextmanager
def _named(file: str) -> Iterator[None]:
    try:
        yield
    except OlpError as error:
        raise error.in_file(file) from None
