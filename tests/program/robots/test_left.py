"""Moves about which the run decides are left as written, and so is what they go by."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from judge import machines
from judge.arm import Arm, quaternion
from judge.arm_files import MACHINE, arm_files
from judge.machines import Recipe

import olp
from olp.core.errors import ProgramError

QUIET: dict[str, dict[str, object]] = {"tools": {}, "job_defaults": {}, "work_offsets": {}}
POSE = "[[250,200,-100],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
RAPID = f"""MODULE Made
  CONST robtarget p10:={POSE};
  CONST robtarget p20:=[[350,200,-100],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  VAR num deep;
  PROC main()
    MoveL p10,v100,fine,tool0;
    MoveL Offs(p10,0,0,10*(deep+(1))),v100,fine,tool0;
    MoveL p20,v100,fine,tool0;
  ENDPROC
ENDMODULE
"""
KRL = """DEF made()
  $BASE=$NULLFRAME
  $TOOL=$NULLFRAME
  LIN XP1
  XP3=XP1
  XP3.Z=XP3.Z+10
  LIN XP3
  LIN XP2
END
DEFDAT made
DECL E6POS XP1={X 250,Y 200,Z -100,A 0,B 0,C 0}
DECL E6POS XP2={X 350,Y 200,Z -100,A 0,B 0,C 0}
DECL E6POS XP3
ENDDAT
"""
SCRIPT = """def made():
  set_tcp(p[0,0,0,0,0,0])
  P1=p[0.25,0.2,-0.1,0,0,0]
  P2=p[0.35,0.2,-0.1,0,0,0]
  movel(P1,a=1,v=0.1)
  movel(pose_add(P1,shift),a=1,v=0.1)
  movel(P2,a=1,v=0.1)
end
"""
PLACE = "X = {} mm, Y = 200.0 mm, Z = -100.0 mm,\n\tW = 0.0 deg, P = 0.0 deg, R = 0.0 deg"
TP = "/PROG MADE\n/MN\n"
for _number, _move in enumerate(("P[1]", "PR[3]", "P[2]", "PR[R[4]]"), 1):
    TP += f"  {_number}:L {_move} 100mm/sec FINE ;\n"
TP += "  5:  PR[3]=P[1] ;\n/POS\n"
for _number in (1, 2):
    TP += f"P[{_number}]{{\n GP1:\n\tUF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',\n"
    TP += f"\t{PLACE.format(150.0 + 100 * _number)}\n}};\n"
TP += "/END\n"
#: By language: the control, the text, and the line whose target a left move goes by.
TEXTS = {
    "rapid": ("abb-rapid", RAPID, "CONST robtarget p10:="),
    "krl": ("kuka-krl", KRL, "DECL E6POS XP1="),
    "ur": ("urscript", SCRIPT, "P1=p["),
    "tp": ("fanuc-tp", TP, "P[1]{"),
}


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("bent")
    return {
        key: machines.random_machine(folder / key, 7, Recipe(controller=name, **QUIET))
        for key, (name, *_) in TEXTS.items()
    }


@pytest.mark.parametrize("key", TEXTS)
def test_what_a_left_move_goes_by_keeps_its_bytes(bent: dict[str, Path], key: str) -> None:
    _, text, head = TEXTS[key]
    done = olp.correct(text.encode(), bent[key])
    written = done.data.decode()
    told = [finding["message"] for finding in done.report["findings"]]
    assert any("left as written" in message for message in told)
    begin = text.index(head)
    whole = text[begin : text.index("};" if key == "tp" else "\n", begin)]
    assert whole in written, "what is copied or shifted in the run stays as it is"
    missing = [line for line in text.splitlines() if line not in written.splitlines()]
    assert len(missing) >= 2, "the move to it goes to a clone, and the other target is corrected"
    assert done.report["verdict"]["ok"]


@pytest.mark.parametrize("key", TEXTS)
def test_without_errors_all_bytes_stay(key: str, tmp_path: Path) -> None:
    name, text, _ = TEXTS[key]
    text = text.replace("MoveL p20", "MoveL Offs(p10,100,0,0)")
    zero = machines.zero_machine(tmp_path / key, Recipe(controller=name, **QUIET))
    assert olp.correct(text.encode(), zero).data == text.encode()


def test_a_program_of_left_moves_alone_is_refused(bent: dict[str, Path]) -> None:
    text = RAPID.replace("MoveL p10,", "MoveL Offs(p10,deep,0,0),").replace("MoveL p20", "MoveL pElse")
    with pytest.raises(ProgramError, match="is computed") as caught:
        olp.correct(text.encode(), bent["rapid"])
    assert (caught.value.code, caught.value.line) == ("OLP533", 6)


def test_a_parameter_hides_a_target_of_its_name(bent: dict[str, Path]) -> None:
    routine = "  PROC go(robtarget p10,num n)\n    MoveL p10,v100,fine,tool0;\n  ENDPROC\nENDMODULE\n"
    text = RAPID.replace("ENDMODULE\n", routine)
    done = olp.correct(text.encode(), bent["rapid"])
    assert routine in done.data.decode(), "the caller gives where this move goes"


def test_on_an_arm_too(tmp_path: Path) -> None:
    joints, outer = [5.0, 10.0, 20.0, 5.0, 60.0, 0.0], [9e9] * 6
    begin = f"MoveAbsJ {[joints, outer]},v100,fine,tool0;"
    text = RAPID.replace("MoveL p10,", f"{begin} MoveL p10,")
    for (x, y, z), k in (((250, 200, -100), 0), ((350, 200, -100), 1)):
        rotation, place = Arm(MACHINE).pose(np.array(joints) + 2 * k)
        own = [place.round(3).tolist(), quaternion(rotation).round(9).tolist()]
        text = text.replace(f"[[{x},{y},{z}],[1,0,0,0]", str(own)[:-1].replace(" ", ""))
    done = olp.correct_joints(text.encode(), arm_files(tmp_path))
    written, head = done.data.decode(), "  CONST robtarget {}:="
    lines = {name: next(x for x in text.splitlines() if head.format(name) in x) for name in ("p10", "p20")}
    assert lines["p10"] in written
    assert "MoveL p10_olp1," in written
    assert lines["p20"] not in written


def test_a_position_that_lacks_numbers_is_left(bent: dict[str, Path]) -> None:
    """What it lacks is as where the robot comes from, and stays corrected."""
    plain = KRL.replace("  XP3=XP1\n  XP3.Z=XP3.Z+10\n  LIN XP3\n", "")
    text = plain.replace("  LIN XP2", "  LIN {Z -90}\n  LIN XP2")
    done = olp.correct(text.encode(), bent["krl"])
    assert done.data.replace(b"  LIN {Z -90}\n", b"").splitlines()[2:] != plain.encode().splitlines()[2:]
    assert b"\n  LIN {Z -90}\n" in done.data
    assert any(found.lines == (5,) and "lacks one of X" in found.message for found in done.findings)


def test_a_frame_that_is_a_target_too_stays(bent: dict[str, Path]) -> None:
    text = KRL.replace("  XP3=XP1\n  XP3.Z=XP3.Z+10\n  LIN XP3\n", "  $BASE=XP1\n").replace(
        "X 350,Y 200,Z -100", "X 50,Y 10,Z 5"
    )
    done = olp.correct(text.encode(), bent["krl"])
    assert done.report["verdict"]["ok"]
    assert "DECL E6POS XP1={X 250,Y 200,Z -100,A 0,B 0,C 0}" in done.data.decode()
    assert "LIN XP1_olp1" in done.data.decode()


def test_older_inline_forms_set_base_and_tool(bent: dict[str, Path]) -> None:
    """BAS(#FRAMES) takes both from FDAT_ACT, whatever was in force before."""
    text = KRL.replace("  $TOOL=$NULLFRAME\n", "  $TOOL=$NULLFRAME\n  FDAT_ACT=FP1\n  BAS(#FRAMES)\n")
    text = text.replace(
        "DECL E6POS XP2", "DECL FDAT FP1={TOOL_NO 0,BASE_NO 3,IPO_FRAME #BASE}\nDECL E6POS XP2"
    )
    with pytest.raises(ProgramError, match="BASE3"):
        olp.correct(text.encode(), bent["krl"])


@pytest.mark.parametrize("word", ["MoveLDO", "MoveLSync"])
def test_an_action_at_the_end_keeps_a_move_whole(bent: dict[str, Path], word: str) -> None:
    action = "do1,1" if word == "MoveLDO" else '"shoot"'
    start = "    MoveL [[20,20,-300],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;\n"
    text = RAPID.replace("    MoveL p10,v100,fine,tool0;\n", start)
    text = text.replace("    MoveL p20,v100,fine,tool0;", f"    {word} p20,v100,fine,tool0,{action};")
    text = text.replace("    MoveL Offs(p10,0,0,10*(deep+(1))),v100,fine,tool0;\n", "")
    written = olp.correct(text.encode(), bent["rapid"], tolerance_um=300.0).data.decode()
    assert written.count(f"{word} p20,v100,fine,tool0,{action};") == 1
    assert "[350,200,-100]" not in written


def test_a_jump_leaves_where_a_move_ends_open(bent: dict[str, Path]) -> None:
    text = TP.replace("L P[1] 100mm/sec FINE ;", "L P[1] 100mm/sec FINE SkipJump,LBL[3] ;")
    told = olp.correct(text.encode(), bent["tp"]).report["findings"]
    assert any("SkipJump" not in f["message"] and f["line"] == 3 for f in told)


ARC = """DEF made()
  $BASE=$NULLFRAME
  $TOOL={X 0,Y 0,Z 100,A 0,B 0,C 0}
  LOOP
    CIRC XP1,XP2
    LIN XP3
    CIRC XP1,XP2
    CIRC XP2,XP3
  ENDLOOP
END
DEFDAT made
DECL E6POS XP1={X 250,Y 200,Z -100,A 0,B 0,C 0}
DECL E6POS XP2={X 300,Y 250,Z -100,A 0,B 0,C 0}
DECL E6POS XP3={X 350,Y 200,Z -100,A 0,B 30,C 0}
ENDDAT
"""


def test_an_arc_whose_path_is_not_known_is_corrected_at_its_points(tmp_path: Path) -> None:
    """It begins where the loop does, or its tool swings, or its points are on a line."""
    recipe = Recipe(controller="kuka-krl", travel=((-900.0, 900.0),) * 3, **QUIET)
    path = machines.shift_machine(tmp_path, (100.0, 50.0, 20.0), recipe=recipe)
    result = olp.correct(ARC.encode(), path)
    text = result.data.decode()
    for x, y in ((250, 200), (300, 250), (350, 200)):
        assert f"={{X {x - 0.1:.5f},Y {y - 0.05:.5f},Z -100.02000," in text
    assert text.count("CIRC XP1,XP2") == 2, "no arc is split"
    told = [f.message for f in result.findings if "at its via point and at its end" in f.message]
    assert [what.partition(":")[0] for what in told] == [
        "where this arc begins is not stated", "the tool turns on this arc",
        "the three points of this arc lie on a line, or on a circle too large to be read",
    ]  # fmt: skip


STILL = """DEF made()
  $BASE=$NULLFRAME
  $TOOL=$NULLFRAME
  LIN XP1
  IF x THEN
    $IPO_MODE=#TCP
    LIN XP2
    $IPO_MODE=#BASE
    LIN XP3
  ENDIF
  LIN XP4
  IF x THEN
    $IPO_MODE=#TCP
  ELSE
    WAIT SEC 1
  ENDIF
  LIN XP5
END
DEFDAT made
"""


def test_moves_with_a_tool_that_stands_still_are_left(tmp_path: Path) -> None:
    recipe = Recipe(controller="kuka-krl", travel=((-900.0, 900.0),) * 3, **QUIET)
    path = machines.shift_machine(tmp_path, (100.0, 0.0, 0.0), recipe=recipe)
    points = [f"DECL E6POS XP{k}={{X {100 * k},Y 200,Z -100,A 0,B 0,C 0}}\n" for k in range(1, 6)]
    text = olp.correct((STILL + "".join(points) + "ENDDAT\n").encode(), path).data.decode()
    assert [f"XP{k}={{X {100 * k - 0.1:.5f}" in text for k in range(1, 6)] == [True, False, True, True, False]


GIVEN = """MODULE made
  CONST robtarget p10:=[[100,200,-100],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget p20:=[[200,200,-100],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  VAR robtarget p30:=[[300,200,-100],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  VAR robtarget p40:=[[400,200,-100],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC pick(robtarget p,num n{*},\\switch s|robtarget t,INOUT robtarget other)
  ENDPROC
  PROC main()
    MoveL p10,v100,fine,tool0;
    MoveL p20,v100,fine,tool0;
    MoveL p30,v100,fine,tool0;
    MoveL p40,v100,fine,tool0;
    pick p10,[1,2],p30;
    pick p20,n\\t:=p40,p30;
    ArcMoveAbsJ [[0,0,0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;
    MoveL p10,v100,fine,tool0;
  ENDPROC
ENDMODULE
"""


def test_a_routine_changes_what_it_is_given_to_change(tmp_path: Path) -> None:
    """Parameters of RAPID are copies unless the routine says otherwise."""
    recipe = Recipe(controller="abb-rapid", travel=((-900.0, 900.0),) * 3, **QUIET)
    path = machines.shift_machine(tmp_path, (100.0, 0.0, 0.0), recipe=recipe)
    result = olp.correct(GIVEN.encode(), path)
    numbers = [line.partition("[[")[2].partition(",")[0] for line in result.data.decode().splitlines()]
    # the call needs the numbers of p10 and p20: moves go to clones of them
    assert [number for number in numbers if number][:6] == ["100", "99.9000", "200", "199.9000", "300", "400"]
    told = [f.message for f in result.findings if "left as written" in f.message]
    assert [what.split(" gets")[0] for what in told] == ["left as written: p30", "left as written: p40"]
