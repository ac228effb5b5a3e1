"""Files are written whole or not at all, and never over an input."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from olp.core.errors import InputError, OlpError, UsageError
from olp.files.replacing import Replacement
from olp.files.starter import starter_machine, write_starter
from olp.files.write import read_bytes, write_bytes, write_files


@pytest.mark.slow
@given(data=st.binary(max_size=300))
def test_what_is_written_is_read(data: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "out.ngc"
    write_bytes(path, data, force=True)
    assert read_bytes(path) == data


def test_an_existing_file_is_kept_unless_forced(tmp_path: Path) -> None:
    path = tmp_path / "out.ngc"
    write_bytes(path, b"first")
    with pytest.raises(UsageError, match=r"exists already; .* --force") as caught:
        write_bytes(path, b"second")
    assert caught.value.exit_code == 2
    assert path.read_bytes() == b"first"
    write_bytes(path, b"second", force=True)
    assert path.read_bytes() == b"second"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["part.ngc", "sub/../part.ngc", "link.ngc", "hard.ngc"])
def test_an_input_is_never_overwritten_under_any_name(name: str, tmp_path: Path) -> None:
    source = tmp_path / "part.ngc"
    source.write_bytes(b"G0")
    (tmp_path / "sub").mkdir()
    try:
        (tmp_path / "link.ngc").symlink_to(source)
        os.link(source, tmp_path / "hard.ngc")
    except OSError:
        pytest.skip("this system makes no links")
    with pytest.raises(UsageError, match="is an input of this call and is never overwritten"):
        write_bytes(tmp_path / name, b"G1", force=True, inputs=[tmp_path / "absent.toml", source])
    assert source.read_bytes() == b"G0"


def test_a_link_keeps_pointing_at_the_file_written(tmp_path: Path) -> None:
    (tmp_path / "real.ngc").write_bytes(b"old")
    try:
        (tmp_path / "link.ngc").symlink_to(tmp_path / "real.ngc")
    except OSError:
        pytest.skip("this system makes no links")
    write_bytes(tmp_path / "link.ngc", b"new", force=True)
    assert (tmp_path / "link.ngc").is_symlink()
    assert (tmp_path / "real.ngc").read_bytes() == b"new"


# A pipe of our own stands for every device: a fault in the code under test must not reach the system's.
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system makes no named pipes")
def test_a_device_is_written_in_place(tmp_path: Path) -> None:
    device = tmp_path / "device"
    os.mkfifo(device)
    reader = os.open(device, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_bytes(device, b"G0")
        assert os.read(reader, 9) == b"G0"
    finally:
        os.close(reader)
    assert device.is_fifo()
    assert list(tmp_path.iterdir()) == [device]


def full_disk(replacement: Replacement, data: bytes) -> None:
    replacement._temporary.write_bytes(data[: len(data) // 2])
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_failing_write_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old = tmp_path / "old.ngc"
    old.write_bytes(b"old")
    monkeypatch.setattr(Replacement, "write", full_disk)
    for target in (old, tmp_path / "new.ngc"):
        with pytest.raises(OlpError, match=r"cannot be written \(No space left on device\)") as caught:
            write_bytes(target, b"a longer program", force=True)
        assert caught.value.exit_code == 4
        assert caught.value.file == str(target)
    assert list(tmp_path.iterdir()) == [old]
    assert old.read_bytes() == b"old"


def test_an_interrupt_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(_: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_bytes(tmp_path / "new.ngc", b"G0")
    assert list(tmp_path.iterdir()) == []


def test_of_several_files_none_is_written_where_one_cannot_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {tmp_path / name: b"data" for name in ("a", "b", "c")}
    (tmp_path / "c").write_bytes(b"kept")
    with pytest.raises(UsageError, match="exists already"):
        write_files(files)
    assert [path.name for path in tmp_path.iterdir()] == ["c"]

    whole = Replacement.write
    monkeypatch.setattr(
        Replacement, "write", lambda r, data: (full_disk if r.target.name == "b" else whole)(r, data)
    )
    with pytest.raises(OlpError, match="cannot be written"):
        write_files(files, force=True)
    assert [path.name for path in tmp_path.iterdir()] == ["c"]
    assert (tmp_path / "c").read_bytes() == b"kept"


def test_a_starter_set_never_replaces_a_file(tmp_path: Path) -> None:
    machine = starter_machine("mill", "FXYZ", dict.fromkeys("XYZ", (0.0, 100.0)))
    (tmp_path / "y.csv").write_text("mine")
    with pytest.raises(UsageError, match=r"y\.csv: exists already"):
        write_starter(tmp_path, machine)
    assert [path.name for path in tmp_path.iterdir()] == ["y.csv"]


def test_permissions_of_a_replaced_file_stay(tmp_path: Path) -> None:
    path = tmp_path / "out.ngc"
    path.write_bytes(b"old")
    path.chmod(0o640)
    before = path.stat().st_mode
    write_bytes(path, b"new", force=True)
    assert path.stat().st_mode == before


def test_a_target_that_is_no_file_is_a_wrong_call(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is a folder; name a file"):
        write_bytes(tmp_path, b"", force=True)
    with pytest.raises(UsageError, match="there is no folder"):
        write_bytes(tmp_path / "none" / "out.ngc", b"")


@pytest.mark.parametrize(
    ("name", "message"), [("none", "no such file"), (".", "is a folder"), ("\0", "cannot be read")]
)
def test_a_file_that_cannot_be_read_gives_one_sentence(name: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_bytes(tmp_path / name)
    assert caught.value.exit_code == 3
    assert "\n" not in str(caught.value)
