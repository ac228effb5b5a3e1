"""Jobs of INFORM on three linear axes: read and corrected as a judge that shares nothing with it says."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from judge import inform, machines
from judge.machines import Recipe
from judge.model import JudgeModel

import olp
from olp.core.errors import OlpError, ProgramError

FRAMES = {1: (300.0, 250.0, -300.0, 25.0), 2: (350.0, 200.0, -250.0, 0.0)}
RECIPE = Recipe(
    controller="yaskawa-inform", job_defaults={},
    work_offsets={
        f"UF{n}": {"X_mm": x, "Y_mm": y, "Z_mm": z, "C_deg": c, "set_by": "true"}
        for n, (x, y, z, c) in FRAMES.items()
    },
)  # fmt: skip
LEVER = np.array([0.0, 0.0, -120.0])
#: rounding of the third decimal, mm
DIGIT = 0.5e-3
HEADER = "///USER {}\n///TOOL 1\n///POSTYPE USER\n///RECTAN\n///RCONF 1,0,0,0,0,0,0,0"


def job(positions: list[str], moves: list[str], count: str = "") -> bytes:
    taught = [
        sum(position.split("\n")[-1].startswith(kind) for position in positions)
        for kind in ("C", "BC", "EC", "P")
    ]
    count = count or "{},{},{},{},0,0".format(*taught)
    head = ["/JOB", "//NAME T", "//POS", f"///NPOS {count}", *positions, "//INST", "///GROUP1 RB1", "NOP"]
    return "\r\n".join([*head, *moves, "END", ""]).replace("\r\n", "\n").replace("\n", "\r\n").encode()


def position(name: str, point: list[float], frame: int = 1, turn: str = "180.0000,0.0000,30.0000") -> str:
    return f"{HEADER.format(frame)}\n{name}={','.join(f'{v:.3f}' for v in point)},{turn}"


def program(rng: np.random.Generator, count: int) -> bytes:
    """Moves to shared positions of two frames, taught ones and variables."""
    points = rng.uniform(-60, 60, (count, 3)).round(1).tolist()
    names = [f"C{k:05d}" for k in range(count - 4)] + [f"P{k:05d}" for k in range(4)]
    positions = [
        position(name, point, 1 + k % 2) for k, (name, point) in enumerate(zip(names, points, strict=True))
    ]
    moves = []
    for _ in range(count):
        name = names[rng.integers(count)]
        shown = name if name[0] == "C" else f"P{int(name[1:]):03d}"
        moves.append(
            f"MOVL {shown} V=200.0 PL={rng.integers(3)}" if rng.random() < 0.7 else f"MOVJ {shown} VJ=50.00"
        )
    return job(positions, moves)


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.random_machine(tmp_path_factory.mktemp("bent"), 8, RECIPE)


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.zero_machine(tmp_path_factory.mktemp("zero"), RECIPE)


def world(move: inform.Move) -> np.ndarray:
    x, y, z, c = FRAMES[int(move.header["USER"])]
    cosine, sine = np.cos(np.radians(c)), np.sin(np.radians(c))
    return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]]) @ move.numbers[:3] + (x, y, z)


@pytest.mark.parametrize("seed", range(3))
def test_each_position_is_where_the_judge_wants_it(bent: Path, zero: Path, seed: int) -> None:
    text = program(np.random.default_rng(seed), 25)
    assert olp.correct(text, zero).data == text
    done = olp.correct(text, bent)
    assert done.report["verdict"]["ok"]
    nominal, written, model = inform.moves(text), inform.moves(done.data), JudgeModel(bent)
    stated, own = inform.counts(done.data)
    assert stated == own > inform.counts(text)[0], "long moves are split"
    place = 0
    for k, move in enumerate(nominal):
        tip, start = world(move), world(nominal[k - 1])
        want = model.command_for(tip[None], LEVER)[0]
        while np.abs(world(written[place]) - want).max() > 2 * DIGIT:
            here = world(written[place])
            actual = here + model.error_mm(here[None], LEVER)[0]
            share = np.clip((actual - start) @ (tip - start) / max((tip - start) @ (tip - start), 1e-9), 0, 1)
            assert np.linalg.norm(start + share * (tip - start) - actual) < 1e-3 + 2 * DIGIT
            assert written[place].tail.split()[0] == move.tail.split()[0]
            assert not re.search(r"PL=0", written[place].tail)
            place += 1
        place += 1
    assert place == len(written)
    numbers = re.findall(rb"(?m)^C(\d+)=", done.data)
    assert numbers == sorted(numbers), "taught positions stay in their order"


def test_a_position_that_moves_want_to_differ_is_cloned(tmp_path: Path) -> None:
    """Reached from both sides of the backlash of X: the clone has the header of the position."""
    path = machines.random_machine(tmp_path, 8, replace(RECIPE, backlash_um={"X": 40.0}))
    positions = [
        position("C00000", [-60, 10, 0]),
        position("C00001", [0, 20, 5]),
        position("C00002", [60, 10, 0], 2),
    ]
    names = ("C00000", "C00001", "C00002", "C00001")
    data = olp.correct(job(positions, [f"MOVL {name} V=20.0" for name in names]), path).data
    own = [
        move
        for move in inform.moves(data)
        if abs(move.numbers[1] - 20.0) < 1.0 and move.header["USER"] == "1"
    ]
    ends = {move.name: move.numbers for move in own if abs(move.numbers[0]) < 1.0}
    assert len(ends) == 2 and "C00001" in ends
    one, other = ends.values()
    assert 0.03 < np.abs(one - other)[0] < 0.05
    assert np.abs(one - other)[3:].max() == 0.0
    stated, counted = inform.counts(data)
    assert stated == counted


def test_axes_beside_the_robot_are_stated_for_each_part(bent: Path) -> None:
    positions = [position("C00000", [-60, -60, 0]), position("C00001", [60, 60, 20]), "BC00000=5.000",
                 "BC00001=5.000", "///POSTYPE PULSE\n///PULSE\nEC00000=10,20", "EC00001=10,20"]  # fmt: skip
    moves = [
        f"MOV{w} C0000{k} BC0000{k} V{s}  +MOVJ EC0000{k}"
        for k, (w, s) in enumerate([("J", "J=5.00"), ("L", "=20.0 PL=0")])
    ]
    text = olp.correct(job(positions, moves), bent).data.decode()
    written = [line for line in text.splitlines() if line.startswith("MOVL")]
    assert len(written) > 1
    for line in written:
        c, bc, ec = re.fullmatch(r"MOVL C(\d+) BC(\d+) V=20.0 PL=\d  \+MOVJ EC(\d+)", line).groups()
        assert c == bc == ec
        assert f"BC{c}=5.000" in text and f"EC{c}=10,20" in text
    assert f"///NPOS {len(written) + 1},{len(written) + 1},{len(written) + 1},0,0,0" in text
    for own, other in (("BC00001=5.000", "BC00001=6.000"), ("EC00001=10,20", "EC00001=10,21")):
        assert (
            olp.correct(job(positions, moves).replace(own.encode(), other.encode()), bent).data.count(b"MOVL")
            == 1
        )


def test_counts_that_are_wrong_stay(bent: Path) -> None:
    positions = [position("C00000", [-60, -60, 0]), position("C00001", [60, 60, 20])]
    text = olp.correct(job(positions, ["MOVJ C00000 VJ=5", "MOVL C00001 V=5.0"], "7,0,0,0,0,0"), bent).data
    assert b"///NPOS 7,0,0,0,0,0" in text
    assert text.count(b"MOVL") > 1


P1, P2 = position("P00001", [10, 20, 30]), position("P00002", [20, 20, 30])


@pytest.mark.parametrize(
    ("statements", "kept"),
    [
        (["MOVL P002 V=5.0"], False),
        (["SETE P002 (1) D001", "MOVL P002 V=5.0"], True),
        (["SET P001 P002", "MOVL P002 V=5.0"], True),
        (["MOVL P002 V=5.0", "ADD P002 P001"], True),
        (["SET P[I001] P001", "MOVL P002 V=5.0"], True),
        (["GETS PX002 $PX000", "MOVL P002 V=5.0"], True),
        (["GETS PX003 $PX002", "MOVL P002 V=5.0"], False),
        (["SFTON P001", "MOVL P002 V=5.0", "SFTOF"], True),
        (["SFTON P001", "SFTOF", "MOVL P002 V=5.0"], False),
        (["COMARCON AMP=1.0", "MOVL P002 V=5.0", "COMARCOF"], True),
        (["*A", "MOVL P002 V=5.0", "SFTON P001", "JUMP *A IF IN#(1)=ON", "SFTOF"], True),
        (["JUMP *A", "SFTON P001", "RET", "*A", "MOVL P002 V=5.0"], False),
        (["SFTON P001", "RET IF IN#(1)=ON", "MOVL P002 V=5.0"], True),
        (["SFTON P001", "IFTHENEXP B000=1", "SFTOF", "ENDIF", "MOVL P002 V=5.0"], True),
        (["SFTON P001", "IFTHENEXP B000=1", "SFTOF", "ELSE", "SFTOF", "ENDIF", "MOVL P002 V=5.0"], True),
        (["IFTHENEXP B000=1", "SFTON P001", "ELSE", "MOVL P002 V=5.0", "ENDIF", "SFTOF"], False),
        (["WHILEEXP B000=1", "MOVL P002 V=5.0", "SFTON P001", "ENDWHILE"], True),
        (["WHILEEXP B000=1", "SFTON P001", "SFTOF", "ENDWHILE", "MOVL P002 V=5.0"], False),
        (["REFP 1 P002", "MOVL P002 V=5.0"], False),
        (["'SET P002 P001", "MOVL P002 V=5.0  //SFTON"], False),
    ],
)
def test_moves_to_what_the_run_decides_are_left(tmp_path: Path, statements: list[str], *, kept: bool) -> None:
    path = machines.shift_machine(tmp_path, (100.0, 0.0, 0.0), recipe=RECIPE)
    data = olp.correct(job([P1, P2], ["MOVJ P001 VJ=5.00", *statements]), path).data
    assert (b"P00002=20.000," in data) is kept


@pytest.mark.parametrize(
    ("statements", "told"),
    [
        (["IFTHENEXP B000=1", "MOVJ P001 VJ=5.00", "ENDIF"], True),
        (["IFTHENEXP B000=1", "DOUT OT#(1) ON", "ENDIF"], False),
        (["CALL JOB:OTHER"], True),
        (["TIMER T=0.50", "ARCON", "SET B000 5", "WAIT IN#(1)=ON T=5.00"], False),
        (["*LABEL"], True),
        (["IMOV LP000 V=201.0"], True),
        (["MOVJ EC00000 VJ=90.0"], False),
        (["MOVJ P001 T0000 VJ=50.00"], False),
        (["MOVJ P001 VJ=5.00 UNTIL IN#(1)=ON"], True),
        (["MOVL P001 V=5.0 SRCH RIN#(1)=ON T=0.10 DIS=5.0"], True),
        (["FOR I000=1 TO 3", "MOVL P001 V=5.0", "NEXT I000"], True),
    ],
)
def test_where_moves_begin(zero: Path, statements: list[str], *, told: bool) -> None:
    result = olp.correct(job([P1, P2], ["MOVJ P001 VJ=5.00", *statements, "MOVL P002 V=5.0"]), zero)
    assert any("depends on the run" in finding.message for finding in result.findings) is told


@pytest.mark.parametrize(
    ("positions", "move", "why"),
    [
        ([], "MOVL C00009 V=5.0", "the position C00009 is not stated"),
        ([P1, P1], "MOVL P001 V=5.0", "the position P001 is stated twice"),
        ([P1], "MOVS P001 V=5.0", "MOVS is a spline"),
        ([P1], "SMOVS P001 V=5.0", "SMOVS counts from a positioner"),
        ([P1], "MOVL P001 V=5.0 +MOVL P001", "`.MOVL` behind a move is not read"),
        ([P1.replace("USER\n", "MTOOL\n")], "MOVL P001 V=5.0", "of ///POSTYPE MTOOL; expected PULSE, BASE"),
        ([P1.replace("RECTAN", "PULSE")], "MOVL P001 V=5.0", "which contradict each other"),
        ([P1.replace("///USER 1\n", "")], "MOVL P001 V=5.0", "no ///USER names it"),
        ([P1.replace("USER 1", "USER 7")], "MOVL P001 V=5.0", "UF7"),
        ([P1.replace("TOOL 1", "TOOL 0")], "MOVL P001 V=5.0", r"give \[tools.0\]"),
        ([P1.replace("///TOOL 1\n", "")], "MOVL P001 V=5.0", "names no tool; state ///TOOL"),
        ([P1.replace(",30.0000", ",x")], "MOVL P001 V=5.0", "in another form"),
        ([P1], "MOVL P001 BC00001 V=5.0", "BC00001 is not stated once"),
    ],
)
def test_what_is_not_certain_is_refused_with_its_line(
    zero: Path, positions: list[str], move: str, why: str
) -> None:
    text = job(positions, ["'x", move])
    with pytest.raises(OlpError, match=why) as error:
        olp.correct(text, zero)
    assert isinstance(error.value, ProgramError)
    assert error.value.line == text[: text.index(move.encode())].count(b"\n") + 1


ARC = [
    position(f"C{k:05d}", point)
    for k, point in enumerate([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0], [70.0, 20.0, 5.0], [50.0, 40.0, 0.0]])
]
RUN = ["MOVJ C00000 VJ=50.00", "MOVC C00001 V=90.0", "MOVC C00002 V=90.0", "MOVC C00003 V=90.0"]


@pytest.mark.parametrize(
    ("moves", "line", "why"),
    [
        (RUN[:3], 0, "in a run of three"),
        ([*RUN, "DOUT OT#(1) ON", "MOVC C00000 V=90.0"], 0, "in a run of three"),
        ([RUN[0], "*A", *RUN[1:]], 1, "in a run of three"),
        ([*RUN[:3], "CALL JOB:X", RUN[3]], 0, "in a run of three"),
        ([*RUN, "*A", *RUN[1:]], 0, "in a run of three"),
        (RUN[1:], -1, "in a run of three"),
        ([*RUN[:3], RUN[3] + " UNTIL IN#(1)=ON"], 0, "may end before its point"),
        ([RUN[0], *(f"S{move}" for move in RUN[1:])], 0, "SMOVC counts from a positioner"),
        ([*RUN[:3], RUN[3] + "  +MOVJ EC00001"], 0, "a positioner may move"),
        ([*RUN[:3], RUN[3] + "  +MOVJ LEX000"], 0, "a positioner may move"),
    ],
)
def test_arcs_that_are_not_followed_are_corrected_at_their_points(
    bent: Path, moves: list[str], line: int, why: str
) -> None:
    positions = [*ARC, "///POSTYPE PULSE\n///PULSE\nEC00001=5"]
    text = job(positions, moves)
    done = olp.correct(text, bent)
    place = text[: text.index(b"NOP")].count(b"\n") + 3 + line
    assert any(why in finding.message and finding.lines[0] == place for finding in done.findings)
    nominal, written, model = inform.moves(text), inform.moves(done.data), JudgeModel(bent)
    assert len(written) == len(nominal), "nothing is split"
    for move, own in zip(nominal, written, strict=True):
        want = model.command_for(world(move)[None], LEVER)[0]
        assert np.abs(world(own) - want).max() < 2 * DIGIT


def test_an_arc_through_a_point_that_is_left_stays_as_it_is(tmp_path: Path) -> None:
    """Others would be moved away from that one: behind a label, and where another move goes there, too."""
    path = machines.shift_machine(tmp_path, (100.0, 0.0, 0.0), recipe=RECIPE)
    moves = ["MOVJ C00003 VJ=5.00", *RUN[1:2], "MOVC P001 V=90.0", "*A", *RUN[3:]]
    text = job(ARC, moves)
    done = olp.correct(text, path)
    assert any("left as written: the text does not state P001" in f.message for f in done.findings)
    nominal, written = inform.moves(text), inform.moves(done.data)
    assert [own.name for own in written] == ["C00004", "C00001", "C00003"]
    shifts = [np.abs(own.numbers - move.numbers).max() for move, own in zip(nominal, written, strict=True)]
    assert shifts[0] > 0.05
    assert shifts[1:] == [0.0, 0.0]


def test_words_of_an_arc_that_are_not_known_are_refused(zero: Path) -> None:
    text = job(ARC, [*RUN[:3], RUN[3] + " FPT"])
    with pytest.raises(ProgramError, match="`FPT` behind a move is not read") as error:
        olp.correct(text, zero)
    assert error.value.line == text[: text.index(b" FPT")].count(b"\n") + 1


@pytest.mark.parametrize(
    ("before", "split"),
    [
        (["MOVJ C00000 VJ=5.00  +MOVJ EC00001"], True),
        (["MOVJ C00000 VJ=5.00  +MOVJ EC00000"], False),
        (["MOVJ C00000 VJ=5.00  +MOVJ EC00001", "MOVJ EC00000 VJ=5.00  +MOVJ EX00001"], False),
        (["MOVJ C00000 VJ=5.00  +MOVJ EC00001", "CALL JOB:X"], False),
        (["MOVJ C00000 VJ=5.00  +MOVJ LEX000"], False),
        (["MOVJ C00000 VJ=5.00  +MOVJ EC00001", "MOVJ C00002 VJ=5.00  +MOVJ LEX000"], False),
        (["MOVJ C00000 VJ=5.00  +MOVJ EC00001", "MOVL C00002 V=5.0"], True),
    ],
)  # fmt: skip
def test_the_path_of_smovl_is_straight_where_the_positioner_stands(
    bent: Path, before: list[str], *, split: bool
) -> None:
    points = [[-60.0, -60.0, 0.0], [60.0, 60.0, 20.0], [-60.0, 0.0, 0.0]]
    positions = [position(f"C{k:05d}", point) for k, point in enumerate(points)]
    positions += ["///POSTYPE PULSE\n///PULSE\nEC00000=10", "EC00001=20"]
    text = job(positions, [*before, "SMOVL C00001 V=20.0  +MOVJ EC00001"])
    done = olp.correct(text, bent)
    assert (done.data.count(b"SMOVL") > 1) is split
    assert any("the path counts from it" in finding.message for finding in done.findings) is not split
    assert done.report["verdict"]["ok"]
    last, model = inform.moves(done.data)[-1], JudgeModel(bent)
    want = model.command_for(world(inform.moves(text)[-1])[None], LEVER)[0]
    assert np.abs(world(last) - want).max() < 2 * DIGIT


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("///USER 1", "///USER 2", "have different frames or tools"),
        ("///RCONF 1,0,0", "///RCONF 1,0,1", "have different postures"),
        ("30.0000", "31.0000", "at the via point the tool is turned by 17.5 mrad"),
    ],
)
def test_points_of_an_arc_that_differ_are_refused(zero: Path, old: str, new: str, why: str) -> None:
    positions = [*ARC[:2], ARC[2].replace(old, new), ARC[3]]
    with pytest.raises(ProgramError, match=why):
        olp.correct(job(positions, RUN), zero)


def test_what_is_said_at_the_via_point_of_an_arc_is_kept(tmp_path: Path) -> None:
    """A stop there, another speed, or a statement behind it: the arc is not split. A level at the end is."""
    bent = machines.random_machine(tmp_path, 7, RECIPE)
    for via, between in ((" PL=0", []), (" ACC=50", []), ("", ["ARCOF"])):
        with pytest.raises(ProgramError, match="post it as shorter arcs"):
            olp.correct(job(ARC, [*RUN[:2], RUN[2] + via, *between, RUN[3]]), bent)
    moves = [*RUN[:2], "ARCON", RUN[2] + " PL=2", RUN[3] + " PL=0"]
    text = job([position("C00000", [-60.0, -60.0, -20.0]), *ARC[1:]], moves)
    data = olp.correct(text, bent).data
    assert data.index(b"MOVL C00007 V=90.0\r\n") < data.index(b"MOVC"), "the way to the arc is straight"
    assert inform.counts(data)[0] == inform.counts(data)[1] > 4
    tails = [move.tail for move in inform.moves(data)][3:]
    assert len(tails) > 2
    assert tails == ["V=90.0 PL=2"] * (len(tails) - 1) + ["V=90.0 PL=0"]
    assert data.index(b"ARCON") < data.index(b"MOVC C00004")
    assert olp.verify(text, data, bent).report["verdict"]["ok"]


def test_ends_of_files_as_pendants_write_them(zero: Path, tmp_path: Path) -> None:
    text = job([P1, P2], ["MOVJ P001 VJ=5.00", "MOVL P002 V=5.0"]) + b"\x1a\0\0"
    assert olp.correct(text, zero).data == text
    shifted = machines.shift_machine(tmp_path, (100.0, 0.0, 0.0), recipe=RECIPE)
    assert olp.correct(text, shifted).data.endswith(b"END\r\n\x1a\0\0")
