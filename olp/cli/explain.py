"""`olp explain`."""

from __future__ import annotations

import difflib
import json
import re
import textwrap
from collections.abc import Mapping

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
        from olp.workflows.help import meanings

        terms = meanings(code)
        if terms:
            put(_as_json(terms) if as_json else "\n".join(map(_as_text, terms, terms.values())))
            return
    rules = list(RULES.values()) if code is None else [_rule(code)]
    if as_json:
        put(json.dumps([_as_dict(rule) for rule in rules], indent=2) + "\n")
    elif code is None:
        put("".join(f"{rule.code}  {_severity(rule):7}  {rule.title}\n" for rule in rules))
    else:
        from olp.reports.handbook import of_rule

        put(of_rule(rules[0]))


def _as_text(term: str, meaning: str) -> str:
    return f"{term}\n{textwrap.fill(meaning, 96, initial_indent='  ', subsequent_indent='  ')}\n"


def _as_json(terms: Mapping[str, str]) -> str:
    rows = [{"term": term, "meaning": meaning} for term, meaning in terms.items()]
    return json.dumps(rows[0] if len(rows) == 1 else rows, indent=2) + "\n"


def _rule(code: str) -> Rule:
    """The finding of a code, also of its number alone. Raises UsageError where there is none."""
    asked = f"OLP{code}" if code.isdigit() else code.upper()
    rule = RULES.get(asked)
    if rule is None and re.fullmatch(r"OLP\d{3,}", asked):
        raise UsageError(f"there is no finding {asked}; olp explain lists the codes")
    if rule is None:
        longer = [other for other in RULES if other.startswith(asked)]
        lists = "olp explain lists the codes, olp help glossary the terms"
        hint = f"did you mean {longer[0]}?" if longer else _near_term(code) or lists
        raise UsageError(f"{code!r} is neither the code of a finding nor a term of the glossary; {hint}")
    return rule


def _near_term(word: str) -> str:
    from olp.files.handbook import glossary

    near = difflib.get_close_matches(word.lower(), glossary(), 1)
    return f"did you mean {near[0]}?" if near else ""


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
