"""The inputs of a run: every reader gets the same bytes of a file.

A long text is let go while nothing needs it, and read again where it is asked for."""

from __future__ import annotations

import functools
import hashlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from olp.core import spool
from olp.core.errors import InputError, OlpError, naming
from olp.core.paired import data_beside, joined
from olp.core.spool import Spool
from olp.core.values import dataclass
from olp.files.write import PathLike, read_bytes


class Sources:
    """Reads files and keeps their bytes for a run, so that the whole run uses one state of each file. Of one
    that is let go it keeps the digest, and refuses another state of it."""

    def __init__(self) -> None:
        self._bytes: dict[Path, bytes] = {}
        self._digests: dict[Path, bytes] = {}
        self._opened: dict[str, None] = {}
        self._there: set[Path] = set()
        self._absent: set[Path] = set()

    @property
    def files(self) -> tuple[str, ...]:
        """The paths from the root of the files that were opened so far, in that order."""
        return tuple(self._opened)

    def read(self, path: PathLike) -> bytes:
        """The bytes of a file, opened the first time only, and again where it was let go. Raises InputError
        where it cannot be read, or is not as it was."""
        key = Path(path)
        if key not in self._bytes:
            self._opened[str(Path(path).absolute())] = None
            data = read_bytes(path)
            if self._digests.get(key) not in (None, hashlib.sha256(data).digest()):
                what = "was changed by another program during this call; look at it, and call again"
                raise InputError(what, file=str(path))
            self._bytes[key] = data
        return self._bytes[key]

    def let_go(self, path: PathLike) -> None:
        """Keep of a long file that was read only its digest; it is read again where it is asked for."""
        key = Path(path)
        data = self._bytes.get(key, b"")
        if len(data) >= spool.LONG:
            self._digests[key] = self._digests.get(key) or hashlib.sha256(data).digest()
            del self._bytes[key]

    def read_last(self, path: PathLike) -> bytes:
        """As `read`, for a large file that is not read again: its bytes are no longer kept."""
        self._opened[str(Path(path).absolute())] = None
        known = self._bytes.pop(Path(path), None)
        return read_bytes(path) if known is None else known

    def exists(self, path: PathLike) -> bool:
        """Whether a file is there."""
        there = Path(path) in self._were_read() or Path(path).is_file()
        (self._there if there else self._absent).add(Path(path))
        return there

    def there(self) -> frozenset[str]:
        """The names in a parcel of files that are there and were not read."""
        return frozenset(in_parcel(path) for path in self._there - self._were_read().keys())

    def parcel(self) -> dict[str, bytes | None]:
        """What was read by now, under the names that a parcel has for it; None for files that were asked for
        and are not there."""
        read: dict[str, bytes | None] = {in_parcel(path): self.read(path) for path in self._were_read()}
        return {in_parcel(path): None for path in self._absent} | read

    def _were_read(self) -> dict[Path, None]:
        """The files that were read by now."""
        return dict.fromkeys((*self._bytes, *self._digests))

    def digest(self, path: PathLike) -> bytes:
        """SHA-256 of a file. Raises as `read`."""
        return hashlib.sha256(self.read(path)).digest()

    def source(self, given: PathLike | bytes | Source) -> Source:
        """A source from what the caller gave. A file is opened when its bytes are first needed."""
        if isinstance(given, Source):
            return given
        if isinstance(given, bytes):
            return Source("", lambda: given)
        part = functools.partial
        return Source(str(given), part(self._whole, given), part(self.let_go, given))

    def _whole(self, path: PathLike) -> bytes:
        """A program with its data, where these are in a file beside it."""
        data = data_beside(Path(path))
        if data is None or not self.exists(data):
            return self.read(path)
        return joined(self.read(path), self.read(data), data.name)


def in_parcel(path: PathLike) -> str:
    """The name of a file in a parcel: its path without detours."""
    return os.path.normpath(path)


def _keep() -> None:
    """What a caller keeps is not let go."""


class Wanted(Exception):
    """A parcel lacks the file `path`: whoever made it knows whether the file is there."""

    def __init__(self, path: str) -> None:
        super().__init__(path)
        self.path = path


class Parcel(Sources):
    """Files that have travelled as bytes: nothing is read from a disk. None stands for a file that is not
    there; files of `there` are, and were not sent. A file that is not in the parcel raises Wanted where it is
    needed. `used` are those that were asked for."""

    def __init__(self, files: Mapping[str, bytes | None], there: Iterable[str] = ()) -> None:
        super().__init__()
        self._files = files
        self._known = frozenset(there)
        self.used: set[str] = set()

    def read(self, path: PathLike) -> bytes:
        """The bytes of a file. Raises InputError where it is not there, Wanted where that is not known."""
        data = self._look(path)
        if data is None:
            raise InputError("no such file; check the path", file=str(path))
        return data

    def read_last(self, path: PathLike) -> bytes:
        """As `read`."""
        return self.read(path)

    def exists(self, path: PathLike) -> bool:
        """Whether a file is there. Raises Wanted where that is not known."""
        return in_parcel(path) in self._known or self._look(path) is not None

    def _look(self, path: PathLike) -> bytes | None:
        name = in_parcel(path)
        self.used.add(name)
        try:
            return self._files[name]
        except KeyError:
            raise Wanted(name) from None


class _Held:
    """A text that has no file of its own, and waits in a spool where it is let go."""

    def __init__(self, first: Callable[[], bytes], spool: Spool | None = None) -> None:
        self._first, self._spool = first, spool
        self._data: bytes | None = None

    def read(self) -> bytes:
        """The text; that of a stream is read when it is first needed."""
        if self._data is None:
            self._data = self._first() if self._spool is None else self._spool.read()
        return self._data

    def let_go(self) -> None:
        """Keep a long text in its spool only."""
        if self._data is not None and len(self._data) >= spool.LONG:
            self._spool = self._spool or Spool(self._data)
            self._data = None


@dataclass(frozen=True, slots=True)
class Source:
    """A program or results: a file, or bytes from a caller or a stream. `name` is the path of the file, ""
    for bytes. `data` can be read again and again; `let_go` frees its memory until then."""

    name: str
    _read: Callable[[], bytes]
    let_go: Callable[[], None] = _keep

    @staticmethod
    def stream(read: Callable[[], bytes]) -> Source:
        """The contents of a stream, which can be read only once. It is read when it is first needed."""
        held = _Held(read)
        return Source("", held.read, held.let_go)

    @staticmethod
    def made(text: Spool) -> Source:
        """A text that was made here."""
        held = _Held(text.read, text)
        return Source("", held.read, held.let_go)

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
