"""The five forms of arcs, by hand: centre, direction, size, and words that contradict each other."""

from __future__ import annotations

import numpy as np
import pytest
from cases.acceptance import machine

from olp.core.errors import ProgramError
from olp.core.machine import Setup
from olp.files.config import load_setup
from olp.program.apt.arcs import Resolved, joints
from olp.program.program import Program
from olp.program.registry import DIALECTS, read

HALF = np.pi
HEAD = "UNITS/MM\nFEDRAT/100,MMPM\n"


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    tables = '[work_offsets.G54]\nset_by = "true"\nX_mm = 100.0\n'
    return load_setup(machine(tmp_path_factory.mktemp("apt"), tables=tables))


def program(text: str, setup: Setup, head: str = HEAD) -> Program:
    return read((head + text).encode(), setup, DIALECTS["apt"])


def sweeps(text: str, setup: Setup) -> list[float]:
    """Signed sweeps of the arcs, in half turns."""
    return (program(text, setup).toolpath.arcs.sweep_rad / HALF).tolist()


QUARTERS = {
    "NX and Creo": "GOTO/10,0,5\nCIRCLE/0,0,5,0,0,{n},10\nGOTO/0,10,5\n",
    "more numbers": "GOTO/10,0,5\nCIRCLE/0,0,5,0,0,{n},10,1,2,3\nGOTO/0,10,5\n",
    "over two cards": "GOTO/10,0,5\nCIRCLE/0,0,5,$\n0,0,{n},10\nGOTO/0,10,5\n",
    "SolidWorks": "GOTO/10,0,5\nCIRCLE/0,0,5,0,0,{n}\nGOTO/0,10,5\n",
    "other lengths": "GOTO/10,0,5\nCIRCLE/0,0,5,0,0,{n}7,10\nGOTO/0,10,5\n",
    "lower case": "goto/10,0,5\ncircle/0,0,5,0,0,{n},10\ngoto/0,10,5\n",
}


@pytest.mark.parametrize("form", QUARTERS)
def test_a_circle_turns_right_handed_about_its_normal(form: str, setup: Setup) -> None:
    if form == "other lengths":
        pairs = (("0.", 0.5), ("-0.", -1.5))
    else:
        pairs = (("1", 0.5), ("-1", -1.5))
    for normal, sweep in pairs:
        text = QUARTERS[form].format(n=normal)
        assert sweeps(text, setup) == pytest.approx([sweep])
        arcs = program(text, setup).toolpath.arcs
        assert arcs.centre_mm.tolist() == [[100.0, 0.0, 5.0]]
        assert arcs.plane.tolist() == [0]


@pytest.mark.parametrize(
    ("normal", "start", "end", "plane"),
    [("0,0,1", "10,0,0", "0,10,0", 0), ("0,1,0", "0,0,10", "10,0,0", 1), ("1,0,0", "0,10,0", "0,0,10", 2)],
)
def test_each_plane_has_its_normal(normal: str, start: str, end: str, plane: int, setup: Setup) -> None:
    arcs = program(f"GOTO/{start}\nCIRCLE/0,0,0,{normal},10\nGOTO/{end}\n", setup).toolpath.arcs
    assert arcs.plane.tolist() == [plane]
    assert arcs.sweep_rad == pytest.approx([HALF / 2])


@pytest.mark.parametrize(
    ("times", "sweep"), [("", 0.5), (",TIMES,1", 0.5), (",TIMES,3", 4.5), (",TIMES,0", 0.5)]
)
def test_full_circles_come_before_the_last_part(times: str, sweep: float, setup: Setup) -> None:
    text = f"GOTO/10,0,5\nCIRCLE/0,0,5,0,0,1,10{times}\nGOTO/0,10,5\n"
    assert sweeps(text, setup) == pytest.approx([sweep])


@pytest.mark.parametrize(("normal", "angle", "sweep"), [(1, "90", 0.5), (-1, "270", -1.5), (1, "-90.", 0.5)])
def test_movarc_states_its_angle(normal: int, angle: str, sweep: float, setup: Setup) -> None:
    text = f"GOTO/10,0,5\nMOVARC/0,0,5,0,0,{normal},10,ANGLE,{angle}\nGOTO/0,10,5\n"
    assert sweeps(text, setup) == pytest.approx([sweep])


@pytest.mark.parametrize(
    ("angle", "fits"),
    # 2 mrad and what 0.01 mm subtends at 10 mm, 1 mrad: 0.1718 degrees
    [("90.17", True), ("89.83", True), ("90.18", False), ("89.82", False), ("80", False), ("450", True)],
)
def test_a_stated_angle_is_that_of_the_points(angle: str, fits: bool, setup: Setup) -> None:
    text = f"GOTO/10,0,5\nMOVARC/0,0,5,0,0,1,10,ANGLE,{angle}\nGOTO/0,10,5\n"
    if fits:
        assert sweeps(text, setup) == pytest.approx([0.5])
        return
    with pytest.raises(ProgramError, match=r"degrees, and its points give 90\.0000") as caught:
        program(text, setup)
    assert caught.value.line == 4


@pytest.mark.parametrize(
    ("radius", "fits"), [("10.028", True), ("9.972", True), ("10.029", False), ("9.971", False)]
)
def test_a_stated_radius_is_that_of_the_start(radius: str, fits: bool, setup: Setup) -> None:
    text = f"GOTO/10,0,5\nCIRCLE/0,0,5,0,0,1,{radius}\nGOTO/0,10,5\n"
    if fits:
        assert sweeps(text, setup) == pytest.approx([0.5])
        return
    with pytest.raises(ProgramError, match=r"its start is 10\.0000 mm from its centre") as caught:
        program(text, setup)
    assert caught.value.line == 4


CATIA = "GOTO/10,0,5\nINDIRV/{v},0\nTLON,GOFWD/({c},10),ON,{again}(LINE/0,0,5,{end})\n"
ROUND = "CIRCLE/0,0,5"


@pytest.mark.parametrize(
    ("begins", "again", "end", "sweep"),
    [
        ("0,1", "", "0,10,5", 0.5), ("0,-1", "2,INTOF,", "0,10,5", -1.5), ("0,-1", "", "0,-10,5", -0.5),
        ("0,1", "2,INTOF,", "0,-10,5", 1.5), ("0,2", "", "-10,0,5", 1.0), ("0,1", "2,INTOF,", "10,0,5", 2.0),
        ("9,1", "", "0,10,5", 0.5),
    ],
)  # fmt: skip
@pytest.mark.parametrize("circle", (ROUND, "CYLNDR/0,0,5,0,0,1"))
def test_catia_says_how_the_arc_begins(
    circle: str, begins: str, again: str, end: str, sweep: float, setup: Setup
) -> None:
    text = CATIA.format(v=begins, c=circle, again=again, end=end)
    got = program(text, setup).toolpath
    assert (got.arcs.sweep_rad / HALF).tolist() == pytest.approx([sweep])
    assert got.end_mm[-1].tolist() == [100.0 + float(end.split(",")[0]), *map(float, end.split(",")[1:])]


@pytest.mark.parametrize(
    ("begins", "again", "end", "words"),
    [
        ("0,1", "", "0,-10,5", "meets its line the first time on the other side"),
        ("0,1", "2,INTOF,", "0,10,5", "meets its line the second time on the other side"),
        ("1,0", "", "0,10,5", "INDIRV does not say"),
        ("1,.1", "", "0,10,5", "INDIRV does not say"),
    ],
)
def test_catia_words_that_contradict_each_other(
    begins: str, again: str, end: str, words: str, setup: Setup
) -> None:
    with pytest.raises(ProgramError, match=words):
        program(CATIA.format(v=begins, c=ROUND, again=again, end=end), setup)


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("GOTO/10,0,5\nMOVARC/0,0,5,0,0,1,10\nGOTO/0,10,5\n", 4, "MOVARC has no ANGLE"),
        ("GOTO/10,0,5\nMOVARC/0,0,5,0,0,1,10,ANGLE\nGOTO/0,10,5\n", 4, "MOVARC has no ANGLE"),
        ("GOTO/10,0,5\nMOVARC/0,0,5,0,0,1\nGOTO/0,10,5\n", 4, "MOVARC has 6 numbers where 7 are expected"),
        ("GOTO/10,0,5\nCIRCLE/0,0,5,0,0\nGOTO/0,10,5\n", 4, "CIRCLE has 5 numbers where 6 are expected"),
        ("GOTO/10,0,5\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,5,10),ON,(LINE/1,0,5,0,10,5)\n", 5,
         "LINE of TLON does not begin at the centre"),
        ("GOTO/10,0,5\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,5,10),ON,(PLANE/1)\n", 5, "form of TLON"),
    ],
)  # fmt: skip
def test_what_is_no_arc_is_refused_with_its_line(text: str, line: int, words: str, setup: Setup) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        program(text, setup)
    assert caught.value.line == line


def test_a_joint_is_smooth_backward_or_a_corner() -> None:
    """A half circle about the origin from X10, counter-clockwise: it begins along +Y."""
    start = np.array([[10.0, 0.0, 0.0]] * 4)
    before = start - np.array([[0.0, 5.0, 0.0], [0.0, -5.0, 0.0], [5.0, 5.0, 0.0], [0.0, 5.0, 0.1]])

    def joint(sweep: float) -> list[int]:
        arcs = Resolved(np.zeros((4, 3)), np.zeros(4, np.int64), np.full(4, sweep))
        return joints(arcs, start, before).tolist()

    assert joint(HALF) == [1, -1, 0, 0]
    assert joint(-HALF) == [-1, 1, 0, 0]
    other = Resolved(np.zeros((1, 3)), np.array([2]), np.array([HALF]))
    begin = np.array([[0.0, 10.0, 0.0]])
    assert joints(other, begin, begin - [[0.0, 0.0, 3.0]]).tolist() == [1]


#: An arc that goes on as the line before it, and one that turns back.
ONWARD = "GOTO/10,-10,5\nGOTO/10,0,5\nCIRCLE/0,0,5,0,0,1,10{more}\nGOTO/0,10,5\n"
BACK = ONWARD.replace("0,0,1", "0,0,-1")


@pytest.mark.parametrize(
    ("onward", "back", "refused"), [(0, 2, False), (0, 3, True), (1, 3, True), (2, 4, False), (2, 5, True)]
)
def test_several_arcs_that_turn_back_are_left_handed(
    onward: int, back: int, refused: bool, setup: Setup
) -> None:
    text = (ONWARD * onward + BACK * back).format(more="")
    if not refused:
        assert len(program(text, setup).toolpath.arcs) == onward + back
        return
    with pytest.raises(ProgramError, match="its normal seems to be left-handed") as caught:
        program(text, setup)
    assert caught.value.line == 2 + 4 * onward + 3


@pytest.mark.parametrize(
    ("text", "line"),
    [(ONWARD, None), (BACK, 5), (ONWARD.replace("GOTO/10,-10,5", "GOTO/20,-10,5"), None),
     (ONWARD.replace("GOTO/10,-10,5", "GOTO/20,-10,5").replace("{more}", ",1,2"), 5),
     (ONWARD.replace("GOTO/10,-10,5", "GOTO/20,-10,5").replace("{more}", ",1,TIMES,1"), 5),
     (ONWARD.replace("GOTO/10,-10,5", "GOTO/20,-10,5").replace("{more}", ",TIMES,1"), None),
     (ONWARD.replace("{more}", ",1,2"), None)],
)  # fmt: skip
def test_arcs_whose_direction_nothing_shows_are_remarked(text: str, line: int | None, setup: Setup) -> None:
    remarks = program(text.format(more=""), setup).remarks
    assert [at for what, at, _ in remarks if what == "arcs"] == ([] if line is None else [line])


def test_a_point_may_end_with_one_comma(setup: Setup) -> None:
    assert program("GOTO/1,2,3,\n", setup).toolpath.end_mm.tolist() == [[101.0, 2.0, 3.0]]
