"""`olp batch` as people call it: exit codes, what is shown, the page of the plant, watching, releases."""

from __future__ import annotations

import json
import os
import re
import sys
import urllib.parse
from pathlib import Path

import pytest
from cases.plants import contents, plant, program
from cli.test_cli import run

import olp
from olp.cli import common


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(plant(tmp_path / "plant"))
    return tmp_path / "plant"


CALL = ("batch", "parts", "-m", "mill/machine.toml", "-o", "out", "--workers", "1")


def test_a_summary_and_a_page_of_the_plant(folder: Path) -> None:
    result = run(*CALL)
    assert result.exit_code == 0, result.stderr
    assert result.stderr == ""
    lines = result.stdout.splitlines()
    assert lines[0] == "Largest deviation from the nominal path in um, the worst programs first"
    assert re.search(r"brackets/two\.ngc +4 +40\.66 +0\.34 +good +OLP203 +0 +written", result.stdout)
    assert lines[-1] == "3 written. No program of 3 has a finding that fails it."
    again = run(*CALL)
    assert again.stdout.splitlines()[-1] == "3 unchanged. No program of 3 has a finding that fails it."


def test_times_of_programs_and_of_all_together(folder: Path) -> None:
    """Those of a machine without limits are not known, which fails nothing."""
    machine, router = (folder / name / "machine.toml" for name in ("mill", "router"))
    router.write_text(router.read_text().replace("jerk_mm_s3 = 20000.0\n", ""))
    stated = json.loads(run(*CALL, "--times", "--json").stdout)
    rows = {row["program"]: row["time"] for row in stated["programs"]}
    assert "jerk" in rows.pop("brackets/board.nc")["unknown"]
    for name, time in rows.items():
        for key, text in (("nominal_s", folder / "parts" / name), ("corrected_s", folder / "out" / name)):
            assert time[key] == olp.retime(text, machine).duration_s
    whole = stated["time"]
    assert (whole["programs"], whole["unknown"]) == (2, 1)
    for key in ("nominal_s", "corrected_s"):
        assert whole[key] == pytest.approx(sum(time[key] for time in rows.values()), rel=1e-12)
    again = run(*CALL, "--times").stdout
    assert f"Time: {whole['corrected_s']:.2f} s for 2 corrected programs, " in again
    assert "; 1 not known." in again.replace("\n  ", " ")
    assert f"{whole['corrected_s']:.2f} s for 2" in (folder / "out" / "index.html").read_text()
    # without them nothing is timed
    assert json.loads(run(*CALL, "--json").stdout)["time"] is None


def test_the_page_leads_to_files_that_are_there(folder: Path) -> None:
    (folder / "parts" / "a b#%.ngc").write_text(program(7))
    assert run(*CALL).exit_code == 0
    page = (folder / "out" / "index.html").read_text()
    links = [urllib.parse.unquote(link) for link in re.findall(r'href="([^"]+)"', page)]
    assert len(links) == 8
    assert [link for link in links if not (folder / "out" / link).is_file()] == []
    assert "<script" not in page
    assert not re.search(r'(?:src|href)="(?:https?:)?//', page)


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are bytes on Linux alone")
def test_a_name_that_is_no_text_is_shown_and_led_to(folder: Path) -> None:
    name = os.fsdecode(b"odd\xff.ngc")
    (folder / "parts" / name).write_text(program(7))
    assert run(*CALL, "--report", "report.md").exit_code == 0
    assert (folder / "out" / name).is_file()
    assert 'href="odd%FF.ngc"' in (folder / "out" / "index.html").read_text()
    assert "4 unchanged" in run(*CALL).stdout


def test_a_report_elsewhere_leads_to_the_same_files(folder: Path) -> None:
    (folder / "filed").mkdir()
    for name in ("summary.html", "summary.md", "summary.json"):
        assert run(*CALL, "--report", f"filed/{name}").exit_code == 0
    markdown = (folder / "filed" / "summary.md").read_text()
    links = [urllib.parse.unquote(link) for link in re.findall(r"\]\(([^)]+)\)", markdown)]
    assert links and [link for link in links if not (folder / "filed" / link).is_file()] == []
    stated = json.loads((folder / "filed" / "summary.json").read_bytes())
    assert stated["schema"] == "olp-batch-1"
    assert len(stated["programs"]) == 3


def test_json_is_the_report(folder: Path) -> None:
    stated = json.loads(run(*CALL, "--json").stdout)
    assert [row["exit_code"] for row in stated["programs"]] == [0, 0, 0]
    assert stated["exit_code"] == 0


def test_the_worst_programs_come_first(folder: Path) -> None:
    (folder / "parts" / "bad.ngc").write_text("G68 X0 Y0 R30\n")
    result = run(*CALL, "--keep-going", "--part-tolerance-um", "0.01")
    assert result.exit_code == 3
    rows = re.findall(r"^  (\S+\.\w+) .* (\d)  +(\w+)$", result.stdout, re.M)
    assert rows[0][:2] == ("bad.ngc", "3")
    assert [code for _, code, _ in rows] == ["3", "1", "1", "1"]
    assert "Not written (1)" in result.stdout
    page = (folder / "out" / "index.html").read_text()
    assert page.index("bad.ngc") < page.index("one.ngc")


def test_without_keep_going_the_call_ends(folder: Path) -> None:
    (folder / "parts" / "bad.ngc").write_text("G68 X0 Y0 R30\n")
    result = run(*CALL)
    assert result.exit_code == 3
    assert "not done" in result.stdout
    assert run(*CALL, "--fail-on", "never").exit_code == 3


def test_fail_on_is_that_of_correct_and_makes_nothing_new(folder: Path) -> None:
    run(*CALL)
    before = contents(folder / "out")
    result = run(*CALL, "--fail-on", "info")
    assert result.exit_code == 1
    assert {**contents(folder / "out"), "index.html": b""} == {**before, "index.html": b""}


def test_a_quiet_call_says_nothing(folder: Path) -> None:
    result = run(*CALL, "-q")
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")


@pytest.mark.slow
def test_review_pages_where_they_are_asked_for(folder: Path) -> None:
    assert run(*CALL, "--pages", "--reports", "none").exit_code == 0
    assert (folder / "out" / "one.ngc.review.html").stat().st_size > 100_000
    assert 'href="one.ngc.review.html"' in (folder / "out" / "index.html").read_text()


@pytest.mark.slow
def test_plots_where_they_are_asked_for(folder: Path) -> None:
    assert run(*CALL).exit_code == 0
    assert b"<svg" not in (folder / "out" / "one.ngc.report.html").read_bytes()
    assert run(*CALL, "--plots").exit_code == 0
    assert b"<svg" in (folder / "out" / "one.ngc.report.html").read_bytes()


def test_a_release_and_what_a_new_calibration_changes(folder: Path) -> None:
    run(*CALL)
    result = run("batch", "-o", "out", "--release", "may", "--date", "2026-05-14")
    assert result.exit_code == 0, result.stderr
    assert "Released as may: 3 programs; kept in " in result.stdout
    calibration = (folder / "mill" / "calibration.toml").read_text()
    (folder / "new.toml").write_text(calibration.replace("203.3", "233.3"))
    result = run("batch", "-o", "out", "--what-if", "new.toml", "--workers", "1", "--report", "new.html")
    assert result.exit_code == 1
    assert re.search(r"brackets/two\.ngc +may +0\.\d\d +5\.66 +1\.87 +3\.79 +OUTSIDE", result.stdout)
    assert "2 of 2 released programs of mill are outside tolerance" in result.stdout
    assert "Not judged, as they are for other machines: 1." in " ".join(result.stdout.split())
    assert b"OUTSIDE" in (folder / "new.html").read_bytes()
    stated = json.loads(run("batch", "-o", "out", "--what-if", "new.toml", "--workers", "1", "--json").stdout)
    assert stated["outside"] == 2


def test_a_watch_ends_well_with_an_interrupt(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from olp.workflows import batch_watch

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(batch_watch, "_wait_for_change", interrupt)
    result = run(*CALL, "--watch")
    assert result.exit_code == 0
    assert "3 written." in result.stdout
    assert result.stderr.splitlines() == ["olp: waiting for changes; end with Ctrl-C", "olp: ended"]


def test_an_interrupt_of_a_call_says_what_stays(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from olp.workflows import batch_work

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(batch_work, "_corrected", interrupt)
    result = run(*CALL)
    assert result.exit_code == 130
    assert "the same call goes on" in result.stderr


@pytest.mark.parametrize(("words", "says"), [
    (["parts", "-o", "-"], "-o is a folder and cannot be -"),
    (["parts", "-o", "out", "--release", "a", "--watch"], "--watch and --release exclude each other"),
    (["parts", "-o", "out", "--release", "a"], "leave the folders of programs out"),
    (["-o", "out", "--what-if", "a", "-m", "mill/machine.toml"], "leave -m and -j out"),
    (["parts", "-o", "out", "--watch", "--json"], "--watch goes on, and excludes --json and --report"),
    (["parts", "-o", "out", "--cluster", "x", "--workers", "2"], "--workers and --cluster exclude"),
    (["parts", "-o", "out", "--plots", "--reports", "md"], "--plots goes with --reports html"),
    (["-o", "out", "-m", "mill/machine.toml"], "no folder is given"),
    (["absent", "-o", "out", "-m", "mill/machine.toml"], "absent: is no folder"),
    (["parts", "-o", "out", "--report", "absent/a.html", "-m", "mill/machine.toml"], "there is no folder"),
])  # fmt: skip
def test_calls_that_cannot_be(folder: Path, words: list[str], says: str) -> None:
    result = run("batch", *words)
    assert result.exit_code in (2, 3)
    assert says in result.stderr
    assert not (folder / "out").exists()


def test_every_page_ending_is_refused_as_an_output(folder: Path) -> None:
    (folder / "parts" / "page.svg").write_text(program(3))
    (folder / "parts" / "page.toml").write_text(
        'schema = "olp-job-1"\nprogram = "page.svg"\nmachine = "../mill/machine.toml"\n'
    )
    result = run(*CALL, "--keep-going")
    assert result.exit_code == 3
    assert "ends as a page" in result.stdout
    assert common.no_page("a.nc") == "a.nc"
