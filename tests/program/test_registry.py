"""Which dialect a text is in: by name, by text, by the ending of its file, by the control; and payloads."""

from __future__ import annotations

from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine

from olp.core.errors import ProgramError, UsageError
from olp.files.config import load_setup
from olp.program.registry import DIALECTS, dialect_of, find, named, read

HAAS = DIALECTS["haas"]
SHARED = b"GOTO/1,2,3\n"


def chosen(name: str | None, data: bytes, file: str, control: str = "haas") -> str:
    return dialect_of(name, DIALECTS[control], data, file).name


def test_names() -> None:
    assert named("haas") is find("haas") is HAAS
    assert find("has") is None
    with pytest.raises(UsageError, match="'HASS'; did you mean haas"):
        named("HASS")
    with pytest.raises(UsageError, match="expected one of linuxcnc, fanuc, grbl, haas, apt"):
        named("?")


def test_a_name_comes_before_all_signs() -> None:
    assert chosen("grbl", b"PARTNO/1\n", "a.cls") == "grbl"


@pytest.mark.parametrize("file", ("a.cls", "A.CLS", "a.ncl.3"))
def test_an_ending_comes_before_the_control(file: str) -> None:
    assert chosen(None, b"", file) == "apt"
    assert chosen(None, b"", "cls") == "apt"
    assert chosen(None, b"", "a.nc") == "haas"
    assert chosen(None, b"", "a.cls.nc") == "haas"


def test_a_text_that_two_dialects_share_is_decided_by_ending_or_control() -> None:
    assert chosen(None, SHARED, "a.dmi") == "dmis"
    assert chosen(None, SHARED, "a.ncl") == "apt"
    assert chosen(None, SHARED, "a.txt", "apt") == "apt"
    with pytest.raises(ProgramError, match="may be apt or dmis; name its dialect"):
        chosen(None, SHARED, "a.txt")


def test_a_text_that_its_ending_contradicts_is_refused() -> None:
    text = b"DMISMN/'a',05.2\nGOTO/1,2,3\n"
    assert chosen(None, text, "a.txt") == "dmis"
    with pytest.raises(ProgramError, match="ending of the file is that of apt, and its text is dmis"):
        chosen(None, text, "a.ncl")


@pytest.mark.parametrize(("before", "line"), [(b"", 1), (b"FROM/0,0,0\nFEDRAT/100,MMPM\n", 3)])
def test_a_payload_comment_of_a_dialect_that_has_none_is_refused(
    tmp_path: Path, before: bytes, line: int
) -> None:
    setup = load_setup(machine(tmp_path, tables=TRUE_ZERO), None)
    with pytest.raises(ProgramError, match=r"a comment changes the payload: .* one payload") as caught:
        read(before + b"PPRINT (olp payload 30 kg)\nGOTO/1,2,3\n", setup, DIALECTS["apt"])
    assert caught.value.line == line
