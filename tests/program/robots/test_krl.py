"""KRL on three linear axes: read and corrected as a judge that shares nothing with it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from judge import krl, machines
from judge.machines import Recipe
from judge.model import JudgeModel

import olp
from olp.core.errors import OlpError, ProgramError

RECIPE = Recipe(controller="kuka-krl", tools={}, job_defaults={}, work_offsets={})
#: rounding of the fifth decimal, mm
DIGIT = 0.5e-5
TURN = "A 30.5,B -10.25,C 170.125"
HEAD = """&ACCESS RVP
&REL 2
DEF made()
  $TOOL={X 10,Y -5,Z 120,A 0,B 10,C 0}
  BASE_DATA[3]={FRAME: X 300,Y 250,Z -300,A 30,B 0,C 0}
  $BASE=BASE_DATA[3]
  $VEL.CP=0.25
"""


def program(rng: np.random.Generator, count: int) -> bytes:
    """Moves to declared positions, some of them shared, to numbers, and to products."""
    data = ["DEFDAT made", f"DECL FRAME g={{X 5,Y 6,Z 7,{TURN}}}"]
    for k, (x, y, z) in enumerate(rng.uniform(-40, 40, (5, 3)).round(3).tolist()):
        data.append(f"DECL E6POS XP{k}={{X {x},Y {y},Z {z},{TURN},S 2,T 'B100011',E1 0.0}} ; taught")
    lines = []
    for _ in range(count):
        x, y, z = rng.uniform(-60, 60, 3).round(2).tolist()
        name = f"XP{rng.integers(5)}"
        target = [
            name, f"{{X {x},Y {y},Z {z},{TURN}}}", f"{name} : {{X {x},Y {y},Z {z},A 0,B 0,C 10}}",
            f"g:{name}", f"{{E6POS: X {x}, Y {y}, Z {z}, {TURN}, E1 0}}",
        ][rng.integers(5)]  # fmt: skip
        move = rng.choice(["LIN", "LIN", "SLIN", "PTP"])
        lines.append(f"  {move} {target}{rng.choice(['', ' C_DIS', ' C_VEL ; on'])}")
    return (HEAD + "\n".join([*lines, "END", *data, "ENDDAT"]) + "\n").encode()


def halves(text: bytes) -> tuple[bytes, bytes]:
    src, _, dat = text.partition(b"DEFDAT")
    return src, dat


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.random_machine(tmp_path_factory.mktemp("bent"), 11, RECIPE)


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.zero_machine(tmp_path_factory.mktemp("zero"), RECIPE)


@pytest.mark.parametrize("seed", range(4))
def test_each_position_is_where_the_judge_wants_it(bent: Path, zero: Path, seed: int) -> None:
    text = program(np.random.default_rng(seed), 30)
    assert olp.correct(text, zero, outside_box="hold").data == text
    done = olp.correct(text, bent)
    assert done.report["verdict"]["ok"]
    nominal, written, model = krl.moves(*halves(text)), krl.moves(*halves(done.data)), JudgeModel(bent)
    assert len(nominal) == 30
    assert len(written) > len(nominal), "long moves are split"
    place = 0
    for k, move in enumerate(nominal):
        want = model.command_for(move.tip[None], move.lever)[0]
        start = nominal[k - 1].tip
        while np.abs(written[place].tip - want).max() > 3 * DIGIT:
            here = written[place].tip
            actual = here + model.error_mm(here[None], move.lever)[0]
            way = move.tip - start
            share = np.clip((actual - start) @ way / max(way @ way, 1e-9), 0, 1)
            assert np.linalg.norm(start + share * way - actual) < 1e-3 + 3 * DIGIT
            place += 1
        assert np.abs(written[place].turn - move.turn).max() < 1e-12
        place += 1
    assert place == len(written)


def test_parts_pass_and_clones_are_declared_behind_their_position(bent: Path) -> None:
    position = "DECL E6POS XP1={X 1,Y 2,Z 3,A 0,B 0,C 180,S 2,T 2,E1 0.0}"
    text = HEAD + (
        "  PTP {X -60,Y -60,Z 0,A 0,B 0,C 180}\n"
        "  SLIN {X 60,Y 60,Z 20,A 0,B 0,C 180} WITH $VEL.CP=0.1 C_SPL\n"
        "  LIN XP1 C_DIS ; last\n  $TOOL=$NULLFRAME\n  PTP XP1\nEND\n"
        f"DEFDAT made\n{position}\nENDDAT\n"
    )
    lines = olp.correct(text.encode(), bent).data.decode().splitlines()
    splines = [line for line in lines if line.startswith("  SLIN")]
    assert len(splines) > 1
    assert all(line.endswith("WITH $VEL.CP=0.1 C_SPL") for line in splines)
    straight = [line for line in lines if line.startswith("  LIN")]
    assert all(
        line.startswith("  LIN {X ") and line.endswith("S 2,T 2,E1 0.0} C_DIS") for line in straight[:-1]
    )
    assert straight[-1] == "  LIN XP1 C_DIS ; last"
    assert "  PTP XP1_olp1" in lines
    place = next(k for k, line in enumerate(lines) if line.startswith("DECL E6POS XP1="))
    assert lines[place + 1].startswith("DECL E6POS XP1_olp1={X ")
    assert lines[place + 1].endswith("A 0,B 0,C 180,S 2,T 2,E1 0.0}")


P = "{X 0,Y 0,Z 0,A 0,B 0,C 0}"
REFUSED = {
    f"$BASE={P}\nLIN {P}": "which .TOOL is in force here is not stated",
    f"$TOOL={P}\nLIN {P}": "which .BASE is in force here is not stated",
    f"$TOOL={P}\n$BASE=BASE_DATA[4]\nLIN {P}": "BASE4",
    f"$TOOL=TOOL_DATA[4]\n$BASE=$NULLFRAME\nLIN {P}": "tool 4",
    f"$TOOL={P}\n$BASE={P}\nmore()\nLIN {P}": "MORE in line 4 may set it",
    f"$TOOL={P}\n$BASE={P}\nIF x THEN\n$BASE=$NULLFRAME\nENDIF\nLIN {P}": "branches up to line 6",
    f"$TOOL={P}\n$BASE={P}\nLOOP\nLIN {P}\n$BASE=$NULLFRAME\nENDLOOP": "loop of line 4 sets it",
    f"$TOOL={P}\n$BASE={P}\n$BASE.X=5\nLIN {P}": "gets a value that the text does not state",
    f"$TOOL={P}\n$BASE={P}\nagain:\nLIN {P}": "jump to line 4",
    f"$TOOL={P}\n$BASE={P}\nLIN p": "not stated in this text",
    f"$TOOL={P}\n$BASE={P}\np={P}\np.X=5\nLIN p": "another value in line 5",
    f"$TOOL={P}\n$BASE={P}\np[1]={P}\np[i]={P}\nLIN p[1]": "another value in line 5",
    f"$TOOL={P}\n$BASE={P}\np={P}\nteach(p)\n$TOOL={P}\n$BASE={P}\nLIN p": "another value in line 5",
    f"$TOOL={P}\n$BASE={P}\np[1]={P}\np[i[2]].X=5\nLIN p[1]": "another value in line 5",
    f"$TOOL={P}\n$BASE={P}\np={P}\nr=EKI_GetReal(a,b,p.X)\nLIN p": "another value in line 5",
    f"p={P}\nteach(p.X)\n$TOOL={P}\n$BASE={P}\nLIN p": "another value in line 3",
    f"p[1]={P}\nteach(f(p[1].X),3)\n$TOOL={P}\n$BASE={P}\nLIN p[1]": "another value in line 3",
    f"$TOOL={P}\n$BASE={P}\np={P}\nTRIGGER WHEN DISTANCE=0 DELAY=0 DO p.X=5\nLIN p": "value in line 5",
    f"p={P}\nEND\nDEF go(p:IN)\n$TOOL={P}\n$BASE={P}\nLIN p": "another value in line 4",
    f"DECL E6POS d\n$TOOL={P}\n$BASE={P}\nLIN d": "another value in line 2",
    f"$TOOL={P}\n$BASE={P}\np=q\nLIN p": "not stated with its numbers in line 4",
    f"$TOOL={P}\n$BASE={P}\nLIN p[i]": "chosen in the run",
    f"$TOOL={P}\n$BASE={P}\nLIN {{X 1}}": "lacks one of",
    f"$TOOL={P}\n$BASE={P}\nLIN {{X 1+y,Y 0,Z 0,A 0,B 0,C 0}}": "computed",
    f"$TOOL={P}\n$BASE={P}\nLIN {P}\nCIRC {P},{P},CA 90": "CA ends this arc",
    f"$TOOL={P}\n$BASE={P}\nLIN {P}\nCIRC {P}": "the arc has 1 positions",
    f"$TOOL={P}\n$BASE={P}\nLIN {P}\n$CIRC_TYPE=#PATH\nCIRC {P},{P}": "turn along with this arc",
    "CIRC_REL {X 5},{Y 5}": "CIRC_REL goes a distance",
    "LIN_REL {X 5}": "LIN_REL goes a distance",
    f"$TOOL={P}\n$BASE={P}\n$IPO_MODE=#TCP\nLIN {P}": "may stand still",
    f"$TOOL={P}\n$BASE={P}\nLIN {P} WITH $IPO_MODE=#TCP": "may stand still",
    "RSI_MOVECORR()": "sensor",
    f"FDAT_ACT=f\nBAS(#PTP_PARAMS,10)\n$TOOL={P}\n$BASE={P}\nLIN {P}": "may stand still",
    f"FDAT_ACT=none\nBAS(#PTP_PARAMS,10)\nLIN {P}": "line 3 sets those of a taught point",
    "what is this": "not a statement of KRL",
}  # fmt: skip


@pytest.mark.parametrize(("statements", "why"), REFUSED.items())
def test_what_is_not_certain_is_refused_with_its_line(zero: Path, statements: str, why: str) -> None:
    text = (
        f"DEF a()\n{statements}\nEND\nDEFDAT a\nDECL FDAT f={{TOOL_NO 1,BASE_NO 1,IPO_FRAME #TCP}}\n"
        f"E6POS d={P}\nENDDAT\n"
    )
    with pytest.raises(OlpError, match=why) as error:
        olp.correct(text.encode(), zero)
    assert isinstance(error.value, ProgramError)
    assert error.value.line is not None
    assert 2 <= error.value.line <= 9


def test_what_a_routine_takes_by_value_it_does_not_change(zero: Path) -> None:
    frames = f"$TOOL={P}\n$BASE={P}\n"
    text = f"DEF a()\np={P}\nshow(p.X)\n{frames}LIN p\nEND\nDEF show(x:IN, y [] : in)\nEND\n"
    assert olp.correct(text.encode(), zero).report["moves"]["total"] == 1
    with pytest.raises(ProgramError, match="another value in line 3"):
        olp.correct(text.replace(": in)", ": out)").encode(), zero)


def test_taught_points_have_their_own_base_and_tool(tmp_path: Path) -> None:
    job = Recipe(
        controller="kuka-krl", job_defaults={}, travel=((-900.0, 900.0),) * 3,
        work_offsets={"BASE2": {"X_mm": 100.0, "C_deg": 30.0, "set_by": "true"}},
        tools={4: {"gauge_to_tip_mm": [0.0, 0.0, -120.0]}},
    )  # fmt: skip
    path = machines.shift_machine(tmp_path, (100.0, 50.0, 20.0), recipe=job)
    text = (
        b"DEF a()\nBAS(#INITMOV,0)\nPTP XHOME\nLOOP\nFDAT_ACT=FP1\nBAS(#PTP_PARAMS,50)\nPTP XP1\nENDLOOP\n"
        b"SLIN XP2 WITH $TOOL=STOOL2(FP1), $BASE=SBASE(FP1.BASE_NO)\nEND\n"
        b"DEFDAT a\nDECL GLOBAL E6POS XP1={X 1,Y 2,Z 3,A 0,B 0,C 180,S 2}\n"
        b"E6POS XP2={X 9,Y 2,Z 3,A 0,B 0,C 180}\n"
        b"DECL FDAT FP1={TOOL_NO 4,BASE_NO 2,IPO_FRAME #BASE}\nENDDAT\n"
    )
    done = olp.correct(text, path).data
    # error in X and Y, along the axes of a frame that is turned by 30 degrees
    assert b"XP1={X 0.88840,Y 2.00670,Z 2.98000,A" in done
    assert b"XP2={X 8.88840,Y 2.00670,Z 2.98000,A" in done


BEGIN = "DEF a()\nBAS(#INITMOV,0)\n{}LIN {{X 300,Y 200,Z -200,A 0,B 0,C 180}}\n{}END\n"


@pytest.mark.parametrize(
    ("between", "behind", "own"),
    [
        ("", "", {"base 0, the world,", "tool 1"}),
        ("BAS(#TOOL,4)\n", "", {"base 0, the world,"}),
        ("$BASE={X 100,Y 0,Z 0,A 0,B 0,C 0}\n", "", {"tool 1"}),
        ("$BASE=$NULLFRAME\nBAS(#TOOL,1)\n", "", set()),
        ("", "TOOL_DATA[1]={X 0,Y 0,Z 120,A 0,B 0,C 0}\n", {"base 0, the world,", "tool 1"}),
    ],
)
def test_the_begin_of_a_program_sets_the_world_and_the_first_tool(
    tmp_path: Path, between: str, behind: str, own: set[str]
) -> None:
    """As the control's own file says; an angle of the machine shows which tool it is."""
    tools = {n: {"gauge_to_tip_mm": [0.0, 0.0, -lever]} for n, lever in ((1, 120.0), (4, 220.0))}
    tools = {4: tools[4]} if behind else tools
    recipe = Recipe(controller="kuka-krl", job_defaults={}, work_offsets={}, tools=tools)
    path = machines.random_machine(tmp_path, 3, recipe)
    text = BEGIN.format(between, behind).encode()
    done = olp.correct(text, path)
    told = {f.message.partition(" is in force here, as BAS(#INITMOV)")[0] for f in done.findings}
    assert told & {"base 0, the world,", "tool 1"} == own
    (x, y, z), model = krl.moves(done.data)[0].tip, JudgeModel(path)
    place = np.array([[400.0 if "X 100" in between else 300.0, 200.0, -200.0]])
    lever = 220.0 if "TOOL,4" in between else 120.0
    want = model.command_for(place, np.array([0.0, 0.0, -lever]))[0]
    assert np.abs((x, y, z) - want).max() < DIGIT


def test_a_base_that_moves_is_not_that_of_the_begin(zero: Path) -> None:
    text = BEGIN.format("BAS(#EX_BASE,1)\n$TOOL=$NULLFRAME\n", "")
    with pytest.raises(ProgramError, match=r"BAS\(#EX_BASE\) in line 3 sets them"):
        olp.correct(text.encode(), zero)


SRC = b"DEF a()\r\n$TOOL=$NULLFRAME\r\n$BASE={X 250,Y 200,Z -300,A 0,B 0,C 0}\r\nPTP XP1\r\nEND"
DAT = b"DEFDAT a\nDECL E6POS XP1={X 1,Y 2,Z 3,A 0,B 0,C 0,S 2}\nENDDAT"


def test_statements_and_data_are_written_both_or_none(bent: Path, tmp_path: Path) -> None:
    (tmp_path / "a.src").write_bytes(SRC)
    (tmp_path / "a.dat").write_bytes(DAT)
    out, data = tmp_path / "b.src", tmp_path / "b.dat"
    done = olp.correct(tmp_path / "a.src", bent)
    done.write(out)
    assert out.read_bytes().partition(b"olp-corrected")[0] == SRC[:9] + b"; "
    assert out.read_bytes().endswith(SRC[9:])
    assert b"XP1={X 1,Y 2,Z 3," not in data.read_bytes()
    assert data.read_bytes().startswith(DAT[:26])
    assert data.read_bytes().endswith(DAT[-24:])
    assert olp.verify(tmp_path / "a.src", out, bent).report["verdict"]["ok"]
    out.unlink()
    with pytest.raises(OlpError, match="exists already"):
        done.write(out)
    assert not out.exists()
    with pytest.raises(OlpError, match="is an input"):
        done.write(tmp_path / "a.src", force=True)


def test_a_refusal_names_the_file_of_data(zero: Path, tmp_path: Path) -> None:
    (tmp_path / "a.SRC").write_bytes(SRC)
    (tmp_path / "a.DAT").write_bytes(DAT.replace(b"ENDDAT", b"XP1={X 1}"))
    with pytest.raises(OlpError, match=r"XP1 gets another value in line 3 of a\.DAT") as error:
        olp.correct(tmp_path / "a.SRC", zero)
    assert error.value.line == 4
    (tmp_path / "a.DAT").unlink()
    with pytest.raises(OlpError, match=r"XP1 is not stated in this text; give the \.dat file beside it"):
        olp.correct(tmp_path / "a.SRC", zero)


def test_data_of_another_module_are_refused(zero: Path) -> None:
    text = f"DEF a()\n$TOOL={P}\n$BASE={P}\nPTP XP1\nEND\n".encode() + DAT
    assert olp.correct(text, zero, outside_box="hold").data == text
    with pytest.raises(ProgramError, match="those of b, and the program is A") as error:
        olp.correct(text.replace(b"DEFDAT a", b"DEFDAT b"), zero)
    assert error.value.line == 6
