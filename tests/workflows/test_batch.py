"""Laws of a batch: the same bytes as one correction after the other, and only what changed is done again."""

from __future__ import annotations

import datetime
import json
import os
from pathlib import Path

import pytest
from cases.plants import START, contents, correct_all, moved, plant, program, states

import olp
from olp.core.errors import CannotCompute, InputError, UsageError
from olp.errormodel.known import KnownErrors
from olp.files.history import writing
from olp.workflows import report as reports
from olp.workflows.batch import BatchOptions, batch, run
from olp.workflows.batch_find import Where
from olp.workflows.batch_pool import Here, opened
from olp.workflows.batch_release import release
from olp.workflows.correct import CorrectOptions
from olp.workflows.session import Session

ALL = {"one.ngc", "brackets/two.ngc", "brackets/board.nc"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return plant(tmp_path / "plant")


def test_the_bytes_are_those_of_one_correction_after_the_other(folder: Path) -> None:
    result = correct_all(folder)
    assert states(result) == dict.fromkeys(ALL, "written")
    parts, router = folder / "parts", folder / "router" / "machine.toml"
    job = parts / "brackets" / "board.toml"
    for name in ("one.ngc", "brackets/two.ngc"):
        alone = olp.correct(parts / name, folder / "mill" / "machine.toml")
        assert (folder / "out" / name).read_bytes() == alone.data
    alone = olp.correct(parts / "brackets" / "board.nc", router, job)
    assert (folder / "out" / "brackets" / "board.nc").read_bytes() == alone.data
    # the two machines lean to different sides
    assert alone.data != olp.correct(parts / "brackets" / "board.nc", folder / "mill" / "machine.toml").data


def test_rows_state_the_figures_of_the_reports(folder: Path) -> None:
    result = correct_all(folder, reports="json")
    for row in result.report["programs"]:
        stated = json.loads((folder / "out" / row["report"]).read_bytes())
        assert row["moves"] == stated["program"]["moves"]
        assert row["corrected_um"] == stated["verdict"]["numerical"]["largest_um"]
        assert row["uncorrected_um"] == stated["deviation"]["before"]["between"]["max_um"]
        assert row["calibration"]["sha256"] == stated["calibration"]["sha256"]
        assert row["exit_code"] == 0


def test_a_report_is_that_of_the_verb_correct(folder: Path) -> None:
    correct_all(folder, reports="md")
    session = Session.start(folder / "mill" / "machine.toml")
    source = session.sources.source(folder / "parts" / "one.ngc")
    alone = olp.correct(folder / "parts" / "one.ngc", folder / "mill" / "machine.toml")
    wanted = reports.correction(alone, source, session, CorrectOptions(), "report.md")
    assert (folder / "out" / "one.ngc.report.md").read_bytes() == wanted


def test_nothing_is_written_where_nothing_has_changed(folder: Path) -> None:
    correct_all(folder, reports="html")
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    again = correct_all(folder, reports="html")
    assert states(again) == dict.fromkeys(ALL, "unchanged")
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


def changed_by(folder: Path, file: str, old: str, new: str) -> dict[str, str]:
    path = folder / file
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return {name: state for name, state in states(correct_all(folder)).items() if state != "unchanged"}


@pytest.mark.parametrize(("file", "old", "new", "done"), [
    ("parts/one.ngc", "X100 Y0", "X101 Y0", {"one.ngc"}),
    ("mill/calibration.toml", "203.3", "213.3", {"one.ngc", "brackets/two.ngc"}),
    ("router/calibration.toml", "-503.7", "-403.7", {"brackets/board.nc"}),
    ("mill/machine.toml", "500.0", "400.0", {"one.ngc", "brackets/two.ngc"}),
    ("parts/brackets/board.toml", "X = 0.0", "X = 1.0", {"brackets/board.nc"}),
])  # fmt: skip
def test_only_what_changed_is_done_again(folder: Path, file: str, old: str, new: str, done: set[str]) -> None:
    correct_all(folder)
    assert changed_by(folder, file, old, new) == dict.fromkeys(done, "written")
    assert changed_by(folder, file, new, new) == {}


def test_other_options_are_another_correction(folder: Path) -> None:
    correct_all(folder)
    options = CorrectOptions(part_tolerance_um=5.0)
    assert states(correct_all(folder, options=options)) == dict.fromkeys(ALL, "written")
    day = CorrectOptions(date=datetime.date(2026, 5, 1))
    assert states(correct_all(folder, options=day)) == dict.fromkeys(ALL, "written")
    assert states(correct_all(folder, options=day)) == dict.fromkeys(ALL, "unchanged")


def test_another_version_is_another_correction(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    correct_all(folder)
    for module in ("batch", "batch_work"):
        monkeypatch.setattr(f"olp.workflows.{module}.__version__", "99.0")
    monkeypatch.setattr("olp.workflows.batch_work.Task.__init__", _of_version("99.0"))
    assert states(correct_all(folder)) == dict.fromkeys(ALL, "written")


def _of_version(version: str):  # type: ignore[no-untyped-def]
    from olp.workflows.batch_task import Task

    made = Task.__init__

    def init(self: Task, *words: object, **named: object) -> None:
        made(self, *words, **{**named, "version": version})

    return init


def test_what_is_missing_is_written_again_with_the_same_bytes(folder: Path) -> None:
    correct_all(folder, reports="json")
    before = contents(folder / "out")
    (folder / "out" / "one.ngc").unlink()
    (folder / "out" / "brackets" / "two.ngc.report.json").unlink()
    result = correct_all(folder, reports="json")
    assert states(result) == {
        "one.ngc": "written",
        "brackets/two.ngc": "written",
        "brackets/board.nc": "unchanged",
    }
    after = contents(folder / "out")
    assert {**after, "index.html": b""} == {**before, "index.html": b""}


def test_a_moved_plant_has_nothing_to_do(folder: Path) -> None:
    correct_all(folder)
    assert states(correct_all(moved(folder, "other"))) == dict.fromkeys(ALL, "unchanged")


def test_a_program_that_is_gone_is_listed_until_its_output_is(folder: Path) -> None:
    correct_all(folder)
    (folder / "parts" / "one.ngc").unlink()
    result = correct_all(folder)
    assert [row["program"] for row in result.report["others"]] == ["one.ngc"]
    assert "From earlier calls" in (folder / "out" / "index.html").read_text()
    (folder / "out" / "one.ngc").unlink()
    assert correct_all(folder).report["others"] == []


# -- what is never overwritten -------------------------------------------------------------------


def test_a_file_of_another_hand_is_left(folder: Path) -> None:
    (folder / "out").mkdir()
    (folder / "out" / "one.ngc").write_text("mine\n")
    result = correct_all(folder, keep_going=True)
    assert (folder / "out" / "one.ngc").read_text() == "mine\n"
    assert states(result)["one.ngc"] == "refused"
    assert result.exit_code == 2
    row = next(row for row in result.report["programs"] if row["program"] == "one.ngc")
    assert row["message"].endswith(
        "one.ngc: is not what olp batch wrote; move it, or overwrite it with --force"
    )
    assert states(correct_all(folder, force=True))["one.ngc"] == "written"


def test_an_edited_output_is_left(folder: Path) -> None:
    correct_all(folder)
    edited = folder / "out" / "one.ngc"
    edited.write_bytes(edited.read_bytes() + b"(mine)\n")
    result = correct_all(folder)
    assert edited.read_bytes().endswith(b"(mine)\n")
    assert (states(result)["one.ngc"], result.exit_code) == ("refused", 2)


def test_an_index_of_another_hand_is_left(folder: Path) -> None:
    (folder / "out").mkdir()
    (folder / "out" / "index.html").write_text("mine")
    assert correct_all(folder).report["index"] is None
    assert (folder / "out" / "index.html").read_text() == "mine"


def test_an_output_that_a_killed_run_left_is_known(folder: Path) -> None:
    """A line of the history comes before its files: with the line alone, and with a line cut in two."""
    correct_all(folder)
    history = folder / "out.history.jsonl"
    before = (folder / "out" / "one.ngc").read_bytes()
    lines = history.read_bytes()
    (folder / "parts" / "one.ngc").write_text(program(120))
    correct_all(folder)
    new = (folder / "out" / "one.ngc").read_bytes()
    (folder / "out" / "one.ngc").write_bytes(before)
    assert states(correct_all(folder))["one.ngc"] == "written"
    assert (folder / "out" / "one.ngc").read_bytes() == new
    cut = next(line for line in history.read_bytes()[len(lines) :].splitlines() if b'"one.ngc"' in line)
    history.write_bytes(lines + cut[: len(cut) // 2])
    (folder / "out" / "one.ngc").write_bytes(before)
    assert states(correct_all(folder))["one.ngc"] == "written"


def test_a_damaged_history_is_refused_with_its_line(folder: Path) -> None:
    correct_all(folder)
    history = folder / "out.history.jsonl"
    history.write_bytes(b'{"schema": "olp-history-1"}\n' + history.read_bytes())
    with pytest.raises(InputError, match=r"out\.history\.jsonl:1: is no line of a history"):
        correct_all(folder)


@pytest.mark.parametrize("output", ["parts", ".", "mill/machine.toml"])
def test_an_output_that_would_hold_the_programs_is_refused(folder: Path, output: str) -> None:
    with pytest.raises(UsageError):
        batch([folder / "parts"], folder / "mill" / "machine.toml", output=folder / output, workers=1)


# -- what is found -------------------------------------------------------------------------------


def why(result: olp.Batch) -> dict[str, str]:
    return {Path(one["file"]).name: one["why"] for one in result.report["skipped"]}


def test_corrected_programs_are_left_out_with_a_word(folder: Path) -> None:
    parts = folder / "parts"
    done = olp.correct(parts / "one.ngc", folder / "mill" / "machine.toml").data
    (parts / "stamped.ngc").write_bytes(done)
    (parts / "one.corrected.ngc").write_text(program(1))
    (parts / ".hidden.ngc").write_text(program(1))
    (parts / "notes.txt").write_text("no program")
    result = correct_all(folder)
    assert set(states(result)) == ALL
    stamp = done[done.index(b"olp-corrected") :][:26].decode()
    assert why(result) == {
        "stamped.ngc": f"it has the stamp `{stamp}` of a correction",
        "one.corrected.ngc": "it is the corrected program of the file beside it",
    }


def test_an_output_folder_inside_is_left_out(folder: Path) -> None:
    result = batch([folder], folder / "mill" / "machine.toml", output=folder / "parts" / "out", workers=1)
    assert set(states(result)) == {f"parts/{name}" for name in ALL}
    again = batch([folder], folder / "mill" / "machine.toml", output=folder / "parts" / "out", workers=1)
    assert set(states(again).values()) == {"unchanged"}


def test_without_a_machine_only_jobs_are_done(folder: Path) -> None:
    result = correct_all(folder, machine=None)
    assert set(states(result)) == {"brackets/board.nc"}
    assert why(result) == dict.fromkeys(
        ("one.ngc", "two.ngc"), "no job file names it, and no machine is given with -m"
    )


def test_two_jobs_of_one_program_have_two_outputs(folder: Path) -> None:
    brackets = folder / "parts" / "brackets"
    (brackets / "second.toml").write_text(
        'schema = "olp-job-1"\nprogram = "board.nc"\nmachine = "../../mill/machine.toml"\n' + START
    )
    result = correct_all(folder)
    assert {"brackets/board.board.nc", "brackets/board.second.nc"} < set(states(result))
    outputs = contents(folder / "out" / "brackets")
    assert outputs["board.board.nc"] != outputs["board.second.nc"]


def test_a_job_keeps_its_machine(folder: Path) -> None:
    """-m is for programs whose job names none: a job would else be corrected for a machine it is not for."""
    result = correct_all(folder)
    machines = {row["program"]: row["calibration"]["sha256"] for row in result.report["programs"]}
    assert machines["one.ngc"] == machines["brackets/two.ngc"] != machines["brackets/board.nc"]


def test_several_folders_keep_their_names(folder: Path) -> None:
    (folder / "more").mkdir()
    (folder / "more" / "one.ngc").write_text(program(50))
    machine = folder / "mill" / "machine.toml"
    result = batch([folder / "parts", folder / "more"], machine, output=folder / "out", workers=1)
    assert {"parts/one.ngc", "more/one.ngc"} < set(states(result))
    with pytest.raises(UsageError, match="two folders of this call are called 'more'"):
        batch([folder / "more", folder / "parts" / ".." / "more"], machine, output=folder / "out", workers=1)


def found(folder: Path, **words: tuple[str, ...]) -> set[str]:
    where = Where(
        folders=(str(folder / "parts"),), output=str(folder / "out"),
        machine=str(folder / "mill" / "machine.toml"), **words,
    )  # fmt: skip
    return set(states(run(where, BatchOptions(reports=""), lambda tasks: Here())))


def test_patterns_of_names(folder: Path) -> None:
    (folder / "parts" / "O1234").write_text(program(10))
    assert found(folder) == ALL
    assert found(folder, include=("O*",)) == {*ALL, "O1234"}
    assert found(folder, exclude=("brackets/t*",)) == ALL - {"brackets/two.ngc"}
    assert found(folder, exclude=("*.toml", "one.*")) == ALL - {"one.ngc"}


def test_folders_without_programs_are_refused(folder: Path) -> None:
    (folder / "empty").mkdir()
    with pytest.raises(InputError, match="empty: holds no program to correct; expected files that end in"):
        batch([folder / "empty"], folder / "mill" / "machine.toml", output=folder / "out", workers=1)


# -- programs that fail --------------------------------------------------------------------------


@pytest.fixture
def failing(folder: Path) -> Path:
    (folder / "parts" / "a-bad.ngc").write_text("G21 G90 G54\nG1 X10 F100\nG68 X0 Y0 R30\nM2\n")
    return folder


def test_the_first_refusal_is_the_last_program_begun(failing: Path) -> None:
    result = correct_all(failing)
    assert result.exit_code == 3
    assert states(result)["a-bad.ngc"] == "refused"
    assert set(states(result).values()) == {"refused", "not done"}
    assert not (failing / "out" / "one.ngc").exists()


def test_a_call_that_keeps_going_does_the_others(failing: Path) -> None:
    result = correct_all(failing, keep_going=True)
    assert states(result) == {**dict.fromkeys(ALL, "written"), "a-bad.ngc": "refused"}
    assert result.exit_code == 3
    worst = result.report["programs"][0]
    assert worst["program"] == "a-bad.ngc"
    assert "a-bad.ngc:3:" in worst["message"]
    assert [f["code"] for f in worst["findings"]]
    # the same refusal without reading it again
    again = correct_all(failing, keep_going=True)
    assert again.report["programs"] == [
        row | ({} if row["state"] == "refused" else {"state": "unchanged"})
        for row in result.report["programs"]
    ]


def test_an_output_of_an_earlier_call_is_pointed_at(folder: Path) -> None:
    correct_all(folder)
    (folder / "parts" / "one.ngc").write_text("G21 G90\nG68 X0 Y0 R30\nG1 X1 F100\n")
    row = correct_all(folder, keep_going=True).report["programs"][0]
    assert (row["program"], row["state"], row["older_output"]) == ("one.ngc", "refused", True)


def test_a_machine_that_is_wrong_refuses_its_programs_alone(folder: Path) -> None:
    (folder / "router" / "machine.toml").write_text("schema = 1\n")
    result = correct_all(folder, keep_going=True)
    assert states(result) == {
        "one.ngc": "written", "brackets/two.ngc": "written", "brackets/board.nc": "refused"
    }  # fmt: skip
    assert "machine.toml" in result.report["programs"][0]["message"]
    assert result.exit_code == 3
    plant_again = plant(folder.with_name("again"))
    (folder / "router" / "machine.toml").write_bytes((plant_again / "router" / "machine.toml").read_bytes())
    assert states(correct_all(folder))["brackets/board.nc"] == "written"


def test_the_exit_code_is_the_worst_of_the_programs(folder: Path) -> None:
    worse = CorrectOptions(part_tolerance_um=0.01)
    result = correct_all(folder, options=worse)
    assert result.exit_code == 1
    assert {row["exit_code"] for row in result.report["programs"]} == {1}
    assert (folder / "out" / "one.ngc").is_file()


def test_an_interrupt_keeps_what_is_done(folder: Path) -> None:
    def interrupt(what: str, share: float) -> None:
        if what.startswith("2 of 3"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        correct_all(folder, progress=interrupt)
    assert sorted(states(correct_all(folder)).values()) == ["unchanged", "unchanged", "written"]


# -- subprograms ---------------------------------------------------------------------------------

CALLING = "G21 G90 G54 G64 P0.02\nG1 X0 Y0 Z0 F1000\no<side> call\nM2\n"
SIDE = "o<side> sub\nG1 X{} Y50\no<side> endsub\n"


def test_a_subprogram_is_an_input(folder: Path) -> None:
    (folder / "parts" / "calling.ngc").write_text(CALLING)
    options, words = CorrectOptions(flatten=True), {"keep_going": True}
    assert states(correct_all(folder, options=options, **words))["calling.ngc"] == "refused"
    (folder / "parts" / "side.ngc").write_text(SIDE.format(60))
    first = states(correct_all(folder, options=options, **words))
    assert first["calling.ngc"] == "written"
    assert states(correct_all(folder, options=options, **words))["calling.ngc"] == "unchanged"
    (folder / "parts" / "side.ngc").write_text(SIDE.format(70))
    assert states(correct_all(folder, options=options, **words))["calling.ngc"] == "written"
    alone = olp.correct(folder / "parts" / "calling.ngc", folder / "mill" / "machine.toml", flatten=True)
    assert (folder / "out" / "calling.ngc").read_bytes() == alone.data


def test_a_report_that_is_not_asked_for_any_more_goes(folder: Path) -> None:
    """A report of the last correction beside the program of this one would tell of another program."""
    correct_all(folder, reports="html")
    kept = folder / "out" / "brackets" / "two.ngc.report.html"
    kept.write_bytes(b"my notes")
    correct_all(folder)
    assert not (folder / "out" / "one.ngc.report.html").exists()
    assert kept.read_bytes() == b"my notes"


def test_two_calls_do_not_write_into_one_folder_at_once(folder: Path) -> None:
    with writing(folder / "out"):
        with pytest.raises(CannotCompute, match="another olp batch is writing there"):
            correct_all(folder)
        assert not (folder / "out").exists()
    correct_all(folder)
    with writing(folder / "out"), pytest.raises(CannotCompute, match="another olp batch"):
        release(folder / "out", "first")


# -- workers -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_other_workers_give_the_same_bytes(folder: Path) -> None:
    correct_all(folder, reports="html")
    other = moved(folder, "other")
    (other / "out.history.jsonl").unlink()
    correct_all(other, reports="html", workers=2, force=True)
    mine, theirs = contents(folder / "out"), contents(other / "out")
    assert {**mine, "index.html": b""} == {**theirs, "index.html": b""}


def test_one_worker_is_this_process() -> None:
    assert isinstance(opened(1, None, 5), Here)
    assert isinstance(opened(None, None, 1), Here)


def test_the_output_may_be_named_from_another_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    correct_all(folder)
    monkeypatch.chdir(folder / "parts")
    result = batch(
        [os.curdir], Path("..", "mill", "machine.toml"), output=Path("..", "out"), workers=1, reports=""
    )
    assert states(result) == dict.fromkeys(ALL, "unchanged")


def test_known_errors_stand_in_place_of_a_machine(folder: Path) -> None:
    for name in ("one.ngc", "brackets/two.ngc"):
        path = folder / "parts" / name
        path.write_text(path.read_text().replace(" G64 P0.02", ""))
    known = KnownErrors.of(skew=["XY=0.2mm/m"])
    result = correct_all(folder, machine=known, reports="html")
    assert set(states(result).values()) == {"written"}
    alone = olp.correct(folder / "parts" / "one.ngc", known)
    assert (folder / "out" / "one.ngc").read_bytes() == alone.data
    # the job keeps its machine
    router = olp.correct(
        folder / "parts" / "brackets" / "board.nc", folder / "router" / "machine.toml",
        folder / "parts" / "brackets" / "board.toml",
    )  # fmt: skip
    assert (folder / "out" / "brackets" / "board.nc").read_bytes() == router.data
    assert set(states(correct_all(folder, machine=known, reports="html")).values()) == {"unchanged"}
    other = KnownErrors.of(skew=["XY=0.3mm/m"])
    done = states(correct_all(folder, machine=other, reports="html"))
    assert done == {"one.ngc": "written", "brackets/two.ngc": "written", "brackets/board.nc": "unchanged"}


def test_an_output_that_cannot_be_written_is_a_row(folder: Path) -> None:
    (folder / "parts" / "two").mkdir()
    (folder / "parts" / "two" / "a.ngc").write_text(program(120))
    (folder / "out").mkdir()
    # a file where the folder of an output would be
    (folder / "out" / "brackets").write_text("")
    result = correct_all(folder, keep_going=True)
    states_now = states(result)
    assert (states_now["one.ngc"], states_now["two/a.ngc"]) == ("written", "written")
    rows = {row["program"]: row for row in result.report["programs"]}
    assert "is a file" in rows["brackets/two.ngc"]["message"]
    assert rows["brackets/two.ngc"]["exit_code"] == result.exit_code


def test_a_row_that_is_refused_shows_nothing_of_an_earlier_call(folder: Path) -> None:
    correct_all(folder, reports="md")
    (folder / "mill" / "machine.toml").write_text("schema = 1\n")
    rows = {
        row["program"]: row for row in correct_all(folder, reports="md", keep_going=True).report["programs"]
    }
    assert rows["one.ngc"]["older_output"]
    assert rows["one.ngc"]["report"] is None and rows["one.ngc"]["released"] is None


@pytest.mark.parametrize("name", ["", ".", "..", "a\\u0000.ngc"])
def test_a_job_without_a_program_of_a_name_is_refused(name: str, folder: Path) -> None:
    for job in ("a.toml", "b.toml"):
        (folder / "parts" / job).write_text(f'schema = "olp-job-1"\nprogram = "{name}"\n{START}')
    result = correct_all(folder, keep_going=True)
    assert [row["exit_code"] for row in result.report["programs"]].count(3) == 2
    assert "expected names of files" in result.report["programs"][0]["message"]


def test_a_folder_that_may_not_be_read_is_not_left_out(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scan = os.scandir

    def refused(path: object) -> object:
        if str(path).endswith("brackets"):
            raise PermissionError(13, "Permission denied", str(path))
        return scan(path)  # type: ignore[call-overload]

    monkeypatch.setattr(os, "scandir", refused)
    with pytest.raises(InputError, match=r"brackets: may not be read .Permission denied."):
        correct_all(folder)
