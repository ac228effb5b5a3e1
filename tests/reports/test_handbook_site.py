"""The papers as linked pages: two small ones, element by element."""

from __future__ import annotations

import json
import re

import pytest

from olp.files.handbook import Page
from olp.reports.handbook_site import site

INDEX = Page.of(
    "index", '# The `olp` & <its> "papers"\n\nFirst.\n\nSee [the check](howto/check.md#its-end).\n'
)
CHECK = Page.of(
    "howto/check",
    "# Check a `<program>` & `more`\n\n![a](../../viewer/pictures/a.png)\n\n## Its end: `x` *now*\n\n"
    "[back](../index.md), [out](https://example.org/a.md), [here](#its-end-x-now), [a.md.txt](b.mdx)\n\n"
    "| a | b |\n|---|---|\n| <1 | 2 |\n",
)
VIEW = Page.of("howto/view", "# View\n\nLast.\n")
PAGES = {page.name: page for page in (INDEX, CHECK, VIEW)}
FILES = site(PAGES, {"a.png": b"PNG"})
FIRST, SECOND, THIRD = (FILES[f"{name}.html"].decode() for name in PAGES)
TITLES = (
    "The <code>olp</code> &amp; &lt;its&gt; &quot;papers&quot;",
    "Check a <code>&lt;program&gt;</code> &amp; <code>more</code>",
    "View",
)


def test_a_site_has_a_page_each_its_pictures_its_style_and_a_search() -> None:
    assert set(FILES) == {
        "style.css",
        "search.js",
        "index.html",
        "howto/check.html",
        "howto/view.html",
        "pictures/a.png",
    }
    assert FILES["pictures/a.png"] == b"PNG"


@pytest.mark.parametrize(
    ("text", "title"),
    [(FIRST, "The olp &amp; &lt;its&gt; &quot;papers&quot;"), (SECOND, "Check a &lt;program&gt; &amp; more")],
)
def test_the_title_of_a_page_is_text(text: str, title: str) -> None:
    assert re.findall(r"<title>(.*)</title>", text) == [f"{title} - olp"]


@pytest.mark.parametrize(("text", "up", "current"), [(FIRST, "", 0), (SECOND, "../", 1), (THIRD, "../", 2)])
def test_a_page_links_all_others_by_group(text: str, up: str, current: int) -> None:
    """From its own folder, itself as the current one; titles are text, and code in them is code."""
    mark = [" aria-current=page" * (k == current) for k in range(3)]
    links = [f'<li><a href="{up}{name}.html"{mark[k]}>{TITLES[k]}</a></li>' for k, name in enumerate(PAGES)]
    groups = [("Start", links[0]), ("Tutorials", ""), ("How to", links[1] + links[2])]
    groups += [(title, "") for title in ("Reference", "Background", "Contributing")]
    expected = "".join(f"<h2>{title}</h2><ul>{link}</ul>" for title, link in groups)
    assert text.split("<summary>Pages</summary>\n")[1].split("\n</details>")[0] == expected
    assert f'<link rel="stylesheet" href="{up}style.css">' in text
    assert f'<body data-up="{up}">' in text
    assert f'<script src="{up}search.js"></script>' in text


def test_the_body_is_the_page_with_its_links_and_pictures_on_the_site() -> None:
    body = SECOND.split("<main>\n")[1].split("\n</main>")[0]
    assert (
        '<h1 id="check-a-program-more">Check a <code>&lt;program&gt;</code> &amp; <code>more</code></h1>'
        in body
    )
    assert '<h2 id="its-end-x-now">' in body
    assert '<img src="../pictures/a.png" alt="a" />' in body
    links = re.findall(r'<a href="([^"]*)">', body)
    assert links == ["../index.html", "https://example.org/a.md", "#its-end-x-now", "b.mdx"]
    assert "<td>&lt;1</td>" in body
    assert '<a href="howto/check.html#its-end">the check</a>' in FIRST


def test_the_search_holds_the_sections() -> None:
    script = FILES["search.js"].decode()
    entries = json.loads(script.split("const ENTRIES = ")[1].split(";\nconst ")[0])
    assert [(e["page"], e["at"], e["title"]) for e in entries] == [
        ("index", "the-olp-its-papers", 'The `olp` & <its> "papers"'),
        ("howto/check", "check-a-program-more", "Check a `<program>` & `more`"),
        ("howto/check", "its-end-x-now", "Its end: `x` *now*"),
        ("howto/view", "view", "View"),
    ]
    assert {e["of"] for e in entries[1:3]} == {"Check a `<program>` & `more`"}
