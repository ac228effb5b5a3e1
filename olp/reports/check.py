"""The findings of a gate in the forms that people and pipelines read: text, JSON, SARIF 2.1.0, JUnit XML."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import PurePath
from typing import Any
from urllib.parse import quote
from xml.etree import ElementTree

from olp.core.errors import InputError
from olp.core.version import __version__
from olp.findings.catalogue import GATE_CODES, RULES
from olp.findings.rule import Rule, Severity
from olp.reports import joints, shown
from olp.reports.refusals import refusals_text
from olp.reports.report import (
    Report,
    cell,
    findings_text,
    number,
    pairs,
    place,
    printable,
    table,
    to_json,
    wrapped,
)

#: Level of SARIF by severity.
_LEVEL = {Severity.INFO: "note", Severity.WARNING: "warning", Severity.ERROR: "error"}
_SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
#: Most rows of the table of clearances.
_NEAREST = 8


def to_text(report: Report, fail_on: str) -> str:
    """Plain text of at most 100 columns."""
    sections = (
        _heads(report),
        _clearance(report),
        *(() if report.get("proof") is None else joints.proof_lines(report["proof"])),
        _findings(report),
        _verdict(report, fail_on),
    )
    return "\n\n".join("\n".join(lines) for lines in map(list, sections) if lines) + "\n"


def _findings(report: Report) -> Iterator[str]:
    if report.get("refused"):
        yield from refusals_text(report["refused"], complete=report["refused_complete"])
    else:
        yield from findings_text(report["findings"])


def _heads(report: Report) -> Iterator[str]:
    machine, program = report["machine"], report["program"]
    yield from pairs([
        ("Program", printable(f"{program['name'] or 'stdin'}, {program['lines']} lines")),
        ("Checked", report["checked"]),
        ("Machine", printable("{name}, chain {chain}, control {controller}".format(**machine))),
        ("Codes", "none checked" if report.get("refused") else
         f"{len(report['rules'])} of {len(GATE_CODES)} checked"),
    ])  # fmt: skip


def _clearance(report: Report) -> Iterator[str]:
    blocks = report.get("clearance") or ()
    if not blocks:
        return
    yield shown.title("Least clearance in mm, point in the frame of the mesh")
    rows = [
        [
            place(b), b["part"], printable(b["mesh"]), number(b["clearance_mm"], 3),
            " ".join(number(v, 3) for v in b["point_mm"]),
        ]
        for b in sorted(blocks, key=lambda b: b["clearance_mm"])[:_NEAREST]
    ]  # fmt: skip
    yield from table(["line", "part", "mesh", "clearance", "point"], rows, text_columns=3, unit="mm")


def _verdict(report: Report, fail_on: str) -> Iterator[str]:
    yield from wrapped((report.get("verdict") or {}).get("sentences") or ())
    failing = failures(report, fail_on)
    if report.get("refused"):
        yield "NO GO: the program is refused, so nothing else was checked."
    elif failing:
        yield f"NO GO: {len(failing)} of {len(report['findings'])} findings are at or above {fail_on}."
    else:
        yield "Go: no finding" + ("." if fail_on == "never" else f" at or above {fail_on}.")


def failures(report: Report, fail_on: str) -> list[Mapping[str, Any]]:
    """The findings that fail the gate."""
    if fail_on == "never":
        return []
    least = Severity[fail_on.upper()]
    return [f for f in report["findings"] if Severity[f["severity"].upper()] >= least]


def to_sarif(report: Report, fail_on: str) -> str:
    """SARIF 2.1.0 (OASIS): a run with every rule that was checked. A finding without a line is located at the
    program as a whole; further lines are related locations."""
    rules = [RULES[code] for code in report["rules"]]
    path = report["program"]["path"]
    refused = bool(report.get("refused"))
    run: dict[str, Any] = {
        "tool": {
            "driver": {
                "name": "olp",
                "version": __version__,
                "rules": [_sarif_rule(rule) for rule in rules],
            }
        },
        "columnKind": "unicodeCodePoints",
        # one id a program: services merge or refuse runs of one tool that have the same
        "automationDetails": {"id": f"olp check/{_uri(path)}/"},
        "results": [_sarif_result(f, report["rules"], path) for f in report["findings"]],
        "invocations": [{"executionSuccessful": not refused, "exitCode": _exit_code(report, fail_on)}],
    }
    if report["verdict"] is not None:
        run["properties"] = {"verdict": report["verdict"]}
    return json.dumps({"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]}, indent=2) + "\n"


def _exit_code(report: Report, fail_on: str) -> int:
    """As the command line ends: an input that is refused counts before findings."""
    return InputError.exit_code if report.get("refused") else int(bool(failures(report, fail_on)))


def _sarif_rule(rule: Rule) -> dict[str, Any]:
    return {
        "id": rule.code,
        "name": "".join(word.capitalize() for word in rule.title.replace("-", " ").split()),
        "shortDescription": {"text": rule.title},
        "fullDescription": {"text": rule.why},
        "help": {"text": f"{rule.remedy}\n\nExample: {rule.example}"},
        "defaultConfiguration": {"level": _LEVEL[rule.severity]},
    }


def _sarif_result(finding: Mapping[str, Any], rules: Sequence[str], path: str) -> dict[str, Any]:
    def located(line: int | None, file: str) -> dict[str, Any]:
        region = {} if line is None else {"region": {"startLine": line}}
        return {"physicalLocation": {"artifactLocation": {"uri": _uri(path, file)}, **region}}

    files = finding.get("files") or [""] * len(finding["lines"])
    pairs = list(zip(finding["lines"], files, strict=True))
    related = [{"id": k, **located(*pair)} for k, pair in enumerate(pairs[1:], 1)]
    return {
        "ruleId": finding["code"],
        "ruleIndex": rules.index(finding["code"]),
        "level": _LEVEL[Severity[finding["severity"].upper()]],
        "message": {"text": finding["message"]},
        "locations": [located(finding["line"], finding.get("file", ""))],
        **({"relatedLocations": related} if related else {}),
    }


def _uri(path: str, file: str = "") -> str:
    """The URI reference of a program, or of a file beside it: relative where the program was named so, else
    with the scheme of files."""
    pure = PurePath(path or "stdin")
    pure = pure.with_name(file) if file else pure
    return pure.as_uri() if pure.is_absolute() else quote(os.fsencode(pure.as_posix()))


def to_junit(report: Report, fail_on: str) -> str:
    """JUnit XML as Jenkins, GitLab and others read it: one test per code, failed where a finding fails the
    gate; milder findings go into the output of the suite."""
    failing = {id(f) for f in failures(report, fail_on)}
    name = report["program"]["name"] or "stdin"
    failed = {f["code"] for f in report["findings"] if id(f) in failing}
    suite = ElementTree.Element(
        "testsuite", name="olp check", package="olp", id="0", hostname="localhost",
        timestamp=f"{report['date'] or '1970-01-01'}T00:00:00", tests=str(len(report["rules"])),
        failures=str(len(failed)), errors="0", time="0",
    )  # fmt: skip
    properties = ElementTree.SubElement(suite, "properties")
    for number_of, sentence in enumerate((report["verdict"] or {}).get("sentences", ()), 1):
        ElementTree.SubElement(properties, "property", name=f"verdict {number_of}", value=printable(sentence))
    mild = []
    for code in report["rules"]:
        case = ElementTree.SubElement(
            suite,
            "testcase",
            name=f"{code} {RULES[code].title}",
            classname=f"olp.check.{printable(name)}",
            time="0",
        )
        findings = [f for f in report["findings"] if f["code"] == code]
        texts = [printable(_sentence(f, name)) for f in findings]
        if code in failed:
            failure = ElementTree.SubElement(case, "failure", type=code, message=texts[0])
            failure.text = "\n".join([*texts, f"What to do: {RULES[code].remedy}"])
        else:
            mild += texts
    ElementTree.SubElement(suite, "system-out").text = "\n".join(mild)
    ElementTree.SubElement(suite, "system-err")
    root = ElementTree.Element("testsuites")
    root.append(suite)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, "unicode") + "\n"


def _sentence(finding: Mapping[str, Any], name: str) -> str:
    name = finding.get("file", name)
    where = name if finding["line"] is None else f"{name}:{finding['line']}"
    return f"{where}: {finding['severity']}: {finding['code']} {finding['message']}"


def to_csv(rows: Iterable[Mapping[str, Any]]) -> bytes:
    """Clearances by block: `line,clearance_mm,part,mesh,role,frame,X_mm,Y_mm,Z_mm`, the point in the named
    frame, and `file` last where lines are of several files."""
    rows = list(rows)
    files = any("file" in row for row in rows)
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(
        ["line", "clearance_mm", "part", "mesh", "role", "frame", "X_mm", "Y_mm", "Z_mm"] + ["file"] * files
    )
    for row in rows:
        names = map(cell, (row["part"], row["mesh"], row["role"], row["frame"]))
        lengths = (f"{v:.6f}" for v in row["point_mm"])
        writer.writerow(
            [
                row["line"],
                f"{row['clearance_mm']:.6f}",
                *names,
                *lengths,
                *[cell(row.get("file", ""))] * files,
            ]
        )
    return buffer.getvalue().encode()


#: Writer of each format, from the report ("olp-check-1") and the severity that fails the gate.
FORMATS: dict[str, Callable[[Report, str], str]] = {
    "text": to_text,
    "json": lambda report, fail_on: to_json(report).decode(),
    "sarif": to_sarif,
    "junit": to_junit,
}
