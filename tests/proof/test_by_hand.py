"""The stated maximum of programs whose deviation is known by hand: uncorrected ones, or one word off."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine

import olp

HEAD = b"G21 G90 G54 G64 P0.0001 Q0\n"


def curve(axis: str, component: str, *nodes: tuple[float, float]) -> dict[str, str]:
    """A curve in um by axis position in mm, straight between its nodes."""
    rows = "".join(f"{at_mm},{value}\n" for at_mm, value in nodes)
    return {f"{axis.lower()}.csv": f"{axis}_mm,{component}_um\n{rows}"}


def stiff(folder: Path, curves: dict[str, str], calibration: str = "") -> Path:
    text = "".join(f'[[curves]]\nfile = "{name}"\ninterpolation = "linear"\n' for name in curves)
    return machine(folder, calibration + text, curves, tables=TRUE_ZERO)


def by_line(path: Path, nominal: bytes, corrected: bytes | None = None) -> dict[int, float]:
    """What `verify` states in um of each line that is judged; the program as its own correction if none."""
    nominal = HEAD + nominal
    done = olp.verify(nominal, nominal if corrected is None else HEAD + corrected, path)
    table = done.table.by_line()
    kept = {
        int(line): float(value)
        for line, value, state in zip(table["line"], table["corrected_um"], table["state"], strict=True)
        if state < 2
    }
    assert done.report["deviation"]["path_max_um"] == pytest.approx(max(kept.values()), abs=1e-3)
    return kept


#: exact where the programs are
NEARLY_EXACT = curve("X", "EXX", (-1000, 0), (1000, 0), (2000, 10))


def test_a_line_counts_between_its_ends(tmp_path: Path) -> None:
    path = stiff(tmp_path, curve("X", "EYX", (-1000, 0), (0, 0), (30, 20), (100, 0), (2000, 0)))
    assert by_line(path, b"G0 X0 Y0 Z0\nG1 X100 F500\nG0 Z10\nM2\n") == pytest.approx({3: 20.0}, abs=0.2)


def test_an_arc_counts_between_its_ends(tmp_path: Path) -> None:
    path = stiff(tmp_path, curve("X", "EZX", (-1000, 0), (0, 0), (30, 20), (100, 0), (2000, 0)))
    assert by_line(path, b"G0 X0 Y0 Z0\nG2 X100 I50 F500\nG0 Z10\nM2\n") == pytest.approx({3: 20.0}, abs=0.3)


@pytest.mark.parametrize("start_deg", (0.0, 22.5, 45.0))
def test_an_arc_counts_where_it_is_farthest_off(tmp_path: Path, start_deg: float) -> None:
    """X is off by 0.5 um per mm. Across a circle of 40 mm that is 20 um at its two ends in X."""
    path = stiff(tmp_path, curve("X", "EXX", (-1000, -500), (2000, 1000)))
    x, y = 40 * np.cos(np.radians(start_deg)), 40 * np.sin(np.radians(start_deg))
    text = f"G0 X{x:.4f} Y{y:.4f} Z0\nG3 I{-x:.4f} J{-y:.4f} F500\nG0 Z10\nM2\n".encode()
    assert by_line(path, text) == pytest.approx({3: 20.0}, abs=0.27)


@pytest.mark.parametrize("rise_mm", (0.0, 2.0, 30.0))
def test_the_start_of_a_helix_counts(tmp_path: Path, rise_mm: float) -> None:
    """Where it starts, the tool is 20 um too low, which is before the start of the helix."""
    nodes = ((-1000.0, -20.0), (0.0, -20.0), (0.1, 0.0), (2000.0, 0.0))
    path = stiff(tmp_path, curve("Z", "EZZ", *nodes))
    text = f"G0 X2 Y0 Z0\nG3 X-2 Z{rise_mm} I-2 F500\nG0 Z40\nM2\n".encode()
    assert by_line(path, text)[3] == pytest.approx(20.0, abs=0.2)


def test_the_end_of_a_part_counts(tmp_path: Path) -> None:
    path = stiff(tmp_path, NEARLY_EXACT)
    nominal = b"G0 X0 Y0 Z0\nG1 X100 F500\nX200\nG0 Z10\nM2\n"
    corrected = b"G0 X0 Y0 Z0\nG1 X50 Y0.0040 F500\nX100 Y0\nX200\nG0 Z10\nM2\n"
    assert by_line(path, nominal, corrected) == pytest.approx({3: 4.0, 4: 0.0}, abs=0.01)


def test_a_step_between_two_cuts_counts(tmp_path: Path) -> None:
    path = stiff(tmp_path, NEARLY_EXACT)
    nominal = b"G0 X0 Y0 Z0\nG1 X100 F500\nY80\nG0 Z10\nM2\n"
    corrected = b"G0 X0 Y0 Z0\nG1 X100 F500\nX100.0040 Y0\nX100 Y80\nG0 Z10\nM2\n"
    assert by_line(path, nominal, corrected) == pytest.approx({3: 0.0, 4: 4.0}, abs=0.01)


def test_a_cut_counts_from_where_the_rapid_left_the_tool(tmp_path: Path) -> None:
    path = stiff(tmp_path, NEARLY_EXACT)
    nominal = b"G0 X0 Y0 Z0\nG1 X100 F500\nG0 Z10\nM2\n"
    assert by_line(path, nominal, nominal.replace(b"Y0", b"Y0.0050")) == pytest.approx({3: 5.0}, abs=0.01)


@pytest.mark.parametrize("peak_mm", (500, 700))
def test_a_cut_from_an_unknown_position_counts_with_the_worst_of_it(tmp_path: Path, peak_mm: int) -> None:
    """Y may be anywhere in the box where the cut starts, and one of its places is off by 20 um in X."""
    nodes = ((-1000, 0), (peak_mm - 300, 0), (peak_mm, 20), (peak_mm + 300, 0), (2000, 0))
    path = stiff(tmp_path, curve("Y", "EXY", *nodes))
    assert by_line(path, b"G0 X0 Z0\nG1 Y50 F500\nG0 Z10\nM2\n") == pytest.approx({3: 20.0}, abs=0.2)


def test_an_unknown_side_and_an_unknown_position_count_once(tmp_path: Path) -> None:
    path = machine(tmp_path, "[backlash]\nX_um = 14.0\n", tables=TRUE_ZERO)
    assert by_line(path, b"G0 X0 Z0\nG1 Y50 F500\nG0 Z10\nM2\n") == pytest.approx({3: 7.0}, abs=0.1)


def test_a_side_that_is_unknown_at_the_start_alone_counts(tmp_path: Path) -> None:
    """The first cut takes the backlash of 14 um up; at its end the tool is up to 7 um off, which is where the
    second one starts."""
    job = "start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }"
    path = machine(tmp_path, "[backlash]\nX_um = 14.0\n", tables=TRUE_ZERO, job=job)
    done = olp.correct(HEAD + b"G1 X50 F500\nX90\nX130\nG0 Z10\nM2\n", path, tmp_path / "job.toml")
    largest = dict(zip(done.table.line.tolist(), (1e3 * done.table.corrected).tolist(), strict=True))
    assert largest[2] == pytest.approx(7.0, abs=0.6)
    assert largest[3] == pytest.approx(7.0, abs=0.6)
    assert largest[4] < 0.6


@pytest.mark.parametrize("block", (1, 2, 1 << 15))
def test_the_side_is_kept_from_block_to_block(
    tmp_path: Path, block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """X has taken up its backlash of 14 um in line 3, and is 7 um behind in the cuts along Y that follow."""
    monkeypatch.setattr("olp.proof.deviation._BLOCK", block)
    path = machine(tmp_path, "[backlash]\nX_um = 14.0\n", tables=TRUE_ZERO)
    text = b"G0 X0 Y0 Z0\nG0 X50\nG1 Y50 F500\nY60\nY70\nY80\nG0 Z10\nM2\n"
    assert by_line(path, text) == pytest.approx(dict.fromkeys((4, 5, 6, 7), 7.0), abs=0.01)


def test_rapids_do_not_count(tmp_path: Path) -> None:
    path = stiff(tmp_path, curve("X", "EYX", (-1000, 0), (0, 0), (30, 20), (100, 0), (2000, 0)))
    assert by_line(path, b"G0 X30 Y0 Z5\nX100\nG1 Z0 F500\nG0 Z10\nM2\n") == pytest.approx({4: 0.0}, abs=1e-3)


HOLE = b"G0 X0 Y0 Z20\nG81 X50 Y0 Z-10 R5 F300\nG80\nM2\n"


@pytest.mark.parametrize("level_mm", (5, -2, -10))
def test_a_hole_counts_across_its_axis(tmp_path: Path, level_mm: int) -> None:
    """The tool is off to the side at one height of the stroke alone: at its start, within, or its end."""
    nodes = ((-1000, 0), (level_mm - 2, 0), (level_mm, 12), (level_mm + 2, 0), (2000, 0))
    path = stiff(tmp_path, curve("Z", "EXZ", *nodes))
    assert by_line(path, HOLE) == pytest.approx({3: 12.0}, abs=0.2)


def test_a_hole_without_a_depth_counts_at_its_place(tmp_path: Path) -> None:
    """The rapid ends at the bottom, where the stroke begins and ends."""
    path = stiff(tmp_path, curve("Z", "EXZ", (-1000, 12), (2000, 12)))
    assert by_line(path, HOLE.replace(b"R5", b"R-10")) == pytest.approx({3: 12.0}, abs=0.01)


@pytest.mark.parametrize("off_um", (-9, 9))
def test_a_hole_counts_at_its_depth(tmp_path: Path, off_um: int) -> None:
    path = stiff(tmp_path, curve("Z", "EZZ", (-1000, off_um), (-10, off_um), (-9, 0), (2000, 0)))
    assert by_line(path, HOLE) == pytest.approx({3: 9.0}, abs=0.01)


@pytest.mark.parametrize("back", (b"G98", b"G99"))
@pytest.mark.parametrize("off_um", (-9, 9))
def test_a_hole_counts_from_where_its_stroke_starts(tmp_path: Path, back: bytes, off_um: int) -> None:
    """As a cut that starts before its line. Too deep a start lies on the axis."""
    path = stiff(tmp_path, curve("Z", "EZZ", (-1000, 0), (3, 0), (5, off_um), (2000, off_um)))
    assert by_line(path, HOLE.replace(b"G81", back + b" G81")) == pytest.approx({3: max(off_um, 0)}, abs=0.05)


@pytest.mark.parametrize("level_mm", (12, 20))
def test_the_rapids_of_a_hole_do_not_count(tmp_path: Path, level_mm: int) -> None:
    nodes = ((-1000, 0), (level_mm - 2, 0), (level_mm, 12), (level_mm + 2, 0), (2000, 0))
    path = stiff(tmp_path, curve("Z", "EXZ", *nodes))
    assert by_line(path, HOLE) == pytest.approx({3: 0.0}, abs=1e-3)


def test_the_verdict_turns_at_what_is_allowed(tmp_path: Path) -> None:
    """1 um and 0.866 of the last digit: a part that is off by 1.8 um is within, by 1.9 um is not."""
    path = stiff(tmp_path, NEARLY_EXACT)
    nominal = b"G0 X0 Y0 Z0\nG1 X100 F500\nG0 Z10\nM2\n"
    for off, holds in ((b"0.0018", True), (b"0.0019", False)):
        other = nominal.replace(b"X100", b"X50 Y" + off + b"\nX100 Y0")
        verdict = olp.verify(HEAD + nominal, HEAD + other, path).report["verdict"]
        assert verdict["ok"] is verdict["numerical"]["holds"] is holds
        assert verdict["numerical"]["line"] == 3
