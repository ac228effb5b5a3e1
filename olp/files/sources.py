"""The inputs of a run: every reader gets the same bytes of a file.

A long text is copied to a temporary file, so that the run has one state of it that takes no memory."""

from __future__ import annotations

import functools
import hashlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path

from olp.core.errors import InputError, OlpError, ProgramError, Reason, Refused, naming
from olp.core.paired import data_beside, joined, system_of, system_part, with_system
from olp.core.projects import FileLines, gathered, holds_several, is_one_of_many
from olp.core.spool import Mapped, Spool, Text, in_parts, whole
from olp.core.values import dataclass
from olp.files.write import PathLike, read_bytes, read_long


class Sources:
    """Reads files and keeps their bytes for a run, so that the whole run uses one state of each file."""

    def __init__(self) -> None:
        self._texts: dict[Path, Text] = {}
        self._opened: dict[str, None] = {}
        self._there: set[Path] = set()
        self._absent: set[Path] = set()
        self._programs: dict[str, bytes | None] = {}

    @property
    def files(self) -> tuple[str, ...]:
        """The paths from the root of the files that were opened so far, in that order."""
        return tuple(self._opened)

    def text(self, path: PathLike) -> Text:
        """The text of a file, opened the first time only. Raises InputError where it cannot be read."""
        key = Path(path)
        if key not in self._texts:
            self._opened[str(Path(path).absolute())] = None
            self._texts[key] = read_long(path)
        return self._texts[key]

    def read(self, path: PathLike) -> bytes:
        """As `text`, in memory."""
        return whole(self.text(path))

    def read_last(self, path: PathLike) -> bytes:
        """As `read`, for a large file that is not read again: its bytes are no longer kept."""
        self._opened[str(Path(path).absolute())] = None
        known = self._texts.pop(Path(path), None)
        return read_bytes(path) if known is None else whole(known)

    def exists(self, path: PathLike) -> bool:
        """Whether a file is there."""
        there = Path(path) in self._texts or Path(path).is_file()
        (self._there if there else self._absent).add(Path(path))
        return there

    def listed(self, folder: Path, ending: str) -> list[Path]:
        """The files of a folder that have an ending, by name."""
        return sorted(path for path in folder.glob("*") if path.suffix.lower() == ending)

    def there(self) -> frozenset[str]:
        """The names in a parcel of files that are there and were not read."""
        return frozenset(in_parcel(path) for path in self._there - self._texts.keys())

    def parcel(self) -> dict[str, bytes | None]:
        """What was read by now, under the names that a parcel has for it; None for files that were asked for
        and are not there."""
        read: dict[str, bytes | None] = {in_parcel(path): self.read(path) for path in self._texts}
        return {in_parcel(path): None for path in self._absent} | read

    def digest(self, path: PathLike) -> bytes:
        """SHA-256 of a file. Raises as `read`."""
        digest = hashlib.sha256()
        for part in in_parts(self.text(path)):
            digest.update(part)
        return digest.digest()

    def source(
        self, given: PathLike | Text | Source, made_from: PathLike | Text | Source | None = None
    ) -> Source:
        """A source from what the caller gave. A file is opened when its bytes are first needed. One that was
        `made_from` another program runs with the data of the same control, wherever it lies."""
        if isinstance(given, Source):
            return given
        if isinstance(given, bytes | Mapped):
            return Source("", lambda: given)
        other = None if made_from is None else self.source(made_from)
        return Source(str(given), functools.partial(self._whole, given, other))

    def _whole(self, path: PathLike, made_from: Source | None = None) -> Text:
        """A program with its data, where these are in a file beside it, or with all files of its project."""
        if is_one_of_many(Path(path)):
            name = in_parcel(path)
            if name not in self._programs:
                self._programs[name] = gathered(Path(path), self)
            text = self._programs[name]
            return self.text(path) if text is None else text
        data = data_beside(Path(path))
        if data is None:
            return self.text(path)
        there = self.exists(data)
        own = joined(self.read(path), self.read(data), data.name) if there else self.text(path)
        system = system_of(Path(path), self.listed)
        if system is not None:
            return with_system(whole(own), self.read(system), system.name)
        further = b"" if made_from is None else system_part(made_from.data)
        return whole(own) + further if further else own


def in_parcel(path: PathLike) -> str:
    """The name of a file in a parcel: its path without detours."""
    return os.path.normpath(path)


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

    def text(self, path: PathLike) -> Text:
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

    def listed(self, folder: Path, ending: str) -> list[Path]:
        """Those that are in the parcel."""
        known = (Path(name) for name, data in self._files.items() if data is not None)
        there = in_parcel(folder)
        return sorted(
            path for path in known if in_parcel(path.parent) == there and path.suffix.lower() == ending
        )

    def _look(self, path: PathLike) -> bytes | None:
        name = in_parcel(path)
        self.used.add(name)
        try:
            return self._files[name]
        except KeyError:
            raise Wanted(name) from None


@dataclass(frozen=True, slots=True)
class Source:
    """A program or results: a file, or bytes from a caller or a stream. `name` is the path of the file, ""
    for bytes."""

    name: str
    _read: Callable[[], Text]

    @staticmethod
    def stream(read: Callable[[], Text]) -> Source:
        """The contents of a stream, which can be read only once. It is read when it is first needed."""
        return Source("", functools.cache(read))

    @staticmethod
    def made(text: Spool) -> Source:
        """A text that was made here."""
        return Source("", text.text)

    def load(self) -> None:
        """Read it now. Raises InputError where it cannot be read."""
        self._read()

    def holding(self, data: Text) -> Source:
        """The same name with other bytes."""
        return Source(self.name, lambda: data)

    @property
    def data(self) -> Text:
        return self._read()

    @property
    def short(self) -> str:
        """The name without its folder, as reports state it."""
        return Path(self.name).name if self.name else ""

    def errors(self, role: str | None = None) -> AbstractContextManager[None]:
        """Adds the name of the source to errors that name no file. With `role`, such as "<program>", to all
        of them, and `role` is the name of bytes. Without it, to those with a line, and bytes have no name. A
        line in one of several files that are read as one text is counted in its own."""
        own = naming(self.name) if role is None else _named(self.name or role)
        return _placed(self, own)


@contextmanager
def _placed(source: Source, own: AbstractContextManager[None]) -> Iterator[None]:
    with own:
        try:
            yield
        except OlpError as error:
            may = not source.name or is_one_of_many(Path(source.name))
            # gathered once: an error may have thousands of reasons
            text = source.data if may and error.line is not None else b""
            if holds_several(text):
                places = FileLines(text)
                for each in (error, *(error.others if isinstance(error, ProgramError) else ())):
                    each.file, each.line = _own_place(source, places, each.file, each.line)
                if isinstance(error, Refused):
                    error.reasons = tuple(_own_reason(source, places, reason) for reason in error.reasons)
            raise


def _own_place(
    source: Source, places: FileLines, file: str | None, line: int | None
) -> tuple[str | None, int | None]:
    """The file of a line of a text and its number there; unchanged where it is one of the first file."""
    if line is None or file is not None:
        return file, line
    name, own = places.of(line)
    if not name:
        return file, line
    return str(Path(source.name).with_name(name)) if source.name else name, own


def _own_reason(source: Source, places: FileLines, reason: Reason) -> Reason:
    file, line = _own_place(source, places, reason.file, reason.line)
    follows_file, follows = _own_place(source, places, reason.follows_file, reason.follows)
    return replace(reason, file=file, line=line, follows_file=follows_file, follows=follows)


@contextmanager
def _named(file: str) -> Iterator[None]:
    try:
        yield
    except OlpError as error:
        raise error.in_file(file) from None
