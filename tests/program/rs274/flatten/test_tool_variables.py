"""Parameters of LinuxCNC that have the tool and the work offset, against its interpreter."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from judge import linuxcnc, machines
from judge.machines import Recipe

import olp
from olp.core.errors import ProgramError

TOOLS = {
    1: {"Z_mm": 80.0, "radius_mm": 3.0},
    7: {"X_mm": 1.5, "Y_mm": -2.0, "Z_mm": 60.25, "radius_mm": 4.125, "wear_mm": 0.25},
}
OFFSETS = {"G54": {"set_by": "true"}, "G55": {"X_mm": 3.0, "set_by": "true"}, "G59.3": {"set_by": "true"}}
RUNS = (
    "G0 X#5400 Y#5410 Z#5403\nX#5220 Y#<_coord_system> Z#<_current_tool>\n",
    "T7\nG0 X#5400 Y#<_selected_tool>\nM6\nG0 X#5401 Y#5402 Z#5403\nX#5410\nG43\nX#5401\n"
    "G59.3\nX#5220 Y#<_coord_system>\n",
    "G55\nT7 M6 G0 X#5400\nY#5400 X#5220\nT1 M6\nG0 X#5410\n",
    # the radius, as programs that move around a part take it
    "T7 M6\no1 sub\n#<r> = [#5410 / 2]\nG0 X[10 + #<r>] Y#1\no1 endsub\no1 call [#5220]\n",
)
UNKNOWN = (
    "G20\nG0 X#5410\n", "G0 X#<_selected_tool>\n", "M61 Q7\nG0 X#5400\n", "T0 M6\nG0 X#5410\n",
    "G10 L1 P1 R3\nG0 X#5410\n", "G0 X#5411\n", "/T7 M6\nG0 X#5400\n", "/G55\nG0 X#5220\n",
)  # fmt: skip


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    recipe = Recipe(tools=TOOLS, work_offsets=OFFSETS)
    return machines.zero_machine(tmp_path_factory.mktemp("m"), recipe)


@pytest.mark.oracle
@pytest.mark.parametrize("text", RUNS)
def test_the_interpreter_has_the_same_values(text: str, path: Path) -> None:
    source = f"G21 G90 G54\n{text}M2\n".encode()
    theirs, own = (
        linuxcnc.interpret(each, path, find_known=False).axis for each in (source, olp.flatten(source, path))
    )
    np.testing.assert_allclose(own, theirs, atol=1e-6)


@pytest.mark.parametrize("text", UNKNOWN)
def test_what_is_not_known_is_refused(text: str, path: Path) -> None:
    with pytest.raises(ProgramError, match=r"not known off line; (assign it there, or )?give it in the job"):
        olp.flatten(f"G21 G90 G54\n{text}M2\n".encode(), path)


@pytest.mark.parametrize(
    ("code", "axes"), [("M6", "XY"), ("T7 M6", "XY"), ("M101", "XYZ"), ("M8", "XYZ"), ("M77", "")]
)
def test_what_m_codes_leave_where_it_is(code: str, axes: str, tmp_path: Path) -> None:
    """The machine file says which axes M6 may move, and which codes of the builder move none; others may."""
    machine = machines.zero_machine(tmp_path, Recipe(tools=TOOLS, work_offsets=OFFSETS))
    stated = 'still_m_codes = [101]\ntool_change_moves = ["Z"]\n'
    machine.write_text(stated + machine.read_text())
    for axis in "XYZ":
        source = f"G21 G90 G54\nT1\nG0 X1 Y2 Z3\n{code}\nG0 X[#<_{axis}>] Y0 Z9\nM2\n".encode()
        if axis in axes:
            assert f"G0 X{'XYZ'.index(axis) + 1} Y0 Z9".encode() in olp.flatten(source, machine)
        else:
            with pytest.raises(ProgramError, match=f"the position of {axis} is needed here"):
                olp.flatten(source, machine)
