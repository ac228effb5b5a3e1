"""25 more mistakes of new users than those of `test_newcomers.py`: calls, names of files, codings, units.

Each message is one that says what is wrong, where, and what to do; nothing is written.
"""

from __future__ import annotations

import gzip
import os
import re
import zipfile
from pathlib import Path

import pytest
from cli.test_cli import run
from cli.test_newcomers import PLAIN, Case, Mistake, changed, program, void, written

CORRECT = ("correct", "part.nc", "-m", "machine.toml")


def zipped(folder: Path) -> None:
    with zipfile.ZipFile(folder / "part.nc", "w") as archive:
        archive.writestr("part.nc", PLAIN)


def recoded(file: str, coding: str) -> Mistake:
    """A file in another coding."""
    return lambda folder: void((folder / file).write_bytes((folder / file).read_text("utf-8").encode(coding)))


def german(folder: Path) -> None:
    """A sheet saved as CSV by a German Excel: semicolons, decimal commas, a byte order mark."""
    text = (folder / "x.csv").read_text("utf-8").replace(",", ";").replace(".", ",")
    (folder / "x.csv").write_text(text, "utf-8-sig")


def expired(folder: Path) -> None:
    text = (folder / "calibration.toml").read_text("utf-8")
    stated = re.sub(r"valid_until = .*", "valid_until = 2026-10-01", text)
    (folder / "calibration.toml").write_text(stated, "utf-8")


def fresh(folder: Path) -> None:
    words = ["--chain", "XYFZ", "--controller", "haas", "--travel", "X", "-762", "0", "--travel", "Y", "-406"]
    made = run("init", folder / "new", *words, "0", "--travel", "Z", "-508", "0")
    assert made.exit_code == 0, made.stderr


CASES = [
    # the call
    Case("machine file without -m", ("machine.toml is one word too many", "machine file with -m"),
         args=("correct", "part.nc", "machine.toml"), code=2),
    Case("-m and -j exchanged", ("this is a machine file", "expected a job file"),
         args=("correct", "part.nc", "-m", "job.toml", "-j", "machine.toml")),
    Case("folder as program", (".: is a folder", "expected a program in it"),
         args=("correct", ".", "-m", "machine.toml")),
    Case("no verb", ("there is no verb 'part.nc'", "such as olp correct part.nc"),
         args=("part.nc", "-m", "machine.toml"), code=2),
    Case("typo in a verb", ("there is no verb 'corect'", "did you mean correct?"),
         args=("corect", *CORRECT[1:]), code=2),
    Case("typo in an option", ("no option --tolerence-um", "did you mean --tolerance-um?"),
         args=(*CORRECT, "--tolerence-um", "1"), code=2),
    Case("option of Windows", ("/q is one word too many", "options begin with - or --"),
         args=(*CORRECT, "/q"), code=2),
    Case("option of another verb", ("no option --step-mm", "olp correct --help lists the options"),
         args=(*CORRECT, "--step-mm", "1"), code=2),
    Case("option without its value", ("--tolerance-um needs a value", "give one, or leave"),
         args=(*CORRECT, "--tolerance-um"), code=2),
    Case("wrong unit behind a number",
         ("'--tolerance-um'", "'1 kg' is not a number", '"kg" is not a unit of length'),
         args=(*CORRECT, "--tolerance-um", "1 kg"), code=2),
    Case("decimal comma in an option", ("'0,5' is not a number", "a decimal point instead of the comma"),
         args=(*CORRECT, "--tolerance-um", "0,5"), code=2),
    Case("day in another order", ("'21.11.2026' is not a day", "such as 2026-05-14, or today"),
         args=(*CORRECT, "--date", "21.11.2026"), code=2),
    Case("PDF as report", ("r.pdf: is not a form of this report", "expected .html"),
         args=(*CORRECT, "--report", "r.pdf"), code=2),
    Case("skew without a unit", ("skew XY=1.414", "expected such as 1.4mm/m"),
         args=("correct", "part.nc", "--skew", "XY=1.414"), code=2),
    Case("skew as a length alone", ("skew XY=0.4mm", "expected such as 1.4mm/m, 0.4mm/600mm"),
         args=("correct", "part.nc", "--skew", "XY=0.4mm"), code=2),
    Case("angle between the axes as skew", ("XY=90.02deg is 90.02 deg", "differs from 90 deg, such as"),
         args=("correct", "part.nc", "--skew", "XY=90.02deg"), code=2),
    Case("skew without a name", ("skew '1.4mm/m'", "such as XY=1.4mm/m"),
         args=("correct", "part.nc", "--skew", "1.4mm/m"), code=2),
    Case("ratio as scale", ("scale of", "such as -0.2% where it moves 99.8 mm instead of 100 mm"),
         args=("correct", "part.nc", "--scale", "X=100.2%"), code=2),
    Case("backlash of a rotary axis", ("backlash 'A=0.1mm'", "out of X, Y, Z, such as X=0.05mm"),
         args=("correct", "part.nc", "--backlash", "A=0.1mm"), code=2),
    Case("travel without an end", ("--travel needs 3 values after it", "--help says which"),
         args=("init", "new", "--travel", "X", "500"), code=2),
    Case("travel from high to low", ("travel of X is [500, 0] mm", "expected min below max"),
         args=("init", "new", "--travel", "X", "500", "0"), code=2),
    Case("verify with one program", ("CORRECTED is missing", "expected olp verify NOMINAL CORRECTED"),
         args=("verify", "part.nc", "-m", "machine.toml"), code=2),
    Case("batch without an output", ("-o OUT is missing", "expected olp batch -o OUT"),
         args=("batch", ".", "-m", "machine.toml"), code=2),
    Case("batch into its own folder", (".: holds the programs of this call", "name another folder with -o"),
         args=("batch", ".", "-m", "machine.toml", "-o", "."), code=2),
    Case("no program", ("no program is given", "name it, or set the key program of the job"),
         args=("correct", "-m", "machine.toml"), code=2),
    # names of files
    Case("typo in the name of the calibration", ("calibraton.toml: no such file", "check the path",
         "the key calibration of the machine file names it"),
         changed("machine.toml", '"calibration.toml"', '"calibraton.toml"')),
    Case("backslash in TOML", ("write the path with / between folders", "key calibration of the machine"),
         changed("machine.toml", '"calibration.toml"', r"'cal\calibration.toml'")),
    Case("output is the machine file", ("machine.toml: is an input", "name another output"),
         args=(*CORRECT, "-o", "machine.toml", "--force"), code=2),
    Case("output is a folder", ("out: is a folder", "name a file to write"),
         lambda folder: (folder / "out").mkdir(), args=(*CORRECT, "-o", "out"), code=2),
    Case("output exists", ("part.corrected.nc: exists already", "overwrite it with --force"),
         written("part.corrected.nc", b"mine"), code=2),
    # codings and formats
    Case("zipped program", ("part.nc:1: this is a ZIP archive", "unpack it"), zipped),
    Case("gzipped program", ("this is a gzip archive", "unpack it"),
         written("part.nc", gzip.compress(PLAIN))),
    Case("PDF as program", ("part.nc:1: this is a PDF document", "the program that the CAM system writes"),
         written("part.nc", b"%PDF-1.7\n%\xe2\xe3\xcf\xd3\n1 0 obj\n<< /Type /Catalog >>\nendobj\n")),
    Case("UTF-16 without a mark", ("part.nc:1", "the byte 0x00 is in no text", "save it as plain text"),
         recoded("part.nc", "utf-16-le")),
    Case("UTF-16 in TOML", ("machine.toml: the text is UTF-16", "expected a text file saved as UTF-8"),
         recoded("machine.toml", "utf-16")),
    Case("UTF-16 in CSV", ("x.csv: line 1: this is UTF-16 text", "save it as plain text"),
         recoded("x.csv", "utf-16")),
    Case("Latin-1 in TOML", ("machine.toml: line 1: byte 0xe4 is not UTF-8", "saved as UTF-8"),
         lambda folder: void((folder / "machine.toml").write_bytes(
             b"# Fr\xe4se\n" + (folder / "machine.toml").read_bytes()))),
    Case("empty machine file", ("machine.toml: the file is empty", "olp init writes first files"),
         written("machine.toml", b"\r\n")),
    Case("CSV of a German Excel", ("x.csv: line 1", "semicolons", "expected commas"), german),
    Case("sep= of Excel", ("x.csv: line 1: sep= is a line for Excel", "delete it"),
         lambda folder: void((folder / "x.csv").write_text(
             "sep=,\n" + (folder / "x.csv").read_text("utf-8"), "utf-8"))),
    Case("empty rows of a sheet", ("x.csv: line 23: has marks between columns and no value", "delete this"),
         lambda folder: void((folder / "x.csv").write_text(
             (folder / "x.csv").read_text("utf-8") + ",,,,,,\n,,,,,,\n", "utf-8"))),
    Case("tabs in CSV", ("x.csv: line 1", "tabs", "replace them in this file"),
         changed("x.csv", ",", "\t")),
    Case("DXF as program", ("part.nc:1: this is a DXF drawing", "the program that the CAM system writes"),
         written("part.nc", b"0\nSECTION\n2\nHEADER\n9\n$ACADVER\n")),
    # units and values
    Case("blank in a key", ("machine.toml: line 10", "a key has no blanks", "did you mean travel_mm?"),
         changed("machine.toml", "travel_mm", "travel mm", 1)),
    Case("inch in a key", ("line 10: axes.X.travel_in is not a known key", "did you mean travel_mm?"),
         changed("machine.toml", "travel_mm", "travel_in", 1)),
    Case("unit in a column", ("x.csv: line 1", '"EXX_mm"', "expected EXX_um, values in um"),
         changed("x.csv", "EXX_um", "EXX_mm")),
    Case("metres in the machine file", ("OLP452", "seems to be in metres; expected mm"),
         changed("machine.toml", "[-762.0, 0.0]", "[-0.762, 0.0]", 1)),
    Case("inch program by mistake", ("part.nc:5", "outside the calibrated box", "counts in inches there"),
         program(b"G21", b"G20")),
    Case("part outside the box", ("part.nc:7: axis X", "-760 to -2 mm", "--outside-box hold"),
         program(b"X50.", b"X-700.")),
    # machine, calibration, dialect
    Case("cycle that the control alone knows",
         ("part.nc:7: G150 cuts a pocket inside the control", "post the moves"),
         program(b"X50.", b"G150 X50. Y3.")),
    Case("tilted plane", ("part.nc:7: G68.2 (tilted plane) is not read", "post the program without it"),
         program(b"X50.", b"G68.2 X50. Y3.")),
    Case("datum in another frame", ("OLP453", "datum_mm has X = 9000", "expected -762 to 0 mm"),
         changed("calibration.toml", "datum_mm = [-381.0", "datum_mm = [9000.0")),
    Case("curve of another axis", ('x.csv: line 1: column 2 is "EXX_um"', "column 1 is Y_mm"),
         changed("x.csv", "X_mm", "Y_mm", 1)),
    Case("axis in small letters", ("machine.toml: line 9: axes.x is not a known key", "did you mean X?"),
         changed("machine.toml", "[axes.X]", "[axes.x]")),
    Case("no travel", ("machine.toml: line 9: axes.X.travel_mm is missing", "[min, max] in mm"),
         changed("machine.toml", "travel_mm = [-762.0, 0.0]\n", "")),
    Case("calibration of a later day", ("OLP460", "after the day of the run, 2020-01-01", "Check --date"),
         args=(*CORRECT, "--date", "2020-01-01")),
    Case("length of a tool is not defined", ("part.nc:4", "tool 99", "give [tools.99]"),
         program(b"H1", b"H99")),
    Case("cutter compensation", ("part.nc:7", "radius of tool 99, which is not known", "give radius_mm"),
         program(b"X50.", b"G41 D99 X50.")),
    Case("statements of another dialect", ("part.nc:1", "is not a statement that olp knows in APT"),
         args=(*CORRECT, "--dialect", "apt")),
    Case("calibration of another machine", ("calibration.toml: line 2", '"mill-2"', 'expected "mill-30-16"'),
         changed("calibration.toml", "mill-30-16", "mill-2")),
    Case("calibration of zeros", ("OLP440", "every value is zero", "Put measured values"), fresh,
         args=("correct", "part.nc", "-m", "new/machine.toml")),
    Case("program of Mazak", ("part.nc:1: this is Mazatrol", "post-process the part"),
         written("part.nc", b"MAZATROL MATRIX\nX+10\n")),
    Case("calibration that has expired", ("OLP401", "valid until 2026-10-01", "Measure the machine again"),
         expired, args=(*CORRECT, "--date", "2026-11-21")),
]  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_mistake_gets_a_clear_message(shop: Path, case: Case) -> None:
    case.make(shop)
    before = {path: path.read_bytes() for path in shop.rglob("*") if path.is_file()}
    result = run(*case.args)
    assert result.exit_code == case.code, result.stderr
    errors = [line for line in result.stderr.splitlines() if line.startswith("olp: ")]
    for words in case.says:
        assert words in "\n".join(errors)
    assert "defect" not in result.stderr and "Traceback" not in result.stderr
    after = {path: path.read_bytes() for path in shop.rglob("*") if path.is_file()}
    assert after == before, "nothing is written"


def test_there_are_at_least_25() -> None:
    assert len({case.name for case in CASES}) == len(CASES) >= 25


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_message_is_plain(shop: Path, case: Case) -> None:
    """No words of the library of the command line, no types of Python, no more than 60 words a line."""
    case.make(shop)
    errors = [line for line in run(*case.args).stderr.splitlines() if line.startswith("olp: error: ")]
    for line in errors:
        assert not re.search(
            r"\b(None|NoneType|Errno|PosixPath|WindowsPath|str|float|invalid literal)\b", line
        )
        assert not re.search(r"Got unexpected|No such option|requires an argument|%Y", line)
        assert len(line.split()) <= 60, line


def test_a_byte_order_mark_is_no_mistake(shop: Path) -> None:
    for name in ("part.nc", "machine.toml", "calibration.toml", "x.csv"):
        (shop / name).write_bytes(b"\xef\xbb\xbf" + (shop / name).read_bytes())
    assert run(*CORRECT, "-q").exit_code == 0


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_may_not_be_written_to(shop: Path) -> None:
    (shop / "out").mkdir(mode=0o555)
    result = run(*CORRECT, "-o", "out/part.nc")
    assert result.exit_code == 4
    assert "name another folder, or let your user write there" in result.stderr
