"""Without matplotlib, installed on request, a call for a plot says so at once, and pages have no plots."""

from __future__ import annotations

from pathlib import Path

import pytest
from cli.test_cli import PROGRAMS, run

import olp
from olp.core.optional import require_matplotlib

MACHINE = PROGRAMS / "nasty" / "machine.toml"
PROGRAM = PROGRAMS / "nasty" / "modal.ngc"
LINES = PROGRAMS / "gantry-lines"


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("olp.core.optional.find_spec", lambda _: None)


@pytest.mark.parametrize("words", [
    ("inspect", MACHINE, "--plot", "out.svg"),
    ("retime", PROGRAM, "-m", MACHINE, "--plot", "out.svg"),
    ("calibrate", "evaluate", LINES, "--plot", "out.svg"),
])  # fmt: skip
def test_what_needs_plots_says_so_before_any_work(
    without: None, words: tuple[str | Path, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(*words)
    assert result.exit_code == 4
    assert "plots need matplotlib, which is not installed; install it with pip install" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_rest_works_without(without: None, tmp_path: Path) -> None:
    result = run("correct", PROGRAM, "-m", MACHINE, "-o", tmp_path / "a.ngc", "--report", tmp_path / "a.md")
    assert result.exit_code == 0, result.stderr
    assert (tmp_path / "a.md").stat().st_size > 1000


@pytest.mark.slow
@pytest.mark.parametrize("words", [
    ("correct", PROGRAM, "-m", MACHINE, "-o", "a.ngc"),
    ("calibrate", "fit", LINES, "-m", LINES / "machine.toml", "-o", "a.toml"),
    ("calibrate", "evaluate", LINES),
])  # fmt: skip
def test_a_page_has_no_plots_and_says_so(
    without: None, words: tuple[str | Path, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(*words, "--report", "out.html")
    assert result.exit_code == 0, result.stderr
    assert result.stderr.count("note: the report has no plots: matplotlib is not installed") == 1
    page = (tmp_path / "out.html").read_text("utf-8")
    assert "<table" in page and "<svg" not in page


def test_the_same_from_python(without: None) -> None:
    from olp.reports.plots.base import drawn

    with pytest.raises(olp.CannotCompute, match="need matplotlib"):
        drawn("x", (1.0, 1.0), lambda _: None)


def test_where_it_is_installed_nothing_is_said() -> None:
    pytest.importorskip("matplotlib")
    require_matplotlib()
