"""HA and DA of Okuma, beside the same programs with numbers."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.acceptance import unstamped
from cases.unrolling import flatten
from judge import machines
from judge.machines import Recipe

import olp
from olp.core.errors import ProgramError
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read
from olp.program.rs274.spindle_words import translate

RECIPE = Recipe(
    controller="okuma",
    work_offsets={"G15 H1": {"X_mm": 250.0, "Y_mm": 200.0, "Z_mm": -300.0, "set_by": "true"}},
    tools={
        4: {"Z_mm": 90.0, "radius_mm": 3.0, "wear_mm": -0.02},
        5: {"Z_mm": 60.0, "radius_mm": 9.0},
    },
    job_defaults={"work_offset": "G15 H1"},
)
TEXT = (
    b"$P.MIN%\nOP (HA DA HB)\nG15 H1 G90 G21 G17 G40\nT4 M6\nG0 X-20. Y-20. S3000 M3\nG56 HA DA Z50.\n"
    b"G1 Z-3. F300\nG41DA X0. Y-10. F500 ; DB\nY40.\nX50.\nY0.\nX-10.\nG40 X-20. Y-20.\nG0 Z50.\nT5 M6\n"
    b"G0 X10. Y10.\nG56hadaZ40.\nG41 d a X20. Y30.\nX60.\nG40 X70. Y30.\nM2\n"
)


def numbered(text: bytes) -> bytes:
    """The same with the numbers of the tools."""
    first, second = text.split(b"T5 M6")
    plain = first.replace(b"G56 HA DA", b"G56 H4 D4").replace(b"G41DA", b"G41D4")
    return plain + b"T5 M6" + second.replace(b"hada", b"h5d5").replace(b"d a", b"d 5")


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = machines.random_machine(tmp_path_factory.mktemp("bent"), 23, RECIPE)
    path.write_text(path.read_text().replace("chain =", 'decimal_point = "calculator"\nchain =', 1))
    return path


@pytest.mark.parametrize("contour", ["contour", "path"])
def test_letters_are_corrected_as_the_numbers_of_the_tools(bent: Path, tmp_path: Path, contour: str) -> None:
    out = []
    for name, text in (("letters", TEXT), ("numbers", numbered(TEXT))):
        path = tmp_path / f"{name}.min"
        path.write_bytes(text)
        out.append(unstamped(olp.correct(path, bent, contour=contour).data))
    assert out[0] != TEXT
    lengths = out[0].replace(b"G56 HA DA", b"G56 H4 D4").replace(b"G56hada", b"G56h5d5")
    as_numbers = numbered(out[0]) if contour == "contour" else lengths
    assert as_numbers == out[1]


@pytest.mark.parametrize(
    ("text", "code", "line", "why"),
    [
        (b"G56 HA Z5.\n", "OLP532", 1, "this tool is not known"),
        (b"T4 M6 G56 HA\n", "OLP532", 1, "the tool is changed in this block"),
        (b"T4 M6\n\nG56 HB\n", "OLP512", 3, "HB is a further offset"),
        (b"T4 M6\nG56 HX\n", "OLP510", 2, "is not understood"),
    ],
)
def test_what_is_not_certain_is_refused(bent: Path, text: bytes, code: str, line: int, why: str) -> None:
    with pytest.raises(ProgramError, match=why) as caught:
        read(text, load_setup(bent), DIALECTS["okuma"])
    assert (caught.value.code, caught.value.line) == (code, line)


def test_what_is_no_such_word_is_left_alone() -> None:
    for text in (
        b"(G56 HA)\n",
        b"; HA\n",
        b"CALL OHA\n",
        b"NDA G0 X1.\n",
        b"HAB=3\n",
        b"DA=5\n",
        b"X=DA+1\n",
    ):
        assert translate(text).text == text
        assert not translate(text).of_spindle
    assert dict(translate(b"\n\nG56 H A\nG41DA X1.").of_spindle) == {3: "H", 4: "D"}


def test_user_tasks_keep_the_letters() -> None:
    text = b"T4 M6\nVC1=50\nG56 HADA Z50.\nG41 DA X50.\nIF[VC1 EQ 50] NX\nX9.\nNX G40\nM2\n"
    assert flatten(text, profile="okuma") == b"T4 M6\nG56 HADA Z50.\nG41 DA X50.\nG40\nM2\n"
