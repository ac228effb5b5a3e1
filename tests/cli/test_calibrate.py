"""The verbs of measured lines, circles, diagonals and postures on the files that the project ships; their
plots and reports."""

from __future__ import annotations

import json
import math
import re
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import olp
from olp.calibration.iso230.evaluation import evaluate_all
from olp.calibration.observations.squareness import SquarenessReading
from olp.cli import main
from olp.cli.common import note_of_use
from olp.core.errors import ConfigError
from olp.files.measurements.reader import load_measurements
from olp.findings.catalogue import RULES
from olp.reports.plots import calibration as plots_calibration

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
LINES, CHECKS = PROGRAMS / "gantry-lines", PROGRAMS / "gantry-checks"
#: of gantry-plate/calibration.toml: what the simulated instruments saw
LOST_UM = {"EXX": 6.0, "EYY": 0.0, "EZZ": 0.0}


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["calibrate", *map(str, arguments)])


def good(*arguments: object) -> str:
    result = call(*arguments)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_evaluate_says_what_a_metrologist_asks() -> None:
    text = good("evaluate", LINES)
    assert "EXX  positioning" in text and "EBX  pitch" in text and "EBY  roll" in text
    assert "EZX  straightness in Z, vertical" in text
    assert "OLP859" in text and "ezx.csv" in text


@pytest.mark.slow
def test_report_and_plots_of_an_evaluation(tmp_path: Path) -> None:
    files = sorted(CHECKS.glob("go-return-*.csv"))
    good("evaluate", *files, "--report", tmp_path / "r.html", "--plot", tmp_path / "line.svg")
    assert_page(tmp_path / "r.html", 4)
    drawn = sorted(p.name for p in tmp_path.glob("line-*.svg"))
    assert drawn == [*(f"line-positioning-E{a}{a}.svg" for a in "XYZ"), "line-reversal.svg"]
    assert (tmp_path / "line-reversal.svg").read_text("utf-8").startswith("<svg")
    again = call("evaluate", *files, "--report", tmp_path / "r.html")
    assert again.exit_code == 2 and "--force" in again.stderr


def assert_page(path: Path, plots: int) -> None:
    """So many plots, and nothing that asks the network."""
    page = path.read_text("utf-8")
    assert page.count("<svg") == plots
    assert "&lt;svg" not in page
    hosts = set(re.findall(r"https?://([\w.]+)", page))
    assert hosts <= {"www.w3.org", "purl.org", "creativecommons.org", "matplotlib.org"}


@pytest.mark.slow
def test_pages_of_all_lines(tmp_path: Path) -> None:
    good("evaluate", LINES, "--report", tmp_path / "r.html")
    # positioning, straightness and angles of three axes; three pairs; reversal
    assert_page(tmp_path / "r.html", 13)
    page, target = tmp_path / "f.html", tmp_path / "calibration.toml"
    good("fit", LINES, "-m", LINES / "machine.toml", "-o", target, "--report", page, "-q")
    assert_page(page, 16)
    assert target.is_file()
    for words in ("Errors found", "OLP802", "Datum", "half reversal", "EXX", "standard uncertainty"):
        assert words in page.read_text("utf-8")


def test_evaluate_as_json_and_markdown(tmp_path: Path) -> None:
    report = json.loads(good("evaluate", LINES, "--json", "--report", tmp_path / "r.md"))
    assert report["schema"] == "olp-evaluation-1"
    [exx] = [row for row in report["lines"] if row["component"] == "EXX"]
    assert exx["E_um"] > exx["M_um"] > exx["B_um"] > 0
    assert exx["runs"] == 5 and len(exx["targets"]["target_mm"]) == 17
    lost = {row["component"]: row["lost_motion_um"] for row in report["reversals"] if "lost_motion_um" in row}
    for name, value in LOST_UM.items():
        assert lost[name] == pytest.approx(value, abs=0.5)
    angles = {row["component"]: row["value_urad"] for row in report["squareness"]}
    assert set(angles) == {"C0Y", "B0Z", "A0Z"}
    assert "EXX" in (tmp_path / "r.md").read_text("utf-8")
    assert json.loads(json.dumps(report)) == report


def test_fail_on_and_plots_of_no_kind(tmp_path: Path) -> None:
    assert call("evaluate", LINES, "--fail-on", "warning").exit_code == 1
    wrong = call("evaluate", LINES, "--plot", tmp_path / "x.pdf")
    assert wrong.exit_code == 2 and "expected .svg or .png" in wrong.stderr


def test_an_incomplete_line_is_told_and_the_others_are_evaluated(tmp_path: Path) -> None:
    text = (CHECKS / "go-return-x.csv").read_text("utf-8").splitlines()
    (tmp_path / "x.csv").write_text("\n".join(text[:-1]) + "\n", "utf-8")
    (tmp_path / "y.csv").write_text((CHECKS / "go-return-y.csv").read_text("utf-8"), "utf-8")
    shown = good("evaluate", tmp_path)
    assert "OLP858" in shown and "EYY" in shown
    alone = call("evaluate", tmp_path / "x.csv")
    assert alone.exit_code == 3 and "as many at every target" in alone.stderr


def test_a_period_that_the_targets_miss_is_flagged_never_fitted(tmp_path: Path) -> None:
    """The bar: a cyclic error sampled at a multiple of its pitch."""
    head = (
        '# component = "EXX"\n# machine = "m"\n# measured = 2026-01-01\n# temperature_degC = 20\n'
        '# sense = "actual-minus-commanded"\n# line_mm = { Y = 0, Z = 0 }\n# tool_mm = [0, 0, 0]\n'
        "# period_mm = [10.0]\ntarget_mm,run,direction,value_um\n"
    )
    rows = [
        f"{50 * k},{run},{d},{3.0 + 0.01 * k + 0.1 * run * d}"
        for run in range(1, 6)
        for d in (1, -1)
        for k in range(21)
    ]
    (tmp_path / "x.csv").write_text(head + "\n".join(rows) + "\n", "utf-8")
    report = json.loads(good("evaluate", tmp_path, "--json"))
    assert report["cyclic"][0]["cyclic"] == []
    assert [row["period_mm"] for row in report["cyclic"][0]["not_seen"]] == [10.0, 5.0]
    assert "OLP853" in {f["code"] for f in report["findings"]}


def test_a_fine_sweep_beside_an_aliased_line_is_used(tmp_path: Path) -> None:
    """Targets at 50 mm miss a screw of 10 mm pitch; 20 mm in steps of 1 mm, a file of its own, see it."""
    head = (
        '# component = "EXX"\n# machine = "m"\n# measured = 2026-01-01\n# temperature_degC = 20\n'
        '# sense = "actual-minus-commanded"\n# line_mm = { Y = 0, Z = 0 }\n# tool_mm = [0, 0, 0]\n'
        "# period_mm = [10.0]\ntarget_mm,run,direction,value_um\n"
    )

    def rows(positions: list[float], runs: int) -> str:
        return "".join(
            f"{q},{run},{d},{4.0 * math.sin(math.tau * q / 10.0 + 0.5) + q / 100.0 + 0.1 * (run % 2):.4f}\n"
            for run in range(1, runs + 1)
            for d in (1, -1)
            for q in positions[::d]
        )

    (tmp_path / "x.csv").write_text(head + rows([50.0 * k for k in range(21)], 5), "utf-8")
    (tmp_path / "sweep.csv").write_text(head + rows([300.0 + k for k in range(21)], 2), "utf-8")
    report = json.loads(good("evaluate", tmp_path, "--json"))
    assert [Path(row["file"]).name for row in report["sweeps"]] == ["sweep.csv"]
    [part] = report["cyclic"]
    assert part["not_seen"] == []
    assert part["cyclic"][0]["amplitude_um"] == pytest.approx(4.0, abs=0.05)
    assert part["cyclic"][0]["phase_rad"] == pytest.approx(0.5, abs=0.02)


@pytest.mark.slow
def test_ballbar(tmp_path: Path) -> None:
    target = tmp_path / "s.toml"
    text = good("ballbar", CHECKS / "ballbar-xy.csv", "-o", target, "--plot", tmp_path / "c.svg")
    assert re.search(r"backlash X\s+um\s+5\.9|backlash X.*6\.0", text)
    [table] = tomllib.loads(target.read_text("utf-8"))["squareness"]
    assert table["value_urad"] == pytest.approx(lean_of_plane(0, 1), abs=6.0)
    assert (tmp_path / "c-XY.svg").is_file()
    rows = (CHECKS / "ballbar-xy.csv").read_text("utf-8").splitlines()
    one = [row for row in rows if not re.fullmatch(r"\d+,\d,-1,.*", row)]
    (tmp_path / "one.csv").write_text("\n".join(one) + "\n", "utf-8")
    report = json.loads(good("ballbar", tmp_path / "one.csv", "--json"))
    assert "C0Y" not in {row["name"] for row in report["circles"][0]["found"]}
    assert "OLP856" in {f["code"] for f in report["findings"]}


def lean_of_plane(i: int, j: int) -> float:
    """C0Y of the mean lines through the centre over the circle's diameter, from the error model."""
    slopes = []
    for moving, seen in ((i, j), (j, i)):
        position_mm = [800.0, 500.0, -220.0]
        ends = []
        for step in (-106.0, 106.0):
            place = list(position_mm)
            place[moving] += step
            error = olp.error_at(PROGRAMS / "gantry-plate" / "machine.toml", tuple(place), (0.0, 0.0, -85.0))
            ends.append(error["error_um"][seen])
        slopes.append((ends[1] - ends[0]) / 212.0 * 1e3)
    return -sum(slopes)


def test_diagonals(tmp_path: Path) -> None:
    files = sorted(CHECKS.glob("diagonal-*.csv"))
    report = json.loads(good("diagonals", *files, "--json", "-o", tmp_path / "d.toml"))
    assert report["not_determined"] == ["SX", "SY", "SZ"]
    assert [row["name"] for row in report["found"]] == ["C0Y", "B0Z", "A0Z"]
    assert len(tomllib.loads((tmp_path / "d.toml").read_text("utf-8"))["squareness"]) == 3
    known = json.loads(good("diagonals", *files, "--known", "SX=37,1", "--known", "SY=-31,1", "--json"))
    assert known["not_determined"] == []
    wrong = call("diagonals", *files, "--known", "SX=37")
    assert wrong.exit_code == 2 and "SX=12.5,0.5" in wrong.stderr


@pytest.mark.slow
def test_squareness_of_a_check_goes_into_a_fit(tmp_path: Path) -> None:
    """What ballbar and diagonals write is a part of a plan that the fit takes."""
    folder = tmp_path / "lines"
    folder.mkdir()
    for path in LINES.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    good("ballbar", CHECKS / "ballbar-xy.csv", "-o", tmp_path / "s.toml")
    plan = folder / "measurements.toml"
    plan.write_text(plan.read_text("utf-8") + "\n" + (tmp_path / "s.toml").read_text("utf-8"), "utf-8")
    measurements = load_measurements([folder])
    assert [reading.component for reading in measurements.of(SquarenessReading)] == ["C0Y"]
    both = olp.fit_calibration(folder, folder / "machine.toml")
    alone = olp.fit_calibration(LINES, LINES / "machine.toml")
    sigma = [
        next(row["sigma_urad"] for row in fitted.report["squareness"] if row["name"] == "C0Y")
        for fitted in (both, alone)
    ]
    assert sigma[0] < 0.5 * sigma[1]


@pytest.mark.slow
def test_go_return(tmp_path: Path) -> None:
    target = tmp_path / "b.toml"
    good("go-return", *sorted(CHECKS.glob("go-return-*.csv")), "-o", target, "--plot", tmp_path / "b.svg")
    backlash = tomllib.loads(target.read_text("utf-8"))["backlash"]
    assert backlash["X_um"] == pytest.approx(6.0, abs=0.4)
    assert backlash["Y_um"] == pytest.approx(0.0, abs=0.4)
    assert (tmp_path / "b-reversal.svg").is_file()
    program = tmp_path / "test.ngc"
    good("go-return", "-m", LINES / "machine.toml", "--axis", "X", "--program", program)
    assert program.read_text("utf-8").count("G4 P2") == 100
    assert call("go-return").exit_code == 2


def test_postures(tmp_path: Path) -> None:
    machine = PROGRAMS / "gantry-plate" / "machine.toml"
    raw = json.loads(good("postures", CHECKS / "postures.csv", "--json"))
    known = json.loads(good("postures", CHECKS / "postures.csv", "-m", machine, "--json"))
    truth = {"2": (14.0, -6.0, 9.0), "3": (-3.0, 11.0, 5.0)}

    def miss(report: dict) -> float:  # type: ignore[type-arg]
        return max(
            abs(e - t)
            for row in report["tools"]
            for e, t in zip(row["error_um"], truth[row["name"]], strict=True)
        )

    assert miss(known) < 4.0
    assert miss(known) < miss(raw)
    program = tmp_path / "a.ngc"
    good("postures", "--program", program, "--tools", "1,2", "--point", "10,20,-30")
    assert olp.inspect(program, machine)["tools"] == [1, 2]


def test_squareness_in_all_conventions() -> None:
    report = json.loads(good("squareness", "C0Y=12", "B0Z=5", "--from", "acute", "--json"))
    rows = {row["name"]: row for row in report["conventions"]}
    assert rows["iso"]["C0Y_urad"] == -12 and rows["iso"]["B0Z_urad"] == 5
    assert rows["obtuse"]["B0Z_urad"] == -5
    framed = json.loads(good("squareness", "--drawn-frame", "C0Y=140.4,142.8,99.8", "--json"))
    assert framed["conventions"][3]["C0Y_urad"] == pytest.approx(-16950.7368, abs=1e-3)
    assert call("squareness", "C0Y").exit_code == 2


@pytest.mark.slow
def test_the_same_readings_give_the_same_plots() -> None:
    evaluated = evaluate_all(load_measurements([LINES]))
    [one] = evaluated.of("EXX")
    assert plots_calibration.positioning(one) == plots_calibration.positioning(one)
    assert plots_calibration.positioning(one, "png").startswith(b"\x89PNG")
    [pair, _, _] = evaluated.pairs
    assert b"urad" in plots_calibration.squareness(pair)
    [eyx] = evaluated.of("EYX")
    assert b"horizontal" in plots_calibration.straightness([eyx])


def test_names_of_turns_follow_the_axis() -> None:
    names = {
        "EAX": "roll", "EBX": "pitch", "ECX": "yaw", "EAY": "pitch", "EBY": "roll", "ECY": "yaw",
        "ECZ": "roll", "EAZ": "tilt about X",
    }  # fmt: skip
    assert {component: plots_calibration.name_of_turn(component) for component in names} == names


def test_public_functions_take_files(tmp_path: Path) -> None:
    assert len(olp.evaluate_lines([LINES]).evaluations) == 19
    assert len(olp.fit_ballbar([CHECKS / "ballbar-xy.csv"])) == 1
    assert olp.fit_diagonals(sorted(CHECKS.glob("diagonal-*.csv"))).determined == {"C0Y", "B0Z", "A0Z"}
    head = '# component = "EAX"\n# machine = "m"\n# measured = 2026-01-01\n# temperature_degC = 20\n'
    head += '# sense = "actual-minus-commanded"\ntarget_mm,run,direction,value_urad\n'
    (tmp_path / "eax.csv").write_text(head + "0,1,1,0\n1,1,1,2\n", "utf-8")
    with pytest.raises(ConfigError, match="no line of positioning"):
        olp.go_return([tmp_path / "eax.csv"])


@pytest.mark.parametrize("code", [f"OLP{n}" for n in range(851, 860)])
def test_every_code_is_explained(code: str) -> None:
    assert RULES[code].why and RULES[code].remedy and RULES[code].example


@pytest.mark.parametrize(("stated", "said"), [
    ("", 'no calibration; to use {new}, add before its first table the line calibration = "../new.toml"'),
    ('calibration = "old.toml"', 'names calibration = "old.toml"; to use {new}, write there instead'),
    ('calibration = "../new.toml"', ""),
])  # fmt: skip
def test_what_puts_a_calibration_into_use_is_said(
    tmp_path: Path, stated: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    machine, new = tmp_path / "mill" / "machine.toml", tmp_path / "new.toml"
    machine.parent.mkdir()
    machine.write_text(f'name = "mill"\n{stated}\n[axes.X]\n')
    note_of_use(str(machine), str(new))
    told = capsys.readouterr().err
    assert said.format(new=new) in told and bool(told) == bool(said)
