"""Calibrations of machines of any joints that cannot be right are refused before anything is written."""

from __future__ import annotations

import datetime
import re
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

import olp
from olp.cli import main
from olp.core.errors import Doubtful, UsageError

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
DAY = datetime.date(2026, 12, 1)
TRUNNION = b"# joined=points\nX_mm,Y_mm,Z_mm,A_deg,C_deg\n0,0,60,0,0\n40,10,20,-20,30\n60,-20,25,-45,75\n"
UM, URAD = r"(_um = )([-\d.]+)", r"(_urad = )([-\d.]+)"
#: A shipped job, what is changed in its calibration, and the doubt.
WRONG = {
    "lengths a thousand times": ("trunnion-mill", UM, r"\g<1>\g<2>e3", "OLP445"),
    "angles a thousand times": ("trunnion-mill", URAD, r"\g<1>\g<2>e3", "OLP446"),
    "lengths in mm": ("arm-payload", UM, r"\g<1>\g<2>e-3", "OLP450"),
    "an amplitude in nrad": ("trunnion-mill", "amplitude_urad = 9.0", "amplitude_urad = 9e3", "OLP448"),
    "a phase in degrees": ("trunnion-mill", "phase_rad = 0.6", "phase_rad = 34.0", "OLP448"),
    "a play of mm": ("trunnion-mill", r"\[location.C\]", "[backlash]\nX_um = 4e3\n[location.C]", "OLP447"),
    "a box in inches": ("trunnion-mill", r"X_mm = \[-290, 290\]", "X_mm = [-11.4, 11.4]", "OLP452"),
    "a box in radians": ("trunnion-mill", r"A_deg = \[-115, 25\]", "A_deg = [-2.01, 0.44]", "OLP452"),
    "a box of another machine": ("trunnion-mill", r"Y_mm = \[-290, 290\]", "Y_mm = [-400, 400]", "OLP452"),
    "a later day": ("trunnion-mill", "measured = 2026-10-12", "measured = 2026-12-30", "OLP460"),
    "an expired one": ("trunnion-mill", "valid_until = 2027", "valid_until = 2026", "OLP401"),
    "an arm in other lengths": ("arm-payload", UM, r"\g<1>\g<2>e3", "OLP445"),
    "a zero in degrees": ("arm-payload", "zero_urad = 420.0", "zero_urad = 240e3", "OLP446"),
    "angles of an arm in mrad": ("arm-payload", URAD, r"\g<1>\g<2>e-3", "OLP450"),
    "legs in other lengths": ("hexapod", r"(?m)(length_um = )([-\d.]+)", r"\g<1>\g<2>e3", "OLP409"),
}  # fmt: skip


def job_of(folder: Path, name: str, old: str = "", new: str = "") -> tuple[bytes, Path]:
    """A few rows of a shipped job, and its machine with another text in the calibration."""
    shutil.copytree(PROGRAMS / name, folder / name)
    path = folder / name / "calibration.toml"
    if old:
        changed = re.sub(old, new, path.read_text("utf-8"))
        assert changed != path.read_text("utf-8")
        path.write_text(changed, "utf-8")
    lists = [*path.parent.glob("deburr.csv"), *path.parent.glob("lens.csv")]
    rows = b"".join(lists[0].read_bytes().splitlines(keepends=True)[:6]) if lists else TRUNNION
    return rows, path.with_name("machine.toml")


@pytest.mark.parametrize("what", WRONG)
def test_what_cannot_be_right_is_refused_with_its_code(what: str, tmp_path: Path) -> None:
    name, old, new, code = WRONG[what]
    rows, machine = job_of(tmp_path, name, old, new)
    with pytest.raises(Doubtful, match=f"--accept {code} goes on all the same") as refused:
        olp.correct_joints(rows, machine, date=DAY)
    assert code in refused.value.codes


def test_who_accepts_goes_on_and_a_gate_lists_it(tmp_path: Path) -> None:
    rows, machine = job_of(tmp_path, *WRONG["lengths a thousand times"][:3])
    accepted = olp.correct_joints(rows, machine, accept=["OLP445", "OLP409"])
    assert accepted.report["accepted"] == ["OLP409", "OLP445"]
    checked = olp.check_joints(rows, machine)
    assert {"OLP409", "OLP445"} <= {one.code for one in checked.findings}
    assert checked.report["verdict"]["ok"] is False
    with pytest.raises(UsageError, match="is no doubt about the inputs"):
        olp.correct_joints(rows, machine, accept=["OLP101"])


@pytest.mark.parametrize("name", ["trunnion-mill", "arm-payload", "hexapod"])
def test_nothing_is_doubted_of_what_ships(name: str, tmp_path: Path) -> None:
    rows, machine = job_of(tmp_path, name)
    done = olp.correct_joints(rows, machine, date=DAY)
    assert done.report["accepted"] == []
    assert not [one for one in done.findings if one.code.startswith("OLP4") and one.code != "OLP422"]


def test_every_verb_doubts_and_the_stamp_keeps_what_was_accepted(tmp_path: Path) -> None:
    rows, machine = job_of(tmp_path, "trunnion-mill", UM, r"\g<1>\g<2>e3")
    (tmp_path / "p.csv").write_bytes(rows)
    words = [str(tmp_path / "p.csv"), "-m", str(machine)]
    for verb in (["correct", "-o", "-"], ["simulate"], ["view", "-o", str(tmp_path / "v.html"), "--no-time"]):
        refused = CliRunner().invoke(main, [verb[0], *words, *verb[1:]])
        assert refused.exit_code == 3 and "OLP445" in refused.stderr and refused.stdout == ""
    codes = ["--accept", "OLP445", "--accept", "OLP409"]
    out = str(tmp_path / "c.csv")
    assert CliRunner().invoke(main, ["correct", *words, "-o", out, *codes]).exit_code == 0
    assert "accepted OLP409 OLP445" in (tmp_path / "c.csv").read_text("utf-8")
    assert CliRunner().invoke(main, ["verify", words[0], out, "-m", str(machine)]).exit_code == 0
    assert CliRunner().invoke(main, ["simulate", out, "-m", str(machine), "-o", "-"]).exit_code == 0


def test_the_machine_file_states_how_large_errors_are(tmp_path: Path) -> None:
    rows, machine = job_of(tmp_path, "trunnion-mill", UM, r"\g<1>\g<2>e3")
    machine.write_text(machine.read_text("utf-8") + "\n[check]\nlargest_correction_um = 90000\n", "utf-8")
    assert olp.correct_joints(rows, machine).report["accepted"] == []
    text = machine.read_text("utf-8").replace("90000", "5")
    (machine.parent / "calibration.toml").write_bytes(
        (PROGRAMS / "trunnion-mill" / "calibration.toml").read_bytes()
    )
    machine.write_text(text, "utf-8")
    with pytest.raises(Doubtful, match="at most 5 um are expected of this machine"):
        olp.correct_joints(rows, machine)
