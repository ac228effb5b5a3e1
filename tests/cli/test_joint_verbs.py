"""Verbs and report files on machines with rotary joints."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from olp.cli import main

FOLDER = Path(__file__).resolve().parents[2] / "programs"
ARM = FOLDER / "arm-payload"


def run(*words: object) -> Result:
    return CliRunner().invoke(main, [*map(str, words)])


def test_a_list_is_inspected() -> None:
    values = json.loads(run("inspect", "-j", ARM / "job.toml", "--json").stdout)
    rows = np.loadtxt(ARM / "deburr.csv", delimiter=",", skiprows=1)
    for column, (name, low, high) in enumerate((("J1", -170.0, 170.0), ("J2", -120.0, 90.0))):
        axis = values["axes"][name]
        assert (axis["from_deg"], axis["to_deg"]) == (rows[:, column].min(), rows[:, column].max())
        rest = np.minimum(rows[:, column] - low, high - rows[:, column])
        assert axis["travel_left_deg"] == pytest.approx(rest.min())
        # the header is line 1
        assert axis["line"] == 2 + rest.argmin()
    # the wrist is straightest there
    assert values["nearest_to_singular"]["line"] == 2 + np.abs(rows[:, 4]).argmin()
    assert values["tip_range_mm"]["Y"] == pytest.approx([-180.0, 180.0], abs=1e-3)


def test_a_program_is_inspected(tmp_path: Path) -> None:
    program = tmp_path / "part.nc"
    program.write_text(
        "G21 G90 G54\nG0 X0 Y0 Z50 A0 C0\nG43.4 H1 X0 Y0 Z20 A0 C0\nG1 X9 A-20 C30 F100\nG49\nM30\n"
    )
    machine = FOLDER / "trunnion-mill" / "machine.toml"
    values = json.loads(run("inspect", program, "-m", machine, "--json").stdout)
    assert values["moves"] == {"rapid": 2, "line": 1, "with_tip_control": 2, "in_tilted_planes": 0}
    assert (values["dialect"], values["tools"], values["stamped"]) == ("fanuc", [1], False)
    assert values["axes"]["A"] == {"from_deg": -20.0, "to_deg": 0.0, "travel_left_deg": 30.0, "line": 2}
    # the tip: 140 mm of the work offset and, before the control of the tip, 120 mm of the tool below
    assert values["tip_range_mm"]["X"] == pytest.approx([0.0, 9.0], abs=1e-9)
    assert values["tip_range_mm"]["Z"] == pytest.approx([-210.0, -120.0], abs=1e-9)
    assert "nearest to singular" in run("inspect", program, "-m", machine).stdout.lower()
    refused = run("inspect", program, "-m", machine, "--at", "0", "0", "0")
    assert "--at does not go with machines with rotary joints" in refused.output


def test_findings_of_a_list_go_into_a_file(tmp_path: Path) -> None:
    job, output = ARM / "job.toml", tmp_path / "found.json"
    shown = run("check", "-j", job, "--json")
    told = run("check", "-j", job, "--json", "-o", output)
    assert (told.exit_code, told.stdout) == (shown.exit_code, "")
    assert output.read_text() == shown.stdout
    again = run("check", "-j", job, "-o", output)
    assert again.exit_code == 2
    assert "exists already" in again.stderr
    two = run("check", ARM / "deburr.csv", ARM / "deburr.csv", "-j", job, "-o", tmp_path / "two.txt")
    assert "-o is for one program" in two.stderr


@pytest.mark.parametrize("ending", ["md", "html", "json"])
def test_the_report_of_a_correction_is_a_file(ending: str, tmp_path: Path) -> None:
    file = tmp_path / f"report.{ending}"
    hexapod = FOLDER / "hexapod" / "job.toml"
    done = run(
        "correct", "-j", hexapod, "-o", tmp_path / "o.csv", "--report", file, "--json", "--date", "2026-11-20"
    )
    assert done.exit_code == 0, done.output
    report, text = json.loads(done.stdout), file.read_text("utf-8")
    if ending == "json":
        assert json.loads(text) == report
        return
    before = report["deviation"]["before"]["position_max_um"]
    for words in (f"{before:.2f}", "joints of any kind", "hexapod-650", "18 days on 2026-11-20", "L6"):
        assert words in text
    again = run("correct", "-j", hexapod, "-o", tmp_path / "p.csv", "--report", tmp_path / "p.csv")
    assert again.exit_code != 0


def test_loops_are_written_out_for_such_a_machine(tmp_path: Path) -> None:
    """The text that --flatten of the other verbs reads; a list has nothing to unroll."""
    mill = Path(__file__).resolve().parents[2] / "programs" / "trunnion-mill" / "machine.toml"
    (tmp_path / "p.nc").write_text(
        "G21 G90 G17 G94 G54 G49\nG0 X0. Y0. Z150. A0. C0.\n#1=1\nWHILE [#1 LE 3] DO1\n"
        "G1 X[#1*2.] C[#1*5.] F900\n#1=#1+1\nEND1\nM30\n"
    )
    done = run("flatten", str(tmp_path / "p.nc"), "-m", str(mill), "-o", str(tmp_path / "flat.nc"))
    assert done.exit_code == 0, done.stderr
    flat = (tmp_path / "flat.nc").read_text()
    assert "WHILE" not in flat and all(f"X{2 * k}" in flat and f"C{5 * k}" in flat for k in (1, 2, 3))
    whole = run("simulate", str(tmp_path / "p.nc"), "-m", str(mill), "--flatten", "--step-mm", "5")
    assert whole.exit_code == 0
    assert (
        run("simulate", str(tmp_path / "flat.nc"), "-m", str(mill), "--step-mm", "5").stdout == whole.stdout
    )
    (tmp_path / "l.csv").write_text("X_mm,Y_mm,Z_mm,A_deg,C_deg\n0,0,50,0,0\n1,0,50,0,0\n")
    done = run("flatten", str(tmp_path / "l.csv"), "-m", str(mill))
    assert done.exit_code == 2 and "cannot be unrolled" in done.stderr
