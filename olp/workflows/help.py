"""`olp help`: what the papers say of a topic, and the papers as linked pages."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path

from olp.core.errors import UsageError
from olp.files import handbook
from olp.files.write import write_files
from olp.findings.catalogue import RULES
from olp.reports import handbook as shown


def topic(words: Sequence[str]) -> str:
    """The papers on a topic, as Markdown: a page by its name, else the sections that answer best.

    Without words the list of all pages. Raises UsageError where nothing is said of it.
    """
    pages = handbook.pages()
    if not words:
        return shown.contents(pages.values())
    asked = " ".join(words)
    for name, page in pages.items():
        if asked.lower() in (name, name.rpartition("/")[2], page.title.lower()):
            return page.text
    codes = [word.upper().strip("?.") for word in words if word.upper().strip("?.") in RULES]
    if codes:
        return shown.of_rule(RULES[codes[0]])
    sections = [section for page in pages.values() for section in page.sections]
    answers = shown.best(asked, sections)
    if not answers:
        near = difflib.get_close_matches(asked, [*pages, *handbook.glossary()], 1)
        hint = f"did you mean {near[0]}?" if near else "olp help lists all pages"
        raise UsageError(f"the papers say nothing about {asked!r}; {hint}")
    first, *others = answers
    term = meaning(shown.subject(asked))
    known = f"**{term[0]}**: {term[1]}\n\n" if term else ""
    more = "".join(f"- {section.title}: `olp help {section.page}`\n" for section in others)
    also = f"\n## See also\n\n{more}" if more else ""
    page = pages[first.page]
    if first == page.sections[0]:
        return f"{known}{page.text}{also}"
    return f"{known}# {first.title}\n\n{first.text}\n\nFrom the page: `olp help {first.page}`\n{also}"


def meaning(word: str) -> tuple[str, str] | None:
    """A term of the glossary and what it means; None where it is not one of them."""
    terms = handbook.glossary()
    by_lower = {term.lower(): term for term in terms}
    term = by_lower.get(word.lower()) or by_lower.get(word.lower().removesuffix("s"))
    return None if term is None else (term, terms[term])


def write_site(folder: str, *, force: bool) -> Path:
    """Write the papers as linked pages into a folder; what to open first. Raises UsageError, InputError."""
    target = Path(folder)
    files = {target / name: data for name, data in shown.site(handbook.pages()).items()}
    for parent in {path.parent for path in files}:
        parent.mkdir(parents=True, exist_ok=True)
    write_files(files, force=force)
    return target / f"{handbook.INDEX}.html"
