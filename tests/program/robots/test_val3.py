"""VAL 3 on three linear axes: read and corrected as a judge that shares nothing with it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from judge import machines, val3
from judge.machines import Recipe
from judge.model import JudgeModel

import olp
from olp.cli import main
from olp.core.errors import OlpError, ProgramError

RECIPE = Recipe(controller="staubli-val3", tools={}, job_defaults={}, work_offsets={})
#: rounding of the sixth decimal, mm
DIGIT = 0.5e-6
DECLARATION = '<?xml version="1.0" encoding="utf-8"?>\r\n'
SPACE = "http://www.staubli.com/robotics/VAL3/"
XSI = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"'
CONFIG = 'shoulder="lefty" elbow="epositive" wrist="wpositive"'
FRAMES = (
    '<Value key="0" x="300" y="250" z="-300" rz="30" fatherId="world[0]" />',
    '<Value key="1" x="5" y="6" z="7" rx="170.125" ry="-10.25" fatherId="fPart[0]" />',
)
FATHER = '<Value key="0" fatherId="fPart[0]" />'
TOOLS = (
    '<Value key="0" x="10" y="-5" z="120" ry="10" fatherId="flange[0]" ioLink="valve1" />',
    '<Value key="1" z="4" rx="20" fatherId="tGrip[0]" />',
)


def datum(name: str, kind: str, *values: str) -> str:
    body = "".join(f"      {value}\r\n" for value in values)
    return (
        f'    <Data name="{name}" access="public" xsi:type="array" type="{kind}" size="{len(values)}">\r\n'
        f"{body}    </Data>\r\n"
    )


def pgx(name: str, *lines: str, parameters: str = "") -> str:
    body = "".join(f"  {line}\r\n" for line in lines)
    return (
        f'{DECLARATION}<Programs {XSI} xmlns="{SPACE}Program/2">\r\n  <Program name="{name}">\r\n{parameters}'
        f"    <Code><![CDATA[begin\r\n{body}end]]></Code>\r\n  </Program>\r\n</Programs>\r\n"
    )


def dtx(*data: str) -> str:
    head = f'{DECLARATION}<Database {XSI} xmlns="{SPACE}Data/2">\r\n  <Datas>\r\n'
    return f"{head}{''.join(data)}  </Datas>\r\n</Database>\r\n"


MOTIONS = (
    datum("mSlow", "mdesc", '<Value key="0" accel="80" tmax="50" blend="off" leave="20" reach="30" />'),
    datum("mFast", "mdesc", '<Value key="0" vel="90" tmax="250" leave="5" reach="5" blend="Cartesian" />'),
)


def text_of(start: str, data: str, *others: str) -> bytes:
    parts = [start]
    for k, other in enumerate((data, *others)):
        parts.append(f"<!--olp: file part{k}.{'pgx' if k else 'dtx'}-->\n{other}")
    return "\n".join(parts).encode()


def made(lines: list[str], points: list[str], *others: str) -> bytes:
    frames, tool = datum("fPart", "frame", *FRAMES), datum("tGrip", "tool", *TOOLS)
    data = dtx(*MOTIONS, frames, datum("pPoint", "pointRx", *points), tool)
    return text_of(pgx("start", *lines), data, *others)


def value(key: int, place: list[float], more: str, father: str = "fPart[0]") -> str:
    """A point whose numbers that are zero are left out, as the tool of the maker does."""
    numbers = "".join(f'{n}="{v}" ' for n, v in zip("xyz", place, strict=True) if v)
    return f'<Value key="{key}" {numbers}{more}{CONFIG} fatherId="{father}" />'


#: How one program of many moves with numbers is written by a common tool.
NAMES = ("x", "y", "z", "rx", "ry", "rz")
GIVEN = "".join(f'<Parameter name="x_n{n}" type="num" xsi:type="element" />' for n in NAMES)
LINE = pgx(
    "MoveLine", *(f"pMove.trsf.{n} = x_n{n}" for n in NAMES), "movel(pMove,tGrip,mMove)",
    parameters=f"<Parameters>{GIVEN}</Parameters>\r\n",
)  # fmt: skip


def program(rng: np.random.Generator, count: int) -> bytes:
    """Moves to declared points, some of them shared, to numbers, along the tool and along frames, and by
    calls."""
    places = rng.uniform(-40, 40, (6, 3)).round(3)
    places[0, 1] = places[1, :2] = places[2] = 0.0
    turns = ['rx="170.125" ry="-10.25" rz="30.5" '] * 5 + ['rx="180" ']
    points = [value(k, p, turns[k], f"fPart[{k % 2}]") for k, p in enumerate(places.tolist())]
    lines = ["pMove.config.shoulder = lefty", "mMove.blend = joint", "mMove.reach = 0.01"]
    for _ in range(count):
        x, y, z = rng.uniform(-60, 60, 3).round(2).tolist()
        name = f"pPoint[{rng.integers(6)}]"
        target = [
            name,
            f"{{{{{x + 300},{y + 250},{z - 300},170.125,-10.25,30.5}},{{lefty,epositive,wpositive}}}}",
            f"appro({name},{{{x / 4},{y / 4},{z},0,0,10}})",
            f"compose({name},fPart,{{{x},{y},{z},0,0,0}})",
            "",
        ][rng.integers(5)]  # fmt: skip
        motion = rng.choice(["mSlow", "mFast"])
        move = rng.choice(["movel", "movel", "nTraj = movel", "movej"])
        call = f"call MoveLine({x},{y},{z},170.125,-10.25,30.5)"
        tool = rng.choice(["tGrip"] * 7 + ["tGrip[1]"])
        lines.append(f"{move}({target},{tool},{motion}) // {x}" if target else call)
    made_ = made(lines, points, LINE).decode()
    more = datum("pMove", "pointRx", '<Value key="0" fatherId="fPart[0]" />')
    more += '    <Data name="mMove" access="private" xsi:type="array" type="mdesc" size="1" />\r\n'
    more += '    <Data name="nTraj" access="private" xsi:type="array" type="num" size="1" />\r\n'
    return made_.replace("  </Datas>", more + "  </Datas>").encode()


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.random_machine(tmp_path_factory.mktemp("bent"), 11, RECIPE)


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.zero_machine(tmp_path_factory.mktemp("zero"), RECIPE)


@pytest.mark.parametrize("seed", range(3))
def test_each_point_is_where_the_judge_wants_it(bent: Path, zero: Path, seed: int) -> None:
    text = program(np.random.default_rng(seed), 30)
    assert olp.correct(text, zero).data == text
    done = olp.correct(text, bent)
    assert done.report["verdict"]["ok"]
    nominal, written, model = val3.moves(text), val3.moves(done.data), JudgeModel(bent)
    assert len(nominal) == 30
    assert len(written) > len(nominal), "long moves are split"
    place = 0
    for k, move in enumerate(nominal):
        want = model.command_for(move.tip[None], move.lever)[0]
        start = nominal[k - 1].tip
        while np.abs(written[place].tip - want).max() > 4 * DIGIT:
            part = written[place]
            actual = part.tip + model.error_mm(part.tip[None], move.lever)[0]
            way = move.tip - start
            share = np.clip((actual - start) @ way / max(way @ way, 1e-9), 0, 1)
            assert np.linalg.norm(start + share * way - actual) < 1e-3 + 4 * DIGIT
            assert part.motion["blend"] == "joint"
            assert part.motion.get("tmax") == move.motion.get("tmax")
            assert part.words == move.words
            place += 1
        assert np.abs(written[place].turn - move.turn).max() < 1e-12
        assert written[place].motion == move.motion
        place += 1
    assert place == len(written)
    assert all(stated in (0, count) or count == 0 for stated, count in val3.sizes(done.data).values())


START, WORDS = "movel(pPoint[0],tGrip,mFast)", "lefty,epositive,wpositive"
POINTS = [
    value(0, [10, 20, 0], 'rx="180" '),
    value(1, [30, 0, 5], 'rx="180" '),
    value(2, [-60, 50, 9], 'rx="180" '),
]


def corrected(lines: list[str], machine: Path, *others: str, data: str = "") -> list[str]:
    text = made(lines, POINTS, *others).decode().replace("  </Datas>", data + "  </Datas>")
    return olp.correct(text.encode(), machine).data.decode().split("\r\n")


def test_a_point_that_moves_want_to_differ_gets_a_further_element(bent: Path) -> None:
    short = datum("tShort", "tool", '<Value key="0" z="80" fatherId="flange[0]" />')
    moves = ["movej(pPoint[1],tGrip,mFast)", "movej(pPoint[1],tShort,mFast)", "movej(pPoint[1],tGrip,mSlow)"]
    lines = corrected(moves, bent, data=short)
    assert [line.strip() for line in lines if "movej" in line] == [
        moves[0], "movej(pPoint[3],tShort,mFast)", moves[2],
    ]  # fmt: skip
    first, clone = (next(line for line in lines if f'key="{k}" x="29.9' in line) for k in (1, 3))
    assert lines.index(clone) == lines.index(first) + 2
    for line in (first, clone):
        # zeros of the data that are corrected are written, and others stay out
        assert ' y="0.0' in line
        assert " rz=" not in line
        assert line.endswith(f'rx="180" {CONFIG} fatherId="fPart[0]" />')
    assert any('name="pPoint"' in line and 'size="4"' in line for line in lines)


def test_parts_pass_with_the_speed_of_their_move(bent: Path) -> None:
    """Also where the program sets it: then their description is made from it before each part."""
    moves = ["movej(pPoint[0],tGrip,mFast)", "movel(pPoint[2],tGrip,mFast)", "mSlow.tvel = 20"]
    lines = corrected([*moves, "movel(pPoint[0],tGrip,mSlow)"], bent)
    text = [line.strip() for line in lines]
    place = text.index("movel(pPoint[2],tGrip,mFast)")
    assert text[place - 1] == "movel(pPoint[3],tGrip,mFast[1])"
    assert '<Value key="1" vel="90" tmax="250" leave="0.5" reach="0.5" blend="joint" />' in text
    place = text.index("movel(pPoint[0],tGrip,mSlow)")
    assert text[place - 5 : place] == [
        "mSlow[1]=mSlow", "mSlow[1].blend=joint", "mSlow[1].leave=0.5", "mSlow[1].reach=0.5",
        "movel(pPoint[4],tGrip,mSlow[1])",
    ]  # fmt: skip


S6 = """\ufeff<?xml version='1.0' encoding='utf-8' ?>
<programList xmlns="ProgramNameSpace" >
  <program name="start" public="false" >
    <source>
      <code>begin
  do
    movej(p1,tProg,mNom)
    if nCount &lt; 3 // &amp; so on
      popUpMsg(&quot;movel(p2, &lt;1&gt;&quot;)
    endIf
    movel(p2,tProg,mNom)
    waitEndMove()
  until (false)
end
      </code>
    </source>
  </program>
</programList>
<!--olp: file made.dtx-->
\ufeff<?xml version="1.0" encoding="utf-8" ?>
<dataList xmlns="DataNameSpace" >
  <frameSection>
    <frame name="fA" public="false"><fFather alias="" name="world" fatherIndex="0" />
      <valueFrame index="0" ><tfValue x="250" y="200" z="-300" rx="0" ry="0" rz="90" /></valueFrame></frame>
  </frameSection>
  <mdescSection>
    <mdesc name="mNom" public="true"><valueMdesc index="0" >
      <mdescValue accel="100" tmax="99999" blend="off" leave="50" reach="50" /></valueMdesc></mdesc>
  </mdescSection>
  <pointSection>
    <point name="p1" public="false" privilege="0" >
      <pFather alias="" name="fA" fatherIndex="0" />
      <valuePoint index="0" >
        <tpValue x="10.5" y="-20" rx="180"/>
        <cpValue shoulder="ssame" elbow="esame" wrist="wsame"/>
      </valuePoint>
    </point>
    <point name="p2" public="false" privilege="0" >
      <pFather alias="" name="fA" fatherIndex="0" />
      <valuePoint index="0" >
        <tpValue x="60" y="50" z="20" rx="180" ry="0" rz="0" />
        <cpValue shoulder="ssame" elbow="esame" wrist="wsame"/>
      </valuePoint>
    </point>
  </pointSection>
  <toolSection>
    <tool name="tProg" public="false"><tFather alias="" name="flange" fatherIndex="0" />
      <valueTool index="0" ><ttValue z="-120" /></valueTool></tool>
  </toolSection>
</dataList>
""".encode()


#: Places of a circle, the last of them above the others.
ROUND = ((40, 0, 0), (0, 40, 0), (-40, 0, 0), (0, -40, 0), (40, 0, 9))


def off_circle(a: np.ndarray, b: np.ndarray, c: np.ndarray, tip: np.ndarray) -> float:
    """How far a tip is from the circle through three points."""
    normal = np.cross(b - a, c - a)
    rows = np.array([b - a, c - a, normal])
    centre = np.linalg.solve(rows, np.array([(b @ b - a @ a) / 2, (c @ c - a @ a) / 2, normal @ a]))
    height = (tip - centre) @ normal / np.linalg.norm(normal)
    level = tip - centre - height * normal / np.linalg.norm(normal)
    return float(np.hypot(height, np.linalg.norm(level) - np.linalg.norm(a - centre)))


#: An arc of numbers, one to elements, back to its start, and one that appro moves, each with its start.
ARCS = [
    ["movej({0},tGrip,mSlow)", "movec({1}, {2},tGrip, mFast) // {"],
    ["movel(pPoint[0],tGrip,mFast)", "nId = movec(pPoint[1],pPoint[2],tGrip,mSlow)"],
    ["movec(pPoint[3],pPoint[0],tGrip,mFast)"],
    [
        "movel(appro(pPoint[1],{0,0,-9,0,0,0}),tGrip,mFast)",
        "movec(pPoint[4],appro(pPoint[3],{0,0,-9,0,0,0}),tGrip,mSlow)",
    ],
]


def test_arcs_are_several_ones_that_pass(bent: Path, zero: Path) -> None:
    around = [value(k, [40 + x, y, z], 'rx="180" ') for k, (x, y, z) in enumerate(ROUND)]
    lines = [line for arc in ARCS for line in arc]
    for k, (x, y, z) in enumerate(((0, 0, 0), (40, 35, 10), (90, 0, 20))):
        stated = f"{{{{{x + 300},{y + 250},{z - 300},180,0,0}},{{{WORDS}}}}}"
        lines = [line.replace(f"{{{k}}}", stated) for line in lines]
    text = made(lines, around)
    assert olp.correct(text, zero).data == text
    done = olp.correct(text, bent)
    assert olp.verify(text, done.data, bent).report["verdict"]["ok"]
    nominal, written, model = val3.moves(text), val3.moves(done.data), JudgeModel(bent)
    place = 0
    for k, move in enumerate(nominal):
        want, last = model.command_for(move.tip[None], move.lever)[0], False
        while not last:
            part, place = written[place], place + 1
            last = np.abs(part.tip - want).max() < 4 * DIGIT
            assert (part.via is None) == (move.via is None)
            assert part.motion == move.motion if last else part.motion["blend"] == "joint"
            assert np.abs(part.turn - move.turn).max() < 1e-12
            for tip in [] if part.via is None else [part.via[:3, 3], part.tip]:
                reached = tip + model.error_mm(tip[None], move.lever)[0]
                assert off_circle(nominal[k - 1].tip, move.via[:3, 3], move.tip, reached) < 1e-3 + 4 * DIGIT
    assert place == len(written) > len(nominal) + 4
    assert all(stated in (0, count) or count == 0 for stated, count in val3.sizes(done.data).values())


def test_one_text_of_several_arcs_is_never_split(bent: Path, zero: Path) -> None:
    given = "".join(
        f'<Parameter name="x_{n}" type="pointRx" xsi:type="element" use="reference" />' for n in "pq"
    )
    calls = ["call bow(pPoint[1],pPoint[2])", START, "call bow(pPoint[3],pPoint[2])"]
    others = pgx("bow", "movec(x_p,x_q,tGrip,mFast)", parameters=f"<Parameters>{given}</Parameters>")
    text = made([START, *calls], [*POINTS, value(3, [-20, 30, 0], 'rx="180" ')], others)
    assert olp.correct(text, zero).data == text
    with pytest.raises(ProgramError, match="this arc would be split"):
        olp.correct(text, bent)


def test_an_arc_whose_numbers_a_call_gives_is_refused(zero: Path) -> None:
    bow = LINE.replace("movel(pMove,", "movec(pPoint[1],pMove,")
    calls = [START, "call MoveLine(-60,50,9,180,0,0)"]
    data = datum("pMove", "pointRx", '<Value key="0" fatherId="fPart[0]" />')
    with pytest.raises(ProgramError, match="a call gives the numbers of this arc"):
        corrected(calls, zero, bow, data=data)


def test_the_older_form_of_data(bent: Path, zero: Path) -> None:
    assert olp.correct(S6, zero).data == S6
    done = olp.correct(S6, bent).data
    nominal, written, model = val3.moves(S6), val3.moves(done), JudgeModel(bent)
    assert len(written) > len(nominal) == 2
    for move, place in ((nominal[0], written[0]), (nominal[1], written[-1])):
        want = model.command_for(move.tip[None], move.lever)[0]
        assert np.abs(place.tip - want).max() < 4 * DIGIT
    part = b'\n      <valuePoint index="1" >\n        <tpValue x="'
    assert part in done
    assert done.count(b"<pFather") == 2
    assert b"&quot;movel(p2, &lt;1&gt;&quot;)" in done
    assert b'<mdescValue accel="100" tmax="99999" blend="joint" leave="0.5" reach="0.5" />' in done


def test_one_text_of_several_moves_is_not_changed_for_one_of_them(bent: Path) -> None:
    """The shift in a program that is called for two points belongs to both."""
    given = (
        '<Parameters><Parameter name="x_p" type="pointRx" xsi:type="element" use="reference" /></Parameters>'
    )
    moves = ("movel(appro(x_p,{0,0,-20,0,0,0}),tGrip,mFast)", "movel(x_p,tGrip,mFast)")
    calls = ["call pick(pPoint[0])", "call pick(pPoint[2])"]
    with pytest.raises(ProgramError, match="moves to this target want different numbers"):
        corrected(calls, bent, pgx("pick", *moves, parameters=given))
    lines = corrected(calls, bent, pgx("pick", moves[1], parameters=given))
    assert sum('key="0" x="9.9' in line or 'key="2" x="-60.0' in line for line in lines) == 2


def test_strings_and_comments_say_nothing(zero: Path) -> None:
    quiet = ['popUpMsg("movel(p \\" // , {")', "// movec(", 'logMsg("a") // "movel(', 'x=asc("a",1)/2']
    assert len(corrected([*quiet, "movel(pPoint[0],tGrip,mFast)"], zero)) > 10


def test_what_a_left_move_goes_by_keeps_its_numbers(bent: Path) -> None:
    moves = ["movel(pPoint[0],tGrip,mFast)", "pAway = pPoint[0]", "pAway.trsf.z = pAway.trsf.z + nK"]
    lines = corrected([*moves, "movel(pAway,tGrip,mFast)"], bent, data=datum("pAway", "pointRx", FATHER))
    assert [line.strip() for line in lines if "movel" in line] == [
        "movel(pPoint[3],tGrip,mFast)", "movel(pAway,tGrip,mFast)",
    ]  # fmt: skip
    assert sum(POINTS[0] in line for line in lines) == 1


REFUSED = [
    ([START, "movec(pPoint[1],pPoint[2],mFast)"], "3 arguments; expected an intermediate point", 6),
    (["movec(pPoint[1],here(tGrip,fPart),tGrip,mFast)"], "computed, or chosen in the run", 5),
    ([START, f"movec({{{{0,9,9,180,0,0}},{{{WORDS}}}}},pPoint[2],tGrip,mFast)"], "from another frame", 6),
    ([START, "pPoint[1].trsf.rx = 179", "movec(pPoint[1],pPoint[2],tGrip,mFast)"], "turned by 17.5 mrad", 7),
    (["movel(pPoint[0],tNone,mFast)"], "does not state the tool tNone", 5),
    (["movel(pPoint[nK],tGrip,mFast)"], "computed, or chosen in the run", 5),
    (["delay(1)", "movel(pGone,tGrip,mFast)"], "pGone is not stated", 6),
    (["pPoint[0].trsf = pPoint[1].trsf * fPart.trsf", "movel(pPoint[0],tGrip,mFast)"], "computed in", 6),
    (["if nK == 1", "tGrip.trsf.z = 1", "endIf", "movel(pPoint[0],tGrip,mFast)"], "block of line 5", 8),
    (["while true", "movel(pPoint[0],tGrip,mFast)", "pPoint[0].trsf.x=nK", "endWhile"], "block of line 5", 6),
    (["setFrame(pPoint[0],pPoint[1],pPoint[2],fPart[0])", "movel(pPoint[0],tGrip,mFast)"], "line 5 may", 6),
    (["pPoint[0].trsf.x = 1", "movel(pPoint[0],tGrip,mFast)", "pPoint[0].trsf.x = 2",
      "movel(pPoint[0],tGrip,mFast)"], "some of its numbers from another one", 8),
    (["movel(pPoint[0],tGrip,mFast"], "bracket is not closed", 5),
    (["movel(pPoint[0],tGrip)"], "the move has 2 arguments", 5),
    (["if movel(pPoint[0],tGrip,mFast) > 0", "endIf"], "in the line of a block", 5),
    (["call start()"], "call each other more than", 5),
    (["for nK = 0 to 3", "endIf"], "ends no block", 6),
    (["movel(compose(pPoint[0],fPart,{0,0,1,0,0,5}),tGrip,mFast)"], "turns the point about a frame", 5),
    (["delay(1)", "alterMovel(pPoint[0],tGrip,mFast)"], "altered in the run", 6),
    (["LIN P1"], "not a statement of VAL 3", 5),
]  # fmt: skip


@pytest.mark.parametrize(("lines", "told", "line"), REFUSED)
def test_refused_with_its_line(lines: list[str], told: str, line: int, zero: Path) -> None:
    with pytest.raises(ProgramError, match=told) as caught:
        corrected(lines, zero)
    assert caught.value.line == line


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        (["fPart.trsf.x=nK"], "the frame fPart"),
        (["tGrip.trsf.z=nK"], "the tool tGrip"),
        (["movel(appro(pPoint[1],{0,0,nK,0,0,0}),tGrip,mFast)"], "the shift of appro in line 9"),
        (["delay(nK)"], "nK, which line 9 uses"),
        (["if nK>100", "endIf"], "nK, which line 9 uses"),
        (["nK=nK+1"], "nK, which line 9 uses"),
        (["nK=7", "call to(nK)", "delay(nK)"], "nK, which line 11 uses"),
        (["call wait(8)"], "nX, which line 8 of part1.pgx uses"),
        (["nK=5", "delay(1) // nK"], ""),
    ],
)
def test_numbers_of_a_target_that_are_needed_as_they_are(
    bent: Path, zero: Path, lines: list[str], told: str
) -> None:
    """A corrected number of one target would move a frame, a tool, or what the run decides by it."""
    points = [value(k, [10.0 + k, 20.0, 30.0], 'rx="180" ') for k in range(3)]
    first = ["nK=150", "pPoint[2].trsf.x=nK", "movel(pPoint[0],tGrip,mFast)"]
    given = '<Parameters><Parameter name="nX" type="num" xsi:type="element" /></Parameters>\r\n'
    own = ["pPoint[1].trsf.y=nX", "movel(pPoint[1],tGrip,mFast)"]
    called = {"to": own, "wait": [*own, "delay(nX)"]}
    others = [pgx(name, *code, parameters=given) for name, code in called.items() if f"{name}(" in str(lines)]
    first = [*first, "movel(pPoint[2],tGrip,mFast)", *lines, "movel(pPoint[0],tGrip,mFast)"]
    text = made(first, points, *others)
    more = datum("nK", "num", '<Value key="0" value="1" />').encode()
    text = text.replace(b"  </Datas>", more + b"  </Datas>")
    if not told:
        assert b"nK=150\r" not in olp.correct(text, bent).data
        return
    with pytest.raises(ProgramError, match=told):
        olp.correct(text, zero)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("<!DOCTYPE a [<!ENTITY b SYSTEM '/etc/hostname'>]><Programs>&b;</Programs>", "document type"),
        ("<Programs>" * 40 + "</Programs>" * 40, "nested more than 32 deep"),
        ("<Programs><Program></Programs>", "</Programs> ends no element"),
        ("<Programs><Program name='a'>", "is not ended"),
        ("moves", "no element begins"),
    ],
)
def test_xml_that_is_not_read(text: str, told: str, zero: Path, tmp_path: Path) -> None:
    (tmp_path / "a.pgx").write_text(text)
    with pytest.raises(OlpError, match=told) as caught:
        olp.correct(tmp_path / "a.pgx", zero)
    assert isinstance(caught.value, ProgramError)
    assert caught.value.code == "OLP506"


PROJECT = """<?xml version="1.0" encoding="utf-8" ?>
<Project xmlns="http://www.staubli.com/robotics/VAL3/Project/3">
  <Parameters version="s7.3.1" stackSize="5000" millimeterUnit="true" />
  <Programs><Program file="start.pgx" /><Program file="pick.pgx" /></Programs>
  <Database><Data file="cell.dtx" /><Data file="../other.dtx" /></Database>
</Project>
"""


def application(folder: Path) -> dict[str, bytes]:
    """The files of an application, whose project has another name than its folder."""
    folder.mkdir()
    program_, _, data = made(["call pick()"], POINTS).decode().partition("\n<!--olp: file part0.dtx-->\n")
    moves = ("movel(appro(pPoint[0],{0,0,9,0,0,0}),tGrip,mSlow)", "movel(pPoint[0],tGrip,mSlow)")
    pick = pgx("pick", *moves)
    files = {
        "start.pgx": program_.encode(), "pick.pgx": "\ufeff".encode() + pick.encode(),
        "cell.dtx": data.encode(), "cell.pjx": PROJECT.encode(),
    }  # fmt: skip
    for name, text in files.items():
        (folder / name).write_bytes(text)
    return files


@pytest.mark.slow
def test_all_files_of_an_application_are_written_or_none(bent: Path, zero: Path, tmp_path: Path) -> None:
    files = application(tmp_path / "app")
    (tmp_path / "other.dtx").write_text("never read")
    (tmp_path / "same").mkdir()
    olp.correct(tmp_path / "app" / "start.pgx", zero).write(tmp_path / "same" / "start.pgx")
    assert {p.name: p.read_bytes() for p in (tmp_path / "same").iterdir()} == files
    for first in ("start.pgx", "cell.pjx"):
        out = tmp_path / first[:4]
        out.mkdir()
        done = olp.correct(tmp_path / "app" / first, bent)
        done.write(out / first)
        assert {p.name for p in out.iterdir()} == set(files)
        written = {name: (out / name).read_bytes() for name in files}
        assert b"pPoint" in written["pick.pgx"]
        assert written["pick.pgx"] != files["pick.pgx"]
        assert written["cell.dtx"] != files["cell.dtx"]
        assert written[first] == olp.correct(tmp_path / "app" / first, bent).data.partition(b"\n<!--olp")[0]
        assert olp.verify(tmp_path / "app" / first, out / first, bent).report["verdict"]["ok"]
    (out / "start.pgx").unlink()
    (out / first).unlink()
    with pytest.raises(OlpError, match="exists already"):
        done.write(out / first)
    assert not (out / first).exists()
    with pytest.raises(OlpError, match="is an input"):
        done.write(tmp_path / "app" / "other.pjx", force=True)


def test_no_file_of_an_application_is_overwritten_by_its_correction(bent: Path, tmp_path: Path) -> None:
    """Also where the command line leaves the name of the output to us, and is told to overwrite."""
    files, folder = application(tmp_path / "app"), tmp_path / "app"
    for more in ((), ("--force",), ("-o", str(folder / "out.pgx"), "--force")):
        call = CliRunner().invoke(main, ["correct", str(folder / "start.pgx"), "-m", str(bent), *more])
        assert call.exit_code == 2
        assert {p.name: p.read_bytes() for p in folder.iterdir()} == files


def test_a_refusal_names_file_and_line(zero: Path, tmp_path: Path) -> None:
    files = application(tmp_path / "app")
    pick, data = tmp_path / "app" / "pick.pgx", tmp_path / "app" / "cell.dtx"
    pick.write_bytes(files["pick.pgx"].replace(b"movel(pPoint[0]", b"movel(pPoint[7]"))
    with pytest.raises(ProgramError, match="pPoint\\[7\\]: the text does not state") as caught:
        olp.correct(tmp_path / "app" / "start.pgx", zero)
    assert (caught.value.file, caught.value.line) == (str(pick), 6)
    pick.write_bytes(files["pick.pgx"])
    data.write_bytes(files["cell.dtx"].replace(b'x="10"', b'x="1,0"'))
    with pytest.raises(ProgramError, match="pPoint: the text does not state") as caught:
        olp.correct(tmp_path / "app" / "start.pgx", zero)
    assert (caught.value.file, caught.value.line) == (str(pick), 5)
    data.unlink()
    with pytest.raises(ProgramError, match="give the data") as caught:
        olp.correct(tmp_path / "app" / "start.pgx", zero)
    (tmp_path / "app" / "cell.pjx").write_text(PROJECT.replace("true", "false"))
    with pytest.raises(ProgramError, match="in inch") as caught:
        olp.correct(tmp_path / "app" / "start.pgx", zero)
    assert caught.value.line == 3
    # what a program that is not followed changes is not known
    (tmp_path / "app" / "cell.pjx").write_text(PROJECT)
    data.write_bytes(files["cell.dtx"])
    (tmp_path / "app" / "start.pgx").write_text(pgx("start", "tGrip.trsf.z = 100"))
    with pytest.raises(ProgramError, match=r"line 5 of start\.pgx, which this program does not run"):
        olp.correct(pick, zero)


def test_frames_and_tools_of_the_job(tmp_path: Path, zero: Path) -> None:
    """One that both state differently is refused; one that the program leaves open is the job's."""
    recipe = Recipe(
        controller="staubli-val3", job_defaults={},
        tools={1: {"gauge_to_tip_mm": [1.0, 2.0, -3.0], "name": "tJob"}},
        work_offsets={"fPart": {"X_mm": 1.0}, "fCell": {"X_mm": 250.0, "Y_mm": 200.0, "Z_mm": -300.0}},
    )  # fmt: skip
    machine = machines.zero_machine(tmp_path, recipe)
    with pytest.raises(ProgramError, match=r"the frame fPart is stated by the program and by"):
        corrected(["movel(pPoint[0],tGrip,mFast)"], machine)
    own = datum("pOwn", "pointRx", '<Value key="0" x="5" fatherId="fCell[0]" />')
    corrected(["movel(pOwn,tJob,mFast)"], machine, data=own)
    with pytest.raises(ProgramError, match="fCell"):
        corrected(["movel(pOwn,tGrip,mFast)"], zero, data=own)


def test_points_of_a_scara_are_as_those_of_an_arm(bent: Path, zero: Path) -> None:
    text = program(np.random.default_rng(5), 12)
    other = text.replace(b"pointRx", b"pointRs")
    assert olp.correct(other, zero).data == other
    assert olp.correct(other, bent).data == olp.correct(text, bent).data.replace(b"pointRx", b"pointRs")


def test_joints_that_are_not_corrected_stay_as_they_are(bent: Path) -> None:
    """Four of a SCARA, and some that the data leave open: the moves behind them are corrected."""
    scara = '<Value key="0" j1="10" j2="20" j3="30" j4="40" />'
    data = datum("jHome", "jointRs", scara) + '<Data name="jOpen" xsi:type="array" type="jointRx" size="1" />'
    moves = ["movej(jHome,tGrip,mFast)", "movej(jOpen,tGrip,mFast)", "movel(pPoint[1],tGrip,mFast)"]
    lines = corrected(moves, bent, data=data)
    assert sum(scara in line for line in lines) == 1
    assert any('key="1" x="29.9' in line for line in lines)
    with pytest.raises(ProgramError, match="the target jOpen: the text does not state all its numbers"):
        corrected(moves[1:2], bent, data=data)


TASK = pgx("cycle", "movel(pPoint[1],tGrip,mFast)")
STILL_TASK = pgx("watch", "delay(1)")


def test_a_task_that_moves_is_corrected_by_itself(bent: Path) -> None:
    """Moves beside it are corrected at their ends, and one that only watches changes nothing."""
    moves = ["movel(pPoint[0],tGrip,mFast)", "movel(pPoint[2],tGrip,mFast)"]
    text = made(['taskCreate "w",10,watch()', *moves], POINTS, TASK, STILL_TASK)
    assert olp.correct(text, bent).report["moves"]["split"] == 1
    text = made(["taskCreateSync sName,0.1,bLate,cycle()", *moves], POINTS, TASK, STILL_TASK)
    result = olp.correct(text, bent)
    assert result.report["moves"]["split"] == 0
    told = [f.message for f in result.findings]
    assert any("cycle is a task of its own" in what and "with cycle.pgx in place" in what for what in told)
    assert any("begins depends on the run" in what for what in told)
    assert result.report["moves"]["corrected"] == 2
    with pytest.raises(ProgramError, match="correct it by itself"):
        olp.correct(made(['taskCreateSync "c",0.1,bLate,cycle()'], POINTS, TASK), bent)


def test_the_only_task_that_moves_is_followed(bent: Path) -> None:
    """From where it begins, with its arguments. Not where there are two, or where it may begin again."""
    lines = ['taskCreate "w",10,watch()', 'taskCreate "c",10,cycle()', "wait(false)"]
    run = ["movej(pPoint[0],tGrip,mFast)", "movel(pPoint[1],tGrip,mFast)", "movel(pPoint[2],tGrip,mFast)"]
    result = olp.correct(made(lines, POINTS, pgx("cycle", *run), STILL_TASK), bent)
    called = olp.correct(made(["call watch()", "call cycle()"], POINTS, pgx("cycle", *run), STILL_TASK), bent)
    assert result.report["moves"]["corrected"] == 3
    assert result.report["moves"]["split"] == called.report["moves"]["split"] > 0
    assert result.data[result.data.index(b"<Datas>") :] == called.data[called.data.index(b"<Datas>") :]
    assert any("cycle is followed from here on" in one.message for one in result.findings)
    for more in ([lines[1]], ["if nX>1", lines[1], "endIf"]):
        with pytest.raises(ProgramError, match="correct it by itself"):
            olp.correct(made([*(lines if len(more) == 1 else []), *more], POINTS, TASK, STILL_TASK), bent)
    with pytest.raises(ProgramError, match="correct it by itself"):
        olp.correct(made([lines[1], "resetMotion()"], POINTS, TASK), bent)


@pytest.mark.parametrize("where", ["watch", "start"])
def test_what_another_task_may_change_is_not_known(where: str, bent: Path) -> None:
    """Also behind a statement of the task itself that gives it numbers."""
    change = "pNear.trsf.x=pNear.trsf.x+1"
    lines = [
        'taskCreate "w",10,watch()',
        'taskCreate "c",10,cycle()',
        change if where == "start" else "delay(1)",
    ]
    watch = pgx("watch", change if where == "watch" else "delay(1)")
    run = ["pNear.trsf={12,0,5,180,0,0}", "movel(pNear,tGrip,mFast)", "movel(pPoint[2],tGrip,mFast)"]
    near = datum("pNear", "pointRx", POINTS[0]) + "  </Datas>"
    text = made(lines, POINTS, pgx("cycle", *run), watch).replace(b"  </Datas>", near.encode())
    result = olp.correct(text, bent)
    assert result.report["moves"]["corrected"] == 1
    says = "may change it at any time" if where == "watch" else "changes it meanwhile"
    assert any(says in one.message for one in result.findings)
