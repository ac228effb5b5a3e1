"""Reads whole files, and writes files so that none is ever half written and no input is destroyed."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from olp.core.errors import InputError, OlpError, UsageError

PathLike = str | os.PathLike[str]
#: A whole file, or its parts in order.
Content = bytes | Iterable[bytes]
#: Reads a whole file, as `read_bytes` does. `Sources.read` keeps the bytes and opens each file once.
Reader = Callable[[PathLike], bytes]


def read_bytes(path: PathLike) -> bytes:
    """The bytes of a file. Raises InputError where it cannot be read."""
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise InputError("no such file; check the path", file=str(path)) from None
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

    Contents in parts are written part by part, so that a long file never has to be in memory.

    Each file is first written beside its target under a temporary name and synced. Then all replace their
    targets. A device such as the null device is written to directly. Raises UsageError where a target is one
    of `inputs` (also with `force`), exists without `force`, or has no folder. Raises OlpError where the
    system refuses to write.
    """
    check_targets(files, inputs, force=force)
    waiting: list[tuple[Path, Path]] = []
    current = Path()
    try:
        for current, data in files.items():
            if current.exists() and not current.is_file():
                with current.open("wb") as device:
                    device.writelines([data] if isinstance(data, bytes) else data)
                continue
            # A link still points to the file that is written.
            final = Path(os.path.realpath(current))
            temporary = final.with_name(f".{final.name[:80]}.{secrets.token_hex(4)}.tmp")
            waiting.append((temporary, final))
            _write_synced(temporary, data)
            if final.exists():
                shutil.copymode(final, temporary)
        while waiting:
            temporary, current = waiting[0]
            temporary.replace(current)
            waiting.pop(0)
    except OSError as error:
        raise OlpError(f"cannot be written ({_reason(error)})", file=str(current)) from error
    finally:
        for temporary, _ in waiting:
            temporary.unlink(missing_ok=True)


def check_targets(
    targets: Iterable[Path], inputs: Iterable[PathLike] = (), *, force: bool, new_folders: bool = False
) -> None:
    """Raise UsageError as `write_files` does. With `new_folders` those of the targets need not exist."""
    sources = [Path(source) for source in inputs]
    for target in targets:
        _check(target, force, sources, new_folders)


def make_folder(folder: Path) -> None:
    """Create a folder and those above it, where they do not exist. Raises UsageError, OlpError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise UsageError("is a file; name a folder", file=str(folder)) from None
    except OSError as error:
        raise OlpError(f"cannot be created ({error.strerror})", file=str(folder)) from error


def _check(target: Path, force: bool, sources: Iterable[Path], new_folders: bool) -> None:
    if not (new_folders or target.parent.is_dir()):
        raise UsageError(f"there is no folder {str(target.parent)!r}; create it first", file=str(target))
    if target.is_dir():
        raise UsageError("is a folder; name a file to write", file=str(target))
    if not target.exists():
        return
    if any(source.exists() and target.samefile(source) for source in sources):
        raise UsageError(
            "is an input of this call and is never overwritten; name another output", file=str(target)
        )
    if target.is_file() and not force:
        raise UsageError("exists already; name another file, or overwrite it with --force", file=str(target))


def _write_synced(path: Path, data: Content) -> None:
    with path.open("xb") as stream:
        stream.writelines([data] if isinstance(data, bytes) else data)
        stream.flush()
        os.fsync(stream.fileno())


def _reason(error: Exception) -> str:
    return (error.strerror if isinstance(error, OSError) else None) or str(error) or type(error).__name__
