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
