"""Modal state of LinuxCNC that changes in the middle of things: by hand, and by its own interpreter."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import judged, machine
from judge import linuxcnc

import olp
from olp.core.errors import ProgramError
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, Options, read

TABLES = "".join(
    f'[work_offsets.{name}]\nX_mm = {x}.0\nY_mm = {y}.0\nZ_mm = {z}.0\nset_by = "true"\n'
    for name, x, y, z in (("G54", 250, 200, -300), ("G55", 420, 310, -280), ("G56", 300, 210, -250))
) + "".join(
    f"[tools.{n}]\nZ_mm = {z}\ngauge_to_tip_mm = [0.0, 0.0, -{z}]\n" for n, z in ((1, 120.0), (2, 85.5))
)
HEAD = "G21 G90 G54 G17 G64 P0.01 Q0\nG0 X1 Y2 Z3\nF100 S100 M3\n"
#: A series begun at 3 in G54: what comes between, the next block, and the axis positions of Z in it.
SERIES: dict[str, tuple[str, str, list[float]]] = {
    "another frame": ("G55", "X2", [-278, -285, -277]),
    "inches": ("G20", "X2 Y1", [-249.2, -427.0, -223.8]),
    "a tool length": ("G43 H2", "X2", [-212.5, -219.5, -211.5]),
    "G92": ("G92 Z7", "X2", [-303, -310, -302]),
    "G52": ("G52 Z4", "X2", [-294, -301, -293]),
    "G10": ("G10 L2 P1 Z-310", "X2", [-308, -315, -307]),
    "other modes": ("G4 P1\nG61\nM5\nT2\nG18\nG17\nG91\nG90\nG40", "X2", [-298, -305, -297]),
    "a rapid word ends it": ("G0", "G81 R2 Z-5 X2", [-305, -298]),
    "G80 ends it": ("G80", "G81 R2 Z-5 X2", [-305, -298]),
    "another cycle goes on": ("G82 R2.5 Z-5 P0 X3", "G81 R2 Z-5 X2", [-298, -305, -297]),
    "depths count from the number": ("G55 G91", "X2", [-275, -280, -275]),
}
#: Blocks, and the axis position that the last of them reaches.
PLACES: dict[str, tuple[str, tuple[float, float, float]]] = {
    "words beside G92.1 are motion": ("G92.1 X20 Y5 Z9", (270, 205, -291)),
    "words beside G92.2 are motion": ("G92 X0\nG92.2 X20", (270, 202, -297)),
    "words beside G92.3 are motion": ("G92 X0\nG92.2\nG92.3 X20", (271, 202, -297)),
    "G52 is stored for G92.3": ("G52 X5 Z4\nG92.3\nG0 X1 Y1 Z3", (256, 201, -293)),
    "G92.2 twice keeps what is stored": ("G92 X5 Z7\nG92.2\nG92.2\nG92.3\nG0 X1 Y1 Z3", (247, 201, -301)),
    "G92.1 forgets it": ("G92 X5\nG92.1\nG92.3\nG0 X1", (251, 202, -297)),
    "H0 is the tool in the spindle": ("G43 H0\nG0 Z1", (251, 202, -179)),
    "H0 after another length": ("T2 M6\nG43 H1\nG43 H0\nG0 X1 Y2 Z1", (251, 202, -213.5)),
    "G43.2 H0 adds it": ("T2 M6\nG43 H1\nG43.2 H0\nG0 X1 Y2 Z1", (251, 202, -93.5)),
    "pecks are counted in numbers": ("G99 G73 Z3.57 R6.57 Q3", (251, 202, -293.43)),
    "P of an arc": ("G3 X1 Y2 I5 J0 P2", (251, 202, -297)),
    "a centre alone in the mode": ("G2 X1 Y2 I5\nI2", (251, 202, -297)),
    "G80 beside a motion": ("G80 G0 X5", (255, 202, -297)),
    "words beside G4": ("G4 P1 X5", (255, 202, -297)),
    "words beside G43": ("G43 H1 G1 Z5", (251, 202, -175)),
}
#: Lines that the control refuses or sees in another way than an editor, and what is said of them.
REFUSED = {
    "G1 Z1 ; old\rZ-40": "carriage return is inside this line, at column 12",
    "G0 X9\0 Y3": "byte 0x00 is inside this line, at column 6",
    "G0 X9 Y7 \x1a": "byte 0x1a is inside this line, at column 10",
    "G0 X9\x0c Y1": "byte 0x0c is inside this line, at column 6",
    "%\nG0 X9": "in the middle of the program",
    "% G0 X9": "in the middle of the program",
    "G0 X9 N5": "N is not the first word",
    "(x)N5 G0 X9": "N is not the first word",
    "F20 F10": "the word F is twice",
    "G20 G21": "G20 and G21 of one modal group",
    "G43 G49 H1": "G43 and G49 of one modal group",
    "M3 M4": "M3 and M4 of one modal group",
    "M7 M8": "M7 and M8 of one modal group",
    "G4 P1 G28": "G4 and G28 of one modal group",
    "G0 X5 P1": "uses its word P",
    "L3": "uses its word L",
    "R5": "uses its word R",
    "G1 X9 I5": "uses its word I",
    "G2 X5 Y2 I2 J0 K1": "uses its word K",
    "H1": "uses its word H",
    "D1": "uses its word D",
    "G81 X5 R2 Z-3 P1": "uses its word P",
    "G81 X5 R2 Z-3 Q1": "uses its word Q",
    "G92": "G92 needs one of X, Y, Z",
    "G4": "G4 needs P",
    "G2": "G2 needs one of I, J, K, R",
    "G81": "G81 needs one of X, Y, Z",
    "G43.2": "G43.2 needs one of H, X, Y, Z",
    "G92 X5 G1": "two G codes of this block use its axis words",
    "G28 G1 X5": "two G codes of this block use its axis words",
    "G93 G81 X5 R2 Z-3 F1": "is in inverse time",
    "G43.1 Z5 G1": "two G codes of this block use its axis words",
    "G10 L20 P1 X5 R0": "leave R out",
    "M4 G74 X5 R2 Z-3 L2": "uses its word L",
    "G96": "G96 needs S",
    "G43.2 H1 X5": "G43.2 takes H, or words of axes",
    "F-5": "the word F is negative",
    "S-5": "the word S is negative",
    "N-5 G0 X1": "the word N is negative",
    "G4 P-1": "a dwell is negative",
    "M19 G74 X5 R2 Z-3": "give M4 before it",
    "T2 M6 G84 X5 R2 Z-3": "give M3 before it",
    "T2 M6 G43 H0": "a tool length beside M6",
    "T0 M6 G43": "a tool length beside M6",
    "G81 X5 R2 Z-3 U1": "moves U too",
    "M5 G84 X5 R2 Z-3": "give M3 before it",
    "G74 X5 R2 Z-3": "give M4 before it",
    "M5 G86 X5 R2 Z-3 P0": "give M3 or M4 before it",
    "(a (b) c)\nG0 X9": "the first `)` ends both",
    "(a (b c)\nG0 X9": "has a `(` in it",
    "M62": "M62 needs P",
    "M66": "M66 needs one of P, E",
    "M67 Q1": "M67 needs E",
    "M68": "M68 needs E",
    "G53": "G53 needs one of X, Y, Z",
    "G0 O5": "O is a program number",
    "O5 X1": "O is a program number",
    "O0.5": "the word O has a fraction",
    "G81 X5 R2 Z-3 L1.5": "the word L has a fraction",
    "G10 L2.5 P1 X1": "the word L has a fraction",
    "G3 R5": "uses its word R",
    "G18 G3 R5 Y1": "uses its word R",
    "G38.4 X1": "ends where it starts",
    "G38.2 C5": "uses its word C",
    "(msg, a)O1": "O is a program number",
    "G2 Y3 I1 R2": "uses its word I",
    "(a\nG0 X9": "`(a` is not closed",
    "G0 X9 (" + "a" * 250 + ")": "takes 252 at most",
}


#: Those that the control refuses as well; it reads the others in another way.
UNSAFE = [t for t in REFUSED if not set("\r\0") & set(t) and not {"H0", "G43.1", "T0"} & set(t.split())]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    where = tmp_path_factory.mktemp("interleaved")
    tables = TABLES + "[job_defaults]\ntool = 1\n"
    return machine(where, tables=tables)


def reached(text: str, place: Path) -> np.ndarray:
    """(n, 3) axis positions as they are read."""
    data = text.encode("latin-1")
    setup = load_setup(place)
    return read(data, setup, DIALECTS["linuxcnc"]).toolpath.end_mm


def series(name: str) -> str:
    between, last, _ = SERIES[name]
    return f"{HEAD}G99 G81 X1 Y1 Z-5 R2\n{between}\nG98 {last}\nM2\n"


@pytest.mark.parametrize("name", SERIES)
def test_a_series_keeps_its_numbers(name: str, place: Path) -> None:
    levels = SERIES[name][2]
    np.testing.assert_allclose(reached(series(name), place)[-len(levels) :, 2], levels, atol=1e-9)


@pytest.mark.parametrize("name", PLACES)
def test_a_block_leads_where_the_control_goes(name: str, place: Path) -> None:
    text, want = PLACES[name]
    np.testing.assert_allclose(reached(f"{HEAD}{text}\nM2\n", place)[-1], want, atol=1e-9)


@pytest.mark.parametrize("modes", ["", "G20\n", "G55\n", "G43 H2\n", "G91\n", "G92 Y1\n"])
@pytest.mark.parametrize("stores", ["G92 X5 Z1", "G10 L20 P1 X5 Y3"])
def test_what_is_stored_is_where_the_moves_before_it_lead(modes: str, stores: str, place: Path) -> None:
    """Whether one block states that place alone, or several do."""
    ends = [
        reached(f"{HEAD}{modes}G1 X4 Y5 Z6\n{moves}{stores}\nG90 G0 X1 Y2 Z3\nM2\n", place)[-1]
        for moves in ("", "X4 Y5 Z6\n" * ("G91" not in modes), "G4 P1\nG64 P0.1\n", "M1\nT1\n")
    ]
    np.testing.assert_allclose(ends, [ends[0]] * 4, atol=1e-9)
    apart = f"{HEAD}{modes}G1 X4\nY5\nZ6\n{stores}\nG90 G0 X1 Y2 Z3\nM2\n"
    np.testing.assert_allclose(reached(apart, place)[-1], ends[0], atol=1e-9)


def test_no_place_is_stored_behind_a_change_that_moves_the_axes(place: Path) -> None:
    with pytest.raises(ProgramError, match="has not been commanded yet"):
        reached(f"{HEAD}G0 X1 Y2 Z3\nT2 M6\nG92 X5\nM2\n", place)


@pytest.mark.parametrize("text", REFUSED)
def test_what_the_control_sees_in_another_way_is_refused(text: str, place: Path) -> None:
    with pytest.raises(ProgramError, match=re.escape(REFUSED[text])) as caught:
        reached(f"{HEAD}{text}\nM2\n", place)
    assert caught.value.line == 4
    # behind the end nothing is read
    reached(f"{HEAD}M2\n{text}\n", place)


def test_a_series_uses_no_words_of_a_block_that_states_a_zero(place: Path) -> None:
    with pytest.raises(ProgramError, match="uses its word R") as caught:
        reached(f"{HEAD}G81 X5 R2 Z-3\nG52 X1 R1\nM2\n", place)
    assert caught.value.line == 5


@pytest.mark.parametrize("line", ["/(a", "/X1 (" + "a" * 250 + ")"])
def test_the_control_reads_the_bytes_of_a_deleted_block(line: str, place: Path) -> None:
    with pytest.raises(ProgramError) as caught:
        deleted(line, place)
    assert caught.value.line == 4


def test_the_words_of_a_deleted_block_may_be_any(place: Path) -> None:
    deleted("/X[1+1] G2 U O5 X2", place)


def deleted(line: str, place: Path) -> None:
    """Read a line with block delete on."""
    data = f"{HEAD}{line}\nM2\n".encode()
    read(data, load_setup(place), DIALECTS["linuxcnc"], Options(block_delete=True))


@pytest.mark.oracle
@pytest.mark.parametrize("text", UNSAFE)
def test_linuxcnc_refuses_it(text: str, place: Path) -> None:
    with pytest.raises(linuxcnc.InterpreterError):
        linuxcnc.interpret(f"{HEAD}{text}\nM2\n".encode("latin-1"), place.parent)


@pytest.mark.oracle
@pytest.mark.parametrize("line", ["/(a", "/X1 (" + "a" * 250 + ")"])
def test_linuxcnc_reads_the_bytes_of_a_deleted_block(line: str, place: Path) -> None:
    with pytest.raises(linuxcnc.InterpreterError):
        linuxcnc.interpret(f"{HEAD}{line}\nM2\n".encode(), place.parent, deletes=True)


@pytest.mark.oracle
@pytest.mark.parametrize("name", [*SERIES, *PLACES])
def test_linuxcnc_goes_there(name: str, place: Path) -> None:
    text = series(name) if name in SERIES else f"{HEAD}{PLACES[name][0]}\nM2\n"
    moves = linuxcnc.interpret(text.encode("latin-1"), place.parent)
    own = reached(text, place)
    np.testing.assert_allclose(own[-1], moves.axis[-1], atol=1e-6)
    if name in SERIES:
        levels = SERIES[name][2]
        np.testing.assert_allclose(moves.axis[-len(levels) :, 2], levels, atol=1e-6)


@pytest.mark.parametrize("control", ["fanuc", "haas"])
@pytest.mark.parametrize("between", ["G55", "G20", "G43 H2", "G92 Z7.", "G28 Z9."])
def test_a_broken_series_is_refused_where_the_control_is_not_known(
    control: str, between: str, tmp_path: Path
) -> None:
    where = machine(tmp_path, controller=control, tables=TABLES + "[job_defaults]\ntool = 1\n")
    text = "G21 G90 G54 G17\nG0 X1. Y2. Z3.\nG98 G81 X1. Y1. Z-5. R2. F60.\n" + between
    with pytest.raises(ProgramError, match="within a series of canned cycles") as caught:
        read(f"{text}\nG90 X2. Y1.\nM2\n".encode(), load_setup(where), DIALECTS[control])
    assert caught.value.line == 5
    read(f"{text}\nG80\nG0 Z3.\nG81 X2. Y1. Z-5. R2.\nM2\n".encode(), load_setup(where), DIALECTS[control])


@pytest.mark.oracle
@pytest.mark.parametrize("name", SERIES)
def test_a_corrected_series_is_right_on_a_bent_machine(name: str, tmp_path: Path) -> None:
    """The level before the series and the words that are inserted count as the control counts them."""
    tables = TABLES + "[job_defaults]\ntool = 1\n"
    curves = {
        "x.csv": "X_mm,EXX_um\n-1000,-900\n2000,1800\n",
        "z.csv": "Z_mm,EZZ_um,EXZ_um\n-1000,-800,300\n2000,1600,-600\n",
    }
    calibration = "[squareness]\nC0Y_urad = 120.0\n" + "".join(f'[[curves]]\nfile = "{c}"\n' for c in curves)
    where = machine(tmp_path, calibration, curves, tables=tables)
    nominal = series(name).encode()
    result = olp.correct(nominal, where)
    verdict = judged(nominal, result.data, tmp_path, kinds=("feed",))
    stated = result.report["deviation"]["path_max_um"]
    # the longest stroke leans by what its middle leaves at both ends
    assert verdict.after.max_um < min(stated + 0.05, verdict.before.max_um / 15)
