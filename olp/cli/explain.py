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
    """Explain the code of a finding, or list all codes."""
    rules = list(RULES.values()) if code is None else [_rule(code)]
    if as_json:
        put(json.dumps([_as_dict(rule) for rule in rules], indent=2) + "\n")
    elif code is None:
        put("".join(f"{rule.code}  {_severity(rule):7}  {rule.title}\n" for rule in rules))
    else:
        put(_text(rules[0]))


def _rule(code: str) -> Rule:
    rule = RULES.get(code.upper())
    if rule is None:
        longer = [other for other in RULES if other.startswith(code.upper())]
        near = longer or difflib.get_close_matches(code.upper(), RULES, 1)
        hint = f"did you mean {near[0]}?" if near else "olp explain lists them all"
        raise UsageError(f"{code!r} is no code of a finding; {hint}")
    return rule


def _severity(rule: Rule) -> str:
    return rule.severity.name.lower()


def _text(rule: Rule) -> str:
    parts = [f"{rule.code} {rule.title} ({_severity(rule)})"]
    sections = (("Why it matters", rule.why), ("Example", rule.example), ("What to do", rule.remedy))
    for title, sentence in sections:
        parts.append(f"{title}:\n" + textwrap.fill(sentence, 96, initial_indent="  ", subsequent_indent="  "))
    return "\n\n".join(parts) + "\n"


def _as_dict(rule: Rule) -> dict[str, str]:
    return {
        "code": rule.code,
        "title": rule.title,
        "severity": _severity(rule),
        "why": rule.why,
        "example": rule.example,
        "remedy": rule.remedy,
    }
