"""A document in its two forms, line by line: no text of a program becomes markup."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from judge import browser

from olp.reports.document import (
    Block,
    Document,
    Grid,
    Notice,
    Pairs,
    Paragraph,
    Plot,
    Section,
    in_form,
    to_html,
    to_markdown,
)

HOSTILE = """<i a="b" c='d'>&amp;\x1b"""
SAFE = "&lt;i a=&quot;b&quot; c=&#x27;d&#x27;&gt;&amp;amp; "
MARKED = """\\<i a="b" c='d'\\>&amp; """


def of(*blocks: Block, level: int = 1) -> Document:
    return Document("T", "S", None, (Section("One", blocks, level),), "end")


def body(document: Document) -> list[str]:
    """Lines of the page between its header and its footer, without the heading of the section."""
    return to_html(document).decode().split("</header>")[1].split("<footer>")[0].strip().splitlines()[1:]


def lines(document: Document) -> list[str]:
    """Lines of the Markdown between the heading of the section and the footer."""
    text = to_markdown(document).decode()
    return text.split("One\n\n")[1].split("\n---\n")[0].rstrip().splitlines()


ROW = ((HOSTILE,) * 4,)
EVERYWHERE = Document(
    HOSTILE,
    HOSTILE,
    (True, HOSTILE),
    (
        Section(
            HOSTILE,
            (
                Paragraph(HOSTILE),
                Pairs(((HOSTILE, HOSTILE),)),
                Grid(ROW[0], ROW, 1, code=2, aside=3),
                Plot(b"<svg></svg>", HOSTILE),
                Notice("warning", "OLP1", HOSTILE, HOSTILE, HOSTILE),
            ),
        ),
    ),
    HOSTILE,
)


def test_no_text_becomes_an_element() -> None:
    page = to_html(EVERYWHERE).decode()
    texts = page.replace(SAFE, "")
    # title and header twice each, verdict, heading, paragraph, pair, 8 cells, caption, notice, footer
    assert page.count(SAFE) == 4 + 1 + 1 + 1 + 2 + 8 + 1 + 3 + 1
    assert not re.search(r"<i|&(amp|lt|gt|quot|#x27);|\x1b", texts)


def test_no_text_becomes_a_mark_of_markdown() -> None:
    text = to_markdown(EVERYWHERE).decode()
    # neither the title of the page nor a plot's caption is in it
    assert text.count(MARKED) == 2 + 1 + 1 + 1 + 2 + 8 + 3 + 1
    assert not re.search(r"(?<!\\)[<>]|\x1b", text)


@pytest.mark.parametrize("mark", tuple("\\`*_[]<>|#"))
def test_every_mark_of_markdown_is_escaped(mark: str) -> None:
    assert lines(of(Paragraph(f"a{mark}b{mark}"))) == [f"a\\{mark}b\\{mark}"]


def test_a_table_says_the_kind_of_its_columns() -> None:
    grid = Grid(("a", "b", "c", "d", "e"), (("1", "2", "3", "4", "5"),), 1, code=3, aside=4)
    kinds = ("l", "r", "r", "l code", "l aside")
    cells = {tag: "".join(f'<{tag} class="{k}">%s</{tag}>' for k in kinds) for tag in ("th", "td")}
    assert body(of(grid)) == [
        f"<table class='short'><thead><tr>{cells['th']}</tr></thead>".replace("%s", "{}").format(*"abcde")
        + f"<tbody><tr>{cells['td']}</tr></tbody></table>".replace("%s", "{}").format(*"12345")
    ]
    assert lines(of(grid)) == [
        "| a | b | c | d | e |", "| --- | ---: | ---: | --- | --- |", "| 1 | 2 | 3 | 4 | 5 |"
    ]  # fmt: skip


def test_the_rows_of_a_table_follow_each_other() -> None:
    grid = Grid(("a", "b"), (("1", "2"), ("3", "4")))
    rows = [f'<tr><td class="l">{a}</td><td class="r">{b}</td></tr>' for a, b in grid.rows]
    assert body(of(grid))[0].split("<tbody>")[1] == "".join(rows) + "</tbody></table>"
    assert lines(of(grid))[2:] == ["| 1 | 2 |", "| 3 | 4 |"]


@pytest.mark.parametrize(("count", "kind"), [(1, "short"), (12, "short"), (13, "long")])
def test_a_table_of_more_than_twelve_rows_may_break(count: int, kind: str) -> None:
    assert body(of(Grid(("a",), (("1",),) * count)))[0].startswith(f"<table class='{kind}'>")


def test_pairs_leave_out_what_is_empty_and_set_digests_in_code() -> None:
    digest = "0123456789abcdef" * 4
    pairs = Pairs((("a", "b"), ("c", ""), ("d", digest), ("e", digest + "0"), ("f", digest.upper())))
    assert body(of(pairs)) == [
        f'<dl><dt>a</dt><dd class="words">b</dd><dt>d</dt><dd class="code">{digest}</dd>'
        f'<dt>e</dt><dd class="words">{digest}0</dd><dt>f</dt><dd class="words">{digest.upper()}</dd></dl>'
    ]
    assert lines(of(pairs)) == ["- a: b", f"- d: {digest}", f"- e: {digest}0", f"- f: {digest.upper()}"]


@pytest.mark.parametrize(
    ("after", "lead"),
    [(Grid(("a",), ()), True), (Plot(b"<svg/>", "c"), True), (Paragraph("b"), False), (None, False)],
)
def test_a_paragraph_stays_on_the_page_of_what_it_announces(after: Block | None, lead: bool) -> None:
    blocks = (Paragraph("a"),) if after is None else (Paragraph("a"), after)
    assert body(of(*blocks))[0] == ('<p class="lead">a</p>' if lead else "<p>a</p>")


def test_a_plot_and_a_notice() -> None:
    plot, notice = Plot(b"<svg/>", "c"), Notice("error", "OLP1", "t", "m.", "r.")
    assert body(of(plot, notice)) == [
        "<figure><svg/><figcaption>c</figcaption></figure>",
        '<div class="notice error"><b>OLP1 t</b> <span>(error)</span><br>m.<br><span>r.</span></div>',
    ]
    assert lines(of(plot, notice)) == ["- **OLP1 t** (error): m. r."]


@pytest.mark.parametrize(("good", "mark"), [(None, "open"), (True, "good"), (False, "bad")])
def test_the_verdict_says_whether_it_is_open(good: bool | None, mark: str) -> None:
    document = Document("T", "S", (good, "so"))
    assert f'<p class="verdict {mark}">so</p>' in to_html(document).decode()
    assert to_markdown(document).decode() == "# T\n\nS\n\n**so**\n\n---\n\n\n"
    assert "<p class=" not in to_html(Document("T", "S", None)).decode()


def test_sections_are_numbered_in_two_levels() -> None:
    levels = (("a", 1), ("b", 2), ("c", 2), ("d", 1), ("e", 2))
    document = Document("T", "S", None, [Section(title, (), level) for title, level in levels])
    headings = [line for line in to_markdown(document).decode().splitlines() if line.startswith("##")]
    assert headings == ["## 1 a", "### 1.1 b", "### 1.2 c", "## 2 d", "### 2.1 e"]
    page = to_html(document).decode()
    assert re.findall(r"<h[23]>[^<]*</h[23]>", page) == [
        "<h2>1 a</h2>", "<h3>1.1 b</h3>", "<h3>1.2 c</h3>", "<h2>2 d</h2>", "<h3>2.1 e</h3>"
    ]  # fmt: skip


def test_the_ending_of_the_file_decides_the_form() -> None:
    document = Document("T", "S", None)
    for name, form in (("a.html", to_html), ("a.HTML", to_html), ("a.md", to_markdown), ("a", to_markdown)):
        assert in_form(document, name) == form(document)


def test_the_page_may_load_nothing() -> None:
    assert (
        '<meta http-equiv="Content-Security-Policy" '
        "content=\"default-src 'none'; style-src 'unsafe-inline'; img-src data:\">"
    ) in to_html(of()).decode()


@pytest.mark.slow
@pytest.mark.parametrize("width", [360, 768])
def test_a_wide_table_scrolls_and_the_page_does_not(tmp_path: Path, width: int) -> None:
    browser.require()
    head = [
        "program",
        "machine",
        "verdict",
        "report",
        "findings",
        "moves",
        "uncorrected max",
        "corrected max",
    ]
    rows = [
        ["cell-3/bracket-left.nc", "mill-30-16", "good", "report", "OLP466, OLP102", "1200", "9.4", "0.4"]
    ]
    path = tmp_path / "page.html"
    path.write_bytes(to_html(of(Grid(head, rows, 5), Pairs([("Sha-256 of the program", "0" * 64)]))))
    with browser.driver() as driver, browser.launched(driver) as chromium:
        page = chromium.new_page(viewport={"width": width, "height": 800})
        page.goto(path.as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= width
