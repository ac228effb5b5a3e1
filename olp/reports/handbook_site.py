"""The papers for a browser: linked pages with their pictures that work without a network, and a search."""

from __future__ import annotations

import html
import json
import posixpath
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple
from typing import TYPE_CHECKING, Any

from olp.reports.handbook import GROUPS, group_of
from olp.reports.handbook_search import (
    ADDED,
    BEGINNING,
    EMPTY,
    IN_PAGE_TITLE,
    IN_TITLE,
    NAMED_PAGE,
    STEM,
    SUBJECTS,
    page_weight,
)

if TYPE_CHECKING:
    from olp.files.handbook import Page

_CURRENT = " aria-current=page"
#: Folder of the pictures on the site.
_PICTURES = "pictures"


def site(pages: Mapping[str, Page], pictures: Mapping[str, bytes]) -> dict[str, bytes]:
    """File name to content: linked pages and pictures, and a search over the sections of the pages."""
    from markdown_it import MarkdownIt

    parser = MarkdownIt("commonmark").enable("table")
    files: dict[str, str] = {"style.css": _STYLE, "search.js": _search(pages.values())}
    for page in pages.values():
        tokens = parser.parse(page.text)
        _link(tokens, page)
        body = parser.renderer.render(tokens, parser.options, {})
        files[f"{page.name}.html"] = _page(page, pages, body)
    shown = {f"{_PICTURES}/{name}": data for name, data in pictures.items()}
    return {name: text.encode() for name, text in files.items()} | shown


def _search(pages: Iterable[Page]) -> str:
    """The script of the search. It ranks as `handbook_search` does, but counts no word twice."""
    entries = [
        {
            "page": page.name, "at": _anchor(section.title), "title": section.title, "of": page.title,
            "text": " ".join(section.text.split()),
            "weight": page_weight(page.name) * (1.0 if k else BEGINNING),
        }
        for page in pages
        for k, section in enumerate(page.sections)
    ]  # fmt: skip
    values: dict[str, Sequence[object] | float] = {
        "ENTRIES": entries, "EMPTY": sorted(EMPTY), "SUBJECTS": [astuple(subject) for subject in SUBJECTS],
        "STEM": STEM, "ADDED": ADDED, "IN_TITLE": IN_TITLE, "IN_PAGE_TITLE": IN_PAGE_TITLE,
        "NAMED_PAGE": NAMED_PAGE,
    }  # fmt: skip
    return "".join(f"const {name} = {json.dumps(value)};\n" for name, value in values.items()) + _SEARCH


def _anchor(title: str) -> str:
    return re.sub(r"[^\w]+", "-", re.sub(r"[`*]", "", title.lower())).strip("-")


def _title(text: str) -> str:
    """A title as HTML, with its code as code."""
    return re.sub(r"`([^`]*)`", r"<code>\1</code>", html.escape(text))


def _link(tokens: Iterable[Any], page: Page) -> None:
    """Links to pages become links to their HTML, pictures those of the site, and headings get names."""
    up = "../" * page.name.count("/")
    held = list(tokens)
    for token, following in zip(held, [*held[1:], None], strict=True):
        if token.type == "heading_open" and following is not None:
            token.attrSet("id", _anchor(following.content))
        for child in token.children or ():
            if child.type == "image":
                child.attrSet("src", f"{up}{_PICTURES}/{posixpath.basename(str(child.attrGet('src')))}")
            target = str(child.attrGet("href") or "") if child.type == "link_open" else ""
            if "://" not in target:
                child.attrSet("href", re.sub(r"\.md(?=$|#)", ".html", target)) if target else None


def _page(page: Page, pages: Mapping[str, Page], body: str) -> str:
    up = "../" * page.name.count("/")
    rows = []
    for group, title in GROUPS.items():
        links = "".join(
            f'<li><a href="{up}{p.name}.html"{_CURRENT * (p is page)}>{_title(p.title)}</a></li>'
            for p in pages.values()
            if group_of(p) == group
        )
        rows.append(f"<h2>{title}</h2><ul>{links}</ul>")
    title = html.escape(page.title.replace("`", ""))
    return _FRAME.format(title=title, up=up, nav="".join(rows), body=body)


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
<p id="none" role="status" hidden>Nothing found.</p>
<ol id="hits" hidden></ol>
<details id="pages" open>
<summary>Pages</summary>
{nav}
</details>
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
nav { padding: 1rem; border-right: 1px solid var(--line); font-size: 0.9rem; position: sticky; top: 0;
  height: 100vh; box-sizing: border-box; display: flex; flex-direction: column; }
nav details { flex: 1; min-height: 0; overflow-y: auto; }
nav summary { display: none; }
nav #hits { flex: none; max-height: 50vh; overflow-y: auto; padding-left: 1.75rem; }
nav h2 { font-size: 0.8rem; margin: 1rem 0 0.25rem; text-transform: uppercase; }
nav ul, nav ol { margin: 0; padding-left: 1rem; }
nav [aria-current] { font-weight: 600; }
nav input { width: 100%; box-sizing: border-box; font: inherit; padding: 0.3rem; }
main { padding: 1rem; min-width: 0; }
img { max-width: 100%; height: auto; background: white; }
pre { overflow-x: auto; padding: 0.75rem; border: 1px solid var(--line); border-radius: 4px; }
code { font-family: ui-monospace, monospace; font-size: 0.9em; }
table { border-collapse: collapse; display: block; overflow-x: auto; }
th, td { border: 1px solid var(--line); padding: 0.25rem 0.6rem; text-align: left; vertical-align: top; }
@media (max-width: 50rem) {
  body { display: block; }
  nav { position: static; display: block; height: auto; border: 0; border-bottom: 1px solid var(--line); }
  nav summary { display: list-item; cursor: pointer; padding: 0.5rem 0; }
}
@media print { nav { display: none; } body { display: block; } }
"""
_SEARCH = r"""
const at = id => document.getElementById(id);
const input = at("search"), hits = at("hits"), none = at("none"), pages = at("pages");
const up = document.body.dataset.up;
const narrow = matchMedia("(max-width: 50rem)");
const fold = () => { pages.open = !narrow.matches; };
fold();
narrow.addEventListener("change", fold);
const current = document.querySelector("nav [aria-current]");
if (current) pages.scrollTop = current.offsetTop - pages.offsetTop - pages.clientHeight / 2;
const empty = new Set(EMPTY);
const stems = text => (text.toLowerCase().match(/[\p{L}\p{N}_.+-]*[\p{L}\p{N}_]/gu) || [])
  .filter(word => !empty.has(word) && !/^\d{1,2}$/.test(word))
  .map(word => word.replace(/(\w{3})s$/, "$1").slice(0, STEM));
for (const entry of ENTRIES) {
  entry.inTitle = new Set(stems(entry.title));
  entry.inPage = new Set(stems(entry.of));
  entry.inText = new Set(stems(entry.text));
}
const holds = (entry, stem) => entry.inTitle.has(stem) || entry.inText.has(stem)
  || [...entry.inTitle].some(word => word.startsWith(stem));
function ranked(question) {
  const subjects = SUBJECTS.filter(([pattern]) => new RegExp(pattern).test(question.toLowerCase()));
  const named = new Set(subjects.flatMap(([, , pages]) => pages));
  const factor = new Map(subjects.flatMap(([, words]) => stems(words)).map(stem => [stem, ADDED]));
  for (const stem of stems(question)) factor.set(stem, 1);
  const weights = [...factor].map(([stem, share]) => {
    const count = ENTRIES.filter(entry => holds(entry, stem)).length;
    return [stem, share * Math.log(1 + ENTRIES.length / (1 + count))];
  });
  const whole = weights.reduce((sum, [, weight]) => sum + weight, 0);
  const score = entry => {
    let points = 0, found = 0;
    for (const [stem, weight] of weights) {
      if (holds(entry, stem)) found += weight;
      points += weight * (IN_TITLE * entry.inTitle.has(stem) + IN_PAGE_TITLE * entry.inPage.has(stem)
        + holds(entry, stem));
    }
    return points * found / whole * entry.weight * (named.has(entry.page) ? NAMED_PAGE : 1);
  };
  return ENTRIES.map(entry => [score(entry), entry]).filter(([points]) => points > 0)
    .sort((a, b) => b[0] - a[0]).slice(0, 12).map(([, entry]) => entry);
}
function titled(link, text) {
  text.split("`").forEach((part, index) => {
    const node = document.createElement(index % 2 ? "code" : "span");
    node.textContent = part;
    if (part) link.append(node);
  });
}
input.addEventListener("input", () => {
  const best = ranked(input.value);
  hits.replaceChildren(...best.map(entry => {
    const item = document.createElement("li"), link = document.createElement("a");
    link.href = up + entry.page + ".html#" + entry.at;
    titled(link, entry.title);
    item.append(link);
    if (entry.title !== entry.of) {
      const page = document.createElement("small");
      page.append(" ");
      titled(page, entry.of);
      item.append(page);
    }
    return item;
  }));
  hits.hidden = best.length === 0;
  none.hidden = best.length > 0 || input.value.trim() === "";
});
"""
