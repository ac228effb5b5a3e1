"""Typical mistakes of a first day: each gets one sentence that says what, where, what was expected, and how
to go on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from cli.test_cli import PROGRAMS, run

MILL = PROGRAMS / "haas-mill"
PLAIN = b"%\nG21 G90 G54 G17\nT1 M6\nG43 H1\nG0 X0. Y0. Z20.\nG1 Z5. F300.\nX50.\nM30\n%\n"

Mistake = Callable[[Path], None]


@dataclass(frozen=True, slots=True)
class Case:
    """A mistake in a folder with part.nc and the files of the mill, the call, and what its message says."""

    name: str
    says: tuple[str, ...]
    make: Mistake = lambda folder: None
    args: tuple[str, ...] = ("correct", "part.nc", "-m", "machine.toml")
    code: int = 3


def changed(file: str, old: str, new: str, times: int = -1) -> Mistake:
    """Another text in a file."""

    def make(folder: Path) -> None:
        text = (folder / file).read_text("utf-8")
        assert old in text
        (folder / file).write_text(text.replace(old, new, times), "utf-8")

    return make


def written(file: str, data: bytes) -> Mistake:
    """A file with other contents."""
    return lambda folder: void((folder / file).write_bytes(data))


def void(_: object) -> None:
    """The result of a call that does not matter."""


def program(old: bytes, new: bytes) -> Mistake:
    """The program with another word."""
    assert old in PLAIN
    return written("part.nc", PLAIN.replace(old, new))


def headless(folder: Path) -> None:
    lines = (folder / "x.csv").read_text("utf-8").splitlines(keepends=True)
    (folder / "x.csv").write_text("".join(lines[1:]), "utf-8")


def thousandths(folder: Path) -> None:
    """Errors of X in mm in columns of um."""
    head, *rows = (folder / "x.csv").read_text("utf-8").splitlines()
    cells = [row.split(",") for row in rows]
    less = [",".join([c[0], *(f"{float(v) / 1000:.6f}" for v in c[1:])]) for c in cells]
    (folder / "x.csv").write_text("\n".join([head, *less]) + "\n", "utf-8")


def corrected(folder: Path) -> None:
    result = run("correct", folder / "part.nc", "-m", folder / "machine.toml", "-o", folder / "done.nc", "-q")
    assert result.exit_code == 0, result.stderr


def without_z(folder: Path) -> None:
    text = (folder / "machine.toml").read_text("utf-8")
    start = text.index("[axes.Z]")
    (folder / "machine.toml").write_text(text[:start] + text[text.index("\n[", start + 1) + 1 :], "utf-8")


XLSX = b"PK\x03\x04\x14\0\6\0\x08\0xl/workbook.xml" + bytes(40)

CASES = [
    Case("two files without -m", ("part.nc", "machine file with -m"),
         args=("correct", "machine.toml", "part.nc"), code=2),
    Case("machine file as program", ("machine.toml: is a TOML file and no program", "machine file with -m"),
         args=("correct", "machine.toml"), code=2),
    Case("program as machine file", ("part.nc", "line 1", "is not TOML", "end in .toml"),
         args=("correct", "part.nc", "-m", "part.nc")),
    Case("job file as machine file", ("job.toml", "this is a job file", "expected a machine file"),
         args=("correct", "part.nc", "-m", "job.toml")),
    Case("calibration as machine file", ("calibration.toml", "this is a calibration",
         "expected a machine file"),
         args=("correct", "part.nc", "-m", "calibration.toml")),
    Case("folder as machine file", (".: is a folder", "expected a file in it"),
         args=("correct", "part.nc", "-m", ".")),
    Case("no machine file", ("no machine file is given", "-m", "key machine of the job",
         "olp init writes one", "--skew"),
         args=("correct", "part.nc"), code=2),
    Case("decimal comma in an option", ("skew XY=0,4mm/600mm", "decimal point instead of the comma"),
         args=("correct", "part.nc", "--skew", "XY=0,4mm/600mm"), code=2),
    Case("no such program", ("absent.nc: no such file", "check the path"),
         args=("correct", "absent.nc", "-m", "machine.toml")),
    Case("no calibration named", ("mill-30-16", "names no calibration", "key calibration"),
         changed("machine.toml", 'calibration = "calibration.toml"\n', "")),
    Case("calibration is missing", ("cal.toml: no such file", "check the path"),
         changed("machine.toml", "calibration.toml", "cal.toml")),
    Case("curve is missing", ("calibration.toml: line 13", 'file = "xx.csv"', "no such file"),
         changed("calibration.toml", "x.csv", "xx.csv")),
    Case("header is missing", ("x.csv: line 1: the header is missing", "expected X_mm"), headless),
    Case("column without unit", ("x.csv: line 1", '"EXX"', "did you mean EXX_um?"),
         changed("x.csv", "EXX_um", "EXX")),
    Case("degrees in a column of angles", ("x.csv: line 1", "EAX_deg", "expected EAX_urad, values in urad"),
         changed("x.csv", "EAX_urad", "EAX_deg")),
    Case("semicolons", ("x.csv: line 1", "semicolons", "expected commas between columns"),
         changed("x.csv", ",", ";")),
    Case("mm in columns of um", ("OLP450", "axis X", "expected columns in um and urad", "Check the unit"),
         thousandths),
    Case("sheet instead of CSV", ("x.csv: line 1", "spreadsheet", "save the sheet as CSV"),
         written("x.csv", XLSX)),
    Case("key with a typo", ("machine.toml: line 10", "axes.X.travl_mm", "did you mean travel_mm?"),
         changed("machine.toml", "travel_mm", "travl_mm", 1)),
    Case("text without quotes", ("machine.toml: line 5", "is not TOML", "text needs quotes"),
         changed("machine.toml", '"haas"', "haas")),
    Case("decimal comma in TOML", ("machine.toml: line 10", "decimal point instead of the comma"),
         changed("machine.toml", "travel_mm = [-762.0, 0.0]", "travel_mm = -762,0")),
    Case("Windows path in TOML", ("machine.toml: line 6", "file name on Windows single quotes"),
         changed("machine.toml", '"calibration.toml"', '"C:\\cal\\new.toml"')),
    Case("axis is missing", ("machine.toml", "axes.Z is missing", "a table [axes.Z]"), without_z),
    Case("limits are exchanged", ("machine.toml: line 10", "[0, -762]", "min below max"),
         changed("machine.toml", "[-762.0, 0.0]", "[0.0, -762.0]")),
    Case("unknown control", ("machine.toml: line 5", '"selca"', "expected one of linuxcnc"),
         changed("machine.toml", '"haas"', '"selca"')),
    Case("unknown dialect", ("no dialect 'hass'", "did you mean haas?"),
         args=("correct", "part.nc", "-m", "machine.toml", "--dialect", "hass"), code=2),
    Case("wrong dialect", ("part.nc", "is not a statement that olp knows"),
         args=("correct", "part.nc", "-m", "machine.toml", "--dialect", "apt")),
    Case("decimal comma in the program", ("part.nc:7", "`X50,5`", "decimal point instead of the comma"),
         program(b"X50.", b"X50,5")),
    Case("tool is not defined", ("part.nc:3", "tool 77", "is not defined", "give [tools.77]"),
         program(b"T1 M6", b"T77 M6")),
    Case("work offset is not defined", ("part.nc:5", "G58 is used but not defined",
         'give [work_offsets."G58"]'),
         program(b"G54", b"G58")),
    Case("macro program", ("part.nc:7", "`X#100`", "--flatten does not unroll it"),
         program(b"X50.", b"X#100")),
    Case("macro program that unrolls", ("part.nc:8", "`X#1`", "an expression gives its X",
         "unroll the program with --flatten"),
         program(b"G1 Z5. F300.\nX50.", b"#1=50.\nG1 Z5. F300.\nX#1")),
    Case("nested comment", ("part.nc:2", "comment inside a comment", "take the inner brackets out"),
         program(b"G21 G90", b"(A (B) C)\nG21 G90")),
    Case("already corrected", ("done.nc:", "has the stamp", "correct the nominal program"), corrected,
         args=("correct", "done.nc", "-m", "machine.toml")),
    Case("programs exchanged", ("done.nc", "exchange the two"), corrected,
         args=("verify", "done.nc", "part.nc", "-m", "machine.toml")),
    Case("empty program", ("part.nc", "the file is empty", "expected a program"), written("part.nc", b"")),
    Case("binary file", ("part.nc:1", "binary file", "plain text"),
         written("part.nc", bytes(range(256)) * 4)),
    Case("UTF-16", ("part.nc:1", "UTF-16", "plain text"),
         written("part.nc", PLAIN.decode().encode("utf-16"))),
    Case("sheet as program", ("part.nc:1", "spreadsheet", "CSV"), written("part.nc", XLSX)),
    Case("output is the input", ("part.nc: is an input", "name another output"),
         args=("correct", "part.nc", "-m", "machine.toml", "-o", "part.nc"), code=2),
    Case("output without folder", ("there is no folder", "create it first"),
         args=("correct", "part.nc", "-m", "machine.toml", "-o", "out/part.nc"), code=2),
    Case("comma in an option", ("--tolerance-um", "'0,5' is not a number", "expected a number"),
         args=("correct", "part.nc", "-m", "machine.toml", "--tolerance-um", "0,5"), code=2),
    Case("opposite sign", ("calibration.toml: line 6", "sign", "multiply curve columns"),
         changed("calibration.toml", "actual-minus-commanded", "commanded-minus-actual")),
]  # fmt: skip


def test_without_a_mistake_the_program_is_corrected(shop: Path) -> None:
    result = run("correct", "part.nc", "-m", "machine.toml", "-q")
    assert (result.exit_code, result.stderr) == (0, "")


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_mistake_gets_a_clear_message(shop: Path, case: Case) -> None:
    case.make(shop)
    before = sorted(path.name for path in shop.iterdir())
    result = run(*case.args)
    assert result.exit_code == case.code, result.stderr
    for words in case.says:
        assert words in result.stderr
    assert "Traceback" not in result.stderr
    assert sorted(path.name for path in shop.iterdir()) == before, "nothing is written"


def test_there_are_at_least_25() -> None:
    assert len(CASES) >= 25
