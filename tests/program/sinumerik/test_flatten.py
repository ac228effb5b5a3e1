"""Parametric programs unrolled: against a judge that runs them as Python, and by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from judge import sinumerik as judge

from olp.core.errors import ConfigError, ProgramError
from olp.core.machine import Setup
from olp.files.config import load_job, load_setup
from olp.program.registry import DIALECTS, read
from olp.program.sinumerik.flatten.unroll import flatten

SINUMERIK = DIALECTS["sinumerik"]
HEAD = "G71 G90 G17 G54 G94 F600\nG0 X0 Y0 Z0\n"


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    return load_setup(machine(tmp_path_factory.mktemp("m"), tables=TRUE_ZERO, controller="sinumerik"))


def unrolled(text: str, **options: object) -> str:
    return flatten(text.encode(), SINUMERIK, **options).decode()  # type: ignore[arg-type]


def random_program(rng: np.random.Generator) -> str:
    """Blocks, assignments and structures inside one another; loops end."""
    rows: list[str] = [f"R{i}={rng.integers(-9, 9)}" for i in range(1, 5)] + ["DEF REAL V1=2.5"]
    counter = 10

    def expression() -> str:
        first = [f"R{rng.integers(1, 5)}", "V1", f"{rng.integers(0, 99) / 10}"][rng.integers(3)]
        other = [f"ABS(R{rng.integers(1, 5)})", f"SIN({rng.integers(0, 90)})", "(R1+2)", "V1"][
            rng.integers(4)
        ]
        return f"{first}{'+-*'[rng.integers(3)]}{other}"

    def block(depth: int) -> None:
        nonlocal counter
        for _ in range(rng.integers(1, 5)):
            kind = rng.integers(10)
            counter += 1
            if kind < 4:
                axis = "XYZ"[rng.integers(3)]
                value = [expression(), f"IC({expression()})", f"AC({expression()})", "7.25"][rng.integers(4)]
                rows.append(f"N{len(rows)} {['G1', 'G90 G0', 'G91', ''][rng.integers(4)]} {axis}={value}")
            elif kind < 6:
                rows.append(f"R{rng.integers(1, 5)}=TRUNC({expression()})/4")
            elif depth > 2:
                rows.append(f"G90 X={expression()} Y{rng.integers(9)}")
            elif kind == 6:
                rows.append(f"IF (R1>{rng.integers(-3, 3)}) AND (R2<={rng.integers(-3, 9)})")
                block(depth + 1)
                rows.append("ELSE")
                block(depth + 1)
                rows.append("ENDIF")
            elif kind == 7:
                rows.append(f"FOR R{counter}=1 TO {rng.integers(0, 4)}")
                block(depth + 1)
                rows.append("ENDFOR")
            elif kind == 8:
                own = counter
                rows.append(f"R{own}=0")
                rows.append(f"WHILE R{own}<{rng.integers(1, 4)}")
                rows.append(f"R{own}=R{own}+1")
                block(depth + 1)
                rows.append("ENDWHILE")
            else:
                own = counter
                rows.append(f"R{own}=0")
                rows.append("REPEAT")
                rows.append(f"R{own}=R{own}+1")
                block(depth + 1)
                rows.append(f"UNTIL R{own}>={rng.integers(1, 3)}")

    for _ in range(3):
        block(0)
    return HEAD + "\n".join([*rows, "G90 G1 X0 Y0 Z0"]) + "\n"


@pytest.mark.parametrize("seed", range(60))
def test_random_programs_go_where_the_judge_goes(seed: int, setup: Setup) -> None:
    program = random_program(np.random.default_rng(seed))
    want = np.array(judge.ends(program))
    got = read(unrolled(program + "M30\n").encode(), setup, SINUMERIK).toolpath.end_mm
    assert got.shape == want.shape
    assert np.abs(got - want).max() < 1e-6


def test_what_is_plain_stays_byte_for_byte() -> None:
    text = 'N10 G1  X5.00 Y=3 ; a\r\nMSG("R1=5")\r\nN20 R1=4 ; b\r\nN30 X=R1 Z-1.50\r\nN40 M30\r\nX9\r\n'
    want = 'N10 G1  X5.00 Y=3 ; a\r\nMSG("R1=5")\r\nN30 X=4 Z-1.50\r\nN40 M30\r\n'
    assert unrolled(text) == want


#: A program behind the head, and its blocks when unrolled.
WRITTEN = {
    "AA:\nN5 X=IC(5)\nR1=R1+1\nIF R1<2 GOTOB AA\n": "N5 X5\nX10\n",
    "GOTOF N20\nX1\nN20 X2\n": "N20 X2\n",
    "CASE R1 OF 1 GOTOF A1 0 GOTOF A2 DEFAULT GOTOF A3\nA1: X1\nA2: X2\nA3: X3\n": "X2\nX3\n",
    "LOOP\nR1=R1+1\nIF R1>2 GOTOF OUT\nX=R1\nENDLOOP\nOUT: Y1\n": "X=1\nX=2\nY1\n",
    "R[2]=3\nX=R2*POT(2) Y=5 DIV 2 Z=5 MOD 3\n": "X=12 Y=2 Z=2\n",
    "DEF INT A[3]\nA[1]=4\nX=A[1]+A[2]\n": "X=4\n",
    "G91 X=AC(4)\n": "G91 X=4\n",
    # a variable of a type takes what fits
    "DEF INT NN=2.7, MM[2]=SET(2.4,-1.5)\nX=NN Y=MM[0] Z=MM[1]\nNN=5/2\nX=NN/2\n": "X=3 Y=2 Z=-1\nX=1.5\n",
    "DEF BOOL FF=0.2\nIF FF\nX1\nENDIF\nFF=0.0\nIF FF\nX2\nENDIF\n": "X1\n",
    "R3=2\nMCALL CYCLE81(5,0,1,-R3)\nX1\nMCALL\n": "MCALL CYCLE81(5,0,1,-2)\nX1\nMCALL\n",
    "SUB1(2)\nL7 P2\n": "X=4\nY1\nY1\n",
    "R1=1\nL7 P=R1+1\nL7 P=R1-1\n": "Y1\nY1\n",
    # words that are no positions of the program do not count for IC( )
    "X5\nG26 X100\nX=IC(1)\n": "X5\nG26 X100\nX6\n",
    "G58 X100\nX5\nX=IC(1)\n": "G58 X100\nX5\nX6\n",
    "$P_UIFR[1]=CTRANS(X,R1+2,Y,3)\n": "$P_UIFR[1]=CTRANS(X,2,Y,3)\n",
    "TRANS X=R1+1\n": "TRANS X=1\n",
    # arguments that are names stay
    "CYCLE832(0.05,_SEMIFIN,1)\nX=R1+1\n": "CYCLE832(0.05,_SEMIFIN,1)\nX=1\n",
    # a variable of the control
    "GUD=2\nX=GUD\n": "X=2\n",
}
FILES = {"SUB1": b"PROC SUB1(REAL A, REAL B=2)\nX=A*B\nRET\n", "L7": b"Y1\nM17\n"}


@pytest.mark.parametrize("text", WRITTEN, ids=lambda t: t.replace("\n", " | "))
def test_unrolled_by_hand(text: str) -> None:
    def beside(name: str) -> tuple[str, bytes] | None:
        return (f"{name}.SPF", FILES[name]) if name in FILES else None

    got = unrolled(HEAD + "R1=0\n" + text + "M30\n", subprograms=beside)
    want = HEAD + WRITTEN[text] + "M30\n"
    lines = [" ".join(line.replace("X=IC", "").split()) for line in got.splitlines()]
    assert [line.replace("=", "") for line in lines] == [line.replace("=", "") for line in want.splitlines()]


def test_cycles_are_written_out_as_moves() -> None:
    text = HEAD + "Z9\nMCALL CYCLE82(5,0,1,-2,,0.5)\nX1 Y2\nHOLES1(10,0,0,5,10,2)\nMCALL\nM30\n"
    hole = "G0 Z1\nG1 Z-2\nG4 F0.5\nG0 Z5\nG0\n"
    want = HEAD + f"Z9\nX1 Y2\n{hole}G0 X15 Y0\n{hole}G0 X25 Y0\n{hole}G0\nM30\n"
    assert unrolled(text, expand_cycles=True) == want


@pytest.mark.parametrize(
    ("call", "places"),
    [
        ("HOLES1(1,2,90,5,10,2)", [(1, 7), (1, 17)]),
        ("HOLES1(1,2,90,5,10,2,1000,0,,,1)", [(1, 7), (1, 17)]),
        ("HOLES2(1,2,5,90,0,2)", [(1, 7), (1, -3)]),
        ("HOLES2(1,2,5,90,-90,2,,,,,1)", [(1, 7), (6, 2)]),
        # a grid goes there and back, turned about its first place
        ("CYCLE801(1,2,0,10,5,2,2)", [(1, 2), (11, 2), (11, 7), (1, 7)]),
        ("CYCLE801(1,2,90,10,5,2,2,0,0,,,,,1)", [(1, 2), (1, 12), (-4, 12), (-4, 2)]),
        # a frame has its rim alone
        ("CYCLE801(0,0,0,1,1,3,3,1)", [(0, 0), (1, 0), (2, 0), (2, 1), (0, 1), (0, 2), (1, 2), (2, 2)]),
    ],
)
def test_patterns_are_places(call: str, places: list[tuple[float, float]], setup: Setup) -> None:
    text = unrolled(f"{HEAD}MCALL CYCLE81(5,0,1,-2)\n{call}\nMCALL\nM30\n")
    path = read(text.encode(), setup, SINUMERIK).toolpath
    drilled = path.end_mm[path.end_mm[:, 2] == path.end_mm[:, 2].min()]
    assert drilled[:, :2] - path.end_mm[0, :2] == pytest.approx(np.array(places), abs=1e-9)


def test_subprograms_are_called_by_their_files() -> None:
    files = {"SUB": ("SUB.SPF", b"G1 X1\nM17\n")}
    for call in ('EXTCALL "SUB"', 'EXTCALL("C:/SPF/SUB.SPF")', 'CALL "/_N_SPF_DIR/_N_SUB_SPF"', "SUB"):
        assert unrolled(call + "\nM30\n", subprograms=files.get) == "G1 X1\nM30\n"


def test_the_header_of_a_file_that_is_called_begins_no_program(setup: Setup) -> None:
    """Behind it nothing would be read."""
    sub = b"%_N_SUB_SPF\n;$PATH=/_N_SPF_DIR\n; A\nX1 Y2\nM17\n"
    head = "%_N_A_MPF\n;$PATH=/_N_A\n" + HEAD
    text = unrolled(
        head + "SUB\nX5\nM30\n", subprograms=lambda name: ("SUB.SPF", sub) if name == "SUB" else None
    )
    assert text == head + "; A\nX1 Y2\nX5\nM30\n"
    assert read(text.encode(), setup, SINUMERIK).toolpath.end_mm[-1, :2].tolist() == [5.0, 2.0]


MAIN = "G17 G90 G71 G54 G40 G1 F200\n"
#: Subprograms with SAVE, and what stands behind the blocks of one, or why it is refused.
SAVED = {
    "Z-1": "",
    "G90 G1 Z-1": "",
    "G91 X10": "G90\n",
    "G0 G91 X10\nG1 G18": "G17 G90\n",
    "G55\nX1\n/G0": "G1 G54\n",
    "INNER\nG91 X1": "G90\n",
    "INNER": "",
    "G41 X1\nG40 X2": "",
    "G41 X1": "takes the place of G40",
    "G64": "program it before the call",
    "TRANS X1": "changes a frame",
    "G58 X1": "changes a frame",
    "SOFT": "take SAVE out",
    "PLAIN": "take SAVE out",
}


@pytest.mark.parametrize("text", SAVED, ids=lambda t: t.replace("\n", " | "))
@pytest.mark.parametrize("head", ["SUB2 SAVE", "SUB2(REAL A) SBLOF DISPLOF SAVE"])
def test_save_puts_back_what_was_in_force_at_the_call(head: str, text: str) -> None:
    subs = {
        "SUB2": f"PROC {head}\n{text}\nRET\n",
        "INNER": "PROC INNER SAVE\nG91\nRET\n",
        "PLAIN": "SOFT\nRET\n",
    }

    def beside(name: str) -> tuple[str, bytes] | None:
        return (f"{name}.SPF", subs[name].encode()) if name in subs else None

    if SAVED[text].rstrip("\n") == SAVED[text] != "":
        with pytest.raises(ProgramError) as caught:
            unrolled(MAIN + "SUB2\nX50\nM30\n", subprograms=beside)
        assert SAVED[text] in str(caught.value) and caught.value.code == "OLP544"
        return
    got = unrolled(MAIN + "SUB2\nX50\nM30\n", subprograms=beside)
    inside = text.replace("INNER", "G91\nG90")
    assert got == f"{MAIN}{inside}\n{SAVED[text]}X50\nM30\n"


@pytest.mark.parametrize(
    ("call", "sub", "why"),
    [("/SUB", "X1\nRET\n", "both positions of the switch"), ("SUB", "X1 M17\n", "a block of its own")],
)
def test_a_call_under_the_switch_and_a_last_block_with_more_words_are_refused(
    call: str, sub: str, why: str
) -> None:
    """The call ran with either position, and the words of the last block were lost."""
    with pytest.raises(ProgramError, match=why):
        unrolled(call, subprograms=lambda _: ("SUB.SPF", sub.encode()), block_delete=None)


def test_arrays_take_the_values_of_their_definition() -> None:
    text = "DEF REAL P[3]=SET(1.5, 2*4)\nX=P[0] Y=P[1] Z=P[2]\n"
    assert unrolled(HEAD + text).endswith("X=1.5 Y=8 Z=0\n")


def test_the_last_index_of_an_array_counts_first() -> None:
    text = "DEF REAL P[2,3]=SET(1, 2, 3, 4)\nP[1,2]=9\nX=P[0,2] Y=P[1,0] Z=P[1,2]\nX=P[1,1]\n"
    assert unrolled(HEAD + text).endswith("X=3 Y=4 Z=9\nX=0\n")


def test_subprograms_of_an_archive_have_the_lines_of_the_file() -> None:
    text = "%_N_A_MPF\n;$PATH=/_N_A\nBB1\nM30\n%_N_BB1_SPF\nG0 X1\nRET\n"
    done = flatten(text.encode(), SINUMERIK)
    assert done.decode() == "%_N_A_MPF\n;$PATH=/_N_A\nG0 X1\nM30\n"
    assert done.origin.lines_of([3, 4]).tolist() == [6, 4]


REFUSED = {
    "X=R9": ("R9 has no value", "OLP541"),
    "X=$AA_IM[X]": ("has no value", "OLP541"),
    "NOSUB": ("NOSUB.SPF", "OLP542"),
    "IF R1>1 AND R1<2 GOTOF A": ("put each comparison into brackets", "OLP540"),
    "GOTOF NONE": ("not in its direction", "OLP542"),
    "X=R1/0": ("divides by zero", "OLP540"),
    "AA: X1\nREPEAT AA P=1.5": ("runs 1.5 times", "OLP542"),
    "REPEAT AA P=3": ("0 times", "OLP542"),
    "ENDIF": ("closes nothing", "OLP542"),
    "AA:\nGOTOB AA": ("endless loop", "OLP543"),
    "GUD=2.5": ("DEF REAL", "OLP542"),
    "DEF REAL AA[2]=5": ("write SET", "OLP542"),
    "DEF REAL AA[0]": ("a size", "OLP542"),
    "CYCLE801(1,2,0,10,5,2)": ("needs 7 numbers", "OLP531"),
    "CYCLE801(1,2,0,10,5,2,2,0,0,15)": ("argument 10", "OLP544"),
    "CYCLE801(1,2,0,10,5,2,1.5)": ("expected an integer", "OLP531"),
    "HOLES2(1,2,5,90,0,3,1100)": ("argument 7", "OLP544"),
    "SUPA X100\nX=IC(1)": ("program it in G90 first", "OLP524"),
    'RET("AA")': ("may go on at another block", "OLP542"),
    "X1 RET": ("write RET alone", "OLP542"),
    "X=DC(R1)": ("DC belongs to rotary axes", "OLP512"),
    "Y=ACP(20)": ("ACP belongs to rotary axes", "OLP512"),
    "AP=ACN(20) RP=3": ("ACN belongs to rotary axes", "OLP512"),
    'X="A"': ("is not a number", "OLP510"),
    "TRANS X1\nX=IC(1)": ("program it in G90 first", "OLP524"),
}


@pytest.mark.parametrize("text", REFUSED, ids=lambda t: t.replace("\n", " | "))
def test_what_is_not_run_is_refused_with_its_line(text: str) -> None:
    message, code = REFUSED[text]
    with pytest.raises(ProgramError) as caught:
        unrolled(f"R1=0\nG90 G0 X0 Y0\n{text}", limit=20_000)
    assert message in str(caught.value)
    assert caught.value.code.startswith(code) and caught.value.line in (3, 4)


def test_values_of_the_control_come_from_the_job() -> None:
    assert unrolled("X=R9\n", parameters={"R9": 2.5}) == "X=2.5\n"


def test_variables_of_the_control_stand_in_the_job_file(tmp_path: Path) -> None:
    stated = {"CLEAR_X": 2.5, "GUD[0]": 1.0, "$AC_MEA[1]": 1.0, "_N": 3.0, "R1": 2.0, "VC1": 1.0}
    job = tmp_path / "job.toml"
    rows = "".join(f'"{name}" = {value}\n' for name, value in stated.items())
    job.write_text(f'schema = "olp-job-1"\n[parameters]\n{rows}')
    assert load_job(job).parameters == stated
    text = "CLEAR_X=CLEAR_X+GUD[0]\nG1 X=CLEAR_X Y=$AC_MEA[1]+_N\n"
    assert unrolled(text, parameters=stated) == "G1 X=3.5 Y=4\n"
    # whether the control rounds it is not known
    for text in ("_N=_N+0.5\n", "_M=1\n_M=0.5\n"):
        with pytest.raises(ProgramError, match="give DEF REAL"):
            unrolled(text, parameters=stated)
    # short names may be axes: the job cannot state them, and no message says so
    for name in ("X", "XA", "AX4", "SP1"):
        job.write_text(f'schema = "olp-job-1"\n[parameters]\n"{name}" = 1.0\n')
        with pytest.raises(ConfigError, match=f'has the key "{name}"'):
            load_job(job)
        with pytest.raises(ProgramError, match=f"{name} has no value that the program sets; set it"):
            unrolled(f"Y={name}+1\n")


@pytest.mark.parametrize("end", ("M30", "M2"))
def test_the_end_of_the_program_in_a_subprogram_is_refused(end: str) -> None:
    """It may return as M17 does; in a part of the program itself it ends the run."""
    with pytest.raises(ProgramError, match="write RET or M17") as caught:
        unrolled(HEAD + "SUB\nX5\nM30\n", subprograms=lambda _: ("SUB.SPF", f"G1 X1\n{end}\n".encode()))
    assert caught.value.code == "OLP542"
    assert "X7" in unrolled(HEAD + f"AA: X7\nBB: {end}\n")
