"""The papers for a terminal and for a browser: what answers a question, and linked pages with a search."""

from __future__ import annotations

import html
import json
import math
import re
import textwrap
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from olp.files.handbook import Page, Section
    from olp.findings.rule import Rule

#: How much more a word counts in a title than in a text.
_TITLE = 3.0
#: Saturation and share of the length in the ranking (Okapi BM25, Robertson and Walker 1994).
_SATURATION = 1.5
_LENGTH = 0.75
#: Letters of a word that count: "square" and "squareness" are one.
_STEM = 6
#: How much pages count: those that are written to be read come before tables and history.
_WEIGHT = {"reference": 0.3, "contributing": 0.6, "changes": 0.2, "index": 0.2, "measured": 0.4,
           "contributing/house": 0.2}  # fmt: skip
#: Words of a question that say nothing about its subject.
_EMPTY = frozenset(
    word
    for line in (
        "a an and are as at be by can do does for from has have how i in is it its me",
        "mean means my not of on or our out should so that the this to was we what when",
        "where which who why will with you your",
    )
    for word in line.split()
)
_CURRENT = " aria-current=page"
_GROUPS = {
    "": "Start", "tutorials": "Tutorials", "howto": "How to", "reference": "Reference",
    "background": "Background", "contributing": "Contributing",
}  # fmt: skip


def best(question: str, sections: Sequence[Section], most: int = 6) -> list[Section]:
    """The sections that answer a question best, the best first; none where no word of it occurs."""
    titles = [set(_words(section.title)) for section in sections]
    texts = [Counter(_words(section.text)) for section in sections]
    lengths = [text.total() for text in texts]
    mean = sum(lengths) / max(len(lengths), 1)
    asked = set(_words(question)) or set(_words(question, keep=True))
    both = list(zip(titles, texts, strict=True))
    holds = {word: [word in title or word in text for title, text in both] for word in asked}
    weight = {word: math.log(1.0 + len(sections) / (1 + sum(held))) for word, held in holds.items()}

    def score(k: int) -> float:
        slack = _SATURATION * (1.0 - _LENGTH + _LENGTH * lengths[k] / max(mean, 1.0))
        parts = (weight[w] * (_TITLE * (w in titles[k]) + texts[k][w] / (texts[k][w] + slack)) for w in asked)
        share = sum(weight[w] for w in asked if holds[w][k]) / max(sum(weight.values()), 1e-9)
        page = sections[k].page
        return sum(parts) * share * _WEIGHT.get(page, _WEIGHT.get(page.rpartition("/")[0], 1.0))

    scores = [score(k) for k in range(len(sections))]
    order = sorted(range(len(sections)), key=lambda k: -scores[k])
    return [sections[k] for k in order[:most] if scores[k] > 0.0]


def subject(question: str) -> str:
    """A question without the words that say nothing about its subject."""
    return " ".join(word for word in question.split() if word.lower().strip("?.,") not in _EMPTY).strip("?.,")


def contents(pages: Iterable[Page]) -> str:
    """All pages by group, one line each."""
    lines: list[str] = []
    for group, title in _GROUPS.items():
        lines += [f"\n{title}"] if lines else [title]
        lines += [f"  {p.name:38} {p.summary}" for p in pages if _group(p) == group]
    return "\n".join(lines) + "\n"


def site(pages: Mapping[str, Page]) -> dict[str, bytes]:
    """File name to content: linked pages that work without a network, with a search over their sections."""
    from markdown_it import MarkdownIt

    parser = MarkdownIt("commonmark").enable("table")
    files: dict[str, str] = {"style.css": _STYLE}
    for page in pages.values():
        tokens = parser.parse(page.text)
        _link(tokens)
        body = parser.renderer.render(tokens, parser.options, {})
        files[f"{page.name}.html"] = _page(page, pages, body)
    entries = [
        {"page": s.page, "at": _anchor(s.title), "title": s.title, "text": " ".join(s.text.split())}
        for page in pages.values()
        for s in page.sections
    ]
    files["search.js"] = f"const ENTRIES = {json.dumps(entries)};\n{_SEARCH}"
    return {name: text.encode() for name, text in files.items()}


def of_rule(rule: Rule) -> str:
    """What a finding means, why it matters, an example, what to do."""
    parts = [f"{rule.code} {rule.title} ({rule.severity.name.lower()})"]
    sections = (("Why it matters", rule.why), ("Example", rule.example), ("What to do", rule.remedy))
    for title, sentence in sections:
        parts.append(f"{title}:\n" + textwrap.fill(sentence, 96, initial_indent="  ", subsequent_indent="  "))
    return "\n\n".join(parts) + "\n"


def _words(text: str, *, keep: bool = False) -> list[str]:
    """Lower-case words without those that say nothing; of long ones the beginning only."""
    words = re.findall(r"[\w.+-]*\w", text.lower())
    return [re.sub(r"(?<=\w{3})s$", "", w)[:_STEM] for w in words if keep or w not in _EMPTY]


def _group(page: Page) -> str:
    return page.name.rpartition("/")[0]


def _anchor(title: str) -> str:
    return re.sub(r"[^\w]+", "-", re.sub(r"[`*]", "", title.lower())).strip("-")


def _link(tokens: Iterable[Any]) -> None:
    """Links to pages become links to their HTML, and headings get names."""
    held = list(tokens)
    for token, following in zip(held, [*held[1:], None], strict=True):
        if token.type == "heading_open" and following is not None:
            token.attrSet("id", _anchor(following.content))
        for child in token.children or ():
            target = str(child.attrGet("href") or "") if child.type == "link_open" else ""
            if "://" not in target:
                child.attrSet("href", re.sub(r"\.md(?=$|#)", ".html", target)) if target else None


def _page(page: Page, pages: Mapping[str, Page], body: str) -> str:
    up = "../" * page.name.count("/")
    rows = []
    for group, title in _GROUPS.items():
        links = "".join(
            f'<li><a href="{up}{p.name}.html"{_CURRENT * (p is page)}>{html.escape(p.title)}</a></li>'
            for p in pages.values()
            if _group(p) == group
        )
        rows.append(f"<h2>{title}</h2><ul>{links}</ul>")
    return _FRAME.format(title=html.escape(page.title), up=up, nav="".join(rows), body=body)


_FRAME = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title} - olp</title>
<link rel="stylesheet" href="{up}style.css">
</head>
<body data-up="{up}">
<nav aria-label="Pages">
<label>Search <input id="search" type="search" autocomplete="off"></label>
<ol id="hits" hidden></ol>
{nav}
</nav>
<main>
{body}
</main>
<script src="{up}search.js"></script>
</body>
</html>
"""
_STYLE = """:root { color-scheme: light dark; --line: color-mix(in srgb, currentColor 20%, transparent); }
body { margin: 0; display: grid; grid-template-columns: 17rem minmax(0, 52rem); gap: 2rem;
  font: 1rem/1.55 system-ui, sans-serif; }
nav { padding: 1rem; border-right: 1px solid var(--line); font-size: 0.9rem; }
nav h2 { font-size: 0.8rem; margin: 1rem 0 0.25rem; text-transform: uppercase; }
nav ul, nav ol { margin: 0; padding-left: 1rem; }
nav [aria-current] { font-weight: 600; }
nav input { width: 100%; box-sizing: border-box; font: inherit; padding: 0.3rem; }
main { padding: 1rem; }
pre { overflow-x: auto; padding: 0.75rem; border: 1px solid var(--line); border-radius: 4px; }
code { font-family: ui-monospace, monospace; font-size: 0.9em; }
table { border-collapse: collapse; display: block; overflow-x: auto; }
th, td { border: 1px solid var(--line); padding: 0.25rem 0.6rem; text-align: left; vertical-align: top; }
@media (max-width: 50rem) { body { display: block; } nav { border: 0; } }
@media print { nav { display: none; } body { display: block; } }
"""
_SEARCH = """
const input = document.getElementById("search"), hits = document.getElementById("hits");
const up = document.body.dataset.up;
input.addEventListener("input", () => {
  const words = input.value.toLowerCase().split(/\\s+/).filter(Boolean);
  const score = entry => words.every(w => (entry.title + " " + entry.text).toLowerCase().includes(w))
    ? 1 + words.filter(w => entry.title.toLowerCase().includes(w)).length : 0;
  const best = words.length === 0 ? [] : ENTRIES.map(entry => [score(entry), entry])
    .filter(([points]) => points > 0).sort((a, b) => b[0] - a[0]).slice(0, 12);
  hits.replaceChildren(...best.map(([, entry]) => {
    const item = document.createElement("li"), link = document.createElement("a");
    link.href = up + entry.page + ".html#" + entry.at;
    link.textContent = entry.title;
    item.append(link);
    return item;
  }));
  hits.hidden = best.length === 0;
});
"""
