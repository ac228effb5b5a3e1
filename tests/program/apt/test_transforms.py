"""Transforms that programs of APT state: TRACUT with a matrix and TRANS, with frames, arcs and homes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases import posts
from judge import machines
from judge.cldata import read_apt
from judge.model import JudgeModel
from judge.path import deviation

import olp
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, Options, read

ORIGIN = np.array([250.0, 200.0, -300.0])
FRAMES = {"G54": (np.eye(3), ORIGIN)}
LENGTHS = {1: 120.0}
RECIPE = machines.Recipe(increment_mm=0.0001)
STILL = {"G54": np.zeros(3)}
#: tolerance, and what rounding to 0.1 um may add
ALLOWED_UM = 1.0 + 0.09
#: 30 degrees about Z and a shift, in numbers of six decimals; and quarter turns about X and Z
ROUND_Z = "TRACUT/0.866025,-0.5,0,40,0.5,0.866025,0,-20.5,0,0,1,15"
OVER_X = "TRACUT/1,0,0,40,0,0,-1,-20.5,0,1,0,15"
SHIFTED = "TRANS/40,-20.5,15"


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.random_machine(tmp_path_factory.mktemp("bent"), 7, RECIPE)


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.zero_machine(tmp_path_factory.mktemp("zero"), RECIPE)


def ends(text: str, path: Path, unit: str = "MM") -> np.ndarray:
    setup = load_setup(path)
    program = read(f"UNITS/{unit}\n{text}".encode(), setup, DIALECTS["apt"], Options())
    return program.toolpath.end_mm - ORIGIN


def within(steps: list[posts.Step], flavour: str, *statements: str) -> bytes:
    """A job with statements before its first point."""
    data = posts.apt(steps, flavour)
    place = data.index(b"SPINDL")
    return data[:place] + "".join(s + "\n" for s in statements).encode() + data[place:]


@pytest.mark.parametrize("statements", [(ROUND_Z,), (OVER_X,), (SHIFTED,), (OVER_X, SHIFTED)])
@pytest.mark.parametrize("flavour", ["nx", "catia"])
def test_transformed_points_and_arcs_are_corrected_where_they_lie(
    statements: tuple[str, ...], flavour: str, bent: Path, zero: Path
) -> None:
    steps = posts.job(3, count=9, reach=120.0)
    if flavour == "catia" and statements[0] == OVER_X:
        return  # CIRCLE of CATIA has no normal
    data = within(steps, flavour, *statements)
    assert olp.correct(data, zero).data == data
    result = olp.correct(data, bent)
    assert result.report["deviation"]["holds"]
    assert "OLP414" in {f.code for f in result.findings}
    nominal, own = (read_apt(d, FRAMES, LENGTHS, tool=1).canon() for d in (data, result.data))
    errors = deviation(own, nominal, JudgeModel(bent), shift_by_frame=STILL, kinds=("feed", "arc"))
    assert errors.max_um <= ALLOWED_UM
    assert olp.verify(data, result.data, bent).report["deviation"]["holds"]


def test_a_matrix_holds_until_it_ends(zero: Path) -> None:
    got = ends(f"{OVER_X}\nGOTO/1,2,3\nTRACUT/NOMORE\nGOTO/1,2,3\n", zero)
    assert got == pytest.approx(np.array([[41.0, -23.5, 17.0], [1.0, 2.0, 3.0]]))


@pytest.mark.parametrize(
    ("statement", "point"),
    [
        ("TRACUT/(MATRIX/TRANSL,5,6,7)", (6.0, 8.0, 10.0)),
        ("TRACUT/TRANSL,5,6", (6.0, 8.0, 3.0)),
        ("TRACUT/XYROT,90", (-2.0, 1.0, 3.0)),
        ("TRACUT/(MATRIX/YZROT,90)", (1.0, -3.0, 2.0)),
        ("TRACUT/ZXROT,90", (3.0, 2.0, -1.0)),
        ("TRACUT/XYROT,-60", (0.5 + 3**0.5, 1.0 - 0.75**0.5, 3.0)),
        ("TRANS/5,6,7", (6.0, 8.0, 10.0)),
        ("TRANS/5,6,7\nTRANS/NOMORE", (1.0, 2.0, 3.0)),
        ("TRANS/5,6,7\nTRANS/0,0,1", (1.0, 2.0, 4.0)),
    ],
)
def test_forms_of_transforms(statement: str, point: tuple[float, ...], zero: Path) -> None:
    assert ends(f"{statement}\nGOTO/1,2,3\n", zero)[0] == pytest.approx(point, abs=1e-9)


def test_a_shift_is_in_the_unit_of_the_program_and_turns_with_the_work_offset(tmp_path: Path) -> None:
    frames = {"G54": {"X_mm": 250.0, "Y_mm": 200.0, "Z_mm": -300.0, "C_deg": 90.0, "set_by": "true"}}
    path = machines.zero_machine(tmp_path, replace(RECIPE, work_offsets=frames))
    assert ends("TRANS/1,0,0\nGOTO/0,0,0\n", path, "INCH")[0] == pytest.approx([0.0, 25.4, 0.0])
    got = ends("TRACUT/1,0,0,5,0,0,-1,0,0,1,0,0\nGOTO/1,2,3\n", path)[0]
    assert got == pytest.approx([3.0, 6.0, 2.0])


def test_a_stated_tool_axis_turns_with_the_points(zero: Path) -> None:
    program = read(
        f"UNITS/MM\nLOADTL/1\nTLAXIS/0,.6,.8\n{OVER_X}\nGOTO/0,0,0\n".encode(), load_setup(zero),
        DIALECTS["apt"], Options(),
    )  # fmt: skip
    path = program.toolpath
    assert path.frames[int(path.frame[-1])].tool_mm == pytest.approx((0.0, 96.0, -72.0))
    assert path.end_mm[-1] - ORIGIN == pytest.approx([40.0, -20.5 - 96.0, 15.0 + 72.0])


def test_homes_and_the_start_are_points_of_the_frame(zero: Path) -> None:
    got = ends("FROM/1,2,3\nTRANS/10,0,0\nGOTO/0,0,0\nGOHOME/5,5,5\nGOTO/1,1,1\nGOHOME\n", zero)
    assert got.tolist() == [[10.0, 0.0, 0.0], [15.0, 5.0, 5.0], [11.0, 1.0, 1.0], [1.0, 2.0, 3.0]]
