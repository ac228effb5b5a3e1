"""Files in which lengths and angles are written with their own unit load as those in the unit of the key."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from files.test_schema import faults, values_of

from olp.core.errors import ConfigError
from olp.files.config import load_calibration, load_job, load_machine, load_setup
from olp.files.json_schema import json_schema

GOOD = Path(__file__).parents[1] / "broken" / "good"

#: File, a line of the good file, and the same with units.
SAME = [
    ("machine", "travel_mm = [0.0, 2000.0]", 'travel_mm = ["0 in", "2 m"]'),
    ("machine", "velocity_mm_s = 500.0", 'velocity_mm_s = "30 m/min"'),
    ("machine", "jerk_mm_s3 = 20000.0", 'jerk_mm_s3 = "20 m/s3"'),
    ("machine", "least_increment_mm = 0.001", 'least_increment_mm = "1 um"'),
    ("calibration", "datum_mm = [10.0, 0.0, -5.0]", 'datum_mm = ["10 mm", 0.0, "-5000 um"]'),
    ("job", "start_mm = {", 'start_mm = { Z = "0.1 in",'),
]


def edited(folder: Path, kind: str, old: str, new: str) -> Path:
    shutil.copytree(GOOD, folder, dirs_exist_ok=True)
    path = folder / f"{kind}.toml"
    text = path.read_text()
    assert old in text
    if "start_mm" in old:
        text = re.sub(r"start_mm = .*", 'start_mm = { X = "10 in", Y = "2 um" }', text)
        path.write_text(text)
        return path
    path.write_text(text.replace(old, new, 1))
    return path


@pytest.mark.parametrize(("kind", "old", "new"), SAME[:4])
def test_a_machine_with_units_is_the_same_machine(kind: str, old: str, new: str, tmp_path: Path) -> None:
    changed = load_machine(edited(tmp_path, kind, old, new))
    shutil.copytree(GOOD, tmp_path, dirs_exist_ok=True)
    assert changed == load_machine(tmp_path / "machine.toml")


def test_a_calibration_and_a_job_with_units(tmp_path: Path) -> None:
    path = edited(tmp_path, *SAME[4])
    assert load_calibration(path).datum_mm == (10.0, 0.0, -5.0)
    assert load_job(edited(tmp_path, *SAME[5])).start_mm == (254.0, 0.002, None)


def test_squareness_backlash_offsets_and_tools_with_units(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(
        (GOOD / "calibration.toml").read_text().partition("\n[")[0]
        + "\n"
        + '[squareness]\nC0Y_urad = "0.4 mm/600 mm"\nB0Z_urad = "-2 arcsec"\n[backlash]\nX_um = "0.0002 in"\n'
    )
    calibration = load_calibration(tmp_path / "c.toml")
    assert calibration.squareness["C0Y"] == pytest.approx(0.4 / 600)
    assert calibration.squareness["B0Z"] == pytest.approx(-9.69627e-6)
    assert calibration.backlash_mm[0] == pytest.approx(0.00508)
    text = (GOOD / "machine.toml").read_text()
    more = '[work_offsets.G57]\nX_mm = "4 in"\nC_deg = "0.5 mrad"\ntouched_at_mm = { X = "1 ft" }\n'
    (tmp_path / "m.toml").write_text(f'{text}\n{more}[tools.9]\nZ_mm = "4.5 in"\nradius_mm = ".25 in"\n')
    machine = load_machine(tmp_path / "m.toml")
    assert machine.work_offsets["G57"].offset_mm[0] == pytest.approx(101.6)
    assert machine.work_offsets["G57"].rotation_deg[2] == pytest.approx(0.0286479)
    assert machine.work_offsets["G57"].touched_at_mm[0] == pytest.approx(304.8)
    assert machine.tools[9].length_mm[2] == pytest.approx(114.3)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("velocity_mm_s = 500.0", 'velocity_mm_s = "fast"', r"line \d+: axes.X.velocity_mm_s = .fast.; exp"),
        ("travel_mm = [0.0, 2000.0]", 'travel_mm = [0.0, "2 s"]', r"line \d+: axes.X.travel_mm\[1\] = .2 s."),
        ("travel_mm = [0.0, 2000.0]", 'travel_mm = [0.0, "2 deg"]', "is an angle; expected a unit of length"),
        ("velocity_mm_s = 500.0", 'velocity_mm_s = "-1 in/s"', "expected a number above 0"),
        ('name = "gantry-2"', 'name = 2.0', "expected text in quotes"),
    ],
)  # fmt: skip
def test_errors_name_line_and_key(old: str, new: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=message):
        load_machine(edited(tmp_path, "machine", old, new))


def test_a_text_that_is_none_of_a_length_is_left_alone(tmp_path: Path) -> None:
    """A work offset may have any name, and set_by is a word."""
    text = (
        GOOD / "machine.toml"
    ).read_text() + '\n[work_offsets."plate_mm"]\nset_by = "true"\nX_mm = "1 in"\n'
    shutil.copytree(GOOD, tmp_path, dirs_exist_ok=True)
    (tmp_path / "machine.toml").write_text(text)
    offset = load_setup(tmp_path / "machine.toml").machine.work_offsets["plate_mm"]
    assert (offset.set_by, offset.offset_mm[0]) == ("true", 25.4)


@pytest.mark.parametrize(("kind", "old", "new"), SAME)
def test_the_schemas_take_texts_with_a_unit(kind: str, old: str, new: str, tmp_path: Path) -> None:
    schema = json_schema(kind)
    text = edited(tmp_path, kind, old, new).read_text()
    assert list(faults(values_of(text), schema, schema)) == []


def test_the_schemas_take_no_bare_text_as_a_length() -> None:
    schema = json_schema("machine")
    text = (GOOD / "machine.toml").read_text().replace("velocity_mm_s = 500.0", 'velocity_mm_s = "500"', 1)
    assert list(faults(values_of(text), schema, schema)) == [".axes.X.velocity_mm_s"]
