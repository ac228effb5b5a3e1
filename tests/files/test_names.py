"""Names of files on Windows: what it takes for a device, what it drops, and files that others hold."""

from __future__ import annotations

import ntpath
from collections.abc import Iterator
from pathlib import Path, PureWindowsPath

import pytest

from olp.cli import common
from olp.core.errors import InputError, OlpError, UsageError
from olp.files import config, names, replacing, write
from olp.files.names import not_found, wrong_on_windows
from olp.reports import check
from olp.reports.outline import by_file


@pytest.mark.parametrize("path", [
    "part.nc", r"C:\nc\part.nc", "C:/nc/part.nc", r"\\server\share\nc\part.nc", r"..\part.nc", "./part.nc",
    "NUL", "nul", "console.nc", "com.nc", "COM10.nc", "lpt.txt", "part.v2.nc", ".hidden", "aux-plate.nc",
    r"\\?\C:\nc\part.nc", "Gr\u00f6\u00dfe 3.nc",
])  # fmt: skip
def test_names_that_windows_takes(path: str) -> None:
    assert wrong_on_windows(path) == ""


@pytest.mark.parametrize(("path", "says"), [
    ("CON", "device of Windows (CON)"), ("con.nc", "device of Windows (CON)"),
    (r"C:\nc\aux.nc", "(AUX)"), ("nul.nc", "(NUL)"), (r"prn\part.nc", "(PRN)"), ("COM1.nc", "(COM1)"),
    ("Lpt9 .nc", "(LPT9)"), ("com\u00b2", "(COM\u00b2)"), ("part.nc.", "ends in a point or a blank"),
    ("part.nc ", "which Windows drops"), (r"out \part.nc", "'out '"), ("part.nc:1", "(':')"),
    ("a?.nc", "('?')"), ("part\t.nc", "no name on Windows"), ('a"b.nc', "take another name"),
    (r"\\.\COM1", "is a device of Windows"), ("//./pipe/x", "is a device of Windows"),
])  # fmt: skip
def test_names_that_windows_takes_for_others(path: str, says: str) -> None:
    assert says in wrong_on_windows(path)


def test_such_a_name_is_no_output_on_windows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(names, "WINDOWS", True)
    with pytest.raises(UsageError, match=r"AUX\.nc: has the name of a device"):
        write.write_bytes(tmp_path / "AUX.nc", b"G0")
    assert list(tmp_path.iterdir()) == []


def test_a_path_that_is_not_found() -> None:
    assert not_found("part.nc") == "no such file; check the path"
    long = "C:\\" + "\\".join(["folder"] * 40) + "\\part.nc"
    assert "too long for Windows" in not_found(long, windows=True)
    assert "write the path with /" in not_found(r"sub\part.nc", windows=False)
    assert not_found(r"sub\part.nc", windows=True) == "no such file; check the path"
    with pytest.raises(InputError, match="write the path with / between folders"):
        write.read_bytes(r"no\such.nc")


@pytest.mark.parametrize(("naming", "named", "path"), [
    (r"C:\machines\machine.toml", "calibration.toml", r"C:\machines\calibration.toml"),
    (r"C:\machines\machine.toml", "sub/x.csv", r"C:\machines\sub\x.csv"),
    (r"C:\machines\machine.toml", r"sub\x.csv", r"C:\machines\sub\x.csv"),
    (r"C:\machines\machine.toml", "D:/cal/x.csv", r"D:\cal\x.csv"),
    (r"C:\machines\machine.toml", r"\\server\cal\x.csv", r"\\server\cal\x.csv"),
    (r"\\server\share\machine.toml", "x.csv", r"\\server\share\x.csv"),
    ("machine.toml", "x.csv", "x.csv"),
])  # fmt: skip
def test_paths_in_files_are_relative_to_them(
    naming: str, named: str, path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(config, "FilePath", PureWindowsPath)
    assert config.beside(naming, named) == path


@pytest.mark.parametrize(("path", "uri"), [
    (r"C:\nc files\part.nc", "file:///C:/nc%20files/part.nc"),
    (r"\\server\share\part.nc", "file://server/share/part.nc"),
    (r"nc\part 1.nc", "nc/part%201.nc"),
])  # fmt: skip
def test_pipelines_get_addresses_and_no_backslashes(
    path: str, uri: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(check, "PurePath", PureWindowsPath)
    assert check._uri(path) == uri


def test_reports_name_files_without_their_folders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("olp.reports.outline.PurePath", PureWindowsPath)
    report = {"lines": [{"name": "EXX", "file": r"C:\laser\x.csv", "rms_um": 1.0}], "points": 3}
    assert by_file(report) == {"lines": [{"name": "EXX x.csv", "rms_um": 1.0}], "points": 3}


def test_names_that_differ_in_case_are_one_output_on_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    common.refuse_twice(["out.nc", "sub/out.nc"])
    monkeypatch.setattr(common.os.path, "normcase", ntpath.normcase)
    with pytest.raises(UsageError, match="named as output twice"):
        common.refuse_twice(["out.nc", "OUT.nc"])


def held(times: int, code: int) -> Iterator[None]:
    """Refuses so often, as Windows does while another program holds the file."""
    for _ in range(times):
        error = PermissionError(13, "held by another program")
        error.winerror = code  # type: ignore[attr-defined]
        yield error  # type: ignore[misc]
    while True:
        yield None


def refusing(monkeypatch: pytest.MonkeyPatch, times: int, code: int) -> None:
    refusals, replace = held(times, code), Path.replace

    def replaced(self: Path, target: Path) -> Path:
        error = next(refusals)
        if error is not None:
            raise error
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", replaced)
    monkeypatch.setattr(replacing.time, "sleep", lambda _: None)


@pytest.mark.parametrize("code", sorted(replacing.HELD))
def test_a_file_that_is_held_for_a_moment_is_written(
    tmp_path: Path, code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "part.nc").write_bytes(b"old")
    refusing(monkeypatch, 3, code)
    write.write_bytes(tmp_path / "part.nc", b"new", force=True)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"new"]


def test_a_file_that_is_held_for_long_is_left_and_the_message_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "part.nc").write_bytes(b"old")
    refusing(monkeypatch, 10**9, 32)
    monkeypatch.setattr(replacing, "PATIENCE_S", 0.0)
    with pytest.raises(OlpError, match="close it in other programs, and call again"):
        write.write_bytes(tmp_path / "part.nc", b"new", force=True)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"old"]


def test_other_refusals_are_not_tried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "part.nc").write_bytes(b"old")
    refusing(monkeypatch, 1, 1)
    with pytest.raises(OlpError, match=r"name another folder, or let your user write there$"):
        write.write_bytes(tmp_path / "part.nc", b"new", force=True)
