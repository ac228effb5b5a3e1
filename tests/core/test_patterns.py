"""Patterns that are compiled when they are first used behave as those of the standard library, the judge."""

from __future__ import annotations

import copy
import pickle
import re

import pytest

from olp.core.patterns import pattern

TEXT = rb"([a-z]+)=(?P<number>\d*)"


def test_a_pattern_is_compiled_when_it_is_first_used(monkeypatch: pytest.MonkeyPatch) -> None:
    compiled = []
    monkeypatch.setattr(re, "compile", lambda text, flags: compiled.append(text) or re._compile(text, flags))  # type: ignore[attr-defined]
    late = pattern(TEXT, re.IGNORECASE)
    assert late.pattern == TEXT
    assert compiled == []
    assert [m[1] for m in late.finditer(b"A=1 b=2")] == [b"A", b"b"]
    assert late.search(b"c=") and late.fullmatch(b"c=3") and late.match(b"=") is None
    assert compiled == [TEXT]


def test_it_has_what_a_pattern_has() -> None:
    late, judge = pattern(TEXT, re.IGNORECASE), re.compile(TEXT, re.IGNORECASE)
    assert (late.flags, late.groups, dict(late.groupindex)) == (judge.flags, judge.groups, judge.groupindex)
    for text in (b"", b"A=1,b=22", b"none"):
        assert late.findall(text) == judge.findall(text)
        assert late.split(text) == judge.split(text)
        assert late.sub(b"<\\1>", text) == judge.sub(b"<\\1>", text)
        assert late.subn(b"", text, 1) == judge.subn(b"", text, 1)
    with pytest.raises(AttributeError, match="no attribute 'scan'"):
        late.scan  # type: ignore[attr-defined]  # noqa: B018


def test_a_copy_and_one_from_another_process_are_the_same_pattern() -> None:
    late = pattern(r"a+", re.MULTILINE)
    late.match("a")
    for twin in (copy.deepcopy(late), pickle.loads(pickle.dumps(late))):
        assert (twin.pattern, twin.flags) == (late.pattern, late.flags)
        assert twin.findall("aa b a") == ["aa", "a"]
    assert repr(late) == "pattern('a+', 8)"
