"""Programs corrected by a few numbers, without files: as with files that say the same."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from cases.acceptance import machine

from olp.core.errors import Doubtful, ProgramError
from olp.errormodel.known import KnownErrors
from olp.files.sources import Source
from olp.workflows import correct, verify
from olp.workflows.session import Session

SQUARE = b"""G21 G90
G0 X10 Y20
G0 Z5
G1 Z-1 F300
G1 X310 F1200
G1 Y320
G2 X280 Y350 I-30 J0
G1 X10 Y350
G1 Y20
G0 Z5
M30
"""
CALIBRATION = """[[curves]]
file = "y.csv"
[squareness]
C0Y_urad = -1414.0
[backlash]
X_um = 30.0
"""
SCALE = {"y.csv": "Y_mm,EYY_um\n-1000,-200\n2000,400\n"}
#: A word of a centre.
CENTRE = re.compile(rb"[IJ][-+]?[0-9]*\.?[0-9]+")
KNOWN = KnownErrors.of(["XY=1.414mm/m"], ["Y=0.2mm/m"], ["X=0.03mm"])


def numbers(text: bytes) -> bytes:
    """What is behind the stamp."""
    return text.partition(b"\n")[2]


def corrected(text: bytes, known: KnownErrors = KNOWN, **words: object) -> correct.Correction:
    options = correct.CorrectOptions(**words)  # type: ignore[arg-type]
    return correct.run(Session.start(known), Source("", lambda: text), options)


def by_files(folder: Path, text: bytes, *offset: float) -> bytes:
    x, y, z = offset
    tables = f"[work_offsets.G54]\nX_mm = {x}\nY_mm = {y}\nZ_mm = {z}\n[work_offsets.G55]\n"
    described = machine(folder, CALIBRATION, SCALE, controller="grbl", tables=tables)
    return correct.correct(text, described).data


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (100.0, -300.0, -50.0)])
def test_it_is_the_correction_of_files_wherever_the_part_lies(
    offset: tuple[float, ...], tmp_path: Path
) -> None:
    """Only distances count: with a zero that was touched off, the place of the part changes nothing."""
    known, files = numbers(corrected(SQUARE).data), numbers(by_files(tmp_path, SQUARE, *offset))
    assert CENTRE.sub(b"", known) == CENTRE.sub(b"", files)
    # centres are chosen within the tolerance, and may do so otherwise elsewhere
    for one, other in zip(CENTRE.findall(known), CENTRE.findall(files), strict=True):
        assert float(one[1:]) == pytest.approx(float(other[1:]), abs=1e-3)
    assert corrected(SQUARE).report["deviation"]["holds"]


def test_the_square_comes_out_square() -> None:
    """C0Y alone: each X moves by -lean times Y, and Y not at all."""
    text = b"G21 G90\nG0 X0 Y0\nG1 X100 Y0 F600\nG1 X100 Y100\nG1 X0 Y100\nM30\n"
    lines = numbers(corrected(text, KnownErrors.of(["XY=1mm/m"])).data).split(b"\n")
    assert lines[3:5] == [b"G1 X99.900 Y100", b"G1 X-0.100 Y100"]


@pytest.mark.parametrize("other", [b"G55", b"G92 X5 Y5", b"G10 L20 P1 X5 Y5"])
def test_another_zero_is_touched_off_too(other: bytes) -> None:
    text = b"G21 G90\nG0 X0 Y0 Z5\n" + other + b"\nG0 X0 Y0\nG1 X100 F600\nG1 Y100\nM30\n"
    assert b"G1 Y100 X99.9" in corrected(text, KnownErrors.of(["XY=1mm/m"])).data


def test_what_is_assumed_is_said() -> None:
    found = [f for f in corrected(SQUARE).findings if f.code == "OLP470"]
    assert [f.message.split(" by ")[0] for f in found] == [
        "Y leans toward +X",
        "Y moves 0.2 mm per m farther than commanded",
        "X has a backlash of 30 um",
        "no machine file: a program of blocks is read as one of grbl, and positions are rounded to 0.001 mm "
        "at the most",
        "no machine file: the zero was touched off on this machine, so only distances from it count",
    ]
    assert not {"OLP444", "OLP462"} & {f.code for f in corrected(SQUARE).findings}


def test_a_machine_position_is_not_known() -> None:
    """Behind G53 the distance from the part is not known, so a cut there is refused, not guessed."""
    text = b"G21 G90\nG0 X10 Y10 Z5\nG53 G0 Y0\nG1 X20 F500\nM30\n"
    with pytest.raises(ProgramError, match=r"position of X and Y|position of Y"):
        corrected(text, KnownErrors.of(["XY=1mm/m"]))
    good = b"G21 G90\nG0 X10 Y10 Z5\nG53 G0 Z0\nG0 X0 Y0\nG1 X20 F500\nM30\n"
    assert corrected(good, KnownErrors.of(["XY=1mm/m"])).report["deviation"]["holds"]
    with pytest.raises(ProgramError, match="G10 L2 states machine coordinates"):
        corrected(b"G21 G90\nG10 L2 P1 X5\nG0 X10 Y10\nM30\n", KNOWN)


def test_lengths_of_several_tools_count_where_z_does() -> None:
    text = b"T1 M6\nG0 X0 Y0 Z5\nG1 Z-1 F100\nG0 Z5\nT2 M6\nG0 X0 Y0 Z5\nG1 Z-1 F100\nM30\n"
    leans = KnownErrors.of(["XZ=1mm/m"])
    with pytest.raises(Doubtful, match=r"OLP471: line 6: .* 2 tools .1, 2. of unknown lengths"):
        corrected(text, leans)
    assert corrected(text, KnownErrors.of(["XY=1mm/m"])).report["deviation"]["holds"]
    assert corrected(text[: text.index(b"T2")] + b"M30\n", leans).report["deviation"]["holds"]


@pytest.mark.parametrize(
    ("known", "code"),
    [(KnownErrors.of(["XY=50mm/m"]), "OLP446"), (KnownErrors.of(backlash=["X=50mm"]), "OLP447")],
)
def test_a_wrong_unit_is_doubted(known: KnownErrors, code: str) -> None:
    with pytest.raises(Doubtful, match=code):
        corrected(SQUARE, known)


def test_the_proof_needs_the_same_numbers() -> None:
    text = corrected(SQUARE).data
    one, two = (Source("", lambda data=data: data) for data in (SQUARE, text))  # type: ignore[misc]
    options = verify.VerifyOptions()
    assert verify.run(Session.start(KNOWN), one, two, options).report["deviation"]["holds"]
    other = KnownErrors.of(["XY=-1.414mm/m"], ["Y=0.2mm/m"], ["X=0.03mm"])
    assert not verify.run(Session.start(other), one, two, options).report["deviation"]["holds"]


def test_the_remedy_for_a_first_move_in_g91_works() -> None:
    with pytest.raises(ProgramError, match="in an absolute rapid first, or give a machine file and a job"):
        corrected(b"G21 G91\nG1 X10 F500\nM30\n")
    assert corrected(b"G21 G90\nG0 X0 Y0 Z5\nG91\nG1 X10 F500\nM30\n").report["deviation"]["holds"]


@pytest.mark.parametrize("text, hint", [
    (b"G0 X50 Y50 Z5\nG81 X100 Z-3 R2 F100\nG80\nG1 Z-1\n", True),
    (b"G0 X50 Y50 Z5\nG1 X100 Z-3 F100\n", False),
])  # fmt: skip
def test_holes_above_tolerance_name_the_option_that_helps(text: bytes, hint: bool) -> None:
    program = b"G21 G90 G54 G61\n" + text + b"M2\n"
    known = KnownErrors.of(["XZ=5mm/m"])

    def above(*, expand: bool) -> list[str]:
        options = correct.CorrectOptions(expand_cycles=expand)
        done = correct.run(Session.start(known, dialect="linuxcnc"), Source("", lambda: program), options)
        return [one.message for one in done.findings if one.code == "OLP101"]

    assert any("--expand-cycles" in message for message in above(expand=False)) == hint
    assert above(expand=True) == []
