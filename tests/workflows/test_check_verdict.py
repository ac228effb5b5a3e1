"""The verdict of `olp check` is that of its findings, in every form, with the lines of the program."""

from __future__ import annotations

import datetime
import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from cases.gate import ARC, HEAD, OVER, Call, box, clamp, scaled, tool

import olp
from olp.findings.rule import Severity
from olp.reports.check import FORMATS, failures

EXPIRED = {"date": datetime.date(2100, 1, 1)}
ABOVE = {"body": b"G1 X100.002\n", "nominal": b"G1 X100\n"}

CASES: dict[str, tuple[Call, bool]] = {
    "good": (Call(**scaled(10.0)), True),
    "outside the box": (Call(ARC, swap=box(109.999)), False),
    "outside the box, a pair": (Call(ARC, nominal=ARC, swap=box(109.999)), False),
    "outside the box, held": (Call(ARC, swap=box(109.999), options={"outside_box": "hold"}), True),
    "a collision": (Call(OVER, tables=tool(50.0), **clamp(15.0)), False),
    "a collision, left out": (
        Call(OVER, tables=tool(50.0), options={"ignore": ("OLP7",)}, **clamp(15.0)), True),
    "a doubt": (Call(options=EXPIRED, **scaled(10.0)), False),
    "a doubt, left out": (Call(options=EXPIRED | {"ignore": ("OLP401",)}, **scaled(10.0)), True),
    "a doubt, accepted": (Call(options=EXPIRED | {"accept": ("OLP401",)}, **scaled(10.0)), True),
    "above tolerance": (Call(**ABOVE), False),
    "above tolerance, left out": (Call(options={"ignore": ("OLP101",)}, **ABOVE), True),
    "corrected by the control": (Call(keys='compensated_by_controller = "all"\n'), False),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_verdict_exit_code_and_all_forms_say_the_same(name: str, tmp_path: Path) -> None:
    call, good = CASES[name]
    report = call.run(tmp_path).report
    verdict = report["verdict"]
    errors = {f["code"] for f in report["findings"] if f["severity"] == "error"}
    assert verdict["ok"] is good is not bool(failures(report, "error")), report["findings"]
    assert set(verdict["errors"]) == errors - {"OLP101", "OLP108"}
    assert json.loads(FORMATS["json"](report, "error"))["verdict"] == verdict
    (run,) = json.loads(FORMATS["sarif"](report, "error"))["runs"]
    assert run["properties"]["verdict"] == verdict
    assert run["invocations"][0]["exitCode"] == int(not good)
    suite = ElementTree.fromstring(FORMATS["junit"](report, "error")).find("testsuite")
    assert suite is not None
    assert (suite.get("failures") == "0") is good
    assert ("NO GO" in FORMATS["text"](report, "error")) is not good


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    report = CASES["above tolerance, left out"][0].run(tmp_path).report
    assert report["verdict"]["numerical"]["holds"] is False
    assert report["verdict"]["sentences"][-1] == "OLP101 is left out, so that does not count here."


def test_doubts_about_a_pair_are_said_once_with_the_lines_of_the_program(tmp_path: Path) -> None:
    """The stamp moves all lines of the corrected text by one."""
    call = Call(**scaled(1100.0), swap={"[axes.X]": "[check]\nlargest_correction_um = 1010.0\n[axes.X]"})
    machine = call.machine(tmp_path)
    done = olp.correct(call.program(), machine, accept=["OLP409"])
    (nominal,) = [f for f in done.findings if f.code == "OLP409"]
    assert call.program().split(b"\n")[(nominal.line or 0) - 1] == b"G1 X100"
    for nominal_text in (None, call.program()):
        checked = olp.check(done.data, machine, nominal=nominal_text)
        (doubt,) = [f for f in checked.findings if f.code == "OLP409"]
        assert done.data.split(b"\n")[(doubt.line or 0) - 1].startswith(b"G1 X")
        assert (doubt.accepted, doubt.severity) == (True, Severity.WARNING)
        assert checked.report["accepted"] == ["OLP409"]


def test_a_doubt_of_a_line_that_does_not_move_has_no_line(tmp_path: Path) -> None:
    """A length without a decimal point stands in a block that sets an offset."""
    words: dict[str, Any] = {"controller": "fanuc", **scaled(10.0)}
    text = HEAD.replace(b"0 Y0 Z0", b"0. Y0. Z0.").replace(b" G64 P0.0001 Q0", b"")
    call = Call(b"G10 L2 P2 X5\nG1 X100.\n", head=text, **words)
    machine = call.machine(tmp_path)
    done = olp.correct(call.program(), machine)
    assert [f.line for f in done.findings if f.code == "OLP302"] == [4]
    pair = olp.check(done.data, machine, nominal=call.program())
    assert [f.line for f in pair.findings if f.code == "OLP302"] == [None]
