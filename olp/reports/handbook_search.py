"""Which sections of the papers answer a question: words that count, other names of a subject, a ranking."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

from olp.core.values import dataclass

if TYPE_CHECKING:
    from olp.files.handbook import Section

#: How much more a word counts in the title of a section, and of its page, than in a text.
IN_TITLE = 3.0
IN_PAGE_TITLE = 1.5
#: How much a word counts that the question does not hold, but another name of its subject.
ADDED = 0.6
#: How much more a page counts that a subject names.
NAMED_PAGE = 3.0
#: How much more the beginning of a page counts, as it shows the page.
BEGINNING = 1.4
#: Saturation and share of the length in the ranking (Okapi BM25, Robertson and Walker 1994).
_SATURATION = 1.5
_LENGTH = 0.75
#: Letters of a word that count: "square" and "squareness" are one.
STEM = 6
#: How much pages count: what a user is guided by comes before tables, history and the plan of the code.
_WEIGHT = {
    "tutorials": 1.6,
    "howto": 1.2,
    "background": 0.8,
    "reference": 0.3,
    "contributing": 0.4,
    "changes": 0.1,
    "index": 0.1,
    "measured": 0.3,
    "background/glossary": 0.3,
    "contributing/house": 0.02,
    "contributing/moved": 0.02,
}
#: Words of a question that say nothing about its subject.
EMPTY = frozenset(
    word
    for line in (
        "a about all an and any are as at be by can could did do does for from get give has have how i if in",
        "into is it its just know like make many me mean means much my need not of on one or our out please",
        "say says should show so tell than that the their then there these they this to too use used using",
        "want was we were what when where which who why will with work works would you your olp",
    )
    for word in line.split()
)


@dataclass(frozen=True, slots=True)
class Subject:
    """Other names of a subject, as a pattern; the words of the papers for it, and the pages about it."""

    pattern: str
    words: str
    pages: tuple[str, ...] = ()


SUBJECTS = (
    Subject(
        r"renishaw|\bxl-?80\b|\bcarto\b|\bqc-?20\b",
        "instrument laser ball-bar",
        ("howto/instrument-files",),
    ),
    Subject(r"\bball ?bars?\b", "ball-bar"),
    Subject(r"out of square|not square", "squareness", ("tutorials/one-known-number",)),
    Subject(r"\bwindows\b|powershell|cmd\.exe", "windows", ("howto/windows",)),
    Subject(r"\binch(es)?\b|\bimperial\b|\bg20\b", "inches", ("howto/correct",)),
    Subject(
        r"\brotary\b|\b(4|5|four|five)[ -]?ax[ie]s\b|\btilting\b|\brobots?\b",
        "rotary five-axis refused built",
        ("background/limits",),
    ),
    Subject(
        r"\b(many|all|several) (programs|files|parts)\b|\bfolders?\b|\bplants?\b|\bdask\b|\bcluster\b",
        "folder batch",
        ("howto/batch",),
    ),
    Subject(
        r"\bsinumerik\b|\bsiemens\b",
        "sinumerik table control",
        ("howto/sinumerik", "reference/control-tables"),
    ),
    Subject(r"\bmach ?[34]\b|\bmarlin\b|\buccnc\b", "control dialect", ("howto/machine",)),
    Subject(
        r"still (good|right|valid|true)|out of date|expired?|too old", "still good", ("howto/still-good",)
    ),
    Subject(r"\bsigns? of (c0y|b0z|a0z)\b", "positive negative", ("tutorials/one-known-number",)),
    Subject(
        r"\badd (my|our|an?|another) (own )?(control|dialect)\b", "dialect", ("contributing/add-a-dialect",)
    ),
    Subject(r"\bheidenhain\b", "programs built", ("background/limits",)),
    Subject(r"\bnot prove\b", "proof", ("background/proof",)),
    Subject(r"\b(no|nothing|without) chang", "changes corrected", ("howto/correct",)),
    Subject(r"\b(longer|bigger|larger|more lines)\b", "length lines arcs", ("howto/correct",)),
)


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked: stems with how much each counts, and the pages about its subjects."""

    stems: dict[str, float]
    added: dict[str, float]
    pages: frozenset[str]

    @staticmethod
    def of(text: str) -> Question:
        held = [subject for subject in SUBJECTS if re.search(subject.pattern, text.lower())]
        own = stems(text) or stems(text, keep=True)
        added = {stem for subject in held for stem in stems(subject.words)} - set(own)
        pages = frozenset(page for subject in held for page in subject.pages)
        return Question(dict.fromkeys(own, 1.0), dict.fromkeys(added, ADDED), pages)


def best(question: str, sections: Sequence[Section], most: int = 6) -> list[Section]:
    """The sections that answer a question best, the best first; none where no word of it occurs."""
    asked = Question.of(question)
    titles = [set(stems(section.title)) for section in sections]
    page_titles = _page_titles(sections)
    texts = [_counted(section.text) for section in sections]
    mean = sum(text.total() for text in texts) / max(len(texts), 1)
    counted = asked.stems | asked.added
    both = list(zip(titles, texts, strict=True))
    weight = {
        stem: factor * math.log(1.0 + len(sections) / (1 + sum(stem in a or stem in b for a, b in both)))
        for stem, factor in counted.items()
    }

    def score(k: int) -> float:
        page = sections[k].page
        slack = _SATURATION * (1.0 - _LENGTH + _LENGTH * texts[k].total() / max(mean, 1.0))
        parts = (
            weight[stem]
            * (
                IN_TITLE * (stem in titles[k])
                + IN_PAGE_TITLE * (stem in page_titles[page])
                + texts[k][stem] / (texts[k][stem] + slack)
            )
            for stem in counted
        )
        held = [stem for stem in counted if stem in titles[k] or stem in texts[k]]
        share = sum(weight[stem] for stem in held) / max(sum(weight.values()), 1e-9)
        named = NAMED_PAGE if page in asked.pages else 1.0
        begins = BEGINNING if k == 0 or sections[k - 1].page != page else 1.0
        return sum(parts) * share * page_weight(page) * named * begins

    scores = [score(k) for k in range(len(sections))]
    order = sorted(range(len(sections)), key=lambda k: -scores[k])
    return [sections[k] for k in order[:most] if scores[k] > 0.0]


def subject(question: str) -> str:
    """A question without the words that say nothing about its subject."""
    return " ".join(word for word in question.split() if word.lower().strip("?.,") not in EMPTY).strip("?.,")


def stems(text: str, *, keep: bool = False) -> list[str]:
    """Lower-case words without empty ones and short bare numbers; of long ones the beginning only."""
    words = re.findall(r"[\w.+-]*\w", text.lower())
    held = (word for word in words if keep or not (word in EMPTY or re.fullmatch(r"\d{1,2}", word)))
    return [re.sub(r"(?<=\w{3})s$", "", word)[:STEM] for word in held]


@lru_cache(maxsize=4096)
def _counted(text: str) -> Counter[str]:
    return Counter(stems(text))


def page_weight(page: str) -> float:
    """How much a page counts in the ranking, by its name or its group."""
    return _WEIGHT.get(page, _WEIGHT.get(page.rpartition("/")[0], 1.0))


def _page_titles(sections: Sequence[Section]) -> dict[str, set[str]]:
    """The stems of the title of each page, which is that of its first section."""
    titles: dict[str, set[str]] = {}
    for section in sections:
        titles.setdefault(section.page, set(stems(section.title)))
    return titles
