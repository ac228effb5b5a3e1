"""Consoles of Windows: code pages that lack letters, and help in plain ASCII."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from cli.test_cli import PROGRAMS, run

import olp
from olp.cli import main
from olp.cli.common import _encodable

ROOT = Path(olp.__file__).parents[1]
NAME = "Gr\u00f6\u00dfe \u4e2d\u2014\u03a9.ngc"


def verbs(command: click.Command, context: click.Context, name: str) -> Iterator[tuple[str, ...]]:
    if not isinstance(command, click.Group):
        return
    for verb in command.list_commands(context):
        inner = command.get_command(context, verb)
        assert inner is not None
        yield (*name.split(), verb)
        yield from verbs(inner, click.Context(inner), f"{name} {verb}")


def test_help_of_every_verb_is_ascii() -> None:
    calls = [(), *verbs(main, click.Context(main), "")]
    assert len(calls) > 30
    assert [call for call in calls if not run(*call, "--help").stdout.isascii()] == []


@pytest.mark.parametrize("page", ["cp437", "cp850", "cp1252", "ascii"])
def test_what_a_code_page_lacks_is_a_question_mark(page: str) -> None:
    text = _encodable(f"wrote {NAME}", page)
    assert text.encode(page)
    assert text.startswith("wrote Gr") and text.endswith(".ngc")
    assert "\u4e2d" not in text


@pytest.mark.slow
@pytest.mark.parametrize("page", ["cp437", "cp1252", "ascii", "utf-8"])
def test_every_stream_of_a_call_fits_its_console(page: str, tmp_path: Path) -> None:
    for path in (PROGRAMS / "table-router").iterdir():
        shutil.copy(path, tmp_path)
    program = (tmp_path / "outline.ngc").read_bytes()
    (tmp_path / NAME).write_bytes("(\u00d8 3 \u00b0 \u4e2d)\r\n".encode() + program)
    machine = ("-m", "machine.toml")
    for words in (
        ("correct", NAME, *machine, "--force"), ("check", NAME, *machine),
        ("correct", f"absent {NAME}", *machine), ("inspect", NAME, *machine, "--json"),
        ("help", "reference/features"), ("correct", "--help"),
    ):  # fmt: skip
        done = subprocess.run(
            [sys.executable, "-m", "olp", *words], cwd=tmp_path, capture_output=True, check=False,
            env=os.environ | {"PYTHONIOENCODING": f"{page}:strict", "PYTHONPATH": str(ROOT)},
        )  # fmt: skip
        assert done.returncode == (3 if words[1].startswith("absent") else 0), done.stderr
        for stream in (done.stdout, done.stderr):
            stream.decode(page)
            assert b"Traceback" not in stream and b"defect" not in stream
    corrected = (tmp_path / NAME).with_suffix(".corrected.ngc").read_bytes()
    assert "(\u00d8 3 \u00b0 \u4e2d)\r\n".encode() in corrected, "bytes are those of the program"
