"""What is said of an unrolled program, in lines of the files that people have.

Inside a run the lines of the program and of the files of its subprograms count through (`Origin`). Reports
and findings name the file of a line beside it where that is not the program's.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from olp.findings.catalogue import Finding
from olp.program.origin import Origin


def placed_findings(findings: Iterable[Finding], origin: Origin | None) -> tuple[Finding, ...]:
    """Findings with the files of their lines."""
    if origin is None:
        return tuple(findings)
    return tuple(_placed_finding(finding, origin) for finding in findings)


def _placed_finding(finding: Finding, origin: Origin) -> Finding:
    own = () if finding.line is None else (finding.line,)
    files, lines = _split(finding.lines or own, origin)
    return replace(finding, line=lines[0] if own else None, lines=tuple(lines), files=tuple(files))


def placed(report: Mapping[str, Any], origin: Origin | None) -> dict[str, Any]:
    """A report, or a part of it, with the file of each line: `file` beside `line`, `worst_file` beside
    `worst_line`, `files` beside a list `lines` ("" for the program)."""
    result: dict[str, Any] = {}
    if origin is None:
        return dict(report)
    for key, value in report.items():
        result[key] = _inside(value, origin)
        if not _of_lines(key):
            continue
        name = key.removesuffix("lines").removesuffix("line")
        if isinstance(value, int) and not key.endswith("lines"):
            files, (result[key],) = _split([value], origin)
            result |= {f"{name}file": files[0]} if files else {}
        elif isinstance(value, list) and all(isinstance(line, int) for line in value):
            files, result[key] = _split(value, origin)
            result |= {f"{name}files": files} if files else {}
    return result


def _of_lines(key: str) -> bool:
    return key in ("line", "lines") or key.endswith(("_line", "_lines"))


def _inside(value: Any, origin: Origin) -> Any:
    if isinstance(value, Mapping):
        return placed(value, origin)
    if isinstance(value, list):
        return [_inside(item, origin) for item in value]
    return value


def _split(lines: Sequence[int], origin: Origin) -> tuple[list[str], list[int]]:
    """The files of lines, none where all are the program's, and the lines in them."""
    pairs = [origin.file_of(line) for line in lines]
    files = ["" if file is None else Path(file).name for file, _ in pairs]
    return files if any(files) else [], [line for _, line in pairs]
