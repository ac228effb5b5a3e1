"""Kinematics of controls from a calibration, judged by readers and forward kinematics of this file alone."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from cases.joint_machines import STRUCTURES, machine_file
from cli.test_cli import run

import olp
from olp.core.errors import ConfigError
from olp.files.kinematics.control_kinematics import Entered
from olp.files.kinematics.load import load_joint_setup
from olp.files.kinematics.tables import TABLES
from olp.kinematics.chain import Kinematics

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
TOOL = (3.0, -2.0, -120.0)
#: Where the axes of a machine lie wrong: the keys of [location] by axis.
WRONG = {
    "Y": {"C_urad": 35.0}, "Z": {"A_urad": -22.0, "B_urad": 41.0},
    "A": {"Y_um": 31.0, "Z_um": -17.0, "B_urad": 60.0, "C_urad": -45.0, "zero_urad": 70.0},
    "B": {"X_um": -23.0, "Z_um": 12.0, "A_urad": 38.0, "C_urad": 51.0, "zero_urad": -64.0},
    "C": {"X_um": 14.0, "Y_um": -29.0, "A_urad": -33.0, "B_urad": 26.0, "zero_urad": 55.0},
}  # fmt: skip


def about(axis: Sequence[float], angle: float) -> np.ndarray:
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def turn(axis: Sequence[float], point: Sequence[float], angle: float) -> np.ndarray:
    """Rotation about a line in space, as a matrix of four rows."""
    pose = np.eye(4)
    pose[:3, :3] = about(axis, angle)
    pose[:3, 3] = np.array(point) - pose[:3, :3] @ np.array(point)
    return pose


def slide(along: Sequence[float]) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = along
    return pose


def product(parts: Sequence[np.ndarray]) -> np.ndarray:
    pose = np.eye(4)
    for part in parts:
        pose = pose @ part
    return pose


def machine(chain: str, values: Mapping[str, float], wrong: Mapping[str, Mapping[str, float]]) -> np.ndarray:
    """The pose of the gauge of a machine whose axes lie as `wrong` says."""
    parts = []
    for name in chain.split():
        off = wrong.get(name, {})
        tilt = 1e-6 * np.array([off.get(f"{axis}_urad", 0.0) for axis in "ABC"])
        if name in "XYZ":
            along = np.eye(3)["XYZ".index(name)]
            parts.append(slide(values[name] * (along + np.cross(tilt, along))))
        elif name != "F":
            direction, point = STRUCTURES[chain][name]
            if tilt.any():
                direction = list(about(tilt, float(np.linalg.norm(tilt))) @ np.array(direction, float))
            shift = 1e-3 * np.array([off.get(f"{axis}_um", 0.0) for axis in "XYZ"])
            angle = math.radians(values[name]) + 1e-6 * off.get("zero_urad", 0.0)
            parts.append(turn(direction, np.array(point) + shift, angle))
    return product(parts)


def isg(text: str, values: Mapping[str, float]) -> np.ndarray:
    """A channel list of the universal kinematics, in units of 0.1 um."""
    rows = [line.split() for line in text.splitlines() if not line.startswith("#")]
    of = {key.removeprefix("trafo[0]."): float(value) for key, value in rows}
    names = text.splitlines()[0].split("axes ")[1].split()
    assert of["id"] == 91 and of["number_of_axes"] == len(names)
    parts = []
    for place in range(len(names)):
        k = int(of[f"chain[{place}]"])
        along = [of[f"axis[{k}].orientation[{i}]"] for i in range(3)]
        point = [1e-4 * of[f"axis[{k}].point[{i}]"] for i in range(3)]
        value = values[names[k]]
        if of[f"axis[{k}].type"] == 2:
            parts.append(turn(along, point, math.radians(value)))
        else:
            parts.append(slide(value * np.array(along) / np.linalg.norm(along)))
    end = slide([1e-4 * of[f"zero_position[{i}]"] for i in range(3)])
    assert [of[f"zero_orientation[{i}]"] for i in range(3)] == [0.0, 0.0, 1.0]
    return product([*parts, end])


def with_points(chain: str, points: Mapping[str, np.ndarray], values: Mapping[str, float]) -> np.ndarray:
    parts = [
        slide(values[name] * np.eye(3)["XYZ".index(name)]) if name in "XYZ"
        else turn(STRUCTURES[chain][name][0], points[name], math.radians(values[name]))
        for name in chain.split() if name != "F"
    ]  # fmt: skip
    return product(parts)


def fanuc(text: str, chain: str) -> dict[str, np.ndarray]:
    """The points of both rotary axes of FANUC parameters, by the rules of its manual."""
    assert text.startswith("%\n") and text.endswith("%\n")
    lines = text.split("\n")[1:-2]
    of = {int(line[1:6]): float(line[6:].lstrip("Q1")[1:]) for line in lines}
    assert all(line[6:9] in ("Q1M", "Q1P") for line in lines)
    before, after = chain.split("F")
    tables, heads = ([n for n in side.split() if n in "ABC"] for side in (before, after))
    assert of[19680] == {0: 2, 1: 21, 2: 12}[len(tables)]
    at = {
        first: np.array([of[first + k] for k in range(3)])
        for first in of
        if first in (19700, 19703, 19709, 19712)
    }
    if len(tables) == 2:
        return {tables[1]: at[19700], tables[0]: at[19700] + at[19703]}
    if len(tables) == 1:
        return {tables[0]: at[19700], heads[0]: at[19709]}
    return {heads[1]: at[19709], heads[0]: at[19709] + at[19712]}


def heidenhain(text: str, chain: str) -> dict[str, np.ndarray]:
    """The points of the rotary axes of a description table: the running position at their rows."""
    lines = text.splitlines()
    assert (
        lines[0].startswith("BEGIN")
        and lines[-1] == "[END]"
        and lines[1].split() == ["NR", "KEY", "AXIS", "COORD"]
    )
    at, points, order = np.zeros(3), {}, []
    for number, cells in enumerate(line.split() for line in lines[2:-1]):
        assert int(cells[0]) == number
        if cells[1] == "Trans":
            at = at + float(cells[3]) * np.eye(3)["XYZ".index(cells[2])]
        elif cells[1] in ("MachAxis", "MachBase"):
            order.append(cells[2] if cells[1] == "MachAxis" else "F")
            points[order[-1]] = at
    assert order == chain.split()[::-1]
    return points


def entered(folder: Path, chain: str, key: str) -> tuple[Entered, Kinematics]:
    keys = {name: WRONG[name] for name in chain.split() if name in WRONG}
    # about or along its own direction an axis has no such error
    keys = {name: {k: v for k, v in of.items() if not k.startswith(name)} for name, of in keys.items()}
    text = "".join(
        f"[location.{n}]\n" + "".join(f"{k} = {v}\n" for k, v in of.items()) for n, of in keys.items()
    )
    file = machine_file(folder, chain, errors=False, calibration=text)
    setup = load_joint_setup(file, None, by_itself=True)
    of = TABLES[key].enter(setup.kinematics.structure, setup.kinematics.errors)
    return of, setup.kinematics


CHAINS = ("C A Y F X Z", "C F X Y Z B", "F X Y Z C B", "C B F X Y Z")


@pytest.mark.parametrize("chain", CHAINS)
@pytest.mark.parametrize("key", ["isg-universal", "fanuc-5-axis", "heidenhain-kinematics", "mastering"])
def test_what_the_control_knows_and_what_is_left(key: str, chain: str, tmp_path: Path) -> None:
    done, kinematics = entered(tmp_path, chain, key)
    text, order = done.data.decode(), kinematics.structure.order
    rng = np.random.default_rng(7)
    values = np.where([name in "XYZ" for name in order], 300.0, 80.0) * rng.uniform(-1, 1, (40, len(order)))
    known = Kinematics(done.known, tool_mm=TOOL).nominal(values)
    actual = Kinematics(kinematics.structure, done.left, TOOL).actual(values)
    left = {name: dict(of) for name, of in WRONG.items()}
    if key == "mastering":
        assert text.splitlines()[0] == "axis,add,unit"
        for name, add, unit in (line.split(",") for line in text.splitlines()[1:]):
            assert unit == "deg"
            left[name]["zero_urad"] -= math.radians(float(add)) * 1e6
    points = {"fanuc-5-axis": fanuc, "heidenhain-kinematics": heidenhain}.get(key)
    tool = np.array([*TOOL, 1.0])
    largest = {"lines": 0.0, "nominal": 0.0}
    for row, at, real in zip(values, known.position, actual.position, strict=True):
        by = dict(zip(order, row.tolist(), strict=True))
        if key == "isg-universal":
            pose = isg(text, by)
        elif points is not None:
            pose = with_points(chain, points(text, chain), by)
        else:
            pose = machine(chain, by, {})
        np.testing.assert_allclose((pose @ tool)[:3], at, atol=2e-6)
        mine = machine(chain, by, left) @ tool
        np.testing.assert_allclose(mine[:3], real, atol=2e-6)
        lines = {n: {k: v for k, v in of.items() if k != "zero_urad"} for n, of in WRONG.items()}
        largest["lines"] = max(
            largest["lines"], float(np.abs(machine(chain, by, lines) @ tool - pose @ tool).max())
        )
        largest["nominal"] = max(
            largest["nominal"], float(np.abs(machine(chain, by, {}) @ tool - pose @ tool).max())
        )
    # with all lines, those of linear axes too, nothing but zeros is left
    assert (largest["lines"] < 5e-6) == (key == "isg-universal")
    assert (largest["nominal"] > 1e-2) == (key != "mastering")


def dh(rows: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Craig: Rx(alpha) Tx(a) Rz(theta) Tz(d) of each row."""
    pose = np.eye(4)
    for (a, alpha, d, theta), q in zip(rows[:, :4], values, strict=True):
        pose = pose @ turn([1, 0, 0], [0, 0, 0], math.radians(alpha)) @ slide([a, 0, 0])
        pose = pose @ turn([0, 0, 1], [0, 0, 0], math.radians(theta + q)) @ slide([0, 0, d])
    return pose


def frame(note: str) -> np.ndarray:
    """A frame as a note states it: X, Y, Z in mm, A, B, C in deg as Rz Ry Rx."""
    x, y, z, a, b, c = (float(part.split()[1]) for part in note.split(": ")[1].split(","))
    pose = slide([x, y, z])
    for axis, angle in (([0, 0, 1], c), ([0, 1, 0], b), ([1, 0, 0], a)):
        pose = pose @ turn(axis, [0, 0, 0], math.radians(angle))
    return pose


def test_an_arm_as_rows_of_denavit_and_hartenberg(tmp_path: Path) -> None:
    text = (PROGRAMS / "arm-payload" / "machine.toml").read_text("utf-8")
    whole = (PROGRAMS / "arm-payload" / "calibration.toml").read_text("utf-8")
    (tmp_path / "machine.toml").write_text(text, "utf-8")
    # only where its axes lie: no weight, no cyclic errors
    (tmp_path / "calibration.toml").write_text(whole.split("[[cyclic]]")[0], "utf-8")
    setup = load_joint_setup(tmp_path / "machine.toml", None, by_itself=True)
    done = TABLES["dh"].enter(setup.kinematics.structure, setup.kinematics.errors)
    rows = np.array([[float(cell) for cell in line.split(",")] for line in done.data.decode().split()[1:]])
    base, gauge = frame(done.notes[0]), frame(done.notes[1])
    assert "J3 are nearly parallel" in done.notes[2]
    stated = tomllib.loads(text)["axes"]
    assert [list(row[4:]) for row in rows] == [stated[f"J{k}"]["travel_deg"] for k in range(1, 7)]
    values = np.random.default_rng(3).uniform(-80.0, 80.0, (30, 6))
    actual = Kinematics(setup.kinematics.structure, setup.kinematics.errors, TOOL).actual(values)
    for row, at, turned in zip(values, actual.position, actual.rotation, strict=True):
        pose = base @ dh(rows, row) @ gauge
        np.testing.assert_allclose((pose @ [*TOOL, 1.0])[:3], at, atol=1e-4)
        np.testing.assert_allclose(pose[:3, :3], turned, atol=1e-7)
    # what is left has no zeros and no lines
    known = Kinematics(done.known, tool_mm=TOOL).nominal(values)
    rest = Kinematics(setup.kinematics.structure, done.left, TOOL).actual(values)
    np.testing.assert_allclose(rest.position, known.position, atol=1e-9)


@pytest.mark.slow
def test_all_tables_are_compared_and_say_what_they_leave(tmp_path: Path) -> None:
    """Play alone: no table holds it, and all leave it. A name of the machine need not be ASCII."""
    text = "[location.C]\nX_um = 20.0\n[backlash]\nC_urad = 30.0\n"
    file = machine_file(tmp_path, "C A Y F X Z", errors=False, calibration=text)
    for name in ("machine.toml", "calibration.toml"):
        stated = (tmp_path / name).read_text("utf-8").replace('"m"', '"Fräse"')
        (tmp_path / name).write_text(stated, "utf-8")
    report = olp.compare_tables(file)
    left, parts = report["box"]["left"], report["box"]["parts"]
    assert set(parts) == set(TABLES) - {"dh", "mastering"}
    refused = {key: form["findings"] for key, form in report["formats"].items() if form["findings"]}
    assert {key: [one["code"] for one in found] for key, found in refused.items()} == {
        "dh": ["OLP871"], "mastering": ["OLP871"],
    }  # fmt: skip
    # half of the play, either way
    for key, kinds in parts.items():
        assert list(kinds) == ["backlash"], key
        assert left[key]["max_um"] == pytest.approx(kinds["backlash"]["max_um"], abs=0.6)
        assert 0.0 < left[key]["rms_um"] < left["as it is"]["rms_um"]
    done = run("calibrate", "export", "-m", str(file), "--compare")
    assert done.exit_code == 0 and "isg-universal: backlash" in done.stdout
    assert "dh: rows of Denavit and Hartenberg cannot hold this machine" in done.stdout
    hexapod = PROGRAMS / "hexapod" / "machine.toml"
    with pytest.raises(ConfigError, match="holds a platform on legs"):
        olp.compare_tables(hexapod)


def test_machines_that_a_table_cannot_hold(tmp_path: Path) -> None:
    refused = {
        ("arm-payload", "isg-universal"): "its linear axes are not X, Y and Z",
        ("arm-payload", "heidenhain-kinematics"): "with one or two rotary axes",
        ("hexapod", "dh"): "has a platform on legs",
        ("trunnion-mill", "dh"): "expected an arm of two or more rotary axes",
    }
    for (name, key), why in refused.items():
        with pytest.raises(ConfigError, match=why):
            olp.export_table(PROGRAMS / name / "machine.toml", key, tmp_path / "t")
    done = machine_file(tmp_path, "A F X Y Z", errors=False, calibration="[location.A]\nY_um = 3.0\n")
    for key, why in (("fanuc-5-axis", "may be imaginary"), ("mastering", "no zero of an axis")):
        with pytest.raises(ConfigError, match=why):
            olp.export_table(done, key, tmp_path / "t")
