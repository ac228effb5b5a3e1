"""The forms of a gate with hostile names: SARIF, JUnit XML and the table of clearances."""

from __future__ import annotations

import csv
import io
import json
from typing import Any
from xml.etree import ElementTree

import pytest

from olp.findings.catalogue import RULES
from olp.reports.check import FORMATS, to_csv

HOSTILE = "</failure>]]>&\"'<i>\x1b\x00\u2028#?%.nc"
#: The same in one line without control characters.
SAFE = "</failure>]]>&\"'<i>   #?%.nc"


def report(**more: Any) -> dict[str, Any]:
    finding = {
        "code": "OLP101",
        "severity": "error",
        "message": HOSTILE,
        "line": 7,
        "lines": [7, 9],
        "count": 2,
    }
    mild = {"code": "OLP102", "severity": "warning", "message": "m", "line": None, "lines": [], "count": 1}
    return {
        "program": {"name": HOSTILE, "path": HOSTILE, "lines": 9}, "rules": ["OLP101", "OLP102"],
        "findings": [finding, mild], "verdict": {"sentences": [HOSTILE]}, "date": None,
    } | more  # fmt: skip


def test_junit_is_xml_whatever_the_names() -> None:
    root = ElementTree.fromstring(FORMATS["junit"](report(), "error"))
    assert [element.tag for element in root.iter()] == [
        "testsuites", "testsuite", "properties", "property", "testcase", "failure", "testcase", "system-out",
        "system-err",
    ]  # fmt: skip
    (suite,) = root
    assert suite.attrib == {
        "name": "olp check", "package": "olp", "id": "0", "hostname": "localhost",
        "timestamp": "1970-01-01T00:00:00", "tests": "2", "failures": "1", "errors": "0", "time": "0",
    }  # fmt: skip
    assert [p.attrib for p in suite.iter("property")] == [{"name": "verdict 1", "value": SAFE}]
    first, second = suite.iter("testcase")
    assert first.attrib == {
        "name": f"OLP101 {RULES['OLP101'].title}", "classname": f"olp.check.{SAFE}", "time": "0"
    }  # fmt: skip
    assert second.attrib["name"] == f"OLP102 {RULES['OLP102'].title}"
    (failure,) = suite.iter("failure")
    sentence = f"{SAFE}:7: error: OLP101 {SAFE}"
    assert failure.attrib == {"type": "OLP101", "message": sentence}
    assert failure.text == f"{sentence}\nWhat to do: {RULES['OLP101'].remedy}"
    assert suite.findtext("system-out") == f"{SAFE}: warning: OLP102 m"


@pytest.mark.parametrize(("fail_on", "failed"), [("never", 0), ("error", 1), ("warning", 2), ("info", 2)])
def test_what_fails_the_gate_fails_its_test(fail_on: str, failed: int) -> None:
    root = ElementTree.fromstring(FORMATS["junit"](report(), fail_on))
    assert len(list(root.iter("failure"))) == failed
    assert root[0].attrib["failures"] == str(failed)
    log = json.loads(FORMATS["sarif"](report(), fail_on))
    assert log["runs"][0]["invocations"] == [{"executionSuccessful": True, "exitCode": int(failed > 0)}]


def test_sarif_names_the_program_as_a_reference() -> None:
    (run,) = json.loads(FORMATS["sarif"](report(), "error"))["runs"]
    uri = "%3C/failure%3E%5D%5D%3E%26%22%27%3Ci%3E%1B%00%E2%80%A8%23%3F%25.nc"
    whole = {"physicalLocation": {"artifactLocation": {"uri": uri}}}

    def at(line: int) -> dict[str, Any]:
        return {"physicalLocation": whole["physicalLocation"] | {"region": {"startLine": line}}}

    first, second = run["results"]
    assert first == {
        "ruleId": "OLP101", "ruleIndex": 0, "level": "error", "message": {"text": HOSTILE},
        "locations": [at(7)], "relatedLocations": [{"id": 1, **at(9)}],
    }  # fmt: skip
    assert second == {
        "ruleId": "OLP102", "ruleIndex": 1, "level": "warning", "message": {"text": "m"}, "locations": [whole]
    }  # fmt: skip
    assert run["properties"] == {"verdict": {"sentences": [HOSTILE]}}


def test_sarif_names_other_files_beside_the_program() -> None:
    """A program in a folder with an absolute path, and a subprogram beside it."""
    own = {"code": "OLP101", "severity": "error", "message": "m", "line": 7, "lines": [7, 9], "count": 2}
    own |= {"file": "sub 1.nc", "files": ["sub 1.nc", ""]}
    path = {"name": "a.nc", "path": "/parts/a b/a.nc", "lines": 9}
    (run,) = json.loads(FORMATS["sarif"](report(findings=[own], program=path), "error"))["runs"]
    (result,) = run["results"]
    locations = [*result["locations"], *result["relatedLocations"]]
    assert [one["physicalLocation"]["artifactLocation"]["uri"] for one in locations] == [
        "file:///parts/a%20b/sub%201.nc", "file:///parts/a%20b/a.nc"
    ]  # fmt: skip
    none = {"name": "", "path": "", "lines": 9}
    (run,) = json.loads(FORMATS["sarif"](report(program=none), "error"))["runs"]
    assert run["results"][1]["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] == "stdin"


@pytest.mark.parametrize("text", ("=1+1", "+1", "-1", "@a", " =1"))
def test_no_cell_of_a_table_is_a_formula(text: str) -> None:
    row = {"line": 3, "clearance_mm": -0.5, "part": text, "mesh": text, "role": text, "frame": text}
    rows = [row | {"point_mm": (1.0, -2.0, 3.0), "file": text}, row | {"point_mm": (1.0, 2.0, 3.0)}]
    head, first, second = csv.reader(io.StringIO(to_csv(rows).decode()))
    assert head == ["line", "clearance_mm", "part", "mesh", "role", "frame", "X_mm", "Y_mm", "Z_mm", "file"]
    assert first == ["3", "-0.500000", *("'" + text,) * 4, "1.000000", "-2.000000", "3.000000", "'" + text]
    assert second[-1] == ""
    assert to_csv(rows[1:]).decode().splitlines()[0] == ",".join(head[:-1])
