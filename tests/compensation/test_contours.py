"""Contours under cutter compensation: which blocks and words a correction inserts, holds and refuses."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine, unstamped
from judge import machines

import olp
from olp.core.errors import ProgramError, UsageError

HEAD = b"G21 G90 G54 G64 P0.001 Q0\nG0 X0 Y0 Z10\nG1 Z0 F600\n"
#: a rectangle, entered and left
RECTANGLE = b"G41 D1 X20 Y20\nX100\nY80\nX20\nY20\nG40 G0 X0 Y0\n"
TWO = {name: {"X_mm": 300.0, "Y_mm": 300.0, "Z_mm": -200.0, "set_by": "true"} for name in ("G54", "G55")}
PLAY = "[backlash]\nX_um = 6.0\nY_um = 6.0\n"
#: leaning columns: X and Y follow Z
LEANING = "[squareness]\nB0Z_urad = 500.0\nA0Z_urad = 500.0\n"
#: X is bent along Y
BENT = {"y.csv": "Y_mm,EXY_um\n-1000,0\n0,0\n30,30\n60,0\n90,30\n120,0\n2000,0\n"}
CURVE_Y = '[[curves]]\nfile = "y.csv"\ninterpolation = "linear"\n'


def tool(radius_mm: float) -> str:
    return f"{TRUE_ZERO}[tools.1]\nZ_mm = 0.0\nradius_mm = {radius_mm}\n[job_defaults]\ntool = 1\n"


def corrected(folder: Path, body: bytes, calibration: str = "", **options: object) -> olp.Correction:
    path = machine(folder, calibration, BENT, tables=tool(5.0))
    return olp.correct(HEAD + body + b"M2\n", path, **options)  # type: ignore[arg-type]


def body(result: olp.Correction) -> list[bytes]:
    return unstamped(result.data).splitlines()[HEAD.count(b"\n") :]


def test_no_step_takes_up_backlash_along_a_contour(tmp_path: Path) -> None:
    result = corrected(tmp_path, RECTANGLE, PLAY)
    # the one block takes it up in the rapid before the contour
    assert result.report["moves"]["inserted_blocks"] == 1
    assert result.data.index(b"G41") > result.data.index(b"\n", result.data.index(b"G0 X"))
    off = result.data.count(b"\n")
    plain = corrected(tmp_path, RECTANGLE.replace(b"G41 D1", b"G1").replace(b"G40 ", b""), PLAY)
    assert plain.data.count(b"\n") > off


def test_the_proof_counts_what_a_turn_without_a_step_leaves(tmp_path: Path) -> None:
    slanted = b"G41 D1 X20 Y20\nX100 Y30\nX20 Y60\nG40 G0 X0 Y0\n"
    deviation = corrected(tmp_path, slanted, PLAY).report["deviation"]
    assert not deviation["holds"]
    assert 1.0 < deviation["path_max_um"] < 7.0


def test_a_block_along_the_tool_axis_gets_no_word_of_the_plane(tmp_path: Path) -> None:
    text = b"G41 D1 X20 Y20\nX100\nZ-20\nY80\nG40 G0 X0\nG0 Z50\n"
    lines = body(corrected(tmp_path, text, LEANING))
    assert lines[2] == b"Z-20"


def test_a_plunge_at_an_outside_corner_stays_at_the_corner(tmp_path: Path) -> None:
    """Beside a side along Y the tool has the Y of the contour; corrected, the corner has another one."""
    text = b"G42 D1 X20 Y20\nX100\nY80\nZ-20\nX70 Y90\nG40 G0 X0\nG0 Z50\n"
    lines = body(corrected(tmp_path, text, f"{LEANING}C0Y_urad = 800.0\n{CURVE_Y}"))
    plunge = next(line for line in lines if line.startswith(b"Z-20"))
    assert b"X" not in plunge and b"Y" not in plunge


def test_a_move_to_the_contour_is_not_split_and_one_behind_it_is(tmp_path: Path) -> None:
    text = b"G41 D1 X20 Y110\nX100 Y20\nX200 Y110\nG40 G1 X20 Y0\n"
    lines = body(corrected(tmp_path, text, CURVE_Y))
    assert lines[0].startswith(b"G41") and lines[1].startswith(b"X")
    assert b"G40" in lines[-5] and lines[-1] == b"M2"


@pytest.mark.parametrize("depth", [1, 2])
def test_a_short_block_behind_a_plunge_ends_where_it_should(tmp_path: Path, depth: int) -> None:
    """The plunge of 1 or 2 mm leaves the tool 0.5 or 1 um aside, which turns a block of 0.06 mm."""
    rows = b"G41 D1 X20.00000 Y9.00000\nX50.00000 Y9.00000\nZ-%d\nX50.06000 Y9.00000\nZ-%d\n"
    text = rows % (depth, 2 * depth) + b"X99.00000 Y9.00000\nG40 G0 X0 Y0\n"
    deviation = corrected(tmp_path, text, LEANING).report["deviation"]
    assert deviation["path_max_um"] < 1.2 * depth


@pytest.mark.parametrize("code", [b"G41", b"G42"])
def test_no_part_is_shorter_than_the_cutter_radius(tmp_path: Path, code: bytes) -> None:
    """The chords bend at Y = 90."""
    near = b"G41 D1 X20 Y20\nX100\nY101\nX20\nG40 G0 X0 Y0\n".replace(b"G41", code)
    text = near.replace(b"Y101", b"Y93")
    assert len(body(corrected(tmp_path, near, CURVE_Y))) == 1 + len(body(corrected(tmp_path, text, CURVE_Y)))


@pytest.mark.parametrize(
    ("entry", "line"),
    [(b"G41 D1 X5.001 Y0\nX60\n", 4), (b"G41 D1 X20 Y0\nG3 X30.002 Y0 I5.001\nG1 X60\n", 5)],
)
def test_what_the_control_would_refuse_is_refused_with_its_line(
    tmp_path: Path, entry: bytes, line: int
) -> None:
    """Stretched by 1e-3, a move or an arc becomes less than the cutter is wide."""
    stretch = {"x.csv": "X_mm,EXX_um\n-1000,-1000\n2000,2000\n"}
    path = machine(tmp_path, CURVE_Y.replace("y.csv", "x.csv"), stretch, tables=tool(5.0))
    text = HEAD + entry + b"Y30\nG40 G0 X0 Y0\nM2\n"
    with pytest.raises(ProgramError, match="control would refuse") as caught:
        olp.correct(text, path)
    assert caught.value.line == line
    assert olp.correct(text.replace(b"G41 D1", b"G1"), path).report["deviation"]["holds"]
    assert olp.correct(text, path, contour="path").report["deviation"]["holds"]


def test_an_outside_corner_that_would_be_lost_is_refused(tmp_path: Path) -> None:
    """A control that takes 0.05 rad for no corner makes an arc about one that is just above."""
    stretch = {"x.csv": "X_mm,EXX_um\n-1000,10000\n2000,-20000\n"}
    path = machine(tmp_path, CURVE_Y.replace("y.csv", "x.csv"), stretch, tables=tool(5.0))
    text = HEAD + b"G42 D1 X20 Y5\nX60 Y5\nX100 Y7.0025\nG40 G0 X0 Y0\nM2\n"
    with pytest.raises(ProgramError, match="none any more") as caught:
        olp.correct(text, path, accept=("OLP445",))
    assert caught.value.line == 6
    done = olp.correct(text, path, contour="path", accept=("OLP445",))
    assert done.report["deviation"]["holds"]


def test_a_contour_states_its_radius_and_the_path_what_it_lacks(tmp_path: Path) -> None:
    result = corrected(tmp_path, RECTANGLE)
    (one,) = [f for f in result.findings if f.code == "OLP305"]
    assert "radii of 5 mm" in one.message
    assert one.lines == (4,)
    (other,) = [f for f in corrected(tmp_path, RECTANGLE, contour="path").findings if f.code == "OLP314"]
    assert other.lines == (4,)
    with pytest.raises(ProgramError, match=r"give radius_mm, and wear_mm, in \[tools\.7\]"):
        corrected(tmp_path, RECTANGLE.replace(b"D1", b"D7"))


def test_right_angles_that_a_control_extends_become_blocks_of_the_path(tmp_path: Path) -> None:
    """Both sides of such a corner meet in one point, where no third block goes on."""
    keys = 'decimal_point = "calculator"\n'
    path = machine(tmp_path, LEANING, controller="haas", keys=keys, tables=tool(5.0))
    text = HEAD + b"G41 D1 G1 X20. Y20.\nY60.\nX90.\nY30. Z-1.\nG40 G0 X120.\nM2\n"
    result = olp.correct(text, path, contour="path")
    assert result.report["deviation"]["holds"]
    written = [b"X15.000 Y20.000", b"Y60.000", b"Y65.000", b"X20.000", b"X90.000", b"X95.000", b"Y60.000"]
    blocks = [line.removeprefix(b"G1 ") for line in body(result)]
    assert [block for block in blocks if block.strip() in written] == written
    assert b"" not in blocks


def test_points_under_cutcom_get_no_step(tmp_path: Path) -> None:
    path = machine(tmp_path, PLAY, tables=tool(5.0))
    text = b"UNITS/MM\nRAPID\nGOTO/0,0,0\nFEDRAT/600,MMPM\n%sGOTO/50,0,0\nGOTO/20,30,0\n%sGOTO/0,0,0\nFINI\n"
    on = olp.correct(text % (b"CUTCOM/LEFT\n", b"CUTCOM/OFF\n"), path)
    off = olp.correct(text % (b"", b""), path)
    assert on.data.count(b"GOTO") < off.data.count(b"GOTO")
    assert [f.lines for f in on.findings if f.code == "OLP313"] == [(6,)]
    with pytest.raises(UsageError, match="programs of blocks"):
        olp.correct(text % (b"CUTCOM/LEFT\n", b"CUTCOM/OFF\n"), path, contour="path")


def test_a_path_is_written_with_its_corners_and_without_compensation(tmp_path: Path) -> None:
    """About the upper right corner of a square, and away; worked by hand."""
    text = b"G1 X20 Y5\nN1 G42 D1 X40 Y0 (in)\nX100 F300\nN3 Y80 M8\nG40 G0 X120 Y90\n"
    lines = body(corrected(tmp_path, text, contour="path"))
    end = 40 - 5 * 5 / 425**0.5, -5 * 20 / 425**0.5
    assert lines[1] == b"N1 X%.3f Y%.3f (in)" % end
    away = end[0] - 40, end[1]
    assert lines[2] == b"G3 X40.000 Y-5.000 I%.4f J%.4f" % (-round(away[0], 3), -round(away[1], 3))
    assert lines[3:] == [
        b"G1 X100.000 F300", b"G3 X105.000 Y0.000 I0.0000 J5.0000",
        b"N3 G1 Y80.000 M8", b"G40 G0 X120.000 Y90.000", b"M2",
    ]  # fmt: skip


def test_a_path_keeps_distances_centres_and_units(tmp_path: Path) -> None:
    """The same tool path from absolute words, distances, inches, R words and absolute centres."""
    absolute = b"G1 X20 Y-10\nG42 D1 X40 Y0\nX80\nG3 X90 Y10 I0 J10\nG1 Y50\nX40\nY0\nG40 X20 Y-10\n"
    same = {
        "G91": b"G1 X20 Y-10\nG91 G42 D1 X20 Y10\nX40\nG3 X10 Y10 J10\nG1 Y40\nX-50\nY-50\n"
        b"G40 X-20 Y-10\nG90\n",
        "R": absolute.replace(b"I0 J10", b"R10"),
        "G90.1": b"G90.1\n" + absolute.replace(b"I0 J10", b"I80 J10"),
        "G91.1": b"G90.1\nG91.1\n" + absolute + b"G90.1\n",
    }
    wanted = corrected(tmp_path, absolute, contour="path")
    for name, text in same.items():
        result = corrected(tmp_path, text, contour="path")
        assert b"G42" not in result.data
        assert result.position_mm == pytest.approx(wanted.position_mm, abs=1e-9), name
        assert result.report["deviation"]["holds"], name


def test_above_tolerance_along_a_contour_the_path_of_the_tool_is_named(tmp_path: Path) -> None:
    slanted = b"G41 D1 X20 Y20\nX100 Y30\nX20 Y60\nG40 G0 X0 Y0\n"
    above = corrected(tmp_path, slanted, PLAY)
    (one,) = [f.message for f in above.findings if f.code == "OLP101"]
    assert one.endswith("correct with --contour path")
    path = corrected(tmp_path, slanted, PLAY, contour="path")
    assert path.report["deviation"]["holds"]
    edited = path.data.replace(b"G40 G0 X", b"G1 Z1\nG40 G0 X")
    found = olp.verify(HEAD + slanted + b"M2\n", edited, tmp_path / "machine.toml").findings
    (other,) = [f.message for f in found if f.code == "OLP101"]
    assert "contour" not in other


@pytest.mark.parametrize("flow", ["", "M98 P100 L2\nM2\nO100\n"])
@pytest.mark.parametrize("flatten", [False, True])
def test_what_rounding_makes_too_narrow_is_refused_at_its_own_line(
    tmp_path: Path, flow: str, flatten: bool
) -> None:
    """An arc of 5.01 mm has 5 mm of room, once its end is written with digits of 0.01 mm."""
    recipe = machines.Recipe(increment_mm=0.01, peak_um=(150.0, 200.0), waves=3.0)
    path = machines.random_machine(tmp_path, 1, recipe)
    head = "G21 G90 G54\nG0 X0 Y0 Z10\nG1 X90 Y90 F600\n"
    contour = "G0 X0 Y51.10\nG41.1 D10 G1 X20 Y51.10\nG3 X30.02 Y51.10 I5.01 J0\nG1 X60\nG40 G0 X0 Y0\n"
    text = f"{head}{flow}{contour}{'M99' if flow else 'M2'}\n".encode()
    with pytest.raises(ProgramError, match="would refuse this block once corrected") as caught:
        olp.correct(text, path, flatten=flatten)
    assert text.splitlines()[(caught.value.line or 1) - 1].startswith(b"G3")
    assert "does not fit" in caught.value.message
    assert caught.value.message.endswith("; have the path of the tool written with --contour path")
    assert olp.correct(text, path, contour="path").report["deviation"]["holds"]


def test_a_move_behind_a_tool_change_goes_where_it_should(tmp_path: Path) -> None:
    """Z is unknown there, and a contour came before: X and Y are those of the block, not of the contour."""
    recipe = machines.Recipe(
        controller="fanuc", tools={n: {"Z_mm": 0.0, "radius_mm": 5.0} for n in (1, 2)}, work_offsets=TWO
    )
    text = b"G21 G90 G17 G54\nT1 M6\nG0 X0 Y0\nG43 H1 Z10.\nG1 Z0 F600\nG41 D1 X10. Y-5.\nY50.\nX80.\n"
    text += b"G40 X95.\nG0 Z100.\nT2 M6\n%sG0 X10. Y10.\nG43 H2 Z50.\nM30\n"
    for offset in (b"", b"G55\n"):
        data = text % offset
        assert olp.correct(data, machines.zero_machine(tmp_path, recipe)).data == data
        lines = olp.correct(data, machines.random_machine(tmp_path, 3, recipe)).data.splitlines()
        x, y = (float(word[1:]) for word in lines[-3].split()[1:3])
        assert abs(x - 10) < 0.2 and abs(y - 10) < 0.2
