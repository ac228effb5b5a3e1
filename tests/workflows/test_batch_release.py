"""Releases of a batch, what a new calibration changes about them, and folders that are watched."""

from __future__ import annotations

import datetime
import json
import re
import zipfile
from pathlib import Path

import pytest
from cases.plants import correct_all, plant, program, states

import olp
from olp.core.errors import InputError, UsageError
from olp.files.history import History
from olp.files.releases import check_name, read_release
from olp.reports.batch_release import changed
from olp.workflows.batch import BatchOptions
from olp.workflows.batch_find import Where
from olp.workflows.batch_pool import Here, Pool
from olp.workflows.batch_release import release, what_if
from olp.workflows.batch_watch import watch
from olp.workflows.correct import CorrectOptions

DAY = datetime.date(2026, 5, 14)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return plant(tmp_path / "plant")


def here(_: int) -> Pool:
    return Here()


def new_calibration(folder: Path, squareness: float, of: str = "mill") -> Path:
    """A later calibration of a machine of the plant."""
    stated = (folder / of / "calibration.toml").read_text()
    path = folder / "new.toml"
    path.write_text(stated.replace("C0Y_urad = 203.3", f"C0Y_urad = {squareness}"))
    return path


def test_a_release_is_in_the_history_and_in_an_archive(folder: Path) -> None:
    correct_all(folder)
    report = release(folder / "out", "may", DAY)
    assert report["released"] == ["brackets/board.nc", "brackets/two.ngc", "one.ngc"]
    assert report["exit_code"] == 0
    last = json.loads((folder / "out.history.jsonl").read_text().splitlines()[-1])
    assert (last["event"], last["name"], last["date"]) == ("released", "may", "2026-05-14")
    kept = read_release(folder / "out.released" / "may.zip")
    assert kept.corrected["one.ngc"] == (folder / "out" / "one.ngc").read_bytes()
    assert (folder / "parts" / "one.ngc").read_bytes() in kept.inputs.values()
    rows = correct_all(folder).report["programs"]
    assert {row["released"] for row in rows} == {"may"}


def test_the_same_release_is_the_same_bytes(folder: Path) -> None:
    correct_all(folder)
    release(folder / "out", "may")
    first = (folder / "out.released" / "may.zip").read_bytes()
    lines = (folder / "out.history.jsonl").read_bytes().splitlines(keepends=True)
    (folder / "out.history.jsonl").write_bytes(b"".join(lines[:-1]))
    (folder / "out.released" / "may.zip").unlink()
    release(folder / "out", "may")
    assert (folder / "out.released" / "may.zip").read_bytes() == first
    assert {entry.date_time for entry in zipfile.ZipFile(folder / "out.released" / "may.zip").infolist()} == {
        (1980, 1, 1, 0, 0, 0)
    }


def test_what_is_not_as_it_was_written_is_not_released(folder: Path) -> None:
    correct_all(folder)
    (folder / "parts" / "one.ngc").write_text(program(33))
    two = folder / "out" / "brackets" / "two.ngc"
    two.write_bytes(two.read_bytes() + b"\n")
    report = release(folder / "out", "may")
    assert report["released"] == []
    assert report["exit_code"] == 1
    assert [row["program"] for row in report["left_out"]] == ["brackets/two.ngc", "one.ngc"]
    assert not (folder / "out.released").exists()
    kept = release(folder / "out", "may", keep_going=True)
    assert (kept["released"], kept["exit_code"]) == (["brackets/board.nc"], 1)


def test_a_program_that_is_gone_is_no_part_of_a_release(folder: Path) -> None:
    correct_all(folder)
    (folder / "parts" / "one.ngc").unlink()
    correct_all(folder)
    assert "its program is gone" in release(folder / "out", "may")["left_out"][0]["why"]
    (folder / "out" / "one.ngc").unlink()
    report = release(folder / "out", "may")
    assert (report["released"], report["exit_code"]) == (["brackets/board.nc", "brackets/two.ngc"], 0)


def test_an_archive_without_its_line_is_no_release(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a call that is killed leaves it."""
    correct_all(folder)
    monkeypatch.setattr(History, "add_release", lambda *_: None)
    release(folder / "out", "may")
    monkeypatch.undo()
    assert release(folder / "out", "may")["exit_code"] == 0
    assert what_if(folder / "out", new_calibration(folder, 203.3), here)["outside"] == 0


def test_what_is_not_good_is_not_released(folder: Path) -> None:
    correct_all(folder, options=CorrectOptions(part_tolerance_um=0.01))
    assert "it is not good" in release(folder / "out", "may")["left_out"][0]["why"]


def test_a_name_is_taken_once(folder: Path) -> None:
    correct_all(folder)
    release(folder / "out", "may")
    for name in ("may", "MAY"):
        with pytest.raises(UsageError, match="there is such a release already"):
            release(folder / "out", name)


@pytest.mark.parametrize("name", ["", "a/b", "..", "con", "COM1.x", "a\\b", "may.", "-x", "a" * 200])
def test_a_name_is_the_name_of_a_file_on_every_system(name: str) -> None:
    with pytest.raises(UsageError):
        check_name(name)


def test_a_new_calibration_says_what_verify_says(folder: Path) -> None:
    correct_all(folder)
    release(folder / "out", "may")
    new = new_calibration(folder, 233.3)
    report = what_if(folder / "out", new, here)
    assert [row["program"] for row in report["programs"]] == ["brackets/two.ngc", "one.ngc"]
    assert report["other_machines"] == ["brackets/board.nc"]
    assert report["outside"] == 2
    (folder / "mill" / "calibration.toml").write_text(new.read_text())
    alone = olp.verify(
        folder / "parts" / "one.ngc", folder / "out" / "one.ngc", folder / "mill" / "machine.toml"
    )
    row = report["programs"][1]
    numerical = alone.report["verdict"]["numerical"]
    assert row["largest_um"] == numerical["largest_um"]
    assert row["tolerance_um"] == numerical["allowed_um"]
    assert row["beyond_um"] == pytest.approx(numerical["largest_um"] - numerical["allowed_um"])
    # 30 urad more over 100 mm
    assert row["largest_um"] == pytest.approx(3.0, abs=0.9)
    assert report["exit_code"] == 1


def test_a_calibration_of_another_machine_judges_nothing(folder: Path) -> None:
    correct_all(folder)
    release(folder / "out", "may")
    new = new_calibration(folder, 233.3)
    new.write_text(re.sub(r'(?m)^machine = ".*"', 'machine = "lathe"', new.read_text()))
    report = what_if(folder / "out", new, here)
    assert not report["programs"] and len(report["other_machines"]) == 3
    assert report["exit_code"] == 1
    assert "no released program is for lathe" in changed(report)


def test_a_part_tolerance_decides_where_it_is_given(folder: Path) -> None:
    correct_all(folder)
    release(folder / "out", "may")
    new = new_calibration(folder, 233.3)
    report = what_if(folder / "out", new, here, part_tolerance_um=5.0)
    outside = {row["program"]: row["outside"] for row in report["programs"]}
    assert outside == {"brackets/two.ngc": True, "one.ngc": False}
    assert report["outside"] == 1
    assert what_if(folder / "out", new, here, part_tolerance_um=50.0)["exit_code"] == 0


def test_what_if_is_about_what_was_released(folder: Path) -> None:
    """Programs, machine and calibration have changed since, and are no part of the answer."""
    correct_all(folder)
    release(folder / "out", "may")
    new = new_calibration(folder, 233.3)
    before = what_if(folder / "out", new, here)
    (folder / "parts" / "one.ngc").write_text(program(777))
    (folder / "mill" / "calibration.toml").write_text("broken")
    (folder / "mill" / "machine.toml").write_text("broken")
    (folder / "out" / "one.ngc").write_text("G0 X0\n")
    assert what_if(folder / "out", new, here) == before


def test_of_several_releases_the_last_counts(folder: Path) -> None:
    correct_all(folder)
    release(folder / "out", "may")
    new = new_calibration(folder, 233.3)
    (folder / "mill" / "calibration.toml").write_text(new.read_text())
    (folder / "parts" / "brackets" / "two.ngc").unlink()
    correct_all(folder)
    release(folder / "out", "june", keep_going=True)
    rows = {row["program"]: row for row in what_if(folder / "out", new, here)["programs"]}
    assert (rows["one.ngc"]["release"], rows["one.ngc"]["outside"]) == ("june", False)
    assert (rows["brackets/two.ngc"]["release"], rows["brackets/two.ngc"]["outside"]) == ("may", True)


def test_nothing_is_written_by_what_if(folder: Path) -> None:
    correct_all(folder)
    release(folder / "out", "may")
    new = new_calibration(folder, 233.3)
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    what_if(folder / "out", new, here)
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


def test_without_a_release_there_is_no_answer(folder: Path) -> None:
    with pytest.raises(InputError, match="there is no history"):
        what_if(folder / "out", new_calibration(folder, 1.0), here)
    correct_all(folder)
    with pytest.raises(InputError, match="nothing is released"):
        what_if(folder / "out", new_calibration(folder, 1.0), here)


def test_an_archive_that_was_changed_is_refused(folder: Path) -> None:
    correct_all(folder)
    release(folder / "out", "may")
    archive = folder / "out.released" / "may.zip"
    archive.write_bytes(archive.read_bytes() + b"x")
    with pytest.raises(InputError, match=r"may\.zip: was changed since the release"):
        what_if(folder / "out", new_calibration(folder, 1.0), here)
    archive.write_bytes(b"no zip")
    with pytest.raises(InputError):
        read_release(archive)


# -- watching ------------------------------------------------------------------------------------


def test_a_watched_folder_is_done_again_when_it_changes(folder: Path) -> None:
    looks: list[int] = []
    seen: list[dict[str, str]] = []
    parts = folder / "parts"
    changes = {
        3: lambda: (parts / "one.ngc").write_text(program(150)),
        8: lambda: (parts / "brackets" / "new.ngc").write_text(program(20)),
        13: lambda: (folder / "mill" / "calibration.toml").touch(),
        18: lambda: (parts / "one.ngc").write_text("G68 X0\n"),
        23: lambda: (parts / "one.ngc").write_text(program(151)),
    }

    def pause() -> None:
        looks.append(len(looks))
        if looks[-1] in changes:
            changes[looks[-1]]()
        if len(looks) > 28:
            raise KeyboardInterrupt

    where = Where(
        folders=(str(parts),), output=str(folder / "out"), machine=str(folder / "mill" / "machine.toml")
    )
    with pytest.raises(KeyboardInterrupt):
        watch(where, BatchOptions(reports=""), here, lambda batch: seen.append(states(batch)), pause=pause)
    changed = [{k: v for k, v in one.items() if v != "unchanged"} for one in seen]
    assert changed == [
        dict.fromkeys(("one.ngc", "brackets/two.ngc", "brackets/board.nc"), "written"),
        {"one.ngc": "written"},
        {"brackets/new.ngc": "written"},
        {},
        {"one.ngc": "refused"},
        {"one.ngc": "written"},
    ]


def test_a_change_while_a_run_lasts_is_not_missed(folder: Path) -> None:
    seen: list[dict[str, str]] = []
    calibration = folder / "mill" / "calibration.toml"

    def change(what: str, share: float) -> None:
        if share == 1.0 and len(seen) == 0:
            (folder / "parts" / "one.ngc").write_text(program(160))
        if share == 1.0 and len(seen) == 1:
            calibration.write_text(calibration.read_text().replace("203.3", "103.3"))

    looks = iter(range(12))

    def pause() -> None:
        if len(seen) == 3 or next(looks, None) is None:
            raise KeyboardInterrupt

    where = Where(
        folders=(str(folder / "parts"),), output=str(folder / "out"),
        machine=str(folder / "mill" / "machine.toml"),
    )  # fmt: skip
    with pytest.raises(KeyboardInterrupt):
        watch(where, BatchOptions(reports=""), here, lambda b: seen.append(states(b)), change, pause=pause)
    done = [{name for name, state in one.items() if state == "written"} for one in seen]
    assert done[1:] == [{"one.ngc"}, {"one.ngc", "brackets/two.ngc"}]


def test_a_file_that_grows_is_waited_for(folder: Path) -> None:
    growing, passes = folder / "parts" / "grows.ngc", list[int]()
    looks = 0

    def pause() -> None:
        nonlocal looks
        looks += 1
        if looks < 5:
            growing.write_text(program(10) * looks)
        if looks > 8:
            raise KeyboardInterrupt

    where = Where(
        folders=(str(folder / "parts"),), output=str(folder / "out"),
        machine=str(folder / "mill" / "machine.toml"),
    )  # fmt: skip
    with pytest.raises(KeyboardInterrupt):
        watch(where, BatchOptions(reports=""), here, lambda _: passes.append(looks), pause=pause)
    assert passes == [0, 5]


def test_an_archive_of_another_history_is_kept(folder: Path) -> None:
    correct_all(folder)
    release(folder / "out", "may")
    archive = folder / "out.released" / "may.zip"
    before = archive.read_bytes()
    (folder / "out").rename(folder / "old")
    (folder / "out.history.jsonl").unlink()
    (folder / "parts" / "one.ngc").write_text(program(110))
    correct_all(folder)
    with pytest.raises(UsageError, match="is of another history"):
        release(folder / "out", "may")
    assert archive.read_bytes() == before


def test_the_root_of_a_disk_has_no_history(folder: Path) -> None:
    with pytest.raises(UsageError, match="has no name"):
        release(folder.anchor, "may")
