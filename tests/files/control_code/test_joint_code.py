"""The C file of a machine with rotary axes holds the chain itself: its poses, and the command for each."""

from __future__ import annotations

import ctypes
import re
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.fast import left_to_a_campaign, some_of_a_campaign
from click.testing import CliRunner
from kinematics.cases import golden, random_values
from scipy.spatial.transform import Rotation

import olp
from olp.cli import main
from olp.core.errors import AlreadyCorrected, ConfigError, OlpError, ProgramError, UsageError
from olp.core.interpolation import Interpolant
from olp.files.control_code.compiled import self_test
from olp.files.control_code.joint_code import joint_code
from olp.files.control_code.registry import CODE, write_code
from olp.kinematics.chain import Kinematics
from olp.kinematics.correction import correct_poses
from olp.kinematics.errors import (
    Gravity,
    Harmonic,
    JointErrors,
    MachineErrors,
    Mass,
    MotionCurve,
    Payload,
    Yield,
)
from olp.kinematics.measures import mobility
from olp.kinematics.weight import turning_together

pytestmark = pytest.mark.slow

DIGEST = "0123456789abcdef" * 4
#: mm and rad; the C file and the model do the same sums
SAME_MM, SAME_RAD = 1e-9, 1e-11
CHAINS = ("xyzac_trunnion", "gantry_nutating", "polar_rppr", "scara", "arm_6r_kr6")
MANY = """
void errors(int n, const double *value, const double *side, const olp_state *state, double *error)
{
    for (int i = 0; i < n; i++) {
        olp_state now = *state;
        for (int k = 0; k < OLP_AXES; k++) now.play[k] = side[i * OLP_AXES + k];
        olp_error(value + i * OLP_AXES, &now, error + 6 * i);
    }
}
#ifdef OLP_POSES
void poses(int n, const double *near, const double *value, const olp_state *state, double *pose,
           double *again)
{
    for (int i = 0; i < n; i++) {
        olp_pose_of_axes(value + i * OLP_AXES, state, pose + 6 * i);
        for (int k = 0; k < OLP_AXES; k++) again[i * OLP_AXES + k] = near[i * OLP_AXES + k];
        if (!olp_axes_of_pose(pose + 6 * i, state, again + i * OLP_AXES)) again[i * OLP_AXES] = NAN;
    }
}
#endif
int follow(int n, const double *wanted, const olp_state *state, const olp_limits *limits, double *command)
{
    olp_follower at;
    int unsolved = 0;
    memset(&at, 0, sizeof at);
    at.share = limits->on;
    for (int i = 0; i < n; i++) {
        olp_follow(&at, limits, state, wanted + i * OLP_AXES, 1e-3, command + i * OLP_AXES);
        unsolved += at.unsolved;
    }
    return unsolved;
}
"""
#: without bounds, and with a dead band of nothing
FREE = (1e9, 1e9, 1e12, 1e12, 0.0, 0.0)


class Compiled:
    """The C file of a machine."""

    def __init__(self, machine: Kinematics, box: dict[str, tuple[float, float]], folder: Path) -> None:
        source = write_code(joint_code(machine, box, DIGEST), "c", folder / "m.c")[folder / "m.c"]
        (folder / "many.c").write_bytes(source + MANY.encode())
        strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC"]
        subprocess.run(
            ["gcc", *strict, "-o", str(folder / "many.so"), str(folder / "many.c"), "-lm"], check=True
        )
        self.library = ctypes.CDLL(str(folder / "many.so"))
        payload = machine.errors.payload
        axes = len(machine.structure.order)
        fields = [*machine.tool_mm, payload.kg, *payload.centre_mm, *([0.0] * axes)]
        self.state = (ctypes.c_double * len(fields))(*fields)

    def errors(self, values: np.ndarray, sides: np.ndarray) -> np.ndarray:
        error = np.empty((len(values), 6))
        self.library.errors(
            len(values), _doubles(values), _doubles(sides), ctypes.byref(self.state), _doubles(error)
        )
        return error

    def follow(self, wanted: np.ndarray, *, bounds: tuple[float, ...] = FREE, on: int = 1) -> np.ndarray:
        class Limits(ctypes.Structure):
            _fields_ = [*((f"f{k}", ctypes.c_double) for k in range(6)), ("on", ctypes.c_int)]

        command = np.empty(wanted.shape)
        limits = Limits(*bounds, on)
        unsolved = self.library.follow(
            len(wanted), _doubles(wanted), ctypes.byref(self.state), ctypes.byref(limits), _doubles(command)
        )
        assert not unsolved
        return command


def _doubles(values: np.ndarray) -> ctypes.c_void_p:
    assert values.flags.c_contiguous and values.dtype == np.float64
    return values.ctypes.data_as(ctypes.c_void_p)


def rich(machine: Kinematics, seed: int = 3) -> Kinematics:
    """The chain with every kind of error on every joint, masses and a payload."""
    random = np.random.default_rng(seed)

    def three(size: float) -> tuple[float, float, float]:
        x, y, z = random.uniform(-size, size, 3)
        return float(x), float(y), float(z)

    joints, yields = {}, {}
    for number, (name, joint) in enumerate(machine.structure.joints.items()):
        low, high = joint.travel
        turns = joint.kind == "rotary"
        knots = np.linspace(-180.0, 180.0, 9) if turns and number % 2 else np.linspace(low, high, 7)
        motions = random.uniform(-1.0, 1.0, (len(knots), 7)) * ([0.02] * 3 + [1e-4] * 4)
        if not turns:
            motions[:, 6] *= 100.0
        motions[-1] = motions[0]
        motions[:, number % 7] = 0.0
        kind = "pchip" if number % 2 else "linear"
        curve = MotionCurve(
            Interpolant.through(knots, motions, kind), three(200.0), follows=number == 1,
            periodic=bool(turns and number % 2),
        )  # fmt: skip
        waves = (Harmonic(6, 3.0, 2e-5 if turns else 2e-3, 0.4), Harmonic(number % 6, 7.0, 1e-5, 1.0))
        across = np.array(three(1e-4))
        across -= np.array(joint.direction) * (across @ np.array(joint.direction))
        joints[name] = JointErrors(
            joint.point_mm, (curve, replace(curve, point_mm=three(100.0))), waves, three(0.03),
            tuple(across.tolist()), 1e-4 if turns else 0.02, 5.0, 4e-5 if turns else 4e-3,
        )  # fmt: skip
        yields[name] = Yield(1e-7, three(1e-7), three(1e-6))
    order = machine.structure.order
    # beside stated masses a joint may only yield across itself
    sagging = [name for name in order if machine.structure.joints[name].kind == "rotary"]
    gravity = tuple(
        Gravity(name, turning_together(machine.structure, name), 3e-5, -2e-5) for name in sagging[::2]
    )
    yields |= {term.joint: replace(yields[term.joint], own=0.0) for term in gravity}
    masses = tuple(Mass(name, 20.0, three(150.0)) for name in (order[0], order[-1]))
    errors = MachineErrors(
        joints,
        three(0.02),
        three(1e-4),
        {},
        yields,
        masses,
        Payload(6.0, (30.0, -20.0, 50.0)),
        gravity,
    )
    return replace(machine, errors=errors, tool_mm=(12.0, -7.0, 140.0))


def case(name: str) -> tuple[Kinematics, dict[str, tuple[float, float]]]:
    setup = golden(name)[0]
    return rich(setup.kinematics), {n: j.travel for n, j in setup.machine.structure.joints.items()}


@pytest.mark.parametrize("name", left_to_a_campaign(CHAINS, ("scara",)))
def test_the_file_agrees_with_the_chain(name: str, tmp_path: Path) -> None:
    """On 20,000 postures in all, with every kind of error, and the vectors with other tools and payloads."""
    machine, box = case(name)
    values = np.ascontiguousarray(random_values(golden(name)[0], 4_000, seed=5))
    sides = np.random.default_rng(6).choice([-1.0, 0.0, 0.3, 1.0], values.shape)
    wanted = np.hstack(machine.deviation(values, sides))
    found = Compiled(machine, box, tmp_path).errors(values, sides)
    assert np.abs(wanted[:, :3]).max() > 0.05 and np.abs(wanted[:, 3:]).max() > 1e-4
    assert np.abs(found - wanted)[:, :3].max() <= SAME_MM
    assert np.abs(found - wanted)[:, 3:].max() <= SAME_RAD
    told = self_test(CODE["c"], write_code(joint_code(machine, box, DIGEST), "c", tmp_path / "v.c"))
    assert told.endswith(" 0 unsolved") and int(told.split()[0]) > 1000


def walk(machine: Kinematics, seed: int, steps: int) -> np.ndarray:
    """Postures of a smooth motion in the middle of the travels, in which every axis turns round."""
    random = np.random.default_rng(seed)
    ends = np.array([joint.travel for joint in machine.structure.joints.values()])
    middle, half = ends.mean(axis=1) + 0.1 * np.diff(ends)[:, 0], 0.02 * np.diff(ends)[:, 0]
    turns = random.uniform(1.0, 2.0, len(ends)) * 2.0 * np.pi
    share = np.linspace(0.0, 1.0, steps)[:, None]
    return np.ascontiguousarray(middle + half * np.sin(turns * share + random.uniform(0.0, 6.0, len(ends))))


@pytest.mark.parametrize("name", some_of_a_campaign(["xyzac_trunnion", "arm_6r_kr6"], 2))
def test_the_tool_follows_through_its_backlash(name: str, tmp_path: Path) -> None:
    """A motion with reversals: once every axis has moved, the machine of the model is where the nominal one
    would be; the side of each axis is found here from what the drives did, in another way."""
    machine, box = case(name)
    wanted = walk(machine, 4, 6000)
    command = Compiled(machine, box, tmp_path).follow(wanted)
    sides, known = played(machine, command)
    actual, target = machine.actual(command[known], sides[known]), machine.nominal(wanted[known])
    assert known.sum() > 2000
    miss = np.linalg.norm(actual.position - target.position, axis=1)
    # where an axis turns round within a cycle, by the way that it makes in it
    assert miss.max() <= 5e-5 and np.count_nonzero(miss > 1e-6) <= 10
    axis, aim = actual.rotation[:, :, 2], target.rotation[:, :, 2]
    assert np.linalg.norm(np.cross(axis, aim), axis=1).max() <= 1e-7
    blind = machine.actual(command[known], np.zeros_like(sides[known])).position - target.position
    assert np.linalg.norm(blind, axis=1).max() > 1e-3


def played(machine: Kinematics, command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, axes) sides of the backlash of axes as a hysteresis of the drives, and rows where all are known."""
    sides, seen = np.zeros(command.shape), np.ones(command.shape, bool)
    for column, (name, joint) in enumerate(machine.structure.joints.items()):
        size = machine.errors.joints[name].backlash
        size = np.degrees(size) if joint.unit == "deg" else size
        load, drive = command[0, column], command[:, column]
        first = np.abs(drive - drive[0]) > size
        seen[:, column] = np.maximum.accumulate(first)
        for row, place in enumerate(drive):
            load = min(max(load, place - 0.5 * size), place + 0.5 * size)
            sides[row, column] = (place - load) / (0.5 * size)
    return sides, seen.all(axis=1)


def test_near_a_singular_posture_nothing_jumps(tmp_path: Path) -> None:
    """The tool of a gantry with a wrist passes by its singular posture: the tip stays exact, no axis turns
    by more than 2 degrees, and from posture to posture the correction changes little."""
    setup = golden("gantry_wrist")[0]
    machine = setup.kinematics
    box = {n: j.travel for n, j in setup.machine.structure.joints.items()}
    order = machine.structure.order
    values = np.tile(random_values(setup, 1, seed=2), (4001, 1))
    values[:, order.index("B")] = np.linspace(-4.0, 4.0, len(values))
    values[:, order.index("C")] = 30.0
    command = Compiled(machine, box, tmp_path).follow(np.ascontiguousarray(values))
    away = machine.actual(command).position - machine.nominal(values).position
    assert np.linalg.norm(away, axis=1).max() <= 1e-6
    turn = command[:, order.index("C")] - 30.0
    assert 0.5 < np.abs(turn).max() <= 2.0
    far = mobility(machine, values).smallest > 0.05
    assert far.any() and np.abs(command - correct_poses(machine, values).values)[far].max() <= 1e-6


def test_a_pose_leads_to_the_joints_near_by(tmp_path: Path) -> None:
    """Programs of an arm state poses; the control goes on from where the joints are."""
    machine, box = case("arm_6r_kr6")
    values = random_values(golden("arm_6r_kr6")[0], 400, seed=5)
    values = np.ascontiguousarray(values[mobility(machine, values).smallest > 0.1])
    code = Compiled(machine, box, tmp_path)
    near = values + np.random.default_rng(1).uniform(-1.0, 1.0, values.shape)
    pose, again = np.empty((len(values), 6)), np.empty(values.shape)
    code.library.poses(
        len(values),
        _doubles(near),
        _doubles(values),
        ctypes.byref(code.state),
        _doubles(pose),
        _doubles(again),
    )
    assert len(values) > 100 and np.abs(again - values).max() < 1e-7
    nominal = machine.nominal(values)
    assert np.abs(pose[:, :3] - nominal.position).max() < 1e-9
    wanted = Rotation.from_euler("xyz", pose[:, 3:], degrees=True).as_matrix()
    assert np.abs(wanted - nominal.rotation).max() < 1e-11


def test_outside_of_the_box_the_face_holds(tmp_path: Path) -> None:
    machine, box = case("xyzac_trunnion")
    small = {name: (0.5 * low, 0.5 * high) for name, (low, high) in box.items()}
    code = Compiled(machine, small, tmp_path)
    values = np.ascontiguousarray(random_values(golden("xyzac_trunnion")[0], 200, seed=8))
    ends = np.array(list(small.values()))
    inside = np.ascontiguousarray(np.clip(values, ends[:, 0], ends[:, 1]))
    first, second = (
        np.vstack([code.follow(np.ascontiguousarray(row[None])) for row in rows]) - rows
        for rows in (values, inside)
    )
    assert (values != inside).any() and np.abs(first - second).max() <= 1e-9


def test_bounds_hold_in_every_cycle(tmp_path: Path) -> None:
    machine, box = case("xyzac_trunnion")
    wanted = walk(machine, 9, 3000)
    bounds = (0.02, 0.004, 3.0, 0.5, 0.0, 0.0)
    correction = Compiled(machine, box, tmp_path).follow(wanted, bounds=bounds) - wanted
    turning = np.array(machine.structure.units) == "deg"
    most, rate = np.where(turning, 0.004, 0.02), np.where(turning, 0.5, 3.0) * 1e-3
    assert (np.abs(correction).max(axis=0) <= most + 1e-12).all()
    assert (np.abs(np.diff(correction, axis=0)) <= rate + 1e-12).all()
    assert (np.abs(correction).max(axis=0) >= most - 1e-12).any()


#: What is offered for a machine with rotary axes.
EXPECTED = (
    "expected --format siemens-carr or siemens-trafo5 or heidenhain-kinematics or fanuc-5-axis or "
    "isg-universal or dh or mastering or c or linuxcnc-kins"
)


def test_what_is_no_chain_or_leaves_a_choice_is_refused(tmp_path: Path) -> None:
    for name, says in (("hexapod", "no platforms on legs"), ("arm_7r_on_track", "6 hold the tool")):
        setup = golden(name)[0]
        with pytest.raises(ConfigError, match=says):
            joint_code(
                setup.kinematics, {n: j.travel for n, j in setup.machine.structure.joints.items()}, "0"
            )
    platform = golden_folder("hexapod") / "machine.toml"
    with pytest.raises(ConfigError, match=f"{re.escape(str(platform))}: P: .* no platforms on legs"):
        olp.export_table(platform, "c", tmp_path / "m.c")
    folder = golden_folder("arm_6r_kr6")
    with pytest.raises(UsageError, match=EXPECTED):
        olp.export_table(folder / "machine.toml", "linuxcnc", tmp_path / "x.comp")
    with pytest.raises(UsageError, match="--program is for machines with three linear axes"):
        olp.export_table(folder / "machine.toml", "c", tmp_path / "m.c", program=b"G1 X1\n")
    assert not list(tmp_path.iterdir())


def golden_folder(name: str) -> Path:
    golden(name)
    from kinematics.cases import GOLDEN

    return GOLDEN / name


@pytest.fixture
def trunnion(tmp_path: Path) -> Path:
    """A copy of the trunnion, and a short program for it."""
    folder = tmp_path / "m"
    folder.mkdir()
    for file in golden_folder("xyzac_trunnion").iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    with (folder / "machine.toml").open("a") as machine:
        machine.write("[work_offsets.G54]\nX_mm = 0.0\nY_mm = 0.0\nZ_mm = 0.0\n")
    (folder / "p.nc").write_text("%\nG21 G90 G54\nT1 M6\nG0 X0 Y0 Z0 A0 C0\nG1 X20 A-10 C30 F500\nM30\n%\n")
    return folder


def test_the_command_writes_it_and_the_machine_file_says_so(trunnion: Path) -> None:
    """The way of a user: export, state the hash; then nothing is left to correct, and programs are told
    apart."""
    machine, program = str(trunnion / "machine.toml"), str(trunnion / "p.nc")
    call = ["calibrate", "export", "-m", machine, "--format", "c", "-o", str(trunnion / "model.c")]
    done = CliRunner().invoke(main, [*call, "--self-test"])
    assert done.exit_code == 0, done.output
    assert "max urad" in done.stdout and "self-test: " in done.stdout
    line = next(row for row in done.stdout.splitlines() if row.startswith("real_time = "))
    corrected = olp.correct_joints(program, machine).data
    text = (trunnion / "machine.toml").read_text()
    (trunnion / "machine.toml").write_text(text.replace("\n[", f"\n{line}\n[", 1))
    with pytest.raises(AlreadyCorrected, match="corrects in real time"):
        olp.correct_joints(corrected, machine)
    marked = olp.correct_joints(program, machine)
    assert marked.report["deviation"]["before"]["position_max_um"] < 1e-6
    assert b"olp-real-time" in marked.data and b"X20 A-10 C30" in marked.data
    assert olp.correct_joints(marked.data, machine).data == marked.data
    assert not olp.load_kinematics(machine).errors.joints
    (trunnion / "machine.toml").write_text(text)
    with pytest.raises(ProgramError, match="does not state that"):
        olp.correct_joints(marked.data, machine)
    (trunnion / "machine.toml").write_text(text.replace("\n[", '\nreal_time = "0123456789ab"\n[', 1))
    with pytest.raises(OlpError, match="expected the same"):
        olp.correct_joints(program, machine)
    again = CliRunner().invoke(main, [*call, "--force"])
    assert again.exit_code == 0 and line in again.stdout
