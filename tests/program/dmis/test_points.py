"""Points of DMIS in polar coordinates and as increments, read and written, beside an independent reader."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import unstamped
from judge import machines
from judge.dmis import read_points
from judge.machines import Recipe
from judge.model import JudgeModel

import olp
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, read

TURN = np.radians(30.0)
PART = np.array([300.0, 220.0, -180.0])
FRAMES = {
    "MCS": {"set_by": "true"},
    "PART": {"X_mm": 300.0, "Y_mm": 220.0, "Z_mm": -180.0, "C_deg": 30.0, "set_by": "true"},
}
STYLUS = np.array([0.0, 0.0, -120.0])
RECIPE = Recipe(controller="dmis", increment_mm=0.0001, work_offsets=FRAMES, job_defaults={})
HEAD = (
    "DMISMN/'PART',05.2\nUNITS/{unit}\nS(S1)=SNSDEF/PROBE,FIXED,CART,0,0,{length},0,0,1,4.0\nSNSLCT/S(S1)\n"
    "RECALL/D(PART)\n"
)
BODY = (
    "GOTO/CART,10.0,20.0,30.0\nGOTO/POL,50.0000,{a},12.5\nWKPLAN/{plane}\nGOTO/POL,50.0000,{a},12.5\n"
    "GOTO/INCR,5.0,0,0.6,-0.8\nGOTO/INCR,2.5,1,0,0\nMEAS/CIRCLE,F(C),2\nPTMEAS/POL,-30.25,$\n {b},2.0,0,0,1\n"
    "PTMEAS/CART,30.25,1.0,2.0,0,0,1\nENDMES\nGOTO/POL,40.0,{b},20.0 $$ away\nGOTO/INCR,20.0,0,0,1\nENDFIL\n"
)
#: numbers in inches that stay on the machine
INCHES = {
    b"10.0,20.0,30.0": b"1,2,.3", b"50.0000": b"2.0", b"12.5": b".5", b"30.25": b"1.2", b"40.0,": b"0.9,",
    b"20.0": b".3", b"INCR,5.0": b"INCR,.5",
}  # fmt: skip


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.random_machine(tmp_path_factory.mktemp("bent"), 11, RECIPE)


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.zero_machine(tmp_path_factory.mktemp("zero"), RECIPE)


def whole(unit: str = "MM,ANGDEC", a: str = "30.0", b: str = "-100.5", plane: str = "YZPLAN") -> bytes:
    length = "-120.0" if unit.startswith("MM") else "-4.7244094488"
    return (HEAD.format(unit=unit, length=length) + BODY.format(a=a, b=b, plane=plane)).encode()


@pytest.mark.parametrize("plane", ["XYPLAN", "YZPLAN", "ZXPLAN"])
@pytest.mark.parametrize(
    ("unit", "a", "b"),
    [
        ("MM,ANGDEC", "30.0", "-100.5"), ("MM,ANGRAD", "0.5236", "-1.75"), ("INCH,ANGDEC", "30", "200"),
        ("MM,ANGDMS", "30:30:36", "-0:45"), ("MM,ANGDMS", "30.5", "10:0:0.5"),
    ],
)  # fmt: skip
def test_the_tip_goes_to_points_of_all_forms(
    unit: str, a: str, b: str, plane: str, bent: Path, zero: Path
) -> None:
    data = whole(unit, a, b, plane)
    if unit.startswith("INCH"):
        for old, new in INCHES.items():
            data = data.replace(old, new)
    assert olp.correct(data, zero).data == data
    turn = np.array([[np.cos(TURN), -np.sin(TURN), 0], [np.sin(TURN), np.cos(TURN), 0], [0, 0, 1]])
    nominal = read_points(data) @ turn.T + PART - STYLUS
    program = read(data, load_setup(zero), DIALECTS["dmis"]).toolpath
    ends = program.end_mm[~np.isnan(program.end_mm).any(axis=1)]
    assert ends == pytest.approx(nominal, abs=1e-6)
    result = olp.correct(data, bent)
    command = read_points(result.data) @ turn.T + PART - STYLUS
    model = JudgeModel(bent)
    off = command + model.error_mm(command, np.broadcast_to(STYLUS, command.shape)) - nominal
    assert np.abs(model.error_mm(nominal, np.broadcast_to(STYLUS, nominal.shape))).max() > 5e-3
    assert np.abs(off).max() < 1.5e-4
    assert olp.verify(data, result.data, bent).report["deviation"]["holds"]


def test_a_changed_point_becomes_cartesian_and_nothing_else_changes(tmp_path: Path) -> None:
    path = machines.shift_machine(tmp_path, recipe=RECIPE)
    written = unstamped(olp.correct(whole("MM,ANGDEC", "90.0", "0"), path).data)
    head, body = HEAD.format(unit="MM,ANGDEC", length="-120.0"), BODY.format(a="90.0", b="0", plane="YZPLAN")
    assert written.startswith(head.encode())
    for old, new in zip(body.split("\n"), written.decode()[len(head) :].split("\n"), strict=True):
        if "GOTO" not in old and "PTMEAS" not in old and not old.startswith(" "):
            assert new == old
    assert b"PTMEAS/CART," in written and b",$\n " in written and b" $$ away\n" in written
    assert b"POL" not in written and b"INCR" not in written


@pytest.mark.parametrize(
    "before",
    [
        "",
        "GOHOME\n",
        "IF/(A)\n",
        "MODE/MAN\nGOTO/1,2,3\nMODE/PROG\n",
        "MEAS/POINT,F(A),1\nPTMEAS/CART,1,2,3\n",
    ],
)
def test_increments_from_a_place_that_only_the_control_knows_stay(before: str, tmp_path: Path) -> None:
    """Those behind them too, up to the next point that is stated."""
    path = machines.shift_machine(tmp_path, recipe=RECIPE)
    stay, closing = "GOTO/INCR,5,0,0,1\nGOTO/INCR,3.0,1,0,0\n", "ENDIF\n" * before.startswith("IF")
    closing += "ENDMES\n" * before.startswith("MEAS")
    text = f"UNITS/MM\nRECALL/D(PART)\n{before}{stay}GOTO/10,20,30\nGOTO/INCR,5.0,0,0,1\n{closing}ENDFIL\n"
    data = text.encode()
    result = olp.correct(data, path)
    assert stay.encode() in unstamped(result.data)
    assert b"GOTO/10,20,30" not in result.data and b"INCR,5.0" not in result.data
    first = text[: text.index(stay)].count("\n") + 1
    (left,) = [finding for finding in result.findings if finding.code == "OLP102"]
    assert {first, first + 1} <= set(left.lines)
    ends = read(data, load_setup(path), DIALECTS["dmis"]).toolpath
    known = ends.end_mm[~np.isnan(ends.end_mm).any(axis=1)]
    assert np.diff(known[-2:], axis=0)[0] == pytest.approx([0, 0, 5])
    assert olp.verify(data, result.data, path).report["deviation"]["holds"]


def test_backlash_adds_no_touch(tmp_path: Path) -> None:
    """A step that takes it up would touch where nothing is."""
    path = machines.random_machine(tmp_path, 11, replace(RECIPE, backlash_um=dict.fromkeys("XYZ", 4.0)))
    data = (
        b"UNITS/MM,ANGDEC\nMODE/PROG\nRECALL/D(PART)\nGOTO/CART,90,90,50\nGOTO/CART,110,100,-5\n"
        b"MEAS/CIRCLE,F(C),2\nPTMEAS/POL,20,0,5,-1,0,0\nPTMEAS/CART,50,60,-3,-1,0,0\nENDMES\nENDFIL\n"
    )
    result = olp.correct(data, path)
    assert result.data.count(b"PTMEAS/CART,") == result.data.count(b"PTMEAS") == 2
    assert olp.verify(data, result.data, path).report["deviation"]["after"]["waypoints"]["max_um"] < 1.0


def test_points_that_are_no_round_numbers_are_kept_on_a_machine_without_errors(zero: Path) -> None:
    data = (
        b"UNITS/MM,ANGDEC\nRECALL/D(MCS)\nGOTO/10,20,-30\nGOTO/INCR,5.5,0,0,1\nGOTO/POL,22.36,63.43,-35.5\n"
    )
    assert olp.correct(data, zero).data == data


def test_an_increment_after_a_moved_point_is_written_although_its_own_place_needs_no_change(
    tmp_path: Path,
) -> None:
    path = machines.random_machine(tmp_path, 11, RECIPE)
    data = b"UNITS/MM,ANGDEC\nRECALL/D(PART)\n" + b"".join(
        b"GOTO/CART,%d,0,0\nGOTO/INCR,%d,-1,0,0\n" % (x, x) for x in range(5, 300, 7)
    )
    result = olp.correct(data, path)
    points = read_points(result.data)
    assert np.abs(points[1::2] - points[1]).max() < 1e-9
