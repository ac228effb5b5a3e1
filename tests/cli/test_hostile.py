"""No output carries script, a formula or a broken line, whatever names, comments and texts hold."""

from __future__ import annotations

import csv
import io
import json
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import pytest
from cases.acceptance import TRUE_ZERO, machine
from cases.gate import block
from cli.test_cli import run

SCRIPT = "<script>alert(1)</script><img src=x onerror=alert(2)>"
FORMULA = "=HYPERLINK(1)"
#: file names, with the marks of HTML, Markdown, CSV and shells; a slash is in none
NAMES = ("<script>alert(1)<img src=x onerror=alert(2)>.nc", FORMULA + ".nc", "a\nb,\"c'&`|*.nc", "\udcff.nc")
HEAD = "G21 G90 G54 G64 P0.02\n"
BODY = f"; </script>{SCRIPT} -->\nG1 X40 F3000\nG1 Y40 ;{SCRIPT}\nX0\n"


class Elements(HTMLParser):
    """The elements of a page, and the attributes that run something."""

    def __init__(self) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.running: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.names.add(tag)
        self.running += [name for name, _ in attributes if name.startswith("on")]
        self.running += [v for _, v in attributes if v and v.strip().lower().startswith("javascript:")]


def elements(page: bytes) -> Elements:
    parser = Elements()
    parser.feed(page.decode())
    return parser


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    quoted = json.dumps(SCRIPT)
    start = "start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }\n"
    mesh = f'[[meshes]]\nfile = "{FORMULA}.stl"\nrole = "fixture"\nframe = "G54"\n'
    path = machine(tmp_path, tables=TRUE_ZERO, job=start + mesh)
    text = path.read_text()
    name = next(line for line in text.split("\n") if line.startswith("name ="))
    path.write_text(text.replace(name, f"name = {quoted}", 1))
    calibration = tmp_path / "calibration.toml"
    text = calibration.read_text()
    name = next(line for line in text.split("\n") if line.startswith("machine ="))
    calibration.write_text(text.replace(name, f"machine = {quoted}", 1))
    (tmp_path / f"{FORMULA}.stl").write_bytes(block((400.0, 0.0, 0.0), (410.0, 10.0, 10.0)))
    (tmp_path / "points.csv").write_text(
        "X_mm,Y_mm,Z_mm\n" + "".join(f"{k},{k % 7},0\n" for k in range(0, 90, 2))
    )
    return tmp_path


def program(folder: Path, name: str) -> str:
    try:
        (folder / name).write_text(HEAD + BODY)
    except (OSError, UnicodeError):
        pytest.skip("this system has no such names")
    return name


@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
@pytest.mark.parametrize("form", ["text", "json", "sarif", "junit"])
def test_the_forms_of_a_check(folder: Path, name: str, form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    words = ("check", program(folder, name), "-j", "job.toml", "--fail-on", "never", "--clearances", "c.csv")
    result = run(*words, "--format", form, "-o", "out", "--force")
    assert result.exit_code == 0, result.stderr
    text = (folder / "out").read_text("utf-8")
    if form in ("json", "sarif"):
        json.loads(text)
    elif form == "junit":
        tags = {element.tag for element in ElementTree.fromstring(text).iter()}
        assert tags <= {
            *("testsuites", "testsuite", "properties", "property", "testcase", "failure"),
            *("system-out", "system-err"),
        }
    for row in csv.reader(io.StringIO((folder / "c.csv").read_text("utf-8"))):
        assert len(row) == 9
        assert all(cell.lstrip()[:1] not in "=+@" or not cell for cell in row), row


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_the_reports_and_the_page_of_a_correction(
    folder: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    program(folder, name)
    words = ("correct", name, "-j", "job.toml", "-o", "out.nc", "--force", "--fail-on", "never")
    for report, more in (("r.html", ("--review", "page.html")), ("r.md", ()), ("r.json", ())):
        result = run(*words, "--report", report, *more)
        assert result.exit_code == 0, result.stderr
    page = elements((folder / "r.html").read_bytes())
    assert not page.names & {"script", "img", "iframe", "object"} and not page.running
    clean = [
        line for line in (folder / "r.md").read_text("utf-8").split("\n") if "<" in line.replace("\\<", "")
    ]
    assert clean == []
    json.loads((folder / "r.json").read_text())
    review = elements((folder / "page.html").read_bytes())
    assert "img" not in review.names and not review.running
    assert b"alert(1)</script>" not in (folder / "page.html").read_bytes()


@pytest.mark.parametrize("name", NAMES[:3], ids=range(3))
def test_the_table_of_a_comparison(folder: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    (folder / name).write_text((folder / "points.csv").read_text())
    result = run("compare", "points.csv", name, "-o", "out.csv", "--force", "--fail-on", "never")
    assert result.exit_code == 0, result.stderr
    rows = list(csv.reader(io.StringIO((folder / "out.csv").read_text("utf-8"))))
    assert len(rows) == 46 and {len(row) for row in rows} == {11}
    assert all(row[0][:1] != "=" for row in rows)


@pytest.mark.parametrize("words", [
    ["check", "part.ngc", "-o"], ["check", "part.ngc", "--clearances"], ["correct", "part.ngc", "-o"],
    ["simulate", "part.ngc", "-o"], ["retime", "part.ngc", "-o"], ["retime", "part.ngc", "--lines"],
    ["retime", "part.ngc", "--write-feed"], ["compare", "points.csv", "points.csv", "-o"],
    ["compare", "points.csv", "points.csv", "--save-profile"],
])  # fmt: skip
@pytest.mark.parametrize("ending", ["html", "SVG", "xhtml"])
def test_what_is_no_page_is_not_named_as_one(
    folder: Path, words: list[str], ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    (folder / "part.ngc").write_text(HEAD + "G1 X4 F3000\n")
    result = run(*words, f"out.{ending}", "-j", "job.toml")
    assert result.exit_code == 2
    assert "ends as a page, which a browser would run; give it another ending" in result.stderr
    assert not (folder / f"out.{ending}").exists()


def test_messages_have_no_control_characters(folder: Path) -> None:
    (folder / "part.ngc").write_bytes(b"G21\n\x1b[2J\x1b]0;title\x07 G1 X\x9b5m #\n")
    result = run("correct", folder / "part.ngc", "-j", folder / "job.toml")
    assert result.exit_code == 3
    assert all(c.isprintable() or c == "\n" for c in result.stderr)


def test_a_program_that_is_named_as_a_page_needs_another_name(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    (folder / program(folder, "part.nc")).rename("part.html")
    assert run("correct", "part.html", "-j", "job.toml").exit_code == 2
    assert run("correct", "part.html", "-j", "job.toml", "-o", "out.nc").exit_code == 0
