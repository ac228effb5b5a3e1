"""Parametric programs with `--flatten`: which are read, and why the others are refused.

    python tests/program/rs274/flatten/survey.py [FOLDER ...]

Without folders: the programs that LinuxCNC installs, and the RS-274 programs of the corpus. Offsets and tools
are zero. A program counts where it has parameters, flow or calls. Judge of each is whether LinuxCNC runs it,
so that probe macros, lathes and libraries without a call are told apart.
"""

from __future__ import annotations

import hashlib
import re
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from judge import linuxcnc, machines

from olp.core.errors import OlpError
from olp.workflows import refusals
from olp.workflows.flatten import UnrollOptions
from olp.workflows.session import Session

INSTALLED = (Path("/usr/share/linuxcnc/ncfiles"), Path("/usr/share/doc/linuxcnc/examples"))
CORPUS = {"gcode_cncjs": "grbl", "gcode_fanuc": "fanuc", "gcode_fanuc_haas_nist": "haas"}
LARGEST = 300_000
#: bytes of a program of the corpus that the count looks at, at most: larger ones are of the same machines
LARGEST_COUNTED = 100_000
TOOLS = dict.fromkeys(range(1, 100), (0.0, 0.0, 0.0))
_COMMENT = re.compile(rb"\([^)]*\)|;[^\r\n]*")
_PARAMETRIC = re.compile(rb"(?im)#|^\s*(?:n\d+)?\s*o\s*[<\d\[]|\bm\s*0*9[78]\b|\bg\s*0*6[56]\b|goto|while")


def installed() -> list[tuple[Path, str]]:
    """Programs of LinuxCNC, each content once."""
    paths: dict[bytes, Path] = {}
    for folder in INSTALLED:
        for path in sorted(folder.rglob("*.ngc")):
            if path.is_file() and path.stat().st_size <= LARGEST:
                paths.setdefault(hashlib.sha256(path.read_bytes()).digest(), path)
    return [(path, "linuxcnc") for path in paths.values()]


def of_corpus(corpus: Path) -> list[tuple[Path, str]]:
    """The RS-274 programs of the corpus with their controls."""
    folders = ((corpus / folder, control) for folder, control in CORPUS.items())
    return [(path, control) for folder, control in folders for path in sorted(folder.iterdir())]


def parametric(text: bytes) -> bool:
    """Whether a text has parameters, flow or calls."""
    return bool(_PARAMETRIC.search(_COMMENT.sub(b"", text)))


def setup(folder: Path, control: str) -> Path:
    """The machine file of a control whose tools and offsets are zero."""
    tools = {n: {"Z_mm": 0.0, "radius_mm": 1.0} for n in range(1, 100)}
    offsets = {f"G{n}": {"Z_mm": 0.0, "set_by": "true"} for n in (*range(54, 60), 59.1, 59.2, 59.3)}
    recipe = machines.Recipe(controller=control, travel=((-9e4, 9e4),) * 3, tools=tools, work_offsets=offsets)
    machine = machines.zero_machine(folder / control, recipe)
    # `X0Y50` is beside `X50.Y0` in those of the corpus
    text = machine.read_text()
    machine.write_text(text.replace('decimal_point = "increment"', 'decimal_point = "calculator"'))
    job = machine.with_name("job.toml")
    start = "start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }\n"
    job.write_text(f'schema = "olp-job-1"\nmachine = "machine.toml"\n{start}')
    return job


def reading(path: Path, job: Path) -> str:
    """Why a program is refused with `--flatten`, and with `--expand-cycles` too; empty where it is read."""
    session = Session.start(job.with_name("machine.toml"), job)
    source = session.sources.source(path)
    why = ""
    for expand in (False, True):
        try:
            source.load()
            options = UnrollOptions(flatten=True, expand_cycles=expand)
            refusals.read(session.sources, source, *session.reading(source), None, options, words=False)
        except OlpError as error:
            why = why or str(error)
        else:
            return ""
    return why


def runs(path: Path) -> bool:
    """Whether LinuxCNC runs a program, and it moves."""
    try:
        canon = linuxcnc.interpret(path.read_bytes(), tools=TOOLS, find_known=False)
    except (linuxcnc.InterpreterError, subprocess.SubprocessError, RuntimeError):
        return False
    return len(canon) > 0


def refused_that_run() -> tuple[int, dict[str, str]]:
    """How many parametric programs of LinuxCNC it runs, and the names of those that are refused, each with
    its reasons."""
    count, why = 0, {}
    with tempfile.TemporaryDirectory() as folder:
        job = setup(Path(folder), "linuxcnc")
        for path, _ in installed():
            if parametric(path.read_bytes()) and runs(path):
                count += 1
                if reason := reading(path, job):
                    why[path.name] = reason
    return count, why


def refused_of_corpus(corpus: Path) -> tuple[int, dict[str, str]]:
    """How many parametric programs the corpus has, large ones left out, and the names of those that are
    refused, each with its reasons."""
    count, why = 0, {}
    with tempfile.TemporaryDirectory() as folder:
        jobs = {control: setup(Path(folder), control) for control in CORPUS.values()}
        for path, control in of_corpus(corpus):
            if path.stat().st_size <= LARGEST_COUNTED and parametric(path.read_bytes()):
                count += 1
                if reason := reading(path, jobs[control]):
                    why[path.name] = reason
    return count, why


def main(folders: list[str]) -> None:
    """Print each refused program with its reason, and the shares."""
    paths = (path for folder in folders for path in sorted(Path(folder).rglob("*")))
    given = [(path, "linuxcnc") for path in paths if path.is_file()]
    shared = Path(__file__).resolve().parents[5] / "shared" / "corpus"
    programs = given or [*installed(), *(of_corpus(shared) if shared.is_dir() else [])]
    counted: Counter[tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        jobs = {control: setup(Path(folder), control) for control in {control for _, control in programs}}
        for path, control in programs:
            if not parametric(path.read_bytes()):
                continue
            kind = "run by LinuxCNC" if control == "linuxcnc" and runs(path) else f"{control}, not judged"
            why = reading(path, jobs[control])
            counted[kind, "refused" if why else "read"] += 1
            if why:
                print(f"[{kind}] {path.name}: {why}"[:400], flush=True)
    for (kind, state), count in sorted(counted.items()):
        print(f"{kind}: {count} {state}")


if __name__ == "__main__":
    main(sys.argv[1:])
