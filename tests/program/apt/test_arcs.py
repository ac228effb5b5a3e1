"""The five forms of arcs, by hand: centre, direction, size, and words that contradict each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import machine
from cases.readings import arc_of

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
    "Creo": "GOTO/10,0,5\nCIRCLE/0,0,5,0,0,{n},10\nGOTO/0,10,5\n",
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
    ("circle", "sweep"),
    [("0,0,1,10,.06,.5,10,0", -1.5), ("0,0,-1,10,.06,.5,10,0", 0.5), ("0,0,1,10,.06,.5,10,0,TIMES,1", -1.5),
     ("$\n0,0,1,10,.06,.5,10,0", -1.5), ("0,0,1,10,.06,.5,10", 0.5), ("0,0,1,10,.06,.5,10,0,1", 0.5)],
)  # fmt: skip
def test_a_circle_of_nx_turns_clockwise_about_its_vector(circle: str, sweep: float, setup: Setup) -> None:
    """Its documentation of CLSF says so, and 149 of 149 joints of public programs."""
    text = f"GOTO/10,0,5\nCIRCLE/0,0,5,{circle}\nGOTO/0,10,5\n"
    read_back = program(text, setup)
    assert (read_back.toolpath.arcs.sweep_rad / HALF).tolist() == pytest.approx([sweep])
    assert bool(read_back.remarks) == (circle.count(",") not in (7, 9))


def test_the_form_of_nx_is_judged_by_its_joints_too(setup: Setup) -> None:
    text = "GOTO/10,{y},5\nGOTO/10,0,5\nCIRCLE/0,0,5,0,0,1,10,.06,.5,10,0\nGOTO/0,10,5\n"
    assert sweeps(text.format(y=10) * 3, setup) == pytest.approx([-1.5] * 3)
    with pytest.raises(ProgramError, match="arcs seem to turn the other way"):
        program(text.format(y=-10) * 3, setup)


@pytest.mark.parametrize(
    ("normal", "start", "end", "plane"),
    [("0,0,1", "10,0,0", "0,10,0", 0), ("0,1,0", "0,0,10", "10,0,0", 1), ("1,0,0", "0,10,0", "0,0,10", 2)],
)
def test_each_plane_has_its_normal(normal: str, start: str, end: str, plane: int, setup: Setup) -> None:
    arcs = program(f"GOTO/{start}\nCIRCLE/0,0,0,{normal},10\nGOTO/{end}\n", setup).toolpath.arcs
    assert arcs.plane.tolist() == [plane]
    assert arcs.sweep_rad == pytest.approx([HALF / 2])


@pytest.mark.parametrize(
    ("times", "sweep"), [("", 0.5), (",TIMES,1", 0.5), (",TIMES,3.0", 4.5), (",TIMES,0", 0.5)]
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
        ("9,1", "", "0,10,5", 0.5), ("0,.05", "", "0,10,5", 0.5), ("0,-.05", "", "0,-10,5", -0.5),
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
    with pytest.raises(ProgramError, match="arcs seem to turn the other way") as caught:
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


# -- boundaries, units, planes -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "line", "code", "words"),
    [
        ("GOTO/10,0,5\nCIRCLE/0,0,5,0,0\nGOTO/0,10,5", 4, "OLP516",
         "CIRCLE has 5 numbers where 6 are expected; send the output"),
        ("GOTO/10,0,5\nCIRCLE/C1\nGOTO/0,10,5", 4, "OLP516", "CIRCLE has 0 numbers where 6"),
        ("GOTO/10,0,5\nCIRCLE/0,0,5,0,0,N\nGOTO/0,10,5", 4, "OLP516", "CIRCLE has 5 numbers"),
        ("GOTO/10,0,5\nMOVARC/0,0,5,0,0,1,R,ANGLE,90\nGOTO/0,10,5", 4, "OLP516", "MOVARC has 6 numbers"),
        ("GOTO/10,0,5\nMOVARC/0,0,5,0,0,1,10,ANGLE\nGOTO/0,10,5", 4, "OLP516",
         "MOVARC has no ANGLE; expected"),
        ("GOTO/10,0,5\nMOVARC/0,0,5,0,0,1,10,ANGLE,A\nGOTO/0,10,5", 4, "OLP516",
         "MOVARC has no ANGLE; expected"),
        ("TLON,GOBACK/(CIRCLE/0,0,5,10),ON,(LINE/0,0,5,0,10,5)", 3, "OLP516",
         "this form of TLON is not read"),
        ("TLON,GOFWD/(LINE/0,0,5,0,10,5)", 3, "OLP516", "this form of TLON is not read"),
        ("TLON,GOFWD/(CIRCLE/0,0,5,10),ON,(PLANE/1)", 3, "OLP516", "this form of TLON is not read"),
        ("TLON,GOFWD/(CIRCLE/0,0,5),ON,(LINE/0,0,5,0,10,5)", 3, "OLP516", "CIRCLE has 3 numbers where 4"),
        ("TLON,GOFWD/(CYLNDR/0,0,5,0,0,1),ON,(LINE/0,0,5,0,10,5)", 3, "OLP516",
         "CYLNDR has 6 numbers where 7"),
        ("TLON,GOFWD/(CIRCLE/0,0,5,10),ON,(LINE/0,0,5,0,10)", 3, "OLP516", "LINE has 5 numbers where 6"),
        ("TLON,GOFWD/(CIRCLE/0,0,5,10),ON,(LINE/.0011,0,5,0,10,5)", 3, "OLP530",
         "LINE of TLON does not begin"),
        ("TLON,GOFWD/(CIRCLE/0,0,5,10),ON,(LINE/0,-.0011,5,0,10,5)", 3, "OLP530",
         "LINE of TLON does not begin"),
        ("GOTO/10,0,5\nTLON,GOFWD/(CIRCLE/0,0,5,10),ON,(LINE/0,0,5,0,10,5)", 4, "OLP532",
         "no INDIRV comes before"),
        ("GOTO/10,0,5\nINDIRV/0,1\nTLON,GOFWD/(CIRCLE/0,0,5,10),ON,(LINE/0,0,5,0,10,5)", 4, "OLP516",
         "INDIRV has 2 numbers where 3"),
        ("GOTO/10,0,5\nINDIRV/1,0,0\nTLON,GOFWD/(CIRCLE/0,0,5,10),ON,(LINE/0,0,5,0,10,5)", 5, "OLP516",
         "INDIRV does not say in which direction"),
        ("GOTO/10,0,5\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,5,10),ON,(LINE/0,0,5,0,-10,5)", 5, "OLP530",
         "the arc meets its line the first time"),
        ("GOTO/10,0,5\nINDIRV/0,1,0\nTLON,GOFWD/(CYLNDR/0,0,5,0,.6,.8,10),ON,(LINE/0,0,5,0,10,5)", 5,
         "OLP530", "the radius of an arc is 10.0000 mm at its start"),
        ("GOTO/10,0,5\nCIRCLE/0,0,5,0,0,0,10\nGOTO/0,10,5", 4, "OLP516", "the normal of an arc has no l"),
        ("GOTO/10,0,5\nCIRCLE/0,0,5,0,0,1,11\nGOTO/0,10,5", 4, "OLP530",
         r"states a radius of 11\.0000 mm, and its start is 10\.0000 mm from its centre"),
        ("GOTO/10,0,5\nCIRCLE/0,0,5,0,0,1E0,11\nGOTO/0,10,5", 4, "OLP530", r"states a radius of 11\.0000 mm"),
        ("GOTO/10,0,5\nMOVARC/0,0,5,0,0,1,10,ANGLE,80\nGOTO/0,10,5", 4, "OLP530",
         r"states an angle of 80\.0000 degrees, and its points give 90\.0000"),
        (BACK * 3, 5, "OLP530", "arcs seem to turn the other way"),
    ],
)  # fmt: skip
def test_a_refusal_has_its_line_its_code_and_its_sentence(
    text: str, line: int, code: str, words: str, setup: Setup
) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        program(text.format(more="") + "\n", setup)
    assert (caught.value.line, caught.value.code) == (line, code)


@pytest.mark.parametrize(
    ("normal", "plane"),
    # the sine between normal and axis is below 1e-6 in the last ones that are read
    [("0,.0000009,1", 0), (".0000009,0,-1", 0), ("0,.0000011,1", None), ("0,0,2.5", 0), (".0000022,0,2",
    None),
     ("0,1,.0000009", 1), ("0,1,.0000011", None), ("1,0,.0000009", 2), (".0000018,0,2", 0)],
)  # fmt: skip
def test_a_normal_is_along_an_axis_of_the_machine(normal: str, plane: int | None, setup: Setup) -> None:
    start, end = {0: ("10,0,5", "0,10,5"), 1: ("0,0,15", "10,0,5"), 2: ("0,10,5", "0,0,15")}[
        int(normal.startswith("0,1")) if plane is None else plane
    ]
    text = f"GOTO/{start}\nCIRCLE/0,0,5,{normal},10\nGOTO/{end}\n"
    if plane is not None:
        assert program(text, setup).toolpath.arcs.plane.tolist() == [plane]
        return
    path = program(text, setup).toolpath
    assert len(path.arcs) == 0 and len(path) > 50


def test_arcs_in_inches_have_radii_in_inches(setup: Setup) -> None:
    for form in ("CIRCLE/0,0,1,0,0,1,2", "CIRCLE/0,0,1,0,0,1,-2", "MOVARC/0,0,1,0,0,1,2,ANGLE,90"):
        arcs = program(f"GOTO/2,0,1\n{form}\nGOTO/0,2,1\n", setup, "UNITS/INCH\n").toolpath.arcs
        assert arcs.centre_mm.tolist() == [[100.0, 0.0, 25.4]]
        assert arcs.sweep_rad == pytest.approx([HALF / 2])
    with pytest.raises(ProgramError, match=r"a radius of 76\.2000 mm, and its start is 50\.8000 mm"):
        program("GOTO/2,0,1\nCIRCLE/0,0,1,0,0,1,3\nGOTO/0,2,1\n", setup, "UNITS/INCH\n")


@pytest.mark.parametrize(
    ("size", "radius", "fits"),
    # within 0.0283 mm, and from 28.3 mm on within 0.1 %
    [(10, 10.028, True), (10, 10.029, False), (100, 100.099, True), (100, 100.101, False), (100, 99.901,
    True),
     (100, 99.899, False)],
)  # fmt: skip
def test_how_far_a_stated_radius_may_be_off(size: int, radius: float, fits: bool, setup: Setup) -> None:
    text = f"GOTO/{size},0,5\nCIRCLE/0,0,5,0,0,1,{radius}\nGOTO/0,{size},5\n"
    if fits:
        assert sweeps(text, setup) == pytest.approx([0.5])
        return
    with pytest.raises(ProgramError, match="the arc states a radius of"):
        program(text, setup)


@pytest.mark.parametrize(
    ("plane", "start", "end"), [("1,0,0", "0,10,5", "0,0,15"), ("0,1,0", "0,0,15", "10,0,5")]
)
@pytest.mark.parametrize(("radius", "angle", "fits"), [(10, 90, True), (11, 90, False), (10, 80, False)])
def test_radius_and_angle_are_those_of_the_plane(
    plane: str, start: str, end: str, radius: int, angle: int, fits: bool, setup: Setup
) -> None:
    text = f"GOTO/{start}\nMOVARC/0,0,5,{plane},{radius},ANGLE,{angle}\nGOTO/{end}\n"
    if fits:
        assert sweeps(text, setup) == pytest.approx([0.5])
        return
    with pytest.raises(ProgramError, match="the arc states"):
        program(text, setup)


@pytest.mark.parametrize(
    ("size", "degrees", "fits"),
    # 0.002 rad and what 0.01 mm subtends: 0.172 degrees at 10 mm, 0.1203 at 100 mm, 0.6875 at 1 mm
    [(100, 90.120, True), (100, 90.121, False), (1, 90.68, True), (1, 90.69, False), (10, 450.17, True),
     (10, 450.18, False), (10, -90.17, True), (10, 449.82, False)],
)  # fmt: skip
def test_how_far_a_stated_angle_may_be_off(size: int, degrees: float, fits: bool, setup: Setup) -> None:
    text = f"GOTO/{size},0,5\nMOVARC/0,0,5,0,0,1,{size},ANGLE,{degrees}\nGOTO/0,{size},5\n"
    if fits:
        assert sweeps(text, setup) == pytest.approx([0.5])
        return
    with pytest.raises(ProgramError, match="the arc states an angle"):
        program(text, setup)


@pytest.mark.parametrize(
    ("begins", "again", "end", "fits"),
    [
        # the direction is more than a tenth along the arc
        ("1,.101", "", "0,10", True), ("1,.1", "", "0,10", False), ("-1,.101", "", "0,10", True),
        # at half a circle, within 1 mrad, both are the same
        ("0,1", "", "-10,-.009", True), ("0,1", "", "-10,-.011", False), ("0,1", "2,INTOF,", "-10,.009",
         True),
        ("0,1", "2,INTOF,", "-10,.011", False), ("0,-1", "", "-10,.009", True), ("0,-1", "", "-10,.011",
         False),
    ],
)  # fmt: skip
def test_how_near_the_words_of_catia_may_be_to_a_contradiction(
    begins: str, again: str, end: str, fits: bool, setup: Setup
) -> None:
    text = CATIA.format(v=begins, c=ROUND, again=again, end=end + ",5")
    if fits:
        assert len(program(text, setup).toolpath.arcs) == 1
        return
    with pytest.raises(ProgramError, match=r"INDIRV does not say|the arc meets its line"):
        program(text, setup)


@pytest.mark.parametrize(
    ("normal", "start", "begins", "end", "plane", "sweep"),
    [
        ("0,0,1", "10,0,0", "0,1,0", "0,10,0", 0, 0.5), ("0,0,-1", "10,0,0", "0,1,0", "0,10,0", 0, 0.5),
        ("1,0,0", "0,10,0", "0,0,1", "0,0,10", 2, 0.5), ("1,0,0", "0,10,0", "0,0,-1", "0,0,-10", 2, -0.5),
        ("0,1,0", "0,0,10", "1,0,0", "10,0,0", 1, 0.5), ("0,1,0", "0,0,10", "-1,0,0", "-10,0,0", 1, -0.5),
    ],
)  # fmt: skip
def test_a_cylinder_of_catia_has_its_axis(
    normal: str, start: str, begins: str, end: str, plane: int, sweep: float, setup: Setup
) -> None:
    tlon = f"TLON,GOFWD/(CYLNDR/0,0,0,{normal},10),ON,(LINE/0,0,0,{end})"
    arcs = program(f"GOTO/{start}\nINDIRV/{begins}\n{tlon}\n", setup).toolpath.arcs
    assert arcs.plane.tolist() == [plane]
    assert arcs.sweep_rad / HALF == pytest.approx([sweep])


def test_arcs_turn_with_their_frame(tmp_path: Path) -> None:
    """B is 90 degrees: X of the program is against Z of the machine, and Z of the program is X."""
    tables = '[work_offsets.G54]\nset_by = "true"\nX_mm = 100.0\nB_deg = 90.0\n'
    setup = load_setup(machine(tmp_path, tables=tables))
    catia = "GOTO/10,0,5\nINDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0,5,10),ON,(LINE/0,0,5,0,10,5)\n"
    for text in (QUARTERS["Creo"].format(n=1), catia):
        path = program(text, setup).toolpath
        assert path.end_mm == pytest.approx(np.array([[105.0, 0, -10], [105, 10, 0]]))
        assert path.arcs.plane.tolist() == [2]
        assert path.arcs.centre_mm == pytest.approx(np.array([[105.0, 0.0, 0.0]]), abs=1e-12)
        # from -Z to +Y: against the turn from Y to Z by three quarters, or with it by one
        assert path.arcs.sweep_rad == pytest.approx([HALF / 2])


def test_catia_writes_autops_before_each_arc(setup: Setup) -> None:
    """As in public programs of CATIA V5, with its blanks."""
    text = (
        "GOTO  /   10.00000,    0.00000,    5.00000\nINTOL /    0.02500\nOUTTOL/    0.00000\nAUTOPS\n"
        "INDIRV/    0.00000,    1.00000,    0.00000\n"
        "TLON,GOFWD/      (CIRCLE/      0.00000,      0.00000,      5.00000,$\n"
        "      10.00000),ON,(LINE/      0.00000,      0.00000,      5.00000,$\n"
        "                               0.00000,     10.00000,      5.00000)\n"
    )
    assert sweeps(text, setup) == pytest.approx([0.5])
    assert sweeps(text.replace("AUTOPS\n", ""), setup) == pytest.approx([0.5])
    with pytest.raises(ProgramError, match="GOLFT drives the tool along geometry"):
        program("GOTO/10,0,5\nAUTOPS\nINDIRV/0,1,0\nGOLFT/1\n", setup)


def test_a_direction_holds_for_one_arc(setup: Setup) -> None:
    text = CATIA.format(v="0,1", c=ROUND, again="", end="0,10,5")
    again = "TLON,GOFWD/(CIRCLE/0,0,5,10),ON,(LINE/0,0,5,-10,0,5)\n"
    assert sweeps(text + "INDIRV/-1,0,0\n" + again, setup) == pytest.approx([0.5, 0.5])
    with pytest.raises(ProgramError, match="no INDIRV comes before TLON"):
        program(text + again, setup)
    kept = CATIA.format(v="0,1", c=ROUND, again="", end="0,10,5").replace("LINE/0,0", "LINE/.0009,-.0009")
    assert sweeps(kept, setup) == pytest.approx([0.5])


# -- joints --------------------------------------------------------------------------------------------

#: An arc behind a straight move that it does not continue: what comes before decides nothing.
CUSP = (
    "GOTO/20,0,5\nGOTO/10,0,5\nCIRCLE/0,0,5,0,0,1,10\nGOTO/0,10,5\nCIRCLE/5,15,5,0,0,1,7.0711\nGOTO/10,10,5\n"
)


@pytest.mark.parametrize(
    ("text", "refused"),
    [
        (BACK, True), (BACK.replace("GOTO/10,0,5", "UNITS/MM\nGOTO/10,0,5"), True),
        (BACK.replace("GOTO/10,0,5", "RAPID\nGOTO/10,0,5"), False), (CUSP, False),
        (BACK.replace("{more}", "").replace("CIRCLE", "UNITS/MM\nCIRCLE"), False),
        ("GOTO/20,-10,5\n" + BACK, True),
    ],
)  # fmt: skip
def test_only_straight_moves_before_an_arc_show_its_direction(text: str, refused: bool, setup: Setup) -> None:
    text = text.format(more="") * 3
    if not refused:
        assert len(program(text, setup).toolpath.arcs) in (3, 6)
        return
    with pytest.raises(ProgramError, match="arcs seem to turn the other way"):
        program(text, setup)


def test_arcs_that_state_their_direction_show_nothing(setup: Setup) -> None:
    catia = (
        "GOTO/10,-10,5\nGOTO/10,0,5\nINDIRV/0,-1,0\nTLON,GOFWD/(CIRCLE/0,0,5,10),ON,(LINE/0,0,5,0,-10,5)\n"
    )
    movarc = "GOTO/10,-10,5\nGOTO/10,0,5\nMOVARC/0,0,5,0,0,-1,10,ANGLE,90\nGOTO/0,-10,5\n"
    for text in (catia, movarc):
        done = program(text * 3, setup)
        assert len(done.toolpath.arcs) == 3
        assert not done.remarks


def test_what_is_remarked_of_arcs_is_the_first_line_of_doubt(setup: Setup) -> None:
    corner = ONWARD.replace("GOTO/10,-10,5", "GOTO/20,-10,5")
    words = "nothing shows which way arcs turn about their normals"
    longer = corner.replace("{more}", ",1,2")
    assert program(longer + longer, setup).remarks == (("arcs", 5, words),)
    assert program((BACK + BACK).format(more=""), setup).remarks == (("arcs", 5, words),)
    assert program((BACK + longer).format(more=""), setup).remarks == (("arcs", 9, words),)


@pytest.mark.parametrize(
    ("come", "joint"),
    # the cosine of 1.3 mrad is above 1 - 1e-6, that of 1.5 mrad below
    [((0.0013, 1.0, 0.0), 1), ((0.0015, 1.0, 0.0), 0), ((0.0013, -1.0, 0.0), -1), ((0.0015, -1.0, 0.0), 0),
     ((0.0, 1.0, 0.0013), 1), ((0.0, 1.0, 0.0015), 0), ((0.0, 0.0, 0.0), 0), ((0.0, 7.0, 0.0), 1)],
)  # fmt: skip
@pytest.mark.parametrize("plane", (0, 1, 2))
def test_how_smooth_a_joint_is(plane: int, come: tuple[float, float, float], joint: int) -> None:
    """An arc that begins along its second axis; the axes of a plane are in turn those of the machine."""
    roll = {0: 0, 1: 2, 2: 1}[plane]
    start = np.roll(np.array([[13.0, 2.0, 5.0]]), roll)
    centre = np.roll(np.array([[3.0, 2.0, 9.0]]), roll)
    for sweep in (1.0, -1.0):
        arcs = Resolved(centre, np.array([plane]), np.array([sweep * HALF]))
        before = start - np.roll(np.array([come]), roll)
        assert joints(arcs, start, before).tolist() == [sweep * joint]


# -- the bytes of an arc -------------------------------------------------------------------------------

C = [b"0", b"0.", b"5"]


@pytest.mark.parametrize(
    ("text", "want"),
    [
        ("CIRCLE/0,0.,5,0,0,1,10\nGOTO/0,10,5", {"radius": [b"10"]}),
        ("CIRCLE/0,0.,5,0,0,1", {}),
        (" circle / 0 , 0. , 5 , 0 , 0 , 1 , 10. ,", {"radius": [b"10."]}),
        ("CIRCLE/0,0.,5,0,0,1,10,1,2", {"radius": [b"10"]}),
        ("CIRCLE/0,0.,5,0,0,1,10,TIMES,1", {"radius": [b"10"]}),
        ("CIRCLE/0,0.,5,$\n0,0,1,10", {"radius": [b"10"]}),
        ("CIRCLE/0,0.,5,$\n0,0,1", {}),
        ("CIRCLE/0,0.,5,0,0,1E0", {}),
        ("CIRCLE/0,0.,5,0,0,1E0,10.0", {"radius": [b"10.0"]}),
        ("MOVARC/0,0.,5,0,0,1,10,ANGLE,90.0", {"radius": [b"10"], "angle": [b"90.0"]}),
        ("INDIRV/0,1,0\nTLON,GOFWD/(CIRCLE/0,0.,5,10),ON,(LINE/0,0.,5,0,10,5)",
         {"radius": [b"10"], "direction": [b"0", b"1", b"0"], "whole": True, "centres": [C, C]}),
        ("INDIRV/0,-1,0\nTLON,GOFWD/(CYLNDR/0,0.,5,0,0,1,1$\n0),ON, 2, INTOF,(LINE/0,0.,5, 0,10,5)",
         {"radius": [b"1$\n0"], "direction": [b"0", b"-1", b"0"], "whole": True, "centres": [C, C],
          "long": b"2, INTOF,"}),
    ],
)  # fmt: skip
def test_the_parts_of_an_arc_are_found_in_its_text(text: str, want: dict[str, object], setup: Setup) -> None:
    end = "" if "TLON" in text or text.endswith("GOTO/0,10,5") else "\nGOTO/0,10,5"
    done = program(f"GOTO/10,0,5\n{text}{end}\n", setup)
    none = {"radius": [], "angle": [], "direction": [], "whole": False, "long": None, "centres": [C]}
    stated = text.removesuffix("\nGOTO/0,10,5").encode()
    assert arc_of(done, 1) == {**none, "text": stated, **want}
    assert done.toolpath.arcs.move.tolist() == [1]


def test_an_arc_has_the_number_of_its_move(setup: Setup) -> None:
    """The arc may be the first point behind a change of the state, or far behind it."""
    head = "GOTO/0,0,0\nUNITS/MM\nGOTO/20,0,5\nGOTO/10,0,5\n"
    for text, moves in (
        (head + "CIRCLE/0,0,5,0,0,1,10\nGOTO/0,10,5\n", [3]),
        (head + "UNITS/MM\nCIRCLE/0,0,5,0,0,1,10\nGOTO/0,10,5\nCIRCLE/0,0,5,0,0,1\nGOTO/-10,0,5\n", [3, 4]),
    ):
        done = program(text, setup)
        assert done.toolpath.arcs.move.tolist() == moves
        assert sorted(done.statements.arcs) == moves  # type: ignore[union-attr]
        assert done.toolpath.kind.tolist() == [1, 1, 1] + [3] * len(moves)
        assert done.toolpath.arcs.sweep_rad == pytest.approx([HALF / 2] * len(moves))


def test_an_arc_behind_a_turn_of_the_tool_is_where_its_tool_is(tmp_path: Path) -> None:
    """The tool is 30 mm long; on the way to the start of the arc it turns upright."""
    tables = '[work_offsets.G54]\nset_by = "true"\n[tools.3]\nZ_mm = 30.0\n'
    setup = load_setup(machine(tmp_path, tables=tables))
    text = "LOADTL/3\nGOTO/9,0,5,0,.6,.8\nGOTO/10,0,5,0,0,1\nCIRCLE/0,0,5,0,0,1,10\nGOTO/0,10,5\n"
    path = program(text, setup).toolpath
    assert path.arcs.centre_mm.tolist() == [[0.0, 0.0, 35.0]]
    assert path.end_mm[2].tolist() == [0.0, 10.0, 35.0]


def test_numbers_of_a_circle_have_many_forms(setup: Setup) -> None:
    for row in ("0,0,5,0,0,1,10", "+0.,-0,5.,0,0,+1.,10.", "0,0,.5E1,0,0,1,1D1", "0,0,.5E1,0,0,1",
    "0 0 5 0 0 1 10",
                "0,0,5,0,0,1,10,-1,2,.5", "0.000000000001,0,5,0,0,1,10"):  # fmt: skip
        arcs = program(f"GOTO/10,0,5\nCIRCLE/{row}\nGOTO/0,10,5\n", setup).toolpath.arcs
        assert arcs.centre_mm == pytest.approx(np.array([[100.0, 0.0, 5.0]]))
        assert arcs.sweep_rad == pytest.approx([HALF / 2])
