"""Arcs of robot programs on arms and gantries: where they go at and between their points, by a judge of its
own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_of_a_campaign
from judge.arm import Arm, between, quaternion, turned_by
from judge.arm_files import MACHINE, ZEROS, arm_files
from judge.machines import Recipe, random_machine, zero_machine
from judge.model import JudgeModel
from judge.robot_arcs import READERS, Pose, Step, along
from judge.robot_moves import abc
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

import olp

#: The tool at the flange, and the frame.
LEVER, TOOL = np.array([10.0, -5.0, 160.0]), abc(0.0, 10.0, 0.0)
FRAME, ORIGIN = abc(30.0, 0.0, 0.0), np.array([705.0, -94.0, 507.0])
DIGITS = {"krl": 1e-5, "tp": 1e-3, "rapid": 1e-4, "ur": 1e-5, "jbi": 1e-3, "val3": 1e-5}
CONTROLLERS = {
    "krl": "kuka-krl", "tp": "fanuc-tp", "rapid": "abb-rapid", "ur": "urscript", "jbi": "yaskawa-inform",
    "val3": "staubli-val3",
}  # fmt: skip
GANTRY_FRAME = {"X_mm": 705.0, "Y_mm": -94.0, "Z_mm": 507.0, "C_deg": 30.0, "set_by": "true"}
NUMBERED = """
[tools.2]
gauge_to_tip_mm = [10.0, -5.0, 160.0]
gauge_to_tip_deg = [0.0, 10.0, 0.0]
[work_offsets.{frame}]
X_mm = 705.0
Y_mm = -94.0
Z_mm = 507.0
C_deg = 30.0
set_by = \"true\"
"""


def angles(turn: np.ndarray) -> list[float]:
    return Rotation.from_matrix(turn).as_euler("ZYX", degrees=True).round(6).tolist()


def krl(steps: list[Step]) -> bytes:
    head = ["DEF made()", "$TOOL={X 10,Y -5,Z 160,A 0,B 10,C 0}"]
    head.append("$BASE={X 705,Y -94,Z 507,A 30,B 0,C 0}")
    body, data = [], ["DEFDAT made"]
    for k, step in enumerate(steps):
        own = []
        for turn, place in step.poses:
            (x, y, z), (a, b, c) = place.round(4).tolist(), angles(turn)
            own.append(f"{{X {x},Y {y},Z {z},A {a},B {b},C {c},S 2,T 0}}")
        if k % 2:
            data.append(f"DECL E6POS XP{k}={own[-1]}")
            own[-1] = f"XP{k}"
        word = {"L": "LIN", "P": "PTP", "C": "CIRC"}[step.kind]
        body.append(f"  {word} {', '.join(own)}{' C_DIS' if k % 3 else ''}")
    return "\n".join([*head, *body, "END", *data, "ENDDAT", ""]).encode()


def tp(steps: list[Step]) -> bytes:
    lines, positions, number = ["/PROG  MADE", "/ATTR", f"LINE_COUNT = {len(steps)};", "/MN"], ["/POS"], 0
    for k, step in enumerate(steps):
        names = []
        for turn, place in step.poses:
            number += 1
            (x, y, z), (r, p, w) = place.round(4).tolist(), angles(turn)
            positions.append(
                f"P[{number}]{{\n   GP1:\n\tUF : 3, UT : 2,\t\tCONFIG : 'N U T, 0, 0, 0',\n"
                f"\tX = {x:9.4f}  mm,\tY = {y:9.4f}  mm,\tZ = {z:9.4f}  mm,\n"
                f"\tW = {w:9.6f} deg,\tP = {p:9.6f} deg,\tR = {r:9.6f} deg\n}};"
            )
            names.append(f"P[{number}]")
        targets = (" \n    :  " if k % 2 else " ").join(names)
        speed = "30%" if step.kind == "P" else "250mm/sec"
        lines.append(f"  {k + 1:2}:{step.kind.replace('P', 'J')} {targets} {speed} CNT60    ;")
    return "\n".join([*lines, *positions, "/END", ""]).encode()


def rapid(steps: list[Step]) -> bytes:
    turn = ",".join(f"{v:.12f}" for v in quaternion(TOOL))
    head = [
        "MODULE Made",
        f"PERS tooldata spindle:=[TRUE,[[10,-5,160],[{turn}]],[1,[0,0,1],[1,0,0,0],0,0,0]];",
        'PERS wobjdata part:=[FALSE,TRUE,"",[[705,-94,507],[0.965925826289,0,0,0.258819045103]],'
        "[[0,0,0],[1,0,0,0]]];",
    ]
    body = ["PROC main()"]
    for k, step in enumerate(steps):
        own = []
        for turn_, place in step.poses:
            value = quaternion(turn_).round(9).tolist()
            own.append(f"[{place.round(4).tolist()},{value},[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]")
        if k % 2:
            head.append(f"CONST robtarget p{k}:={own[-1]};")
            own[-1] = f"p{k}"
        word = {"L": "MoveL", "P": "MoveJ", "C": "MoveC"}[step.kind]
        body.append(f"  {word} {', '.join(own)},v100,z10,spindle\\WObj:=part;")
    return "\n".join([*head, *body, "ENDPROC", "ENDMODULE", ""]).encode()


def ur(steps: list[Step]) -> bytes:
    head = ["def made():", "  set_tcp(p[0.01,-0.005,0.16,0,0.174532925199,0])"]
    head.append("  frame=p[0.705,-0.094,0.507,0,0,0.523598775598]")
    body = []
    for k, step in enumerate(steps):
        own = []
        for turn, place in step.poses:
            vector = Rotation.from_matrix(turn).as_rotvec()
            own.append(f"p[{','.join(f'{v:.9f}' for v in [*place / 1000, *vector])}]")
        if k % 2:
            head.append(f"  t{k}={own[-1]}")
            own[-1] = f"t{k}"
        targets = ", ".join(f"pose_trans(frame, {target})" for target in own)
        words = "1.2, 0.25, 0.002" if step.kind == "C" and k % 3 else "a=1.2, v=0.25"
        body.append(f"  move{step.kind.replace('P', 'j').lower()}({targets}, {words})")
    return "\n".join([*head, *body, "end", ""]).encode()


def data(name: str, kind: str, values: list[str]) -> str:
    own = "".join(f'<Value key="{k}" {value}/>\n' for k, value in enumerate(values))
    head = f'<Data name="{name}" access="public" type="{kind}" size="{len(values)}">'
    return f"{head}\n{own}</Data>\n"


def val3(steps: list[Step]) -> bytes:
    points: dict[str, list[str]] = {"pEven": [], "pOdd": []}
    body = []
    for k, step in enumerate(steps):
        own, name = [], ("pEven", "pOdd")[k % 2]
        for turn, place in step.poses:
            numbers = [*place.round(4).tolist(), *Rotation.from_matrix(turn).as_euler("XYZ", degrees=True)]
            pairs = zip(("x", "y", "z", "rx", "ry", "rz"), numbers, strict=True)
            stated = " ".join(f'{key}="{number:.6f}"' for key, number in pairs)
            own.append(f"{name}[{len(points[name])}]")
            points[name].append(f'{stated} fatherId="fPart[0]" ')
        word = step.kind.replace("P", "j").lower()
        body.append(f"  move{word}({', '.join(own)}, tGrip, {('mStop', 'mPass')[k % 3 > 0]})")
    every = [
        data("mStop", "mdesc", ['tmax="100" blend="off" ']),
        data("mPass", "mdesc", ['tmax="100" blend="joint" leave="5" reach="5" ']),
        data("fPart", "frame", ['x="705" y="-94" z="507" rz="30" fatherId="world[0]" ']),
        data("tGrip", "tool", ['x="10" y="-5" z="160" ry="10" fatherId="flange[0]" ']),
        *(data(name, "pointRx", values) for name, values in points.items()),
    ]
    space = 'xmlns="http://www.staubli.com/robotics/VAL3/{}/2"'
    code = "\n".join(["<![CDATA[begin", *body, "end]]>"])
    return (
        f'<Programs {space.format("Program")}>\n<Program name="start">\n<Code>{code}</Code>\n</Program>\n'
        f"</Programs>\n<!--olp: file made.dtx-->\n<Database {space.format('Data')}>\n<Datas>\n"
        f"{''.join(every)}</Datas>\n</Database>\n"
    ).encode()


def jbi(steps: list[Step]) -> bytes:
    """Each arc as three moves to taught positions, behind a straight move to where it begins."""
    positions, moves, here = [], [], ""
    for k, step in enumerate(steps):
        for turn, place in step.poses:
            (x, y, z), (c, b, a) = place.round(3).tolist(), angles(turn)
            positions.append(f"C{len(positions):05d}={x:.3f},{y:.3f},{z:.3f},{a:.4f},{b:.4f},{c:.4f}")
        names = [own.split("=")[0] for own in positions[-len(step.poses) :]]
        if step.kind == "C":
            moves += [f"MOVL {here} V=100.0 PL=1"] if k % 2 else ["DOUT OT#(1) ON"]
            moves += [f"MOVC {name} V=100.0{' PL=2' if k % 3 else ''}" for name in (here, *names)]
            moves += [f"MOVL {names[-1]} V=100.0"]
        else:
            moves.append(f"MOVJ {names[0]} VJ=30.00" if step.kind == "P" else f"MOVL {names[0]} V=80.0")
        here = names[-1]
    head = ["/JOB", "//NAME MADE", "//POS", f"///NPOS {len(positions)},0,0,0,0,0"]
    head += ["///USER 3", "///TOOL 2", "///POSTYPE USER", "///RECTAN", *positions]
    return "\r\n".join([*head, "//INST", "///GROUP1 RB1", "NOP", *moves, "END", ""]).encode()


WRITERS: dict[str, Callable[[list[Step]], bytes]] = {
    "krl": krl,
    "tp": tp,
    "rapid": rapid,
    "ur": ur,
    "jbi": jbi,
    "val3": val3,
}
#: The numbers of frame and tool stand in the machine file.
NAMED_FRAMES = {"tp": "UFRAME3", "jbi": "UF3"}


def rotation_of(rng: np.random.Generator, size_rad: float) -> np.ndarray:
    vector = rng.normal(size=3)
    return Rotation.from_rotvec(size_rad * vector / np.linalg.norm(vector)).as_matrix()


#: Kinds of moves, with the radius of arcs, and their sweep in degrees.
SHAPES = (("C", 60, 150), ("C", 40, -100), ("L", 0, 0), ("C", 25, 300), ("C", 60, 90))


def steps_of(seed: int, begin: Pose, turned_rad: float) -> list[Step]:
    """A start, arcs in a leaning plane, one of them more than half a turn, and a straight move between. The
    tool turns by so much on each, evenly with its angle."""
    rng = np.random.default_rng(seed)
    (turn, here), lean = begin, rotation_of(rng, 0.5)
    steps = [Step("P", (begin,))]
    for kind, radius, sweep in SHAPES:
        goal = rotation_of(rng, turned_rad) @ turn if turned_rad else turn
        poses = [(goal, here + rng.uniform(-40, 40, 3))]
        if kind == "C":
            share, first = rng.uniform(0.35, 0.6), rng.uniform(0, 360)
            a, b, c = (radius * lean @ abc(first + part * sweep, 0, 0)[:, 0] for part in (0, share, 1))
            poses = [(between(turn, goal, share), here + b - a), (goal, here + c - a)]
        steps.append(Step(kind, tuple(poses)))
        turn, here = poses[-1]
    return steps


#: Where the machine is, and how its tool is turned, in the world, commanded a pose of the program.
Run = Callable[[Pose], Pose]


def nearest(begin: Pose, step: Step, tip: np.ndarray) -> Pose:
    """The pose in the world on a move where it is nearest to a tip."""

    def miss(share: float) -> float:
        return float(np.linalg.norm(world(along(begin, step, np.array([share]))[0])[1] - tip))

    best = min(np.linspace(0, 1, 21), key=miss)
    bounds = max(best - 0.06, 0.0), min(best + 0.06, 1.0)
    share = minimize_scalar(miss, bounds=bounds, method="bounded", options={"xatol": 1e-8}).x
    return world(along(begin, step, np.array([share]))[0])


def assert_led(nominal: list[Step], written: list[Step], run: Run, off: float, off_rad: float) -> None:
    """At the points of the written moves, and between them, the tip is on the nominal move, as far along as
    the tool is turned. Each nominal move ends with a written one."""
    place, begin, before = 0, nominal[0].poses[-1], None
    for want in nominal:
        goal, last = want.poses[-1], False
        while not last:
            move = written[place]
            last = np.linalg.norm(run(move.poses[-1])[1] - world(goal)[1]) < off
            if before is not None:
                for pose in along(before, move, np.linspace(0, 1, 7)):
                    turn, tip = run(pose)
                    near = nearest(begin, want, tip)
                    assert np.linalg.norm(near[1] - tip) < off
                    assert np.linalg.norm(turned_by(turn, near[0])) < off_rad
            before, place = move.poses[-1], place + 1
        begin = goal
    assert place == len(written)


def world(pose: Pose) -> Pose:
    return FRAME @ pose[0], ORIGIN + FRAME @ pose[1]


@pytest.mark.slow
@pytest.mark.parametrize("language", some_of_a_campaign(WRITERS, 6))
def test_arcs_of_an_arm_are_led_as_the_program_says(language: str, tmp_path: Path) -> None:
    machine = arm_files(tmp_path)
    first = np.array([0.0, 20.0, 30.0, 5.0, 50.0, 10.0])
    turn, flange = Arm(MACHINE).pose(first)
    begin = FRAME.T @ turn @ TOOL, FRAME.T @ (flange + turn @ LEVER - ORIGIN)
    text = WRITERS[language](steps_of(3, begin, 0.08))
    if language in NAMED_FRAMES:
        stated = machine.read_text("utf-8").replace("\n[job_defaults]\ntool = 1\n", "\n")
        stated += "\n[kinematics]\nthird_joint_level = true\n" if language == "tp" else ""
        machine.write_text(stated + NUMBERED.replace("{frame}", NAMED_FRAMES[language]), "utf-8")
    job = tmp_path / "job.toml"
    start = ", ".join(f"J{k + 1} = {value}" for k, value in enumerate(first.tolist()))
    job.write_text(f'schema = "olp-job-1"\nstart_deg = {{ {start} }}\n', "utf-8")
    result = olp.correct_joints(text, machine, job=job)
    assert result.report["deviation"]["holds"]
    assert olp.verify_joints(text, result.data, machine, job=job).report["verdict"]["ok"]
    arm, reader = Arm(machine, ZEROS), READERS[language]
    nominal, written = reader(text), reader(result.data)
    assert len(nominal) < len(written) < 10 * len(nominal), "few arcs, not many chords"

    def run(pose: Pose) -> Pose:
        own, tip = world(pose)
        held = own @ TOOL.T
        rotation, place = arm.actual(arm.joints(held, tip - held @ LEVER, first))
        return rotation @ TOOL, place + rotation @ LEVER

    assert_led(nominal, written, run, 1e-3 + DIGITS[language], 1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("language", WRITERS)
def test_arcs_of_a_gantry_are_led_as_the_program_says(language: str, tmp_path: Path) -> None:
    turn = abc(20.0, -15.0, 170.0)
    begin = FRAME.T @ turn, FRAME.T @ (np.array([30.0, 40.0, 20.0]) - ORIGIN)
    lever = turn @ TOOL.T @ LEVER
    recipe = Recipe(
        controller=CONTROLLERS[language], job_defaults={}, travel=((-900.0, 900.0),) * 3,
        tools={2: {"gauge_to_tip_mm": lever.tolist()}} if language in NAMED_FRAMES else {},
        work_offsets={NAMED_FRAMES[language]: GANTRY_FRAME} if language in NAMED_FRAMES else {},
    )  # fmt: skip
    folders = [tmp_path / "bent", tmp_path / "zero"]
    for folder in folders:
        folder.mkdir()
    machine, zero = random_machine(folders[0], 7, recipe), zero_machine(folders[1], recipe)
    text = WRITERS[language](steps_of(4, begin, 0.0))
    assert olp.correct(text, zero).data == text
    result = olp.correct(text, machine)
    assert result.report["verdict"]["ok"]
    assert olp.verify(text, result.data, machine).report["verdict"]["ok"]
    model, reader = JudgeModel(machine), READERS[language]
    nominal, written = reader(text), reader(result.data)
    assert len(written) < 10 * len(nominal), "few arcs, not many chords"

    def run(pose: Pose) -> Pose:
        own, tip = world(pose)
        return own, tip + model.error_mm(tip[None], lever)[0]

    assert_led(nominal, written, run, 1e-3 + DIGITS[language], 1e-6)
