"""Silent wrong moves of Heidenhain and Sinumerik programs, one test for each.

The numbers are those of `../shared/reference/languages.md`, section 10, as far as they concern the two. Two
readers that share no code with the package say where the tool goes.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from judge import heidenhain, machines, sinumerik_words
from judge.linuxcnc import FEED, RAPID, CanonMoves
from judge.machines import Recipe
from judge.model import JudgeModel
from judge.path import deviation

import olp
from olp.core.errors import ProgramError
from olp.files.config import load_setup
from olp.program.feeds.stated import programmed
from olp.program.registry import DIALECTS, Options, dialect_of, read

ORIGIN = np.array([250.0, 200.0, -300.0])
LENGTHS = {1: 120.0}
#: axes far from square and with play: long moves are split, and play is taken up in front of others
RECIPE = {
    "travel": ((-300.0, 900.0), (-300.0, 800.0), (-500.0, 200.0)),
    "backlash_um": {"X": 30.0, "Y": 25.0}, "tools": {1: {"Z_mm": 120.0, "radius_mm": 5.0}},
}  # fmt: skip
#: tolerance, and what rounding to 1 um may add in each axis
ALLOWED_UM = 1.0 + 1.5
H = "BEGIN PGM A MM\nTOOL CALL 1 Z S100\nL X+0 Y+0 Z+50 R0 FMAX\n"
S = "G71 G90 G17 G54\nT1 M6\nD1\nG0 X0 Y0 Z50\n"


@pytest.fixture(scope="module", params=["heidenhain", "sinumerik"])
def machine(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp(request.param)
    return machines.random_machine(folder, 7, Recipe(controller=request.param, **RECIPE))


def canon(text: bytes, machine: Path) -> CanonMoves:
    if load_setup(machine).machine.controller == "heidenhain":
        return heidenhain.read(text, ORIGIN, LENGTHS).canon()
    origins = {"G54": ORIGIN, "G500": np.zeros(3)}
    return sinumerik_words.read(text, origins, LENGTHS, {}).canon()


def said(machine: Path, heid: str, sinu: str) -> bytes:
    """The program of the language of a machine, whole."""
    if load_setup(machine).machine.controller == "heidenhain":
        return f"{H}{heid}\nEND PGM A MM\n".encode()
    return f"{S}{sinu}\nM30\n".encode()


def ends(text: bytes, machine: Path) -> np.ndarray:
    """(n, 3) the ends of the moves in numbers of the first system."""
    program = read(text, load_setup(machine), DIALECTS[load_setup(machine).machine.controller])
    return program.toolpath.end_mm - ORIGIN - [0.0, 0.0, 120.0]


def bottoms(text: bytes, machine: Path, z: float) -> Counter[tuple[int, int]]:
    """How often the tool is at a depth, by place."""
    axis = np.array(canon(text, machine).axis) - ORIGIN - [0.0, 0.0, 120.0]
    low = axis[np.abs(axis[:, 2] - z) < 0.2]
    return Counter((round(x), round(y)) for x, y in low[:, :2].tolist())


def test_1_a_block_that_is_inserted_under_a_modal_call_drills_no_hole(machine: Path) -> None:
    text = said(
        machine,
        "CYCL DEF 200 Q200=2 Q201=-9 Q206=50 Q203=+0 Q204=20\nL X-200 Y-150 F900 M89\nL X+300\nL Y+250 M99",
        "MCALL CYCLE81(20,0,2,-9)\nG1 X-200 Y-150 F900\nX300\nY250\nMCALL",
    )
    result = olp.correct(text, machine, flatten=True)
    assert result.data.count(b"\n") > text.count(b"\n") + 4
    assert bottoms(result.data, machine, -9.0) == {(-200, -150): 1, (300, -150): 1, (300, 250): 1}


def test_2_every_part_of_a_rapid_is_a_rapid(machine: Path) -> None:
    text = said(machine, "L X-200 F700\nL X+300 R0 F MAX\nL X-90 Y+9", "G1 X-200 F700\nG0 X300\nG1 X-90 Y9")
    done = canon(olp.correct(text, machine, split_rapids=True).data, machine)
    x, kind = np.array(done.axis)[:, 0] - ORIGIN[0], np.array(done.kind)
    far = int(np.argmax(x))
    low = int(np.argmin(x))
    assert far - low > 3
    assert (kind[low + 1 : far + 1] == RAPID).all()
    assert (kind[far + 1 :] == FEED).all() and len(kind) > far + 1


def test_3_and_4_trans_replaces_a_rotation_and_g58_is_no_work_offset(machine: Path) -> None:
    text = said(
        machine,
        "CYCL DEF 10.0\nCYCL DEF 10.1 ROT+90\nCYCL DEF 10.1 ROT+0\nCYCL DEF 7.1 X+10\nL X+1 Y+2",
        "ROT Z90\nTRANS X10\nX1 Y2\nTRANS\nG58 X5 Y=6\nX1 Y2",
    )
    plain = olp.flatten(text, machine)
    assert ends(plain, machine)[-1, :2].tolist() in ([11.0, 2.0], [6.0, 8.0])
    assert ends(plain, machine) == pytest.approx(
        np.array(canon(plain, machine).axis) - ORIGIN - [0, 0, 120.0], abs=1e-9
    )


def test_5_a_letter_takes_its_number_directly(tmp_path: Path) -> None:
    """C2.5 is an axis C; C2=5 is an axis C2, which is not there."""
    path = machines.random_machine(tmp_path, 7, Recipe(controller="sinumerik", **RECIPE))
    assert ends(f"{S}X1 C2.5\nX2 C25.815\n".encode(), path)[-2:, 0].tolist() == [1.0, 2.0]
    with pytest.raises(ProgramError, match="C2 "):
        olp.correct(f"{S}X1 C2=5\n".encode(), path)


def test_12_inches_count_in_positions_feeds_and_cycles(machine: Path) -> None:
    text = said(
        machine,
        "CYCL DEF 7.1 X+1\nL X+1 F100\nCYCL DEF 200 Q200=0.1 Q201=-0.5 Q206=50 Q203=+0 Q204=0.2\nL X+2 M99",
        "G700\nTRANS X1\nG1 X1 F10\nMCALL CYCLE81(0.2,0,0.1,-0.5)\nX2\nMCALL",
    ).replace(b"A MM", b"A INCH")
    own = ends(text, machine)
    assert own[-1, 0] == pytest.approx(76.2)
    assert own[:, 2].min() == pytest.approx(-12.7)
    program = read(text, load_setup(machine), DIALECTS[load_setup(machine).machine.controller])
    first = int(np.argmax(np.abs(program.toolpath.end_mm[:, 0] - ORIGIN[0] - 50.8) < 1e-6))
    assert programmed(program)[first] == pytest.approx(10 * 25.4 / 60)
    lathe = said(machine, "CYCL DEF 10.1 ROT+9", "DIAMON\nX5")
    with pytest.raises(ProgramError):
        olp.correct(lathe, machine)


@pytest.mark.parametrize("word", ["X", "Y", "Z"])
def test_18_angles_that_the_control_finds_are_none_of_linear_axes(tmp_path: Path, word: str) -> None:
    path = machines.random_machine(tmp_path, 7, Recipe(controller="heidenhain", **RECIPE))
    assert len(ends(f"{H}L A+Q120 B+Q121 C+Q122 R0 FMAX\nL X1\n".encode(), path)) == 2
    for flatten in (False, True):
        with pytest.raises(ProgramError, match=r"Q120|parameters"):
            olp.correct(f"{H}L {word}+Q120\n".encode(), path, flatten=flatten)


def test_19_a_section_is_corrected_in_each_frame_in_which_it_is_run(machine: Path, tmp_path: Path) -> None:
    calls = "L Z+9 FMAX\n{0}\nL X+0 Y+0 Z+9 FMAX\n{1}\n"
    heid = "".join(
        calls.format(f"CYCL DEF 7.1 X{x}\nCYCL DEF 7.2 Y{y}", "CALL LBL 1")
        for x, y in ((-150, 90), (260, -80))
    )
    heid += "L X+1\nM30\nLBL 1\nL Z-2 F500\nL X+60\nL Y+50\nL Z+9\nLBL 0"
    sinu = "".join(f"TRANS X{x} Y{y}\nG0 X0 Y0 Z9\nL77\n" for x, y in ((-150, 90), (260, -80)))
    file = tmp_path / ("a.h" if b"BEGIN" in said(machine, "", "") else "a.mpf")
    file.write_bytes(said(machine, heid, sinu))
    (tmp_path / "L77.SPF").write_text("G1 Z-2 F500\nX60\nY50\nZ9\nM17\n")
    with pytest.raises(ProgramError, match=r"CALL LBL|L77"):
        olp.correct(file, machine)
    plain = olp.flatten(file, machine)
    result = olp.correct(file, machine, flatten=True)
    errors = deviation(canon(result.data, machine), canon(plain, machine), JudgeModel(machine),
                       shift_by_frame={"G54": np.zeros(3)}, kinds=("feed",))  # fmt: skip
    assert errors.before.max_um > 20
    assert errors.max_um <= ALLOWED_UM


def test_24_a_log_is_no_program(tmp_path: Path) -> None:
    path = machines.random_machine(tmp_path, 7, Recipe(controller="sinumerik", **RECIPE))
    log = tmp_path / "LOG.MPF"
    log.write_text("1 ponavljanje 1 mera -1.6427 greska  0.0127\n2 ponavljanje 1 mera -1.6433\n")
    with pytest.raises(ProgramError) as caught:
        olp.correct(log, path)
    assert caught.value.line == 1


@pytest.mark.parametrize(
    ("text", "z"),
    [
        ("CYCLE DEF 7.0 DATUM SHIFT\nCYCLE DEF 7.3 Z-5\nL Z+1", -4.0),
        ("TOOL CALL 1 Z S100 DL+0.5 DR+0.1\nL X+0 Y+0 Z+1", 1.5),
    ],
)
def test_further_traps_of_conversational_programs(tmp_path: Path, text: str, z: float) -> None:
    path = machines.random_machine(tmp_path, 7, Recipe(controller="heidenhain", **RECIPE))
    assert ends(f"{H}{text}\nEND PGM A MM\n".encode(), path)[-1, 2] == pytest.approx(z)
    with pytest.raises(ProgramError, match="M128"):
        olp.correct(f"{H}L M128. F10000.\nL X1\n".encode(), path)


def test_what_follows_an_end_under_block_delete_runs_with_the_switch_alone(tmp_path: Path) -> None:
    path = machines.random_machine(tmp_path, 7, Recipe(controller="heidenhain", **RECIPE))
    data = f"{H}L Z+1 F100.\n/81 M30\nL Z+2\nEND PGM A MM\n".encode()
    for switch, z in ((False, 1.0), (True, 2.0)):
        own = read(data, load_setup(path), DIALECTS["heidenhain"], Options(block_delete=switch))
        assert own.toolpath.end_mm[-1, 2] - ORIGIN[2] - 120.0 == pytest.approx(z)
    with pytest.raises(ProgramError, match="block delete"):
        olp.correct(data.replace(b"M30", b"L Z-9"), path)


def test_texts_of_both_are_known(machine: Path) -> None:
    text, name = (
        said(machine, "L X1", "MCALL CYCLE81(5,0,1,-2)\nX1\nMCALL"),
        load_setup(machine).machine.controller,
    )
    assert dialect_of(None, DIALECTS["haas"], text, "a.nc").name == name
