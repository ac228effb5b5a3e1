"""Languages of other controls and other files are recognised by name, and no program that is read is."""

from __future__ import annotations

from pathlib import Path

import pytest
from cli.test_cli import PROGRAMS, run

from olp.program.foreign import FOREIGN, LOOKED_AT, recognised

MILL = PROGRAMS / "haas-mill"
TEXTS = {
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


OTHER_POST = "post-process the part for the control of the machine file, or give the CAM system's APT CLDATA"
OSP = "plain moves of it are read with --dialect okuma; else post-process for the control of the machine file"
ROBOT = (
    "robots are not corrected from their own language; give a list of positions in the frame of the machine "
    "(CSV), or the CAM system's APT CLDATA"
)
PROGRAM = "give the program that the CAM system writes for the control"
PLAIN = "save it as plain text (ASCII or UTF-8), and give that file"
UNPACK = "unpack it, and give the program in it"
NAMED = "name its dialect with --dialect sinumerik, or with the key dialect of the job file"
TOML = "give the program first, and the machine file with -m, the job file with -j"
#: Name, remedy and code of what is recognised; texts that only its own sign recognises.
SIGNS = {
    ("UTF-16 text", PLAIN, "OLP502"): (b"\xff\xfeG\0", b"\xfe\xff\0G"),
    ("a spreadsheet of Excel or LibreOffice", "save the sheet as CSV, and give that file", "OLP502"): (
        b"PK\x03\x04xl/", b"PK\x03\x04" + b"\n" * 4000 + b"xl/", b"PK\x03\x04mimetypeopendocument",
        b"PK\x03\x04content.xml", b"\xd0\xcf\x11\xe0",
    ),
    ("a ZIP archive", UNPACK, "OLP502"): (
        b"PK\x03\x04", b"PK\x03\x04XL/", b"PK\x03\x04contentxxml", b"PK\x03\x04" + b"\n" * 4001 + b"xl/",
    ),
    ("a gzip archive", UNPACK, "OLP502"): (b"\x1f\x8b\x08",),
    ("a PDF document", PROGRAM, "OLP501"): (b"%PDF-1.7\n",),
    ("a picture", PROGRAM, "OLP501"): (b"\x89PNG\r\n", b"\xff\xd8\xff\xe0", b"GIF89a", b"BMabcd\0\0\0\0"),
    ("an STL mesh", PROGRAM, "OLP501"): (
        b"solid a b\n facet normal", b"SOLID\r\nFACET", b" \nsolid x\n\n endsolid",
    ),
    ("STEP-NC (ISO 14649)", OTHER_POST, "OLP501"): (
        b"ISO-10303-21; MACHINING", b" \nISO-10303-21;\n14649", b"ISO-10303-21;AP238",
        b"ISO-10303-21;" + b"\n" * 3000 + b"WORKPLAN",
    ),
    ("a STEP model", PROGRAM, "OLP501"): (
        b"ISO-10303-21;", b" ISO-10303-21;machining", b"ISO-10303-21;" + b"\n" * 3001 + b"WORKPLAN",
    ),
    ("an IGES model", PROGRAM, "OLP501"): (b"a" * 72 + b"S      1\n",),
    ("a DXF drawing", PROGRAM, "OLP501"): (
        b"0\nSECTION\n", b"  0\r\nSECTION\r\n", b"999\nby a CAD\n 0\nSECTION\n", b"\n999\r\n\r\n0\nSECTION\n",
    ),
    ("a web page or XML", PROGRAM, "OLP501"): (b"<html>", b" \n<!DocType html>", b"<?xml version='1.0'?>"),
    ("a file of olp in TOML", TOML, "OLP501"): (
        b"[machine]\n", b'name = "a"\n', b"# c\n\n  # d\r\n[a.b_c]\r\n", b"values=[1,2]\n", b"a_b = 5\n",
        b"name\t=\t7",
    ),
    ("JSON", PROGRAM, "OLP501"): (b'{"a": 1}', b' [\n{"a": 1}]', b'["a"]', b"[[1]]", b"{{", b"{["),
    ("KUKA KRL", NAMED.replace("sinumerik", "kuka-krl"), "OLP501"): (
        b"&ACCESS RV\n", b" &rel 1\n", b"&PARAM A\n", b"DEF part()\n", b"DEFDAT part (x)\n",
        b"DEFFCT a_1 (b)\r\n",
        b"PTP {X 1}\n", b"LIN_REL {\n", b"CIRC XP1\n", b"lin\tX_1\n", b"PTP XHOME Vel\n",
    ),
    ("ABB RAPID", NAMED.replace("sinumerik", "abb-rapid"), "OLP501"): (
        b"%%% VERSION:1", b"%%%\n VERSION", b"MODULE a\n", b"module a_1 (SYSMODULE)\n", b"PROC main()\n",
        b"proc a (num b)\n",
        b"MoveL p1, v1", b"movej [[1", b"MoveC p1 ,p2", b"MoveAbsJ a,", b"CONST robtarget p",
        b"pers tooldata t", b"VAR\trobtarget p",
    ),
    ("FANUC TP", NAMED.replace("sinumerik", "fanuc-tp"), "OLP501"): (
        b"/PROG A", b"/ATTR\n", b"/MN", b"/pos\n", b"1:J P[1]", b"  12: L PR[1]", b":C P[", b"1:\tj  P[2]",
    ),
    ("Stäubli VAL 3", NAMED.replace("sinumerik", "staubli-val3"), "OLP501"): (
        b"  <program xmlns='STAUBLI'>", b"begin\n movej(a)", b"\tBegin \r\nmovel(b)", b"begin\nmovec(c)",
    ),
    ("Mazatrol", OTHER_POST, "OLP501"): (b"MAZATROL", b"UNo. UNIT", b" \nUNo.\tUNIT"),
    ("UR script", NAMED.replace("sinumerik", "urscript"), "OLP501"): (
        b"def a():\n", b"movej(", b" movel (", b"MOVEP(", b"movec(", b"servoj(", b"def a_1():",
    ),
    ("Yaskawa INFORM (JBI)", NAMED.replace("sinumerik", "yaskawa-inform"), "OLP501"): (
        b"/JOB\n", b"//NAME A", b"//pos\n", b"//INST", b"MOVJ C00001", b" MOVL  C1", b"movc\tC2",
    ),
    ("Sinumerik (Siemens)", NAMED, "OLP501"): (
        b"%_N_A_MPF", b";%_N_A", b";$PATH=/_N_", b"TRAORI\n", b"N10 TRAFOOF", b"CYCLE81(1", b"N5CYCLE832 (",
        b"MCALL\n",
        b"DEF REAL A", b"N10 PROC A", b"POCKET3(", b"HOLES1 (", b'MSG("a")', b"TRANS X1", b"ATRANS Y1",
        b"ROT Z30", b"AROT Z1",
        b"MIRROR X0", b"AMIRROR X0", b"SCALE X2", b"ASCALE X2", b"R1=5", b"R12 = R1", b"EXTERN A", b"SUPA G0",
        b"FFWON", b"SOFT",
        b"COMPCAD", b"COMPON", b"G641", b"N9 G642 X1", b"WORKPIECE(", b"G1 X=R1", b"G1 Y=-5", b"G2 I=5",
        b"S1=500", b"G0 Z= +5",
        b"X1=5", b"G1 F=(1)",
    ),
    ("Okuma OSP", OSP, "OLP501"): (
        b"$A-1.MIN%", b"$B.SSB", b" $C.SUB", b"CALL O1", b"N10 call\tOA", b"VC1=5", b"N5VTOFX = 1",
    ),
    ("HPGL", PROGRAM, "OLP501"): (
        b"IN;SP1;", b" in;", b"\x1b.(IN;", b"PU0,0;", b"SP1;\nPD -1,2,3,4;", b"X;PA1,-2;",
    ),
}  # fmt: skip
#: Languages that are read by another dialect.
READ = (
    "Sinumerik (Siemens)", "Okuma OSP", "KUKA KRL", "ABB RAPID", "FANUC TP", "Stäubli VAL 3", "UR script",
    "Yaskawa INFORM (JBI)",
)  # fmt: skip
LANGUAGES = (
    "KUKA KRL", "ABB RAPID", "FANUC TP", "Stäubli VAL 3", "Mazatrol",
    "UR script",
    "Yaskawa INFORM (JBI)", "Sinumerik (Siemens)", "Okuma OSP", "HPGL",
)  # fmt: skip


def test_every_sign_is_tried() -> None:
    assert {name for name, _, _ in SIGNS} == {kind.name for kind in FOREIGN}


@pytest.mark.parametrize("kind", SIGNS, ids=lambda kind: kind[0])
def test_every_sign_says_what_it_is_and_what_to_do(kind: tuple[str, str, str]) -> None:
    name, instead, code = kind
    for text in SIGNS[kind]:
        error = recognised(text, languages=True)
        assert error is not None, text
        how = "and was read as another language" if name in READ else "which is not read"
        assert (error.message, error.code) == (f"this is {name}, {how}; {instead}", code), text
        # in a text whose dialect is certain no language is looked for
        certain = recognised(text, languages=False)
        assert (certain is None) is (name in LANGUAGES), text
        if name in LANGUAGES and name not in ("Mazatrol", "HPGL"):
            later = recognised(b"G0 X1\n(a)\n" + text, languages=True)
            assert later is not None and later.message == error.message, text
            assert later.line == 3, text


@pytest.mark.parametrize(
    "text",
    [
        b"", b"G0 X1\n", b" \xff\xfe", b" PK\x03\x04" + b"X" * 99, b"X\x1f\x8b" + b"X" * 99, b" %PDF-", b"BM",
        b"GIF7", b"solid\nX1\n", b"solids\nfacet",
        b"ISO-10303-22;", b"a" * 71 + b"S      1", b"0\nSECTIONS\n", b"1\nSECTION\n", b"<a>", b"(<html>",
        b"[Machine]\n", b"G1 X1\n[machine]\n", b"[1]", b"BEGINPGM", b"PGM BEGIN", b"1 L X+1 R0\n2 M30\n",
        b"L X+1 R0\nL X+2 R0\n",
        b"&ACCESSED", b"PTP X -5\n", b"LIN P2\n", b"MODULE a b\n", b"MoveL p1 v1",
        b"VAR num a", b"/PROGS", b"1:J X[", b"1 J P[1]", b"begin\nX1", b"begin movej(", b"(MAZATROL)",
        b"UNo.1",
        b"xmovej(", b"/JOBS", b"MOVJ P1", b"MOVX C1", b"(R1=5)", b"; X=5", b"#1=5", b"G64 X1", b"G6411",
        b"TRANSX", b"CYCLE(",
        b"CALL P1", b"$A.MINI", b"VX1=5", b"PU 1;", b"PD1,A;", b"(IN;)", b"(PU0,0", b"G1 IN;",
    ],
)  # fmt: skip
def test_texts_that_are_nearly_another(text: bytes) -> None:
    assert recognised(text, languages=True) is None


def test_the_line_is_that_of_what_was_recognised() -> None:
    for text, line in ((b"\n\n  <html>", 3), (b"G0\nX1\n \t&REL 1\n", 3),
                       (b"a\nb\nbegin\n movej(a)", 3), (b"SP1;\nPU1,1;", 2)):  # fmt: skip
        error = recognised(text, languages=True)
        assert error is not None and error.line == line, text


def test_only_the_start_of_a_text_is_looked_at() -> None:
    padding = b"G0 X1\n" * (LOOKED_AT // 6)
    assert len(padding) == LOOKED_AT - 4
    assert recognised(padding + b"SOFT", languages=True) is not None
    assert recognised(padding + b"COMPON", languages=True) is None
    assert recognised(b"X" + padding + b"SOFT", languages=True) is None


def test_more_than_one_byte_in_fifty_is_of_a_binary_file() -> None:
    sentence = "is in no text, so this is a binary file or one of another coding"
    for byte in (0, 8, 0x0E, 0x10, 0x15, 0x19, 0x1C, 0x1F):
        text = b"G0\n" + bytes([byte]) + b"X" * 46
        assert len(text) == 50
        assert recognised(text, languages=False) is None
        error = recognised(text[:-1], languages=False)
        assert error is not None
        assert (error.message, error.code, error.line) == (
            f"the byte {byte:#04x} {sentence}; {PLAIN}",
            "OLP502",
            2,
        )
        assert recognised(text * 9, languages=True) is None
        assert recognised(text[:-1] * 9, languages=True) is not None
    for byte in (9, 10, 13, 0x11, 0x14, 0x1A, 0x1B, 0x20, 0x7F, 0xFF):
        assert recognised(bytes([byte]) * 40, languages=False) is None


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
