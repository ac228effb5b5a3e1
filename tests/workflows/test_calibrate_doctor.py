"""The doctor of calibrations: decided is right, undecided is said; files, findings and the command."""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from cases.doctor import AXES, Done, judged, trial, true_calibration
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st
from judge import simulated

from olp.calibration.diagnosis.arrangements import arrangements, scaled
from olp.calibration.diagnosis.deciding import advise
from olp.calibration.diagnosis.doctor import diagnose
from olp.calibration.observations.points import Points
from olp.cli import main
from olp.core.errors import ConfigError
from olp.core.machine import COMPONENTS, SQUARENESS
from olp.errormodel.build import build
from olp.errormodel.uncertainty import fingerprint
from olp.files.calibration.covariance import load_uncertainty
from olp.files.calibration.reader import load_calibration
from olp.files.calibration.writer import calibration_files
from olp.files.measurements.checkpoints import load_checkpoints

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
NAMES = (*COMPONENTS, *SQUARENESS)


def case(seed: int, chain: str = "FXYZ", n: int = 60, sigma: float = 0.002):
    machine = simulated.machine(seed, "smooth", chain)
    machine.half = {}
    axis_mm, tool, place = simulated.points(machine, seed, n, sigma)
    return true_calibration(machine, seed, 0.0), Points(axis_mm, tool, place, sigma)


@pytest.mark.parametrize("seed", (0, 3, 5))
@pytest.mark.slow
def test_no_wrong_decision_among_blunders(seed: int) -> None:
    one = trial(seed, 40, 0.005)
    assert one.wrong == []
    assert one.counts["sign right"] > 5


@pytest.mark.slow
def test_an_undecided_curve_that_cannot_be_right_is_told() -> None:
    """Few points do not settle which mistake it is; that it is one is told, and never of a good curve."""
    told = 0
    for seed in range(4):
        one = trial(seed, 50, 0.015)
        assert one.wrong == []
        told += len(one.diagnosis.not_as_stated)
        for verdict in one.diagnosis.not_as_stated:
            assert verdict.sign == "undecided" and verdict.factor != pytest.approx(1.0, abs=0.4)
    assert told > 0


def test_what_is_decided_excludes_the_rest() -> None:
    calibration, points = case(4)
    diagnosis = diagnose(scaled(calibration, {"EXX": -1.0}), "FXYZ", points)
    of = {v.name: v for v in diagnosis.verdicts}
    assert of["EXX"].excluded == ("right", "absent") and of["EYY"].excluded == ("flipped", "absent")
    assert not diagnosis.not_as_stated
    assert all("right" not in v.excluded for v in diagnosis.verdicts if v.name != "EXX")


def test_curves_in_the_other_sense_are_put_right_exactly() -> None:
    calibration, points = case(4)
    flipped = {"EXX": -1.0, "EYY": -1.0, "C0Y": -1.0}
    diagnosis = diagnose(scaled(calibration, flipped), "FXYZ", points)
    assert {v.name: v.applied for v in diagnosis.wrong} == flipped
    assert {v.sign for v in diagnosis.wrong} == {"flipped"}
    put_right = build(diagnosis.corrected, "FXYZ").error(points.axis_mm, points.tool_mm)
    assert np.array_equal(put_right, build(calibration, "FXYZ").error(points.axis_mm, points.tool_mm))


@pytest.mark.slow
def test_units_that_a_factor_explains() -> None:
    calibration, points = case(2)
    factors = {"EXX": 1000.0, "EYY": 1e-3, "EAX": np.pi / 0.648, "C0Y": 0.648 / np.pi}
    diagnosis = diagnose(scaled(calibration, factors), "FXYZ", points)
    assert {v.name: v.unit for v in diagnosis.wrong} == {
        "EXX": "um (or urad) stated as mm (rad)",
        "EYY": "mm (or rad) stated as um (urad)",
        "EAX": "urad stated as arcsec",
        "C0Y": "arcsec stated as urad",
    }
    assert all(v.applied * factors[v.name] == pytest.approx(1.0) for v in diagnosis.wrong)


def test_pitch_and_roll_in_each_other_s_place() -> None:
    calibration, points = case(3, "YFXZ")
    swap = next(a for a in arrangements(calibration, "YFXZ") if a.words.startswith("EAX and EBX"))
    diagnosis = diagnose(swap.apply(calibration), "YFXZ", points)
    assert [a.words for a in diagnosis.arrangements] == [swap.words]
    assert diagnosis.wrong == ()


def test_a_table_stated_as_the_table_moves() -> None:
    calibration, points = case(4, "YFXZ")
    diagnosis = diagnose(scaled(calibration, {f"E{d}Y": -1.0 for d in "XYZABC"}), "YFXZ", points)
    assert diagnosis.senses == {"Y": "of the table itself"}
    assert diagnose(calibration, "YFXZ", points).senses == {"Y": "of the tool relative to the workpiece"}


def test_a_curve_that_the_control_corrects_already() -> None:
    calibration, points = case(5)
    off = build(calibration, "FXYZ").error(points.axis_mm, points.tool_mm)
    without = build(scaled(calibration, {"EXX": 0.0}), "FXYZ").error(points.axis_mm, points.tool_mm)
    moved = dataclasses.replace(points, measured_mm=points.axis_mm + points.tool_mm + without)
    diagnosis = diagnose(calibration, "FXYZ", moved)
    assert [(v.name, v.sign) for v in diagnosis.wrong] == [("EXX", "absent")]
    skipped = diagnose(calibration, "FXYZ", moved, skip=frozenset({"EXX"}))
    assert skipped.wrong == ()
    assert not np.allclose(off, without)


@pytest.mark.parametrize("chain", ["FXYZ", "XYFZ"])
def test_one_straight_tool_leaves_what_it_cannot_see(chain: str) -> None:
    """With t = (0, 0, t) no turn about Z of the last axis moves the tip."""
    machine = simulated.machine(6, "smooth", chain)
    machine.half = {}
    axis_mm, tool, place = simulated.points(machine, 6, 60, 0.002, tools=((0.0, 0.0, -120.0),))
    diagnosis = diagnose(true_calibration(machine, 6, 0.0), chain, Points(axis_mm, tool, place, 0.002))
    assert "ECZ" not in {v.name for v in diagnosis.verdicts}


@pytest.mark.slow
def test_proposed_points_decide() -> None:
    calibration, points = case(7, n=14, sigma=0.005)
    first = diagnose(calibration, "FXYZ", points)
    advice = advise(first, [(0.0, 0.0, -120.0)])
    assert 0 < len(advice.axis_mm) <= 12
    axis_mm = np.vstack([points.axis_mm, advice.axis_mm])
    tool = np.vstack([points.tool_mm, advice.tool_mm])
    both = Points(axis_mm, tool, axis_mm + tool + build(calibration, "FXYZ").error(axis_mm, tool), 0.005)
    second = diagnose(calibration, "FXYZ", both)
    assert len(second.undecided) < len(first.undecided)
    assert second.wrong == ()


@pytest.mark.slow
@settings(max_examples=3, deadline=None)
@given(st.integers(0, 1000), st.floats(-3.0, 3.0), st.tuples(*[st.floats(-4000, 4000)] * 3))
def test_the_instrument_s_frame_does_not_matter(seed: int, turn: float, shift: tuple[float, ...]) -> None:
    calibration, points = case(seed % 3, n=24)
    c, s = np.cos(turn), np.sin(turn)
    moved = points.measured_mm @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + np.array(shift)
    a = diagnose(calibration, "FXYZ", points)
    b = diagnose(calibration, "FXYZ", dataclasses.replace(points, measured_mm=moved))
    assert [v.sign for v in a.verdicts] == [v.sign for v in b.verdicts]
    assert np.allclose([v.factor for v in a.verdicts], [v.factor for v in b.verdicts], rtol=1e-4, atol=1e-4)


def test_judging_is_no_formality() -> None:
    calibration, points = case(8)
    diagnosis = diagnose(calibration, "FXYZ", points)
    assert judged(diagnosis, Done(dict.fromkeys(NAMES, -1.0))).wrong


# -- files and the command -------------------------------------------------------------------------------

ROWS = "X_mm,Y_mm,Z_mm,{0}X_{1},{0}Y_{1},{0}Z_{1}\n" + "".join(
    f"{x},{y},{z},1,2,3\n" for x, y, z in ((0, 0, 0), (9, 0, 0), (0, 9, 0), (0, 0, 9))
)


def test_a_file_of_deviations(tmp_path: Path) -> None:
    file = tmp_path / "p.csv"
    head = '# sigma_um = 4\n# tool_mm = [0, 0, -100]\n# frame = "machine"\n'
    file.write_text(head + ROWS.format("deviation_", "um"), "utf-8")
    points, known = load_checkpoints(file)
    assert known
    assert points.sigma == 0.004
    assert np.allclose(points.measured_mm[1], [9.001, 0.002, -99.997])


@pytest.mark.parametrize(
    ("head", "body", "words"),
    [
        ("# tool_mm = [0, 0, 0]\n", ROWS.format("measured_", "mm"), "uncertainty of a coordinate"),
        ("# sigma_um = 5\n", ROWS.format("measured_", "mm"), "vector from the gauge point"),
        ("# sigma_um = -5\n# tool_mm = [0, 0, 0]\n", ROWS.format("measured_", "mm"), "line 1: sigma_um"),
        ("# sigma_um = 5\n", ROWS.format("deviation_", "mm"), "deviation_X_um"),
        ("# sigma_um = 5 um\n", ROWS.format("measured_", "mm"), "line 1: sigma_um = 5 um is not a value"),
    ],
)
def test_files_that_leave_something_open(tmp_path: Path, head: str, body: str, words: str) -> None:
    file = tmp_path / "p.csv"
    file.write_text(head + body, "utf-8")
    with pytest.raises(ConfigError, match=words):
        load_checkpoints(file)


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("doctor") / "gantry-lines"
    shutil.copytree(PROGRAMS / "gantry-lines", folder, ignore=shutil.ignore_patterns("calibration*"))
    fitted = ["calibrate", "fit", str(folder), "-m", str(folder / "machine.toml"), "-q"]
    done = CliRunner().invoke(main, [*fitted, "-o", str(folder / "calibration.toml")])
    assert done.exit_code == 0, done.output
    return folder


def call(shop: Path, calibration: str, *more: str):
    files = [str(shop / name) for name in (calibration, "tracker.csv")]
    return CliRunner().invoke(main, ["calibrate", "doctor", *files, "-m", str(shop / "machine.toml"), *more])


@pytest.mark.slow
def test_the_command_on_a_good_calibration(shop: Path) -> None:
    done = call(shop, "calibration.toml", "--json")
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert report["schema"] == "olp-doctor-1"
    assert {row["sense"] for row in report["curves"]} <= {"right", "undecided"}
    assert report["decided"] > 8


@pytest.mark.slow
def test_what_is_put_right_keeps_its_uncertainty(shop: Path, tmp_path: Path) -> None:
    good = load_calibration(shop / "calibration.toml")
    known = load_uncertainty(shop / "calibration.toml", good)
    assert known is not None
    factors = {"EXX": -1.0, "EYY": -1.0}
    wrong = scaled(good, factors)
    entries = [dataclasses.replace(e, factor=e.factor * factors.get(e.name, 1.0)) for e in known.entries]
    spoilt = dataclasses.replace(known, entries=tuple(entries), fingerprint=fingerprint(wrong))
    for path, data in calibration_files(wrong, shop / "flipped.toml", covariance=spoilt).items():
        path.write_bytes(data)
    target = tmp_path / "right.toml"
    done = call(shop, "flipped.toml", "-o", str(target), "--json", "--fail-on", "never")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["uncertainty"] == "carried over"
    back = load_calibration(target)
    uncertainty = load_uncertainty(target, back)
    assert uncertainty is not None
    for a, b in zip(uncertainty.entries, known.entries, strict=True):
        assert np.array_equal(a.factor, b.factor)


@pytest.mark.slow
def test_the_command_puts_right_what_is_wrong(shop: Path, tmp_path: Path) -> None:
    good = load_calibration(shop / "calibration.toml")
    text = (shop / "calibration.toml").read_text("utf-8")
    stated = f"C0Y_urad = {good.squareness['C0Y'] * 1e6:.7g}"
    assert stated.split("=")[0] in text
    wrong = "\n".join(
        line.replace("= ", "= -") if line.startswith("C0Y_urad") else line for line in text.splitlines()
    )
    (shop / "wrong.toml").write_text(wrong, "utf-8")
    target = tmp_path / "right.toml"
    done = call(shop, "wrong.toml", "-o", str(target))
    assert done.exit_code == 1
    assert "OLP831" in done.stdout
    new = load_calibration(target)
    assert new.squareness == pytest.approx(good.squareness, abs=1e-15)
    for a, b in zip(new.curves, good.curves, strict=True):
        assert all(np.array_equal(a.mean(name), b.mean(name)) for name in a.names)
    assert (shop / "wrong.toml").read_text("utf-8") == wrong
    # the covariance beside it is that of the calibration before the change
    assert "[covariance]" not in target.read_text("utf-8")
    assert call(shop, "wrong.toml", "-o", str(shop / "wrong.toml"), "--force").exit_code == 2


def test_axes_are_those_of_the_judge() -> None:
    assert AXES == simulated.AXES
