"""The papers for a terminal: all pages, a text without Markdown's links and pictures, a finding."""

from __future__ import annotations

import posixpath
import re
import textwrap
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from olp.files.handbook import Page
    from olp.findings.rule import Rule

GROUPS = {
    "": "Start", "tutorials": "Tutorials", "howto": "How to", "reference": "Reference",
    "background": "Background", "contributing": "Contributing",
}  # fmt: skip
#: Code, which stays as it is, or a picture, or a link.
_MARKS = re.compile(
    r"(?P<code>^```.*?^```|`[^`\n]*`)"
    r"|!\[(?P<alt>[^\]]*)\]\([^)\s]+\)"
    r"|\[(?P<title>[^\]]*)\]\((?P<target>[^)\s]+)\)",
    re.DOTALL | re.MULTILINE,
)


def contents(pages: Iterable[Page]) -> str:
    """All pages by group, one line each."""
    lines: list[str] = []
    for group, title in GROUPS.items():
        lines += [f"\n{title}"] if lines else [title]
        lines += [f"  {p.name:38} {p.summary}" for p in pages if group_of(p) == group]
    return "\n".join(lines) + "\n"


def for_terminal(text: str, page: str) -> str:
    """The text of a page for a reader who cannot click: a link is the call that shows its page, a picture
    what it shows."""

    def plain(mark: re.Match[str]) -> str:
        if mark["code"] is not None:
            return mark[0]
        if mark["alt"] is not None:
            return f"Picture: {mark['alt']}"
        return mark["title"] + _where(mark["target"], page)

    return _MARKS.sub(plain, text)


def of_rule(rule: Rule) -> str:
    """What a finding means, why it matters, an example, what to do."""
    parts = [f"{rule.code} {rule.title} ({rule.severity.name.lower()})"]
    sections = (("Why it matters", rule.why), ("Example", rule.example), ("What to do", rule.remedy))
    for title, sentence in sections:
        parts.append(f"{title}:\n" + textwrap.fill(sentence, 96, initial_indent="  ", subsequent_indent="  "))
    return "\n\n".join(parts) + "\n"


def group_of(page: Page) -> str:
    """The folder of a page; "" for those at the top."""
    return page.name.rpartition("/")[0]


def _where(target: str, page: str) -> str:
    """How a reader of a terminal comes to the target of a link; "" within its page."""
    if "://" in target:
        return f" ({target})"
    file = target.partition("#")[0]
    name = posixpath.normpath(posixpath.join(posixpath.dirname(page), file.removesuffix(".md")))
    return f" (`olp help {name}`)" if file else ""
