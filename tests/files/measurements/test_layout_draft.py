"""Profiles drafted from texts: what they show is right, what they do not show is asked for."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from click.testing import CliRunner

from olp.cli import main
from olp.files.measurements.layout_draft import ASKED, drafted
from olp.files.measurements.line_profile import LineProfile, parse_line
from olp.files.measurements.proposal import propose
from olp.files.problems import validate

TARGETS = [0.0, 250.5, 500.0, 500.0, 250.5, 0.0]
ERRORS = [0.5, 1.25, -2.0, -3.5, 1.75, 0.25]
MARKS = {"semicolon": ";", "tab": "\t", "comma": ",", "space": "  "}


def text_of(mark: str, decimal: str, head: list[str], swapped: bool, held: list[float] = ERRORS) -> str:
    pairs = [(f"{q:.1f}", f"{value:.2f}") for q, value in zip(TARGETS, held, strict=True)]
    rows = [mark.join(pair[::-1] if swapped else pair) for pair in pairs]
    return "\n".join([*head, *(row.replace(".", decimal) for row in rows)]) + "\n"


@pytest.mark.parametrize(
    ("delimiter", "decimal", "named", "swapped"),
    [
        case
        for case in itertools.product(MARKS, ("point", "comma"), (True, False), (True, False))
        if case[:2] != ("comma", "comma")
    ],
)
def test_a_draft_reads_the_text_that_it_was_drafted_from(
    delimiter: str, decimal: str, named: bool, swapped: bool
) -> None:
    mark = MARKS[delimiter]
    names = ["Soll_[mm]", "Abweichung_[µm]"]
    head = ["Laser", "run of Friday"] + ([mark.join(names[::-1] if swapped else names)] if named else [])
    text = text_of(mark, "," if decimal == "comma" else ".", head, swapped)
    keys = drafted(text)
    assert keys is not None
    if not named:
        assert keys["unit"] == keys["position_unit"] == ASKED
        keys |= {"unit": "um", "position_unit": "mm"}
    readings = parse_line(text.encode(), "x.txt", validate(LineProfile, keys, {}, "p.toml"))
    assert readings.target_mm.tolist() == TARGETS
    assert (readings.value * 1e3).tolist() == pytest.approx(ERRORS)
    assert readings.direction.tolist() == [1, 1, 1, -1, -1, -1]


def test_what_a_text_leaves_open_is_asked_for() -> None:
    once = drafted("a;b\n0,5;1,5\n1,5;2,5\n2,5;1,0\n3,5;0,5\n")
    assert (
        once is not None and once["columns"] == {"target": ASKED, "value": ASKED} and once["holds"] == ASKED
    )
    # groups of three digits, or decimals
    grouped = drafted("a;b\n1,000;2,345\n2,000;3,345\n2,000;3,355\n1,000;3,745\n")
    assert grouped is not None and grouped["decimal"] == ASKED
    positions = drafted(text_of(";", ".", [], False, [q + 0.01 * k for k, q in enumerate(TARGETS)]))
    assert positions is not None and positions["holds"] == "position"
    assert drafted("three words here\nand 1.5 more\n") is None


@pytest.mark.parametrize(
    ("decimal", "group", "name"), [(",", ".", "point"), (".", ",", "comma"), (",", " ", "space")]
)
def test_groups_of_digits_lose_no_reading(decimal: str, group: str, name: str) -> None:
    """Only rows above 999 have them, and no row before these may be taken for the head."""
    targets = [0.0, 800.0, 1600.0, 2400.0, 3200.0, 3200.0, 2400.0, 1600.0, 800.0, 0.0]
    marked = str.maketrans({",": group, ".": decimal})
    rows = [f"{q:,.3f}".translate(marked) + f";{k:.2f}".replace(".", decimal) for k, q in enumerate(targets)]
    keys = drafted("\n".join(["Soll [mm];Abw [um]", *rows]) + "\n")
    assert keys is not None and (keys["header_lines"], keys["thousands"]) == (0, name)
    data = "\n".join(["Soll [mm];Abw [um]", *rows]).encode()
    readings = parse_line(data, "x.txt", validate(LineProfile, keys, {}, "p.toml"))
    assert readings.target_mm.tolist() == targets


@pytest.mark.parametrize("named", [True, False])
def test_a_short_first_run_is_no_head(named: bool) -> None:
    """Text between runs is not read over in silence: the profile begins above the first run."""
    runs = ["0;1.5", "10;2.5", "20;3.5", "Lauf 2", "0;1.6", "10;2.4", "20;3.6", "30;4.5"]
    keys = drafted("\n".join(["Soll;Abw" if named else "Laser", *runs]) + "\n")
    assert keys is not None
    assert (keys["header_lines"], keys["header"]) == ((0, True) if named else (1, False))


def test_of_more_columns_that_of_the_targets_is_found() -> None:
    rows = [f"{k};{q};{q + 0.01 * k + 0.003:.3f};{k + 0.5}" for k, q in enumerate(TARGETS)]
    keys = drafted("\n".join(["Nr;Soll [mm];Ist [mm];Abw [um]", *rows]) + "\n")
    assert keys is not None
    assert keys["columns"] == {"target": "Soll [mm]", "value": ASKED} and keys["holds"] == ASKED
    assert drafted("\n".join(f"{k};{k + 1};{k + 2}" for k in range(9))) is None


def test_files_that_are_laid_out_alike_share_a_draft(tmp_path: Path) -> None:
    for name in ("exx.txt", "eyy.txt"):
        (tmp_path / name).write_text(text_of(";", ",", ["Soll [mm];Abw"], False))
    (tmp_path / "layout-1.toml").write_text("unit = 'mine'\n")
    proposal = propose(tmp_path)
    assert list(proposal.layouts) == ["layout-2.toml"]
    assert proposal.text.count('profile = "layout-2.toml"') == 2 and 'component = "EYY"' in proposal.text
    assert [words for words in proposal.asked if words.startswith("unit of layout-2.toml")]


def test_formats_that_are_not_public_are_not_drafted(tmp_path: Path) -> None:
    (tmp_path / "exx.txt").write_text(text_of(";", ",", [], False))
    (tmp_path / "x.pos").write_text(text_of(";", ",", [], False))
    assert propose(tmp_path).unknown == ("x.pos",)
    plan = str(tmp_path / "measurements.toml")
    said = CliRunner().invoke(main, ["calibrate", "fit", str(tmp_path), "--propose", plan]).output
    assert "not known: x.pos; it is a positioning measurement of Renishaw or Wyler" in said
    assert f"wrote {tmp_path / 'layout-1.toml'}" in said
