"""Languages that a file describes: forms, what their statements do, and the files that come with `olp`."""

from __future__ import annotations

import contextlib
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from judge.machines import Recipe, random_machine, zero_machine
from judge.model import JudgeModel
from program.pointlist.test_lists import same

import olp
from olp.cli import main
from olp.core.errors import ConfigError, OlpError, ProgramError
from olp.core.machine import Setup
from olp.core.toolpath import Kind
from olp.files.config import load_setup
from olp.files.described import described, load_described
from olp.files.fields import SHIPPED
from olp.files.json_schema import json_schema
from olp.program.described.forms import form
from olp.program.dialect import Dialect, Support
from olp.program.registry import read

FRAMES = {
    "G54": {"X_mm": 210.0, "Y_mm": 180.0, "Z_mm": -260.0, "set_by": "true"},
    "TABLE": {"X_mm": 300.0, "Y_mm": 200.0, "Z_mm": -250.0, "C_deg": 20.0, "set_by": "true"},
}
OFFSET = np.array([210.0, 180.0, -260.0])

OWN = """
schema = "olp-dialect-1"
name = "own"
title = "A language of our own"
unit = "mm"
speed_unit = "mm/min"
comments = ["!"]
stamp = ["! ", ""]
quote = '"'
continuation = "&"
label = "N{number}"
carry = ["SPEED ...", "SAY ..."]
refuse = { "LOOP ..." = "write it out" }
[[statements]]
form = "GO X{x} Y{y} Z{z} [A{a}]"
does = "rapid"
[[statements]]
form = "CUT X{x} Y{y} Z{z} [A{a}] [F{speed}]"
does = "line"
[[statements]]
form = "STEP X{x} Y{y} Z{z}"
does = "line"
incremental = true
[[statements]]
form = "PART Z{z}"
does = "line"
[[statements]]
form = "TOOL {tool}"
does = "tool"
[[statements]]
form = "FRAME {frame}"
does = "frame"
[[statements]]
form = "INCH"
does = "unit"
unit = "inch"
[[statements]]
form = "PARK"
does = "away"
"""
PROGRAM = b"""! a program
N10 SPEED 100
N20 GO X1.000 Y2.000 Z30.000
N30 CUT X80.500 Y60.250 Z40.125 F10 ! there
N40 CUT X100.000 &
    Y90.000 Z40.125
N50 SAY "! no comment"
N60 STEP X1.000 Y-2.000 Z0.500
N70 STEP X1.000 Y-2.000 Z0.500
N80 TOOL 2
N90 CUT X0.000 Y0.000 Z50.000 A15
N95 FRAME TABLE
N100 CUT X10.000 Y20.000 Z60.000
N110 PARK
"""


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    recipe = Recipe(work_offsets=FRAMES, increment_mm=0.0001)
    return random_machine(tmp_path_factory.mktemp("own") / "m", 6, recipe)


@pytest.fixture(scope="module")
def perfect(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return zero_machine(tmp_path_factory.mktemp("own") / "zero", Recipe(work_offsets=FRAMES))


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("own") / "own.toml"
    path.write_text(OWN)
    return path


def setup_of(machine: Path, dialect: Dialect | None) -> Setup:
    setup = load_setup(machine)
    return replace(setup, job=replace(setup.job, described=dialect))


def ends(text: bytes, setup: Setup) -> np.ndarray:
    dialect = setup.job.described
    assert isinstance(dialect, Dialect)
    return read(text, setup, dialect).toolpath.end_mm


def judged(text: bytes, corrected: bytes, machine: Path, setup: Setup, tools: list[int]) -> float:
    """How far the tip is from the nominal waypoints, by the independent model."""
    model = JudgeModel(machine)
    nominal, command = ends(text, setup), ends(corrected, setup)
    if len(command) > len(nominal):
        # the last parts of moves that were split
        near = [
            int(np.abs(np.nan_to_num(command, nan=1e9) - n).max(axis=1).argmin())
            for n in np.nan_to_num(nominal, nan=1e9)
        ]
        command = command[near]
    known = np.isfinite(nominal).all(axis=1)
    tool_vector = np.array([model.tool_vector_mm(n) for n in tools])
    actual = command[known] + model.error_mm(command[known], tool_vector[known])
    return float(np.abs(actual - nominal[known]).max())


def test_every_statement_does_what_its_form_says(machine: Path, own: Path) -> None:
    own_program = read(PROGRAM, setup_of(machine, load_described(own)), load_described(own))
    path = own_program.toolpath
    assert path.kind.tolist() == [Kind.RAPID, *[Kind.LINE] * 6, Kind.RAPID]
    assert path.line.tolist() == [3, 4, 5, 8, 9, 11, 13, 14]
    assert path.end_mm[1] == pytest.approx(OFFSET + np.array((80.5, 60.25, 40.125)))
    assert path.end_mm[2] == pytest.approx(OFFSET + np.array((100.0, 90.0, 40.125)))
    assert path.end_mm[4] == pytest.approx(OFFSET + np.array((102.0, 86.0, 41.125)))
    c, s = np.cos(np.radians(20.0)), np.sin(np.radians(20.0))
    turned = np.array([c * 10 - s * 20, s * 10 + c * 20, 60.0])
    assert path.end_mm[6] == pytest.approx(turned + np.array([300.0, 200.0, -250.0]))
    assert np.isnan(path.end_mm[7]).all()
    assert [path.frames[f].tool for f in path.frame] == [1, 1, 1, 1, 1, 2, 2, 2]
    assert own_program.statements is not None
    assert own_program.statements.feed_mm_s[1:7] == pytest.approx([10 / 60] * 6)


def test_a_corrected_program_brings_the_tip_there(machine: Path, own: Path) -> None:
    setup = setup_of(machine, load_described(own))
    result = olp.correct(PROGRAM, setup)
    assert judged(PROGRAM, result.data, machine, setup, [1] * 5 + [2] * 3) < 3e-4
    assert result.report["deviation"]["holds"]
    codes = {f.code for f in result.findings}
    assert "OLP331" in codes
    # nothing differs but numbers of positions, inserted copies and the stamp
    lines = result.data.decode().splitlines()
    assert lines[0].startswith("! olp-corrected ")
    kept = [line for line in PROGRAM.decode().splitlines() if not re.search("GO|CUT|STEP|Y90", line)]
    assert [line for line in lines[1:] if not re.search("GO|CUT|STEP|Y90|Y89", line)] == kept


def test_distances_do_not_drift(machine: Path, own: Path) -> None:
    step = b"STEP X0.0130 Y0.0070 Z-0.0010\n"
    text = b"GO X0.0000 Y0.0000 Z40.0000\n" + step * 400
    setup = setup_of(machine, load_described(own))
    result = olp.correct(text, setup)
    assert judged(text, result.data, machine, setup, [1] * 401) < 2e-4


def test_long_moves_are_split_with_copies_of_their_statement(machine: Path, own: Path) -> None:
    text = b"GO X-200.0000 Y-150.0000 Z100.0000\nCUT X500.0000 Y400.0000 Z100.0000 F20 ! far\n"
    result = olp.correct(text, setup_of(machine, load_described(own)), tolerance_um=0.5)
    rows = [r for r in result.data.splitlines() if b"CUT" in r]
    assert len(rows) > 3
    assert rows[0].endswith(b"F20 ! far")
    assert all(r.endswith(b"F20") for r in rows[1:])
    assert result.report["deviation"]["holds"]


def test_without_error_nothing_is_touched(perfect: Path, own: Path) -> None:
    assert olp.correct(PROGRAM, setup_of(perfect, load_described(own))).data == PROGRAM


@pytest.mark.parametrize(("text", "line", "words"), [
    (b"GO X1 Y2 Z3\nJUMP X1\n", 2, "`JUMP X1` is not a statement of the dialect own"),
    (b"GO X1 Y2 Z3\nLOOP 5\n", 2, "is not read: write it out"),
    (b"GO X1 Y2\n", 1, "is not a statement"),
    (b"TOOL 9\nGO X1 Y2 Z3\n", 2, "tool 9"),
    (b"FRAME NOWHERE\nGO X1 Y2 Z3\n", 2, "NOWHERE"),
    (b"GO X1.000 Y2.000 Z3.000\nPART Z30.000\n", 2, "leaves out"),
    (b"PART Z30.000\n", 1, "X and Y"),
    (b"STEP X1 Y1 Z1\n", 1, "position of X"),
])  # fmt: skip
def test_what_may_move_and_is_not_understood_is_refused(
    machine: Path, own: Path, text: bytes, line: int, words: str
) -> None:
    with pytest.raises(ProgramError, match=re.escape(words)) as caught:
        olp.correct(text, setup_of(machine, load_described(own)))
    assert caught.value.line == line


def test_a_long_statement_is_refused(machine: Path, own: Path) -> None:
    dialect = load_described(own)
    with pytest.raises(ProgramError, match="has 5004 characters; expected at most 4000") as caught:
        read(b"GO X1 Y2 Z3\nSAY " + b"a" * 5000, setup_of(machine, dialect), dialect)
    assert caught.value.line == 2


def test_inches_are_inches(machine: Path, own: Path) -> None:
    text = b"INCH\nGO X1.00000 Y2.00000 Z1.50000\nCUT X3.00000 Y2.50000 Z1.50000\n"
    setup = setup_of(machine, load_described(own))
    assert ends(text, setup)[1] == pytest.approx(np.array([3.0, 2.5, 1.5]) * 25.4 + OFFSET)
    assert judged(text, olp.correct(text, setup).data, machine, setup, [1, 1]) < 3e-4


TEXTS = st.lists(st.sampled_from([
    "GO X1 Y2 Z3", "CUT X1.5 Y.5 Z-3.", "STEP X1 Y1 Z1", "TOOL 1", "INCH", "PARK", "!", "&", '"',
    " ", "N10 ", "\n", "\r\n",
    "X", "{", "LOOP", "SPEED 1", "\u00f8",
]))  # fmt: skip


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60, deadline=None)
@given(text=st.one_of(st.binary(max_size=100), TEXTS.map(lambda t: "".join(t).encode("latin-1"))),
       which=st.sampled_from(["own", *SHIPPED]))  # fmt: skip
def test_any_bytes_are_read_or_refused(perfect: Path, own: Path, text: bytes, which: str) -> None:
    dialect = load_described(own) if which == "own" else described(which)
    assert dialect is not None
    with contextlib.suppress(OlpError):
        assert read(text, setup_of(perfect, dialect), dialect).data == text
        assert olp.correct(text, setup_of(perfect, dialect)).data == text


LINES = st.sampled_from([
    "GO X1.5 Y-2 Z3", "GO X-1 Y2 Z30.25", "N10 CUT X1.5 Y.5 Z-3. F20", "N2000 CUT X11.5 Y5. Z-33.5 F7",
    "CUT X1 Y2 Z3 A4", "CUT X1 Y2 Z3 A15 ! note", "CUT X1 Y2 Z3 A15 ! note 2.0.1", "CUT X1e1 Y2 Z3",
    "GO X 1 Y2 Z3", "GO X1 Y 2 Z3", "TOOL 2", "TOOL 1", "INCH", "STEP X1 Y1 Z1", "CUT X1 Y2 &", "Z3",
    "FRAME TABLE", "SPEED 5", "  cut x7 y8 z9", "PARK", "",
])  # fmt: skip


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=80, deadline=None)
@given(lines=st.lists(LINES, max_size=14), end=st.sampled_from(["\n", "\r\n", "\r"]))
def test_similar_lines_are_read_as_each_is_alone(
    perfect: Path, own: Path, monkeypatch: pytest.MonkeyPatch, lines: list[str], end: str
) -> None:
    dialect = load_described(own)
    text, setup = end.join(lines).encode(), setup_of(perfect, dialect)
    programs: list[object] = []
    for alone in (False, True):
        with monkeypatch.context() as patch:
            if alone:
                patch.setattr("olp.program.described.reader.same_form_of", lambda *_: None)
            try:
                programs.append(read(text, setup, dialect))
            except ProgramError as error:
                programs.append(str(error))
    fast, slow = programs
    if isinstance(fast, str) or isinstance(slow, str):
        assert fast == slow
    else:
        same(fast, slow)  # type: ignore[arg-type]


@pytest.mark.parametrize(("text", "matches", "fails"), [
    ("MOVE {target}", ["MOVE p1", " move  P.1 ", "MOVE a[1,2]"], ["MOVEp1", "MOVE", "MOVE 1"]),
    ("A({x},{y})", ["A(1,2)", "A ( -1.5 , +.5 )", "a(1.,2e3)"], ["A(1)", "A 1,2", "A(1,,2)"]),
    ("L {x} [, {y}] END", ["L 1 END", "L 1, 2 END"], ["L 1 , END", "L 1 2 END"]),
    ("<MOVE|MOVES> #...", ["MOVE #p", "MOVES # p 1"], ["MOVE p", "MOVET #p"]),
    ("G{number} X{x}", ["G1 X5", "G01 X-.5"], ["G X5", "G1X5 Y"]),
    ("END", ["END", "  end"], ["ENDING", "END 1"]),
    # a number is never parted into two: 100 200 are no three numbers
    ("P {x} [,] {y} [,] {z}", ["P 1 2 3", "P 1,2,3"], ["P 100 200", "P 123", "P 1.2.3 4"]),
    ("X{x}E{number}", ["X1E2", "X1.5E2"], ["X1E2E", "X12"]),
    ("CUT" + " [A]" * 8, ["CUT A A", "CUT" + " A" * 8], ["CUT" + " A" * 9, "CUT A A B"]),
    ("SAY ... X ... Y", ["SAY a X b Y"], ["SAY" + " X" * 900, "SAY" + " " * 3000]),
])  # fmt: skip
def test_forms(text: str, matches: list[str], fails: list[str]) -> None:
    made = form(text, ignore_case=True)
    assert [bool(made.pattern.fullmatch(t)) for t in matches] == [True] * len(matches)
    assert [bool(made.pattern.fullmatch(t)) for t in fails] == [False] * len(fails)


@pytest.mark.parametrize(("change", "words"), [
    (('does = "tool"', 'does = "tol"'), "statements[4].does"),
    (("TOOL {tool}", "TOOL {wrench}"), "a field {wrench}"),
    (("TOOL {tool}", "TOOL"), "expected the field {tool}"),
    (("CUT X{x} Y{y} Z{z} [A{a}]", "CUT X{x} Y{y} Z{z} [A{a}"), "bracket without"),
    (("X{x} Y{y} Z{z} [A{a}]\"\ndoes = \"rapid\"", 'X{x} Y{x} Z{z}"\ndoes = "rapid"'), "a field twice"),
    (('unit = "inch"\n', ""), "expected the key unit"),
    (('form = "GO X{x} Y{y} Z{z} [A{a}]"', 'form = "GO"'), "has neither fields"),
    (('title = "A language of our own"\n', ""), "title is missing"),
    (("SAY ...", "SAY" + " [A]" * 9), "has 9 optional parts; expected at most 8"),
    (("SAY ...", "SAY ... A ... B ..."), "has 3 places for any text; expected at most 2"),
    (("SAY ...", "SAY " + "A" * 500), "has 504 characters; expected at most 500"),
    (('stamp = ["! ", ""]', 'stamp = ["! "]'), "stamp needs two marks"),
])  # fmt: skip
def test_what_is_wrong_with_a_file_is_said(tmp_path: Path, change: tuple[str, str], words: str) -> None:
    assert change[0] in OWN
    path = tmp_path / "d.toml"
    path.write_text(OWN.replace(change[0], change[1], 1))
    with pytest.raises(ConfigError, match=re.escape(words)) as caught:
        load_described(path)
    assert "line " in str(caught.value) or "missing" in words


@pytest.mark.parametrize("kind", ["points", "dialect"])
def test_files_have_a_schema(kind: str) -> None:
    assert json_schema(kind)["properties"]["schema"]["const"] == f"olp-{kind}-1"


# -- the files that come with olp --------------------------------------------------------------------

SMALL = {
    "kawasaki-as": b""".PROGRAM demo()
  SPEED 100 MM/S ALWAYS ; fast
  JMOVE TRANS(10.000, 20.000, 30.000, 0, 180, 0)
  LMOVE TRANS(60.000, 20.000, 30.000, 0, 180, 0)
  LMOVE p1
  LMOVE p2
  LMOVE p1
  BREAK
  DRAW 0.000, 5.000, 10.000
  JMOVE #home
.END
.TRANS
p1 80.000000 90.000000 30.000000 0.000000 180.000000 0.000000
p2 85.000000 95.000000 40.000000 0.000000 180.000000 0.000000
.END
.JOINTS
#home 0 0 0 0 0 0
.END
""",
    "val2": b""".PROGRAM demo
10 SPEED 50.00 ALWAYS
20 SET a = TRANS(10.000, 20.000, 30.000, 0, 180, 0)
30 MOVE a
40 MOVES TRANS(60.000, 25.000, 30.000, 0, 180, 180)
   MOVES b ; back
   BREAK
   DRAW 0.000, 5.000, 0.000
   OPENI
.END
.LOCATIONS
b 80.0000 90.0000 30.0000 0.0000 180.0000 0.0000
.END
""",
    "karel": b"""PROGRAM demo
VAR
p1 : POSITION
p2 : POSITION
BEGIN
$SPEED = 100
p1 = POS(10.000, 20.000, 30.000, 0, 180, 0, config)
p2 = POS(60.000, 25.000, 30.000, 0, 180, 0, config)
MOVE TO p1 -- first
MOVE TO p2
END demo
""",
}


@pytest.mark.parametrize("name", SHIPPED)
def test_files_that_come_with_olp_load_and_say_what_they_know(name: str) -> None:
    dialect = described(name)
    assert dialect is not None
    assert dialect.name == name
    assert len(getattr(dialect, "about", "")) > 100
    kinds = {row.support for row in dialect.rows()}
    assert {Support.UNCHANGED, Support.REFUSED} <= kinds
    assert all(row.why for row in dialect.rows() if row.support is Support.REFUSED)


@pytest.mark.parametrize("name", sorted(SMALL))
def test_small_programs_in_them_are_corrected(machine: Path, perfect: Path, name: str) -> None:
    text = SMALL[name]
    setup = setup_of(machine, described(name))
    assert olp.correct(text, setup_of(perfect, described(name))).data == text
    result = olp.correct(text, setup)
    count = len(ends(text, setup))
    assert judged(text, result.data, machine, setup, [1] * count) < 3e-4
    number = re.compile(rb"-?\d+\.\d+")
    rest = result.data.partition(b"\n")[2]
    assert number.sub(b"#", rest) == number.sub(b"#", text)
    with pytest.raises(OlpError, match="olp-corrected"):
        olp.correct(result.data, setup)


@pytest.mark.parametrize(("name", "text", "line", "words"), [
    ("kawasaki-as", b".PROGRAM a()\nLMOVE p9\n.END\n", 2, "p9 is not defined in this text"),
    ("kawasaki-as", b".PROGRAM a()\nFOR i = 1 TO 3\n.END\n", 2, "loop"),
    ("kawasaki-as", b".PROGRAM a()\nLAPPRO p1, 50\n.END\n", 2, "tool axis"),
    ("kawasaki-as", b".PROGRAM a()\nXMOVE p1\n.END\n", 2, "is not a statement"),
    ("kawasaki-as", b".PROGRAM a()\nPOINT p = SHIFT(q BY 1,2,3)\nLMOVE p\n.END\n", 2, "computed"),
    ("kawasaki-as", b".PROGRAM a()\nLMOVE TRANS(1,2,3)\n.PROGRAM b()\nLMOVE TRANS(1,2,4)\n", 4, "two parts"),
    (
        "kawasaki-as", b".TRANS\np 1 2 3\np 1 2 4\n.END\n.PROGRAM a()\nLMOVE p\n.END\n", 6,
        "is defined twice, in lines 2 and 3",
    ),
    ("val2", b"MOVES part\n", 1, "part is not defined in this text"),
    ("val2", b"APPROS part, 50\n", 1, "tool axis"),
    ("karel", b"MOVE NEAR p1 BY 100\n", 1, "computed"),
])  # fmt: skip
def test_what_they_do_not_know_is_refused(
    machine: Path, name: str, text: bytes, line: int, words: str
) -> None:
    with pytest.raises(ProgramError, match=re.escape(words)) as caught:
        olp.correct(text, setup_of(machine, described(name)))
    assert caught.value.line == line


def test_one_position_of_two_moves_that_want_different_numbers_is_refused(machine: Path) -> None:
    text = b".TRANS\np 10.0000 20.0000 30.0000\n.END\n.PROGRAM a()\nLMOVE p\nTOOL 2\nLMOVE p\n.END\n"
    with pytest.raises(ProgramError, match="serves line 5 too") as caught:
        olp.correct(text, setup_of(machine, described("kawasaki-as")))
    assert caught.value.line == 7


@pytest.mark.slow
def test_the_command_line(machine: Path, own: Path, tmp_path: Path) -> None:
    source, target = tmp_path / "a.prg", tmp_path / "b.prg"
    source.write_bytes(PROGRAM)
    run = CliRunner()
    words = ["-m", str(machine), "--dialect", str(own)]
    assert run.invoke(main, ["correct", str(source), *words, "-o", str(target)]).exit_code == 0
    for verb, more in (
        ("verify", [str(target)]), ("inspect", []), ("simulate", ["-o", "-"]), ("check", []), ("retime", []),
        ("view", ["-o", str(tmp_path / "v.html")]),
    ):  # fmt: skip
        done = run.invoke(main, [verb, str(source), *more, *words])
        assert done.exit_code == 0, (verb, done.output)
    matrix = run.invoke(main, ["inspect", str(source), *words]).stdout
    assert "CUT X{x} Y{y} Z{z}" in matrix
    assert "any other statement" in matrix
    job = tmp_path / "job.toml"
    job.write_text(f'schema = "olp-job-1"\nprogram = "a.prg"\nmachine = "{machine}"\ndialect = "{own}"\n')
    assert run.invoke(main, ["correct", "-j", str(job), "-o", "-", "-q"]).stdout_bytes == target.read_bytes()
    other = tmp_path / "m2.toml"
    other.write_text(machine.read_text().replace('"linuxcnc"', '"kawasaki-as"').replace(
        'calibration = "', f'calibration = "{machine.parent}/'
    ))  # fmt: skip
    demo = tmp_path / "demo.as"
    demo.write_bytes(SMALL["kawasaki-as"])
    done = run.invoke(main, ["correct", str(demo), "-m", str(other), "-o", str(tmp_path / "x.as")])
    assert done.exit_code == 0, done.output


@pytest.mark.parametrize(("blanks", "z"), [(b"  ", b"30.0"), (b"", b"3e1")])
def test_a_number_larger_than_a_machine_is_refused_with_its_line(
    machine: Path, blanks: bytes, z: bytes
) -> None:
    """It is met where numbers keep their columns, as behind two blanks, and where one has an exponent."""
    block = b"MOVES TRANS(" + blanks + b"%s,20.0,%s,0,180,0)\n"
    text = block % (b"60.0", b"30.0") + block % (b"100000000.0", b"30.0") + block % (b"60.0", z)
    with pytest.raises(ProgramError) as caught:
        olp.correct(text, setup_of(machine, described("val2")), outside_box="hold")
    assert (caught.value.line, caught.value.code) == (2, "OLP561")
    assert caught.value.message == "the number 100000000.0 is larger than a machine; correct it"
