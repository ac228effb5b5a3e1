"""Lists of positions as programs: what is detected of their form, and that only numbers change."""

from __future__ import annotations

import contextlib
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from judge.machines import Recipe, random_machine, zero_machine
from judge.model import JudgeModel

import olp
from olp.cli import main
from olp.core.errors import AlreadyCorrected, InputError, OlpError, ProgramError, UsageError
from olp.files.config import load_setup
from olp.files.described import load_described
from olp.files.point_profile import PointProfile
from olp.program.pointlist.dialect import DIALECT, with_layout
from olp.program.program import Program
from olp.program.registry import read
from olp.program.text.delimited import detected_layout

FRAMES = {
    "G54": {"X_mm": 210.0, "Y_mm": 180.0, "Z_mm": -260.0, "set_by": "true"},
    "G55": {"X_mm": 210.0, "Y_mm": 180.0, "Z_mm": -260.0, "C_deg": 30.0, "A_deg": -4.0, "set_by": "true"},
}
OFFSET = np.array([210.0, 180.0, -260.0])
_NUMBER = re.compile(rb"[-+]?\d*[.,]?\d+")


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return random_machine(tmp_path_factory.mktemp("list") / "m", 4, Recipe(work_offsets=FRAMES))


@pytest.fixture(scope="module")
def perfect(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return zero_machine(tmp_path_factory.mktemp("list") / "zero", Recipe(work_offsets=FRAMES))


def layout(**keys: object):  # type: ignore[no-untyped-def]
    return with_layout(PointProfile(**keys).layout)  # type: ignore[arg-type]


def setup_of(machine: Path, dialect: object = None):  # type: ignore[no-untyped-def]
    from dataclasses import replace

    setup = load_setup(machine)
    return replace(setup, job=replace(setup.job, dialect="list", described=dialect))


def positions(text: bytes, machine: Path, dialect: object = None) -> np.ndarray:
    setup = setup_of(machine, dialect)
    return read(text, setup, dialect or DIALECT).toolpath.end_mm  # type: ignore[arg-type]


TABLES = [
    b"X_mm,Y_mm,Z_mm,speed\n1.000,2.000,3.000,100\n80.500,60.250,40.125,200\n",
    b"X_mm;Y_mm;Z_mm;name\r\n1,000;2,000;3,000;A\r\n80,500;60,250;40,125;B\r\n",
    b"# frame=G54\n  name      X_mm      Y_mm      Z_mm\n    A1    9.9999   99.9999   12.3456\n"
    b"   A22  100.0000    0.0010  -99.9999\n",
    b'"name","X (mm)","Y (mm)","Z (mm)"\n"P,1","1.0","2.0","3.0"\n"P2","80.0","+60.0","40.0"\n',
    b"Z_inch\tX_inch\tY_inch\n0.5000\t1.0000\t-1.0000\n1.2500\t3.0000\t2.0000\n",
    b"\xef\xbb\xbfX_m,Y_m,Z_m\n.0001,.02,.03\n.08,.06,.04",
    b"// made by hand\nX_mm Y_mm Z_mm\n1e1 2.00E+1 3\n80 60 40\n",
]


@pytest.mark.parametrize("text", TABLES)
def test_a_corrected_list_brings_the_tip_to_its_places(machine: Path, text: bytes) -> None:
    result = olp.correct(text, setup_of(machine))
    model = JudgeModel(machine)
    nominal, corrected = positions(text, machine), positions(result.data, machine)
    tool_vector = model.tool_vector_mm(1)
    actual = corrected + model.error_mm(corrected, tool_vector)
    assert np.abs(model.error_mm(nominal, tool_vector)).max() > 0.004
    # half of the coarsest digit that these files are written with: 0.0001 inch
    assert np.abs(actual - nominal).max() < 0.0014
    assert result.report["deviation"]["holds"]


@pytest.mark.parametrize("text", TABLES)
def test_only_numbers_and_one_comment_differ(machine: Path, text: bytes) -> None:
    data = olp.correct(text, setup_of(machine)).data
    lines = data.splitlines(keepends=True)
    stamp = next(i for i, line in enumerate(lines) if b"olp-corrected" in line)
    assert stamp == 0
    head = b"\xef\xbb\xbf" if text[:3] == b"\xef\xbb\xbf" else b""
    rest = head + b"".join(lines[1:])
    blank = re.compile(rb"[-+]?(\d+[.,]?\d*|[.,]\d+)([eE][-+]?\d+)?")
    squeeze = re.compile(rb" +")
    assert squeeze.sub(b" ", blank.sub(b"#", rest)) == squeeze.sub(b" ", blank.sub(b"#", text))
    assert rest.count(b"\r\n") == text.count(b"\r\n")


@pytest.mark.parametrize("text", TABLES)
def test_without_error_nothing_is_touched(perfect: Path, text: bytes) -> None:
    assert olp.correct(text, setup_of(perfect)).data == text


def test_columns_keep_their_edges(machine: Path) -> None:
    before = TABLES[2].splitlines()
    after = olp.correct(TABLES[2], setup_of(machine)).data.splitlines()[1:]
    assert [len(line) for line in after] == [len(line) for line in before]


def test_signs_zeros_and_quotes_stay(machine: Path) -> None:
    data = olp.correct(TABLES[3], setup_of(machine)).data
    assert re.search(rb'"P2","\d\d\.\d+","\+\d\d\.\d+"', data)
    data = olp.correct(TABLES[5], setup_of(machine)).data
    assert re.search(rb"\n-?\.\d+,\.\d+,\.\d+", data)


def test_a_turned_frame_is_turned(machine: Path) -> None:
    text = b"# frame=G55\nX_mm,Y_mm,Z_mm\n1.0000,2.0000,3.0000\n80.5000,60.2500,40.1250\n"
    result = olp.correct(text, setup_of(machine))
    model = JudgeModel(machine)
    nominal, corrected = positions(text, machine), positions(result.data, machine)
    actual = corrected + model.error_mm(corrected, model.tool_vector_mm(1))
    assert np.abs(actual - nominal).max() < 2e-4
    a, c = np.radians(-4.0), np.radians(30.0)
    turn = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]]) @ np.array(
        [[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]]
    )
    assert nominal[1] == pytest.approx(turn @ [80.5, 60.25, 40.125] + OFFSET)


def test_tools_of_rows_give_their_levers(machine: Path) -> None:
    text = b"X_mm,Y_mm,Z_mm,tool\n50.0000,60.0000,70.0000,1\n50.0000,60.0000,70.0000,2\n"
    rows = olp.correct(text, setup_of(machine)).data.splitlines()[2:]
    assert rows[0].rsplit(b",", 1)[0] != rows[1].rsplit(b",", 1)[0]


LONG = b"X_mm,Y_mm,Z_mm\n-200.0000,-150.0000,100.0000\n500.0000,400.0000,100.0000\n"


def test_places_are_no_path_unless_the_profile_says_so(machine: Path) -> None:
    plain = olp.correct(LONG, setup_of(machine), tolerance_um=0.5)
    assert plain.data.count(b"\n") == LONG.count(b"\n") + 1
    assert "OLP333" in {f.code for f in plain.findings}
    lines = olp.correct(LONG, setup_of(machine, layout(joined="lines")), tolerance_um=0.5)
    assert lines.data.count(b"\n") == plain.data.count(b"\n")
    assert "OLP101" in {f.code for f in lines.findings}
    split = olp.correct(LONG, setup_of(machine, layout(joined="lines", insert=True)), tolerance_um=0.5)
    assert split.report["deviation"]["holds"]
    rows = np.array([[float(v) for v in r.split(b",")] for r in split.data.splitlines()[2:]])
    assert len(rows) > 3
    assert (np.diff(rows[:, 0]) > 0).all()
    with pytest.raises(UsageError, match="split-rapids"):
        olp.correct(LONG, setup_of(machine), split_rapids=True)


def test_no_row_takes_up_backlash_where_none_may_be_inserted(tmp_path: Path) -> None:
    recipe = Recipe(work_offsets=FRAMES, backlash_um={"X": 8.0, "Y": 5.0, "Z": 6.0})
    machine = random_machine(tmp_path / "m", 4, recipe)
    places = [(0, 0, 0), (50, 0, 0), (20, 10, 0), (60, -10, 5), (10, 20, 5), (11, 20, 5), (10.5, 20, 6)]
    rows = "".join(f"{x:.3f},{y:.3f},{z:.3f}\n" for x, y, z in places)
    text = ("X_mm,Y_mm,Z_mm\n" + rows).encode()
    for dialect in (None, layout(joined="lines")):
        result = olp.correct(text, setup_of(machine, dialect))
        assert result.data.count(b"\n") == text.count(b"\n") + 1
    more = olp.correct(text, setup_of(machine, layout(joined="lines", insert=True)))
    assert more.data.count(b"\n") > text.count(b"\n") + 1
    # nothing can be put before the first row, so at the start of its first line a side is unknown
    first, *later = np.split(more.table.corrected, [2])
    assert first.min() > more.table.allowed_mm >= later[0].max()
    assert "OLP103" in {f.code for f in more.findings}


def test_no_row_is_inserted_where_rows_have_a_time(machine: Path) -> None:
    text = LONG.replace(b"Z_mm\n", b"Z_mm,t_s\n").replace(b"100.0000\n", b"100.0000,0.5\n")
    dialect = layout(joined="lines", insert=True, columns={"t": "t_s"})
    assert olp.correct(text, setup_of(machine, dialect)).data.count(b"\n") == text.count(b"\n") + 1


def test_a_list_without_comments_is_not_marked(machine: Path) -> None:
    result = olp.correct(TABLES[0], setup_of(machine, layout(stamp=False)))
    assert b"olp" not in result.data
    assert "OLP626" in {f.code for f in result.findings}


def test_what_is_detected_is_stated(machine: Path) -> None:
    findings = olp.correct(TABLES[1], setup_of(machine)).findings
    messages = " ".join(f.message for f in findings if f.code == "OLP331")
    assert "separated by semicolon" in messages
    assert "decimal mark is a comma" in messages
    assert "in mm" in messages
    assert "stated in G54" in messages
    turning = b"X_mm,Y_mm,Z_mm,A,B,C\n1,2,3,0,0,0\n1,2,4,0,0,90\n"
    assert "OLP332" in {f.code for f in olp.correct(turning, setup_of(machine)).findings}


@pytest.mark.parametrize(("text", "error", "words"), [
    (b"1,2,3\n4,5,6\n", ProgramError, "states no unit"),
    (b"1,2,3,4,5\n", ProgramError, "does not show which columns"),
    (b"", ProgramError, "has no positions"),
    (b"X_mm,Y_mm,Z_mm\n1,2\n", ProgramError, ":2: 2 columns"),
    (b"X_mm,Y_mm,Z_mm\n1,2,3\n1,2,z\n", ProgramError, ':3: column 3 is "z"'),
    (b"# frame=G57\nX_mm,Y_mm,Z_mm\n1,2,3\n", ProgramError, "G57"),
    (b"X_mm,Y_mm,Z_mm,tool\n1,2,3,9\n", ProgramError, ":2: tool 9"),
    (b"X_mm,Y_mm,Z_mm,tool\n1,2,3,T1\n", ProgramError, ':2: "T1" is not a tool number'),
    (
        b"# olp-corrected 0123456789ab\nX_mm,Y_mm,Z_mm\n1,2,3\n", AlreadyCorrected,
        "would apply the model twice",
    ),
])  # fmt: skip
def test_what_is_not_said_is_refused(
    machine: Path, tmp_path: Path, text: bytes, error: type[OlpError], words: str
) -> None:
    path = tmp_path / "p.csv"
    path.write_bytes(text)
    with pytest.raises(error, match=re.escape(words)):
        olp.correct(path, machine)


CELLS = st.one_of(
    st.sampled_from(["1", "-2.5", "3,5", "", '"', "x", "#", "1e5", "X_mm", "Y_mm", "Z_mm", " "])
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(data=st.one_of(
    st.binary(max_size=120),
    st.lists(st.lists(CELLS, max_size=5).map(",".join), max_size=6).map(lambda r: "\n".join(r).encode()),
))  # fmt: skip
def test_any_bytes_are_read_or_refused(perfect: Path, data: bytes) -> None:
    try:
        program = read(data, setup_of(perfect), DIALECT)
    except ProgramError:
        return
    assert program.data == data
    with contextlib.suppress(InputError):
        assert olp.correct(data, setup_of(perfect)).data == data


VALUES = st.tuples(*[st.integers(-90_000, 150_000)] * 3)


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=25, deadline=None)
@given(rows=st.lists(VALUES, min_size=1, max_size=6), places=st.integers(3, 6), mark=st.sampled_from(",;\t "),
       width=st.sampled_from([0, 14]))  # fmt: skip
def test_a_list_read_back_says_what_was_meant(
    machine: Path, rows: list[tuple[int, int, int]], places: int, mark: str, width: int
) -> None:
    body = [mark.join(f"{v / 1000:{width or ''}.{places}f}" for v in row) for row in rows]
    text = "\n".join([mark.join(["X_mm", "Y_mm", "Z_mm"]), *body, ""]).encode()
    result = olp.correct(text, setup_of(machine))
    model = JudgeModel(machine)
    wanted = model.command_for(np.array(rows) / 1000 + OFFSET, model.tool_vector_mm(1))
    assert np.abs(positions(result.data, machine) - wanted).max() <= 0.5 * 10.0**-places * 1.001 + 2e-6


ODD = st.sampled_from(["1", "-2.5", "3.", ".25", "+4", "5e1", "0012.50", " 7 "])


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40, deadline=None)
@given(
    rows=st.lists(st.lists(ODD, min_size=5, max_size=5), min_size=1, max_size=6),
    mark=st.sampled_from(",;\t "), end=st.sampled_from(["\n", "\r\n"]), comma=st.booleans(),
    noise=st.sampled_from(["", "# x", "\n", "   "]),
)  # fmt: skip
def test_rows_read_in_columns_say_what_rows_read_alone_say(
    perfect: Path, monkeypatch: pytest.MonkeyPatch, rows: list[list[str]], mark: str, end: str, comma: bool,
    noise: str,
) -> None:  # fmt: skip
    if comma:
        mark = ";" if mark == "," else mark
        rows = [[cell.replace(".", ",") for cell in row] for row in rows]
    head = mark.join(["X_mm", "speed (mm/s)" if mark != " " else "speed_mm/s", "Z_mm", "Y_mm", "tool"])
    body = [mark.join([*row[:4], "1"]) for row in rows]
    text = end.join([head, *body[:1], noise, *body[1:], ""]).encode()
    dialect = layout(
        delimiter={",": "comma", ";": "semicolon", "\t": "tab", " ": "space"}[mark],
        decimal="comma" if comma else "point", speed_unit="mm/s",
        columns={"X": "X_mm", "Y": "Y_mm", "Z": "Z_mm", "tool": "tool", "speed": head.split(mark)[1]},
    )  # fmt: skip
    setup = setup_of(perfect, dialect)
    fast = read(text, setup, dialect)
    with monkeypatch.context() as patch:
        patch.setattr("olp.program.pointlist.reader.columns", lambda *_: None)
        slow = read(text, setup, dialect)
    same(fast, slow)


def same(one: Program, other: Program) -> None:
    """Two readings say the same."""
    assert one.toolpath.end_mm == pytest.approx(other.toolpath.end_mm, nan_ok=True)
    for name in ("kind", "flag", "line", "frame"):
        assert getattr(one.toolpath, name).tolist() == getattr(other.toolpath, name).tolist(), name
    assert one.toolpath.frames == other.toolpath.frames
    assert one.slot.tolist() == other.slot.tolist()
    for name in ("mantissa", "decimals", "number", "end"):
        assert getattr(one.words, name)[:].tolist() == getattr(other.words, name)[:].tolist(), name
    for name in ("begin", "end"):
        assert getattr(one.statements, name).tolist() == getattr(other.statements, name).tolist(), name
    assert one.statements is not None
    assert other.statements is not None
    assert one.statements.feed_mm_s == pytest.approx(other.statements.feed_mm_s, nan_ok=True)
    assert one.remarks == other.remarks


def test_the_command_line(machine: Path, tmp_path: Path) -> None:
    source = tmp_path / "tags.txt"
    source.write_text("1.5 2.5 3.5\n100 80 60\n")
    run = CliRunner()
    words = ["-m", str(machine), "-o", str(tmp_path / "out.txt"), "--force"]
    refused = run.invoke(main, ["correct", str(source), *words, "--dialect", "list"])
    assert refused.exit_code == 3
    assert "states no unit" in refused.stderr
    assert run.invoke(main, ["correct", str(source), *words, "--unit", "mm"]).exit_code == 0
    profile = tmp_path / "tags.toml"
    profile.write_text(
        'schema = "olp-points-1"\ndelimiter = "space"\nheader = false\n[columns]\nX = 1\nY = 2\nZ = 3\n'
    )
    by_profile = run.invoke(main, ["correct", str(source), *words, "--profile", str(profile)])
    assert by_profile.exit_code == 0, by_profile.output
    corrected = (tmp_path / "out.txt").read_bytes()
    dialect = ["--dialect", str(profile), "-m", str(machine)]
    for verb, more in (
        ("verify", [str(tmp_path / "out.txt")]), ("inspect", []), ("simulate", ["-o", "-"]), ("check", []),
        ("retime", []), ("view", ["-o", str(tmp_path / "v.html")]),
    ):  # fmt: skip
        done = run.invoke(main, [verb, str(source), *more, *dialect])
        assert done.exit_code == 0, (verb, done.output)
    job = tmp_path / "job.toml"
    job.write_text(
        f'schema = "olp-job-1"\nprogram = "tags.txt"\nmachine = "{machine}"\ndialect = "tags.toml"\n'
    )
    assert run.invoke(main, ["correct", "-j", str(job), "-o", "-", "-q"]).stdout_bytes == corrected


@pytest.mark.corpus
def test_lists_of_another_package_stay_unchanged(tmp_path: Path, corpus: Path) -> None:
    """RoboDK's examples: no header, no unit, fifteen decimals, and empty cells."""
    wide = Recipe(
        work_offsets={"G54": {"X_mm": 1000.0, "Y_mm": 500.0, "Z_mm": 0.0, "set_by": "true"}},
        travel=((-500.0, 2500.0), (-900.0, 1900.0), (-900.0, 900.0)),
    )  # fmt: skip
    machine = random_machine(tmp_path / "m", 3, wide)
    model = JudgeModel(machine)
    lists = sorted((corpus / "robodk_csv").iterdir())
    assert lists
    for name in lists:
        data = name.read_bytes()
        with pytest.raises(OlpError, match=r"unit|columns"):
            olp.correct(data, setup_of(machine))
        dialect = layout(header=False, columns={"X": 1, "Y": 2, "Z": 3})
        result = olp.correct(data, setup_of(machine, dialect))
        nominal, corrected = (positions(t, machine, dialect) for t in (data, result.data))
        actual = corrected + model.error_mm(corrected, model.tool_vector_mm(1))
        assert np.abs(actual - nominal).max() < 0.0006
        tail = re.compile(rb"^[^,]*,[^,]*,[^,]*")
        after = [tail.sub(b"", line) for line in result.data.splitlines()[1:]]
        assert after == [tail.sub(b"", line) for line in data.splitlines()]


def test_a_profile_is_a_dialect(tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    path.write_text(PointProfile(joined="lines", unit="inch").to_toml())
    dialect = load_described(path)
    assert dialect.layout.unit == "inch"  # type: ignore[attr-defined]
    assert detected_layout(["X,Y,Z"]).unit is None  # type: ignore[union-attr]
