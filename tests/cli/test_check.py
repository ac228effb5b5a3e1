"""`olp check`: what goes where, exit codes, and the forms that pipelines read."""

from __future__ import annotations

import csv
import io
import json
import shutil
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from cases.fast import some_fast
from cases.gate import CASES, TOUCH, Call, box, clamp, tool
from cli.test_cli import run
from click.testing import Result

import olp
from olp.findings.catalogue import GATE_CODES, RULES

FORMS = ("text", "json", "sarif", "junit")
#: an error with a line, one with many, a warning without any, an information
SEVERAL = Call(
    b"G1 X100\nG1 X1999\nG1 X100\nG1 X1999 ; <&\"'\n", swap=box(1900.0),
    options={"date": None}, tables=TOUCH, increment_mm=0.01,
)  # fmt: skip


def written(folder: Path, call: Call) -> tuple[Path, ...]:
    """The files of a call, and its program, as options of the command line."""
    path = call.machine(folder)
    (folder / "a part.nc").write_bytes(call.program())
    return folder / "a part.nc", path, path.with_name("job.toml")


def checked(folder: Path, call: Call, *args: str | Path) -> Result:
    program, machine, job = written(folder, call)
    return run("check", program, "-m", machine, "-j", job, *args)


def test_a_job_that_may_go_and_one_that_may_not(tmp_path: Path) -> None:
    good = checked(tmp_path / "good", Call(), "--date", "2026-11-21")
    assert good.exit_code == 0
    assert good.stdout.splitlines()[-1] == "Go: no finding at or above error."
    bad = checked(tmp_path / "bad", SEVERAL)
    assert bad.exit_code == 1
    assert bad.stdout.splitlines()[-1].startswith("NO GO: 1 of ")
    assert max(map(len, bad.stdout.splitlines())) <= 100
    assert bad.stderr == ""


@pytest.mark.parametrize(("args", "code"), [
    (["--fail-on", "never"], 0),
    (["--fail-on", "warning", "--ignore", "OLP405"], 1),
    (["--ignore", "OLP405"], 0),
    (["--select", "OLP405,OLP1"], 1),
    (["--select", "OLP411", "--select", "OLP1"], 0),
    (["--select", "XYZ"], 2),
])  # fmt: skip
def test_the_exit_code_follows_codes_and_severity(tmp_path: Path, args: list[str], code: int) -> None:
    for form in FORMS:
        assert checked(tmp_path / form, SEVERAL, *args, "--format", form).exit_code == code


def test_json_is_the_report_of_the_library(tmp_path: Path) -> None:
    program, machine, job = written(tmp_path, SEVERAL)
    report = json.loads(run("check", program, "-m", machine, "-j", job, "--format", "json").stdout)
    again = olp.check(str(program), machine, job).report
    assert report["findings"] == json.loads(json.dumps(again["findings"]))
    assert (report["schema"], report["rules"]) == ("olp-check-1", list(GATE_CODES))


def test_json_is_one_of_the_forms_and_excludes_the_others(tmp_path: Path) -> None:
    short = checked(tmp_path / "a", SEVERAL, "--json")
    assert short.exit_code == 1
    named = checked(tmp_path / "a", SEVERAL, "--format", "json")
    assert json.loads(short.stdout) == json.loads(named.stdout)
    refused = checked(tmp_path / "c", SEVERAL, "--json", "--format", "sarif")
    assert refused.exit_code == 2
    assert "exclude each other" in refused.stderr


def test_quiet_is_the_exit_code_alone(tmp_path: Path) -> None:
    quiet = checked(tmp_path / "a", SEVERAL, "-q")
    assert (quiet.exit_code, quiet.stdout, quiet.stderr) == (1, "", "")
    program, machine, job = written(tmp_path / "b", Call())
    proved = run("verify", program, program, "-m", machine, "-j", job, "-q", "--tolerance-um", "1000")
    assert (proved.exit_code, proved.stdout, proved.stderr) == (0, "", "")
    moved = tmp_path / "moved.nc"
    moved.write_bytes(program.read_bytes().replace(b"X100", b"X101"))
    above = run("verify", program, moved, "-m", machine, "-j", job, "-q")
    assert (above.exit_code, above.stdout, above.stderr) == (1, "", "")
    assert run("verify", program, program, "-m", machine, "-j", job).stdout
    simulated = run("simulate", program, "-m", machine, "-j", job, "-o", tmp_path / "m.csv", "-q")
    assert (simulated.exit_code, simulated.stdout, simulated.stderr) == (0, "", "")


def sarif(text: str) -> dict[str, Any]:
    """A log as SARIF's object model reads it."""
    model = pytest.importorskip("sarif_pydantic")
    model.Sarif.model_validate_json(text)
    return json.loads(text)


@pytest.mark.slow
def test_sarif_holds_rules_places_and_levels(tmp_path: Path) -> None:
    log = sarif(checked(tmp_path, SEVERAL, "--format", "sarif").stdout)
    assert log["version"] == "2.1.0"
    (sarif_run,) = log["runs"]
    rules = sarif_run["tool"]["driver"]["rules"]
    assert [r["id"] for r in rules] == list(GATE_CODES)
    assert all(
        r["help"]["text"] and r["shortDescription"]["text"] and r["fullDescription"]["text"] for r in rules
    )
    results = {r["ruleId"]: r for r in sarif_run["results"]}
    for code, result in results.items():
        assert rules[result["ruleIndex"]]["id"] == code
        assert result["level"] == {0: "note", 1: "warning", 2: "error"}[RULES[code].severity]
    place = results["OLP405"]["locations"][0]["physicalLocation"]
    assert place["region"] == {"startLine": 5}
    assert place["artifactLocation"]["uri"] == (tmp_path / "a part.nc").as_uri()
    others = [p["physicalLocation"]["region"]["startLine"] for p in results["OLP405"]["relatedLocations"]]
    assert others == [7]
    assert "region" not in results["OLP411"]["locations"][0]["physicalLocation"]
    assert sarif_run["invocations"] == [{"executionSuccessful": True, "exitCode": 1}]


def test_a_relative_program_is_a_relative_uri(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path, SEVERAL)
    monkeypatch.chdir(tmp_path)
    log = sarif(run("check", "a part.nc", "-m", "machine.toml", "--format", "sarif").stdout)
    place = log["runs"][0]["results"][0]["locations"][0]["physicalLocation"]
    assert place["artifactLocation"]["uri"] == "a%20part.nc"


def test_junit_has_a_test_for_each_code(tmp_path: Path) -> None:
    parser = pytest.importorskip("junitparser")
    text = checked(tmp_path, SEVERAL, "--format", "junit", "--date", "2026-11-21").stdout
    (suite,) = parser.JUnitXml.fromstring(text.encode())
    assert (suite.tests, suite.failures, suite.errors) == (len(GATE_CODES), 1, 0)
    assert suite.timestamp == "2026-11-21T00:00:00"
    cases = {case.name.split()[0]: case for case in suite}
    assert list(cases) == list(GATE_CODES)
    assert {code for code, case in cases.items() if not case.is_passed} == {"OLP405"}
    (failure,) = cases["OLP405"].result
    assert failure.type == "OLP405"
    assert "a part.nc:5: error: OLP405" in failure.message
    assert "OLP411" in (ElementTree.fromstring(text).findtext("testsuite/system-out") or "")
    stricter = checked(tmp_path / "b", SEVERAL, "--format", "junit", "--fail-on", "warning").stdout
    (suite,) = parser.JUnitXml.fromstring(stricter.encode())
    assert suite.failures > 1


@pytest.mark.parametrize("code", some_fast(CASES, 3))
def test_every_finding_goes_into_every_form(code: str, tmp_path: Path) -> None:
    """Whatever a message holds, the forms stay what they are."""
    from olp.reports.check import FORMATS

    report = CASES[code][0].run(tmp_path).report
    assert code in FORMATS["text"](report, "info")
    assert code in {f["code"] for f in json.loads(FORMATS["json"](report, "info"))["findings"]}
    assert code in {r["ruleId"] for r in sarif(FORMATS["sarif"](report, "info"))["runs"][0]["results"]}
    root = ElementTree.fromstring(FORMATS["junit"](report, "info"))
    assert code in {failure.get("type") for failure in root.iter("failure")}


def test_output_files_are_written_whole_and_never_over_others(tmp_path: Path) -> None:
    program, machine, job = written(tmp_path, Call(**clamp(5.0), tables=tool(50.0)))
    target, table = tmp_path / "check.sarif", tmp_path / "clear.csv"
    words = [
        "check",
        program,
        "-m",
        machine,
        "-j",
        job,
        "--format",
        "sarif",
        "-o",
        target,
        "--clearances",
        table,
    ]
    assert run(*words).exit_code == 1
    sarif(target.read_text())
    rows = list(csv.DictReader(io.StringIO(table.read_text())))
    assert [float(rows[-1][k]) for k in ("line", "clearance_mm")] == [4, 0]
    assert run(*words).exit_code == 2
    assert run(*words, "--force").exit_code == 1
    assert run(*words[:-4], "-o", program, "--force").exit_code == 2
    assert run(*words[:-4], "-o", tmp_path / "clamp.stl", "--force").exit_code == 2
    assert run("check", program, "-m", machine, "--clearances", table, "--force").exit_code == 2


def test_programs_come_from_stdin_as_well(tmp_path: Path) -> None:
    program, machine, _ = written(tmp_path, Call())
    text = program.read_bytes()
    alone = run("check", "-", "-m", machine, "--format", "json", stdin=text)
    assert json.loads(alone.stdout)["program"]["name"] == ""
    pair = run("check", program, "-m", machine, "--nominal", "-", stdin=text)
    assert "against the nominal one" in pair.stdout
    assert run("check", "-", "-m", machine, "--nominal", "-", stdin=text).exit_code == 2
    wrong = run("check", "-", "-m", machine, stdin=b"G5 X1\n")
    assert wrong.exit_code == 3
    assert wrong.stderr.startswith("olp: error: <stdin>:1: ")


@pytest.mark.slow
def test_the_gate_passes_what_correct_wrote(tmp_path: Path) -> None:
    folder = tmp_path / "mill"
    shutil.copytree(Path(__file__).parents[2] / "programs" / "haas-mill", folder)
    job = ("-j", folder / "job.toml")
    assert run("correct", *job, "-q", "-o", folder / "out.nc").exit_code == 0
    pair = run("check", folder / "out.nc", *job, "--nominal", folder / "bracket.nc")
    assert pair.exit_code == 0, pair.stdout
    assert run("check", folder / "out.nc", *job).exit_code == 0
    raw = run("check", folder / "bracket.nc", *job, "--nominal", folder / "bracket.nc", "--select", "OLP101")
    assert raw.exit_code == 1
