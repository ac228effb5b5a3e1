"""New elements in the data of an application: targets of clones and of parts, and how parts are passed."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping

from olp.core.errors import ProgramError
from olp.core.patterns import pattern
from olp.program.robots.dialect import Replacement
from olp.program.robots.targets import Span, Target
from olp.program.robots.val3.data import Datum, Entry, stated
from olp.program.robots.val3.files import application
from olp.program.text.line_ends import LINE_END
from olp.program.text.numbers import spliced

#: mm before and behind its end in which a part goes over into the next one.
_BLEND = b"0.5"
_WORD = pattern(rb"\s(\w+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
_BLENDS = pattern(rb"\sblend\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
_TAG = pattern(rb"<([^\s/>]+)")
_INDEX = pattern(rb"\b(?:key|index)\s*=\s*[\"']\s*(\d+)")
#: Stands for the motion description of parts until all of them are known.
_PASSING = pattern(rb"\0([^\0]*)\0([^\0]*)\0")


@functools.lru_cache(maxsize=2)
def declared(data: bytes) -> Mapping[str, Datum]:
    """The data of a text by their names."""
    return {datum.name: datum for datum in application(data).data}


@functools.lru_cache(maxsize=2)
def _entries(data: bytes) -> Mapping[Span, tuple[Datum, Entry]]:
    """The elements of all data by their bytes."""
    every = declared(data).values()
    return {entry.span: (datum, entry) for datum in every for entry in datum.entries.values()}


@functools.lru_cache(maxsize=2)
def _ends(data: bytes) -> Mapping[str, int]:
    """Where the last element of each datum ends."""
    return {datum.name: datum.end for datum in declared(data).values() if datum.entries}


@functools.lru_cache(maxsize=2)
def following(data: bytes) -> Mapping[str, int]:
    """The first index of each datum that no element has."""
    return {datum.name: datum.following(data) for datum in declared(data).values()}


def declared_at(data: bytes, target: Target, *, whole: bool = False) -> tuple[Datum, Entry]:
    """The entry in which a target is declared, `whole` where all its numbers have to be those of it. Raises
    ProgramError where it cannot be declared again."""
    found = _entries(data).get(target.declaration)
    if found is None or (whole and found[1].host != target.value):
        raise ProgramError(
            "moves to this target want different numbers of it, and it has no element of its own in the data "
            "that could be written again; give each move its own target",
            line=target.line,
            code="OLP561",
        )
    return found


def element(data: bytes, datum: Datum, entry: Entry, index: str, texts: Mapping[str, bytes]) -> Replacement:
    """A further element of a datum, behind its last one, with other numbers."""
    begin, end = entry.span
    edits = stated(data, entry, dict(texts))
    if entry.index[1] > entry.index[0]:
        edits.append((*entry.index, index.encode()))
    else:
        tag = _TAG.match(data, begin)
        assert tag is not None
        edits.append((tag.end(), tag.end(), b' key="' + index.encode() + b'"'))
    own = spliced(data[begin:end], [(a - begin, b - begin, text) for a, b, text in edits])
    place = _ends(data)[datum.name]
    return place, place, _lead(data, entry) + own


def _lead(data: bytes, entry: Entry) -> bytes:
    """What stands between an element and the one before it, where it has a line of its own."""
    begin = max(data.rfind(b"\n", 0, entry.span[0]), data.rfind(b"\r", 0, entry.span[0])) + 1
    blanks = data[begin : entry.span[0]]
    if blanks.strip() or begin == 0:
        return b""
    ends = list(LINE_END.finditer(data, max(begin - 4, 0), begin))
    return ends[-1][0] + blanks


def numbers_of(data: bytes, entry: Entry, text: bytes) -> dict[str, bytes]:
    """The numbers that the host of an entry has where `text` is written instead of it. Those that the data
    leave out stand within its name there."""
    tag = _TAG.match(data, *entry.host)
    assert tag is not None
    number = rb"([-+.\d]*)"
    letters = [re.escape(tag[1][k : k + 1]) for k in range(len(tag[1]))]
    match = re.match(b"<" + number + number.join(letters) + number, text)
    assert match is not None
    found = {name: match[k] for k, name in enumerate(entry.slots, 1) if k <= len(letters) + 1 and match[k]}
    for name, first, second in _WORD.findall(text):
        if name.decode() in entry.slots:
            found[name.decode()] = (first or second).strip()
    return found


def passing(name: str, index: str) -> bytes:
    """The motion description of parts that are made from one of the data."""
    return b"\0" + name.encode() + b"\0" + index.encode() + b"\0"


@functools.lru_cache(maxsize=64)
def is_assigned(data: bytes, name: bytes) -> bool:
    """Whether a program gives a motion description other values."""
    form = rb"\b" + re.escape(name) + rb"\b\s*(?:\[[^\[\]]*\])?\s*(?:\.\s*\w+\s*)?=(?!=)"
    return re.search(form, data) is not None


def copied(passing: bytes, own: bytes) -> list[bytes]:
    """Statements that make the motion description of parts from one that changes in the run."""
    words = (b".blend=joint", b".leave=" + _BLEND, b".reach=" + _BLEND)
    return [passing + b"=" + own, *(passing + word for word in words)]


def completed(data: bytes, edits: list[Replacement]) -> list[Replacement]:
    """As `RobotDialect.completed`: numbers that were left out, motion descriptions of parts, and sizes."""
    edits = _left_out(data, edits)
    edits = _passed(data, edits)
    known = declared(data)
    ends = {place: known[name] for name, place in _ends(data).items()}
    largest: dict[int, int] = {}
    for a, b, text in edits:
        index = _INDEX.search(text) if a == b and a in ends else None
        if index is not None:
            largest[a] = max(largest.get(a, 0), int(index[1]))
    for place, last in largest.items():
        size = ends[place].size
        if size is not None and int(data[slice(*size)]) <= last:
            edits.append((*size, str(last + 1).encode()))
    return edits


def _left_out(data: bytes, edits: list[Replacement]) -> list[Replacement]:
    places: dict[int, tuple[Entry, str]] = {}
    for datum in declared(data).values():
        for entry in datum.entries.values():
            places.update({a: (entry, name) for name, ((a, b), _) in entry.slots.items() if a == b})
    kept: list[Replacement] = []
    texts: dict[Span, tuple[Entry, dict[str, bytes]]] = {}
    for a, b, text in edits:
        if a == b and a in places:
            entry, name = places[a]
            texts.setdefault(entry.span, (entry, {}))[1][name] = text
        else:
            kept.append((a, b, text))
    for entry, own in texts.values():
        kept += stated(data, entry, own)
    return kept


def _passed(data: bytes, edits: list[Replacement]) -> list[Replacement]:
    """Edits with motion descriptions that let parts pass, each of which is declared once."""
    known, names, added = declared(data), {}, []
    used: dict[str, int] = {}
    for _, _, text in edits:
        for match in _PASSING.finditer(text):
            name, index = match[1].decode(), match[2].decode()
            if match[0] in names:
                continue
            datum = known[name]
            own = used.get(name, following(data)[name])
            used[name] = own + 1
            names[match[0]] = f"{name}[{own}]".encode()
            entry = datum.entries[index]
            a, b, made = element(data, datum, entry, str(own), {"leave": _BLEND, "reach": _BLEND})
            added.append((a, b, _blending(made, _TAG.match(data, *entry.host))))
    if not names:
        return edits
    return [(a, b, _PASSING.sub(lambda m: names[m[0]], text)) for a, b, text in edits] + added


def _blending(text: bytes, tag: re.Match[bytes] | None) -> bytes:
    """An element of a motion description with which the robot goes over into the next move."""
    match = _BLENDS.search(text)
    if match is not None:
        a, b = match.span(1) if match[1] is not None else match.span(2)
        return text[:a] + b"joint" + text[b:]
    assert tag is not None
    place = text.index(tag[0]) + len(tag[0])
    return text[:place] + b' blend="joint"' + text[place:]
