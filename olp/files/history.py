"""The history of an output folder: what was written there from what, and what was released.

It is the file NAME.history.jsonl beside the folder NAME, with one JSON object per line. Lines are appended
and never changed. A line is written before the files that it tells of: a run that is killed between leaves
files that the next one knows as its own.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from olp.core.errors import CannotCompute, InputError, OlpError, UsageError
from olp.core.values import dataclass
from olp.files.folders import digest_of, from_root
from olp.files.write import PathLike, make_folder, write_bytes

SCHEMA = "olp-history-1"


@dataclass(frozen=True, slots=True)
class Record:
    """One line on a program. `output` is the path of its correction below the output folder. `key` stands for
    version, options and the files that the call names. `inputs` and `outputs` are SHA-256 digests by path:
    of all files that were read (None: not there), from the folder of the history, and of what was written,
    from the output folder. `setup` says how the program was called, `row` is its row of the summary."""

    output: str
    key: str
    inputs: Mapping[str, str | None]
    outputs: Mapping[str, str]
    setup: Mapping[str, Any]
    row: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class ReleaseLine:
    """One line on a release: its name, the day that was given, the digest of its archive, and the corrected
    programs in it by path with their digests."""

    name: str
    date: str | None
    sha256: str
    programs: Mapping[str, str]


@contextmanager
def writing(folder: PathLike) -> Iterator[None]:
    """The time in which this process alone writes into `folder` and its history. Raises CannotCompute where
    another one does.

    The lock is that of an SQLite file, which the system takes back however a process ends.
    """
    place = _named(folder)
    path = place.with_name(f"{place.name}.history.lock")
    make_folder(path.parent)
    with closing(_locked(path, place)):
        yield


def _named(folder: PathLike) -> Path:
    """The path of an output folder. Raises UsageError where it has no name."""
    place = from_root(folder)
    if not place.name:
        raise UsageError("has no name, so no history lies beside it", file=str(folder))
    return place


def _locked(path: Path, place: Path) -> sqlite3.Connection:
    try:
        lock = sqlite3.connect(path, timeout=0.0, isolation_level=None)
        lock.execute("BEGIN EXCLUSIVE")
    except sqlite3.Error as error:
        why = "another olp batch is writing there; call again when it has ended"
        if error.sqlite_errorname != "SQLITE_BUSY":
            why = (
                f"the file {path.name} beside it cannot be written ({error}); name another folder, or let "
                "your user write there"
            )
        raise CannotCompute(why, file=str(place)) from None
    return lock


class History:
    """The history of an output folder, read once and appended to.

    `last` is the last record of each output, `releases` are in the order of their lines."""

    def __init__(self, folder: PathLike) -> None:
        """Read the history of `folder`; there may be none. Raises InputError where it is damaged,
        UsageError for a folder without a name."""
        self.folder = _named(folder)
        self.path = self.folder.with_name(f"{self.folder.name}.history.jsonl")
        self.last: dict[str, Record] = {}
        self.releases: dict[str, ReleaseLine] = {}
        self._own: dict[str, set[str]] = {}
        self._read()

    @property
    def base(self) -> Path:
        """The folder from which inputs are named."""
        return self.folder.parent

    def archive(self, name: str) -> Path:
        """The file of a release."""
        return self.folder.with_name(f"{self.folder.name}.released") / f"{name}.zip"

    def named(self, path: PathLike) -> str:
        """The name of an input in the history."""
        try:
            return Path(os.path.relpath(path, self.base)).as_posix()
        except ValueError:
            # on another drive
            return from_root(path).as_posix()

    def place(self, name: str) -> Path:
        """The path of an input by its name in the history."""
        return from_root(self.base / name)

    def owns(self, output: str) -> bool:
        """Whether the file at `output`, below the output folder, is as it was written, or is not there."""
        path = self.folder / output
        return not os.path.lexists(path) or digest_of(path) in self._own.get(output, ())

    def unchanged(self, record: Record) -> bool:
        """Whether all that was written with a record is there, and is as it was written."""
        return all(digest_of(self.folder / name) == digest for name, digest in record.outputs.items())

    def remove_older(self, record: Record, names: Iterable[str]) -> None:
        """Remove what was written with an older record and is none of the `names` written now. What was
        changed since stays. Raises OSError where the system refuses."""
        for name in record.outputs.keys() - set(names):
            if self.owns(name):
                (self.folder / name).unlink(missing_ok=True)

    def gone(self, record: Record) -> bool:
        """Whether neither the program nor its output is there: nothing is to be said of it any more."""
        program = self.place(record.setup["program"])
        return not ((self.folder / record.output).is_file() or program.is_file())

    def add(self, record: Record) -> None:
        """Append a record. Raises OlpError where the system refuses."""
        values = {
            "event": "written", "output": record.output, "key": record.key, "setup": dict(record.setup),
            "inputs": dict(record.inputs), "outputs": dict(record.outputs), "row": dict(record.row),
        }  # fmt: skip
        self._append(values)
        self._take(values)

    def add_release(self, release: ReleaseLine) -> None:
        """Append a release. Raises as `add`."""
        values = {
            "event": "released", "name": release.name, "date": release.date, "sha256": release.sha256,
            "programs": dict(release.programs),
        }  # fmt: skip
        self._append(values)
        self._take(values)

    def add_index(self, name: str, sha256: str) -> None:
        """Append that a page of the output folder was written. Raises as `add`."""
        values = {"event": "index", "outputs": {name: sha256}}
        self._append(values)
        self._take(values)

    def _append(self, values: Mapping[str, Any]) -> None:
        line = json.dumps({"schema": SCHEMA} | dict(values), sort_keys=True) + "\n"
        make_folder(self.base)
        try:
            with self.path.open("ab") as stream:
                stream.write(line.encode())
                stream.flush()
                os.fsync(stream.fileno())
        except OSError as error:
            raise OlpError(f"cannot be written ({error.strerror})", file=str(self.path)) from error

    def _read(self) -> None:
        try:
            data = self.path.read_bytes()
        except FileNotFoundError:
            return
        except OSError as error:
            raise InputError(f"cannot be read ({error.strerror})", file=str(self.path)) from None
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            # a line that a killed run left; what it tells of was not written
            write_bytes(self.path, data[:whole], force=True)
        for number, line in enumerate(data[:whole].splitlines(), 1):
            try:
                values = json.loads(line)
                if values["schema"] != SCHEMA:
                    raise ValueError
                self._take(values)
            except (ValueError, KeyError, TypeError, AttributeError):
                raise InputError(
                    f"is no line of a history ({SCHEMA}); restore the file, or move it and the output folder "
                    "away to begin again",
                    file=str(self.path),
                    line=number,
                ) from None

    def _take(self, values: Mapping[str, Any]) -> None:
        if values["event"] == "released":
            words = (values[key] for key in ("name", "date", "sha256", "programs"))
            self.releases[values["name"]] = ReleaseLine(*words)
            return
        for name, digest in values["outputs"].items():
            self._own.setdefault(name, set()).add(digest)
        if values["event"] == "written":
            keys = ("output", "key", "inputs", "outputs", "setup", "row")
            self.last[values["output"]] = Record(*(values[key] for key in keys))
