"""Programs whose words state poses on serial machines with errors: SCARA, polar machines and arms. LinuxCNC's
own kinematics modules are the control, an independent forward computation is the machine."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.any_machines import Axis, Made, calibration_text, linear, machine_text, rotary
from judge import kinematics
from judge.whole_machine import WholeMachine, small

import olp
from olp.core.errors import ConfigError, ProgramError
from olp.workflows.flatten import UnrollOptions
from olp.workflows.joints.inspect import program_summary
from olp.workflows.joints.loaded import JointRun

HEAD = "G21 G90 G17 G54 G64 P0.01\nT1 M6\nG43 H1\n"
UP = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Case:
    """A machine: its module of LinuxCNC with pins, its axes in the order of joints and its chain, its gauge
    and tool, the posture, the letters of its turns, and a program of words."""

    module: str
    pins: Mapping[str, float]
    axes: Mapping[str, Axis]
    chain: Sequence[str]
    gauge: tuple[Any, float]
    tool: tuple[float, float, float]
    posture: Sequence[float]
    turns: str
    blocks: Sequence[str]


def scara(bent: float) -> Case:
    """An elbow that is bent to either side; the tool is beside the last axis."""
    axes = {"J1": rotary(UP, (0, 0, 0)), "J2": rotary(UP, (340.0, 0, 0))}
    axes |= {"J3": linear((0, 0, -1), 0.0, 400.0), "J4": rotary(UP, (590.0, 0, 0))}
    pins = {"D1": 490.0, "D2": 340.0, "D3": 0.0, "D4": 250.0, "D5": 120.0, "D6": 30.0}
    blocks = (
        "G0 X400. Y80. Z200. C190.", "G1 X380. Y150. F900", "X300. Y205. Z180. C225.", "G91 X-25. Y12. C5.",
        "G90 G2 X265. Y227. I-5. J5.", "G1 X120. Y310. C170.", "G0 Z260.",
    )  # fmt: skip
    return Case(
        "scarakins", pins, axes, ["F", *axes], ((590.0, 0, 490.0), 0.0), (30.0, 0.0, -120.0),
        (0.0, bent, 200.0, 0.0), "C", blocks,
    )  # fmt: skip


def polar(chain: str) -> Case:
    """A radius and a turn, of the tool or of the workpiece, which is the same to the tip."""
    axes = {"X": linear((1, 0, 0), -50.0, 500.0), "Z": linear(UP, -200.0, 200.0), "C": rotary(UP, (0, 0, 0))}
    blocks = (
        "G0 X150. Y-40. Z30.", "G1 X160. Y60. F900", "X-20. Y140. Z10.", "G91 X-25. Y12.",
        "G90 G2 X-55. Y152. I-5. J0.", "G1 X-120. Y30. Z25.", "G0 Z60.",
    )  # fmt: skip
    return Case(
        "rosekins", {}, axes, chain.split(), ((0.0, 0.0, 50.0), 0.0), (0.0, 0.0, -50.0), (200.0, 0.0, 90.0),
        "", blocks,
    )  # fmt: skip


#: Rows a, alpha, d of an arm (Craig), mm and deg; the last d includes the tool.
ROWS = ((0, 0, 0), (0, -90, 0), (300, 0, 70), (50, -90, 400), (0, 90, 0), (0, -90, 100))
PUMA = {"A2": 300.0, "A3": 50.0, "D3": 70.0, "D4": 400.0, "D6": 100.0}
SERIAL = {f"{name}-{k}": row[n] for n, name in enumerate(("A", "ALPHA", "D")) for k, row in enumerate(ROWS)}
SERIAL |= {f"ALPHA-{k}": float(np.radians(row[1])) for k, row in enumerate(ROWS)}


def arm(module: str, pins: Mapping[str, float], posture: Sequence[float]) -> Case:
    """Six axes; the tool hangs down, where A is half a turn."""
    pose, axes = np.eye(4), {}
    for number, (a, alpha, d) in enumerate(ROWS, 1):
        row = np.eye(4)
        row[:3, :3] = small("xyz", np.radians([alpha, 0.0, 0.0]))[0]
        row[0, 3] = a
        pose = pose @ row
        axes[f"J{number}"] = rotary(pose[:3, 2].round(12), pose[:3, 3], 360.0)
        pose = pose @ np.block([[np.eye(3), np.array([[0.0], [0.0], [d]])], [np.zeros(3), 1.0]])
    flange = tuple(pose[:3, 3] - 40.0 * pose[:3, 2])
    blocks = (
        "G0 X420. Y80. Z-150. A178. B-2. C10.", "G1 X400. Y150. A182. F900", "X340. Y205. Z-140. B4. C25.",
        "G91 X-25. Y12. C5.", "G90 G2 X305. Y217. I-5. J0.", "G1 X260. Y260. A170.", "G0 Z-100.",
    )  # fmt: skip
    return Case(
        module,
        pins,
        axes,
        ["F", *axes],
        (flange, "0.0\nA_deg = 180.0"),
        (0.0, 0.0, 40.0),
        posture,
        "ABC",
        blocks,
    )


CASES = {
    "scara to the left": scara(90.0),
    "scara to the right": scara(-90.0),
    "polar": polar("F C X Z"),
    "polar table": polar("C F Z X"),
    "arm": arm("pumakins", PUMA, (20.0, -60.0, 40.0, 20.0, 70.0, 0.0)),
    # its module searches, to about 1e-5 mm
    "arm by a search": arm("genserkins", SERIAL, (20.0, -60.0, 40.0, 20.0, 70.0, 0.0)),
}


def written(folder: Path, case: Case, seed: int, *, errors: bool = True, play: bool = False) -> Path:
    """The files of a machine with random errors of all sources."""
    made = Made(list(case.chain), dict(case.axes), "pose", {}, {}, case.gauge, case.tool)
    text = machine_text(made, "linuxcnc", 1e-6, UP)
    names = ", ".join(f"{n} = {v}" for n, v in zip(case.axes, case.posture, strict=True))
    keys = f'[kinematics]\nprogram_words = "pose"\nposture = {{ {names} }}\n'
    text = text.replace("[kinematics]\n", keys) + '[work_offsets.G54]\nset_by = "true"\n'
    if not errors:
        text = text.replace('calibration = "calibration.toml"\n', "")
    machine = folder / "machine.toml"
    machine.write_text(text)
    calibration = calibration_text(folder, made, np.random.default_rng(seed), play=play)
    (folder / "calibration.toml").write_text(calibration)
    return machine


def program_of(case: Case) -> str:
    return HEAD + "\n".join(case.blocks) + "\nM30\n"


def read(text: str, turns: str) -> list[tuple[str, np.ndarray]]:
    """The code of each move and the words behind it, by an own reader."""
    letters, counts, code, found = "XYZ" + turns, False, "", []
    place = np.full(len(letters), np.nan)
    for line in text.splitlines():
        words = re.findall(r"([A-Z])(-?[\d.]+)", re.sub(r"\(.*?\)|;.*", "", line))
        for letter, number in words:
            counts = {"G90": False, "G91": True}.get(letter + number, counts)
            code = letter + number if letter + number in ("G0", "G1", "G2") else code
        given = [(w, float(v)) for w, v in words if w in letters]
        if given and "G54" not in line and "G43" not in line:
            place = place.copy()
            for letter, number in given:
                column = letters.index(letter)
                place[column] = place[column] + number if counts else number
            found.append((code, place))
    return found


class Control:
    """The control and the machine."""

    def __init__(self, machine: Path, case: Case) -> None:
        self.judge, self.case = WholeMachine(machine), case

    def axes(self, words: np.ndarray) -> np.ndarray:
        """(n, axes) what the control leads the axes to."""
        poses = np.zeros((len(words), 6))
        poses[:, [*range(3), *("XYZABC".index(letter) for letter in self.case.turns)]] = words
        near, count = np.array(self.case.posture), len(self.case.axes)
        return kinematics.inverse(self.case.module, self.case.pins, poses, count, near)

    def stated(self, words: np.ndarray) -> np.ndarray:
        """(n, 4, 4) where the machine without errors has the tool."""
        return self.judge.pose(self.axes(words), False)

    def actual(self, words: np.ndarray) -> np.ndarray:
        """(n, 4, 4) where the machine with its errors has the tool."""
        return self.judge.pose(self.axes(words), True)


def wanted(moves: list[tuple[str, np.ndarray]]) -> np.ndarray:
    """(n, words) places along the feed moves of a program, close to each other; G2 is half a circle."""
    places, share = [], np.linspace(0.0, 1.0, 4001)[:, None]
    for (_, a), (code, b) in pairwise(moves):
        way = a + share * (b - a)
        if code == "G2":
            middle, radius = (a + b)[:2] / 2.0, (a - b)[:2] / 2.0
            angle = np.pi * share[:, 0]
            across = np.array((radius[1], -radius[0]))
            way[:, :2] = middle + np.cos(angle)[:, None] * radius + np.sin(angle)[:, None] * across
        if code != "G0":
            places.append(way)
    return np.concatenate(places)


def nearest(words: np.ndarray, control: Control, tool: np.ndarray) -> tuple[float, float]:
    """mm and rad of a pose (4, 4) from the path of a program `words`: at the place on it where the larger one
    of both, in um and in half urad, is least."""
    at = int(np.argmin(np.linalg.norm(words[:, :3] - tool[:3, 3], axis=1)))
    near = words[max(at - 1, 0) : at + 2]
    way = near[-1] - near[0]
    share = (tool[:3, 3] - near[0][:3]) @ way[:3] / (way[:3] @ way[:3])
    share = share + np.linspace(-1.2e-3, 1.2e-3, 25) / np.linalg.norm(way[:3])
    there = control.stated(near[0] + share[:, None] * way)
    off = np.linalg.norm(tool[:3, 3] - there[:, :3, 3], axis=1)
    turn = tool[:3, :3] @ np.swapaxes(there[:, :3, :3], 1, 2)
    turned = np.stack(
        (turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1])
    )
    angle = np.linalg.norm(turned[["ABC".index(letter) for letter in control.case.turns]], axis=0) / 2.0
    best = int(np.argmin(np.maximum(off / 1e-3, angle / 2e-6)))
    return float(off[best]), float(angle[best])


@pytest.mark.slow
@pytest.mark.oracle
@pytest.mark.parametrize(
    "kind",
    [
        "scara to the right",
        "arm",
        *(
            pytest.param(kind, marks=pytest.mark.campaign)
            for kind in ("scara to the left", "polar", "polar table", "arm by a search")
        ),
    ],
)
def test_the_tool_is_where_the_program_says(kind: str, tmp_path: Path) -> None:
    case = CASES[kind]
    machine, text = written(tmp_path, case, 5), program_of(case)
    result = olp.correct_joints(text.encode(), machine, tolerance_urad=2.0)
    assert result.report["verdict"]["ok"]
    control, words = Control(machine, case), wanted(read(text, case.turns))
    feeds = [(a[1], b[1]) for a, b in pairwise(read(result.data.decode(), case.turns)) if b[0] != "G0"]
    assert len(feeds) > 100
    commands = np.array([a + share * (b - a) for a, b in feeds for share in (0.5, 1.0)])
    far = [nearest(words, control, tool) for tool in control.actual(commands[::5])]
    worst = np.max(far, axis=0)
    assert worst[0] < 1.02e-3
    assert worst[1] < 2.1e-6
    off = control.actual(words[::2000])[:, :3, 3] - control.stated(words[::2000])[:, :3, 3]
    assert np.linalg.norm(off, axis=1).max() > 0.1


def driven(q: np.ndarray, width: np.ndarray) -> np.ndarray:
    """(n, axes) the sides of the play of axes that go along (n, axes), from the middle of it on."""
    load, sides = q[0].copy(), np.zeros(q.shape)
    for row, drive in enumerate(q):
        load = np.clip(load, drive - 0.5 * width, drive + 0.5 * width)
        sides[row] = 2.0 * (drive - load) / width
    return sides


@pytest.mark.slow
@pytest.mark.oracle
@pytest.mark.parametrize(
    "kind",
    ["scara to the left", *(pytest.param(k, marks=pytest.mark.campaign) for k in ("polar table", "arm"))],
)
def test_backlash_is_taken_up(kind: str, tmp_path: Path) -> None:
    case = CASES[kind]
    machine = written(tmp_path, case, 5, play=True)
    to_and_fro = [" ".join(f"{a}{way}" for a in "XYZ" + case.turns) for way in (3.0, -5.0)]
    blocks = [case.blocks[0], f"G91 {to_and_fro[0]}", to_and_fro[1], "G90", *case.blocks]
    text = HEAD + "\n".join(blocks) + "\nM30\n"
    result = olp.correct_joints(text.encode(), machine, tolerance_urad=2.0)
    assert result.report["verdict"]["ok"]
    control, words = Control(machine, case), wanted(read(text, case.turns))
    moves = list(pairwise(read(result.data.decode(), case.turns)))
    shares = np.arange(1, 21) / 20.0
    q = control.axes(np.array([a[1] + share * (b[1] - a[1]) for a, b in moves for share in shares]))
    play = control.judge.errors["backlash"]
    width = [
        np.degrees(1e-6) * play[f"{name}_urad"] if axis.kind == "rotary" else 1e-3 * play[f"{name}_um"]
        for name, axis in case.axes.items()
    ]
    feeds = np.flatnonzero(np.repeat([b[0] != "G0" for _, b in moves], len(shares)))[::53]
    tools = control.judge.pose(q[feeds], True, driven(q, np.array(width))[feeds])
    worst = np.max([nearest(words, control, tool) for tool in tools], axis=0)
    assert worst[0] < 1.02e-3
    assert worst[1] < 2.1e-6


def endless(folder: Path, keys: str = "endless = ['C']") -> tuple[Path, Case]:
    """A polar machine whose turn has no end; its errors repeat."""
    blocks = (
        "G0 X150. Y-40. Z30.", "G1 X140. F900", "G2 X140. I-140. J40.", "G2 X140. I-140. J40.", "G1 Z20.",
        "X-90. Y-70.", "X-80. Y60.",
    )  # fmt: skip
    case = replace(polar("C F Z X"), blocks=blocks)
    axes = {**case.axes, "C": rotary(UP, (0, 0, 0), 180.0)}
    machine = written(folder, replace(case, axes=axes), 5)
    text = machine.read_text().replace("[-180.000000000, 180.000000000]", "[-1e5, 1e5]")
    machine.write_text(text.replace("posture =", f"{keys}\nposture ="))
    errors = folder / "calibration.toml"
    errors.write_text(errors.read_text().replace('file = "C.csv"', 'file = "C.csv"\nperiodic = true'))
    return machine, case


@pytest.mark.slow
@pytest.mark.oracle
def test_an_endless_axis_goes_on_over_whole_turns(tmp_path: Path) -> None:
    machine, case = endless(tmp_path)
    text = program_of(case)
    result = olp.correct_joints(text.encode(), machine)
    assert result.report["verdict"]["ok"]
    simulated = olp.simulate_joints(text.encode(), machine)
    turn = simulated.axes[:, list(case.axes).index("C")]
    assert np.abs(np.diff(turn)).max() < 10.0
    assert np.ptp(turn) > 720.0
    limit(machine, case)
    way = np.linalg.norm(np.diff(simulated.points_mm, axis=0), axis=1).sum()
    retimed = olp.retime_joints(text.encode(), machine)
    assert retimed.duration_s == pytest.approx(way / 15.0, rel=0.05)
    assert retimed.report["waypoints"] < 1000
    control, path = Control(machine, case), simulated.points_mm
    assert np.linalg.norm(path - control.judge.pose(simulated.axes, True)[:, :3, 3], axis=1).max() < 1e-9
    # around twice the tool is on the circle, and on its lines elsewhere
    moves = [place for _, place in read(result.data.decode(), "")]
    places = np.array([a + share * (b - a) for a, b in pairwise(moves[1:]) for share in (0.5, 1.0)])
    tools = control.actual(places)[:, :3, 3]
    circle = np.hypot(np.hypot(*tools[:, :2].T) - np.hypot(140.0, 40.0), tools[:, 2] - 30.0)
    flat = [np.array(line) for line in (((140, -40, 30), (140, -40, 20)), ((140, -40, 20), (-90, -70, 20)))]
    flat += [np.array(((150, -40, 30), (140, -40, 30))), np.array(((-90, -70, 20), (-80, 60, 20)))]
    lines = [np.linalg.norm(np.cross(tools - a, b - a), axis=1) / np.linalg.norm(b - a) for a, b in flat]
    assert np.minimum(circle, np.min(lines, axis=0)).max() < 1.02e-3
    assert (circle < 1.02e-3).sum() > 200


@pytest.mark.parametrize(
    ("keys", "error", "why"),
    [
        ("", ProgramError, "C goes further than half a turn"),
        ("endless = ['X']", ConfigError, "names X; expected some of C"),
        ("endless = ['C']", ConfigError, "whose errors are others in the next turn"),
    ],
)
def test_an_axis_is_endless_where_that_is_stated_and_right(
    keys: str, error: type[Exception], why: str, tmp_path: Path
) -> None:
    machine, case = endless(tmp_path, keys)
    if error is ConfigError:
        errors = tmp_path / "calibration.toml"
        errors.write_text(errors.read_text().replace("\nperiodic = true", ""))
    with pytest.raises(error, match=re.escape(why)):
        olp.correct_joints(program_of(case).encode(), machine)


@pytest.mark.parametrize(
    "kind", ["polar", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("scara to the left", "arm"))]
)
def test_a_machine_without_errors_changes_nothing(kind: str, tmp_path: Path) -> None:
    machine = written(tmp_path, CASES[kind], 3, errors=False)
    text = HEAD + "\n".join(CASES[kind].blocks[:3]) + "\nM30\n"
    assert olp.correct_joints(text.encode(), machine).data.decode().endswith(text)


@pytest.mark.parametrize(
    ("kind", "blocks", "why"),
    [
        ("scara to the left", "G1 X900. F100", "within reach"),
        ("scara to the left", "G1 X-400. Y-80. F100", "out of reach in the branch of kinematics.posture"),
        ("scara to the left", "G1 X551.485 Y97.244 F100", "comes to a singular posture"),
        ("scara to the left", "G1 Z-100. F100", "of J3 is 470"),
        ("scara to the left", "G1 X400. A1. F100", "moves A, which is no axis"),
        ("polar", "G1 X-150. Y40. F100", "comes to a singular posture"),
        ("polar", "G1 X-150. Y42. F100", "comes to a singular posture"),
        ("polar", "G1 X-20. Y-150. F100", "C goes further than half a turn from its 90 deg"),
        ("polar", "G2 X150. Y-40. I-150. J40. F100", "C goes further than half a turn from its 90 deg"),
        ("polar", "G1 X600. F100", "of X is 601"),
        ("arm", "G1 B92. F100", "B turns the tool to within 1 deg of a right angle, or across one"),
        ("arm", "G1 A-178. F100", "goes further than half a turn from its 20 deg"),
        ("arm", "G1 X471.03 Y84.525 Z-133.573 A174.29 B-33. C12.163 F100", "comes to a singular posture"),
        ("arm", "G81 X400. Z-160. R-145. F100\nG80", "--expand-cycles"),
    ],
)
def test_what_is_not_corrected_is_refused_with_its_line(
    kind: str, blocks: str, why: str, tmp_path: Path
) -> None:
    machine = written(tmp_path, CASES[kind], 3, errors=False)
    text = HEAD + CASES[kind].blocks[0] + "\n" + blocks + "\nM30\n"
    with pytest.raises(ProgramError, match=re.escape(why)) as refused:
        olp.correct_joints(text.encode(), machine)
    assert refused.value.line == 5


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('program_words = "pose"\n', "", 'kinematics.posture is read with program_words = "pose"'),
        ("posture =", "#", "names nothing; expected the value of every axis"),
        ("J1 = 0.0, ", "", "names J2, J3, J4; expected the value of every axis"),
        ("J2 = 90.0", "J2 = 0.1", "kinematics.posture is singular"),
        ("F J1 J2", "F J2 J1", "kinematics.posture is singular"),
    ],
)
def test_machine_files_that_name_no_branch_are_refused(old: str, new: str, why: str, tmp_path: Path) -> None:
    machine = written(tmp_path, CASES["scara to the left"], 3, errors=False)
    text = machine.read_text()
    assert old in text
    machine.write_text(text.replace(old, new))
    with pytest.raises(ConfigError, match=re.escape(why)):
        olp.correct_joints(b"G0 X0\n", machine)


def elbow_left(words: np.ndarray) -> np.ndarray:
    """(n, 4) axis values of the first SCARA at words X, Y, Z, C, by the law of cosines."""
    turn = np.radians(words[:, 3])
    x, y = words[:, 0] - 30.0 * np.cos(turn), words[:, 1] - 30.0 * np.sin(turn)
    reach = np.hypot(x, y)
    second = np.arccos((reach**2 - 340.0**2 - 250.0**2) / (2.0 * 340.0 * 250.0))
    first = np.arctan2(y, x) - np.arccos((reach**2 + 340.0**2 - 250.0**2) / (2.0 * 340.0 * reach))
    return np.stack(
        (np.degrees(first), np.degrees(second), 370.0 - words[:, 2], np.degrees(turn - first - second)),
        axis=1,
    )


def test_lists_alone_are_read_where_no_words_are_poses(tmp_path: Path) -> None:
    machine = written(tmp_path, CASES["scara to the left"], 3, errors=False)
    lines = machine.read_text().splitlines(keepends=True)
    machine.write_text("".join(x for x in lines if not x.startswith(("program_words", "posture"))))
    with pytest.raises(ProgramError, match='or program_words = "pose" in'):
        olp.correct_joints(b"G0 X0\n", machine)


def limit(machine: Path, case: Case) -> None:
    """Velocity, acceleration and jerk of all axes."""
    limits = "velocity_{0}_s = 300.0\nacceleration_{0}_s2 = 2000.0\njerk_{0}_s3 = 30000.0\n"
    text = machine.read_text()
    for name, axis in case.axes.items():
        text = text.replace(f"[axes.{name}]\n", f"[axes.{name}]\n{limits.format(axis.unit)}")
    machine.write_text(text)


@pytest.mark.slow
def test_all_that_reads_a_program_takes_its_words_as_poses(tmp_path: Path) -> None:
    case = CASES["scara to the left"]
    machine = written(tmp_path, case, 3, errors=False)
    limit(machine, case)
    program = HEAD + "\n".join(case.blocks[:3]) + "\nM30\n"
    places = np.array([place for _, place in read(program, case.turns)])
    joints = elbow_left(places)
    simulated = olp.simulate_joints(program.encode(), machine, step_mm=1000.0)
    assert np.abs(simulated.axes[-1] - joints[-1]).max() < 1e-9
    assert np.abs(simulated.points_mm[-1] - places[-1, :3]).max() < 1e-9
    assert olp.check_joints(program.encode(), machine).report["verdict"]["ok"]
    summary = program_summary(JointRun.of(program.encode(), machine), UnrollOptions())
    for column, name in enumerate(case.axes):
        axis = summary["axes"][name]
        ends = [axis[f"{end}_{case.axes[name].unit}"] for end in ("from", "to")]
        assert ends == pytest.approx([joints[:, column].min(), joints[:, column].max()])
    circle = program.replace("M30", "G2 I-20.\nM30").encode()
    retimed = olp.retime_joints(program.encode(), machine)
    more_s = olp.retime_joints(circle, machine).duration_s - retimed.duration_s
    assert more_s == pytest.approx(40.0 * np.pi / 15.0, rel=0.02)
    (stretch,) = retimed.stretches
    time = np.linspace(0.0, stretch.trajectory.duration_s, 200)
    values = retimed.at(0, time)[0]
    assert np.abs(values[[0, -1]] - joints[[0, -1]]).max() < 1e-9
    tips = WholeMachine(machine).pose(values, False)[:, :3, 3]
    way = np.linspace(places[:-1], places[1:], 4001).reshape(-1, 4)[:, :3]
    away = [np.linalg.norm(way - tip, axis=1).min() for tip in tips]
    assert max(away) < 0.01 + 0.02
