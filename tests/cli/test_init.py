"""`olp init`: what it asks, takes and writes, and that nothing that it made up passes for a measurement."""

from __future__ import annotations

import json
import math
import tomllib
from pathlib import Path

import pytest
from cases.control_settings import SAMPLES, Sample
from cli.test_cli import run
from click.testing import CliRunner, Result

from olp.cli import init, main
from olp.files.config import load_machine, load_setup
from olp.files.json_schema import schema_id
from olp.program.registry import DIALECTS, read
from olp.program.rs274.profiles.base import Profile
from olp.workflows.session import Session

TRAVEL = ("--travel", "X", "0", "600", "--travel", "Y", "0", "16in", "--travel", "Z", "-300", "0")
PROFILES = sorted(name for name, dialect in DIALECTS.items() if isinstance(dialect, Profile))
CONVERSATIONAL = """0 BEGIN PGM PART MM
1 TOOL CALL 1 Z S1000
2 L X+100 Y+50 Z+50 R0 FMAX
3 L Z+10 F500
4 L X+200 Y+90
5 END PGM PART MM
"""


def square(name: str, *words: str) -> tuple[str, ...]:
    return ("--skew", f"C0Y={name}", "--measured", "2026-11-01", *words)


@pytest.mark.parametrize("control", PROFILES)
def test_the_first_program_is_corrected_at_once(control: str, tmp_path: Path) -> None:
    made = run("init", tmp_path / "m", "--controller", control, *TRAVEL, *square("0.4mm/600mm"))
    assert made.exit_code == 0, made.stderr
    done = run("correct", "-j", tmp_path / "m" / "job.toml", "--json")
    assert done.exit_code == 0, done.stderr
    report = json.loads(done.stdout)
    # the square is 100 mm wide, in the middle
    assert report["deviation"]["before"]["waypoints"]["max_um"] == pytest.approx(400 / 600 * 50, rel=0.01)
    assert report["deviation"]["after"]["waypoints"]["max_um"] < 1.0


@pytest.mark.parametrize("control", PROFILES)
def test_the_first_program_stays_in_the_middle_of_the_travel(control: str, tmp_path: Path) -> None:
    assert run("init", tmp_path / "m", "--controller", control, *TRAVEL).exit_code == 0
    setup = load_setup(job_path=tmp_path / "m" / "job.toml")
    assert setup.job.program is not None
    text = Path(setup.job.program).read_bytes()
    path = read(text, setup, Session(setup).control()).toolpath
    ends = path.end_mm[~(path.end_mm != path.end_mm).any(axis=1)]
    assert ends.min(axis=0)[:2].tolist() == pytest.approx([250.0, 203.2 - 50.0])
    assert ends.max(axis=0)[:2].tolist() == pytest.approx([350.0, 203.2 + 50.0])
    assert -150.0 < ends[:, 2].min() < ends[:, 2].max() <= -130.0


@pytest.mark.parametrize("verb", ["correct", "check", "simulate", "retime"])
def test_a_calibration_that_nobody_measured_is_doubted_by_every_verb(verb: str, tmp_path: Path) -> None:
    assert run("init", tmp_path / "m").exit_code == 0
    out = () if verb == "check" else ("-o", tmp_path / "out.csv")
    done = run(verb, "-j", tmp_path / "m" / "job.toml", *out)
    assert done.exit_code in (1, 3)
    assert "OLP440" in done.output
    assert "OLP442" in done.output


def test_only_errors_that_are_known_are_written(tmp_path: Path) -> None:
    known = (
        "--backlash",
        "X=0.002in",
        "--scale",
        "Z=120ppm",
        "--scale",
        "Y=-50um/m",
        "--measured",
        "2026-11-01",
    )
    assert run("init", tmp_path / "m", *TRAVEL, *known).exit_code == 0
    assert sorted(path.name for path in (tmp_path / "m").glob("*.csv")) == [
        "calibration-y.csv", "calibration-z.csv",
    ]  # fmt: skip
    found = json.loads(
        run("inspect", tmp_path / "m" / "machine.toml", "--at", "1", "1", "-300", "--json").stdout
    )
    assert found["error_um"][2] == pytest.approx(120e-6 * -150.0 * 1e3), "zero in the middle"
    calibration = tomllib.loads((tmp_path / "m" / "calibration.toml").read_text())
    assert calibration["backlash"]["X_um"] == pytest.approx(50.8)
    assert calibration["box_mm"][1] == [0.0, pytest.approx(406.4)]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--skew", "C0Y=1mm/m", "--measured", "today"), "need the travel that they hold for"),
        ((*TRAVEL, "--skew", "C0Y=1mm/m"), "measured errors need their day; state it with --measured"),
        ((*TRAVEL, *square("2 mm")), "is neither an angle nor a ratio of lengths; expected such as"),
        (("--skew", "XX=1mm/m"), "expected NAME=VALUE with a name out of XY, XZ, YZ, C0Y"),
        (("--travel", "X", "0", "ten"), "give a number and its unit"),
        (("--travel", "X", "0", "10", "--travel", "Y", "5", "5"), "expected min below max"),
        (("--controller", "GRBL"), "did you mean grbl"),
        (("--chain", "XYZ"), "is not a chain"),
    ],
)
def test_what_has_to_be_stated_is_named(words: tuple[str, ...], message: str, tmp_path: Path) -> None:
    result = run("init", tmp_path / "m", *words)
    assert result.exit_code == 2
    assert message in result.stderr
    assert not (tmp_path / "m").exists()


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda sample: sample.name)
def test_settings_of_every_control_become_files_that_correct(sample: Sample, tmp_path: Path) -> None:
    file = tmp_path / sample.name
    file.write_text(sample.text)
    made = run("init", tmp_path / "m", "--from", file, *square("-300urad"))
    assert made.exit_code == 0, made.stderr
    if sample.controller == "heidenhain":  # no first program is written for it
        assert 'program = "part.h"' in (tmp_path / "m" / "job.toml").read_text()
        (tmp_path / "m" / "part.h").write_text(CONVERSATIONAL)
    done = run("correct", "-j", tmp_path / "m" / "job.toml", "-q")
    assert done.exit_code == 0, done.stderr


def test_settings_without_a_travel_need_it(tmp_path: Path) -> None:
    (marlin,) = (sample for sample in SAMPLES if sample.key == "marlin")
    (tmp_path / "a.txt").write_text(marlin.text.partition("Send: M211")[0])
    refused = run("init", tmp_path / "m", "--from", tmp_path / "a.txt")
    assert refused.exit_code == 2
    assert "state it with --travel X MIN MAX --travel Y MIN MAX --travel Z MIN MAX" in refused.stderr
    assert run("init", tmp_path / "m", "--from", tmp_path / "a.txt", *TRAVEL).exit_code == 0


def test_every_file_names_its_schema_which_is_beside_it(tmp_path: Path) -> None:
    assert run("init", tmp_path / "m").exit_code == 0
    for kind in ("machine", "calibration", "job"):
        first, _, _ = (tmp_path / "m" / f"{kind}.toml").read_text().partition("\n")
        assert first.startswith("#:schema ./")
        schema = json.loads((tmp_path / "m" / first.removeprefix("#:schema ./")).read_text())
        assert schema["$id"] == schema_id(kind) == f"urn:olp-corrector:schema:olp-{kind}-1"
        assert schema == json.loads(run("schema", kind).stdout)


def test_a_machine_without_limits_of_motion_is_corrected_and_not_timed(tmp_path: Path) -> None:
    assert run("init", tmp_path / "m", *TRAVEL, *square("100urad")).exit_code == 0
    job = tmp_path / "m" / "job.toml"
    refused = run("retime", "-j", job, "-o", tmp_path / "t.csv")
    assert refused.exit_code == 3
    assert "does not state axes.X.velocity_mm_s, axes.X.acceleration_mm_s2" in refused.stderr
    assert refused.stderr.count("olp: error") == 1
    plan = run("calibrate", "plan", "-m", tmp_path / "m" / "machine.toml")
    assert plan.exit_code == 3
    assert "axes.Z.jerk_mm_s3" in plan.stderr
    page = run("view", "-j", job, "-o", tmp_path / "page.html")
    assert page.exit_code == 0, page.stderr
    assert "the motion is not planned" in page.stderr
    assert run("check", "-j", job).exit_code == 0


# -- the questions -------------------------------------------------------------------------------------------


def answered(monkeypatch: pytest.MonkeyPatch, folder: Path, answers: list[str], *words: str) -> Result:
    """`olp init` on a terminal, with these answers."""
    monkeypatch.setattr(init, "is_terminal", lambda stream: True)
    return CliRunner().invoke(main, ["init", str(folder), *words], input="".join(f"{a}\n" for a in answers))


def test_what_is_not_stated_is_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answers = ["fanuc", "yfxz", "0 20 in", "-400, 0", "-300 0mm", "y", "0.4 mm/600 mm"]
    answers += [""] * 2 + ["0.02 mm"] + [""] * 2 + [""] * 3 + ["2026-11-01"]
    result = answered(monkeypatch, tmp_path / "m", answers)
    assert result.exit_code == 0, result.stderr
    assert result.stdout == ""
    machine = load_machine(tmp_path / "m" / "machine.toml")
    assert (machine.controller, machine.chain) == ("fanuc", "YFXZ")
    assert machine.axes["X"].travel_mm == pytest.approx((0.0, 508.0))
    assert machine.axes["Y"].travel_mm == (-400.0, 0.0)
    calibration = tomllib.loads((tmp_path / "m" / "calibration.toml").read_text())
    assert calibration["squareness"]["C0Y_urad"] == pytest.approx(2000 / 3)
    assert calibration["backlash"]["X_um"] == 20.0
    assert math.isclose(calibration["temperature_degC"], 20.0)


def test_a_wrong_answer_is_asked_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answers = [
        "GRBL",
        "grbl",
        "XYZ",
        "FXYZ",
        "5 5",
        "0,5 500 mm",
        "0 500 600",
        "0 500",
        "0 ten",
        "0 400",
        "-90 0",
        "n",
    ]
    result = answered(monkeypatch, tmp_path / "m", answers)
    assert result.exit_code == 0, result.stderr
    for words in (
        "did you mean grbl",
        "is not an order of F, X, Y, Z",
        "is empty",
        "expected two positions and perhaps a unit",
    ):
        assert words in result.stderr
    assert "OLP440" in run("correct", "-j", tmp_path / "m" / "job.toml").output


def test_only_what_is_missing_is_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ("--controller", "grbl", "--chain", "FXYZ", *TRAVEL)
    result = answered(monkeypatch, tmp_path / "m", ["n"], *words)
    assert result.exit_code == 0, result.stderr
    assert "Control (" not in result.stderr
    assert "Travel of" not in result.stderr


def test_an_answer_that_never_comes_ends_the_call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = answered(monkeypatch, tmp_path / "m", ["fanuc"])
    assert result.exit_code == 130
    assert not (tmp_path / "m").exists()
