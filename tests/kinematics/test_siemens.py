"""Machine files from the vectors of a Sinumerik control: the pose is what turning the vectors gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

import olp
from olp.cli import main
from olp.core.errors import InputError
from olp.files.kinematics.trafo import machine_of_trafo

#: By kind: pivots of both rotary axes from the vectors, and whether a table carries the axis.
PIVOTS = {
    "T": (lambda i2, i3: (i3 + i2, i3), (False, False)),
    "P": (lambda i2, i3: (i2, i2 + i3), (True, True)),
    "M": (lambda i2, i3: (i2, i3), (False, True)),
}


def swivel(kind: str, seed: int) -> tuple[str, dict[str, np.ndarray]]:
    """A text of swivel data with random vectors, closed, and the vectors."""
    random = np.random.default_rng(seed)
    of = {name: np.round(random.uniform(-300, 300, 3), 3) for name in ("I2", "I3")}
    of["V1"] = np.array(((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0))[seed % 3])
    of["V2"] = np.array(((0.0, 0.6, 0.8), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0))[seed % 3])
    closing = -(of["I2"] + of["I3"])
    of |= {"T": {"I1": closing}, "P": {"I4": closing}, "M": {"I1": -of["I2"], "I4": -of["I3"]}}[kind]
    first = {"I1": 1, "I2": 4, "V1": 7, "V2": 10, "I3": 15, "I4": 18}
    lines = [
        f"N{10 * (first[name] + k)} $TC_CARR{first[name] + k}[2] = {value!r} ; {name}"
        for name, vector in of.items()
        for k, value in enumerate(vector.tolist())
    ]
    lines += ["$TC_CARR21[2]=C", "$TC_CARR22[2]=A", f'$TC_CARR23[2]="{kind}"', "$TC_CARR32[2]=360"]
    return "\n".join(lines) + "\n", of


def transformation(kind: str, of: dict[str, np.ndarray]) -> str:
    """The same vectors as data of a transformation."""
    number, names = {
        "T": (24, {"I1": "PART_OFFSET", "I2": "JOINT_OFFSET", "I3": "BASE_TOOL"}),
        "P": (40, {"I2": "BASE_TOOL", "I3": "JOINT_OFFSET", "I4": "PART_OFFSET"}),
        "M": (56, {"I1": "JOINT_OFFSET", "I2": "BASE_TOOL", "I3": "JOINT_OFFSET_PART", "I4": "PART_OFFSET"}),
    }[kind]
    names |= {"V1": "AXIS1", "V2": "AXIS2"}
    lines = [f"N24100 $MC_TRAFO_TYPE_1={number}"]
    lines += [
        f"$MC_TRAFO5_{names[name]}_1[{k}]={value!r}"
        for name, vector in of.items()
        for k, value in enumerate(vector.tolist())
    ]
    return "\n".join(lines) + "\n"


def turned(vector: np.ndarray, degrees: float, point: np.ndarray) -> np.ndarray:
    """(4, 4) a turn about a vector at a point, by the right hand."""
    whole = np.eye(4)
    whole[:3, :3] = Rotation.from_rotvec(np.radians(degrees) * vector / np.linalg.norm(vector)).as_matrix()
    whole[:3, 3] = point - whole[:3, :3] @ point
    return whole


@pytest.mark.parametrize("kind", PIVOTS)
@pytest.mark.parametrize("seed", range(3))
def test_the_tool_is_where_the_vectors_lead_it(kind: str, seed: int, tmp_path: Path) -> None:
    text, of = swivel(kind, seed)
    pivots, tables = PIVOTS[kind]
    places = pivots(of["I2"], of["I3"])
    random = np.random.default_rng(9)
    for number, stated in enumerate((text, transformation(kind, of))):
        file, folder = tmp_path / f"{number}.txt", tmp_path / str(number)
        file.write_text(stated)
        done = CliRunner().invoke(main, ["init", str(folder), "--trafo", str(file)])
        assert done.exit_code == 0, done.output
        machine = olp.load_kinematics(folder / "machine.toml")
        names = [name for name in machine.structure.order if name not in "XYZ"]
        assert number or sorted(names) == ["A", "C"]
        linear, angles = random.uniform(-200, 200, 3), random.uniform(-100, 100, 2)
        # the axes in the order of the file: the first rotary axis first
        first = list(machine.structure.joints)
        row = {
            **dict(zip("XYZ", linear, strict=True)),
            **dict(zip([name for name in first if name not in "XYZ"], angles, strict=True)),
        }
        pose = machine.nominal(np.array([[row[name] for name in machine.structure.order]]))
        head = part = np.eye(4)
        for vector, place, angle, table in zip(("V1", "V2"), places, angles, tables, strict=True):
            turn = turned(of[vector], angle, place)
            head, part = (head, part @ turn) if table else (head @ turn, part)
        slide = np.eye(4)
        slide[:3, 3] = linear
        wanted = np.linalg.inv(part) @ slide @ head
        assert np.abs(pose.rotation[0] - wanted[:3, :3]).max() < 1e-11
        assert np.abs(pose.position[0] - wanted[:3, 3]).max() < 1e-9


def test_the_example_of_the_manual(tmp_path: Path) -> None:
    """A table that turns about Y by 45 degrees moves a point 15 mm above its axis by X10.607 and Z-4.393."""
    text = '$TC_CARR8[1]=1\n$TC_CARR23[1]="P"\n'
    (tmp_path / "t.txt").write_text(text)
    (tmp_path / "machine.toml").write_bytes(machine_of_trafo(tmp_path / "t.txt", "m").data)
    machine = olp.load_kinematics(tmp_path / "machine.toml")
    order = machine.structure.order
    there = {"X": 10.606601717798213, "Z": 10.606601717798213, "B": 45.0}
    pose = machine.nominal(np.array([[there.get(name, 0.0) for name in order]]))
    assert np.abs(pose.position[0] - (0.0, 0.0, 15.0)).max() < 1e-9


REFUSED = [
    ('$TC_CARR9[1]=1\n$TC_CARR23[1]="X"\n', "expected T, P or M"),
    ("$TC_CARR9[1]=1\n", "no .TC_CARR23"),
    ('$TC_CARR23[1]="T"\n', "V1 is 0"),
    ('$TC_CARR9[1]=1\n$TC_CARR6[1]=5\n$TC_CARR23[1]="P"\n', "I2 \\+ I3 \\+ I4 is 0, 0, 5"),
    ('$TC_CARR9[1]=1\n$TC_CARR24[1]=5\n$TC_CARR23[1]="P"\n', "TC_CARR24.1. adds"),
    ('$TC_CARR9[1]=1\n$TC_CARR12[1]=1\n$TC_CARR23[1]="P"\n', "both rotary axes would be C"),
    ('$TC_CARR9[1]=1\n$TC_CARR23[1]="P"\n$TC_CARR23[2]="P"\n', "2 sets"),
    ('$TC_CARR9[1]=1\n$TC_CARR9[1]=0\n$TC_CARR23[1]="P"\n', "state it once"),
    ('$TC_CARR9[1]=1\n$TC_CARR23[1]="P"\n$MC_TRAFO_TYPE_1=24\n', "keep one"),
    ('$TC_CARR9[1]=1\n$TC_CARR30[1]=5\n$TC_CARR32[1]=-5\n$TC_CARR23[1]="P"\n', "limits"),
    ("$MC_TRAFO_TYPE_1=24\n$MC_TRAFO5_AXIS1_1[2]=1\n$MC_TRAFO5_ROT_SIGN_IS_PLUS_1[0]=0\n", "changes what"),
    ("$MC_TRAFO_TYPE_1=24\n$MC_TRAFO5_AXIS1_1[2]=1\n$MC_TRAFO5_BASE_ORIENT_1[0]=1\n", "along Z"),
    ('$TC_CARR9[1]=R1\n$TC_CARR23[1]="P"\n', "expected a number"),
]


@pytest.mark.parametrize(("text", "message"), REFUSED)
def test_what_is_not_one_machine_is_refused(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "t.txt").write_text(text)
    with pytest.raises(InputError, match=message):
        machine_of_trafo(tmp_path / "t.txt", "m")
