"""What a control makes of several blocks, written out by --flatten: under a judge, and by hand."""

from __future__ import annotations

import cmath
import math
from pathlib import Path

import numpy as np
import pytest
from cases.conversational_contours import contour
from cases.fast import some_fast
from judge import heidenhain_contours, heidenhain_sides, machines
from judge.machines import Recipe

import olp
from olp.core.errors import ProgramError
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, Options, read

DIALECT = DIALECTS["heidenhain"]
ORIGIN = np.array([250.0, 200.0, -300.0 + 120.0])
RECIPE = Recipe(
    controller="heidenhain", increment_mm=0.0001, travel=((-900.0, 1400.0), (-900.0, 1400.0), (-500.0, 100.0))
)
HEAD = "L X+0 Y+0 Z+5 R0 FMAX\nF500\n"
CYCLE = "CYCL DEF 200 DRILL ~\nQ200=2 ~\nQ201=-5 ~\nQ203=+0 ~\nQ204=20\n"


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = machines.random_machine(tmp_path_factory.mktemp("bent"), 5, RECIPE)
    path.write_text(path.read_text().replace("\ncontroller =", '\nscaling_axes = "all"\ncontroller ='))
    return path


def flat(text: str) -> str:
    assert DIALECT.unroller is not None
    return DIALECT.unroller((HEAD + text).encode(), DIALECT).decode().removeprefix(HEAD)


@pytest.mark.parametrize("seed", some_fast(range(40), 8))
def test_random_contours_are_what_the_control_makes_of_them(bent: Path, seed: int) -> None:
    data = contour(seed)
    assert DIALECT.unroller is not None
    text = bytes(DIALECT.unroller(data, DIALECT, setup=load_setup(bent)))
    path = read(text, load_setup(bent), DIALECT, Options()).toolpath
    steps = heidenhain_contours.read(data)
    ends = np.array([[s.end.real, s.end.imag, s.z] for s in steps])
    assert path.end_mm[1:] - ORIGIN == pytest.approx(ends[1:], abs=2e-6)
    arcs = [s for s in steps if s.sweep]
    assert path.arcs.sweep_rad == pytest.approx(np.array([s.sweep for s in arcs]), abs=1e-5)
    centres = np.array([[s.centre.real, s.centre.imag] for s in arcs]).reshape(-1, 2)
    assert path.arcs.centre_mm[:, :2] - ORIGIN[:2] == pytest.approx(centres, abs=2e-5)


def test_an_arc_may_follow_a_tool_call_that_moves_nothing(bent: Path, tmp_path: Path) -> None:
    """The reader, which keeps positions of axes, is the judge of what unrolling writes."""
    text = f"{HEAD}L X+10 Y+0\n{{}}CC X+20 Y+0\nC X+30 Y+0 DR-\nRND R2\nL X+45\n".encode()
    still = tmp_path / "machine.toml"
    for name in ("calibration.toml", "x.csv", "y.csv", "z.csv"):
        (tmp_path / name).write_bytes(bent.with_name(name).read_bytes())
    still.write_text("tool_change_moves = false\n" + bent.read_text())
    call = b"TOOL CALL 2 Z S900\n"
    plain = olp.flatten(text.replace(b"{}", b""), still)
    assert olp.flatten(text.replace(b"{}", call), still).replace(call, b"") == plain
    assert (
        olp.flatten(text.replace(b"{}", b"TOOL CALL S900\n"), bent).replace(b"TOOL CALL S900\n", b"") == plain
    )
    with pytest.raises(ProgramError, match="an arc needs the present position"):
        olp.flatten(text.replace(b"{}", call), bent)


@pytest.mark.parametrize("seed", some_fast(range(6), 2))
def test_contours_that_are_written_out_are_corrected(bent: Path, seed: int) -> None:
    result = olp.correct(contour(seed), bent, flatten=True)
    assert result.report["deviation"]["holds"]
    with pytest.raises(ProgramError, match="--flatten"):
        olp.correct(contour(seed), bent)


# -- by hand -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        # I and positions in one block
        ("7 L IX+4 Y+2 R0 F50 ; A\n", "7 L X+4 Y+2 R0 F50 ; A\n"),
        # polar positions about the pole, the angle being counted on
        ("CC X+10 Y+0\nLP PR+5 PA+90\nLP IPA-90 IZ+1\n", "CC X+10 Y+0\nL X+10 Y+5\nL X+15 Y+0 Z+6\n"),
        # both sides of a corner give up the length of the chamfer; its feed is its own
        ("L X+20\nCHF 5 F90\nL Y+20\n", "L X+15 Y+0\nL X+20 Y+5 F90\nL X+20 Y+20 F500\n"),
        ("L X+20\nRND R5\nL Y+20 F80\n", "L X+15 Y+0\nCC X+15 Y+5\nC X+20 Y+5 DR+\nL X+20 Y+20 F80\n"),
        # a distance counts from the corner as it is programmed
        ("L X+20\nRND R5\nL IY+20\n", "L X+15 Y+0\nCC X+15 Y+5\nC X+20 Y+5 DR+\nL X+20 Y+20\n"),
        ("L X+10\nCT X+10 Y+8\n", "L X+10\nCC X+10 Y+4\nC X+10 Y+8 DR+\n"),
        ("L X+10\nCC X+10 Y+0\nCTP PR+8 PA+90\n", "L X+10\nCC X+10 Y+0\nCC X+10 Y+4\nC X+10 Y+8 DR+\n"),
        # turned by 90 degrees, then back
        ("CYCL DEF 10.1 ROT+90\nL X+10\nCYCL DEF 10.1 IROT-90\nL X+3\n", "L X+0 Y+10\nL X+3\n"),
        # a mirror turns arcs
        (
            "CYCL DEF 8.0\nCYCL DEF 8.1 X\nL X+10 Y+0\nCC X+5 Y+0\nC X+0 Y+0 DR+\nCYCL DEF 8.1\nL X+3\n",
            "L X-10 Y+0\nCC X-5 Y+0\nC X+0 Y+0 DR-\nL X+3\n",
        ),
        # the shift stays in the text; a rotation is about it
        (
            "CYCL DEF 7.0\nCYCL DEF 7.1 X+100\nCYCL DEF 10.0\nCYCL DEF 10.1 ROT+180\nL X+1 Y+2\n",
            "CYCL DEF 7.0\nCYCL DEF 7.1 X+100\nL X-1 Y-2\n",
        ),
        (
            "APPR LT X+20 Y+0 LEN5 R0 F9\nL X+50\nDEP LT LEN10\nL Y+9\n",
            "L X+15 Y+0 R0\nL X+20 Y+0 F9\nL X+50\nL X+60 Y+0\nL Y+9\n",
        ),
        # in planes with Z, angles count from Y and from Z
        ("CC Z+1 X+2\nLP PR+5 PA+90 F9\nLP PA+180 IY+2\n", "CC Z+1 X+2\nL X+7 Z+1 F9\nL X+2 Y+2 Z-4\n"),
        ("CC Y+0 Z+0\nL Y+3 Z+0\nLP IPA+90\nLP IPR+1\n", "CC Y+0 Z+0\nL Y+3 Z+0\nL Y+0 Z+3\nL Y+0 Z+4\n"),
        # TRANS is another way to write them
        ("TRANS ROTATION ROT+90\nL X+10\nTRANS ROTATION RESET\nTRANS MIRROR AXIS X\nL X+3 Y+0\n"
         "TRANS MIRROR RESET\nTRANS SCALE SCL 2\nL X+2\n", "L X+0 Y+10\nL X-3 Y+0\nL X+4 Y+0\n"),
        ("TRANS SCALE SCL 2\nL X+10\nRND R1\nL Y+20\n",
         "L X+18 Y+0\nCC X+18 Y+2\nC X+20 Y+2 DR+\nL X+20 Y+40\n"),
        # scaled about the datum, or about a centre; the radius too
        ("CYCL DEF 11.0\nCYCL DEF 11.1 SCL 2\nL X+10 Y+1\nCR X+14 Y+5 R+4 DR+\nCYCL DEF 11.0\n"
         "CYCL DEF 11.1 SCL 1\nL IX+1\n", "L X+20 Y+2\nCC X+20 Y+10\nC X+28 Y+10 DR+\nL IX+1\n"),
        ("CYCL DEF 26.0\nCYCL DEF 26.1 X2 Y0.5 Z3 CCX+15 CCZ-2\nL X+10 Y+1\nL Z+1\n", "L X+5 Y+0.5\nL Z+7\n"),
        # in a plane with Z of a rotated program
        ("CYCL DEF 10.0\nCYCL DEF 10.1 ROT+90\nCC Z+1 X+2\nLP PR+5 PA+90\nLP PA+0\n",
         "L X+0 Y+7 Z+1\nL X+0 Y+2 Z+6\n"),
        # modal calls, up to M99
        (CYCLE + "L X+1 FMAX M89\nL X+2 FMAX\nL X+3 M99\nL X+4\n",
         CYCLE + "L X+1 FMAX M99\nL X+2 FMAX M99\nL X+3 M99\nL X+4\n"),
        (CYCLE + "CYCL CALL POS X+1 Y+2 Z+3 FMAX M8\nL X+9 M99\n",
         CYCLE + CYCLE.replace("Q203=+0", "Q203=+3") + "L X+1 Y+2 R0 FMAX M8 M99\n" + CYCLE + "L X+9 M99\n"),
        # a feed of its own, and the one in force
        (CYCLE + "PATTERN DEF POS1 (X+1 Y+2 Z+0)\nCYCL CALL PAT F MAX M3\nCYCL CALL PAT\n",
         CYCLE + "L Z+20 R0 FMAX\n" + CYCLE + "L X+1 Y+2 R0 F MAX M3 M99\n" + CYCLE + "L X+1 Y+2 R0 M99\n"),
    ],
)  # fmt: skip
def test_what_is_written(text: str, plain: str) -> None:
    assert flat(text) == plain


def places(text: str) -> list[tuple[float, float]]:
    """X and Y of the blocks with M99."""
    blocks = [line.split() for line in flat(text).split("\n") if line.endswith("M99")]
    return [(float(b[1][1:]), float(b[2][1:])) for b in blocks]


def test_grids_of_holes_and_their_rims() -> None:
    def holes(pattern: str) -> list[tuple[float, float]]:
        return places(CYCLE + f"PATTERN DEF {pattern}\nCYCL CALL PAT FMAX\n")

    grid = "PAT1 (X+10 Y+20 DX+8 DY+5 NUMX3 NUMY2 ROT{} ROTX{} ROTY{} Z+0)"
    assert holes(grid.format("+0", "+0", "+0")) == [
        (10, 20),
        (18, 20),
        (26, 20),
        (26, 25),
        (18, 25),
        (10, 25),
    ]
    # the whole is turned; one direction alone is
    assert holes(grid.format("+90", "+0", "+0"))[2:4] == [(10, 36), (5, 36)]
    assert holes(grid.format("+0", "+90", "+0"))[2:4] == [(10, 36), (10, 41)]
    assert holes(grid.format("+0", "+0", "+90"))[2:4] == [(26, 20), (21, 20)]
    rim = holes("FRAME1 (X+0 Y+0 DX+1 DY+1 NUMX4 NUMY3 ROT+0 ROTX+0 ROTY+0 Z+0)")
    assert len(rim) == 10
    assert not {(1, 1), (2, 1)} & set(rim)


def test_words_of_functions_stay_theirs_in_what_is_written_out() -> None:
    text = "L X+10 M118 Z5\nRND R2 F90\nL Y+10 M103 F20\n"
    plain = "L X+8 Y+0 M118 Z5\nCC X+8 Y+2\nC X+10 Y+2 DR+ F90\nL X+10 Y+10 F500 M103 F20\n"
    assert [sorted(b.split()) for b in flat(text).split("\n")] == [
        sorted(b.split()) for b in plain.split("\n")
    ]


def test_patterns_of_holes() -> None:
    surface = "Q200=2 Q203=+1 Q204=30 Q301=0\n"
    circle = "CYCL DEF 220 Q216=+50 Q217=+10 Q244=80 Q245=+0 Q246=+360 Q247=+0 Q241=4 "
    assert places(CYCLE + circle + surface) == [(90, 10), (50, 50), (10, 10), (50, -30)]
    part = circle.replace("Q246=+360", "Q246=+90").replace("Q241=4", "Q241=3")
    assert places(CYCLE + part + surface)[1:] == [(78.284271, 38.284271), (50, 50)]
    stepped = circle.replace("Q247=+0", "Q247=-90").replace("Q241=4", "Q241=2")
    assert places(CYCLE + stepped + surface) == [(90, 10), (50, -30)]
    lines = "CYCL DEF 221 Q225=+1 Q226=+2 Q237=10 Q238=5 Q242=2 Q243=2 Q224=+0 "
    assert places(CYCLE + lines + surface) == [(1, 2), (11, 2), (11, 7), (1, 7)]
    assert places(CYCLE + lines.replace("Q224=+0", "Q224=+90") + surface)[1:3] == [(1, 12), (-4, 12)]
    # between the holes the tool is at the clearance of the pattern, behind the last one at the second
    text = flat(CYCLE + lines + surface)
    assert text.count("Q203=+1") == 2
    assert [part.split("\n")[0] for part in text.split("Q204=")[1:]] == ["20", "+0", "+30"]


def test_a_pattern_definition_adds_to_the_surface_and_keeps_the_height() -> None:
    pattern = "PATTERN DEF ~\nPOS1 (X+25 Y+33.5 Z+0) ~\nROW1 (X+1 Y+2 D+10 NUM2 ROT+90 Z+2) ~\n"
    pattern += "CIRC1 (X+0 Y+0 D+20 START+90 NUM2 Z+0)\n"
    text = CYCLE + "L Z+60\n" + pattern + "CYCL CALL PAT F500 M3\n"
    assert places(text) == [(25, 33.5), (1, 2), (1, 12), (0, 10), (0, -10)]
    assert flat(text).count("L Z+60 R0 FMAX") == 4
    assert flat(text).count("M3") == 1
    assert [part[:2] for part in flat(text).split("Q203=+")[2:]] == ["0\n"[:1] + " ", "2 ", "2 ", "0 ", "0 "]


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("RND R5\nL X+1\n", 3, "directly before it"), ("L X+9\nRND R5\nL Z+1\n", 5, "directly behind it"),
        ("L X+9\nRND R50\nL Y+9\n", 4, "does not fit"), ("L X+9\nCHF 10\nL Y+20\n", 4, "does not fit"),
        ("L X+9 Z+3\nRND R1\nL Y+9\n", 4, "along Z"), ("L Z-1\nCT X+5 Y+5\n", 4, "goes on from"),
        ("LP PR+5 PA+5\n", 3, "no pole"), ("TOOL CALL 2 Z\nL IX+5 Y+1\n", 4, "present position"),
        ("CYCL DEF 10.0\nCYCL DEF 10.1 ROT+5\nCYCL DEF 7.0\nCYCL DEF 7.1 X+5\n", 6, "shift it before"),
        ("CYCL DEF 10.0\nCYCL DEF 10.1 ROT+5\nCYCL DEF 8.0\nCYCL DEF 8.1 X\n", 6, "mirror it before"),
        ("CYCL DEF 8.0\nCYCL DEF 8.1 Z\n", 4, "another axis"),
        ("APPR LT X+9 Y+9 LEN5 R0\nFLT\n", 4, "free contour"), ("L X+9\nRND R5\nFC DR- R18\n", 5, "free"),
        ("CC Z+0 IX+5\nLP PR+5 PA+0\n", 4, "no pole"),
        ("CC Z+0 X+5\nCYCL DEF 10.0\nCYCL DEF 10.1 ROT+5\nLP PA+0\n", 6, "no pole"),
        ("CYCL DEF 10.0\nCYCL DEF 10.1 ROT+5\nCC Z+0 X+5\nCP IPA5 DR+\n", 6, "another plane"),
        ("CYCL DEF 11.0\nCYCL DEF 11.1 SCL 2\nL Z-1\n", 5, "scaling_axes"),
        ("CYCL DEF 11.0\nCYCL DEF 11.1 SCL 0\n", 4, "above zero"),
        ("CYCL DEF 11.0\nCYCL DEF 11.1 SCL 2\nCYCL DEF 7.0\nCYCL DEF 7.1 X+5\n", 6, "shift it before"),
        ("CYCL DEF 11.0\nCYCL DEF 11.1 SCL 2\nL X+1 M99\n", 5, "a cycle is called in a scaled"),
        ("CYCL DEF 11.0\nCYCL DEF 11.1 SCL 2\nCYCL CALL\n", 5, "a cycle is called in a scaled"),
        ("CYCL DEF 11.0\nCYCL DEF 11.1 SCL 2\nAPPR LT X+9 Y+9 LEN5 R0\n", 5, "scales its radius"),
        ("CYCL DEF 11.0\nCYCL DEF 11.1 SCL 2\nCYCL DEF 26.0\nCYCL DEF 26.1 X2\n", 6, "both in force"),
        ("CYCL DEF 26.0\nCYCL DEF 26.1 X2 Y3\nCR X+1 Y+1 R+5 DR+\n", 5, "different factors"),
        ("CYCL DEF 26.0\nCYCL DEF 26.1 X2\nCYCL DEF 10.0\nCYCL DEF 10.1 ROT+5\n", 6, "different factors"),
        ("APPR LCT X+1 Y+1 R5 R0\nL X+20\n", 3, "inside the arc"),
        ("APPR LT X+9 Y+9 R0\nL X+20\n", 3, "needs LEN"),
        ("CYCL CALL PAT\nLP\n", 3, "no PATTERN DEF"),
        ("PATTERN DEF PAT1 (X+1 Y+1 DX+1 DY+1)\n", 3, "0 holes"),
        ("CYCL CALL POS X+1 Y+1 Z+0\n", 3, "no cycle with Q203"), ("L X+5 X+6\nLP\n", 3, "states X twice"),
        ("CYCL DEF 221 Q225=+1\n", 3, "has 0 holes"),
        ("CYCL DEF 10.0\nCYCL DEF 10.1 ROT+5\n/L X1\n", 5, "block delete"),
    ],
)  # fmt: skip
def test_what_cannot_be_written_out(text: str, line: int, words: str) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        flat(text)
    assert caught.value.line == line


def test_plain_blocks_keep_their_bytes() -> None:
    text = "5 L IX+4  R0 F MAX ; A\n CC X+1 Y+1\n6 C X+2 Y+0 DR-\nL C+30\nX+5 M3\n~\n* - B\nCC IX+1 Y+1\n"
    assert flat(text + "LP PR+1 PA+0\n").startswith(text.rsplit("CC IX", 1)[0])


# -- RL and RR -----------------------------------------------------------------------------------------

AROUND = (
    "BEGIN PGM A MM\nTOOL CALL 1 Z S100 DR{delta}\n"
    "L X-40 Y-30 Z+5 R0 FMAX\nL Z-5 F500\nL X+0 Y+0 {side} F300\n"
    "{path}L X+0 Y+0\nL X-40 Y-30 R0 F900\nL Z+50 R0 FMAX M30\nEND PGM A MM\n"
)
#: around a part, which is on the right; then a pocket, which is beside the tool on both sides
PATHS = [
    "L X+0 Y+40\nRND R8\nL X+50\nCC X+50 Y+30\nC X+60 Y+30 DR-\nL X+40 Y+0\n",
    "L X+0 Y+40\nL X+20 Y+50\nCT X+40 Y+40\nRND R6\nL X+80\nCHF 4\nL X+60 Y+20\nCR X+60 Y+0 R+10 DR-\n",
    "L X+5 Y+70\nL X+40 Y+71\nCR X+70 Y+70 R+30 DR+\nL X+100 Y+70\nL X+90 Y+20\nL X+60 Y+40\nL X+50 Y-20\n",
]


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize(("side", "mirror"), [("RL", ""), ("RL", "X"), ("RL", "Y")])
@pytest.mark.parametrize("delta", ["+0", "-2.25"])
def test_the_tool_is_at_its_radius_beside_the_contour(
    bent: Path, path: str, side: str, mirror: str, delta: str
) -> None:
    radius = 5.0 + float(delta)
    text = AROUND.format(side=side, path=path, delta=delta)
    if mirror:
        text = text.replace("L X-40 Y-30 Z+5", f"CYCL DEF 8.0\nCYCL DEF 8.1 {mirror}\nL X-40 Y-30 Z+5")
    plain = olp.flatten(text.encode(), bent)
    assert b"RL" not in plain
    assert b"RR" not in plain
    contour = heidenhain_contours.read(text.replace(" RL", "").encode())[3:-2]
    tool = heidenhain_contours.read(plain)[3:-2]
    assert heidenhain_sides.off_by(contour, tool, radius) < 2e-6
    assert heidenhain_sides.sides(contour, tool) == {-1 if mirror else 1}
    # it begins across from the beginning of the contour, and ends across from its end
    assert tool[0].start == pytest.approx(
        contour[0].start + contour[0].heading(0) * 1j * radius * (-1 if mirror else 1)
    )
    assert tool[-1].end == pytest.approx(
        contour[-1].end + contour[-1].heading(1) * 1j * radius * (-1 if mirror else 1)
    )


def rounded_contour(angle: float) -> str:
    """A line, a quarter of a circle in three parts, a line of 0.03 mm and a long one. They meet but for their
    digits, as CAM systems write them."""
    turned = cmath.exp(1j * angle)
    corner, size = 60.0 + 6.0j, 6.013
    places = [corner + size * cmath.exp(1j * math.radians(part - 90)) for part in (0, 31, 62, 90)]
    ends = [*places, places[-1] + 0.031j, places[-1] + 40j]
    xy = [f"X{(turned * end).real:+.3f} Y{(turned * end).imag:+.3f}" for end in ends]
    centre = f"CC X{(turned * corner).real:+.3f} Y{(turned * corner).imag:+.3f}"
    start = turned * (places[0] - 50)
    first = turned * (places[0] - 70)
    return (
        f"L X{first.real:+.3f} Y{first.imag:+.3f} Z+5 R0 FMAX\n"
        f"L X{start.real:+.3f} Y{start.imag:+.3f} RL F300\n"
        f"L {xy[0]}\n" + "".join(f"{centre}\nC {end} DR+\n" for end in xy[1:4]) + f"L {xy[4]}\nL {xy[5]}\n"
    )


@pytest.mark.parametrize("angle", some_fast([0.1 * n for n in range(60)], 6))
@pytest.mark.parametrize("radius", ["0", "0.01", "0.5"])
def test_pieces_that_meet_but_for_their_digits_are_smooth(bent: Path, angle: float, radius: str) -> None:
    text = f"TOOL CALL 1 Z DR{float(radius) - 5.0:+.3f}\n" + rounded_contour(angle) + "L X+0 Y-90 R0\n"
    contour = heidenhain_contours.read(text.replace(" RL", "").encode())[2:-1]
    tool = heidenhain_contours.read(olp.flatten(text.encode(), bent))[2:-1]
    assert heidenhain_sides.off_by(contour, tool, float(radius)) < 2e-3


@pytest.mark.parametrize(
    ("delta", "same"),
    [("1.", "+1"), (".5", "+.5"), ("2.", "+2"), ("25", "+25"), ("2:+1", "+0"), ("2+1", "+0")],
)
def test_the_delta_of_the_radius_may_have_no_sign(bent: Path, delta: str, same: str) -> None:
    """DR2 is the delta of another radius."""
    texts = [
        f"TOOL CALL 1 Z DR{d}\nL X-90 Y-90 Z+5 R0 FMAX\nL X+0 Y+0 RL F300\nL Y+400\nL X-90 R0\n"
        for d in (delta, same)
    ]
    one, other = (olp.flatten(text.encode(), bent).split(b"\n", 1)[1] for text in texts)
    assert one == other


def test_an_approach_and_a_departure_are_beside_the_contour_too(bent: Path) -> None:
    text = "TOOL CALL 1 Z\nL X-20 Y-20 Z+5 R0 FMAX\nAPPR LT X+0 Y+0 LEN15 RR F100\nL X+40\nDEP LT LEN10\n"
    plain = olp.flatten((text + "L Y+50\n").encode(), bent).decode().split("\n")
    assert plain[2:-1] == [
        "L X-15 Y-5 R0", "L X+0 Y-5 F100", "L X+40 Y-5", "L X+50 Y-5", "L Y+50",
    ]  # fmt: skip


def test_arcs_of_approaches_have_the_radius_of_the_tools_centre(bent: Path) -> None:
    # the tool is larger than the arc: beside the contour there would be none
    text = "TOOL CALL 1 Z DR+2\nL X-40 Y+0 Z+5 R0 FMAX\nL Z-5 F100\nCC X+50 Y+0\n"
    text += "APPR LCT X+0 Y+0 R4 RL F300\nC X+0 Y+0 DR-\nDEP CT CCA90 R+4\nL X-40 Y+0\n"
    plain = olp.flatten(text.encode(), bent).decode().split("\n")
    # from (-40, 0) the tangent of the circle about (-11, 0) with a radius of 4 touches it on its lower side
    assert plain[4] == "L X-11.551724 Y-3.961767 R0 F300"
    assert plain[5:-1] == [
        "CC X-11 Y+0", "C X-7 Y+0 DR+ F300", "CC X+50 Y+0", "CP IPA-360 DR-", "CC X-11 Y+0", "C X-11 Y+4 DR+",
        "L X-40 Y+0",
    ]  # fmt: skip


def test_a_contour_is_corrected_as_the_path_of_the_tool(bent: Path) -> None:
    text = AROUND.format(side="RL", path=PATHS[0], delta="+0").encode()
    assert olp.correct(text, bent, flatten=True).report["deviation"]["holds"]
    with pytest.raises(ProgramError, match="RL: the control offsets"):
        olp.correct(text, bent)


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("L X+0 Y+0 RL\nL Y+40\nL X+30 Y+3\nL X+1 Y+40\nL X-9 R0\n", 5, "does not fit"),
        ("L X+0 Y+0 RR\nL Y+40\nCR X+6 Y+40 R+3 DR-\nL X+6 Y+0\nL X-9 R0\n", 5, "does not fit"),
        ("L X+0 Y+0 RL\nL Y+40\nL Z+50 R0\n", 5, "behind a contour"),
        ("L X+0 Y+0 RL\nL Y+40\n", 4, "no end"), ("L Z-9 RL\nL X+9 Y+40\nL X+0 R0\n", 3, "enters a contour"),
        ("L X+0 Y+0 RL\nL X+9 R0\n", 3, "one move alone"),
        ("L X+0 Y+0 RL\nL Y+40\nL X+10 RR\nL X+9 R0\n", 5, "the side or the tool changes"),
        ("L X+0 Y+0 RL\nL Y+40\nTOOL CALL 2 Z\nL X+9 Y+3 R0\n", 4, "is called beside a contour"),
        ("L X+0 Y+0 RL\nL Y+40 M97\nL X+10\nL X+9 R0\n", 4, "M97"),
        ("TOOL CALL 3 Z\nL X+9 Y+3\nL X+0 Y+0 RL\nL Y+40\nL X+9 R0\n", 5, "radius of tool 3"),
        ("TOOL CALL 1 Z DR-6\nL X+9 Y+3\nL X+0 Y+0 RL\nL Y+40\nL X+9 R0\n", 5, "negative"),
    ],
)  # fmt: skip
def test_contours_that_are_refused(bent: Path, text: str, line: int, words: str) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        olp.flatten(("TOOL CALL 1 Z\nL X-20 Y-20 Z+5 R0 FMAX\n" + text).encode(), bent)
    assert caught.value.line == line


def test_a_refusal_that_follows_from_another_is_not_the_reason_against_flatten(bent: Path) -> None:
    # the arc goes wrong only because the approach before it is not read
    text = "TOOL CALL 1 Z\nL X-40 Y+0 Z+5 R0 FMAX\nL Z-5 F100\nCC X+50 Y+0\nAPPR LCT X+0 Y+0 R4 RL F300\n"
    text += "C X+0 Y+0 DR-\nDEP CT CCA90 R+4\nL X-40 Y+0\n"
    with pytest.raises(ProgramError) as caught:
        olp.correct(text.encode(), bent)
    assert "APPR follows from the blocks beside it; write it out with --flatten" in str(caught.value)
