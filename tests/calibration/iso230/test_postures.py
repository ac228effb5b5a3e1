"""Test A: errors of tool vectors from one point, held in several postures; and the files of instruments."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from olp.calibration.iso230 import ballbar, diagonals, postures
from olp.calibration.observations.diagonals import Diagonal
from olp.core.errors import ConfigError
from olp.core.machine import Tool
from olp.files.measurements.instruments.ballbars import read_circles
from olp.files.measurements.instruments.diagonals import read_diagonal
from olp.files.measurements.postures import read_postures

POINT = np.array([400.0, 300.0, -500.0])


def held(vectors, errors, names, turns=None, noise=0.0, machine=None, seed=0):  # type: ignore[no-untyped-def]
    """Axis positions that bring a tip of the true vector onto the point."""
    random = np.random.default_rng(seed)
    n = len(names)
    turn = np.tile(np.eye(3), (n, 1, 1)) if turns is None else turns
    vector = np.array([vectors[name] for name in names], float)
    true = vector + np.array([errors[name] for name in names])
    axis = POINT - np.einsum("nij,nj->ni", turn, true) + random.normal(0, 1, (n, 3)) * noise
    if machine is not None:
        axis -= machine
    return postures.Postures(axis, tuple(names), vector, turn, max(noise, 1e-6), "a.csv")


STYLI = {"down": (0, 0, -100), "left": (-80, 0, -60), "front": (0, -80, -60)}
ERRORS = {"down": (0.010, -0.004, 0.021), "left": (-0.030, 0.012, 0.003), "front": (0.0, 0.015, -0.018)}


def test_without_a_turning_head_only_differences_are_known() -> None:
    result = postures.fit(held(STYLI, ERRORS, ["down", "left", "front"] * 4, noise=1e-3))
    assert result.reference == "down"
    for name in ("left", "front"):
        wanted = np.subtract(ERRORS[name], ERRORS["down"])
        assert np.abs(result.error_mm[name] - wanted).max() < 4 * result.sigma_mm[name].max()
        assert 3e-4 < result.sigma_mm[name].max() < 1.5e-3
    assert list(result.findings) == []
    assert result.as_dict()["before_rms_um"] > 10 * result.as_dict()["after_rms_um"]
    [left_stylus, _] = result.as_dict()["tools"]
    assert left_stylus["gauge_to_tip_mm"] == pytest.approx([-80.04, 0.016, -60.018], abs=4e-3)
    other = postures.fit(held(STYLI, ERRORS, ["down", "left", "front"] * 4, noise=1e-3), reference="front")
    gap = result.error_mm["left"] - result.error_mm["front"]
    assert other.error_mm["left"] == pytest.approx(gap, abs=1e-12)


ANGLES = np.array([[0, 0, 0], [30, 0, 0], [-30, 0, 90], [0, 40, 45], [20, -35, 180], [0, 0, -120]], float).T


def test_a_turning_head_gives_the_vector_itself() -> None:
    turn = postures.turn_of(*ANGLES)
    taken = held({"probe": (5, 2, -200)}, {"probe": (0.05, -0.02, 0.08)}, ["probe"] * 6, turn)
    result = postures.fit(taken)
    assert result.error_mm["probe"] == pytest.approx([0.05, -0.02, 0.08], abs=1e-9)
    assert result.point_mm == pytest.approx(POINT, abs=1e-9)
    assert result.reference is None


def test_turns_about_one_axis_hide_the_part_along_it() -> None:
    zero = np.zeros(4)
    turn = postures.turn_of(zero, zero, np.array([0.0, 90.0, 180.0, 270.0]))
    result = postures.fit(held({"probe": (5, 2, -200)}, {"probe": (0.05, -0.02, 0.08)}, ["probe"] * 4, turn))
    assert result.error_mm["probe"][:2] == pytest.approx([0.05, -0.02], abs=1e-9)
    assert np.isnan(result.error_mm["probe"][2])
    [finding] = result.findings
    assert finding.code == "OLP856" and "error in Z" in finding.message
    assert result.as_dict()["tools"][0]["gauge_to_tip_mm"] is None


def test_turns_are_right_handed() -> None:
    """A quarter turn about +Z takes X to Y, about +X takes Y to Z, about +Y takes Z to X."""
    quarter = np.eye(3) * 90.0
    turn = postures.turn_of(*quarter)
    assert turn[2] @ [1, 0, 0] == pytest.approx([0, 1, 0])
    assert turn[0] @ [0, 1, 0] == pytest.approx([0, 0, 1])
    assert turn[1] @ [0, 0, 1] == pytest.approx([1, 0, 0])


def test_errors_of_the_machine_are_taken_out() -> None:
    """Where a calibration says how the machine is off at each posture, it is no error of a tool."""
    names = ["down", "left", "front"] * 3
    off = np.random.default_rng(4).normal(0, 0.05, (9, 3))
    taken = held(STYLI, ERRORS, names, machine=off)
    uncompensated, known = postures.fit(taken), postures.fit(taken, off)
    assert known.as_dict()["after_rms_um"] < 1e-6
    assert uncompensated.as_dict()["after_rms_um"] > 10
    assert [f.code for f in uncompensated.findings] == ["OLP857"]
    assert known.error_mm["left"] == pytest.approx(np.subtract(ERRORS["left"], ERRORS["down"]), abs=1e-9)


def test_without_repetition_an_uncertainty_must_be_stated() -> None:
    once = held(STYLI, ERRORS, ["down", "left"])
    bare = postures.Postures(once.axis_mm, once.tool, once.vector_mm, once.turn)
    with pytest.raises(ConfigError, match="sigma_um is not stated"):
        postures.fit(bare)
    assert postures.fit(once).sigma_mm["left"] == pytest.approx([2**0.5 * 1e-6] * 3)
    two, ones = np.array([0.0, 100.0]), np.ones(2, int)
    plain = Diagonal((0, 0, 0), (60, 80, 0), two, np.array([0.0, 0.002]), ones, ones)
    with pytest.raises(ConfigError, match="nothing is repeated"):
        diagonals.fit([plain])


def test_program_of_postures() -> None:
    text = postures.program([1, 2], (10.0, 20.0, -30.0), clearance_mm=50.0, feed_mm_min=300.0, runs=1)
    assert text.count("M6") == 2 and "G1 Z-30.0000 F300" in text and "G0 Z20.0000" in text


def write(path: Path, head: str, rows: list[str]) -> Path:
    path.write_text(head + "\n".join(rows) + "\n", "utf-8")
    return path


def test_file_of_a_ball_bar(tmp_path: Path) -> None:
    head = "# plane = ZX\n# radius_mm = 100\n# centre_mm = [1, 2, 3]\n# tool_mm = [0, 0, -50]\n"
    rows = ["angle_deg,run,direction,deviation_um"]
    rows += [f"{a},1,{d},{a / 10}" for d in (1, -1) for a in range(0, 360, 9)]
    result = read_circles(write(tmp_path / "c.csv", head, rows))
    assert (result.plane, result.centre_mm, result.tool_mm) == ("ZX", (1, 2, 3), (0, 0, -50))
    assert result.value[1] == pytest.approx(0.9e-3)
    assert ballbar.fit(result).reading() is not None
    other = read_circles(write(tmp_path / "s.csv", head + "# sense = shorter-is-positive\n", rows))
    assert other.value == pytest.approx(-result.value)
    with pytest.raises(ConfigError) as caught:
        read_circles(write(tmp_path / "w.csv", head.replace("radius_mm", "radius"), rows))
    assert "did you mean radius_mm" in str(caught.value)
    with pytest.raises(ConfigError) as caught:
        read_circles(write(tmp_path / "v.csv", head, [rows[0], "0,1,1,1", "1,0.5,1,x", "2,1,0,1"]))
    assert "line 7: run = 0.5" in str(caught.value) and 'deviation_um = "x"' in str(caught.value)
    assert "line 8: direction = 0" in str(caught.value)


def test_file_of_a_diagonal(tmp_path: Path) -> None:
    head = "# start_mm = [0, 0, 0]\n# end_mm = [300, 400, 0]\n# tool_mm = [0, 0, 0]\n# sense = {}\n"
    rows = ["target_mm,run,direction,value_um", "0,1,1,0", "250,1,1,3", "500,1,1,5"]
    rows += ["0,2,1,0", "250,2,1,2", "500,2,1,5"]
    plus = read_diagonal(write(tmp_path / "p.csv", head.format("actual-minus-commanded"), rows))
    minus = read_diagonal(write(tmp_path / "m.csv", head.format("commanded-minus-actual"), rows))
    assert plus.name == "PP0"
    assert plus.elongation()[0] == pytest.approx(10e-6)
    assert minus.elongation()[0] == pytest.approx(-10e-6)
    assert diagonals.fit([plus]).as_dict()["diagonals"][0]["R_up_um"] == pytest.approx(4 * 0.5**0.5)
    with pytest.raises(ConfigError, match="sense is missing"):
        read_diagonal(write(tmp_path / "n.csv", head.replace("# sense = {}\n", ""), rows))


def test_file_of_postures(tmp_path: Path) -> None:
    rows = ["X_mm,Y_mm,Z_mm,tool", "0,0,100,1", "80,0,60,2", "0,0,100.01,1"]
    tools = {1: Tool(1, (0, 0, 100.0)), 2: Tool(2, gauge_to_tip_mm=(-80.0, 0.0, -60.0))}
    result = read_postures(write(tmp_path / "a.csv", "# sigma_um = 2\n", rows), tools)
    assert result.vector_mm.tolist() == [[0, 0, -100], [-80, 0, -60], [0, 0, -100]]
    # the point is at Z 0.005 by the mean of tool 1, at 0 by tool 2: tool 2 ends 0.005 higher than it says
    assert postures.fit(result).error_mm["2"] == pytest.approx([0, 0, 0.005], abs=1e-9)
    with pytest.raises(ConfigError, match="line 4: tool 2 has no vector"):
        read_postures(tmp_path / "a.csv", {1: tools[1]})
