"""The papers are right: sentences, words, links, tables, and what `olp help` answers."""

from __future__ import annotations

import functools
import re
import statistics
import tomllib
from collections.abc import Iterator
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import pytest
from benchmarks import figures
from cases.fast import in_each
from click.testing import CliRunner
from docs import write_reference
from docs.blocks import DOCS, README, ROOT
from docs.prose import LONGEST, MEAN, Sentence, modules, of_module, of_paper
from docs.words import PATTERN, instead
from markdown_it import MarkdownIt

from olp.cli import main
from olp.files import handbook
from olp.findings.catalogue import RULES
from olp.reports import handbook_search
from olp.reports.handbook import for_terminal
from olp.reports.handbook_site import site

#: Deviations may change a little from one version of numpy to the next.
SAME_UM = 0.1
#: What was, in its own words.
HISTORY = {DOCS / "changes.md", DOCS / "contributing" / "moved.md"}
PAGES = [README, *sorted(DOCS.rglob("*.md"))]
_LINK = re.compile(r"\]\(([^)\s]+)\)")


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def anchor(title: str) -> str:
    return re.sub(r"[^\w]+", "-", re.sub(r"[`*]", "", title.lower())).strip("-")


# -- sentences and words -------------------------------------------------------------------------


@pytest.mark.slow
@in_each([*PAGES, *modules()], name_of)
def test_no_sentence_is_too_long(path: Path) -> None:
    sentences = of_paper(path) if path.suffix == ".md" else of_module(path)
    assert [f"line {s.line}: {s.text}" for s in sentences if s.words > LONGEST] == []


def mean(sentences: Iterator[Sentence]) -> float:
    """Words of a sentence in the mean, of those that are sentences and not cells or titles."""
    return statistics.fmean([s.words for s in sentences if s.words > 3] or [0])


@pytest.mark.parametrize("path", PAGES, ids=name_of)
def test_sentences_of_a_page_are_short_in_the_mean(path: Path) -> None:
    assert mean(of_paper(path)) <= MEAN


@pytest.mark.slow
def test_messages_are_short_in_the_mean() -> None:
    assert mean(sentence for path in modules() for sentence in of_module(path)) <= MEAN


@pytest.mark.slow
@in_each(sorted({*PAGES, *modules()} - HISTORY), name_of)
def test_words_are_those_of_the_field(path: Path) -> None:
    lines = path.read_text("utf-8").splitlines()
    banned = [
        f"line {number}: {match[0]!r}, say: {instead(match[0])}"
        for number, line in enumerate(lines, 1)
        for match in PATTERN.finditer(line)
    ]
    assert banned == []


def test_the_readme_is_a_page_for_a_stranger() -> None:
    assert len(README.read_text("utf-8").splitlines()) <= 200


# -- links ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", PAGES, ids=name_of)
def test_links_lead_somewhere(path: Path) -> None:
    text = re.sub(r"^```.*?^```", "", path.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    for link in _LINK.findall(re.sub(r"`[^`]*`", "", text)):
        if "://" in link:
            continue
        target, _, part = link.partition("#")
        file = (path.parent / target).resolve() if target else path
        assert file.is_file(), link
        if part:
            titles = re.findall(r"^#+ (.*)$", file.read_text("utf-8"), re.MULTILINE)
            assert part in {anchor(title) for title in titles}, link


def test_every_page_is_in_the_index() -> None:
    listed = {(DOCS / link).resolve() for link in _LINK.findall((DOCS / "index.md").read_text("utf-8"))}
    assert {path for path in DOCS.rglob("*.md") if path not in listed} == {DOCS / "index.md"}


@pytest.mark.parametrize("path", sorted((DOCS / "contributing").glob("*.md")), ids=name_of)
def test_files_that_are_named_exist(path: Path) -> None:
    named = re.findall(r"`((?:olp|tests)/[\w/.]+\.\w+)`", path.read_text("utf-8"))
    if path.name != "moved.md":
        assert [file for file in named if not (ROOT / file).is_file()] == []


@pytest.mark.parametrize("path", sorted((DOCS / "contributing").glob("way-*.md")), ids=name_of)
def test_the_ways_name_files_of_the_package(path: Path) -> None:
    rows = re.findall(r"^\| \d+ \| (.*?) \|", path.read_text("utf-8"), re.MULTILINE)
    assert len(rows) > 8
    for file in re.findall(r"`([\w/]+\.py)`", "\n".join(rows)):
        assert any(p.as_posix().endswith(file) for p in (ROOT / "olp").rglob("*.py")), file


# -- tables --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", write_reference.PAGES)
def test_the_reference_is_that_of_the_code(name: str) -> None:
    written = (DOCS / "reference" / name).read_text("utf-8")
    assert written == write_reference.PAGES[name](), "stale: python tests/docs/write_reference.py"


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]


def rows_below(path: Path, mark: str) -> list[list[str]]:
    """The cells of the first table below a mark, without its head."""
    text = path.read_text("utf-8")
    table = re.search(r"\n\|.*?\n(?!\|)", text[text.index(mark) :], re.DOTALL)
    assert table
    return [cells(line) for line in table[0].strip().splitlines()[2:]]


@functools.cache
def options() -> frozenset[str]:
    return frozenset(re.findall(r"(?<![\w-])--[a-z][a-z-]+", write_reference.verbs())) | {
        "--help",
        "--version",
    }


@pytest.mark.parametrize(
    "path", [p for p in PAGES if p not in HISTORY and p.name != "measured.md"], ids=name_of
)
def test_every_option_that_is_named_exists(path: Path) -> None:
    others = r"(apt-get|pip|pytest|halsampler|halcompile|mypy|ruff|python tests|run\.py|--post=)[^`\n]*"
    ours = re.sub(others, "", path.read_text("utf-8"))
    assert set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", ours)) <= options()


def test_every_dependency_has_its_reason() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = project["optional-dependencies"]
    ours, plots, tests = (
        {re.split("[>=]", item)[0] for item in items}
        for items in (project["dependencies"], extras["plots"], extras["test"])
    )
    page = DOCS / "contributing" / "dependencies.md"
    assert {row[0].strip("`") for row in rows_below(page, "# ")} == ours
    assert {row[0].strip("`") for row in rows_below(page, "## On request")} == plots <= tests
    assert {name for name in tests if name not in page.read_text("utf-8")} == set()


@pytest.mark.parametrize("job", figures.JOBS)
def test_figures_are_those_of_today(job: str) -> None:
    stated = rows_below(DOCS / "measured.md", "<!-- figures")[figures.JOBS.index(job)]
    today = cells(figures.row(job))
    assert stated[:2] == today[:2]
    for cell, now in zip(stated[2:], today[2:], strict=True):
        values = ([float(v) for v in text.split("/")] for text in (cell, now))
        assert all(abs(a - b) <= SAME_UM for a, b in zip(*values, strict=True)), f"{cell}, now {now}"


# -- olp help ------------------------------------------------------------------------------------

#: What a new user asks, and what the answer has to say.
QUESTIONS = {
    "my Grbl router is out of square": "C0Y",
    "which sign does a level have": "olp help background/conventions",
    "what does OLP306 mean": "What to do:",
    "how do I add my control": "DIALECT",
    "what does the proof not prove": "calibration",
    "what is backlash": "olp help background/model",
    "how certain is the correction": "uncertainty",
    "my program has loops and subprograms": "--flatten",
    "which exit codes are there": "exit code 0",
    "can it read Heidenhain programs": "olp help howto/heidenhain",
    "how do I stop a bad program before it runs": "olp check",
    "how do I correct CMM results": "olp results",
    "out of square": "one number to a corrected program",
    "sign of C0Y": "positive",
    "is a 5 axis machine corrected": "three linear axes",
    "rotary table": "three linear axes",
    "can it read Renishaw files": "laser",
    "siemens-cec": "table",
}
#: Questions and the pages that answer them, best or in the list below it.
ANSWERS = {
    "out of square": "tutorials/one-known-number",
    "sign of C0Y": "tutorials/one-known-number",
    "5 axis": "background/limits",
    "rotary table": "background/limits",
    "robot": "background/limits",
    "renishaw": "howto/instrument-files",
    "XL-80": "howto/instrument-files",
    "ballbar": "tutorials/laser-and-ball-bar",
    "sinumerik": "howto/sinumerik",
    "will my program get longer": "howto/correct",
    "why no changes": "howto/correct",
    "how do I add my control": "contributing/add-a-dialect",
    "windows": "howto/windows",
    "correct many programs": "howto/batch",
    "a folder of parts": "howto/batch",
    "is my calibration still good": "howto/still-good",
    "inches": "howto/correct",
    "G20": "howto/correct",
    "FreeCAD": "howto/cam",
    "post processor of Fusion": "howto/cam",
    "Mastercam": "howto/cam",
    "install without network": "howto/offline",
    "pre-commit": "howto/ci",
    "SARIF": "howto/check",
    "JSON schema for my editor": "howto/editors",
    "numpy arrays": "howto/python",
}


def asked(*words: str) -> str:
    result = CliRunner().invoke(main, list(words))
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.parametrize("question", QUESTIONS)
def test_questions_of_a_new_user_are_answered(question: str) -> None:
    assert QUESTIONS[question].lower() in asked("help", *question.split()).lower()


def test_help_lists_every_page() -> None:
    text = asked("help")
    assert [name for name in handbook.pages() if name not in text] == []


@pytest.mark.parametrize("question", ANSWERS)
def test_questions_lead_to_the_right_page(question: str) -> None:
    sections = [section for page in handbook.pages().values() for section in page.sections]
    assert ANSWERS[question] in [section.page for section in handbook_search.best(question, sections)][:3]


@pytest.mark.slow
def test_no_question_leads_to_the_plan_of_the_code_first() -> None:
    sections = [section for page in handbook.pages().values() for section in page.sections]
    for question in [*QUESTIONS, *ANSWERS]:
        best = handbook_search.best(question, sections)
        assert best[0].page not in ("contributing/house", "contributing/moved")


def test_pages_about_a_subject_exist() -> None:
    named = {page for subject in handbook_search.SUBJECTS for page in subject.pages}
    assert named <= handbook.pages().keys()


def test_sections_are_the_headings_of_a_page() -> None:
    """By another reader of Markdown; a comment in a block of code is no heading."""
    for page in handbook.pages().values():
        tokens = MarkdownIt("commonmark").parse(page.text)
        headings = [b.content for a, b in pairwise(tokens) if a.type == "heading_open"]
        assert [section.title for section in page.sections] == headings


def test_help_shows_a_page_by_its_name() -> None:
    for name, page in handbook.pages().items():
        assert asked("help", name) == for_terminal(page.text, name)


@pytest.mark.parametrize(
    "name", ["howto/doctor.md", "../howto/doctor.md", "../howto/doctor.md#the-file-of-points", "doctor"]
)
def test_help_takes_a_page_as_links_name_it(name: str) -> None:
    assert asked("help", name) == asked("help", "howto/doctor")


def test_a_terminal_shows_neither_links_nor_pictures_nor_comments() -> None:
    text = (
        "[the `doctor`](../howto/doctor.md#x), [here](#y), [ISO](https://iso.org)\n![A curve.](../a.png)\n"
        "`[a](b.md)`\n```\n[a](b.md)\n```\n"
    )
    assert for_terminal(text, "reference/verbs") == (
        "the `doctor` (`olp help howto/doctor`), here, ISO (https://iso.org)\nPicture: A curve.\n"
        "`[a](b.md)`\n```\n[a](b.md)\n```\n"
    )
    for name, page in handbook.pages().items():
        assert "<!--" not in page.text
        prose = re.sub(
            r"^```.*?^```|`[^`\n]*`", "", for_terminal(page.text, name), flags=re.DOTALL | re.MULTILINE
        )
        assert not re.search(r"\]\(\S+\)", prose), name
        for call in re.findall(r"\(`olp help ([\w/-]+)`\)", for_terminal(page.text, name)):
            assert call in handbook.pages() or call.startswith(".."), (name, call)


def test_what_no_page_answers_is_refused_with_a_hint() -> None:
    result = CliRunner().invoke(main, ["help", "xyzzyx"])
    assert result.exit_code == 2
    assert "olp help lists all pages" in result.output


def test_explain_finds_terms_and_codes() -> None:
    terms = handbook.glossary()
    assert len(terms) > 60
    for term, meaning in list(terms.items())[:10]:
        assert " ".join(meaning.split())[:30] in " ".join(asked("explain", term).split())
    for code in RULES:
        assert code in asked("explain", code)


@pytest.mark.parametrize(
    ("word", "expected"),
    [
        ("306", ["OLP306"]),
        ("tolerance", ["numerical tolerance", "part tolerance", "path tolerance"]),
        ("reversal", ["reversal error"]),
        ("sense", ["sign convention"]),
        ("sign", ["sign convention"]),
        ("ballbar", ["ball-bar"]),
        ("datum_mm", ["datum"]),
    ],
)
def test_explain_finds_parts_and_other_spellings(word: str, expected: list[str]) -> None:
    lines = asked("explain", word).splitlines()
    assert all(any(line.startswith(term) for line in lines) for term in expected)


@pytest.mark.parametrize("code", ["OLP9999", "OLP399", "9999"])
def test_explain_offers_no_other_code_for_one_that_does_not_exist(code: str) -> None:
    result = CliRunner().invoke(main, ["explain", code])
    assert result.exit_code == 2
    assert f"there is no finding OLP{code.removeprefix('OLP')}; olp explain lists the codes" in result.output


def test_pictures_of_pages_ship_with_the_package() -> None:
    targets = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["hatch"]["build"]["targets"]
    shipped = targets["wheel"]["force-include"]
    pictures = handbook.pictures()
    assert len(pictures) > 6
    assert {f"viewer/pictures/{name}" for name in pictures} == {k for k in shipped if k.endswith(".png")}
    assert all(shipped[f"viewer/pictures/{name}"] == f"olp/_pictures/{name}" for name in pictures)


class Links(HTMLParser):
    """What a page in HTML links and names."""

    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.names: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for key, value in attrs:
            if key in ("href", "src") and value:
                self.links.append(value)
            elif key == "id" and value:
                self.names.add(value)


@pytest.mark.slow
def test_the_html_is_linked_and_needs_no_network() -> None:
    files = site(handbook.pages(), handbook.pictures())
    seen = {name: Links() for name in files if name.endswith(".html")}
    for name, parser in seen.items():
        parser.feed(files[name].decode())
    for name, parser in seen.items():
        for link in parser.links:
            if link.startswith("https://"):
                continue
            target, _, part = link.partition("#")
            path = Path(name).parent.joinpath(target) if target else Path(name)
            parts: list[str] = []
            for piece in path.parts:
                parts = parts[:-1] if piece == ".." else [*parts, piece]
            file = "/".join(parts)
            assert file in files, (name, link)
            assert not part or part in seen[file].names, (name, link)
    scripts = b"".join(data for file, data in files.items() if not file.endswith(".png"))
    assert b"http://" not in scripts.replace(b"http://localhost", b"")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("folder", "words"),
    [
        ("mine", "exists already"),
        ("file", "is a file; name a folder"),
        ("file/sub", "is a file; name a folder"),
    ],
)
def test_pages_that_cannot_be_written_leave_nothing(tmp_path: Path, folder: str, words: str) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "index.html").write_text("mine")
    (tmp_path / "file").write_text("mine")
    refused = CliRunner().invoke(main, ["help", "--html", str(tmp_path / folder)])
    assert refused.exit_code == 2
    assert f"{tmp_path / folder}" in refused.stderr
    assert words in refused.stderr
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["file", "index.html", "mine"]


@pytest.mark.slow
def test_the_html_is_written_and_not_overwritten(tmp_path: Path) -> None:
    target = tmp_path / "pages"
    asked("help", "--html", str(target))
    page = (target / "howto" / "evaluate.html").read_text("utf-8")
    assert 'src="../pictures/calibrate-angles.png"' in page
    assert (target / "pictures" / "calibrate-angles.png").read_bytes().startswith(b"\x89PNG")
    assert "`" not in page[page.index("<nav") : page.index("</nav>")]
    assert CliRunner().invoke(main, ["help", "--html", str(target)]).exit_code == 2
    asked("help", "--html", str(target), "--force")
