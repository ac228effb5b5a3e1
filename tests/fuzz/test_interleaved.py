"""Programs with interleaved modal state, a short run of fixed seeds: `interleaved.py` makes long ones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fuzz import any_words, bent, grammar, interleaved, minimise, nominal
from fuzz.grammar import Drawn
from judge import linuxcnc
from judge.linuxcnc import InterpreterFailure

import olp

#: where LinuxCNC's packages have programs
INSTALLED = Path("/usr/share/linuxcnc/ncfiles")


@pytest.fixture(scope="module")
def judge(tmp_path_factory: pytest.TempPathFactory) -> nominal.Judge:
    return nominal.Judge.of(tmp_path_factory.mktemp("nominal"))


def differences(
    judge: nominal.Judge | bent.Judge, programs: Iterator[Drawn]
) -> tuple[list[str], Counter[str]]:
    """What is wrong, by program, and how often each outcome came."""
    wrong, counts = [], Counter[str]()
    for drawn in programs:
        outcome = judge.outcome(drawn)
        counts[outcome.kind] += 1
        if outcome.kind in nominal.WRONG:
            wrong.append(f"{outcome.kind}, line {outcome.line}: {outcome.text}: {drawn}")
    return wrong, counts


# -- the grammar and the comparison themselves ------------------------------------------------------------


def test_a_seed_is_one_program() -> None:
    assert [grammar.program(s) for s in range(20)] == [grammar.program(s) for s in range(20)]
    assert grammar.legal(3) == grammar.legal(3) != grammar.legal(4)


@pytest.mark.slow
def test_the_grammar_draws_every_code_and_every_odd_spelling() -> None:
    text = b"\n".join(grammar.program(seed).data for seed in range(2000)).upper()
    codes = "G0 G1 G2 G3 G4 G10 G17 G18 G19 G20 G21 G28 G30 G40 G43 G43.1 G43.2 G49 G52 G53 G54 G55 G59.3 "
    codes += (
        "G61 G61.1 G64 G73 G74 G80 G81 G82 G83 G84 G85 G86 G89 G90 G90.1 G91 G91.1 G92 G92.1 G92.2 G92.3 "
    )
    codes += "G93 G94 G95 G98 G99 M6 M61 M2 M30"
    missing = [c for c in codes.split() if c.encode() not in text]
    odd = [b"\r\r\n", b"\0", b"\xff", b"\t", b"%", b"/", b";", b"(", b"X-.", b"G 1", b"M2.0", b"+", b"\x0b"]
    assert missing + [byte for byte in odd if byte not in text] == []


def test_the_smallest_program_still_shows_what_the_whole_one_did() -> None:
    data = b"G21 G90\nG0 X1 Y2\n(remark)\nG1 X5 F100 (x)\nG92 X3 Y4\nM2\n"
    small = minimise.minimised(
        Drawn(data, True, None), lambda drawn: b"G92" in drawn.data and b"X5" in drawn.data
    )
    assert small.data.split() == [b"X5", b"G92"]
    assert not small.deletes
    assert minimise.signature(b"G01 X1.5 Y-2\r\nG92.1\n") == "G1 X Y | G92.1"


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("told", "is_there"),
    [
        (b"G0 X1 Y2 Z3\n", b"G0 X1 Y2 Z3.001\n"),
        (b"G0 X1 Y2 Z3\n", b"G1 X1 Y2 Z3 F100\n"),
        (b"G1 X1 Y2 Z3 F100\n", b"G1 X1 Y2 Z3 F101\n"),
        (b"G0 X1\nG0 X1\n", b"G0 X1\nG0 X2\n"),
        (b"G2 I5 F100\n", b"G3 I5 F100\n"),
        (b"G2 I5 F100\n", b"G2 I5 P2 F100\n"),
        (b"G2 X5 Y5 I0 J5 F100 G91\n", b"G2 X5 Y5 I5 J0 F100 G91\n"),
        (b"G0 X1 Y2 Z3\n", b"G0 X1 Y2 Z3\nX3\n"),
    ],
)
def test_two_programs_that_differ_are_told_apart(judge: nominal.Judge, told: bytes, is_there: bytes) -> None:
    """One program read here, another one there: every kind of difference is found."""
    one, other = (Drawn(data, False, (12.0, -8.0, 30.0)) for data in (told, is_there))
    program, feed = judge.read(one)
    assert nominal.difference(one.data, program, feed, judge.interpret(one)) is None
    assert nominal.difference(one.data, program, feed, judge.interpret(other)) is not None


@pytest.mark.oracle
def test_an_axis_that_only_the_start_knows_is_a_difference(judge: nominal.Judge) -> None:
    drawn = Drawn(b"G0 X1\nG91 Y2\n", False, (12.0, -8.0, 30.0))
    program, feed = judge.read(drawn)
    moves = judge.interpret(replace(drawn, start_mm=None))
    assert nominal.difference(drawn.data, program, feed, moves) == ("Y is known here only", 1)


@pytest.mark.oracle
@pytest.mark.parametrize("start", [None, (12.0, -8.0, 30.0)], ids=["unknown", "known"])
@pytest.mark.parametrize(
    "before", [b"", b"G20\n", b"G20\nG0 X1\nG21\n", b"F9\n", b"G55\n", b"G92 X3\n", b"G43 H2\n"]
)
def test_after_m61_the_judge_stands_where_it_was(
    judge: nominal.Judge, before: bytes, start: tuple[float, float, float] | None
) -> None:
    drawn = Drawn(before + b"G0 X1 Y-14\nM61 Q2\nZ13\nM2\n", False, start)
    moves = judge.interpret(drawn)
    np.testing.assert_allclose(moves.axis[-1, :2], moves.axis[-2, :2], atol=1e-9)


@pytest.mark.oracle
def test_between_tape_marks_the_judge_starts_where_it_is_told(judge: nominal.Judge) -> None:
    moves = judge.interpret(Drawn(b"%\nG0 Z2\nG4 P0\nM61 Q2\nZ3\n%\n", False, (12.0, -8.0, 30.0)))
    np.testing.assert_allclose(moves.axis[:, :2], [[12.0, -8.0]] * len(moves), atol=1e-9)


# -- the server -------------------------------------------------------------------------------------------


@pytest.mark.oracle
def test_a_program_leaves_nothing_to_the_next_one() -> None:
    """Modes, offsets, tools: all of a program ends with it."""
    before = linuxcnc.interpret(b"G0 X1 Y2 Z3\nM2\n", tools={1: (0.0, 0.0, 50.0)})
    other = b"G20 G91 G18 G55\nG10 L2 P1 X5\nG92 X7\nT2 M6 G43\nG0 X1\nM2\n"
    linuxcnc.interpret(other, tools={2: (1.0, 2.0, 80.0)}, offsets={"G54": (9.0, 9.0, 9.0)})
    after = linuxcnc.interpret(b"G0 X1 Y2 Z3\nM2\n", tools={1: (0.0, 0.0, 50.0)})
    assert (before.axis == after.axis).all()
    assert not linuxcnc.accepts(b"G43 H2 G0 Z1\nM2\n", tools={1: (0.0, 0.0, 50.0)})


@pytest.mark.oracle
def test_a_program_without_an_end_is_an_answer_and_the_next_one_is_read() -> None:
    endless = b"o1 while [1]\n#1=[#1+1]\no1 endwhile\nM2\n"
    with pytest.raises(InterpreterFailure, match="time"):
        linuxcnc.interpret(endless, find_known=False, seconds=0.2)
    assert len(linuxcnc.interpret(b"G0 X1\nM2\n")) == 1


@pytest.mark.oracle
def test_the_switch_takes_out_deleted_blocks() -> None:
    assert [len(linuxcnc.interpret(b"G0 X1\n/G0 X2\nM2\n", deletes=on)) for on in (False, True)] == [2, 1]


# -- programs ---------------------------------------------------------------------------------------------


@pytest.mark.oracle
@pytest.mark.slow
@pytest.mark.parametrize("block", range(3))
def test_nominal_readings_agree(judge: nominal.Judge, block: int) -> None:
    first = 1_000_000 + 150 * block
    wrong, counts = differences(judge, (grammar.program(seed) for seed in range(first, first + 150)))
    assert wrong == []
    assert counts[nominal.SAME] >= 50, counts


@pytest.mark.oracle
@pytest.mark.slow
def test_readings_of_any_words_agree(judge: nominal.Judge) -> None:
    wrong, counts = differences(judge, (any_words.program(seed) for seed in range(4_000_000, 4_000_400)))
    assert wrong == []
    assert counts[nominal.SAME] >= 15, counts


@pytest.mark.oracle
@pytest.mark.slow
def test_corrected_texts_are_what_olp_says_they_are(tmp_path: Path) -> None:
    seeds = range(2_000_000, 2_000_060)
    wrong, counts = differences(bent.Judge.of(tmp_path), (grammar.legal(seed) for seed in seeds))
    assert wrong == []
    assert counts[nominal.SAME] >= 20, counts


@pytest.mark.oracle
@pytest.mark.slow
def test_programs_of_linuxcnc_read_alike(judge: nominal.Judge) -> None:
    """Those that its packages install, where they do; OLP_LINUXCNC_TESTS names a folder of more."""
    folders = [INSTALLED, *interleaved.more_programs()]
    paths = sorted(path for folder in folders for path in folder.rglob("*.ngc"))
    if not paths:
        pytest.skip(f"no programs in {INSTALLED}; set OLP_LINUXCNC_TESTS")
    wrong, counts = differences(judge, (Drawn(p.read_bytes(), False, (0.0, 0.0, 0.0)) for p in paths))
    assert wrong == []
    assert counts[nominal.SAME] >= 5, counts


@pytest.mark.parametrize("number", range(5))
def test_turns_of_a_circle_belong_to_it(number: int, tmp_path: Path) -> None:
    """A circle of several turns passes its end before it ends there: none goes to the next move."""
    _, setup = bent.Judge.of(tmp_path).setups[number]
    setup = replace(setup, job=replace(setup.job, start_mm=(12.0, -8.0, 30.0)))
    text = b"G0 X12 Y-8 Z30\nF300\nG2 X12 Y-8 I8 P2\nG1 X15\nM2\n"
    assert olp.correct(text, setup).report["deviation"]["path_max_um"] < 2.0
