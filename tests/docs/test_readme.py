"""The README is right: its commands run, its examples load, its tables are those of the code."""

from __future__ import annotations

import functools
import os
import re
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest
from benchmarks import figures

from olp.cli import VERBS, calibrate
from olp.findings.catalogue import RULES

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "README.md").read_text("utf-8")
NEVER_COPIED = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "build", "dist")
#: Deviations may change a little from one version of numpy to the next.
SAME_UM = 0.1
_FENCE = re.compile(
    r"(?P<mark><!-- [^\n]* -->\n)?^```(?P<kind>\w+)\n(?P<body>.*?)^```\n"
    r"(?:\n```text\n(?P<output>.*?)^```\n)?",
    re.DOTALL | re.MULTILINE,
)


@dataclass(frozen=True)
class Block:
    """A fenced block, the comment before it, and the output that stands below it."""

    kind: str
    mark: str
    body: str
    output: str

    @property
    def name(self) -> str:
        return "-".join(re.findall(r"[a-z.-]+", self.body)[:6])


BLOCKS = [Block(m["kind"], m["mark"] or "", m["body"], m["output"] or "") for m in _FENCE.finditer(TEXT)]
SHELL = [b for b in BLOCKS if b.kind == "sh" and "set-up" not in b.mark]
SET_UP = [b for b in BLOCKS if b.kind == "sh" and "set-up" in b.mark]
PYTHON = [b for b in BLOCKS if b.kind == "python"]
FILES = [b for b in BLOCKS if b.kind in ("toml", "csv")]


def run(body: str, folder: Path, *, timeout_s: float = 120.0) -> str:
    """What a block writes to stdout and stderr; fails where a command of it fails."""
    shell = shutil.which("bash")
    if shell is None:
        pytest.skip("needs bash")
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    # what this run promises is not beside the copy
    env = {k: v for k, v in os.environ.items() if not k.startswith("OLP_REQUIRE_")}
    done = subprocess.run(
        [shell, "-euo", "pipefail", "-c", body],
        cwd=folder, env=env | {"PATH": path, "COLUMNS": "100"}, timeout=timeout_s, check=False,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    return done.stdout


def masked(text: str) -> str:
    """Text without its numbers and the width of its gaps."""
    return re.sub(r"\s+", " ", re.sub(r"[-\d.]*\d[\d.]*", "#", text)).strip()


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The parts of the repository that commands name, and the files that the README shows."""
    shutil.copytree(ROOT / "programs", tmp_path / "programs")
    # what a reader of the how-to has left beside its measurements
    for made in (tmp_path / "programs" / "gantry-lines").glob("calibration*"):
        made.unlink()
    for block in FILES:
        target = tmp_path / block.body.splitlines()[0].removeprefix("# ")
        target.parent.mkdir(exist_ok=True)
        target.write_text(block.body, "utf-8")
    return tmp_path


def test_there_is_something_to_try() -> None:
    assert len(SHELL) > 10
    assert len(SET_UP) == 2
    assert PYTHON
    assert all(b.kind in ("sh", "python", "toml", "csv", "text") for b in BLOCKS)


@pytest.mark.slow
@pytest.mark.parametrize("block", SHELL, ids=lambda b: b.name)
def test_commands_run(block: Block, copy: Path) -> None:
    found = masked(run(block.body, copy))
    for part in block.output.split("...\n"):
        assert masked(part) in found
        found = found.partition(masked(part))[2] if part else found


@pytest.mark.parametrize("block", PYTHON, ids=lambda b: b.name)
def test_python_runs(block: Block, copy: Path) -> None:
    subprocess.run([sys.executable, "-W", "error", "-c", block.body], cwd=copy, check=True, timeout=120)


@pytest.mark.slow
def test_set_up_from_nothing(tmp_path: Path) -> None:
    """The two commands, in a copy of the checkout and an environment of their own."""
    copy = tmp_path / "checkout"
    shutil.copytree(ROOT, copy, ignore=NEVER_COPIED)
    for name in (".gitignore", ".ci"):
        source = ROOT / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, copy / name)
    first, second = (run(block.body, copy, timeout_s=900.0) for block in SET_UP)
    assert "What this proves" in first
    assert (copy / "plate.ngc").stat().st_size > 0
    assert re.search(r"\d+ passed", second)


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]


@functools.cache
def rows_below(heading: str) -> list[list[str]]:
    """The cells of the first table below a heading or a comment, without its head."""
    table = re.search(r"\n\|.*?\n(?!\|)", TEXT[TEXT.index(heading) :], re.DOTALL)
    assert table
    return [cells(line) for line in table[0].strip().splitlines()[2:]]


def test_every_finding_is_listed_as_it_is() -> None:
    codes = [[rule.code, rule.severity.name.lower(), rule.title] for rule in RULES.values()]
    assert rows_below("### Findings") == codes


def test_every_verb_is_listed() -> None:
    listed = [re.findall(r"`olp (\w+(?: [\w-]+)?)", row[0]) for row in rows_below("### Verbs")]
    assert list(dict.fromkeys(name.split()[0] for names in listed for name in names)) == list(VERBS)
    groups = [name.split()[1] for names in listed for name in names if name.startswith("calibrate ")]
    assert sorted(groups) == sorted(calibrate.VERBS)


def test_every_option_that_is_named_exists(copy: Path) -> None:
    verbs = [*VERBS, *(f"calibrate {verb}" for verb in calibrate.VERBS)]
    helps = run("\n".join(f"olp {verb} --help" for verb in verbs), copy)
    ours = re.sub(r"(apt-get|pip|pytest)[^`\n]*", "", TEXT)
    assert set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", ours)) <= set(re.findall(r"--[a-z-]+", helps))


def test_every_dependency_has_its_reason() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    ours, tests = (
        {re.split("[>=]", item)[0] for item in items}
        for items in (project["dependencies"], project["optional-dependencies"]["test"])
    )
    assert {row[0] for row in rows_below("## Dependencies")} == ours
    assert {name for name in tests if name not in TEXT[TEXT.index("## Dependencies") :]} == set()


def test_links_and_pictures_are_there() -> None:
    links = [link for link in re.findall(r"\]\(([^)]+)\)", TEXT) if "://" not in link]
    assert links
    assert [link for link in links if not (ROOT / link).is_file()] == []


@pytest.mark.parametrize("job", figures.JOBS)
def test_figures_are_those_of_today(job: str) -> None:
    stated = rows_below("<!-- figures")[figures.JOBS.index(job)]
    today = cells(figures.row(job))
    assert stated[:2] == today[:2]
    for cell, now in zip(stated[2:], today[2:], strict=True):
        values = ([float(v) for v in text.split("/")] for text in (cell, now))
        assert all(abs(a - b) <= SAME_UM for a, b in zip(*values, strict=True)), f"{cell}, now {now}"
