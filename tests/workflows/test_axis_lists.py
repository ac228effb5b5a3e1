"""Lists of axis values on machines of any joints: corrected, proved, refused, and judged by LinuxCNC."""

from __future__ import annotations

import json
import re
import shutil
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from cases.fast import some_fast
from click.testing import CliRunner
from judge.kinematics import forward
from kinematics.cases import GOLDEN, golden, need_golden, random_values

import olp
from olp.cli import main
from olp.core.arrays import Array

#: By golden machine: urad that no command corrects.
CASES = {"scara": 600.0, "polar_rppr": 600.0, "tripod": 1.0, "hexapod": 1.0, "xyzac_trunnion": 1.0}


def machine_of(folder: Path, name: str, digit: str = "0.0001") -> Path:
    """The files of a golden machine, with a last digit for its axes."""
    need_golden()
    for file in (GOLDEN / name).iterdir():
        shutil.copy(file, folder / file.name)
    path = folder / "machine.toml"
    path.write_text(re.sub(r"(least_increment_\w+) = .*", rf"\1 = {digit}", path.read_text()))
    return path


def postures(name: str, count: int = 5, share: float = 0.1) -> Array:
    values = random_values(golden(name)[0], count, 3)
    middle = values.mean(axis=0)
    return np.round(middle + share * (values - middle), 3)


def text_of(name: str, values: Array, *, mark: str = ",", head: str = "") -> bytes:
    structure = golden(name)[0].machine.structure
    names = [f"{axis}_{unit}" for axis, unit in zip(structure.order, structure.units, strict=True)]
    rows = [mark.join([*names, "speed"])]
    rows += [mark.join([*(f"{value:.3f}" for value in row), "100"]) for row in values.tolist()]
    return (head + "\n".join(rows) + "\n").encode()


def rows_of(text: bytes) -> Array:
    lines = [line for line in text.decode().splitlines() if not line.startswith("#")]
    return np.array([[float(cell) for cell in line.split(",")[:-1]] for line in lines[1:]])


@pytest.mark.parametrize("name", some_fast(list(CASES), 5))
def test_a_list_is_within_tolerance_at_and_between_its_rows(name: str, tmp_path: Path) -> None:
    machine, values = machine_of(tmp_path, name), postures(name)
    text, job = text_of(name, values), tmp_path / "job.toml"
    job = job if job.exists() else None
    result = olp.correct_joints(text, machine, job, tolerance_urad=2.0, outside_box="hold")
    assert result.report["verdict"]["ok"]
    assert result.report["orientation"]["uncorrectable_urad"] < CASES[name]
    kinematics = golden(name)[0].kinematics
    corrected, rounding = rows_of(result.data), result.report["deviation"]["allowed_um"] * 1e-3
    # the judge takes the nearest place on the nominal path
    share = np.linspace(0.0, 1.0, 4001)[:, None]
    for begin, end in pairwise(values):
        path = kinematics.nominal(begin + share * (end - begin)).position
        first = int(np.argmin(np.abs(corrected - begin).max(axis=1)))
        last = int(np.argmin(np.abs(corrected - end).max(axis=1)))
        for a, b in zip(corrected[first:last], corrected[first + 1 : last + 1], strict=True):
            actual = kinematics.actual(a + np.linspace(0.0, 1.0, 7)[:, None] * (b - a)).position
            away = np.linalg.norm(actual[:, None] - path[None], axis=2).min(axis=1)
            coarse = np.linalg.norm(np.diff(path, axis=0), axis=1).max()
            assert away.max() < rounding + coarse
    assert olp.verify_joints(text, result.data, machine, job, tolerance_urad=2.0).report["verdict"]["ok"]
    assert not olp.verify_joints(text, text, machine, job, tolerance_urad=2.0).report["verdict"]["ok"]


@pytest.mark.oracle
def test_linuxcnc_finds_the_corrected_arm_at_its_targets(tmp_path: Path) -> None:
    """The PUMA of genserkins with other Denavit-Hartenberg parameters than its control believes."""
    machine = machine_of(tmp_path, "linuxcnc_puma560", "0.000001")
    figures = json.loads((GOLDEN / "linuxcnc_puma560.json").read_text("utf-8"))
    values = postures("linuxcnc_puma560")
    text = text_of("linuxcnc_puma560", values, head="# joined=points\n")
    result = olp.correct_joints(text, machine, outside_box="hold")
    assert result.report["orientation"]["near_singular"] == 0
    places = []
    for key, joints in (("mdh", values), ("mdh_actual", rows_of(result.data))):
        zeros = np.degrees([row["theta0_rad"] for row in figures[key]])
        places.append(forward("genserkins", pins_of(figures[key]), joints + zeros))
    assert (
        np.abs(
            places[0][:, :3] - forward("genserkins", pins_of(figures["mdh_actual"]), values + zeros)[:, :3]
        ).max()
        > 0.1
    )
    assert np.abs(places[1][:, :3] - places[0][:, :3]).max() < 1e-4
    assert np.abs(places[1][:, 3:] - places[0][:, 3:]).max() < 1e-5


def pins_of(rows: list[dict[str, float]]) -> dict[str, float]:
    names = {"A": "a_mm", "ALPHA": "alpha_rad", "D": "d_mm"}
    return {f"{pin}-{joint}": row[name] for joint, row in enumerate(rows) for pin, name in names.items()}


def test_without_errors_no_byte_changes(tmp_path: Path) -> None:
    machine = machine_of(tmp_path, "scara")
    machine.write_text(machine.read_text().replace('calibration = "calibration.toml"\n', ""))
    text = text_of("scara", postures("scara"))
    assert olp.correct_joints(text, machine).data == text


def test_what_is_no_axis_value_stays(tmp_path: Path) -> None:
    machine = machine_of(tmp_path, "scara")
    lines = [
        b"# a list\r\n", b'name;J1_deg;J2_deg;J3_mm;J4_deg;note\r\n', b'P 1;10,5;20,0;100,0;+5,0;"a;b"\r\n',
        b"\r\n", b"P2;12,5;1,8e1;100,0;5,0;c",
    ]  # fmt: skip
    done = olp.correct_joints(b"".join(lines), machine, tolerance_um=1e4, tolerance_urad=1e4).data
    written = done.splitlines(keepends=True)
    assert written[0].startswith(b"# olp-corrected ")
    assert written[0].endswith(b"\r\n")
    assert written[1:3] == lines[:2]
    assert re.fullmatch(rb'P 1;10,\d{4};(19|20),\d{4};(99|100),\d{4};\+[45],\d{4};"a;b"\r\n', written[3])
    assert written[4] == b"\r\n"
    assert re.fullmatch(rb"P2;12,\d+;1,[78]\d+e1;(99|100),\d{4};[45],\d{4};c", written[5])


def test_numbers_keep_their_form(tmp_path: Path) -> None:
    machine = machine_of(tmp_path, "scara")
    text = b"J1_deg,J2_deg,J3_mm,J4_deg\n010.50,.5,100.25,+5\n12.5, 1.8E1 ,100,-0.0\n"
    done = olp.correct_joints(text, machine, tolerance_um=1e4, tolerance_urad=1e4).data
    first, second = done.splitlines()[2:]
    assert re.fullmatch(rb"0\d\d\.\d{4},-?\.\d{4},(99|100)\.\d{4},\+[45]\.\d{4}", first)
    assert re.fullmatch(rb"1\d\.\d{4}, 1\.[78]\d+E1 ,(99|100)\.\d{4},-?0\.\d{4}", second)


def test_all_rows_out_of_reach_are_told(tmp_path: Path) -> None:
    """A straight arm does not reach outward, where its error takes it inward."""
    machine = machine_of(tmp_path, "scara")
    rows = [b"12.5,18,100,5", b"41,0,100,5", b"12,17,100,5", b"40,0,100,5"]
    text = b"# joined=points\nJ1_deg,J2_deg,J3_mm,J4_deg\n" + b"\n".join(rows) + b"\n"
    with pytest.raises(olp.ProgramError, match="no axis values") as told:
        olp.correct_joints(text, machine, outside_box="hold")
    assert [told.value.line, *(other.line for other in told.value.others)] == [4, 6]


def test_points_and_times_get_no_rows(tmp_path: Path) -> None:
    machine = machine_of(tmp_path, "scara")
    plain = text_of("scara", postures("scara"))
    assert olp.correct_joints(plain, machine).report["written"]["inserted_blocks"] > 0
    for text in (b"# joined=points\n" + plain, plain.replace(b"speed", b"t_s")):
        report = olp.correct_joints(text, machine).report
        assert report["written"]["inserted_blocks"] == 0
        assert report["verdict"]["ok"]
        assert "between the rows" in report["does_not_prove"][-1]


REFUSED = [
    (b"J1_deg,J2_deg,J3_mm\n1,2,3\n", "missing or twice: J4_deg", 1),
    (b"J1_deg,J2_deg,J3_mm,J4_rad\n1,2,3,4\n", "missing or twice: J4_deg", 1),
    (b"J1_deg,J2_deg,J3_mm,J4_deg,B_deg\n1,2,3,4,5\n", "B_deg, and the machine has no such axis", 1),
    (b"J1_deg,J2_deg,J3_mm,J4_deg\n1,2,3,4\n1,x,3,4\n", 'column 2 is "x"', 3),
    (b"J1_deg,J2_deg,J3_mm,J4_deg\n1,2,3\n", "3 columns", 2),
    (b"J1_deg,J2_deg,J3_mm,J4_deg\n", "no rows", 1),
    (b"J1_deg,J2_deg,J3_mm,J4_deg,tool\n1,2,100,4,7\n", "tool 7 has no vector", 2),
    (b"# frame=G55\nJ1_deg,J2_deg,J3_mm,J4_deg\n1,2,3,4\n", "states the frame G55", None),
    (b"# joined=arcs\nJ1_deg,J2_deg,J3_mm,J4_deg\n1,2,3,4\n", "expected lines or points", 1),
    (b"G1 X10\n", "lists of axis values are read", None),
    (b"J1_deg,J2_deg,J3_mm,J4_deg\n0,20,100,0\n900,20,100,0\n", "out of its travel", 3),
]


@pytest.mark.parametrize(("text", "message", "line"), REFUSED)
def test_what_is_wrong_is_named_with_its_line(
    tmp_path: Path, text: bytes, message: str, line: int | None
) -> None:
    with pytest.raises(olp.ProgramError, match=message) as caught:
        olp.correct_joints(text, machine_of(tmp_path, "scara"), outside_box="hold")
    assert caught.value.line == line


def test_the_verbs_read_lists(tmp_path: Path) -> None:
    machine, part, out = machine_of(tmp_path, "scara"), tmp_path / "part.csv", tmp_path / "out.csv"
    part.write_bytes(text_of("scara", postures("scara")))

    def run(*words: str) -> tuple[int, str]:
        done = CliRunner().invoke(main, [*words, "-m", str(machine)])
        return done.exit_code, done.output

    assert run("correct", str(part), "-o", str(out))[0] == 0
    assert run("verify", str(part), str(out), "-q") == (0, "")
    assert run("check", str(part))[1].splitlines()[-1].startswith("Go: ")
    assert run("simulate", str(part))[1].splitlines()[1].startswith("X_mm,Y_mm,Z_mm,RX_urad")
    assert run("correct", str(out))[0] == 3
