"""Line numbers in the page are those of the files, and texts are theirs too."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from judge.machines import Recipe, random_machine
from judge.unpacker import Page

import olp
from olp.review import listing
from olp.review.job import Review
from olp.review.listing import LONGEST, shown

ROOT = Path(__file__).resolve().parents[2]
NASTY = ROOT / "programs" / "nasty"
REFUSED = {"block-delete-depends.ngc"}
PROGRAMS = sorted(path for path in NASTY.glob("*.ngc") if path.name not in REFUSED)
#: long moves, so that blocks are inserted; blank lines and comments between
TEXT = (
    "(front)\n\nG21 G17 G90 G94 G54 G64 P0.01 Q0\nG43 H1\nG0 X0 Y0 Z20 ; rapid\n\n\n(cut)\n"
    "N10 G1 X500 Y300 F900 (long)\n\nN20 X0 Y0\n; between\nG0 Z30\n(back)\n\nM2\n(behind the end)\n"
)


def lines_of(data: bytes) -> list[str]:
    """Lines as an editor counts them, found without the code under test."""
    text = data.decode("utf-8-sig")
    lines = re.split("\r\n|\r|\n", text)
    return lines[:-1] if lines[-1] == "" else lines


def checked(review: Review, nominal: bytes, corrected: bytes) -> Page:
    """Rows hold every line of both files once and in order, and texts are the lines of the files."""
    page = Page(review.html())
    shown_as = page.manifest["listing"]
    for key, data in (("nominal", nominal), ("corrected", corrected)):
        rows = page.array(shown_as[f"row_{key}"])
        lines = lines_of(data)
        assert rows[rows > 0].tolist() == list(range(1, len(lines) + 1))
        assert page.array(shown_as[key]) == lines
    assert ((page.array(shown_as["row_nominal"]) > 0) | (page.array(shown_as["row_corrected"]) > 0)).all()
    return page


@pytest.mark.slow
@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_rows_are_the_lines_of_the_files(path: Path) -> None:
    result = olp.correct(path, NASTY / "machine.toml")
    review = olp.view(path, NASTY / "machine.toml", correction=result, time=False)
    page = checked(review, path.read_bytes(), result.data)
    same = [
        (a, b)
        for a, b in zip(page.array("row_nominal"), page.array("row_corrected"), strict=True)
        if a > 0 and b > 0
    ]
    nominal, corrected = lines_of(path.read_bytes()), lines_of(result.data)
    # partners differ in words of axes, centres, and of the time of parts in G93
    words = re.compile(r"\s*[XYZIJKRFxyzijkrf]\s*[-+]?[\d.]+")
    for a, b in same:
        here, there = (words.sub("", text[int(n) - 1]).split() for text, n in ((nominal, a), (corrected, b)))
        assert set(there) <= set(here), (nominal[int(a) - 1], corrected[int(b) - 1])


@pytest.mark.parametrize("eol", ["\n", "\r\n"])
@pytest.mark.parametrize("end", ["", "last line end"])
def test_whatever_ends_a_line(eol: str, end: str, tmp_path: Path) -> None:
    """Also blank lines, comments, inserted blocks, and text behind the end of the program."""
    data = TEXT.replace("\n", eol).encode()
    data = data if end else data.removesuffix(eol.encode())
    machine = random_machine(tmp_path / "m", 3)
    result = olp.correct(data, machine, tolerance_um=0.2)
    review = olp.view(data, machine, correction=result, tolerance_um=0.2, time=False)
    page = checked(review, data, result.data)
    inserted = page.array("row_nominal") == 0
    assert inserted.sum() == len(lines_of(result.data)) - len(lines_of(data)) > 3
    row = page.array(page.manifest["line"]).astype(int)
    # samples lie on the two long moves and the rapids: their lines by an editor's count
    nominal = lines_of(data)
    moved = {nominal[int(n) - 1] for n in page.array("row_nominal")[np.unique(row)]}
    assert moved == {line for line in nominal if re.match(r"(N\d+ )?(G[01] )?[XZ]", line)}


def test_an_inserted_block_stands_before_the_block_that_it_was_split_from(tmp_path: Path) -> None:
    machine = random_machine(tmp_path / "m", 3)
    page = Page(olp.view(TEXT.encode(), machine, tolerance_um=0.2, time=False).html())
    rows = page.array("row_nominal").astype(int).tolist()
    index = rows.index(9)
    assert rows[index - 1] == 0
    assert "X500" not in page.array("text_corrected")[int(page.array("row_corrected")[index - 1]) - 1]
    assert rows[1] == 0 or rows[0] == 0  # the stamp


def test_a_line_is_never_farther_off_its_path_than_its_samples_are_off_their_points(tmp_path: Path) -> None:
    machine = random_machine(tmp_path / "m", 3, Recipe())
    page = Page(olp.view(TEXT.encode(), machine, time=False).html())
    row = page.array("line").astype(int)
    for name, layer in (("uncorrected_um", "uncorrected"), ("corrected_um", "corrected")):
        size = np.linalg.norm(page.array(page.layer(layer)["delta"]), axis=1) * 1e3
        stated = page.array(page.manifest["listing"][name])
        # below 0: not known
        assert np.flatnonzero(stated >= 0.0).tolist() == np.unique(row).tolist()
        for k in np.unique(row):
            assert stated[k] <= size[row == k].max() + 0.006


@given(st.integers(0, 30), st.sets(st.integers(0, 40)), st.sets(st.integers(0, 40)))
def test_rows_are_those_of_a_walk_along_both_texts(pairs: int, left: set[int], more: set[int]) -> None:
    """Lines that were left out come before those that were inserted at the same place."""
    left_out, inserted = (
        sorted(line for line in some if line < pairs + len([i for i in some if i <= line]))
        for some in (left, more)
    )
    count, other = pairs + len(left_out), pairs + len(inserted)
    rows, i, j = [], 0, 0
    while i < count or j < other:
        if i in left_out:
            rows.append((i := i + 1, 0))
        elif j in inserted:
            rows.append((0, j := j + 1))
        else:
            rows.append((i := i + 1, j := j + 1))
    line, line_other = listing._woven(count, other, np.array(inserted, int), np.array(left_out, int))
    assert list(zip(line.tolist(), line_other.tolist(), strict=True)) == rows


def test_both_texts_are_coded_by_the_samples_of_their_lines(tmp_path: Path) -> None:
    """What is left of the numbers is the zero of the positions, on every line."""
    lines = [f"G1 X{k * 0.7:.4f} Y{k * k * 0.003:.4f} Z{20 - k * 0.01:.4f} F900" for k in range(200)]
    data = "\n".join([*TEXT.split("\n")[:4], "G43 H1", *lines, "M2", ""]).encode()
    page = Page(olp.view(data, random_machine(tmp_path / "m", 3), time=False).html())
    for name in ("text_nominal", "text_corrected"):
        rest = page.array(f"{name}_rest")
        assert rest.shape[1] == 3
        assert not np.diff(rest[20:], axis=0).any()


# -- texts ----------------------------------------------------------------------------------------------


@given(st.binary(max_size=300))
def test_any_bytes_are_shown_line_by_line(data: bytes) -> None:
    text = shown(data)
    ends = len(re.findall(rb"\r\n|\r|\n", data))
    assert text.count("\n") == ends - (re.search(rb"[\r\n]\Z", data) is not None)
    assert not set(text) & {chr(c) for c in (*range(9), *range(11, 32), *range(0x7F, 0xA0))}
    assert not set(text) & set("\u200e\u202a\u202e\u2028\u2066\ufeff")


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=300))
def test_plain_text_is_shown_as_it_is(text: str) -> None:
    assert shown(text.encode()) == text


def test_controls_are_pictures_of_themselves() -> None:
    assert shown(b"G1\x00 X1\x1b[31m\x7f\tY2") == "G1␀ X1␛[31m␡\tY2"
    assert shown("(\u202eesrever\u202c)".encode()) == "(�esrever�)"
    assert shown(b"\xef\xbb\xbfG21") == "G21"
    assert shown("(Fräsen)".encode("latin-1")) == shown("(Fräsen)".encode()) == "(Fräsen)"


def test_a_line_without_end_is_cut_and_says_so() -> None:
    text = shown(b"G21\n(" + b"x" * 1_000_000 + b")\nM2\n")
    first, long, last = text.split("\n")
    assert (first, last) == ("G21", "M2")
    assert long == "(" + "x" * (LONGEST - 1) + " … (1000002 characters)"
    assert shown(b"x" * LONGEST) == "x" * LONGEST


@pytest.mark.slow
@pytest.mark.parametrize("name", ["creo.ncl", "catia.aptsource", "nx.cls", "solidworks.apt"])
def test_lines_that_are_not_changed_stand_beside_themselves(name: str) -> None:
    """Blocks are inserted at two places before the first cut: at the top, and where backlash is taken up."""
    folder = ROOT / "programs" / "apt-flavours"
    job = folder / "job.toml"
    review = olp.view(folder / name, folder.parent / "gantry-plate" / "machine.toml", job, time=False)
    page = Page(review.html())
    listing = page.manifest["listing"]
    texts = [page.array(listing[key]) for key in ("nominal", "corrected")]
    rows = zip(
        *(page.array(listing[f"row_{key}"]).astype(int) for key in ("nominal", "corrected")), strict=True
    )
    beside = {a: b for a, b in rows if a}
    single = [line for line in texts[0] if texts[0].count(line) == texts[1].count(line) == 1]
    assert len(single) > 5
    for line in single:
        number = beside[texts[0].index(line) + 1]
        assert number and texts[1][number - 1] == line


@pytest.mark.parametrize(
    "data", [b"", b"\n", b"G21\nX1\n\n", b"X1\r\nX2\r\n", b"X1\tY2\x07\nM2", "X1 (\u00e4)\n".encode()]
)
def test_a_text_is_looked_at_by_bands(data: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = shown(data), shown(data + b"x" * LONGEST + b"y\n" + data)
    monkeypatch.setattr(listing, "_BAND", 3)
    assert (shown(data), shown(data + b"x" * LONGEST + b"y\n" + data)) == whole
    assert whole[0] == "\n".join(lines_of(data)).replace("\x07", "\u2407")


def test_the_nominal_text_is_not_kept_twice() -> None:
    scene = olp.view(PROGRAMS[0], NASTY / "machine.toml", time=False).scene
    assert scene.listing.read is scene.nominal.data
    assert scene.listing.nominal == shown(scene.nominal.data)
