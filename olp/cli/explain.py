"""`olp explain`."""

from __future__ import annotations

import difflib
import json
import textwrap

import click

from olp.cli.common import put
from olp.cli.options import json_option
from olp.core.errors import UsageError
from olp.findings.catalogue import RULES
from olp.findings.rule import Rule


@click.command("explain")
@click.argument("code", required=False)
@json_option("Print as JSON.")
def command(code: str | None, as_json: bool) -> None:
    """Explain the code of a finding or a term of the glossary, or list all codes."""
    if code is not None and code.upper() not in RULES:
        from olp.workflows.help import meaning

        term = meaning(code)
        if term is not None:
            name, text = term
            lines = textwrap.fill(text, 96, initial_indent="  ", subsequent_indent="  ")
            as_text = f"{name}\n{lines}\n"
            put(json.dumps({"term": name, "meaning": text}, indent=2) + "\n" if as_json else as_text)
            return
    rules = list(RULES.values()) if code is None else [_rule(code)]
    if as_json:
        put(json.dumps([_as_dict(rule) for rule in rules], indent=2) + "\n")
    elif code is None:
        put("".join(f"{rule.code}  {_severity(rule):7}  {rule.title}\n" for rule in rules))
    else:
        from olp.reports.handbook import of_rule

        put(of_rule(rules[0]))


def _rule(code: str) -> Rule:
    rule = RULES.get(code.upper())
    if rule is None:
        longer = [other for other in RULES if other.startswith(code.upper())]
        near = longer or difflib.get_close_matches(code.upper(), RULES, 1)
        lists = "olp explain lists the codes, olp help glossary the terms"
        hint = f"did you mean {near[0]}?" if near else lists
        raise UsageError(f"{code!r} is neither the code of a finding nor a term of the glossary; {hint}")
    return rule


def _severity(rule: Rule) -> str:
    return rule.severity.name.lower()


def _as_dict(rule: Rule) -> dict[str, str]:
    return {
        "code": rule.code,
        "title": rule.title,
        "severity": _severity(rule),
        "why": rule.why,
        "example": rule.example,
        "remedy": rule.remedy,
    }
