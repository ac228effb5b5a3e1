"""Ends of blocks along contours: where the path goes straight on, only what is across it counts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine

import olp
from olp.core.toolpath import Toolpath
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read
from olp.proof.smooth_joints import SmoothJoints

HEAD = b"G21 G90 G54 F600\nG0 X0 Y0 Z10\nG1 Z0\n"
TOOL = f"{TRUE_ZERO}[tools.1]\nZ_mm = 0.0\nradius_mm = 5.0\n[job_defaults]\ntool = 1\n"


def path_of(folder: Path, text: bytes) -> Toolpath:
    return read(
        HEAD + text + b"M2\n", load_setup(machine(folder, tables=TOOL)), DIALECTS["linuxcnc"]
    ).toolpath


def joints_of(folder: Path, text: bytes) -> SmoothJoints | None:
    return SmoothJoints.of(path_of(folder, text))


def test_joints_are_where_a_contour_goes_straight_on(tmp_path: Path) -> None:
    """Right of a line, its outside corner of 90 degrees, and an arc that goes on from a line as a helix."""
    text = b"G42 D1 G1 X20 Y0\nX30\nX40 Y0.1\nZ-1\nX50\nY30\nG3 X40 Y40 I-10 Z-2\nG40 G1 X0\n"
    path, found = path_of(tmp_path, text), joints_of(tmp_path, text)
    assert found is not None
    lines = path.line[found.move].tolist()
    # to the line on, to the corner, from it, and to the helix; not to and from the plunge
    assert lines == [5, 8, 9, 9]
    arc = found.behind[1]
    assert arc == pytest.approx(found.before[1], abs=0.011)
    steep = np.array([0.0, 15.0 * np.pi / 2, -1.0])
    assert found.behind[3] == pytest.approx(steep / np.linalg.norm(steep))
    assert found.before[3] == pytest.approx([0, 1, 0])
    # an arc is straight for a tenth of its radius
    assert found.ahead[3] == pytest.approx(1.5)
    assert found.back[3] == pytest.approx(29.9)


def test_there_are_none_without_compensation_at_rapids_and_between_contours(tmp_path: Path) -> None:
    assert joints_of(tmp_path, b"G1 X20 Y0\nX30\nX40\n") is None
    assert joints_of(tmp_path, b"G41.1 D0 G1 X20 Y0\nX30\nX40\nG40 X50\n") is None
    assert joints_of(tmp_path, b"G42 D1 G1 X20 Y0\nG0 X30\nG1 X40\nG40 X50\n") is None
    assert joints_of(tmp_path, b"G42 D1 G1 X20 Y0\nG40 X30\n") is None


@pytest.mark.parametrize(
    ("away", "distance"),
    [
        ((0.3, 0.0, 0.0), 0.3 * np.sin(0.04)), ((-0.3, 0.0, 0.0), 0.3 * np.sin(0.04)),
        ((0.0, 0.0, 0.2), 0.2), ((-11.0, 0.0, 0.0), 7.0), ((11.0, 0.0, 0.0), 7.0),
    ],
)  # fmt: skip
def test_what_is_along_the_path_counts_by_its_turn(
    tmp_path: Path, away: tuple[float, float, float], distance: float
) -> None:
    """Blocks of 10 mm with a turn of 0.04 rad; a point that is farther away than they are long stays."""
    end = 30 + 10 * np.cos(0.04), 10 * np.sin(0.04)
    found = joints_of(tmp_path, b"G42 D1 G1 X20 Y0\nX30\nX%.6f Y%.6f\nG40 X90\n" % end)
    assert found is not None
    move = found.move[-1]
    size = np.array([7.0, 7.0])
    found.put_across(size, np.array([move, move + 1]), np.array([away, away]))
    assert size == pytest.approx([distance, 7.0], rel=0.02)


def test_a_tool_that_is_late_along_a_contour_is_on_its_path(tmp_path: Path) -> None:
    """The same moves as a contour and as the path of its tool, by hand: a joint 8 um late, 1 um across."""
    path = machine(tmp_path, tables=TOOL)
    text = HEAD + b"G42 D1 G1 X20 Y0\nX50\nX80\nG40 X120\nM2\n"
    late = text.replace(b"X50", b"X49.992")
    aside = text.replace(b"X50", b"X49.992 Y0.001")
    assert olp.verify(text, late, path).report["deviation"]["path_max_um"] == pytest.approx(0.0, abs=1e-3)
    assert olp.verify(text, aside, path).report["deviation"]["path_max_um"] == pytest.approx(1.0, abs=0.01)
    plain = text.replace(b"G42 D1 ", b"")
    found = olp.verify(plain, plain.replace(b"X50", b"X49.992"), path).report["deviation"]
    assert found["path_max_um"] == pytest.approx(8.0, abs=1e-3)


def test_a_plunge_that_is_late_counts_in_full(tmp_path: Path) -> None:
    path = machine(tmp_path, tables=TOOL)
    text = HEAD + b"G42 D1 G1 X20 Y0\nX50\nZ-1\nX80\nG40 X120\nM2\n"
    late = text.replace(b"X50", b"X49.992")
    assert olp.verify(text, late, path).report["deviation"]["path_max_um"] == pytest.approx(8.0, abs=1e-3)
