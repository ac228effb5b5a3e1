"""Reads whole files, and writes files so that none is ever half written and no input is destroyed."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from olp.core import projects
from olp.core.errors import InputError, OlpError, UsageError
from olp.core.paired import divided
from olp.core.spool import Mapped, Text, text_of
from olp.files import names
from olp.files.names import not_found
from olp.files.replacing import HELD, Replacement, parts_of, remove_stale
from olp.files.replacing import Content as Content

PathLike = str | os.PathLike[str]
#: Reads a whole file, as `read_bytes` does. `Sources.read` keeps the bytes and opens each file once.
Reader = Callable[[PathLike], bytes]

#: Endings of files that browsers open as pages, and whose scripts they run.
_PAGES = frozenset(
    (".htm", ".html", ".xht", ".xhtml", ".shtml", ".svg", ".svgz", ".mht", ".mhtml", ".hta", ".xsl", ".xslt")
)


def is_page(name: PathLike) -> bool:
    """Whether a browser would open a file of this name as a page, and run what it holds."""
    return Path(name).suffix.lower() in _PAGES


def read_bytes(path: PathLike) -> bytes:
    """The bytes of a file. Raises InputError where it cannot be read."""
    with _reading(path):
        return Path(path).read_bytes()


def read_long(path: PathLike) -> Text:
    """A copy of a file that may be long. Raises InputError where it cannot be read."""
    with _reading(path), Path(path).open("rb") as file:
        return text_of(file)


@contextmanager
def _reading(path: PathLike) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError:
        raise InputError(not_found(str(path)), file=str(path)) from None
    except IsADirectoryError:
        raise InputError("is a folder; expected a file in it", file=str(path)) from None
    except PermissionError:
        folder = Path(path).is_dir()
        sentence = (
            "is a folder; expected a file in it" if folder else "may not be read; check its permissions"
        )
        raise InputError(sentence, file=str(path)) from None
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read ({_reason(error)})", file=str(path)) from None


def write_bytes(
    path: PathLike, data: Content, *, force: bool = False, inputs: Iterable[PathLike] = ()
) -> None:
    """Write one file as `write_files` does."""
    write_files({Path(path): data}, force=force, inputs=inputs)


def write_files(
    files: Mapping[Path, Content], *, force: bool = False, inputs: Iterable[PathLike] = ()
) -> None:
    """Write files, each whole or not at all. Where one cannot be written, no target is replaced.

    Contents in parts are written part by part, so that a long file never has to be in memory. A program that
    was read from several files is written to as many (`olp.core.paired`, `olp.core.projects`).

    Each file is first written beside its target under a temporary name and synced, with the owner and mode of
    the file that it replaces. Then all replace their targets. Temporary files of killed runs are removed. A
    device such as the null device is written to directly. Raises UsageError where a target is one of `inputs`
    (also with `force`), exists without `force`, has no folder, or has a name that Windows would take for
    another. Raises OlpError where the system refuses to write, or where another program holds a target or has
    changed it meanwhile.
    """
    inputs = list(inputs)
    many = [Path(source) for source in inputs if projects.is_one_of_many(Path(source))]
    written: dict[Path, Content] = {}
    for target, whole in files.items():
        own = _divided(target, whole)
        # the files that were read with a program are inputs, too
        read = [source.with_name(part.name) for source in many for part in own if part != target]
        inputs += read
        # one of them that stays as it is has not to be written
        written |= {
            part: data for part, data in own.items() if not (_is_one(part, read) and _holds(part, data))
        }
    files = written
    check_targets(files, inputs, force=force)
    waiting: list[Replacement] = []
    current = Path()
    try:
        for current, data in files.items():
            if current.exists() and not current.is_file():
                with current.open("wb") as device:
                    device.writelines(parts_of(data))
                continue
            waiting.append(Replacement(current))
            waiting[-1].write(data)
        while waiting:
            current = waiting[0].target
            waiting[0].replace(force=force)
            remove_stale(waiting.pop(0).final)
    except OSError as error:
        raise OlpError(_unwritten(error), file=str(current)) from error
    finally:
        for replacement in waiting:
            replacement.discard()


def _divided(target: Path, content: Content) -> Mapping[Path, Content]:
    if not isinstance(content, bytes | Mapped):
        return {target: content}
    return projects.divided(target, content) if projects.is_one_of_many(target) else divided(target, content)


def _is_one(file: Path, others: Iterable[Path]) -> bool:
    return file.is_file() and any(other.is_file() and file.samefile(other) for other in others)


def _holds(file: Path, data: Content) -> bool:
    """Whether a file has these bytes."""
    size = len(data) if isinstance(data, bytes | Mapped) else -1
    return file.stat().st_size == size and read_bytes(file) == data


def check_targets(
    targets: Iterable[Path], inputs: Iterable[PathLike] = (), *, force: bool, new_folders: bool = False
) -> None:
    """Raise UsageError as `write_files` does. With `new_folders` those of the targets need not exist."""
    sources = [Path(source) for source in inputs]
    for target in targets:
        try:
            _check(target, force, sources, new_folders)
        except OSError as error:
            raise UsageError(f"is no name for a file ({_reason(error)})", file=str(target)) from None


def make_folder(folder: Path) -> None:
    """Create a folder and those above it, where they do not exist. Raises UsageError, OlpError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise UsageError("is a file; name a folder", file=str(folder)) from None
    except OSError as error:
        raise OlpError(f"cannot be created ({error.strerror})", file=str(folder)) from error


def _unwritten(error: OSError) -> str:
    reason = f"cannot be written ({_reason(error)})"
    held = getattr(error, "winerror", None) in HELD
    if held:
        return f"{reason}; close it in other programs, and call again"
    denied = isinstance(error, PermissionError) and error.errno == errno.EACCES
    return f"{reason}; name another folder, or let your user write there" if denied else reason


def _check(target: Path, force: bool, sources: Iterable[Path], new_folders: bool) -> None:
    wrong = names.wrong_on_windows(str(target)) if names.WINDOWS else ""
    if wrong:
        raise UsageError(wrong, file=str(target))
    if not (new_folders or target.parent.is_dir()):
        raise UsageError(f"there is no folder {str(target.parent)!r}; create it first", file=str(target))
    if target.is_dir():
        raise UsageError("is a folder; name a file to write", file=str(target))
    if not target.exists():
        if Path(os.path.realpath(target)).is_symlink():
            raise UsageError("is a link that leads back to itself; name a file", file=str(target))
        return
    if any(source.exists() and target.samefile(source) for source in sources):
        raise UsageError(
            "is an input of this call and is never overwritten; name another output", file=str(target)
        )
    if target.is_file() and not force:
        raise UsageError("exists already; name another file, or overwrite it with --force", file=str(target))


def _reason(error: Exception) -> str:
    return (error.strerror if isinstance(error, OSError) else None) or str(error) or type(error).__name__
