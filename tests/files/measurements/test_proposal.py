"""A plan proposed from a folder: what files say is taken, what none says is asked for, nothing is guessed."""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner

from olp.cli import main
from olp.core.errors import ConfigError
from olp.files.config import load_machine
from olp.files.measurements.instruments.registry import INSTRUMENTS
from olp.files.measurements.proposal import ASKED, propose
from olp.files.measurements.reader import load_measurements

PROGRAMS = Path(__file__).resolve().parents[3] / "programs"
LINE = "target_mm,run,direction,value_um\n0,1,1,0\n100,1,1,2.5\n0,2,1,0.5\n100,2,1,3.5\n"
POINTS = "X_mm,Y_mm,Z_mm,{}\n"
#: A file of each instrument, by the table that is proposed for it.
FILES = {
    "lines": ("eyz-left.csv", LINE),
    "points": ("tracker.csv", POINTS.format("measured_X_mm,measured_Y_mm,measured_Z_mm")),
    "polar": ("station.csv", POINTS.format("distance_mm,azimuth_deg,elevation_deg")),
    "artefacts": ("centres.csv", "pose,ball,X_mm,Y_mm,Z_mm\n"),
    "stations": ("lengths.csv", POINTS.format("length_mm")),
    "pods": ("t.csv", POINTS.format("azimuth_1_deg,elevation_1_deg,azimuth_2_deg,elevation_2_deg")),
    "diagonals": ("d.csv", "# start_mm = [0, 0, 0]\n# end_mm = [9, 9, 9]\n" + LINE),
    "ballbars": ("b.csv", "# plane = XY\nangle_deg,run,direction,deviation_um\n"),
}


def test_every_instrument_with_files_recognises_its_own(tmp_path: Path) -> None:
    assert set(FILES) == {instrument.key for instrument in INSTRUMENTS if instrument.marks}
    for name, text in FILES.values():
        (tmp_path / name).write_text(text)
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    proposal = propose(tmp_path)
    plan = tomllib.loads(proposal.text)
    for key, (name, _) in FILES.items():
        assert [table["file"] for table in plan[key]] == [name]
    assert plan["lines"][0]["component"] == "EYZ" and plan["pods"][0]["pods"] == 2
    assert proposal.unknown == ("other.csv",)
    assert proposal.text.count(f'"{ASKED}"') == len(proposal.asked)
    # conventions of theodolites are asked for, although the plan has defaults for them
    assert plan["pods"][0]["azimuth"] == plan["polar"][0]["vertical"] == ASKED


def test_uncertainties_in_columns_are_not_asked_for(tmp_path: Path) -> None:
    axes = "measured_X_mm,measured_Y_mm,measured_Z_mm,tool_X_mm,tool_Y_mm,tool_Z_mm,"
    (tmp_path / "t.csv").write_text(POINTS.format(axes + "sigma_X_um,sigma_Y_um,sigma_Z_um"))
    plan = tomllib.loads(propose(tmp_path).text)
    assert plan["points"] == [{"file": "t.csv"}]


def test_a_plan_that_is_filled_in_is_read(tmp_path: Path) -> None:
    for name in ("eax.csv", "eyx.csv", "eyz-left.csv", "tracker.csv"):
        shutil.copy(PROGRAMS / "gantry-lines" / name, tmp_path)
    machine = PROGRAMS / "gantry-lines" / "machine.toml"
    proposal = propose(tmp_path, load_machine(machine))
    plan = tmp_path / "measurements.toml"
    plan.write_text(proposal.text)
    with pytest.raises(ConfigError) as refused:
        load_measurements([tmp_path])
    assert all(question.split()[0] in str(refused.value) for question in proposal.asked)
    answers = {
        "measured": "2026-04-20", "temperature_degC": "20.0", "sense": '"actual-minus-commanded"',
        "line_mm": "{ X = 740.0, Y = 620.0, Z = -310.0 }", "tool_mm": "[0.0, 0.0, -85.0]",
    }  # fmt: skip
    text = re.sub(r'^(\w+) = "\?".*$', lambda m: f"{m[1]} = {answers[m[1]]}", proposal.text, flags=re.M)
    plan.write_text(text)
    measurements = load_measurements([tmp_path])
    assert [line.component for line in measurements.lines] == ["EAX", "EYX", "EYZ"]
    assert len(measurements.scattered) == 1 and measurements.machine == "gantry-1600"


@pytest.mark.parametrize(
    ("name", "component"),
    [
        ("EXX.csv", "EXX"), ("laser_ezx-2.csv", "EZX"), ("2026-05 eyy run1.csv", "EYY"),
        ("texxas.csv", None), ("eax.csv", None), ("line1.csv", None),
    ],
)  # fmt: skip
def test_a_component_is_taken_from_a_name_that_says_it_and_fits_its_unit(
    tmp_path: Path, name: str, component: str | None
) -> None:
    (tmp_path / name).write_text(LINE)
    (table,) = tomllib.loads(propose(tmp_path).text)["lines"]
    assert table["component"] == (component or ASKED)


def test_a_profile_of_the_folder_reads_files_of_another_layout(tmp_path: Path) -> None:
    for name in ("laser.toml", "laser-x.txt", "machine.toml"):
        shutil.copy(PROGRAMS / "gantry-lines" / name, tmp_path)
    shutil.copy(tmp_path / "laser-x.txt", tmp_path / "laser EYY.txt")
    (tmp_path / "notes.txt").write_text("cold in the hall\n")
    (tmp_path / "photo.JPG").write_bytes(b"\xff\xd8")
    proposal = propose(tmp_path)
    plan = tomllib.loads(proposal.text)
    assert plan["lines"] == [
        {"file": "laser EYY.txt", "component": "EYY", "profile": "laser.toml"},
        {"file": "laser-x.txt", "profile": "laser.toml", "component": ASKED},
    ]
    # the profile states the sense, and a line has it once
    assert "sense" not in plan["defaults"]
    assert proposal.unknown == ("notes.txt",)


def test_days_that_contradict_are_asked_for(tmp_path: Path) -> None:
    for k, day in enumerate(("2026-05-14", "2026-05-15")):
        (tmp_path / f"exx-{k}.csv").write_text(f"# measured = {day}\n# sense = table-motion\n" + LINE)
    plan = tomllib.loads(propose(tmp_path).text)
    assert plan["measured"] == ASKED and "sense" not in plan["defaults"]
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(ConfigError, match="no file of readings that says what it is"):
        propose(empty)


def test_the_command_writes_the_plan_and_asks(tmp_path: Path) -> None:
    (tmp_path / "exx.csv").write_text(LINE)
    call = ["calibrate", "fit", str(tmp_path), "--propose"]
    done = CliRunner().invoke(main, [*call, str(tmp_path / "measurements.toml")])
    assert done.exit_code == 0, done.output
    assert "asked for sense of the lines" in done.stderr and (tmp_path / "measurements.toml").is_file()
    again = CliRunner().invoke(main, [*call, str(tmp_path / "measurements.toml")])
    assert again.exit_code == 2 and "--force" in again.stderr
    elsewhere = CliRunner().invoke(main, [*call, str(tmp_path.parent / "m.toml")])
    assert elsewhere.exit_code == 2 and "relative" in elsewhere.stderr
    one = CliRunner().invoke(main, ["calibrate", "fit", str(tmp_path / "exx.csv"), *call[3:], "m.toml"])
    assert one.exit_code == 2 and "one folder" in one.stderr
