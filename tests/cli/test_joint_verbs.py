"""Verbs and report files on machines with rotary joints."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import click
import numpy as np
import pytest
from click.testing import CliRunner, Result

from olp.cli import joints, main
from olp.cli.compare import _ON_JOINTS
from olp.cli.joint_diff import _between
from olp.workflows.joints.check import CODES

FOLDER = Path(__file__).resolve().parents[2] / "programs"
ARM = FOLDER / "arm-payload"
#: A part with four moves.
PART = (
    "G21 G90 G54\nG0 X0 Y0 Z50 A0 C0\nG1 X9 Y0 Z20 A0 C0 F900\nG1 X5 Y5 Z20 A-10 C40\n"
    "G1 X0 Y0 Z20 A0 C0\nM30\n"
)
#: A line in a loop that ends beyond the calibrated values of X.
LOOP = (
    "G21 G90 G17 G94 G54 G49\nG0 X0. Y0. Z150. A0. C0.\n#1=1\nWHILE [#1 LE 3] DO1\n"
    "G1 X[#1*97.+2.] C[#1*5.] F900\n#1=#1+1\nEND1\nM30\n"
)


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
    assert "--at is not for machines with rotary joints" in refused.output


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
    flatly = run("simulate", str(tmp_path / "flat.nc"), "-m", str(mill), "--step-mm", "5")
    (here, lines), (there, _) = (
        zip(*(row.rsplit(",", 1) for row in done.stdout.splitlines()[1:]), strict=True)
        for done in (whole, flatly)
    )
    # lines are those of the program
    assert here == there and set(lines[1:]) == {"5"}
    (tmp_path / "l.csv").write_text("X_mm,Y_mm,Z_mm,A_deg,C_deg\n0,0,50,0,0\n1,0,50,0,0\n")
    done = run("flatten", str(tmp_path / "l.csv"), "-m", str(mill))
    assert done.exit_code == 2 and "cannot be unrolled" in done.stderr


def test_a_gate_speaks_the_forms_of_pipelines(tmp_path: Path) -> None:
    """Codes are those that are looked for, and what is left out does not count."""
    (tmp_path / "part.nc").write_text(PART)
    job = (tmp_path / "part.nc", "-m", FOLDER / "trunnion-mill" / "machine.toml")
    late = ("--date", "2099-01-01")
    report = json.loads(run("check", *job, *late, "--format", "json").stdout)
    assert (report["schema"], report["rules"], report["verdict"]["ok"]) == ("olp-check-1", [*CODES], False)
    assert "OLP401" in [one["code"] for one in report["findings"]]
    assert report["proof"]["deviation"]["holds"]
    log = json.loads(run("check", *job, *late, "--format", "sarif").stdout)["runs"][0]
    assert [rule["id"] for rule in log["tool"]["driver"]["rules"]] == [*CODES]
    assert [one["ruleId"] for one in log["results"]] == [one["code"] for one in report["findings"]]
    suite = ElementTree.fromstring(run("check", *job, *late, "--format", "junit").stdout)[0]
    assert (suite.get("tests"), suite.get("failures")) == (str(len(CODES)), "1")
    assert run("check", *job, *late).exit_code == 1
    assert run("check", *job, *late, "--ignore", "OLP401").stdout.splitlines()[-1].startswith("Go: ")
    assert run("check", *job, *late, "--select", "OLP1", "-q").exit_code == 0
    refused = run("check", *job, "--select", "OLP701")
    assert refused.exit_code == 2 and "OLP701 is not looked for" in refused.stderr
    assert run("check", *job, "--select", "OLP9999").exit_code == 2


def test_lines_of_a_gate_are_those_of_the_program_that_is_checked(tmp_path: Path) -> None:
    machine = ("-m", FOLDER / "trunnion-mill" / "machine.toml")
    nominal, corrected = tmp_path / "part.nc", tmp_path / "corrected.nc"
    nominal.write_text(PART)
    assert run("correct", nominal, *machine, "-o", corrected, "-q").exit_code == 0
    lines = corrected.read_text().splitlines()
    far = next(k for k, line in enumerate(lines) if "A-10" in line)
    lines[far] += " (nudged)"
    lines[far] = re.sub(r"X(\S+)", lambda word: f"X{float(word[1]) + 0.004:.3f}", lines[far])
    corrected.write_text("\n".join(lines))
    done = run("check", corrected, *machine, "--nominal", nominal, "--json")
    found = {one["code"]: one for one in json.loads(done.stdout)["findings"]}
    # the line behind begins where this one ends
    assert far + 1 in found["OLP101"]["lines"] and found["OLP101"]["line"] >= far + 1
    assert done.exit_code == 1
    alone = json.loads(run("check", corrected, *machine, "--json").stdout)
    assert [one["code"] for one in alone["findings"]] == ["OLP408"] and "give --nominal" in alone["checked"]
    corrected.write_text("\n".join([*lines[:far], lines[far].replace("A-10", "A-130"), *lines[far + 1 :]]))
    beyond = {
        f["code"]: f for f in json.loads(run("check", corrected, *machine, "--json").stdout)["findings"]
    }
    assert "A is commanded beyond its travel of -120 to 30 deg" in beyond["OLP402"]["message"]
    # the move behind begins there
    assert beyond["OLP402"]["lines"] == beyond["OLP405"]["lines"] == [far + 1, far + 2]
    nominal.write_text(PART.replace("X9", "X295"))
    outside = run("check", nominal, *machine, "--json")
    (finding,) = (one for one in json.loads(outside.stdout)["findings"] if one["code"] == "OLP405")
    assert outside.exit_code == 1 and finding["line"] == 3
    held = run("check", nominal, *machine, "--json", "--outside-box", "hold")
    assert "OLP403" in held.stdout and held.exit_code == 0


def test_lines_of_an_unrolled_program_are_those_that_were_written(tmp_path: Path) -> None:
    (tmp_path / "loop.nc").write_text(LOOP)
    words = (tmp_path / "loop.nc", "-m", FOLDER / "trunnion-mill" / "machine.toml", "--flatten")
    done = run("correct", *words, "-o", tmp_path / "o.nc", "--json", "--outside-box", "hold")
    report = json.loads(done.stdout)
    assert {row["line"] for row in report["worst"]} == {5}
    (outside,) = (one for one in report["findings"] if one["code"] == "OLP403")
    assert (outside["line"], outside["lines"]) == (5, [5])


def test_changes_are_shown_line_by_line(tmp_path: Path) -> None:
    """Partners are the moves that belong together, and changes are corrected minus nominal command."""
    (tmp_path / "loop.nc").write_text(LOOP.replace("97.+2.", "2."))
    mill = ("-m", FOLDER / "trunnion-mill" / "machine.toml")
    done = run("correct", tmp_path / "loop.nc", *mill, "--flatten", "-o", tmp_path / "o.nc", "-q", "--diff")
    rows = [row.split() for row in done.stdout.splitlines()[1:-1]]
    # three passes of the line in the loop, which the stamp and the rapid precede
    assert [row[0] for row in rows] == ["+", "2", "5", "5", "5"]
    for row in rows[2:]:
        x = [float(word[1:]) for word in row if word.startswith("X") and "." in word]
        assert x[2] == pytest.approx((x[1] - x[0]) * 1e3, abs=0.06)
    listed = run("correct", "-j", ARM / "job.toml", "-o", tmp_path / "o.csv", "-q", "--diff").stdout
    texts = (ARM / "deburr.csv").read_text(), (tmp_path / "o.csv").read_text()
    counts = [len(text.splitlines()) for text in texts]
    assert listed.splitlines()[-1] == (
        f"lines: {counts[0] - 1} changed, {counts[1] - counts[0]} inserted, 0 left out"
    )
    second = listed.splitlines()[2].split()
    turned = np.array(
        [float(row.split(",")[0]) for row in (texts[0].splitlines()[1], texts[1].splitlines()[2])]
    )
    assert f"J1{np.radians(np.diff(turned))[0] * 1e6:+.1f}" in second


@pytest.mark.slow
def test_curves_of_joints_are_drawn(tmp_path: Path) -> None:
    drawn = run("inspect", FOLDER / "trunnion-mill" / "machine.toml", "--plot", tmp_path / "c.svg")
    assert drawn.exit_code == 0 and drawn.stdout == ""
    text = (tmp_path / "c.svg").read_text()
    assert all(f">{name}<" in text for name in ("axis A", "axis C", "EXC", "EBC", "ECC", "EAA"))
    assert "axis X" not in text
    none = run("inspect", FOLDER / "hexapod" / "machine.toml", "--plot", tmp_path / "h.svg")
    assert none.exit_code == 2 and "no curves" in none.stderr


def test_a_refused_option_says_why_and_how_to_go_on() -> None:
    """Every option of the verbs for programs is taken, or a sentence of its own refuses it."""
    taken = {
        "retime": joints.RETIME, "view": joints.VIEW, "check": joints.CHECK, "correct": joints.CORRECT,
        "inspect": ("file",), "compare": _ON_JOINTS, "verify": (), "simulate": (), "flatten": (),
    }  # fmt: skip
    for verb, also in taken.items():
        command = main.get_command(click.Context(main), verb)
        assert command is not None
        for option in command.params:
            known = option.name in (*joints.ALWAYS, *also, *joints.WHY_NOT)
            assert known or not option.expose_value, f"{verb} {option.name}"
    results = run("results", ARM / "deburr.csv", "-m", ARM / "machine.toml")
    assert results.exit_code == 2 and "does not state the values of all axes" in results.stderr
    said = run("retime", "-j", ARM / "job.toml", "--max-inertial-um", "3")
    assert "compliance to accelerations is stated for three linear axes" in said.stderr


@pytest.mark.slow
def test_a_log_of_axis_values_is_compared_by_its_tips(tmp_path: Path) -> None:
    """The way on that the refusal of --positions names: a log of the nominal positions shows the errors."""
    machine = FOLDER / "trunnion-mill" / "machine.toml"
    (tmp_path / "part.nc").write_text(PART)
    refused = run("compare", tmp_path / "part.nc", tmp_path / "log.csv", "-m", machine, "--positions", "axes")
    assert "olp simulate LOG.csv" in refused.stderr
    (tmp_path / "log.csv").write_text(
        "X_mm,Y_mm,Z_mm,A_deg,C_deg\n0,0,-90,0,0\n9,0,-120,0,0\n5,5,-120,-10,40\n0,0,-120,0,0\n"
    )
    for source in ("part.nc", "log.csv"):
        done = run("simulate", tmp_path / source, "-m", machine, "-o", tmp_path / f"{source}.tips.csv", "-q")
        assert done.exit_code == 0, done.output
    most = [
        json.loads(run("compare", tmp_path / "part.nc", tips, "-m", machine, "--json").stdout)["after"]
        for tips in (tmp_path / "part.nc.tips.csv", tmp_path / "log.csv.tips.csv")
    ]
    assert most[0]["across_um"]["max"] == pytest.approx(most[1]["across_um"]["max"], rel=0.05)


def test_data_of_robots_are_partners_by_their_names() -> None:
    """Targets that stand before all moves, with one more that a correction inserts."""
    nominal = ["p0:=[1.5,-2];", "p1:=[3,4];", "p2:=[5,6];"]
    corrected = ["p0:=[1.49,-2.01];", "p1:=[3.01,4];", "p1_olp1:=[3,4];", "p2:=[5,6.02];"]
    pairs = list(_between(nominal, corrected, (0, 3), (0, 4)))
    assert pairs == [(0, 0), (1, 1), (None, 2), (2, 3)]
