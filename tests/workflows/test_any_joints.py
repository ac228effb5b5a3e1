"""Lists of axis values on random machines of many structures, with all their sources of errors, judged by a
forward computation of their own."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from judge.any_joints import AnyJoints
from scipy.optimize import minimize_scalar

import olp

HEAD = 'schema = "olp-machine-1"\nname = "m"\ncontroller = "linuxcnc"\ncalibration = "calibration.toml"\n'
TAIL = "[job_defaults]\ntool = 1\n[tools.1]\ngauge_to_tip_mm = {tip}\n"
CALIBRATION = (
    'schema = "olp-calibration-1"\nmachine = "m"\nmeasured = 2026-11-01\ntemperature_degC = 20.0\n'
    'sign = "actual-minus-commanded"\nmodel = "rigid-body"\n'
)
#: By name: the chain, directions and points of its rotary axes, the gauge, and whether the tool turns fully.
SERIAL: dict[str, Any] = {
    "table-table": ("C A Y F X Z", {"A": ((-1, 0, 0), (0, 20, -180)), "C": ((0, 0, -1), (5, 0, -230))}, None),
    "nutating": ("F X Y Z C B", {"C": ((0, 0, 1), (3, 0, 250)), "B": ((0, 0.6, 0.8), (0, 9, 250))}, None),
    "six axes": (
        "C F X Y Z A B",
        {"C": ((0, 0, 1), (40, 9, 0)), "A": ((1, 0, 0), (0, 5, 250)), "B": ((0, 1, 0), (8, 0, 220))},
        None,
    ),
    # the wrist has no common point
    "arm": (
        "F J1 J2 J3 J4 J5 J6",
        {
            "J1": ((0, 0, -1), (0, 0, 400)),
            "J2": ((0, 1, 0), (25, 0, 400)),
            "J3": ((0, 1, 0), (480, 9, 400)),
            "J4": ((-1, 0, 0), (480, 3, 435)),
            "J5": ((0, 1, 0), (900, 0, 440)),
            "J6": ((-1, 0, 0), (980, 7, 435)),
        },
        (980, 0, 435),
    ),
}


def text_of(values: Any) -> str:
    return "[" + ", ".join(f"{float(value)!r}" for value in values) + "]"


def serial(folder: Path, name: str, rng: np.random.Generator) -> tuple[Path, np.ndarray]:
    """A machine of `SERIAL` with random errors, and waypoints."""
    chain, rotary, gauge = SERIAL[name]
    symmetry = "none" if gauge else "axis"
    text = HEAD + f'chain = "{chain}"\n[kinematics]\ntool_symmetry = "{symmetry}"\n'
    names = [axis for axis in ("X", "Y", "Z", *rotary) if axis in chain.split()]
    errors, box = "", []
    for axis in names:
        unit = "deg" if axis in rotary else "mm"
        text += f"[axes.{axis}]\ntravel_{unit} = [-700.0, 700.0]\nleast_increment_{unit} = 0.000001\n"
        box.append(f"{axis}_{unit} = [-700, 700]")
        if axis not in rotary:
            continue
        direction, point = rotary[axis]
        text += f'kind = "rotary"\ndirection = {text_of(direction)}\npoint_mm = {text_of(point)}\n'
        around = int(np.argmax(np.abs(direction)))
        errors += f"[location.{axis}]\nzero_urad = {rng.normal(0, 60):.3f}\n"
        for k in range(3):
            if k != around or abs(direction[around]) != 1:
                errors += (
                    f"{'XYZ'[k]}_um = {rng.normal(0, 25):.3f}\n{'ABC'[k]}_urad = {rng.normal(0, 50):.3f}\n"
                )
        errors += f'[[cyclic]]\ncomponent = "E{axis}{axis}"\nperiod_deg = 6.0\nphase_rad = 0.7\n'
        errors += f"amplitude_urad = {rng.uniform(5, 20):.3f}\n"
        if abs(direction[around]) == 1:
            errors += curve(folder, axis, around, own=direction[around] > 0, rng=rng)
        if gauge and axis in ("J2", "J3"):
            errors += f'[elasticity.{axis}]\nown_urad_Nm = 0.4\n[[masses]]\non = "{axis}"\nkg = 25.0\n'
            errors += f"centre_mm = {text_of(np.add(point, (90, 0, 20)))}\n"
    if gauge:
        text += f"[gauge]\npoint_mm = {text_of(gauge)}\nB_deg = 90.0\n"
    tip = (20.0, -30.0, 60.0) if gauge else (0.0, 0.0, -120.0)
    (folder / "machine.toml").write_text(text + TAIL.format(tip=text_of(tip)))
    (folder / "calibration.toml").write_text(CALIBRATION + f"box = {{ {', '.join(box)} }}\n" + errors)
    start = np.array(
        [rng.uniform(-60, 60) if n in "XYZ" else rng.choice([-1, 1]) * rng.uniform(20, 60) for n in names]
    )
    step = np.array([10.0 if n in "XYZ" else 4.0 for n in names])
    return folder / "machine.toml", start + np.cumsum(rng.uniform(-1, 1, (3, len(names))) * step, axis=0)


def curve(folder: Path, axis: str, around: int, *, own: bool, rng: np.random.Generator) -> str:
    """Error motions of a rotary axis."""
    value = np.linspace(-700.0, 700.0, 141)
    rows = rng.uniform(3, 12, 6) * np.sin(np.radians(value)[:, None] + rng.uniform(0, 6, 6))
    rows[:, 3 + around] *= own
    head = [f"E{letter}{axis}_um" for letter in "XYZ"]
    head += [f"E{axis if k == around else 'ABC'[k]}{axis}_urad" for k in range(3)]
    table, header = np.column_stack((value, rows)), ",".join([f"{axis}_deg", *head])
    np.savetxt(folder / f"{axis}.csv", table, "%.6f", ",", header=header, comments="")
    point = text_of(rng.uniform(-90, 90, 3))
    return f'[[curves]]\nfile = "{axis}.csv"\ninterpolation = "linear"\npoint_mm = {point}\n'


def legged(folder: Path, name: str, rng: np.random.Generator) -> tuple[Path, np.ndarray]:
    """A hexapod, or a linear delta with two rods a carriage, with random legs."""
    text, errors, box = HEAD + 'chain = "F P"\n[kinematics]\ntool_symmetry = "none"\n', "", []
    legs, hexapod = "", name == "hexapod"
    ends = []
    for k in range(6):
        third = np.radians(120 * (k // 2))
        if hexapod:
            angles = (
                third + np.radians((-15, 15))[k % 2],
                np.radians(120 * ((k + 1) // 2) - 60 + (15, -15)[k % 2]),
            )
            base, end = (
                r * np.array([np.cos(a), np.sin(a), 0.0]) for r, a in zip((400, 200), angles, strict=True)
            )
            hold = f'axis = "L{k + 1}"\nlength_mm = 0.0\n'
        else:
            out, beside = (
                np.array([np.cos(third), np.sin(third), 0.0]),
                np.array([-np.sin(third), np.cos(third), 0.0]),
            )
            base, end = out * 170 + beside * (25, -25)[k % 2], out * 40 + beside * (25, -25)[k % 2]
            hold = f'carriage = "T{k // 2 + 1}"\nlength_mm = 290.0\n'
        ends.append((base, end))
        legs += f"[[platforms.P.legs]]\nbase_mm = {text_of(base)}\nplatform_mm = {text_of(end)}\n{hold}"
        errors += f'[[legs]]\nplatform = "P"\nleg = {k + 1}\nbase_um = {text_of(rng.normal(0, 40, 3))}\n'
        errors += f"platform_um = {text_of(rng.normal(0, 30, 3))}\nlength_um = {rng.normal(0, 20):.3f}\n"
    names = [f"L{k + 1}" for k in range(6)] if hexapod else ["T1", "T2", "T3"]
    for axis in names:
        text += f"[axes.{axis}]\ntravel_mm = [100.0, 900.0]\nleast_increment_mm = 0.000001\n"
        text += 'kind = "length"\n' if hexapod else 'kind = "linear"\ndirection = [0.0, 0.0, 1.0]\n'
        box.append(f"{axis}_mm = [100, 900]")
        if not hexapod:
            errors += (
                f"[location.{axis}]\nzero_um = {rng.normal(0, 50):.3f}\nA_urad = {rng.normal(0, 80):.3f}\n"
            )
    start = (0.0, 0.0, 450.0 if hexapod else 250.0)
    text += f"[platforms.P]\nstart_mm = {text_of(start)}\n" + legs + TAIL.format(tip="[0.0, 0.0, 60.0]")
    (folder / "machine.toml").write_text(text)
    (folder / "calibration.toml").write_text(CALIBRATION + f"box = {{ {', '.join(box)} }}\n" + errors)
    rows = []
    for _ in range(3):
        place = np.array(start) + rng.uniform(-25, 25, 3)
        away = [end + place - base for base, end in ends]
        if hexapod:
            rows.append([np.linalg.norm(one) for one in away])
        else:
            rows.append([one[2] + np.sqrt(290.0**2 - one[0] ** 2 - one[1] ** 2) for one in away[::2]])
    return folder / "machine.toml", np.array(rows)


MACHINES = [*SERIAL, "hexapod", "delta"]


def made(folder: Path, name: str) -> tuple[Path, np.ndarray]:
    rng = np.random.default_rng(7)
    machine, rows = (serial if name in SERIAL else legged)(folder, name, rng)
    return machine, rows.round(4)


@pytest.mark.parametrize("name", MACHINES)
def test_the_pose_is_that_of_another_computation(name: str, tmp_path: Path) -> None:
    machine, rows = made(tmp_path, name)
    model, judge = olp.load_kinematics(machine), AnyJoints(machine)
    for values in rows:
        for actual in (False, True):
            found, wanted = (
                (model.actual if actual else model.nominal)(values[None]),
                judge.pose(values, actual),
            )
            assert np.abs(found.position[0] - wanted[:3, 3]).max() < 1e-8
            assert np.abs(found.rotation[0] - wanted[:3, :3]).max() < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("name", MACHINES)
def test_a_list_is_within_tolerance_between_its_rows_too(name: str, tmp_path: Path) -> None:
    machine, rows = made(tmp_path, name)
    judge = AnyJoints(machine)
    units = ["deg" if judge.axes[axis].get("kind") == "rotary" else "mm" for axis in judge.order]
    head = ",".join(f"{axis}_{unit}" for axis, unit in zip(judge.order, units, strict=True))
    text = "\n".join([head, *(",".join(f"{value:.4f}" for value in row) for row in rows)]) + "\n"
    result = olp.correct_joints(text.encode(), machine, tolerance_urad=2.0)
    assert result.report["verdict"]["ok"]
    lines = [line for line in result.data.decode().splitlines() if line[0] in "-0123456789"]
    written = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    first = judge.pose(written[0], True)[:3, 3] - judge.pose(rows[0], False)[:3, 3]
    # half a last digit of 1e-6 deg of each joint, at 1 m
    assert np.linalg.norm(first) < 1e-4
    # a delta does not turn
    angle_rad = 0.0 if name == "delta" else 2e-6
    for before, after in pairwise(written):
        for share in (0.5, 1.0):
            tip = judge.pose(before + share * (after - before), True)
            assert min(away(judge, a, b, tip, angle_rad) for a, b in pairwise(rows)) <= 1.05


def away(judge: AnyJoints, begin: np.ndarray, end: np.ndarray, tip: np.ndarray, angle_rad: float) -> float:
    """How many tolerances of 1 um and `angle_rad` a pose is from the nearest one of a nominal move."""

    def cost(share: float) -> float:
        nominal = judge.pose(begin + share * (end - begin), False)
        off = float(np.linalg.norm(tip[:3, 3] - nominal[:3, 3])) * 1e3
        if not angle_rad:
            return off
        full = judge.file["kinematics"]["tool_symmetry"] == "none"
        pairs = range(3) if full else (2,)
        turned = sum(np.cross(tip[:3, k], nominal[:3, k]) for k in pairs) / (2.0 if full else 1.0)
        return max(off, float(np.linalg.norm(turned)) / angle_rad)

    found = minimize_scalar(cost, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-9})
    return float(found.fun)
