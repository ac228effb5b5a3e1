"""`olp help`: what the papers say of a topic, and the papers as linked pages."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from pathlib import Path

from olp.core.errors import UsageError
from olp.files import handbook
from olp.files.write import check_targets, make_folder, write_files
from olp.findings.catalogue import RULES
from olp.reports import handbook as shown
from olp.reports.handbook_search import best, subject
from olp.reports.handbook_site import site

#: Words for terms that the glossary has under another name.
_ALIASES = {"sense": "sign convention"}


def topic(words: Sequence[str]) -> str:
    """The papers on a topic, as Markdown: a page by its name, else the sections that answer best.

    Without words the list of all pages. Raises UsageError where nothing is said of it.
    """
    pages = handbook.pages()
    if not words:
        return shown.contents(pages.values())
    asked = " ".join(words)
    named = _page_name(asked)
    for name, page in pages.items():
        if named in (name, name.rpartition("/")[2], page.title.lower()):
            return shown.for_terminal(page.text, name)
    codes = [word.upper().strip("?.") for word in words if word.upper().strip("?.") in RULES]
    if codes:
        return shown.of_rule(RULES[codes[0]])
    sections = [section for page in pages.values() for section in page.sections]
    answers = best(asked, sections)
    if not answers:
        near = difflib.get_close_matches(asked, [*pages, *handbook.glossary()], 1)
        hint = f"did you mean {near[0]}?" if near else "olp help lists all pages"
        raise UsageError(f"the papers say nothing about {asked!r}; {hint}")
    first, *others = answers
    term = meaning(subject(asked))
    known = f"**{term[0]}**: {term[1]}\n\n" if term else ""
    more = "".join(f"- {section.title}: `olp help {section.page}`\n" for section in others)
    also = f"\n## See also\n\n{more}" if more else ""
    page = pages[first.page]
    if first == page.sections[0]:
        return f"{known}{shown.for_terminal(page.text, page.name)}{also}"
    text = shown.for_terminal(first.text, page.name)
    return f"{known}# {first.title}\n\n{text}\n\nFrom the page: `olp help {page.name}`\n{also}"


def meaning(word: str) -> tuple[str, str] | None:
    """A term of the glossary and what it means, however it is spelt; None where it is not one of them."""
    terms = handbook.glossary()
    by_spelling = {_spelling(term): term for term in terms}
    term = by_spelling.get(_spelling(word)) or by_spelling.get(_spelling(word).removesuffix("s"))
    return None if term is None else (term, terms[term])


def meanings(word: str) -> dict[str, str]:
    """The terms that a word means: that term, else those with it as a word, else those explained with it."""
    one = meaning(_ALIASES.get(word.lower(), word))
    if one is not None:
        return dict([one])
    asked = word.lower()
    terms = handbook.glossary()
    parts = {term: text for term, text in terms.items() if asked in re.split(r"[\s-]", term.lower())}
    return parts or {term: text for term, text in terms.items() if f"`{asked}`" in text}


def _spelling(term: str) -> str:
    """A term without hyphens, spaces and capitals: "ballbar" is "ball-bar"."""
    return re.sub(r"[\s-]", "", term.lower())


def _page_name(asked: str) -> str:
    """The page that a link or a path names: "../howto/doctor.md#the-file-of-points" is "howto/doctor"."""
    bare = re.sub(r"^(\.{1,2}/)+|^olp/docs/|\.html?$", "", asked.lower())
    return re.sub(r"(\.md)?(#[\w-]*)?$", "", bare)


def write_site(folder: str, *, force: bool) -> Path:
    """Write the papers as linked pages into a folder; what to open first. Raises UsageError, InputError."""
    target = Path(folder)
    files = {target / name: data for name, data in site(handbook.pages(), handbook.pictures()).items()}
    check_targets(files, force=force, new_folders=True)
    # the folder itself first: an error names what was asked for
    for parent in [target, *sorted({path.parent for path in files})]:
        make_folder(parent)
    write_files(files, force=force)
    return target / f"{handbook.INDEX}.html"
