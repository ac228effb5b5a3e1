"""What the verbs say of a program that is refused for several reasons: all of them, in every form."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest
from cli.test_cli import PROGRAMS, run
from click.testing import Result

import olp
from olp.core.errors import Refused
from olp.findings.catalogue import RULES

MACHINE = PROGRAMS / "haas-mill" / "machine.toml"
HEAD = b"%\nG21 G90 G54 G17\nT1 M6\nG0 X0. Y0. Z20.\n"
PART = HEAD + b"G68.2 R30.\n&X1,5\nT77 M6\n" + b"G12 D2.\n" * 40 + b"M30\n%\n"


@pytest.fixture
def part(tmp_path: Path) -> Path:
    (tmp_path / "part.nc").write_bytes(PART)
    return tmp_path / "part.nc"


def of(verb: str, part: Path, *args: str) -> Result:
    return run(verb, part, "-m", MACHINE, *args)


@pytest.mark.parametrize("verb", ["inspect", "check"])
def test_all_reasons_are_listed(part: Path, verb: str) -> None:
    result = of(verb, part)
    assert result.exit_code == 3
    report = json.loads(of(verb, part, "--json").stdout)
    rows = report["refused"]
    assert [row["line"] for row in rows] == [5, 6, 7, *range(8, 48)]
    assert report["refused_complete"]
    assert rows[2] == {
        "line": 7, "code": "OLP521", "statement": "T77 M6", "follows": None,
        "message": "M6 uses tool 77, which is not defined; give [tools.77] in the machine or job file",
        "remedy": RULES["OLP521"].remedy,
    }  # fmt: skip
    assert {finding["severity"] for finding in report["findings"]} == {"error"}
    # forty blocks of one kind are one finding
    assert [(f["code"], f["line"], f["count"]) for f in report["findings"]] == [
        ("OLP512", 5, 1), ("OLP510", 6, 1), ("OLP521", 7, 1), ("OLP512", 8, 40),
    ]  # fmt: skip
    assert "Refused (43), explained by olp explain CODE" in result.stdout
    assert "line 7: `T77 M6`: M6 uses tool 77" in result.stdout
    assert "What to do: Give [tools.N]" in result.stdout
    assert "and 22 others" in result.stdout
    assert max(map(len, result.stdout.splitlines())) <= 100
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"olp: error: {part}:5: G68.2 (tilted plane)")
    assert "43 statements are refused in all" in line


def test_correct_refuses_with_the_first_twenty(part: Path) -> None:
    result = of("correct", part)
    assert result.exit_code == 3
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert len(lines) == 21
    assert lines[2].startswith(f"olp: error: {part}:7: M6 uses tool 77")
    # the first one says itself what to do
    assert lines[0].endswith("; post the program without it")
    assert lines[-1] == f"olp: error: {part}: 23 more statements are refused; olp inspect lists them"
    assert sorted(part.parent.iterdir()) == [part]


def test_from_python_the_error_has_the_reasons(part: Path) -> None:
    for verb in (olp.inspect, olp.check, olp.correct):
        with pytest.raises(Refused) as caught:
            verb(part, MACHINE)  # type: ignore[operator]
        assert len(caught.value.reasons) == 43
        assert caught.value.code == "OLP512"


def test_pipelines_get_the_reasons(part: Path) -> None:
    sarif = json.loads(of("check", part, "--format", "sarif").stdout)["runs"][0]
    assert [r["ruleId"] for r in sarif["results"]] == ["OLP512", "OLP510", "OLP521", "OLP512"]
    assert {r["level"] for r in sarif["results"]} == {"error"}
    assert all(
        sarif["tool"]["driver"]["rules"][r["ruleIndex"]]["id"] == r["ruleId"] for r in sarif["results"]
    )
    assert sarif["invocations"] == [{"executionSuccessful": False, "exitCode": 3}]
    junit = ElementTree.fromstring(of("check", part, "--format", "junit").stdout)
    assert {f.get("type") for f in junit.iter("failure")} == {"OLP510", "OLP512", "OLP521"}


def test_a_refused_program_is_no_go_whatever_is_selected(part: Path) -> None:
    for args in (["--select", "OLP1"], ["--fail-on", "never"], ["--ignore", "OLP4"]):
        result = of("check", part, *args)
        assert result.exit_code == 3
        assert result.stdout.splitlines()[-1].startswith("NO GO: ")


def test_a_code_of_a_refusal_is_explained() -> None:
    assert "What to do" in run("explain", "OLP521").stdout
