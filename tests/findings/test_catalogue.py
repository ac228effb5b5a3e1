"""Every code is one row, and every row is a code that the program states."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import fields
from pathlib import Path

import pytest

import olp
from olp.findings import codes
from olp.findings.catalogue import GATE_CODES, RULES, Finding, rows
from olp.findings.rule import Rule, Severity

PACKAGE = Path(olp.__file__).parent
TABLES = Path(codes.__path__[0])
CODE = re.compile(r"OLP\d{3}")


def codes_in(source: str) -> Iterator[str]:
    """The codes that a text states whole, as in `Finding("OLP101", ...)`."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and CODE.fullmatch(node.value):
            yield node.value


def repeated(rules: Iterable[Rule]) -> list[str]:
    return [code for code, count in Counter(rule.code for rule in rules).items() if count > 1]


def unexplained(rule: Rule) -> list[str]:
    """The texts of a rule that are empty, or not a sentence."""
    texts = {f.name: str(getattr(rule, f.name)) for f in fields(rule) if f.type == "str"}
    sentences = ("why", "remedy", "example")
    return [n for n, t in texts.items() if len(t) < 4 or "  " in t or (n in sentences and t[-1] != ".")]


def test_every_module_of_rows_is_found() -> None:
    files = {path.stem for path in TABLES.glob("*.py")} - {"__init__"}
    stated = {code for stem in files for code in codes_in((TABLES / f"{stem}.py").read_text("utf-8"))}
    assert stated == set(RULES)


def test_a_code_has_one_row() -> None:
    assert repeated(rows()) == []
    assert repeated([*rows(), RULES["OLP101"]]) == ["OLP101"]


def test_codes_are_in_order_and_well_formed() -> None:
    assert list(RULES) == sorted(RULES)
    assert all(CODE.fullmatch(code) for code in RULES)


@pytest.mark.parametrize("rule", RULES.values(), ids=lambda rule: rule.code)
def test_every_code_is_explained(rule: Rule) -> None:
    assert unexplained(rule) == []


def test_a_row_that_explains_nothing_is_found() -> None:
    rule = Rule("OLP999", "title", Severity.INFO, "", "Do nothing", "The  same.", "topic")
    assert unexplained(rule) == ["why", "remedy", "example"]


@pytest.mark.slow
def test_the_catalogue_holds_the_codes_of_the_program_and_no_others() -> None:
    modules = [path for path in PACKAGE.rglob("*.py") if path.parent != TABLES]
    used = {code for path in modules for code in codes_in(path.read_text("utf-8"))}
    assert used - set(RULES) == set(), "no row explains these"
    assert set(RULES) - used == set(), "no module uses these"


def test_a_code_in_a_call_counts_and_one_in_a_sentence_is_not() -> None:
    source = 'def f():\n    """As OLP101."""\n    yield Finding(*("OLP998",)), {"told": "OLP999"}\n'
    assert set(codes_in(source)) == {"OLP998", "OLP999"}


def test_a_gate_looks_for_findings_of_a_program() -> None:
    assert {"OLP101", "OLP331", "OLP431", "OLP701"} <= set(GATE_CODES)
    others = ("calibration", "comparison", "control_tables", "measurements", "planning", "results", "thermal")
    assert all(not rule.gate for rule in RULES.values() if rule.topic in others)


@pytest.mark.parametrize("path", sorted(TABLES.glob("*.py")), ids=lambda path: path.stem)
def test_a_module_of_rows_holds_one_topic_with_its_name(path: Path) -> None:
    stated = set(codes_in(path.read_text("utf-8")))
    assert {RULES[code].topic for code in stated} <= {path.stem}


def test_a_finding_has_the_severity_of_its_rule() -> None:
    assert Finding("OLP101", "x").severity is Severity.ERROR
    assert Finding("OLP301", "x").as_dict()["severity"] == "info"
