"""Reports in inches: the same report, with every length converted once, and nothing else."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from cli.test_cli import PROGRAMS, run

from olp.reports import shown
from olp.reports.document import Document, Grid, Notice, Pairs, Paragraph, Section, as_shown

PLATE = ("correct", "-j", PROGRAMS / "gantry-plate" / "job-bracket.toml")


@pytest.mark.parametrize(
    ("text", "inches"),
    [
        ("at most 0.86 um; 1.09 um are allowed", "at most 0.00003 in; 0.00004 in are allowed"),
        ("0 to 600 mm", "0 to 23.622 in"),
        ("X 0 to 508, Y -254 to 0 mm", "X 0 to 20, Y -10 to 0 in"),
        ("+-30.00 um median, 60.00 um largest", "+-0.00118 in median, 0.00236 in largest"),
        ("<0.01 um", "<0.00001 in"),
        ("30 mm/s, 25.4 mm/min, 2540 mm/s2", "1.18 in/s, 1 in/min, 100 in/s2"),
        ("line 5, 0.254 um", "line 5, 0.00001 in"),
        ("in line 12, 254.00 um max", "in line 12, 0.01000 in max"),
        ("11.5 um/m/K and 20 urad", "11.5 um/m/K and 20 urad"),
        ("3 maximum, 12 moves, 20 degC", "3 maximum, 12 moves, 20 degC"),
        ("plate 300 mm.ngc is 254 mm long.", "plate 300 mm.ngc is 10 in long."),
        ("It is off by 254 um.", "It is off by 0.01000 in."),
    ],
)  # fmt: skip
def test_prose(text: str, inches: str) -> None:
    assert shown.prose(text) == text
    with shown.shown_in("inch"):
        assert shown.prose(text) == inches
    assert shown.prose(text) == text, "the units are those of the call"


def test_cells_take_the_unit_of_their_column_else_row_else_title() -> None:
    header = ["", "period mm", "max", "points", "phase rad", "angle"]
    rows = [
        ["EXX", "10", "25.40", "12", "1.50", "90 deg"],
        ["EAX", "10", "25.40", "12", "1.50", "95.0 %"],
    ]
    with shown.shown_in("inch"):
        heads, inner = shown.cells(header, rows, "um")
        _, by_row = shown.cells(["", "A", ""], [["EXX", "2.54", "um"], ["EAX", "2.54", "urad"]])
    assert heads[1] == "period in"
    assert inner == [
        ["EXX", "0.3937", "0.00100", "12", "1.50", "90 deg"],
        ["EAX", "0.3937", "0.00100", "12", "1.50", "95.0 %"],
    ]
    assert by_row == [["EXX", "0.00010", "in"], ["EAX", "2.54", "urad"]]
    assert rows[0][1] == "10", "what is given is unchanged"


def test_a_number_that_is_not_zero_is_never_shown_as_zero() -> None:
    with shown.shown_in("inch"):
        assert shown.value("0.02", "um") == "<0.00001"
        assert shown.value("-0.02", "um") == ">-0.00001"
        assert shown.value("0.00", "um") == "0.00000"
        assert shown.value("0.001", "mm") == "0.000039"


def test_a_document_is_converted_but_for_programs_and_findings() -> None:
    document = Document(
        "t", "s", (True, "at most 2.54 um"),
        [
            Section("Largest, in um", [Grid(["line", "max", ""], [["3", "2.54", "G1 (at 5 mm)"]], code=2)]),
            Section("Budget", [Pairs([("Backlash, um", "2.54, 0.00"), ("Box", "X 0 to 25.4 mm")]),
                               Notice("info", "OLP303", "t", "backlash.X_um = 5; expected 4 um", "r")]),
            Section("Worst", [Paragraph("Blocks, in um:"), Grid(["line", "max"], [["3", "2.54"]])]),
        ],
    )  # fmt: skip
    with shown.shown_in("inch"):
        inches = as_shown(document)
    assert inches.verdict == (True, "at most 0.00010 in")
    first, budget, worst = inches.sections
    assert first.title == "Largest, in inch"
    assert first.blocks[0].rows == [["3", "0.00010", "G1 (at 5 mm)"]]  # type: ignore[union-attr]
    assert budget.blocks[0].rows == [("Backlash, in", "0.00010, 0.00000"), ("Box", "X 0 to 1 in")]  # type: ignore[union-attr]
    assert budget.blocks[1] == document.sections[1].blocks[1]
    assert worst.blocks[0] == Paragraph("Blocks, in inch:")
    assert worst.blocks[1].rows == [["3", "0.00010"]]  # type: ignore[union-attr]
    assert as_shown(document) == document


def figures(text: str, after: str) -> list[float]:
    return [float(n) for n in re.findall(r"\d+\.\d+", text.partition(after)[2].partition("\n\n")[0])]


@pytest.mark.slow
def test_a_correction_in_inches_is_the_same_correction(tmp_path: Path) -> None:
    out = ("-o", tmp_path / "out.mpf", "--force")
    mm = run(*PLATE, *out, "--report", tmp_path / "mm.md")
    data = (tmp_path / "out.mpf").read_bytes()
    inch = run(*PLATE, *out, "--units", "inch", "--report", tmp_path / "inch.md")
    assert (mm.exit_code, inch.exit_code) == (0, 0)
    assert (tmp_path / "out.mpf").read_bytes() == data
    before, now = figures(mm.stdout, "Deviation from"), figures(inch.stdout, "Deviation from")
    assert now == pytest.approx([um / 25400 for um in before], abs=1.1e-5)
    assert not re.search(r"\d um\b", inch.stdout.partition("Findings")[0])
    page = (tmp_path / "inch.md").read_text()
    assert "in inch" in page
    assert not re.search(r"\| in um", page)


@pytest.mark.slow
def test_json_keeps_its_units(tmp_path: Path) -> None:
    out = ("-o", tmp_path / "out.ngc", "--force", "--json")
    assert run(*PLATE, *out).stdout == run(*PLATE, *out, "--units", "inch").stdout


@pytest.mark.parametrize("verb", ["correct", "verify", "check", "compare", "results", "retime", "inspect"])
def test_every_verb_that_prints_a_report_takes_units(verb: str) -> None:
    assert "--units [mm|inch]" in run(verb, "--help").stdout


def test_inspect_in_inches() -> None:
    at = ("inspect", PROGRAMS / "gantry-plate" / "machine.toml", "--at", "2in", "1in", "-1in")
    assert "position in    2, 1, -1\n" in run(*at, "--units", "inch").stdout
    assert "position mm    50.8, 25.4, -25.4\n" in run(*at).stdout
