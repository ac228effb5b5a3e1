"""Which moves belong to which: programs whose moves are split in a known way."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine

from olp.core.errors import ProgramError
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.files.config import load_setup
from olp.program.program import Program
from olp.program.registry import DIALECTS, read
from olp.proof.matching import match

BOX = np.tile([-1000.0, 2000.0], (3, 1))
MODEL = build(Calibration("exact", BOX), "FXYZ")
NEAR_MM = 0.05
START = "G21 G90 G17 G54 G61\nG0 X0 Y0 Z0\n"
#: Number of parts of a move; more than a window allows at first among them.
PARTS = (1, 1, 1, 2, 3, 7, 90)
#: mm; by how much a correction moves the ends of parts.
OFF_MM = 0.003


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machine(tmp_path_factory.mktemp("matching"), tables=TRUE_ZERO)


def program(text: str, folder: Path) -> Program:
    return read((START + text).encode(), load_setup(folder, None), DIALECTS["linuxcnc"])


def groups(nominal: Program, corrected: Program) -> list[int]:
    return match(nominal, nominal.toolpath.end_mm, corrected, MODEL, NEAR_MM).tolist()


def split_at_random(seed: int, moves: int) -> tuple[str, str, list[int]]:
    """A nominal program, one whose moves are split, and the last move of each; behind the move to the
    start."""
    rng = np.random.default_rng(seed)
    here = np.zeros(3)
    nominal, corrected, last = [], [], [0]
    for _ in range(moves):
        kind = rng.choice(["G0", "G1", "G1", "G3"])
        count = 1 if kind == "G0" else int(rng.choice(PARTS))
        there = here + rng.uniform(5.0, 60.0, 3) * rng.choice([-1.0, 1.0], 3)
        shares = np.arange(1, count + 1) / count
        if kind == "G3":
            # half a turn from here about a centre on the way, with a rise
            centre = (here + there)[:2] / 2
            arm = here[:2] - centre
            nominal.append(word("G3", there) + f" I{-arm[0]:.6f} J{-arm[1]:.6f}")
            before = here
            for share in shares:
                c, s = math.cos(math.pi * share), math.sin(math.pi * share)
                turned = centre + np.array([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]])
                end = np.array([*turned, here[2] + share * (there - here)[2]])
                corrected.append(
                    word("G3", end) + f" I{centre[0] - before[0]:.6f} J{centre[1] - before[1]:.6f}"
                )
                before = end
        else:
            nominal.append(word(kind, there))
            ends = here + shares[:, None] * (there - here)
            corrected += [word(kind, end + rng.uniform(-OFF_MM, OFF_MM, 3)) for end in ends]
        last.append(last[-1] + count)
        here = there
    return "\n".join(nominal) + "\n", "\n".join(corrected) + "\n", last


def word(code: str, end: np.ndarray) -> str:
    feed = "" if code == "G0" else " F500"
    return f"{code} X{end[0]:.6f} Y{end[1]:.6f} Z{end[2]:.6f}{feed}"


@pytest.mark.parametrize("seed", range(8))
def test_parts_belong_to_their_move(seed: int, folder: Path) -> None:
    nominal, corrected, last = split_at_random(seed, 25)
    assert groups(program(nominal, folder), program(corrected, folder)) == last


@pytest.mark.parametrize("seed", range(4))
def test_one_wrong_coordinate_shifts_no_other(seed: int, folder: Path) -> None:
    nominal, corrected, last = split_at_random(seed, 25)
    lines = corrected.splitlines()
    for wrong in (last[9] - 1, last[10] - 1):
        lines[wrong] = lines[wrong].replace(" Z", " Z1", 1) if " Z-" not in lines[wrong] else lines[wrong]
    straight = [k for k in (9, 10) if "I" not in lines[last[k] - 1]]
    if len(straight) == 2:
        assert groups(program(nominal, folder), program("\n".join(lines) + "\n", folder)) == last


def test_steps_before_a_move_belong_to_it(folder: Path) -> None:
    """Backlash is taken up beside the waypoint before the move."""
    nominal = "G1 X10 F500\nX20\nX30\nG0 Z9\n"
    corrected = "G1 X10 F500\nX10.004\nX20\nX20.004\nX30\nG0 Z9\n"
    assert groups(program(nominal, folder), program(corrected, folder)) == [0, 1, 3, 5, 6]


def test_whole_circles_on_a_shifted_zero_leave_no_doubt(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each passes its end as it begins, and has a step before each half; only doubts are searched."""
    nominal = program("G0 X0\n" + 30 * "G2 I9 F500\n", folder)
    half = "G1 X1.003 F500\nG2 X19 I9\nG1 X18.997\nG2 X1 I-9\n"
    corrected = program("G0 X1\n" + 30 * half, folder)
    monkeypatch.setattr("olp.proof.matching._Alignment._window", None)
    target = nominal.toolpath.end_mm.copy()
    target[1:, 0] += 1.0
    ends = match(nominal, target, corrected, MODEL, NEAR_MM)
    assert ends.tolist() == [0, 1, *range(5, 125, 4)]


def test_what_comes_behind_the_last_waypoint_belongs_to_it(folder: Path) -> None:
    nominal, corrected = "G1 X10 F500\nG2 X10 I-5\n", "G1 X10 F500\nG2 X0 I-5\nX10 I5\n"
    assert groups(program(nominal, folder), program(corrected, folder)) == [0, 1, 3]


def test_programs_of_as_many_moves_are_matched_one_by_one(folder: Path) -> None:
    text = "G1 X10 F500\nX20\nX30\n"
    assert groups(program(text, folder), program(text, folder)) == [0, 1, 2, 3]
    assert groups(program(text, folder), program(text.replace("X20", "X25"), folder)) == [0, 1, 2, 3]


def test_another_job_is_refused(folder: Path) -> None:
    text = "G1 X10 F500\nX20\nX30\nX40\n"
    with pytest.raises(ProgramError, match="4 moves and holes, fewer than the 5 of the nominal one"):
        groups(program(text, folder), program("G1 X10 F500\nX20\nX30\n", folder))
    # three of five waypoints are farther off than 1 mm, and two of five are a wrong program of this job
    with pytest.raises(ProgramError, match=r"3 of 5 waypoints are farther than 1 mm .* at its line 4;"):
        groups(program(text, folder), program("G1 X10 F500\nX22\nX33\nX44\n", folder))
    two = program("G1 X10 F500\nX20\nX33\nX44\n", folder)
    assert groups(program(text, folder), two) == [0, 1, 2, 3, 4]
    assert groups(program("", folder), program("", folder)) == [0]


@pytest.mark.parametrize("parts", (63, 66, 200, 700))
@pytest.mark.parametrize("split", (3, 8, 13))
def test_a_move_of_many_parts_beside_a_wrong_one(split: int, parts: int, folder: Path) -> None:
    """Where a waypoint is far off, so much is in doubt that the next moves are aligned at once."""
    ends = np.array([[10.0 * k, 5.0 * (k % 2), 0.0] for k in range(1, 15)])
    nominal = "".join(word("G1", end) + "\n" for end in ends)
    lines, last = [], [0]
    for k, end in enumerate(ends):
        count = parts if k == split else 1
        begin = ends[k - 1] if k else np.zeros(3)
        for share in np.arange(1, count + 1) / count:
            lines.append(word("G1", begin + share * (end - begin)))
        last.append(last[-1] + count)
    lines[last[2] - 1] = word("G1", ends[1] + [0.0, 3.0, 0.0])
    assert groups(program(nominal, folder), program("\n".join(lines) + "\n", folder)) == last
