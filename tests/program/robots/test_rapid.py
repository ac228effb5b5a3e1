"""RAPID on three linear axes: read and corrected as a judge that shares nothing with it says."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from judge import machines, rapid
from judge.machines import Recipe
from judge.model import JudgeModel

import olp
from olp.core.errors import OlpError, ProgramError

RECIPE = Recipe(controller="abb-rapid", tools={}, job_defaults={}, work_offsets={})
#: rounding of the fourth decimal, mm
DIGIT = 0.5e-4
HEAD = """MODULE Made
PERS tooldata grip:=[TRUE,[[10,-5,120],[0.996194698,0,0.087155743,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
PERS wobjdata part:=[FALSE,TRUE,"",[[300,250,-300],[0.965925826,0,0,0.258819045]],[[5,6,7],[1,0,0,0]]];
"""
TAIL = "[0.1,0.3,0.9,0.3],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
MACHINE_TAIL = b"ENDPROC\nENDMODULE\n"


def program(rng: np.random.Generator, count: int) -> bytes:
    """Moves to declared targets, some of them shared, inline ones, Offs and RelTool."""
    named = rng.uniform(-40, 40, (6, 3)).round(3)
    lines = [f"CONST robtarget p{k}:=[[{x},{y},{z}],{TAIL};" for k, (x, y, z) in enumerate(named.tolist())]
    lines.append("PROC main()")
    for _ in range(count):
        x, y, z = rng.uniform(-60, 60, 3).round(2).tolist()
        name = f"p{rng.integers(6)}"
        target = [
            name,
            f"[[{x},{y},{z}],{TAIL}",
            f"Offs({name},{x},{y},{z})",
            f"RelTool({name},{x},{y},{z}\\Rz:=30)",
        ][rng.integers(4)]
        move = "MoveL" if rng.random() < 0.7 else "MoveJ"
        zone = rng.choice(["fine", "z10"])
        lines.append(f"  {move} {target}, v{rng.integers(50, 500)},{zone},grip\\WObj:=part;")
    return HEAD.encode() + "\n".join(lines).encode() + b"\n" + MACHINE_TAIL


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.random_machine(tmp_path_factory.mktemp("bent"), 7, RECIPE)


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.zero_machine(tmp_path_factory.mktemp("zero"), RECIPE)


def ends(nominal: list[rapid.RobotMove], written: list[rapid.RobotMove], model: JudgeModel) -> list[int]:
    """The written move with which each nominal one ends: the first one that is where it has to be."""
    place, found = 0, []
    for move in nominal:
        want = model.command_for(move.tip[None], move.lever)[0]
        while np.abs(written[place].tip - want).max() > 2 * DIGIT:
            place += 1
            assert place < len(written), "a target is not reached"
        found.append(place)
        place += 1
    assert place == len(written)
    return found


@pytest.mark.parametrize("seed", range(4))
def test_each_target_is_where_the_judge_wants_it(bent: Path, zero: Path, seed: int) -> None:
    text = program(np.random.default_rng(seed), 40)
    assert olp.correct(text, zero).data == text
    done = olp.correct(text, bent)
    assert done.report["verdict"]["ok"]
    nominal, written, model = rapid.moves(text), rapid.moves(done.data), JudgeModel(bent)
    groups = ends(nominal, written, model)
    begin = -1
    for k, (move, last) in enumerate(zip(nominal, groups, strict=True)):
        for part in written[begin + 1 : last + 1]:
            assert np.abs(part.turn - move.turn).max() < 1e-6 or not move.straight
            actual = part.tip + model.error_mm(part.tip[None], move.lever)[0]
            start = nominal[k - 1].tip
            way = move.tip - start
            share = np.clip((actual - start) @ way / max(way @ way, 1e-9), 0, 1)
            assert np.linalg.norm(start + share * way - actual) < 1.0e-3 + DIGIT
        begin = last
    assert len(written) > len(nominal), "long moves are split"


def test_a_target_is_cloned_only_where_its_moves_differ(bent: Path) -> None:
    body = (
        f"CONST robtarget a:=[[1,2,3],{TAIL}; ! kept\nLOCAL VAR robtarget b:=[[4,5,6],{TAIL};\nPROC main()\n"
        "MoveJ a,v100,fine,grip\\WObj:=part;\nMoveJ a,v50,z1,grip\\WObj:=part;\n"
        "MoveJ b,v100,fine,grip\\WObj:=part;\nMoveJ b,v100,fine,tool0\\WObj:=part;\n"
        "MoveJ Offs(a,90,0,0),v100,fine,grip\\WObj:=part;\n"
    )
    text = olp.correct(HEAD.encode() + body.encode() + MACHINE_TAIL, bent).data.decode()
    assert "a_olp1" not in text
    assert "; ! kept\n" in text
    assert text.count("LOCAL VAR robtarget b") == 2
    assert "MoveJ b_olp1,v100,fine,tool0" in text
    # the shift of a move takes up its own correction
    assert re.search(r"Offs\(a,(89|90)\.\d{4},-?0\.\d{4},-?0\.\d{4}\)", text)


def test_parts_of_a_move_pass_without_a_stop(bent: Path) -> None:
    body = (
        f"PROC main()\nMoveJ [[-60,-60,0],{TAIL},v100,fine,grip\\WObj:=part;\n"
        f"MoveL [[60,60,20],{TAIL},v100,fine,grip\\WObj:=part;\n"
    )
    text = olp.correct(HEAD.encode() + body.encode() + MACHINE_TAIL, bent).data.decode()
    parts = [line for line in text.splitlines() if line.startswith("MoveL")]
    assert len(parts) > 1
    assert all(",v100,z0,grip" in line for line in parts[:-1])
    assert ",v100,fine,grip" in parts[-1]


REFUSED = {
    "MoveL CRobT(),v100,fine,tool0;": "computed",
    "MoveL Offs(p,i,0,0),v100,fine,tool0;": "computed",
    "MoveL p,v100,fine,tool0;\np.trans.z:=5;": "another value in line",
    "MoveL gone,v100,fine,tool0;": "not stated in this text",
    "MoveL p,v100,fine,lost;": "does not state the tool lost",
    "MoveL p,v100,fine,tool0\\WObj:=lost;": "lost",
    "MoveL p,v100,fine,still;": "stands still",
    "MoveL p,v100,fine,tool0\\WObj:=held;": "moves",
    "MoveL p,v100,fine,tool0;MoveC p,v100,fine,tool0;": "expected via point",
    "CirPathMode\\CirPointOri;MoveL p,v1,fine,tool0;MoveC p,p,v1,fine,tool0;": "CirPathMode.CirPointOri",
    "SearchL x,p,p,v100,tool0;": "p gets another value in line 6",
    "MoveL\\ID:=10,p,v100,fine,tool0;": "another robot moves at the same time",
    "ArcL p,v100,s1,w1,fine,tool0\\Track:=t1;": "a sensor leads the robot",
    "SpotL p,v100,fine,tool0;": "expected target, speed, data of the process, data of the process, tool",
    "NutL p,v100,n1,fine,tool0;": "application package",
    "PDispSet frame1;": "PDISPSET",
    "IF x=1 PDispOn p,tool0;": "IF without THEN",
    "MoveL p,v100,fine,tool0": "semicolon",
    "MoveL [[0,0,0],[1,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;": "quaternion",
}


@pytest.mark.parametrize(("statement", "why"), REFUSED.items())
def test_what_is_not_certain_is_refused_with_its_line(zero: Path, statement: str, why: str) -> None:
    head = (
        f"MODULE m\nCONST robtarget p:=[[0,0,0],{TAIL};\n"
        "PERS tooldata still:=[FALSE,[[0,0,0],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
        'PERS wobjdata held:=[TRUE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\nPROC main()\n'
    )
    with pytest.raises(OlpError, match=why) as error:
        olp.correct(head.encode() + statement.encode() + b"\nENDPROC\nENDMODULE\n", zero)
    assert isinstance(error.value, ProgramError)
    assert error.value.line is not None
    assert 3 <= error.value.line <= 7


def test_frames_and_tools_come_from_program_or_job(tmp_path: Path) -> None:
    job = replace(
        RECIPE,
        work_offsets={"part": {"X_mm": 100.0, "C_deg": 30.0, "set_by": "true"}},
        tools={4: {"name": "grip", "gauge_to_tip_mm": [0.0, 0.0, -120.0]}},
        travel=((-900.0, 900.0),) * 3,
    )
    path = machines.shift_machine(tmp_path, (100.0, 50.0, 20.0), recipe=job)
    move = f"PROC main()\nMoveJ [[1,2,3],{TAIL},v100,fine,grip\\WObj:=part;\n".encode()
    text = olp.correct(b"MODULE m\n" + move + MACHINE_TAIL, path).data
    # error in X and Y, along the axes of a frame that is turned by 30 degrees
    assert b"[[0.8884,2.0067,2.9800]" in text
    with pytest.raises(OlpError, match="frame part is stated by the program and by"):
        olp.correct(HEAD.encode() + move + MACHINE_TAIL, path)
    same = "[[100,0,0],[0.9659258262890683,0,0,0.2588190451025207]],[[0,0,0]"
    own = HEAD.replace("[[300,250,-300],[0.965925826,0,0,0.258819045]],[[5,6,7]", same)
    with pytest.raises(OlpError, match="tool grip is stated by the program and by"):
        olp.correct(own.encode() + move + MACHINE_TAIL, path)


def test_behind_moves_that_may_not_run_only_the_end_is_corrected(bent: Path) -> None:
    body = (
        f"PROC main()\nMoveJ [[-60,-60,0],{TAIL},v100,fine,grip\\WObj:=part;\n"
        f"IF x=1 THEN\nMoveL [[0,0,20],{TAIL},v100,fine,grip\\WObj:=part;\nENDIF\n"
        f"MoveL [[60,60,20],{TAIL},v100,fine,grip\\WObj:=part;\n"
        f"IF x=1 THEN\nSetDO a,1;\nENDIF\nMoveL [[-60,-60,20],{TAIL},v100,fine,grip\\WObj:=part;\n"
    )
    text = olp.correct(HEAD.encode() + body.encode() + MACHINE_TAIL, bent).data.decode()
    lines = text.splitlines()
    second = next(k for k, line in enumerate(lines) if line == "ENDIF")
    assert lines[second + 1].startswith("MoveL [[60.")
    assert lines[second + 2] == "IF x=1 THEN"
    assert lines[second + 5].startswith("MoveL")
    assert not lines[second + 5].startswith("MoveL [[-60.0"), "the last move is split"


@pytest.mark.parametrize("handler", ["ERROR", "ERROR (ERR_A, ERR_B)", "ERROR(ERR_A)"])
def test_the_handler_of_errors_begins_anywhere(bent: Path, handler: str) -> None:
    move = f"MoveL [[%s60,60,20],{TAIL},v100,fine,grip\\WObj:=part;\n"
    body = f"PROC main()\n{move % ''}{handler}\n{move % '-'}RETRY;\nENDPROC\nENDMODULE\n"
    text = olp.correct(HEAD.encode() + body.encode(), bent).data.decode()
    assert text.count("MoveL") == 2, "the move of the handler is not split"
    assert handler in text.splitlines()


#: moves as plain ones, and as those of a process or a signal: same numbers, and data that stay
PROCESSES = [
    (r"MoveL (.*?), v100,z10,(.*?);", r"ArcL \1, v100,seam1,weld1\\Weave:=wv1,z10,\2;"),
    (r"MoveL (.*?), v100,z10,(.*?);", r"ArcL \1, v100,seam1,weld1,wv1,z10,\2;"),
    (r"MoveL (.*?), v100,z10,(.*?);", r"DispL \1, v100,bead1,z10,\2;"),
    (r"MoveL (.*?), v100,z10,(.*?);", r"PaintL \1, v100,z10,\2;"),
    (r"MoveL (.*?), v100,z10,(.*?);", r"CapL \1, v100,c1,ws1,wv1,z10,\2;"),
    (r"MoveL (.*?), v100,z10,(.*?);", r"ArcMoveL \1, v100,z10,\2;"),
    (r"MoveLSync (.*?), v100,z10,(.*?),\"none\";", r"TriggL \1, v100,trig1\\T2:=trig2,z10,\2;"),
    (r"MoveLSync (.*?), v100,z10,(.*?),\"none\";", r"ArcLStart \1, v100,seam1,weld1\\Weave:=w,z10,\2;"),
    (r"MoveLSync (.*?), v100,z10,(.*?),\"none\";", r"SpotL \1, v100,gun1,spot1,\2;"),
    (r"MoveLSync (.*?), v100,z10,(.*?),\"none\";", r"MoveL \1, v100\\T:=3,z10,\2;"),
    (r"MoveJSync (.*?), v100,z10,(.*?),\"none\";", r"SpotJ \1, v100,gun1,spot1,\2;"),
]


@pytest.mark.parametrize(("plain", "process"), PROCESSES)
def test_moves_of_processes_are_corrected_as_plain_ones(bent: Path, plain: str, process: str) -> None:
    move = plain.split()[0]
    sync = ',"none"' if move.endswith("Sync") else ""
    text = HEAD + f"CONST robtarget p:=[[20,30,-5],{TAIL};\nPROC main()\n"
    targets = (f"[[-50,10,0],{TAIL}", "Offs(p,5,6,7)", "p")
    text += "".join(f"  {move} {target}, v100,z10,grip\\WObj:=part{sync};\n" for target in targets)
    text += MACHINE_TAIL.decode()
    as_process, count = re.subn(plain, process, text)
    assert count == len(targets)
    wanted = olp.correct(text.encode(), bent).data.decode()
    written = olp.correct(as_process.encode(), bent).data.decode()
    again = re.sub(r"v100,z0,grip", "v100,z10,grip", wanted)
    ours = re.sub(r",z0,grip", ",z10,grip", written)
    skip = re.compile(r"! olp-corrected.*")
    assert skip.sub("", re.sub(plain, process, again)) == skip.sub("", ours)
    assert written != as_process


def test_a_move_in_a_short_if_is_one_move(bent: Path) -> None:
    """Parts of it would run in any case."""
    text = (
        HEAD
        + f"CONST robtarget p:=[[-300,0,0],{TAIL};\nCONST robtarget q:=[[300,50,0],{TAIL};\nPROC main()\n"
    )
    text += "  MoveL p,v100,fine,grip\\WObj:=part;\n  IF di1=1 MoveL q,v100,fine,grip\\WObj:=part;\n"
    text += "  MoveL p,v100,fine,grip\\WObj:=part;\n"
    done = olp.correct(text.encode() + MACHINE_TAIL, bent)
    assert done.data.count(b"MoveL") == 3
    assert rb"IF di1=1 MoveL q,v100" in done.data
    assert b"q:=[[300,50,0]" not in done.data


PART = HEAD.splitlines()[2].partition(":=")[2]
#: `grip`, `part` and a target are declared without a value, and get one where the program begins
LATER = "PERS tooldata now;\nPERS wobjdata there;\nVAR robtarget a;\nVAR robtarget b;\n"
GIVEN = f"now:=grip;\nthere:={PART}\na:=p;\nb:=[[-9,8,7],{TAIL};\n"
MOVES = "MoveL p,v100,fine,grip\\WObj:=part;\nMoveJ q,v100,z10,grip\\WObj:=part;\n"


def test_data_that_get_their_only_value_later_have_that(bent: Path, zero: Path) -> None:
    stated = f"CONST robtarget p:=[[20,30,-5],{TAIL};\n"
    plain = HEAD + stated + f"CONST robtarget q:=[[-9,8,7],{TAIL};\nPROC main()\n" + MOVES
    moves = MOVES.replace("p,", "a,").replace("q,", "b,").replace("grip", "now").replace("=part", "=there")
    later = (HEAD + LATER + stated + "PROC main()\n" + GIVEN + moves).encode() + MACHINE_TAIL
    assert olp.correct(later, zero).data == later
    want = olp.correct(plain.encode() + MACHINE_TAIL, bent).data.decode()
    done = olp.correct(later, bent).data.decode()
    for own, other in ((r" p:=(.*);", r" p:=(.*);"), (r"\nb:=(.*);", r" q:=(.*);")):
        assert re.findall(own, done) == re.findall(other, want) != re.findall(own, later.decode())
    assert [line for line in done.splitlines() if line.startswith("Move")] == moves.splitlines()


@pytest.mark.parametrize(
    ("declared", "given", "moved"),
    [
        (f"VAR robtarget a:=[[1,2,3],{TAIL};", "a:=p;", "a"),
        ("VAR robtarget a;", "a:=p;\na:=q;", "a"),
        ("VAR robtarget a;", "a:=Offs(p,1,2,3);", "a"),
        ("VAR robtarget a;\nVAR robtarget b;", "a:=b;\nb:=a;", "a"),
        ("VAR robtarget a;", "a:=p;\na.trans.z:=3;", "a"),
        (f"VAR robtarget a:=[[1,2,3],{TAIL};", "Add a.trans.z,5;", "a"),
        (f"VAR robtarget a:=[[1,2,3],{TAIL};", "Teach 1,a.trans.x\\Slow;", "a"),
        (f"VAR robtarget a:=[[1,2,3],{TAIL};", "ok:=StrToVal(s,a.trans.x);", "a"),
        (f"VAR robtarget a:=[[1,2,3],{TAIL};", "IF StrToVal(StrPart(s,1,3),a) THEN\nENDIF", "a"),
        (f"VAR robtarget a{{1}}:=[[[1,2,3],{TAIL}];", "a{i{1}}.trans.x:=5;", "a{1}"),
        (
            f"FUNC num f(num k,INOUT num v)\nENDFUNC\nVAR robtarget a:=[[1,2,3],{TAIL};",
            "IF f(1,a.trans.z)>3 RETURN;", "a",
        ),
    ],
)  # fmt: skip
def test_data_that_may_have_another_value_are_refused(
    zero: Path, declared: str, given: str, moved: str
) -> None:
    text = f"{HEAD}{declared}\nCONST robtarget p:=[[1,2,3],{TAIL};\nCONST robtarget q:=[[4,5,6],{TAIL};\n"
    text += f"PROC main()\n{given}\nMoveJ {moved},v100,fine,tool0;\n"
    with pytest.raises(ProgramError, match="gets another value in line"):
        olp.correct(text.encode() + MACHINE_TAIL, zero)


def test_a_function_that_takes_a_component_by_value_changes_nothing(zero: Path) -> None:
    text = f"{HEAD}VAR robtarget a:=[[250,200,-100],{TAIL};\nFUNC num f(num k,num v)\nENDFUNC\nPROC main()\n"
    text += "SetAO ao,a.trans.x;\nb:=f(1,a.trans.z);\nMoveJ a,v100,fine,tool0;\n"
    assert olp.correct(text.encode() + MACHINE_TAIL, zero).report["moves"]["total"] == 1


def test_a_target_of_another_routine_is_not_named_where_nothing_sees_it(zero: Path) -> None:
    text = f"{HEAD}VAR robtarget a;\nPROC set()\nVAR robtarget p:=[[1,2,3],{TAIL};\na:=p;\nENDPROC\n"
    text += "PROC main()\nset;\nMoveJ a,v100,fine,tool0;\n"
    with pytest.raises(ProgramError, match="a gets another value in line 7"):
        olp.correct(text.encode() + MACHINE_TAIL, zero)


def test_places_for_statements_move_nothing(bent: Path) -> None:
    text = HEAD + f"CONST robtarget p:=[[20,30,-5],{TAIL};\n%sPROC main()\n{MOVES.splitlines()[0]}\n%s"
    full, bare = (
        olp.correct((text % own).encode() + MACHINE_TAIL, bent).data
        for own in (("<DDN>\n", "  <SMT>\n"), ("", ""))
    )
    skip = re.compile(rb"! olp-corrected.*")
    assert skip.sub(b"", full.replace(b"<DDN>\n", b"").replace(b"  <SMT>\n", b"")) == skip.sub(b"", bare)


def test_strings_in_the_lines_of_blocks_hold_anything(tmp_path: Path) -> None:
    path = machines.shift_machine(tmp_path, (100.0, 0.0, 0.0), recipe=RECIPE)
    body = (
        'TEST c\nCASE ";","!":\nMoveJ p,v100,fine,tool0;\nCASE ":":\nStop;\nENDTEST\n'
        'IF c="x" THEN\nELSEIF c=";" THEN\nStop;\nENDIF\nWHILE c<>"DO ;" DO\nENDWHILE\n'
    )
    text = f"MODULE m\nCONST robtarget p:=[[10,20,-30],{TAIL};\nPROC main()\n{body}"
    assert b"p:=[[9.9000,20,-30]" in olp.correct(text.encode() + MACHINE_TAIL, path).data
