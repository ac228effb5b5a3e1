"""URScript on three linear axes: read and corrected as a judge that shares nothing with it says."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from judge import machines, ur
from judge.machines import Recipe
from judge.model import JudgeModel

import olp
from olp.core.errors import OlpError, ProgramError

RECIPE = Recipe(controller="urscript", tools={}, job_defaults={}, work_offsets={})
#: rounding of the eighth decimal of a metre, mm
DIGIT = 0.5e-5
TURN = "2.2,2.2,0.1"
HEAD = "def prog():\n  set_tcp(p[0.01,-0.005,0.12,0,0,0.3])\n"


def program(rng: np.random.Generator, count: int) -> bytes:
    """Moves to poses with a name, some of them in two frames, and to their own."""
    lines = []
    for k, (x, y, z) in enumerate((rng.uniform(-40, 40, (5, 3)) / 1000).round(5).tolist()):
        lines.append(f"  P{k}=p[{x},{y},{z},{TURN}]")
    for _ in range(count):
        x, y, z = (rng.uniform(-60, 60, 3) / 1000).round(4).tolist()
        target = [f"P{rng.integers(5)}", f"p[{x},{y},{z},{TURN}]"][rng.integers(2)]
        frame = ["p[0.3,0.25,-0.3,0,0,0.4]", "p[0.35,0.2,-0.25,0,0,0.4]"][rng.integers(2)]
        move = ["movel", "movej", "movep"][rng.integers(3)]
        rest = {"movep": ",1.2,0.25,0.001"}.get(
            move, [",a=1.2,v=0.25,r=0.01", ",1.2,0.25,0,0.001"][rng.integers(2)]
        )
        lines.append(f"  {move}(pose_trans({frame},{target}){rest})")
    return (HEAD + "\n".join(lines) + "\nend\n").encode()


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.random_machine(tmp_path_factory.mktemp("bent"), 9, RECIPE)


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.zero_machine(tmp_path_factory.mktemp("zero"), RECIPE)


@pytest.mark.parametrize("seed", range(3))
def test_each_pose_is_where_the_judge_wants_it(bent: Path, zero: Path, seed: int) -> None:
    text = program(np.random.default_rng(seed), 25)
    assert olp.correct(text, zero).data == text
    done = olp.correct(text, bent)
    assert done.report["verdict"]["ok"]
    nominal, written, model = ur.moves(text), ur.moves(done.data), JudgeModel(bent)
    assert len(written) > len(nominal), "long moves are split"
    place = 0
    for k, move in enumerate(nominal):
        want = model.command_for(move.tip[None], move.lever)[0]
        start = nominal[k - 1].tip
        while np.abs(written[place].tip - want).max() > 2 * DIGIT:
            here = written[place].tip
            actual = here + model.error_mm(here[None], move.lever)[0]
            way = move.tip - start
            share = np.clip((actual - start) @ way / max(way @ way, 1e-9), 0, 1)
            assert np.linalg.norm(start + share * way - actual) < 1e-3 + 2 * DIGIT
            place += 1
        assert np.abs(written[place].turn - move.turn).max() < 1e-12
        place += 1
    assert place == len(written)


def test_parts_of_a_move_blend(bent: Path) -> None:
    text = HEAD + (
        "  movej(pose_trans(p[0.3,0.25,-0.3,0,0,0],p[-0.06,-0.06,0,2.2,2.2,0.1]),a=1,v=1)\n"
        "  movel(pose_trans(p[0.3,0.25,-0.3,0,0,0],p[0.06,0.06,0.02,2.2,2.2,0.1]),a=1,v=1)\nend\n"
    )
    lines = olp.correct(text.encode(), bent).data.decode().splitlines()
    parts = [line for line in lines if line.startswith("  movel")]
    assert len(parts) > 1
    assert all(line.endswith("a=1,v=1, r=0.0005)") for line in parts[:-1])
    assert parts[-1].endswith("a=1,v=1)")


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        ("set_tcp(p[0,0,0,0,0,0])\nq=p[0,0,0,0,0,0]\nq[2]=0.1\nmovel(q)", "several values"),
        ("set_tcp(p[0,0,0,0,0,0])\nmovel(pose_add(q,q))", "computed"),
        ("set_tcp(p[0,0,0,0,0,0])\nmovec(p[0,0,0,0,0,0])", "the arc lacks"),
        ("set_tcp(p[0,0,0,0,0,0])\nspeedl([0,0,0,0,0,0],1,1)", "speeds"),
        ("movel(p[0,0,0,0,0,0])", "no set_tcp"),
        ("movel(p[0,0,0,0,0,0])\nset_tcp(p[0,0,0,0,0,0])", "depends on the run"),
        ("if x:\nset_tcp(p[0,0,0,0,0,0])\nend\nmovel(p[0,0,0,0,0,0])", "the block up to line 4 sets another"),
        ("set_tcp(p[0,0,0,0,0,0])\nx=movel(p[0,0,0,0,0,0])", "movel in a value"),
        ("if movel(p[0,0,0,0,0,0]):", "line of its own"),
        ("movel(p[0,0,0,0,0,0]", "bracket"),
    ],
)
def test_what_is_not_certain_is_refused_with_its_line(zero: Path, lines: str, why: str) -> None:
    with pytest.raises(OlpError, match=why) as error:
        olp.correct(f"def a():\n{lines}\nend\n".encode(), zero)
    assert isinstance(error.value, ProgramError)
    assert error.value.line is not None


def test_the_tool_of_the_job_holds_without_set_tcp(tmp_path: Path) -> None:
    tools = {1: {"gauge_to_tip_mm": [0.0, 0.0, -120.0]}}
    recipe = Recipe(controller="urscript", tools=tools, job_defaults={"tool": 1}, work_offsets={})
    path = machines.shift_machine(tmp_path, (100.0, 0.0, 0.0), recipe=recipe)
    text = olp.correct(b"def a():\n  movej(p[0.1,0.2,-0.3,0,0,0])\nend\n", path).data
    assert b"movej(p[0.09990000,0.2,-0.3,0,0,0])" in text


def test_a_statement_goes_on_until_its_brackets_are_closed(bent: Path) -> None:
    """Also over comments; its bytes stay as they are."""
    lines = (
        "def a():\n  set_tcp(p[0,0,0,0,0,0])\n  while (not get_x() and  # (a\n    n > 0):\n    sleep(0.1)\n"
        "  end\n  movel(p[0.2,0.25,-0.1,0,0,0],1.2,0.1)\n  movel(p[0.3,\r\n   0.25,-0.1,0,0,0], # first\n"
        " 1.2,0.1)\nend\n"
    )
    done = olp.correct(lines.encode(), bent).data.decode()
    plain = lines.replace("\r\n   ", "").replace(" # first\n 1.2", "1.2").replace("  # (a\n    n", " n")
    wanted = olp.correct(plain.encode(), bent).data.decode()
    numbers = re.findall(r"0\.\d{6,}|-0\.\d{6,}", done)
    assert numbers == re.findall(r"0\.\d{6,}|-0\.\d{6,}", wanted)
    assert len(numbers) >= 6
    assert "], # first\n 1.2" in done
    assert "and  # (a\n    n > 0):" in done


@pytest.mark.slow
def test_a_pose_that_is_added_goes_along_with_its_target(bent: Path, zero: Path) -> None:
    """The place is added along the frame. How one that turns is added is not stated, so it is left."""
    frame, second = "p[0.3,0.25,-0.3,0,0,0.4]", [0.02, -0.01, 0.03]
    names = f"  P=p[0.05,0.02,0.01,{TURN}]\n  D=p[0.02,-0.01,0.03,0,0,0]\n"
    move = "  movej(pose_trans({},{}),a=1,v=1)\n"

    def correct(*targets: str) -> str:
        text = HEAD + names + "".join(move.format(frame, target) for target in targets) + "end\n"
        assert olp.correct(text.encode(), zero).data == text.encode()
        return olp.correct(text.encode(), bent).data.decode()

    def found(form: str, text: str) -> np.ndarray:
        return np.array([float(value) for value in re.findall(form, text)[0].split(",")[:3]])

    there = found(r"pose_trans\(p\[[^]]*\],p\[(.*)\]\)", correct(f"p[0.07,0.01,0.04,{TURN}]"))
    for target in ("pose_add(P , p[0.02,-0.01,0.03,0,0,0])", "pose_add(P,D)"):
        done = correct(target)
        assert np.abs(found(r" P=p\[(.*)\]", done) + second - there).max() < 2.1e-8
        assert target in done
    both = correct("pose_add(P,p[0.02,-0.01,0.03,0,0,0])", "P")
    away = found(r"pose_add\(P,p\[(.*?)\]\)", both)
    assert np.abs(found(r" P=p\[(.*)\]", both) + away - there).max() < 2.1e-8
    assert np.abs(away - second).max() > 1e-8, "the target is that of the other move"
    left = correct("pose_add(P,p[0.02,-0.01,0.03,0,0,0.1])", f"p[0.07,0.01,0.04,{TURN}]")
    assert names.encode() in left.encode(), "what a move that is left goes by stays"


@pytest.mark.slow
def test_calls_in_one_line_are_statements_of_their_own(bent: Path) -> None:
    """As the control reads them, which looks for no ends of lines behind calls."""
    frame = "p[0.3,0.25,-0.3,0,0,0]"
    one = (
        f"  movej(pose_trans({frame},p[-0.06,-0.06,0,2.2,2.2,0.1]),a=1,v=1)   sleep(0.5)  # wait\n"
        f"  movel(pose_trans({frame},p[0.06,0.06,0.02,2.2,2.2,0.1])) movel(Q, r=0.01) Q[0]=0.5\n"
    )
    names = f"  Q=p[0.29,0.22,-0.28,{TURN}]\n"
    plain = one.replace("   sleep", "\n  sleep").replace(") movel", ")\n  movel").replace(") Q[", ")\n  Q[")
    both = [olp.correct((HEAD + names + text + "end\n").encode(), bent) for text in (one, plain)]
    assert both[0].report["moves"] == both[1].report["moves"]
    assert both[0].report["moves"]["split"] == 2
    wanted, done = (ur.moves(re.sub(rb"\)[ ]+(?=[mQs])", b")\n", each.data)) for each in both)
    assert [move.tip.tolist() for move in wanted] == [move.tip.tolist() for move in done]
    with pytest.raises(OlpError, match="write it in a line of its own"):
        olp.correct((HEAD + "  movel(p[0,0,0,0,0,0]) and x\nend\n").encode(), bent)


SET = "set_tcp(p[0,0,0.1,0,0,0])\n"
MOVE = "movel(p[0.1,0.2,-0.3,0,0,0])\n"


@pytest.mark.parametrize(
    ("lines", "moved"),
    [
        # before any tool, and behind one
        (f"def a():\n{MOVE}{SET}{MOVE}end\n", "01"),
        # with a name of the tool, and in a function that is called behind it
        (f'def a():\nset_tcp(p[0,0,0.1,0,0,0], "T")\ndef f():\n{MOVE}end\nf()\n{MOVE}end\n', "11"),
        (f"def f():\n{MOVE}end\ndef a():\n{SET}f()\nend\n", "1"),
        (f"def f():\n{MOVE}end\ndef a():\nf()\n{SET}f()\n{MOVE}end\n", "01"),
        # functions with tools of their own
        (f"def f():\n{SET}{MOVE}end\ndef a():\nset_tcp(p[0,0,0.2,0,0,0])\n{MOVE}f()\n{MOVE}end\n", "110"),
        # in branches and loops
        (f"def a():\n{SET}if x:\n{SET}end\n{MOVE}end\n", "1"),
        (f"def a():\n{SET}if x:\nset_tcp(p[0,0,0.2,0,0,0])\n{MOVE}else:\n{MOVE}end\n{MOVE}end\n", "110"),
        (f"def a():\nset_tcp(p[0,0,0.2,0,0,0])\nif x:\n{SET}else:\n{SET}end\n{MOVE}end\n", "1"),
        (f"def a():\nset_tcp(p[0,0,0.2,0,0,0])\n{MOVE}if x:\n{SET}elif y:\n{SET}end\n{MOVE}end\n", "10"),
        (f"def a():\n{SET}while x:\n{MOVE}set_tcp(p[0,0,0.2,0,0,0])\n{MOVE}end\n{MOVE}end\n", "010"),
        # moves that no target states, and a value that is none
        (f"def a():\n{SET}q=get_inverse_kin(p[0,0,0,0,0,0])\nservoj(q)\nforce_mode(q)\n{MOVE}end\n", "1"),
    ],
)
def test_moves_whose_tool_the_run_decides_are_left(lines: str, moved: str, tmp_path: Path) -> None:
    recipe = Recipe(controller="urscript", tools={}, job_defaults={}, work_offsets={})
    path = machines.shift_machine(tmp_path, (100.0, 0.0, 0.0), recipe=recipe)
    text = olp.correct(lines.encode(), path).data.decode()
    own = [line for line in text.splitlines() if line.startswith("movel")]
    assert [str(int("0.09990000" in line)) for line in own] == list(moved)


@pytest.mark.parametrize(
    ("between", "known"),
    [
        ("grip(1)", True),
        ("x=grip(1)", True),
        ("x[0]=grip(1)", True),
        ("if not(grip(0)):\nsleep(1)\nend", True),
        ("h=run watch()\njoin h", True),
        ("x=server.move_box(1)", True),
        ("textmsg(to_str(grip(1)))", True),
        ("go()", False),
        ("x=get_list_length(go())", False),
        ("x[0]=go()", False),
        ("textmsg(to_str(go()))", False),
        ("if not(go()):\nsleep(1)\nend", False),
        ("h=run leave()\njoin h", False),
        ("library()", False),
    ],
)
def test_a_function_that_moves_nothing_leaves_the_robot_where_it_is(
    between: str, known: bool, bent: Path
) -> None:
    """Whatever it calls: the move behind it is split. One that may move, or is not known, is not."""
    functions = (
        'def grip(n):\nsocket_send_line("GTO")\nwhile read_input_boolean_register(n):\nsync()\nend\n'
        "return wait()\nend\ndef wait():\nsleep(0.1)\nreturn 1\nend\nthread watch():\nwait()\nend\n"
        "def go():\nreturn there()\nend\ndef there():\nmovej([0,0,0,0,0,0])\nend\n"
        "thread leave():\ngo()\nend\n"
    )
    moves = [f"movel(pose_trans(p[0.3,0.25,-0.3,0,0,0],p[{x},{x},0,2.2,2.2,0.1]))" for x in (-0.06, 0.06)]
    text = "\n".join(["def a():", "set_tcp(p[0,0,0.1,0,0,0])", functions, moves[0], between, moves[1], "end"])
    assert (olp.correct(text.encode(), bent).report["moves"]["split"] == 1) == known


A, B = "p[0.1,0.1,0.1,0,0,0]", "p[0.4,0.1,0.1,0,0,1.570796326794897]"
IN_F, TO_P = "movel(pose_trans(F,p[0.1,0.2,-0.3,0,0,0]))", "movel(P)"
#: The place of a target that is corrected in the frame A, and in B, whose second axis is against X.
IN_A, IN_B = "p[0.09990000,0.2,", "p[0.1,0.20010000,"


@pytest.mark.parametrize(
    ("lines", "wanted"),
    [
        # the last value before the move, as posts write their frames
        (["global F=" + A, "F=" + B, IN_F, "F=" + A, IN_F], [IN_B, IN_A]),
        (["F=" + A, "if x:", "F=" + B, IN_F, "else:", IN_F, "end", IN_F], [IN_B, IN_A, IN_F]),
        (["F=" + A, "if x:", "F=" + B, "else:", "F=" + B, "end", IN_F], [IN_F]),
        (["F=" + A, "while x:", IN_F, "F=" + B, IN_F, "end", IN_F, "F=" + B, IN_F], [IN_F, IN_B, IN_F, IN_B]),
        # what another function gives, or this one when it runs again
        (["F=" + A, "def g():", "F=" + B, "end", IN_F], [IN_F]),
        (["F=" + A, "F=" + B, "def g():", IN_F, "end", IN_F, "g()"], [IN_F, IN_B]),
        (["def g():", SET.strip(), "F=" + A, "g()", IN_F, "F=" + B, IN_F, "end", "g()"], [IN_F, IN_F]),
        (["def g(F):", IN_F, "end", "F=" + B, IN_F, "g(F)"], [IN_F, IN_B]),
        (["def g():", "local F=" + A, IN_F, "end", "local F=" + B, IN_F, "g()"], [IN_A, IN_B]),
        (["F=" + A, "F=" + B, "F[0]=x", IN_F], [IN_F]),
        # targets with two values, and one that is a frame as well
        (
            ["P=p[0.1,0.1,-0.1,0,0,0]", TO_P, "P=p[0.1,0.2,-0.3,0,0,0]", TO_P],
            ["P=p[0.09990000,0.1,", TO_P, "P=" + IN_A, TO_P],
        ),
        (["F=p[0.1,0.1,-0.01,0,0,0]", "movel(F)", IN_F], ["movel(F_olp1)", IN_A]),
    ],
)
def test_the_value_of_a_name_is_the_one_that_holds_there(
    lines: list[str], wanted: list[str], tmp_path: Path
) -> None:
    """Where the run decides about it a move stays as it is written."""
    recipe = Recipe(controller="urscript", tools={}, job_defaults={}, work_offsets={})
    path = machines.shift_machine(tmp_path, (100.0, 0.0, 0.0), recipe=recipe)
    text = "\n".join(["def a():", "set_tcp(p[0,0,0.1,0,0,0])", *lines, MOVE + "end", ""])
    result = olp.correct(text.encode(), path)
    assert result.report["verdict"]["ok"]
    found = [line for line in result.data.decode().splitlines() if line.startswith(("movel", "P="))]
    assert len(found) == len(wanted) + 1
    for line, part in zip(found, wanted, strict=False):
        assert part in line
