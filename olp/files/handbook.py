"""The papers that ship with the package: pages in reading order, their sections, terms of the glossary."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator
from importlib import resources
from importlib.resources.abc import Traversable

from olp.core.values import dataclass

#: The page whose links are the reading order of the others.
INDEX = "index"
GLOSSARY = "background/glossary"

_LINK = re.compile(r"\]\(([\w/.-]+)\.md(?:#[\w-]+)?\)")
_PICTURE = re.compile(r"!\[[^\]]*\]\([\w./-]*viewer/pictures/([\w.-]+)\)")
_COMMENT = re.compile(r"^<!--.*?-->[ \t]*\n", re.DOTALL | re.MULTILINE)
_FENCE = "```"


@dataclass(frozen=True, slots=True)
class Section:
    """A heading of a page and the text below it, up to the next heading."""

    page: str
    title: str
    text: str


@dataclass(frozen=True, slots=True)
class Page:
    """A page in Markdown. `name` is its path below the papers without its ending: "howto/check"."""

    name: str
    text: str
    sections: tuple[Section, ...]

    @staticmethod
    def of(name: str, text: str) -> Page:
        return Page(name, text, tuple(_sections(name, text)))

    @property
    def title(self) -> str:
        return self.sections[0].title

    @property
    def summary(self) -> str:
        """The first sentence below the title."""
        paragraph = " ".join(self.sections[0].text.strip().split("\n\n")[0].split())
        return re.split(r"(?<=[.!?])\s", paragraph)[0]


@functools.cache
def pages() -> dict[str, Page]:
    """All pages by name, in reading order: the index first, then as it links them, then what it links not."""
    pages_by_name = {name: Page.of(name, text) for name, text in _texts(resources.files("olp") / "docs", "")}
    order = [INDEX, *_LINK.findall(pages_by_name[INDEX].text), *sorted(pages_by_name)]
    return {name: pages_by_name[name] for name in dict.fromkeys(order) if name in pages_by_name}


@functools.cache
def glossary() -> dict[str, str]:
    """Term to meaning, from the table of the glossary."""
    lines = (line.strip() for line in pages()[GLOSSARY].text.splitlines())
    rows = [line.strip("|").split("|", 1) for line in lines if line.startswith("|")]
    return {term.strip().strip("`*"): meaning.strip() for term, meaning in rows[2:]}


def pictures() -> dict[str, bytes]:
    """The pictures of all pages by file name: from the installed package, or from the checkout."""
    folder = resources.files("olp") / "_pictures"
    if not folder.is_dir():
        folder = resources.files("olp") / ".." / "viewer" / "pictures"
    names = sorted({name for page in pages().values() for name in _PICTURE.findall(page.text)})
    return {name: (folder / name).read_bytes() for name in names}


def _texts(folder: Traversable, prefix: str) -> Iterator[tuple[str, str]]:
    for entry in sorted(folder.iterdir(), key=lambda entry: entry.name):
        if entry.is_dir():
            yield from _texts(entry, f"{prefix}{entry.name}/")
        elif entry.name.endswith(".md"):
            yield prefix + entry.name.removesuffix(".md"), _COMMENT.sub("", entry.read_text("utf-8"))


def _sections(page: str, text: str) -> Iterator[Section]:
    title, lines, fenced = page, list[str](), False
    for line in text.splitlines():
        if line.startswith(_FENCE):
            fenced = not fenced
        if not fenced and line.startswith("#"):
            if lines or title != page:
                yield Section(page, title, "\n".join(lines).strip("\n"))
            title, lines = line.lstrip("# "), []
        else:
            lines.append(line)
    yield Section(page, title, "\n".join(lines).strip("\n"))
