"""A file is replaced at once: after a kill at any moment there is the old file or the new one."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any

import pytest

from olp.core.errors import OlpError, UsageError
from olp.files.replacing import Replacement
from olp.files.write import check_targets, write_bytes, write_files

POSIX = pytest.mark.skipif(not hasattr(os, "fork"), reason="forks and owners of POSIX")
OLD, NEW = b"the old program\n" * 99, b"a new and longer program\n" * 9999


def of(function: Any) -> str:
    """The module of a C function, or of the kind of object that it is a method of."""
    owner = getattr(function, "__self__", None)
    return owner.__name__ if isinstance(owner, ModuleType) else type(owner).__module__


def killed_at(step: int, work: object) -> bool:
    """Run `work` in a process that is killed at its `step`-th call of a C function; False where it had ended
    before. Every system call is in one of them, and in none of a number, a text or a list."""
    child = os.fork()
    if child:
        _, status = os.waitpid(child, 0)
        return os.WIFSIGNALED(status)
    left = [step]

    def count(frame: FrameType, event: str, function: Any) -> None:
        if event == "c_call" and of(function) != "builtins":
            left[0] -= 1
            if left[0] <= 0:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.setprofile(count)
    try:
        work()  # type: ignore[operator]
    finally:
        sys.setprofile(None)
        os._exit(0)


@POSIX
@pytest.mark.slow
@pytest.mark.parametrize("before", [OLD, None])
@pytest.mark.parametrize("linked", [False, True])
def test_a_kill_at_every_call_leaves_the_old_file_or_the_new_one(
    before: bytes | None, linked: bool, tmp_path: Path
) -> None:
    real, target = tmp_path / "part.ngc", tmp_path / ("link.ngc" if linked else "part.ngc")
    if linked:
        target.symlink_to(real)
    states = []
    step = 1
    killed = True
    while killed:
        real.unlink(missing_ok=True)
        if before is not None:
            real.write_bytes(before)
            real.chmod(0o640)
        killed = killed_at(step, lambda: write_bytes(target, NEW, force=before is not None))
        after = real.read_bytes() if real.exists() else None
        assert after in (before, NEW), f"step {step}"
        assert target.is_symlink() is linked
        if before is not None:
            assert real.stat().st_mode & 0o777 == 0o640
        states.append(after == NEW)
        step += 1
    assert step > 20 and states[-1] and states == sorted(states)
    write_bytes(target, NEW, force=True)
    assert set(tmp_path.iterdir()) == {real, target}


@POSIX
def test_the_next_run_to_the_same_place_removes_what_a_killed_one_left(tmp_path: Path) -> None:
    def stuck() -> Iterator[bytes]:
        yield b"half"
        os.kill(os.getpid(), signal.SIGKILL)

    assert killed_at(10**9, lambda: write_bytes(tmp_path / "a.ngc", stuck()))
    assert len(list(tmp_path.iterdir())) == 1
    foreign = [tmp_path / f".a.ngc.{os.getppid()}-01234567.tmp", tmp_path / ".a.ngc.mine.tmp"]
    for path in foreign:
        path.touch()
    write_bytes(tmp_path / "a.ngc", NEW)
    assert set(tmp_path.iterdir()) == {tmp_path / "a.ngc", *foreign}, "those of runs that go on are kept"
    os.utime(foreign[0], (0.0, 0.0))
    write_bytes(tmp_path / "a.ngc", NEW, force=True)
    assert set(tmp_path.iterdir()) == {tmp_path / "a.ngc", foreign[1]}


@POSIX
def test_the_owner_and_the_mode_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.ngc"
    path.write_bytes(OLD)
    path.chmod(0o604)
    if os.getuid() == 0:
        os.chown(path, 1234, 4321)
        write_bytes(path, NEW, force=True)
        status = path.stat()
        assert (status.st_uid, status.st_gid, status.st_mode & 0o777) == (1234, 4321, 0o604)
        path.write_bytes(OLD)

        def refused(*_: object) -> None:
            raise PermissionError(1, "Operation not permitted")

        monkeypatch.setattr(os, "chown", refused)
        with pytest.raises(OlpError, match=r"a\.ngc: belongs to another user") as caught:
            write_bytes(path, NEW, force=True)
        assert caught.value.exit_code == 4
        assert path.read_bytes() == OLD and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("before", [OLD, None])
def test_a_file_that_another_program_changed_meanwhile_is_left(before: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "a.ngc"
    if before is not None:
        path.write_bytes(before)

    def parts() -> Iterator[bytes]:
        yield b"half"
        path.write_bytes(b"by another")
        yield b"half"

    with pytest.raises(OlpError, match=r"a\.ngc: was changed by another program during this call"):
        write_bytes(path, parts(), force=before is not None)
    assert path.read_bytes() == b"by another"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_appears_at_the_last_moment_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.ngc"
    whole = os.link

    def link(source: Path, target: Path) -> None:
        path.write_bytes(b"by another")
        whole(source, target)

    monkeypatch.setattr(os, "link", link)
    with pytest.raises(OlpError, match="was changed by another program"):
        write_bytes(path, NEW)
    assert path.read_bytes() == b"by another"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_system_without_links_takes_new_files_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refused)
    write_bytes(tmp_path / "a.ngc", NEW)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [NEW]


def test_names_of_many_bytes_are_written(tmp_path: Path) -> None:
    """A temporary name is never longer than the longest name."""
    path = tmp_path / ("\u754c" * 80 + ".ngc")
    write_bytes(path, NEW)
    assert path.read_bytes() == NEW


def test_what_is_no_name_is_a_wrong_call(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is no name for a file"):
        check_targets([tmp_path / ("a" * 300)], force=True)
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    with pytest.raises(UsageError, match="a link that leads back to itself"):
        write_files({loop: NEW}, force=True)
    assert loop.is_symlink()


def test_a_link_to_a_file_that_is_not_there_yet_is_kept(tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "later.ngc")
    write_bytes(link, NEW)
    assert link.is_symlink() and (tmp_path / "later.ngc").read_bytes() == NEW


def test_a_replacement_that_is_discarded_leaves_nothing(tmp_path: Path) -> None:
    replacement = Replacement(tmp_path / "a.ngc")
    replacement.write(NEW)
    replacement.discard()
    assert list(tmp_path.iterdir()) == []
