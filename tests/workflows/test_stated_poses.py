"""Programs whose words state poses, on random platforms with wrong legs: judged by a reader, an inverse and a
forward computation of their own, at and between the written waypoints."""

from __future__ import annotations

import json
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from cases.any_machines import Made, write_machine
from cases.fast import left_to_a_campaign
from click.testing import CliRunner
from judge.whole_machine import WholeMachine, small

import olp
from olp.cli import main
from olp.core.errors import ProgramError

OFFSET = (5.0, -3.0, 2.0)
FRAME = '\n[work_offsets.G54]\nset_by = "true"\nX_mm = 5.0\nY_mm = -3.0\nZ_mm = 2.0\n'
HEAD = "G21 G90 G17 G54 G64 P0.01\nT1 M6\nG43 H1\n"
KINDS = ("hexapod", "tripod", "linear delta", "rotary delta")


def machine_of(folder: Path, kind: str, seed: int) -> tuple[Path, Made]:
    made, _ = write_machine(folder, kind, seed)
    machine = folder / "machine.toml"
    text = machine.read_text().replace("[kinematics]\n", '[kinematics]\nprogram_words = "pose"\n')
    machine.write_text(text + FRAME)
    return machine, made


def program_of(kind: str, made: Made) -> str:
    high = round(made.start[2] + made.tip[2])
    turns = (" A0. B0. C0.", " A1.5 B-2. C1.", " A2. C4.") if kind == "hexapod" else ("", "", "")
    return (
        f"{HEAD}G0 X0. Y0. Z{high}{turns[0]}\nG1 X20. Y10. F900 (first)\n"
        f"X45.5 Y-12.25 Z{high + 6}{turns[1]}\nG91 X-10. Y-5.\nG90 G2 X15.5 Y-17.25 I-10. J0.\n"
        f"G1 X-30. Y2.{turns[2]}\nG0 Z{high + 5}\nM30\n"
    )


def read(text: str, columns: int) -> list[np.ndarray]:
    """The stated poses of straight feed moves behind the first rapid, by an own reader; arcs end there."""
    place, counts, feeds = np.full(columns, np.nan), False, []
    for line in text.splitlines():
        words = re.findall(r"([A-Z])(-?[\d.]+)", re.sub(r"\(.*?\)", "", line))
        for letter, number in words:
            counts = {"G90": False, "G91": True}.get(letter + number, counts)
        given = [(w, float(v)) for w, v in words if w in "XYZABC"[:columns]]
        if given:
            place = place.copy()
            for letter, number in given:
                column = "XYZABC".index(letter)
                offset = OFFSET[column] if column < 3 else 0.0
                place[column] = place[column] + number if counts else number + offset
            feeds.append(place)
    return feeds


class Posed:
    """The judge, commanded in poses."""

    def __init__(self, machine: Path, made: Made) -> None:
        self.judge, self.made = WholeMachine(machine, (0.0, (0.0, 0.0, 0.0))), made

    def stated(self, words: np.ndarray) -> np.ndarray:
        """(4, 4) the pose that words state."""
        pose = np.eye(4)
        pose[:3, 3] = words[:3]
        if len(words) > 3:
            pose[:3, :3] = small("xyz", np.radians(words[3:]))[0]
        return pose

    def actual(self, words: np.ndarray) -> np.ndarray:
        """(4, 4) where the machine with its errors has the tool."""
        wanted = self.stated(words)
        turn = wanted[:3, :3]
        assert self.made.legs is not None
        axes = self.made.legs(wanted[:3, 3] - turn @ np.array(self.made.tip), turn)
        return np.asarray(self.judge.pose(axes[None], True)[0])


@pytest.mark.slow
@pytest.mark.parametrize("kind", left_to_a_campaign(KINDS, ("linear delta", "rotary delta")))
def test_the_tool_is_where_the_program_says(kind: str, tmp_path: Path) -> None:
    machine, made = machine_of(tmp_path, kind, 11)
    text, turns = program_of(kind, made), kind == "hexapod"
    result = olp.correct_joints(text.encode(), machine, tolerance_urad=2.0)
    assert result.report["verdict"]["ok"]
    columns, posed = (6 if turns else 3), Posed(machine, made)
    nominal, written = read(text, columns), read(result.data.decode(), columns)
    assert len(written) > len(nominal)
    far = []
    for before, after in pairwise(written[1:-1]):
        for share in (0.5, 1.0):
            tool = posed.actual(before + share * (after - before))
            far.append(nearest(posed, nominal, tool, turns=turns))
    worst = np.max(far, axis=0)
    assert worst[0] < 1.02e-3
    assert worst[1] < 2.1e-6
    uncorrected = posed.actual(nominal[2])[:3, 3] - posed.stated(nominal[2])[:3, 3]
    assert np.linalg.norm(uncorrected) > 0.02


def nearest(posed: Posed, nominal: list[np.ndarray], tool: np.ndarray, *, turns: bool) -> tuple[float, float]:
    """mm and rad of a pose from the nearest one of the program: straight moves, and half a circle behind."""
    begin, places = nominal[3], []
    for a, b in [*pairwise(nominal[:4]), (nominal[4], nominal[5])]:
        way = (b - a)[:3]
        places.append(a + np.clip((tool[:3, 3] - a[:3]) @ way / (way @ way), 0.0, 1.0) * (b - a))
    x, y = tool[:2, 3] - begin[:2] + (10.0, 0.0)
    angle, round_ = np.arctan2(y, x), begin.copy()
    round_[:2] += (10.0 * np.cos(angle) - 10.0, 10.0 * np.sin(angle))
    best = (np.inf, np.inf)
    for place in [*places, round_] if y < 1e-3 else places:
        there = posed.stated(place)
        off = float(np.linalg.norm(tool[:3, 3] - there[:3, 3]))
        turned = sum(np.cross(there[:3, k], tool[:3, k]) for k in range(3)) / 2.0
        best = min(best, (off, float(np.linalg.norm(turned)) if turns else 0.0))
    return best


@pytest.mark.parametrize("kind", KINDS)
def test_a_machine_without_errors_changes_nothing(kind: str, tmp_path: Path) -> None:
    machine, made = machine_of(tmp_path, kind, 3)
    text = program_of(kind, made)
    machine.write_text(machine.read_text().replace('calibration = "calibration.toml"\n', ""))
    result = olp.correct_joints(text.encode(), machine)
    assert result.data.decode().endswith(text)


@pytest.mark.parametrize(
    ("blocks", "why"),
    [
        ("G1 X1900. F100\n", "out of its travel 50 to 1500"),
        ("G1 B95. F100\n", "B turns the tool to within 1 deg of a right angle"),
        ("G81 X1. Z420 R425 F100\nG80\n", "--expand-cycles"),
        ("G92 X0\n", "stores the present position"),
    ],
)
def test_what_is_not_corrected_is_refused_with_its_line(blocks: str, why: str, tmp_path: Path) -> None:
    machine, made = machine_of(tmp_path, "hexapod", 3)
    start = f"G0 X0 Y0 Z{made.start[2] + 60:.3f} A0 B0 C0\n"
    with pytest.raises(ProgramError, match=re.escape(why)) as refused:
        olp.correct_joints((HEAD + start + blocks + "M30\n").encode(), machine)
    assert refused.value.line == 5


@pytest.mark.parametrize(
    ("words", "why"),
    [("X0 A1.", "moves A, which is no axis"), ("X900.", "within reach")],
)
def test_poses_of_a_delta_that_do_not_exist_are_refused(words: str, why: str, tmp_path: Path) -> None:
    machine, made = machine_of(tmp_path, "linear delta", 3)
    with pytest.raises(ProgramError, match=why) as refused:
        olp.correct_joints(f"{HEAD}G0 {words} Y0 Z{made.start[2] + 60:.3f}\nM30\n".encode(), machine)
    assert refused.value.line == 4


def test_points_measured_in_a_work_offset_are_compared(tmp_path: Path) -> None:
    machine, made = machine_of(tmp_path, "hexapod", 3)
    high = round(made.start[2] + made.tip[2])
    (tmp_path / "m.csv").write_text(f"# frame=G54\nx_mm,y_mm,z_mm\n5.0,2.5,{high + 0.02}\n10,5,{high}\n")
    program = tmp_path / "p.ngc"
    program.write_text(program_of("hexapod", made))
    out = tmp_path / "report.json"
    words = ["compare", program, tmp_path / "m.csv", "-m", machine, "--report", out]
    call = CliRunner().invoke(main, [str(word) for word in words])
    assert call.exit_code == 0, call.output
    assert json.loads(out.read_text())["after"]["across_um"]["max"] == pytest.approx(20.0, abs=0.01)


def test_a_leg_that_is_too_short_between_waypoints_is_found(tmp_path: Path) -> None:
    """The distance from a point is least inside of a straight line, so legs are beyond their travel there."""
    made = CliRunner().invoke(main, ["init", str(tmp_path), "--structure", "hexapod"])
    assert made.exit_code == 0
    machine, part = tmp_path / "machine.toml", tmp_path / "part.ngc"
    text = machine.read_text().replace("[700.0, 1100.0]", "[500.0, 1300.0]")
    text += '\n[work_offsets.G54]\nset_by = "true"\n'
    machine.write_text(text)
    part.write_text("G21 G90 G54 G94\nG0 X-400 Y0 Z540 A0 B0 C0\nG1 X-72 F900\nM30\n")
    legs = olp.simulate_joints(part, machine).axes
    dip = np.minimum(legs[0], legs[-1]) - legs.min(axis=0)
    leg = int(dip.argmax())
    assert dip[leg] > 1.0
    low = legs[:, leg].min() + 0.5 * dip[leg]
    tables = text.split("[axes.")
    tables[leg + 1] = tables[leg + 1].replace("travel_mm = [500.0", f"travel_mm = [{low:.3f}")
    machine.write_text("[axes.".join(tables))
    with pytest.raises(ProgramError, match=f"command of L{leg + 1} is .*, out of its travel") as refusal:
        olp.correct_joints(part, machine)
    assert (refusal.value.line, refusal.value.code) == (3, "OLP567")
    checked = CliRunner().invoke(main, ["check", str(part), "-m", str(machine), "--json"])
    assert [one["code"] for one in json.loads(checked.stdout)["findings"]] == ["OLP567"]
    # one that others corrected
    found = {one.code: one for one in olp.check_joints(part, machine, nominal=part.read_bytes()).findings}
    assert found["OLP402"].line == 3 and f"L{leg + 1} is commanded" in found["OLP402"].message
