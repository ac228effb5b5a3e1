"""Laws L1 to L8 of the program representation over all dialects: one table of cases, one suite.

A dialect joins with a `Case`: how it says points, distances and comments, which characters it is made of, and
where real programs of it are. What only one family has is tested beside it (`test_laws`, `test_apt`,
`test_dmis`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import points, unstamped
from hypothesis import example, given, settings
from hypothesis import strategies as st
from judge import machines
from judge.machines import Recipe
from judge.model import JudgeModel
from judge.path import match

import olp
from olp.core.errors import OlpError, ProgramError
from olp.core.machine import Setup
from olp.files.config import load_setup
from olp.files.described import described

#: 1 nm, within which the two independent models agree
SLACK_MM = 1e-6
OFFSET = np.array([250.0, 200.0, -300.0])
LEVER = np.array([0.0, 0.0, -120.0])
NUMBER = rb"[+-]?(?:\d+\.?\d*|\.\d+)"
HALF_DIGIT = 0.5e-3 + SLACK_MM
Lines = list[str]


@dataclass(frozen=True)
class Case:
    """One dialect. `coordinates` finds the numbers of motion statements, its one group the three of them;
    `lever` is what the tool of the test's machine is to this dialect."""

    name: str
    controller: str
    alphabet: str
    head: Lines
    tail: Lines
    point: Callable[[Sequence[float], int], str]
    distance: Callable[[Sequence[float], int], str] | None
    comment: Callable[[str], str]
    coordinates: re.Pattern[bytes]
    specimens: tuple[str, ...]
    examples: tuple[bytes, ...] = ()
    keys: str = ""

    def program(self, points: np.ndarray, digits: int) -> bytes:
        said = [self.point(p, digits) for p in points.tolist()]
        return ("\n".join([*self.head, *said, *self.tail]) + "\n").encode()


def _words(values: Sequence[float], digits: int) -> str:
    return " ".join(f"{a}{v:.{digits}f}" for a, v in zip("XYZ", values, strict=True))


def _list(values: Sequence[float], digits: int) -> str:
    return ",".join(f"{v:.{digits}f}" for v in values)


def _rs274(name: str) -> Case:
    return Case(
        name, name, "GXYZIJKRFMTNSPQHLDO%/;()[]#=+-. 0123456789\r\n\t:<>\"'^!",
        ["G21 G90 G17 G54 G94 F600"], ["M2"],
        lambda p, d: f"G1 {_words(p, d)}", lambda p, d: f"G91 G1 {_words(p, d)}",
        lambda text: f"({text})",
        re.compile(rb"(?m)^G1 X(" + NUMBER + rb") Y(" + NUMBER + rb") Z(" + NUMBER + rb")"),
        ("gcode_cncjs/*",) if name == "linuxcnc" else ("gcode_fanuc*/*",) if name == "fanuc" else (),
        (b"%\n%\n", b"\xef\xbb\xbfG21\nG0 X1\n"),
    )  # fmt: skip


RS274 = ("linuxcnc", "grbl", "fanuc", "haas")
CASES = {
    **{name: _rs274(name) for name in RS274},
    "apt": Case(
        "apt", "apt", "GOTDLAFRMCIEUNSP/,.+-$ 0123456789\r\n\t=()'",
        ["PARTNO TEST", "UNITS/MM", "FEDRAT/600,MMPM"], ["FINI"],
        lambda p, d: f"GOTO/{_list(p, d)}", lambda p, d: f"GODLTA/{_list(p, d)}",
        lambda text: f"$$ {text}",
        re.compile(rb"(?m)^GOTO/(" + NUMBER + rb"),(" + NUMBER + rb"),(" + NUMBER + rb")"),
        ("apt_cldata/*",),
        (
            b"GOTO/1,2,3$", b"GOTO/1,2,$\n3", b"GOTO/1.$\n5,2,3", b"$$ $\nGOTO/1,2,3\n",
            b"GOTO/1,2,3,0,0,1\nGOTO/4,5,6",
            b"CIRCLE/0,0,0,0,0,1\nGOTO/1,0,0", b"GODLTA/1\nGOTO/1,2,3\nGODLTA/-2", b"RAPID\nGOTO/1,2,3",
            b"GOTO/1E2,2D0,3", b"GOTO/1E999,0,0",
            b"INDIRV/1,0,0\nTLON,GOFWD/(CIRCLE/0,0,0,1),ON,(LINE/0,0,0,1,0,0)",
            b"CYCLE/DRILL,DEPTH,5,CLEAR,1\nGOTO/1,2,3\nCYCLE/OFF\nGOTO/2,3,4", b"PPRINT $\nGOTO/1,2,3",
            b"\xef\xbb\xbfGOTO/1,2,3\r\nGOTO/1,2,4\r\n", b"GOTO/1,2,3\rGOTO/1,2,4\r", b"LOADTL/1\nGOTO/0,0,0",
            b"$$-> CSYS / 1,0,0,0, $\n0,1,0,0, $\n0,0,1,0\nGOTO/1,2,3\n", b"GOTO/99999999999999999999,1,2",
        ),
    ),
    "dmis": Case(
        "dmis", "dmis", "GOTPMEASCRDUNI/,.+-$ 0123456789\r\n\t=()'F",
        ["DMISMN/'TEST',05.2", "UNITS/MM,ANGDEC", "MODE/PROG,MAN"], ["ENDFIL"],
        lambda p, d: f"GOTO/{_list(p, d)}", None,
        lambda text: f"$$ {text}",
        re.compile(rb"(?m)^GOTO/(" + NUMBER + rb"),(" + NUMBER + rb"),(" + NUMBER + rb")"),
        ("dmis/*",),
        (
            b"GOTO/CART,1,2,3", b"MEAS/POINT,F(A),1\nPTMEAS/CART,1,2,3,0,0,1\nENDMES", b"PTMEAS/CART,1,2,3",
            b"F(A)=FEAT/POINT,CART,1,2,3,0,0,1\nGOTO/1,2,$\n3", b"MEAS/POINT,F(A),1\nENDMES\nGOTO/1,2,3",
            b"MODE/MAN\nGOTO/1,2,3", b"IF/(A .EQ. 1)\nGOTO/1,2,3\nENDIF",
            b"TEXT/OPER,'GOTO/1,2,$$'\nGOTO/1,2,3",
            b"$$ a $\nGOTO/1,2,3", b"D(A)=DATSET/DAT(A),ZDIR\nGOTO/1,2,3", b"BEGIN/CHFILE\nX = 3\nEND/CHFILE",
        ),
    ),
    "list": Case(
        "list", "list", "XYZ_mminch,;.+-# 0123456789\r\n\t\"eE=",
        ["X_mm,Y_mm,Z_mm"], [],
        _list, None, lambda text: f"# {text}",
        re.compile(rb"(?m)^(" + NUMBER + rb"),(" + NUMBER + rb"),(" + NUMBER + rb")"),
        (),
        (
            b"X_mm;Y_mm;Z_mm\n1,5;2,5;3,5\n", b"X_inch Y_inch Z_inch\n 1.50  2.5  -3\n", b"1,2,3",
            b"X_mm,Y_mm,Z_mm", b'X_mm,Y_mm,Z_mm\n"1","2","3"', b"X_mm,Y_mm,Z_mm\n1,2,3,\n",
            b"\xef\xbb\xbfX_mm,Y_mm,Z_mm\r\n1e1,2E-1,.5\r", b"X_mm,Y_mm,Z_mm\n1,2,\n",
            b"# frame=G55\nX_mm,Y_mm,Z_mm\n1,2,3", b"X_mm,Y_mm,Z_mm\n1e99,2,3",
            b"X_mm,Y_mm,Z_mm\n" + b"0" * 50 + b"1,2,3", b'X_mm,Y_mm,Z_mm\n"1,2,3',
        ),
    ),
    "kawasaki-as": Case(
        "kawasaki-as", "kawasaki-as", "LMOVETRANSPOINDW().,;\"+-= #0123456789\r\n\tp",
        [".PROGRAM test()", "SPEED 100 MM/S ALWAYS"], [".END"],
        lambda p, d: f"LMOVE TRANS({_list(p, d)})", lambda p, d: f"DRAW {_list(p, d)}",
        lambda text: f"; {text}",
        re.compile(rb"(?m)^LMOVE TRANS\((" + NUMBER + rb"),(" + NUMBER + rb"),(" + NUMBER + rb")\)"),
        (),
        (
            b"LMOVE p\n.TRANS\np 1 2 3\n.END", b"LMOVE TRANS(1,2,3,0,180,0) ; x",
            b"JMOVE #a\nLMOVE TRANS(1,2,3)",
            b'PRINT ";"\nLMOVE TRANS(1,2,3)', b"LMOVE TRANS(1E400,2,3)", b"DRAW 1,2,3",
            b".TRANS\np 1 2 3\np 1 2 3\n.END\nLMOVE p", b"TOOL 99\nLMOVE TRANS(1,2,3)",
            b"LMOVE TRANS(1,2,3)\rLMOVE TRANS(1,2,3)",
        ),
    ),
    "val2": Case(
        "val2", "val2", "MOVESTRANSPD().,;\"+-= #0123456789\r\n\tp",
        ["SPEED 100 ALWAYS"], [],
        lambda p, d: f"MOVES TRANS({_list(p, d)})", lambda p, d: f"DRAW {_list(p, d)}",
        lambda text: f"; {text}",
        re.compile(rb"(?m)^MOVES TRANS\((" + NUMBER + rb"),(" + NUMBER + rb"),(" + NUMBER + rb")\)"),
        (),
        (b"10 SET a = TRANS(1,2,3)\n20 MOVES a\n30 MOVES a", b"MOVE #p\nMOVES TRANS(1,2,3)"),
    ),
}  # fmt: skip
FRAMES = {
    name: {"X_mm": 250.0, "Y_mm": 200.0, "Z_mm": -300.0, "set_by": "true"}
    for name in ("G54", "MCS", "A", "CSYS2", "CSYS3")
}


def recipe(case: Case, **more: object) -> Recipe:
    return replace(Recipe(controller=case.controller, work_offsets=FRAMES), **more)


def pinned(path: Path, case: Case) -> Setup:
    """The setup with the dialect named, so that any bytes are read in it."""
    setup = load_setup(path)
    return replace(setup, job=replace(setup.job, dialect=case.name, described=described(case.name)))


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Setup]:
    folder = tmp_path_factory.mktemp("zero")
    return {n: pinned(machines.zero_machine(folder / n, recipe(c)), c) for n, c in CASES.items()}


@pytest.fixture(scope="module")
def shifted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Setup]:
    folder = tmp_path_factory.mktemp("shift")
    return {n: pinned(machines.shift_machine(folder / n, recipe=recipe(c)), c) for n, c in CASES.items()}


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("bent")
    return {n: machines.random_machine(folder / n, 11, recipe(c, off_datum=True)) for n, c in CASES.items()}


def attempt(data: bytes, setup: Setup) -> bytes | None:
    """Corrected bytes, or None where the program is refused; anything but a refusal is a failure."""
    try:
        return olp.correct(data, setup).data
    except OlpError as error:
        assert str(error)
        return None


# -- L1, L3: identity ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CASES)
@given(data=st.data())
@settings(max_examples=40)
def test_l1_any_bytes_come_back_or_are_refused(
    zero: dict[str, Setup], shifted: dict[str, Setup], name: str, data: st.DataObject
) -> None:
    text = data.draw(
        st.one_of(st.binary(max_size=200), st.text(CASES[name].alphabet, max_size=120).map(str.encode))
    )
    out = attempt(text, zero[name])
    assert out is None or out == text
    attempt(text, shifted[name])


@pytest.mark.parametrize(("name", "text"), [(n, t) for n, c in CASES.items() for t in c.examples])
def test_l1_chosen_texts(zero: dict[str, Setup], shifted: dict[str, Setup], name: str, text: bytes) -> None:
    out = attempt(text, zero[name])
    assert out is None or out == text
    attempt(text, shifted[name])


@pytest.mark.parametrize("name", CASES)
@given(noise=st.binary(max_size=60))
@example(noise=b"$$ \xff 'x'")
@settings(max_examples=15)
def test_l1_text_in_a_comment_is_opaque(zero: dict[str, Setup], name: str, noise: bytes) -> None:
    case = CASES[name]
    said = re.sub(rb"[\r\n()]|olp", b"", noise).rstrip(b" $\t\v\f").decode("latin-1")
    text = "\n".join([*case.head, case.comment(said), case.point((1.0, 2.0, 3.0), 3), *case.tail])
    data = text.encode("latin-1")
    assert olp.correct(data, zero[name]).data == data


@pytest.mark.parametrize("name", CASES)
@given(
    seed=st.integers(0, 2**20),
    cuts=st.lists(st.tuples(st.integers(0, 4000), st.binary(max_size=4)), max_size=6),
)
@settings(max_examples=20)
def test_l1_a_damaged_program_never_crashes(
    zero: dict[str, Setup], shifted: dict[str, Setup], name: str, seed: int,
    cuts: list[tuple[int, bytes]],
) -> None:  # fmt: skip
    rng = np.random.default_rng(seed)
    text = bytearray(CASES[name].program(rng.uniform(-50, 50, (6, 3)), 3))
    for place, piece in cuts:
        at = place % len(text)
        text[at : at + 2] = piece
    data = bytes(text)
    out = attempt(data, zero[name])
    assert out is None or out == data
    attempt(data, shifted[name])


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("seed", range(3))
def test_l3_no_error_no_edit(zero: dict[str, Setup], name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    data = CASES[name].program(rng.uniform(-60, 60, (40, 3)), int(rng.integers(0, 7)))
    assert olp.correct(data, zero[name]).data == data


@pytest.mark.corpus
@pytest.mark.parametrize("name", [n for n, c in CASES.items() if c.specimens])
def test_l1_l3_every_specimen_is_carried(corpus: Path, tmp_path: Path, name: str) -> None:
    case = CASES[name]
    tools = {n: {"Z_mm": 100.0 + n} for n in range(1, 31)}
    frames = {**FRAMES, **{f"COOR_{n:04d}": FRAMES["A"] for n in range(1, 30)}}
    frames |= {f"CSYS{n}": FRAMES["A"] for n in range(2, 9)}
    described = machines.zero_machine(
        tmp_path, recipe(case, travel=((-3000.0, 3000.0),) * 3, tools=tools, work_offsets=frames)
    )
    described.write_text(
        described.read_text()
        + '[styli."A0.0B0.0"]\noffset_mm = [0, 0, -150]\n[styli."A90.0B0.0"]\noffset_mm = [0, 120, -50]\n'
    )
    paths = [p for pattern in case.specimens for p in sorted(corpus.glob(pattern))]
    carried = 0
    for path in (p for p in paths if p.stat().st_size < 400_000):
        try:
            out = olp.correct(path, pinned(described, case), contour=True).data
            assert out == path.read_bytes(), path.name
            carried += 1
        except OlpError as refusal:
            assert isinstance(refusal, ProgramError), path.name
            assert refusal.line is not None, path.name
            assert case.name not in ("apt", "dmis"), refusal
    assert carried


# -- L2: bytes outside edits; a shift edits every slot -------------------------------------------------


def numbers(text: bytes, pattern: re.Pattern[bytes]) -> tuple[bytes, list[Decimal]]:
    """The text with a mark in place of each coordinate, and the coordinates."""
    found: list[Decimal] = []

    def mark(hit: re.Match[bytes]) -> bytes:
        found.extend(Decimal(g.decode()) for g in hit.groups())
        out = hit[0]
        for group in range(3, 0, -1):
            a, b = hit.span(group)
            out = out[: a - hit.start()] + b"@" + out[b - hit.start() :]
        return out

    return pattern.sub(mark, text), found


@pytest.mark.parametrize("name", CASES)
def test_l2_a_shift_edits_every_slot_and_nothing_else(
    shifted: dict[str, Setup], tmp_path: Path, name: str
) -> None:
    case = CASES[name]
    back = pinned(machines.shift_machine(tmp_path / "back", (-100.0, -100.0, -100.0), recipe(case)), case)
    rng = np.random.default_rng(5)
    nominal = case.program(rng.uniform(-60, 60, (20, 3)), 3)
    corrected = unstamped(olp.correct(nominal, shifted[name]).data)
    frame, before = numbers(nominal, case.coordinates)
    same, after = numbers(corrected, case.coordinates)
    assert same == frame
    assert [b - a for b, a in zip(before, after, strict=True)] == [Decimal("0.1")] * 60
    assert numbers(unstamped(olp.correct(corrected, back).data), case.coordinates) == (frame, before)


# -- L4, L6: the numbers written are the points meant -------------------------------------------------


def commanded(
    nominal: np.ndarray, text: bytes, path: Path, case: Case, own: np.ndarray | None = None
) -> float:
    """Largest difference of the written end of a nominal move from the command that the judge asks for."""
    model = JudgeModel(path)
    # the ram of a measuring machine ends a stylus above the tip, and there its axes count
    up = np.array([0.0, 0.0, 120.0]) if case.name == "dmis" else np.zeros(3)
    want = model.command_for(nominal + OFFSET + up, LEVER) - OFFSET - up
    if own is None:
        own = np.array([[float(g) for g in m.groups()] for m in case.coordinates.finditer(text)])
    return float(np.abs(own[match(own, want)] - want).max())


@pytest.mark.parametrize("name", CASES)
@given(seed=st.integers(0, 2**16), digits=st.sampled_from([2, 3, 4]))
@settings(max_examples=6)
def test_l4_points_within_half_a_digit(bent: dict[str, Path], name: str, seed: int, digits: int) -> None:
    rng = np.random.default_rng(seed)
    nominal = np.round(rng.uniform((-60, -50, -20), (60, 50, 40), (15, 3)), digits)
    case = CASES[name]
    text = olp.correct(case.program(nominal, digits), pinned(bent[name], case)).data
    own = points(text) if case.name in RS274 else None
    assert commanded(nominal, text, bent[name], case, own) <= 0.5 * 10.0 ** -max(digits, 3) + SLACK_MM


@pytest.mark.parametrize("name", [n for n, c in CASES.items() if c.distance])
def test_l6_distances_do_not_drift(bent: dict[str, Path], name: str) -> None:
    case = CASES[name]
    assert case.distance is not None
    rng = np.random.default_rng(3)
    steps = np.round(rng.normal(scale=0.4, size=(1500, 3)) * (1, 1, 0.2), 3)
    steps -= np.round(steps.mean(axis=0), 3)
    said = [case.distance(s, 3) for s in steps.tolist()]
    text = "\n".join([*case.head, case.point((0.0, 0.0, 0.0), 3), *said, *case.tail]) + "\n"
    out = olp.correct(text.encode(), pinned(bent[name], case)).data
    three = rb"X?([^,\s]+)[,\s]Y?([^,\s]+)[,\s]Z?([^,\s)]+)"
    found = re.findall(rb"(?m)^(?:G91 )?(?:G1 |GODLTA/|GOTO/|DRAW |LMOVE TRANS\(|MOVES TRANS\()" + three, out)
    own = np.cumsum([[float(n) for n in row] for row in found], axis=0)
    nominal = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    assert commanded(nominal, out, bent[name], case, own) <= HALF_DIGIT


# -- L8: every move is accounted for ------------------------------------------------------------------


@pytest.mark.parametrize("name", CASES)
def test_l8_the_tally_is_complete(bent: dict[str, Path], name: str) -> None:
    rng = np.random.default_rng(2)
    data = CASES[name].program(rng.uniform(-60, 60, (30, 3)), 3)
    moves = olp.correct(data, pinned(bent[name], CASES[name])).report["moves"]
    parts = [moves[key] for key in ("corrected", "approximated", "passed", "refused")]
    assert min(parts) >= 0
    assert sum(parts) == moves["total"] == 30


@pytest.mark.parametrize("name", CASES)
def test_the_support_matrix_says_what_becomes_of_each_statement(zero: dict[str, Setup], name: str) -> None:
    rows = olp.inspect(CASES[name].program(np.zeros((2, 3)), 3), zero[name])["support"]
    assert {row["support"] for row in rows} == {"corrected", "read", "carried", "refused"}
    assert all(row["why"] for row in rows if row["support"] == "refused")
    assert len({row["statement"] for row in rows}) == len(rows)


@pytest.mark.parametrize("name", CASES)
def test_a_second_correction_is_refused(shifted: dict[str, Setup], name: str) -> None:
    once = olp.correct(CASES[name].program(np.ones((2, 3)), 3), shifted[name]).data
    with pytest.raises(OlpError, match="olp-corrected"):
        olp.correct(once, shifted[name])
