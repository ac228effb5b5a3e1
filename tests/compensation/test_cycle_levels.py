"""R and depth of canned cycles between G90 and G91 on controls where they stay levels."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.acceptance import unstamped
from judge import machines
from judge.machines import Recipe
from judge.path import judge_programs

import olp

HEAD = "G21 G90 G17 G54 G94 F100\nG0 X10. Y20. Z50.\n"
#: rows of holes, and what each change of the mode would have to state again
ROWS = {
    "G98 G81 X20. Z-5. R2.\nX60.\nG91 X40.{} L3\nY60.\nG90 X10.{}\nY180.\nG80\nG0 X0. Z60.\nM2\n": (
        " Z-7. R-48.", " Z-5. R2.",
    ),
    "G91 G99 G81 X20. Z-6. R-40.\nY70.\nG90 X150.{}\nX20. Y10.\nG91 Y50.{}\nG80\nG90 G0 X0. Z60.\nM2\n": (
        " Z4. R10.", " Z-6. R-40.",
    ),
}  # fmt: skip


def machine(folder: Path, *, errors: bool) -> Path:
    recipe = Recipe(controller="fanuc", increment_mm=0.0001, peak_um=(10.0, 30.0))
    return machines.random_machine(folder, 31, recipe) if errors else machines.zero_machine(folder, recipe)


@pytest.mark.parametrize("row", ROWS)
def test_without_errors_no_level_is_stated_again(row: str, tmp_path: Path) -> None:
    path = machine(tmp_path, errors=False)
    text = (HEAD + row.format("", "")).encode()
    assert unstamped(olp.correct(text, path).data) == text


@pytest.mark.oracle
@pytest.mark.parametrize("row", ROWS)
def test_levels_that_change_are_stated_together(row: str, tmp_path: Path) -> None:
    """LinuxCNC, which takes them for distances, bores the same holes then."""
    path = machine(tmp_path, errors=True)
    result = olp.correct((HEAD + row.format("", "")).encode(), path)
    assert result.report["deviation"]["holds"]
    stated = (HEAD + row.format(*ROWS[row])).encode()
    verdict = judge_programs(stated, result.data, path, kinds=("feed",))
    assert verdict.after.judged > 0
    assert verdict.max_um < 1.2


@pytest.mark.parametrize("row", [
    "G99 G81 X20. Z-5. R2.\nG91 X5. Z-7. R-48.\nG90 X30.\nX300. Y200.\nX400. Y20.\n",
    "G98 G81 X20. Z-5. R2.\nX60.\nG91 X40. L3\nY60.\nX300.\n",
])  # fmt: skip
@pytest.mark.parametrize(("seed", "peak_um"), [(2, 1.2), (2, 1.5), (5, 1.5)])
def test_what_a_program_states_itself_is_no_level_of_the_other_mode(
    row: str, seed: int, peak_um: float, tmp_path: Path
) -> None:
    """Errors of about a digit: some holes need other levels, and others do not."""
    recipe = Recipe(controller="fanuc", increment_mm=0.001, peak_um=(peak_um, 1.01 * peak_um))
    path = machines.random_machine(tmp_path, seed, recipe)
    text = HEAD + row + "G80\nG90 G0 X0. Z60.\nM2\n"
    assert olp.correct(text.encode(), path).report["deviation"]["holds"]
