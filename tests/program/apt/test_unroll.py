"""COPY written out: copies as they are, shifted and turned, against moves that are made otherwise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from judge import machines
from judge.cldata import read_apt

import olp
from olp.core.errors import ProgramError, UsageError
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read

APT = DIALECTS["apt"]
RECIPE = machines.Recipe(increment_mm=0.0001)
ORIGIN = np.array([250.0, 200.0, -300.0])
RANGE = "GOTO/10,0,5\nGOTO/20.5,0,-1 $$ down\nCIRCLE/20.5,5,-1,0,0,1,5\nGOTO/20.5,10,-1\nGODLTA/0,0,6\n"
ARC = "INDIRV/1,0,0\nTLON,GOFWD/(CYLNDR/20.5,15,5,0,0,1,$\n5),ON,(LINE/20.5,15,5,25.5,$\n15,5)\nGOTO/0,0,20\n"


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.zero_machine(tmp_path_factory.mktemp("zero"), RECIPE)


def unrolled(text: str, **options: bool) -> bytes:
    assert APT.unroller is not None
    return APT.unroller(text.encode(), APT, **options)


def ends(text: bytes) -> np.ndarray:
    """Of all moves, by the independent reader."""
    moves = read_apt(b"UNITS/MM\n" + text, {"G54": (np.eye(3), np.zeros(3))}, {}, tool=1)
    centre = np.array(moves.centre)
    return np.hstack((np.array(moves.axis), centre, np.array(moves.turns)[:, None]))


def test_the_same_again() -> None:
    text = f"PARTNO A\nINDEX/1\n{RANGE}COPY/1,SAME,2\nFINI\n"
    assert unrolled(text) == f"PARTNO A\n{RANGE}{RANGE}{RANGE}FINI\n".encode()
    assert unrolled(text).origin.line.tolist() == [1, *[3, 4, 5, 6, 7] * 3, 9]  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("form", "turn", "shift"),
    [
        ("TRANSL,0,30.25,-.5", np.eye(3), (0, 30.25, -0.5)),
        ("TRANSL,7,0", np.eye(3), (7, 0, 0)),
        ("XYROT,90", np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]), (0, 0, 0)),
        ("XYROT,-60", np.array([[0.5, 0.75**0.5, 0], [-(0.75**0.5), 0.5, 0], [0, 0, 1]]), (0, 0, 0)),
        ("YZROT,90", np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), (0, 0, 0)),
        ("MODIFY,(MATRIX/TRANSL,1,2,3)", np.eye(3), (1, 2, 3)),
        ("MODIFY,0,-1,0,5,1,0,0,6,0,0,1,7", np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]), (5, 6, 7)),
    ],
)
@pytest.mark.parametrize("some", [RANGE, RANGE + ARC])
def test_copies_lie_where_the_form_says(
    form: str, turn: np.ndarray, shift: tuple[float, ...], some: str
) -> None:
    written = unrolled(f"GOTO/0,0,50\nINDEX/7\n{some}COPY/7,{form},3\nGOTO/0,0,60\n")
    got, one = ends(written), ends(some.encode())
    count = len(one)
    assert len(got) == 4 * count + 2
    places, centres = one[:, :3], one[:, 3:6]
    for k in range(4):
        part = got[1 + k * count : 1 + (k + 1) * count]
        assert np.abs(part[:, :3] - places).max() < 1e-6
        arcs = one[:, 6] != 0
        assert np.abs(part[arcs, 3:6] - centres[arcs]).max() < 1e-6
        places, centres = places @ turn.T + shift, centres @ turn.T + shift


def test_ranges_in_ranges_and_what_is_no_range() -> None:
    text = "INDEX/1\nGOTO/1,0,0\nINDEX/2\nGOTO/2,0,0\nCOPY/2,SAME,1\nCOPY/1,TRANSL,0,1,0,1\nGOTO/9,9,9"
    assert ends(unrolled(text))[:, :2].tolist() == [[1, 0], [2, 0], [2, 0], [1, 1], [2, 1], [2, 1], [9, 9]]
    for plain in ("INDEX/5\nGOTO/1,2,3", "GOTO/1,2,3\r\nINDEX\r\nFINI\r\nCOPY/1,SAME,1\r\n", ""):
        assert unrolled(plain) == plain.encode()


def test_lines_that_are_broken_and_words_that_stay() -> None:
    text = "INDEX/1\r\nGOTO / 1.50, $\r\n 2.$\r\n0, 3\r\nFEDRAT/90,MMPM\r\nCOPY/1,TRANSL,10,0,0,1\r\n"
    written = unrolled(text)
    assert written == text.encode().split(b"COPY")[0].replace(b"INDEX/1\r\n", b"") + (
        b"GOTO / 11.50, $\r\n 2.$\r\n0, 3\r\nFEDRAT/90,MMPM\r\n"
    )


@pytest.mark.parametrize(
    ("text", "line", "code", "words"),
    [
        ("COPY/1,SAME,1", 1, "OLP532", "COPY/1 has no INDEX/1 before it"),
        ("INDEX/2\nGOTO/1,2,3\nCOPY/1,SAME,1", 3, "OLP532", "COPY/1 has no INDEX/1"),
        ("INDEX/1\nGOTO/1,2,3\nCOPY/1,SAME", 3, "OLP516", "COPY has no number of copies"),
        ("INDEX/1\nGOTO/1,2,3\nCOPY/1,SAME,1.5", 3, "OLP516", "COPY has no number of copies"),
        ("INDEX/1\nGOTO/1,2,3\nCOPY/1,MODIFY,M1,2", 3, "OLP523", "does not state its transform in numbers"),
        (
            "INDEX/1\nTRANS/1,2,3\nGOTO/1,2,3\nCOPY/1,XYROT,5,2",
            2,
            "OLP518",
            "TRANS is in the range of a COPY",
        ),
        ("INDEX/1\nGODLTA/5\nCOPY/1,YZROT,5,2", 2, "OLP518", "GODLTA has one number"),
        ("INDEX/1\nGOTO/1,2,3\nCOPY/1,SAME,99999999", 3, "OLP543", "the copies are more than"),
    ],
)
def test_refusals(text: str, line: int, code: str, words: str) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        unrolled(text + "\n")
    assert (caught.value.line, caught.value.code) == (line, code)


def test_cycles_are_not_expanded() -> None:
    with pytest.raises(UsageError, match="leave --expand-cycles out"):
        unrolled("GOTO/1,2,3\n", expand_cycles=True)


def test_a_program_with_copies_says_what_to_do_and_is_corrected_with_it(zero: Path, tmp_path: Path) -> None:
    text = f"PARTNO A\nUNITS/MM\nLOADTL/1\nRAPID\nGOTO/0,0,50\nINDEX/1\n{RANGE}COPY/1,TRANSL,0,30,0,2\nFINI\n"
    with pytest.raises(ProgramError, match="COPY repeats the moves since INDEX; unroll") as caught:
        read(text.encode(), load_setup(zero), APT)
    assert (caught.value.line, caught.value.code) == (12, "OLP511")
    with pytest.raises(ProgramError, match="unroll the program with --flatten"):
        olp.correct(text.encode(), zero)
    assert olp.correct(text.encode(), zero, flatten=True).data == unrolled(text)
    bent = machines.random_machine(tmp_path, 7, RECIPE)
    result = olp.correct(text.encode(), bent, flatten=True)
    assert result.report["deviation"]["holds"]
    assert olp.verify(text.encode(), result.data, bent, flatten=True).report["deviation"]["holds"]
