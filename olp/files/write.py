"""Reading of whole files, and writing that never leaves half a file or destroys an input."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from olp.core.errors import InputError, OlpError, UsageError

PathLike = str | os.PathLike[str]
#: a whole file, or its parts in order
Content = bytes | Iterable[bytes]
#: reads a whole file, as `read_bytes` does; one that remembers opens each file once
Reader = Callable[[PathLike], bytes]


def read_bytes(path: PathLike) -> bytes:
    """The bytes of a file; raises InputError in one sentence where it cannot be read."""
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise InputError("no such file; check the path", file=str(path)) from None
    except IsADirectoryError:
        raise InputError("is a folder; expected a file", file=str(path)) from None
    except PermissionError:
        what = (
            "is a folder; expected a file"
            if Path(path).is_dir()
            else "may not be read; check its permissions"
        )
        raise InputError(what, file=str(path)) from None
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
    """Write files, each whole or not at all; where one cannot be written, none is put in place.

    What comes in parts is written part by part, so that a long file never has to be in memory.

    Each goes to a temporary file beside its target and is synced; then all replace their targets. A device
    such as the null device is written to directly. Raises UsageError where a target is one of `inputs`
    (also with `force`), exists and `force` is not given, or lies in no folder; OlpError where the system
    refuses to write.
    """
    sources = [Path(source) for source in inputs]
    for target in files:
        _check(target, force, sources)
    waiting: list[tuple[Path, Path]] = []
    current = Path()
    try:
        for current, data in files.items():
            if current.exists() and not current.is_file():
                with current.open("wb") as device:
                    device.writelines([data] if isinstance(data, bytes) else data)
                continue
            # A link keeps pointing to the file that is written.
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


def _check(target: Path, force: bool, sources: Iterable[Path]) -> None:
    if not target.parent.is_dir():
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
