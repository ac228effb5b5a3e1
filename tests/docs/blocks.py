"""The fenced blocks of the papers: commands, their output, files that they need."""

from __future__ import annotations

import contextlib
import itertools
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from click.testing import CliRunner

from olp.cli import main
from olp.files import handbook

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "olp" / "docs"
README = ROOT / "README.md"

_FENCE = re.compile(
    r"(?P<mark><!-- [^\n]* -->\n)?^```(?P<kind>\w+)\n(?P<body>.*?)^```\n"
    r"(?:\n```(?P<next>\w+)\n(?P<output>.*?)^```\n)?",
    re.DOTALL | re.MULTILINE,
)
#: First line of a block that is a file to be written.
_PATH = re.compile(r"(?:[#;!] |<!-- |\()([\w./-]+\.\w+)(?: -->|\))?\n")
#: Comment before a block of Python that goes on where the one before it ended.
_CONTINUES = "continues"
#: Printed between two such blocks.
_END = "-- the next block --"
#: A call of `olp` in which no shell has anything to do.
_PLAIN = re.compile(r"olp [^|<>$&;*?`\\]*")
#: End of a command that is meant to fail.
_EXITS = re.compile(r"\s+# exits with (\d)$")


@dataclass(frozen=True)
class Block:
    """A fenced block of a page, the comment before it, and the block right below it."""

    page: str
    kind: str
    mark: str
    body: str
    next_kind: str
    below: str

    @property
    def output(self) -> str:
        return self.below if self.next_kind == "text" else ""

    @property
    def file(self) -> str | None:
        """The file that the block is, None where it is none."""
        match = _PATH.match(self.body)
        return match[1] if match and self.kind in ("toml", "csv", "text", "xml") else None

    @property
    def set_up(self) -> bool:
        """Whether the block makes an environment: it then runs in a copy of the checkout, apart."""
        return ".venv/bin/pip" in self.body


def blocks(path: Path, name: str) -> list[Block]:
    text = path.read_text("utf-8")
    parts, start = [], 0
    while match := _FENCE.search(text, start):
        parts.append(
            Block(
                name,
                match["kind"],
                match["mark"] or "",
                match["body"],
                match["next"] or "",
                match["output"] or "",
            )
        )
        start = match.end("body") + len("```\n")
    return parts


def papers() -> dict[str, list[Block]]:
    """The blocks of README and of all pages, by name, in reading order."""
    pages = {name: blocks(DOCS / f"{name}.md", name) for name in handbook.pages()}
    return {"README": blocks(README, "README"), **pages}


def environment() -> dict[str, str]:
    """That of a user who has this package on the path; what this run promises is not beside the folder."""
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    kept = {key: value for key, value in os.environ.items() if not key.startswith("OLP_REQUIRE_")}
    return kept | {"PATH": path, "COLUMNS": "100"}


def run(body: str, folder: Path) -> tuple[int, str]:
    """Exit code of a text for the shell, and what it writes to stdout and stderr."""
    shell = shutil.which("bash")
    if shell is None:
        pytest.skip("needs bash")
    done = subprocess.run(
        [shell, "-euo", "pipefail", "-c", body], cwd=folder, env=environment(), timeout=300,
        check=False, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    return done.returncode, done.stdout


def called(command: str, folder: Path) -> tuple[int, str]:
    """The same of one command. A call of `olp` is one of this process, so that two hundred of them do not
    import everything anew."""
    if not _PLAIN.fullmatch(command):
        return run(command, folder)
    with contextlib.chdir(folder):
        result = CliRunner(env={"COLUMNS": "100"}).invoke(main, shlex.split(command)[1:])
    assert result.exception is None or isinstance(result.exception, SystemExit), (command, result.exception)
    return result.exit_code, result.output


def problems(
    parts: list[Block], folder: Path, call: Callable[[str, Path], tuple[int, str]] = run
) -> Iterator[str]:
    """Run all blocks of a page in a folder, one after the other, each command by `call`; what goes wrong."""
    for block in parts:
        if block.file is not None:
            target = folder / block.file
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(block.body, "utf-8")
    for number, block in enumerate(parts):
        if block.kind == "sh" and not block.set_up:
            yield from _shell(block, folder, call)
        elif block.kind == "python" and _CONTINUES not in block.mark:
            following = [b for b in parts[number + 1 :] if b.kind == "python"]
            going_on = itertools.takewhile(lambda b: _CONTINUES in b.mark, following)
            yield from _python([block, *going_on], folder)


def _shell(block: Block, folder: Path, call: Callable[[str, Path], tuple[int, str]]) -> Iterator[str]:
    output = ""
    for command in block.body.splitlines():
        wanted = _EXITS.search(command)
        code, text = call(_EXITS.sub("", command), folder)
        output += text
        if code != (int(wanted[1]) if wanted else 0):
            yield f"{block.page}: `{command}` exits with {code}: {text[-500:]}"
    yield from _missing(block, output)


def _python(session: list[Block], folder: Path) -> Iterator[str]:
    """Run blocks one after the other in one process, as a notebook does."""
    body = f"\nprint({_END!r}, flush=True)\n".join(block.body for block in session)
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", body], cwd=folder, env=environment(), capture_output=True,
        text=True, timeout=300,
    )  # fmt: skip
    if done.returncode:
        yield f"{session[0].page}: python: {done.stderr[-500:]}"
        return
    for block, output in zip(session, done.stdout.split(_END), strict=True):
        yield from _missing(block, output)


def _missing(block: Block, output: str) -> Iterator[str]:
    """What a page shows as output, and is not in it."""
    rest = masked(output)
    for part in block.output.split("...\n") if block.output else ():
        if masked(part) not in rest:
            yield f"{block.page}: not in the output of `{block.body.strip()}`: {part.strip()}"
        else:
            rest = rest.partition(masked(part))[2] if part else rest


def masked(text: str) -> str:
    """Text without its numbers and the width of its gaps."""
    return re.sub(r"\s+", " ", re.sub(r"[-\d.]*\d[\d.]*", "#", text)).strip()
