"""Languages of other controls and other files are recognised by name, and no program that is read is."""

from __future__ import annotations

from pathlib import Path

import pytest
from cli.test_cli import PROGRAMS, run

from olp.program.foreign import FOREIGN, recognised

MILL = PROGRAMS / "haas-mill"
TEXTS = {
    "Heidenhain": (b"0 BEGIN PGM TEST MM\n"
                   b"1 TOOL CALL 1 Z S1000\n2 L X+10 Y+5 R0 FMAX\n3 END PGM TEST MM\n", 1),
    "Heidenhain conversational": (b"1 TOOL CALL 1 Z S1000\n2 L X+10 Y+5 R0 FMAX\n3 L Z-5 F500\n", 2),
    "Sinumerik": (b"G54 G90\nG0 X0\nCYCLE800(1,\"TABLE\",0,57,0,0,0)\nX10\n", 3),
    "Sinumerik (Siemens)": (b"G54\nN20 R1=5\nN30 G1 X=R1 F100\n", 2),
    "KUKA KRL": (b"&ACCESS RVP\nDEF part()\nPTP {X 10, Y 0, Z 5}\nLIN P2\nEND\n", 1),
    "ABB RAPID": (b"MODULE M\n PROC main()\n MoveL p1, v100, fine, tool0;\n ENDPROC\nENDMODULE\n", 1),
    "FANUC TP": (b"/PROG TEST\n/ATTR\n/MN\n 1:J P[1] 100% FINE ;\n/POS\n/END\n", 1),
    "UR script": (b"def part():\n  movej(p[0.1, 0, 0, 0, 0, 0], a=1.4)\nend\n", 1),
    "Yaskawa": (b"/JOB\n//NAME TEST\nNOP\nMOVJ C00000 VJ=50\nEND\n", 1),
    "VAL 3": (b"begin\n  movej(pA,flange,mNomSpeed)\nend\n", 1),
    "Mazatrol": (b"MAZATROL MATRIX\n", 1),
    "Okuma": (b"$PART.MIN%\nG15 H1\nCALL OO88\n", 1),
    "HPGL": (b"IN;SP1;PU0,0;PD100,0;\n", 1),
    "STEP-NC": (b"ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('MACHINING_SCHEMA'));\n", 1),
    "STEP model": (b"ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\n", 1),
    "STL": (b"solid part\nfacet normal 0 0 1\n", 1),
    "DXF": (b"0\nSECTION\n2\nHEADER\n", 1),
    "PDF": (b"%PDF-1.4\n1 0 obj\n", 1),
    "ZIP": (b"PK\x03\x04" + bytes(30) + b"part.nc", 1),
    "spreadsheet": (b"PK\x03\x04" + bytes(30) + b"xl/workbook.xml", 1),
    "UTF-16": ("G0 X1\n".encode("utf-16"), 1),
    "binary file": (bytes(range(256)) * 4, 1),
    "web page": (b"<!DOCTYPE html>\n<html>\n", 1),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_what_is_no_program_is_named(tmp_path: Path, name: str) -> None:
    text, line = TEXTS[name]
    (tmp_path / "part.nc").write_bytes(text)
    result = run("correct", tmp_path / "part.nc", "-m", MILL / "machine.toml")
    assert result.exit_code == 3
    assert result.stderr.count("\n") == 1, result.stderr
    assert f"part.nc:{line}: " in result.stderr
    assert name in result.stderr
    assert "; " in result.stderr


def test_every_sign_is_tried() -> None:
    tried = {error.message.split(",")[0] for text, _ in TEXTS.values()
             if (error := recognised(text, languages=True)) is not None}  # fmt: skip
    untried = {kind.name for kind in FOREIGN if not any(kind.name in message for message in tried)}
    assert untried == {"a gzip archive", "a picture", "an IGES model", "a file of olp in TOML", "JSON"}


def test_no_program_that_is_read_is_taken_for_another() -> None:
    """The programs of the examples: also where one is refused later, its language is not in doubt."""
    programs = [path for path in PROGRAMS.rglob("*") if path.suffix in (".nc", ".ngc")]
    assert len(programs) > 4
    named = {path.name: error.message for path in programs
             if (error := recognised(path.read_bytes(), languages=True)) is not None}  # fmt: skip
    assert named == {}


def test_parameters_of_rs274_are_no_other_language() -> None:
    text = (
        b"#<x>=5\n#1=[#2*3]\no<sub> call [1]\nG1 X[#1] (R1=5)\nG10 L2 P1 R0\nM98 P1000\nIF [#1 EQ 1] GOTO 5\n"
    )
    assert recognised(text, languages=True) is None


def test_a_tape_with_some_control_bytes_is_text() -> None:
    assert recognised(b"\0\0\0\x11%\r\n" + b"G1 X1.\r\n" * 100 + b"\x13\x1a", languages=True) is None
