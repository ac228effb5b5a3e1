"""Arms on a track that is a joint of the machine, with errors of its own: programs of robots state where it
is, and a judge of seven joints says where the tool is then."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from judge import inform
from judge.arm import Arm, OnTrack, quaternion
from judge.arm_files import MACHINE, ZEROS, arm_files
from workflows.test_robots_on_arms import (
    FRAMES,
    JOINTS,
    LEVER,
    TOOL,
    TP_FILES,
    Step,
    angles,
    judged,
    local,
    steps_of,
)

import olp
from olp.core.errors import ConfigError, ProgramError

DIRECTION = np.array([0.6, 0.8, 0.0])
#: The errors of the track: um of its zero, urad of its direction, um and urad in a meter of its way.
ERRORS = 250.0, (-40.0, 30.0, 120.0), (35.0, -50.0, 80.0, 60.0, -90.0, 70.0)
TRACK = """
[axes.E1]
kind = "linear"
direction = [0.6, 0.8, 0.0]
travel_mm = [-4000.0, 4000.0]
least_increment_mm = 0.001
"""


def files(folder: Path, more: str = "", *, errors: bool = True, place: str = "[axes.J4]") -> Path:
    """The arm of the shipped job on a track, whose axis stands in the file before `place`."""
    machine = arm_files(folder, ZEROS if errors else (0.0,) * 6)
    text = (
        machine.read_text("utf-8").replace('"F J1', '"F E1 J1').replace("\n[job_defaults]\ntool = 1\n", "\n")
    )
    machine.write_text(text.replace(place, TRACK + place) + more, "utf-8")
    calibration = machine.with_name("calibration.toml")
    own = calibration.read_text("utf-8").replace("J1_deg", "E1_mm = [-4000, 4000], J1_deg")
    if errors:
        zero, (a, b, c), motion = ERRORS
        own += f"[location.E1]\nzero_um = {zero}\nA_urad = {a}\nB_urad = {b}\nC_urad = {c}\n"
        own += '[[curves]]\nfile = "track.csv"\ninterpolation = "linear"\npoint_mm = [0, 0, 0]\n'
        names = [f"E{k}E1_{'um' if k in 'XYZ' else 'urad'}" for k in "XYZABC"]
        rows = [",".join(f"{v:.9f}" for v in [x, *(x * 1e-3 * np.array(motion))]) for x in (-4000.0, 4000.0)]
        machine.with_name("track.csv").write_text(
            "\n".join([",".join(["E1_mm", *names]), *rows, ""]), "utf-8"
        )
    calibration.write_text(own, "utf-8")
    return machine


#: A move, and where the track is.
Carried = tuple[str, np.ndarray, float]


def placed(joints: np.ndarray, along: float) -> list[float]:
    """Where the tip is in the frame, which stands."""
    place = np.array(local(joints, 9)[0]) + FRAMES.turn.T @ (along * DIRECTION)
    return place.round(4).tolist()


def krl(steps: list[Carried]) -> bytes:
    lines = ["DEF made()", "$TOOL={X 10,Y -5,Z 160,A 0,B 10,C 0}", "$BASE={X 705,Y -94,Z 507,A 30,B 0,C 0}"]
    for kind, joints, along in steps:
        body = ",".join(f"A{k + 1} {value}" for k, value in enumerate(joints.tolist()))
        if kind != "J":
            (x, y, z), (a, b, c) = placed(joints, along), angles(local(joints)[1])
            turn = sum(1 << k for k in range(6) if joints[k] < 0)
            body = f"X {x},Y {y},Z {z},A {a},B {b},C {c},S {2 + 4 * (joints[4] < 0)},T {turn}"
        lines.append(f"  {'LIN' if kind == 'L' else 'PTP'} {{{body},E1 {along}}}")
    return "\n".join([*lines, "END", ""]).encode()


def rapid(steps: list[Carried]) -> bytes:
    turn = ",".join(f"{v:.12f}" for v in quaternion(TOOL))
    lines = [
        "MODULE Made",
        f"PERS tooldata spindle:=[TRUE,[[10,-5,160],[{turn}]],[1,[0,0,1],[1,0,0,0],0,0,0]];",
        'PERS wobjdata part:=[FALSE,TRUE,"",[[705,-94,507],[0.965925826289,0,0,0.258819045103]],'
        "[[0,0,0],[1,0,0,0]]];",
        "PROC main()",
    ]
    for kind, joints, along in steps:
        target = f"{joints.tolist()}"
        if kind != "J":
            own = quaternion(local(joints)[1]).round(7).tolist()
            quarters = [int(np.floor(joints[j] / 90)) for j in (0, 3, 5)]
            target = f"{placed(joints, along)},{own},{[*quarters, int(joints[4] < 0)]}"
        word = {"L": "MoveL", "P": "MoveJ", "J": "MoveAbsJ"}[kind]
        lines.append(f"  {word} [{target},[{along},9E9,9E9,9E9,9E9,9E9]],v100,z10,spindle\\WObj:=part;")
    return "\n".join([*lines, "ENDPROC", "ENDMODULE", ""]).encode()


def tp(steps: list[Carried]) -> bytes:
    lines, positions = ["/PROG  MADE", "/ATTR", "/MN"], ["/POS"]
    for k, (kind, joints, along) in enumerate(steps, 1):
        speed = "250mm/sec" if kind == "L" else "30%"
        lines.append(f"  {k:2}:{'L' if kind == 'L' else 'J'} P[{k}] {speed} CNT60    ;")
        level = joints + np.array([0, 0, joints[1], 0, 0, 0])
        body = ",\n".join(f"\tJ{j}= {value:9.3f} deg" for j, value in enumerate(level.tolist(), 1))
        if kind != "J":
            (x, y, z), (r, p, w) = placed(joints, along), angles(local(joints)[1])
            turns = ", ".join(f"{round(joints[j] / 360)}" for j in (0, 3, 5))
            body = f"\tCONFIG : '{'N' if joints[4] > 0 else 'F'} U T, {turns}',\n"
            body += f"\tX = {x:9.4f}  mm,\tY = {y:9.4f}  mm,\tZ = {z:9.4f}  mm,\n"
            body += f"\tW = {w:9.5f} deg,\tP = {p:9.5f} deg,\tR = {r:9.5f} deg"
        head = f"P[{k}]{{\n   GP1:\n\tUF : 3, UT : 2,"
        positions.append(f"{head}{body},\n\tE1= {along:9.3f}  mm\n}};")
    return "\n".join([*lines, *positions, "/END", ""]).encode()


WRITERS = {"krl": krl, "rapid": rapid, "tp": tp}
#: What is before the table of the track in the machine file, so that its column is another one, and what else
#: the file states.
PLACES = {"krl": "[axes.J1]", "rapid": "[axes.J4]", "tp": "[gauge]"}
MORE = {"krl": "", "rapid": "", "tp": TP_FILES}


def carried(seed: int, places: list[float]) -> list[Carried]:
    kinds = "JLLPLPLJLL"[: len(places)]
    return [(*step, along) for step, along in zip(steps_of(seed, kinds), places, strict=True)]


@pytest.mark.slow
@pytest.mark.parametrize("language", WRITERS)
def test_errors_of_the_track_count_where_it_is(language: str, tmp_path: Path) -> None:
    """Also along moves during which it goes. It keeps its words, and a model without errors keeps all."""
    machine = files(tmp_path, MORE[language], place=PLACES[language])
    steps = carried(3, [1500.0, 1500.0, 1000.0, -2200.5, -2200.5, 900.0, 800.0, 0.0])
    text = WRITERS[language](steps)
    result = olp.correct_joints(text, machine)
    assert result.report["deviation"]["holds"]
    assert olp.verify_joints(text, result.data, machine).report["verdict"]["ok"]
    arm = OnTrack(machine, ZEROS, *ERRORS)
    plain: list[Step] = [(kind, joints) for kind, joints, _ in steps]
    judged(arm, language, text, result.data, plain)
    still = files(tmp_path, MORE[language], errors=False, place=PLACES[language])
    assert olp.correct_joints(text, still).data == text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("language", "old", "new", "says"),
    [
        ("krl", ",E1 1500.0", "", "take the track out of the chain"),
        ("krl", "LIN", "PTP", ""),
        ("krl", "E1 1500.0", "E1 4500.0", r"command of E1 is 4500 mm, out of its travel -4000 to 4000"),
        ("rapid", "[1500.0,", "[9E9,", "does not state its first external axis"),
        ("tp", "1500.000  mm", "15.000 deg", "states E1 in deg, and E1 is the track of the arm"),
    ],
)
def test_a_program_that_does_not_state_the_track_is_refused(
    language: str, old: str, new: str, says: str, tmp_path: Path
) -> None:
    """Of joint values, too: the errors of the track count there."""
    machine = files(tmp_path, MORE[language])
    text = WRITERS[language](carried(3, [1500.0, 1500.0])).replace(old.encode(), new.encode(), 1)
    if not says:
        assert olp.correct_joints(text, machine).report["verdict"]["ok"]
        return
    with pytest.raises(ProgramError, match=says) as caught:
        olp.correct_joints(text, machine)
    assert caught.value.line is not None


@pytest.mark.slow
def test_inform_states_the_track_in_mm_or_is_refused(tmp_path: Path) -> None:
    """A base axis in base coordinates is the track. Positions of the arm do not say where that is without it,
    and pulses of it are none of a length."""
    machine = files(tmp_path, TP_FILES.replace("third_joint_level = true\n", "").replace("UFRAME3", "UF3"))
    own = machine.read_text("utf-8").replace('kind = "rotary"\n', 'kind = "rotary"\npulses_per_deg = 1e5\n')
    machine.write_text(own, "utf-8")
    rotation, place = Arm(MACHINE).pose(JOINTS)
    pulses = ",".join(f"{v * 1e5:.0f}" for v in JOINTS)
    x, y, z = place + rotation @ LEVER + 1500.0 * DIRECTION
    c, b, a = angles(rotation @ TOOL)
    taught = {
        "BASE": f"///RECTAN\r\n///RCONF 0,0,0,0,0,0,7,0\r\nC00000={x:.3f},{y:.3f},{z:.3f},{a},{b},{c}",
        "ROBOT": f"///RECTAN\r\n///RCONF 0,0,0,0,0,0,7,0\r\nC00000={x:.3f},{y:.3f},{z:.3f},{a},{b},{c}",
        "PULSE": f"///PULSE\r\nC00000={pulses}",
    }
    along = {"mm": "///POSTYPE BASE\r\n///RECTAN\r\nBC00000=1500.000", "pulses": "///PULSE\r\nBC00000=90000"}

    def job(kind: str, base: str) -> bytes:
        lines = ["/JOB", "//NAME T", "//POS", "///NPOS 1,1,0,0,0,0", "///TOOL 2", f"///POSTYPE {kind}"]
        lines += [taught[kind], *([along[base]] if base else []), "//INST", "NOP"]
        return "\r\n".join([*lines, f"MOVJ C00000 {'BC00000 ' if base else ''}VJ=5.00", "END", ""]).encode()

    arm = OnTrack(machine, ZEROS, *ERRORS)
    arm.carry(1500.0)
    moves = [inform.moves(olp.correct_joints(job(kind, "mm"), machine).data)[0] for kind in ("BASE", "PULSE")]
    for one in moves:
        joints = one.numbers / 1e5
        if not one.in_pulses:
            turn = one.turn @ TOOL.T
            joints = arm.joints(turn, one.numbers[:3] - turn @ LEVER, JOINTS)
        turn, here = arm.actual(joints)
        assert np.abs(here + turn @ LEVER - (x, y, z)).max() < 2e-3
    for kind, base, says in (
        ("ROBOT", "", "does not state its first external axis"),
        ("PULSE", "", "does not state its first external axis"),
        ("PULSE", "pulses", "the base axis of this move is in pulses"),
    ):
        with pytest.raises(ProgramError, match=says):
            olp.correct_joints(job(kind, base), machine)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "says"),
    [
        ("[kinematics]\ntrack = [1.0, 0.0, 0.0]\n", "kinematics.track is stated, and E1 of the chain is"),
        ("[kinematics]\nexternal = { 1 = 90.0 }\n", "kinematics.external.1 is stated, and E1 of the chain"),
        ("", "keeps where its track is as written"),
    ],
)
def test_a_track_is_stated_once_and_has_no_backlash(more: str, says: str, tmp_path: Path) -> None:
    machine = files(tmp_path, more)
    calibration = machine.with_name("calibration.toml")
    calibration.write_text(calibration.read_text("utf-8") + "[backlash]\nE1_um = 30.0\n", "utf-8")
    with pytest.raises(ConfigError, match=says):
        olp.correct_joints(krl(carried(3, [1500.0, 1500.0])), machine)
