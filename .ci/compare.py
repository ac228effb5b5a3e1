#!/usr/bin/env python3
"""Proves that a change of structure changed no behaviour: runs thousands of commands with the package as it was
at a base commit and as it is in a tree, and compares exit codes, stdout, stderr and every file as bytes.

    python .ci/compare.py [--base COMMIT] [--tree PATH] [--work DIR] [--jobs 2] [--only TEXT] [--expect FILE]
    python .ci/compare.py --self        # the base against itself: is any of it left to chance?

Run it with an interpreter that has the dependencies of the package, else an environment is made in DIR. Inputs
are those of the base commit (programs/, tests/, README.md) and of ../shared where that is there, so a tree may
move its own. A case is a folder of inputs and steps that run in it one after another, at the same path for both
sides. After each step of the tree the folder is put to what the base left, so no difference hides the next.
What the base did is kept in DIR; of differences, both sides are kept in DIR/differences. `--expect` names cases
that may differ (fnmatch patterns of "CASE: STEP" or CASE, one a line, `# reason`). Exit code 1: any other does.

Steps run in forks of one process a side that has imported the package; those of the README and --help start
interpreters of their own, so that the order of imports is tried too. Normalised is what names places in the
source and nothing else: frames of tracebacks, module paths of exceptions, file and line of Python's warnings,
addresses of objects. Left out are inputs on which the base hangs (repro/interpreter/7 and 9).
"""

from __future__ import annotations

import argparse
import contextlib
import difflib
import fcntl
import fnmatch
import hashlib
import json
import os
import pickle
import random
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tarfile
import threading
import time
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
CPU_S, WALL_S = 60, 900.0  # a step that takes more is a timeout: nothing else of it is compared
LIMIT_BYTES = 8 << 30
NEEDS = "import numpy, scipy, ruckig, trimesh, meshcat, pydantic, click, rich, matplotlib"
DAY = "--date 2026-06-01"
say = sys.stdout.write

# -- the server: one process a side and job, a fork a step ---------------------------------------------------


def serve() -> None:
    """Requests, one a line, on what was stdin; answers on what was stdout."""
    import gc
    import importlib
    import pkgutil

    asked, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(os.open(os.devnull, os.O_RDWR), 0)
    os.dup2(2, 1)
    del sys.path[0]
    import olp

    for name in [
        "scipy.interpolate",
        "scipy.optimize",
        "scipy.spatial",
        "scipy.stats.qmc",
        "matplotlib.figure",
    ]:
        importlib.import_module(name)
    for module in pkgutil.walk_packages(olp.__path__, "olp."):
        if not module.name.endswith("__main__"):
            try:
                importlib.import_module(module.name)
            except Exception:
                sys.modules.pop(module.name, None)  # a case that needs it says so
    answers.write(f"{olp.__file__}\n".encode())
    gc.collect()
    gc.freeze()
    for line in asked:
        request = json.loads(line)
        child = os.fork()
        if child == 0:
            _step(request)
        code, seconds = _wait(child, request["timeout"])
        answers.write(f"{code} {seconds}\n".encode())


def _wait(child: int, timeout: float) -> tuple[object, float]:
    """Exit code and CPU time."""
    end, pause = time.monotonic() + timeout, 0.002
    while time.monotonic() < end:
        done, status, used = os.wait4(child, os.WNOHANG)
        if done:
            code = os.waitstatus_to_exitcode(status)
            over = code in (-signal.SIGXCPU, 128 + signal.SIGXCPU)
            return "timeout" if over else code, used.ru_utime + used.ru_stime
        time.sleep(pause)
        pause = min(1.2 * pause, 0.05)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return "timeout", timeout


def _step(request: dict[str, Any]) -> None:
    """One step, in a child."""
    import atexit
    import resource
    import runpy
    import traceback

    os.setsid()
    os.chdir(request["folder"])
    resource.setrlimit(resource.RLIMIT_AS, (LIMIT_BYTES, LIMIT_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S + 5))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        flags = os.O_RDONLY if number == 0 else os.O_WRONLY | os.O_CREAT | os.O_TRUNC
        os.dup2(os.open(request[name], flags), number)
    kind, what = request["kind"], request["what"]
    if kind == "shell":
        os.execvp("bash", ["bash", "-euo", "pipefail", "-c", what])
    if kind == "start":
        os.execv(sys.executable, [sys.executable, "-m", "olp", *what])
    code: object = 0
    try:
        if kind == "python":
            exec(compile(what, "<case>", "exec"), {"__name__": "__main__"})
        else:
            sys.argv = ["olp", *what]
            runpy.run_module("olp", run_name="__main__")
    except SystemExit as end:
        code = end.code
    except BaseException:
        traceback.print_exc()
        code = 1
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code if isinstance(code, int) else int(code is not None))


class Server:
    """The other end."""

    def __init__(self, place: Place, package: Path) -> None:
        words = [place.python, str(Path(__file__).resolve()), "--serve"]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(words, stdin=pipe, stdout=pipe, env=place.environment(package))
        self.package = Path(self._answer()).resolve().parents[1]
        if self.package != package.resolve():
            raise SystemExit(f"olp was imported from {self.package}, not from {package}")

    def _answer(self) -> str:
        assert self.process.stdout
        line = self.process.stdout.readline().decode().strip()
        if not line:
            raise SystemExit("a server ended: can the package be imported?")
        return line

    def run(self, kind: str, what: object, folder: Path, given: Path, streams: Path) -> Any:
        """Exit code, stdout, stderr."""
        out, err = streams.with_suffix(".out"), streams.with_suffix(".err")
        files = {"stdin": str(given), "stdout": str(out), "stderr": str(err)}
        request = {"kind": kind, "what": what, "folder": str(folder), "timeout": WALL_S, **files}
        assert self.process.stdin
        self.process.stdin.write(json.dumps(request).encode() + b"\n")
        self.process.stdin.flush()
        code, seconds = self._answer().split()
        return code, normal(out.read_bytes()), normal(err.read_bytes()), float(seconds)


def normal(text: bytes) -> bytes:
    """Output without places in the source."""
    text = re.sub(rb"Traceback \(most recent call last\):\n(?:  .*\n)+", b"Traceback\n", text)
    text = re.sub(rb"(?m)^olp(?:\.\w+)+\.(\w+)(?=:|$)", rb"\1", text)
    text = re.sub(rb"(?m)^\S+\.py:\d+: (\w*Warning: .*\n)(?:  .*\n)?", rb"\1", text)
    return re.sub(rb" at 0x[0-9a-f]+", b" at 0x", text)


# -- both sides ----------------------------------------------------------------------------------------------


@dataclass
class Place:
    """Where the base, its inputs and what was found are kept."""

    work: Path
    commit: str
    python: str = sys.executable

    def __post_init__(self) -> None:
        for name in ("done", "run", "locks", "bin"):
            (self.work / name).mkdir(parents=True, exist_ok=True)
        with self.alone("place"):
            self._prepare()

    @contextlib.contextmanager
    def alone(self, name: str) -> Iterator[None]:
        """Several runs may share a folder: one at a time prepares it, and one at a time is at a case."""
        with (self.work / "locks" / name).open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield

    def _prepare(self) -> None:
        self.source, self.base = self.work / f"source-{self.commit}", self.work / f"base-{self.commit}"
        self.made = self.work / f"made-{self.commit}-{hashlib.sha256(MAKE.encode()).hexdigest()[:8]}"
        if not self.source.is_dir():
            words = ["git", "-C", str(ROOT), "archive", self.commit]
            archive = subprocess.run(words, check=True, stdout=subprocess.PIPE).stdout
            with tarfile.open(fileobj=BytesIO(archive)) as packed:
                packed.extractall(self.source, filter="data")
        wheels = self.work / f"wheel-{self.commit}"
        if not list(wheels.glob("*.whl")):
            words = ["-m", "pip", "wheel", "-q", "--no-deps", "-w", str(wheels), str(self.source)]
            subprocess.run([self.python, *words], check=True)
        wheel = next(wheels.glob("*.whl"))
        if not self.base.is_dir():
            zipfile.ZipFile(wheel).extractall(self.base)
        if subprocess.run([self.python, "-c", NEEDS], stderr=subprocess.DEVNULL).returncode:
            self.python = str(self.work / "venv/bin/python")
            if not Path(self.python).exists():
                subprocess.run([sys.executable, "-m", "venv", str(self.work / "venv")], check=True)
                subprocess.run([self.python, "-m", "pip", "install", "-q", str(wheel)], check=True)
        for name, words in (("olp", " -m olp"), ("python", "")):
            shim = self.work / "bin" / name
            shim.write_text(f'#!/bin/sh\nexec "{self.python}"{words} "$@"\n')
            shim.chmod(0o755)
        if not self.made.is_dir():
            start = self.environment(self.base, self.source / "tests")
            draft = self.made.with_suffix(".draft")
            subprocess.run([self.python, "-c", MAKE, str(draft)], check=True, env=start)
            subprocess.run([self.python, "-c", "import matplotlib.font_manager"], check=True, env=start)
            draft.rename(self.made)

    def environment(self, *packages: Path) -> dict[str, str]:
        one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        return one | {
            "PATH": f"{self.work / 'bin'}:/usr/local/bin:/usr/bin:/bin", "HOME": str(self.work / "home"),
            "PYTHONPATH": os.pathsep.join(map(str, packages)), "PYTHONHASHSEED": "0", "TZ": "UTC",
            "PYTHONPYCACHEPREFIX": str(self.work / "pycache"), "MPLCONFIGDIR": str(self.work / "matplotlib"),
            "LC_ALL": "C.UTF-8", "TERM": "dumb", "COLUMNS": "100", "NO_COLOR": "1",
        }  # fmt: skip


@dataclass
class Case:
    """Folders and files to copy, texts to write, and steps: (kind, words or text, stdin)."""

    name: str
    copies: list[tuple[Path, str]]
    steps: list[tuple[str, Any, bytes]]
    texts: dict[str, bytes] = field(default_factory=dict)

    def slug(self) -> str:
        return re.sub(r"[^\w.-]+", "_", self.name)

    def files(self) -> dict[str, bytes]:
        out: dict[str, bytes] = {}
        for source, target in self.copies:
            for path in [source] if source.is_file() else sorted(source.rglob("*")):
                if path.is_file() and "__pycache__" not in path.parts:
                    out[str(Path(target) / path.relative_to(source))] = path.read_bytes()
        return out | self.texts

    def key(self, place: Place) -> str:
        files = {name: hashlib.sha256(data).hexdigest() for name, data in self.files().items()}
        stated = ["2", place.commit, str(place.work), sys.version, self.name, files, self.steps]
        return hashlib.sha256(repr(stated).encode()).hexdigest()[:24]


@dataclass
class Done:
    """What a step did; files that it made or changed, None for those it removed."""

    code: str
    stdout: bytes
    stderr: bytes
    files: dict[str, bytes | None]
    seconds: float = field(default=0.0, compare=False)

    def parts(self) -> dict[str, bytes | None]:
        return {"exit code": self.code.encode(), "stdout": self.stdout, "stderr": self.stderr} | self.files


def title(step: tuple[str, Any, bytes]) -> str:
    text = step[1] if isinstance(step[1], str) else " ".join(step[1])
    return f"{step[0]} {text}".replace("\n", " / ")


def read_all(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def put(folder: Path, name: str, data: bytes | None) -> None:
    path = folder / name
    if data is None:
        path.unlink(missing_ok=True)
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)


def perform(case: Case, server: Server, place: Place, base: list[Done] | None) -> list[Done]:
    """Run all steps; on the side of the tree, go on from what the base left after each."""
    folder = place.work / "run" / case.slug()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    state = case.files()
    for name, data in state.items():
        put(folder, name, data)
    streams = folder.with_name(folder.name + ".streams")
    given, done = streams.with_suffix(".in"), []
    for number, (kind, what, stdin) in enumerate(case.steps):
        given.write_bytes(stdin)
        code, out, err, seconds = server.run(kind, what, folder, given, streams)
        now = read_all(folder)
        changed = {n: now.get(n) for n in sorted(now | state) if now.get(n) != state.get(n)}
        if code == "timeout":
            done.append(Done(code, b"", b"", {}, seconds))
        else:
            done.append(Done(code, out, err, changed, seconds))
        wanted = done[-1].files if base is None else base[number].files
        for name in changed | wanted:
            if changed.get(name, b"-") != wanted.get(name, b"+"):
                put(folder, name, wanted[name] if name in wanted else state.get(name))
        state = {n: d for n, d in (state | wanted).items() if d is not None}
    shutil.rmtree(folder)
    for rest in folder.parent.glob(folder.name + ".*"):
        rest.unlink()
    return done


# -- differences ---------------------------------------------------------------------------------------------


def lines(data: bytes | None) -> list[str]:
    """A part as lines for people."""
    if data is None:
        return ["(removed)"]
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return [f"({len(data)} bytes, sha256 {hashlib.sha256(data).hexdigest()[:16]})"]
    if text.startswith(("{", "[")):
        with contextlib.suppress(ValueError):
            text = json.dumps(json.loads(text), indent=1)
    return text.splitlines() + ([] if text.endswith("\n") else ["(no end of line)"])


def difference(a: Done, b: Done, keep: Path) -> list[str]:
    out: list[str] = []
    ours, theirs = a.parts(), b.parts()
    for name in dict.fromkeys([*ours, *theirs]):
        one, two = ours.get(name), theirs.get(name)
        if one == two and (name in ours) == (name in theirs):
            continue
        first = lines(one) if name in ours else ["(not touched)"]
        second = lines(two) if name in theirs else ["(not touched)"]
        found = list(difflib.unified_diff(first, second, "base", "tree", n=0, lineterm=""))[2:]
        found = found or ["(the bytes differ, as in blanks or line ends)"]
        out += [f"    {name}", *(f"      {line[:200]}" for line in found[:10])]
        out += [f"      ... {len(found) - 10} lines more"] if len(found) > 10 else []
        for side, data in (("base", one), ("tree", two)):
            if data is not None:
                put(keep, f"{name.replace('/', '_')}.{side}", data)
    return out


# -- the cases -----------------------------------------------------------------------------------------------

#: Written by the base's own tests, into argv[1]: machines, random programs, a job for each finding of the gate.
MAKE = r"""
import json, sys
from pathlib import Path
import numpy as np
from gate_cases import CASES, DAY, Call, ARC, box
from judge import machines, programs, retime_programs
from judge.machines import Recipe
from posts import FLAVOURS, apt, gcode, job
out = Path(sys.argv[1])
for code, calls in CASES.items():
    for name, call in zip(("hit", "miss"), calls):
        folder = out / "gate" / f"{code}-{name}"
        call.machine(folder)
        (folder / "part.ngc").write_bytes(call.program())
        words = []
        if call.nominal is not None:
            (folder / "nominal.ngc").write_bytes(call.head + call.nominal)
        for key, value in {"date": DAY, **call.options}.items():
            option = "--" + key.replace("_", "-")
            words += [option] if value is True else [] if value is None else [option, str(value)]
        (folder / "options.json").write_text(json.dumps(words))
big = ((-3000.0, 3000.0),) * 3
tools = {n: {"Z_mm": 100.0 + n, "radius_mm": 3.0} for n in range(1, 31)}
frames = {f"G{n}": {"X_mm": 5.0 * (n - 54), "Y_mm": 2.0, "Z_mm": -200.0, "set_by": "true"} for n in range(54, 60)}
frames["MCS"] = {"set_by": "true"}
start = 'schema = "olp-job-1"\nmachine = "machine.toml"\nstart_mm = { X = 0.0, Y = 0.0, Z = 100.0 }\n'
for name in ("linuxcnc", "grbl", "fanuc", "fanuc-calculator", "haas", "apt", "dmis", "list", "kawasaki-as"):
    recipe = Recipe(controller=name.split("-calc")[0], travel=big, tools=tools, work_offsets=frames)
    path = machines.random_machine(out / "machines" / name, 5, recipe)
    if "calculator" in name:
        path.write_text(path.read_text().replace("controller =", 'decimal_point = "calculator"\ncontroller =', 1))
    path.with_name("job.toml").write_text(start)
chains = machines.CHAINS
for seed in range(24):
    recipe = Recipe(chain=chains[seed % 24], cyclic=seed % 3 == 0, off_datum=seed % 2 == 0,
        backlash_um={"X": 6.0, "Y": 3.0} if seed % 4 == 1 else {}, directed="XZ" if seed % 4 == 3 else "",
        on_table=chains[seed % 24].split("F")[0] if seed % 5 == 0 else "")
    folder = out / "random" / str(seed)
    machines.random_machine(folder, seed, recipe)
    (folder / "part.ngc").write_bytes(programs.random_program(seed, blocks=8))
    (folder / "motion.ngc").write_bytes(retime_programs.program(seed))
    (folder / "post.ngc").write_bytes(gcode(job(seed)))
    (folder / "post.apt").write_bytes(apt(job(seed), FLAVOURS[seed % 5]))
"""

API = r"""
import dataclasses, inspect, json, re
import olp
def say(*parts):
    print(re.sub(r"\bolp(\.\w+)+\.", "", " ".join(str(p) for p in parts)))
def members(c):
    return {n: m for b in reversed(c.__mro__[:-1]) for n, m in vars(b).items() if n[0] != "_"}
say(olp.__all__, dir(olp), olp.__version__)
for name in olp.__all__:
    thing = getattr(olp, name)
    say("==", name, type(thing).__name__, inspect.getdoc(thing))
    try:
        say(inspect.signature(thing))
    except ValueError:
        pass
    if inspect.isclass(thing):
        say([b.__name__ for b in thing.__mro__], getattr(thing, "exit_code", None))
        for f in dataclasses.fields(thing) if dataclasses.is_dataclass(thing) else ():
            say("  field", f.name, f.type, f.default if f.default is not dataclasses.MISSING else "")
        for n, m in members(thing).items():
            say("  member", n, type(m).__name__, inspect.signature(m) if inspect.isfunction(m) else "")
"""

CALLS = r"""
import json, re
from pathlib import Path
import numpy as np
import olp
P, M = "programs/haas-mill/bracket.nc", "programs/haas-mill/machine.toml"
def show(name, thing, depth=0):
    if isinstance(thing, dict):
        print(name, json.dumps(thing, default=str))
    elif isinstance(thing, np.ndarray):
        print(name, thing.dtype, thing.shape, thing.flags.writeable, thing.tobytes().hex()[:4000])
    elif isinstance(thing, (bytes, str, int, float, bool, type(None))):
        print(name, repr(thing)[:4000])
    elif isinstance(thing, (tuple, list)):
        for k, part in enumerate(thing[:20]):
            show(f"{name}[{k}]", part, depth)
    elif depth < 3:
        fields = getattr(thing, "__dataclass_fields__", None) or getattr(thing, "__slots__", ())
        print(name, type(thing).__name__)
        for f in fields:
            show(f"{name}.{f}", getattr(thing, f), depth + 1)
result = olp.correct(P, M)
Path("raw.csv").write_bytes(olp.simulate(P, M).to_csv())
timed = olp.retime(P, M)
for name, call in {
    "correct": lambda: result, "correct bytes": lambda: olp.correct(Path(P).read_bytes(), M, tolerance_um=0.3),
    "verify": lambda: olp.verify(P, result.data, M), "error_at": lambda: olp.error_at(M, (-100.0, -50.0, -200.0), tool=1),
    "inspect": lambda: olp.inspect(P, M), "simulate": lambda: olp.simulate(P, M), "flatten": lambda: olp.flatten(P, M),
    "check": lambda: olp.check(P, M), "retime": lambda: timed.report, "lines": lambda: timed.lines,
    "compare": lambda: olp.compare(P, ["raw.csv"], M).report, "setup": lambda: olp.load_setup(M),
    "tables": lambda: olp.compare_tables(M), "table": lambda: olp.export_table(M, "isg"),
    "no program": lambda: olp.correct("none.nc", M), "no machine": lambda: olp.correct(P, "none.toml"),
    "refused": lambda: olp.correct(b"G1 X#1\n", M), "outside": lambda: olp.error_at(M, (1e6, 0.0, 0.0)), "none": lambda: olp.nothing,
}.items():
    try:
        show(name, call())
    except Exception as error:
        print(name, type(error).__name__, error, [c.__name__ for c in type(error).__mro__], getattr(error, "__dict__", ""))
"""


def olp(text: str, stdin: bytes = b"") -> tuple[str, Any, bytes]:
    return "olp", shlex.split(text), stdin


def each(text: str) -> list[tuple[str, Any, bytes]]:
    """A step a line; lines that begin with `!` start an interpreter of their own."""
    found = [line.strip() for line in text.strip().splitlines() if line.strip()]
    return [("start", shlex.split(t[1:]), b"") if t[0] == "!" else olp(t) for t in found]


def short_tour(program: str, setup: str, size: int = 0, more: str = "") -> list[tuple[str, Any, bytes]]:
    p, out = shlex.quote(program), f"out{Path(program).suffix}"
    return each(f"""inspect {p} {setup} --json
        correct {p} {setup} -o {out} --report r.json --json {DAY} --fail-on never {more}
        verify {p} {out} {setup} --json\nsimulate {p} {setup} -o raw.csv --step-mm 5
        check {p} {setup} --format json {DAY}
        {f"retime {p} {setup} --json --lines lines.csv -o t.csv --cycle-ms 20" if size < 14_000 else ""}
        correct {p} {setup} -o flat{out} --flatten --expand-cycles --peck-clearance-mm 0.5 --diff {DAY}""")


def tour(program: str, setup: str, size: int) -> list[tuple[str, Any, bytes]]:
    """All verbs; what takes long only on small programs."""
    p, e = program, Path(program).suffix
    steps = short_tour(p, setup, size) + each(f"""inspect {p} {setup}\ncorrect out{e} {setup} -o again{e}
        correct {p} {setup} -o b{e} --report r.html {DAY} --diff --tolerance-um 0.3
        verify {p} out{e} {setup}\nverify {p} {p} {setup} --within-um 3 --tolerance-um 2 {DAY}
        simulate out{e} {setup} -o corrected.csv --step-mm 10
        compare {p} corrected.csv {setup} --json -o dev.csv --report m.json {DAY}
        check {p} {setup} --format sarif -o f.sarif --date 2030-01-01 --fail-on warning
        check out{e} {setup} --nominal {p} {DAY}\nview {p} {setup} -o v.html --no-time""")
    return steps + (each(f"""correct {p} {setup} -o a{e} --report r.md -q --only-sure-components
        correct {p} {setup} -o c{e} --split-rapids --outside-box hold --within-um 5 --contour --date 2030-01-01 --report r.md
        simulate {p} {setup} --step-mm 50\ncompare {p} corrected.csv --before raw.csv {setup} --report m.html --tolerance-um 1
        compare {p} raw.csv {setup} --align fit --order forward --report m.md --reach-mm 0.5
        check {p} {setup} {DAY}\ncheck {p} {setup} --format junit
        retime {p} {setup} -o t.npz --slow slow.csv --plot m.svg --report t.json --cycle-ms 20
        retime out{e} {setup} --nominal {p} --proof r.json --write-feed f{e} --blend-mm 0.02
        retime {p} {setup} -o u.json --format ros --cycle-ms 50 -q\nretime {p} {setup} -o t.pvt --format pvt --cycle-ms 50 -q
        view {p} {setup} --corrected out{e} --measured corrected.csv -o w.html\ncorrect {p} {setup} -o d{e} --review rv.html -q
    """) if size < 9000 else [])  # fmt: skip


def of_programs(source: Path) -> list[Case]:
    """The jobs of the repository."""
    programs, cases = source / "programs", []

    def case(name: str, folders: str, steps: list[tuple[str, Any, bytes]]) -> None:
        copies = [(programs / folder, f"programs/{folder}") for folder in folders.split()]
        cases.append(Case(f"programs/{name}", copies, steps))

    for folder, also in (("gantry-plate", ""), ("bridge-cmm", ""), ("haas-mill", ""), ("table-router", ""),
                         ("nasty", ""), ("apt-flavours", "gantry-plate"), ("dmis-housing", "bridge-cmm")):  # fmt: skip
        here = f"programs/{folder}"
        setup, jobs = f"-j {here}/job.toml", sorted((programs / folder).glob("job*.toml"))
        main = {re.search(r'(?m)^program = "(.*)"', job.read_text())[1]: job.name for job in jobs}  # type: ignore
        for path in sorted((programs / folder).iterdir()):
            if path.name in main:
                own = f"-j {here}/{main[path.name]}"
                case(
                    f"{folder}/{path.name}",
                    f"{folder} {also}",
                    tour(f"{here}/{path.name}", own, path.stat().st_size),
                )
            elif path.suffix not in (".toml", ".csv"):
                case(f"{folder}/{path.name}", f"{folder} {also}", short_tour(f"{here}/{path.name}", setup))
        machine = f"{here}/machine.toml"
        if (programs / folder / "machine.toml").exists():
            steps = each(f"""inspect {machine}\ninspect {machine} --json\ninspect {machine} --plot c.svg
                inspect {machine} --at 10 20 -30\ninspect {machine} --at 10 20 -30 --tool 1 --json
                inspect {machine} --at 1e5 0 0\ninspect {machine} -j {here}/job.toml\ninspect {machine} --plot c.png
                calibrate export -m {machine} --compare\ncalibrate export -m {machine} --compare --json
                !inspect {machine}\ncorrect -j {here}/job.toml -o -\ncorrect -j {here}/job.toml
                view -j {here}/job.toml --no-time -q\ncheck -j {here}/job.toml""")
            for name, sense in (("isg", ""), ("etalon", ""), ("linuxcnc", ""), ("klipper", ""),
                                ("siemens-cec", ""), ("siemens-cec", "--sense error"), ("isg", "--most-rows 20"),
                                ("heidenhain", "--sense correction"), ("heidenhain", "--sense error")):  # fmt: skip
                words = f"--format {name} {sense} -m {machine}"
                again = words.replace("--most-rows 20", "")
                steps += each(
                    f"calibrate export {words} -o {name}/t.tab\ncalibrate export {words} -o t.tab --force --json"
                )
                steps += each(f"calibrate import t.tab {again} -o i.toml --force --measured 2026-05-14")
            case(f"{folder}/machine", f"{folder} {also}", steps)
    lines, checks = "programs/gantry-lines", "programs/gantry-checks"
    m = f"-m {lines}/machine.toml"
    case("gantry-lines/fit", "gantry-lines gantry-plate", each(f"""
        calibrate fit {lines} {m} -o {lines}/calibration.toml --report fit.html
        calibrate fit {lines} {m} -o {lines}/c2.toml --report fit.json --json --map
        calibrate fit {lines} -o {lines}/c3.toml --report fit.md --datum 100 50 -20 --valid-until 2027-01-01
        inspect {lines}/machine.toml --json\ninspect {lines}/machine.toml --plot c.svg
        calibrate doctor {lines}/calibration.toml {lines}/tracker.csv {m} -o {lines}/right.toml --json
        calibrate doctor {lines}/calibration.toml {lines}/tracker.csv {m} --sigma-um 2 --tool 0 0 -85
        calibrate refine {lines}/calibration.toml {lines}/tracker.csv {m} -o {lines}/new.toml {DAY} --json
        calibrate refine {lines}/calibration.toml {lines}/tracker.csv {m} -o {lines}/new.toml
        correct programs/gantry-plate/plate.ngc {m} -o p.ngc --within-um 8 --report p.json --json
        correct programs/gantry-plate/plate.ngc {m} -o q.ngc --only-sure-components --report p.html -q
        check programs/gantry-plate/plate.ngc {m} --within-um 8\nverify programs/gantry-plate/plate.ngc p.ngc {m} --json
        view programs/gantry-plate/plate.ngc {m} -o v.html --no-time"""))  # fmt: skip
    case(
        "gantry-lines/plan",
        "gantry-lines",
        each(f"""calibrate plan {m} --json {DAY}
        calibrate plan {m} --uncertainty-um 8 --instrument lines -o plan\ncalibrate plan {m} --instrument pods --points 40 -q
        calibrate plan {m} --instrument tracker --points 60 --sigma-um 10 --period-x 10 -o plan2 {DAY}"""),
    )
    diagonals = " ".join(f"{checks}/diagonal-{d}.csv" for d in ("nnp", "npp", "pnp", "ppp"))
    reads = "\n".join(f"calibrate read {lines}/{f.name} {o}" for f in sorted((programs / "gantry-lines").glob("*.*"))
                      for o in ("", "--json", f"--profile {lines}/laser.toml") if f.suffix != ".toml")  # fmt: skip
    case(
        "gantry-checks",
        "gantry-lines gantry-checks gantry-plate",
        each(f"""
        calibrate evaluate {lines}\ncalibrate evaluate {lines} {m} --json --zone minimum-zone {DAY}
        calibrate evaluate {lines} --report e.html --plot e.svg\ncalibrate evaluate {lines} --report e.md
        calibrate ballbar {checks}/ballbar-xy.csv -o s.toml --plot b.svg\ncalibrate ballbar {checks}/ballbar-xy.csv --json
        calibrate diagonals {diagonals}\ncalibrate diagonals {diagonals} --json --known SX=37,1 -o d.toml
        calibrate go-return {checks}/go-return-x.csv {checks}/go-return-y.csv -o g.toml --plot g.svg
        calibrate go-return {checks}/go-return-z.csv --json\ncalibrate go-return {m} --axis X --program g.ngc
        calibrate postures {checks}/postures.csv -m programs/gantry-plate/machine.toml
        calibrate postures {checks}/postures.csv -m programs/gantry-plate/machine.toml --json
        calibrate postures -m programs/gantry-plate/machine.toml --program t.ngc --tools 1,2,3 --point 100,100,-100
        calibrate squareness\ncalibrate squareness --json\ncalibrate squareness C0Y=12.5 B0Z=-3 --from klipper
        calibrate squareness C0Y=20 --from larger-than-90 --json\ncalibrate squareness --frame C0Y=141.5,141.3,100
        calibrate formats\ncalibrate formats --json\n{reads}"""),
    )
    return cases


def of_words(source: Path) -> list[Case]:
    """Help, schemas, explanations, new machines, wrong calls, and the Python names."""
    text = "\n".join(p.read_text() for p in sorted((source / "olp").rglob("*.py")))
    codes = sorted(set(re.findall(r'"(OLP\d{3})"', text)))
    files = [p.stem for p in sorted((source / "olp/cli").glob("*.py"))]
    groups = [
        f"calibrate {p.removeprefix('calibrate_').replace('_', '-')}"
        for p in files
        if p.startswith("calibrate_")
    ]
    verbs = [
        "init",
        "inspect",
        "correct",
        "verify",
        "simulate",
        "retime",
        "check",
        "view",
        "compare",
        "calibrate",
        "schema",
        "explain",
    ]
    helps = [f"!{verb} --help" for verb in ["", *verbs, *groups]]
    schemas = [
        f"schema {n}"
        for n in ("machine", "calibration", "job", "measurements", "points", "dialect", "nothing")
    ]
    explained = [f"explain {c} {o}" for c in codes for o in ("", "--json")] + [
        "explain",
        "explain --json",
        "explain OLP999",
    ]
    mill = source / "programs/haas-mill"
    p, m = "mill/bracket.nc", "-m mill/machine.toml"
    wrong = each(f"""nothing\n{chr(10).join(f'{v} --no-such-option' for v in [*verbs, *groups])}
        {chr(10).join([*verbs, *groups])}\n--version\n!--version\n!correct none.nc {m}\n!correct {p}
        correct {p}\ncorrect none.nc {m}\ncorrect {p} -m none.toml\ncorrect {p} {m} -o none/out.nc\ncorrect {p} {m} -o {p} --force
        correct {p} {m} -o out.nc --tolerance-um 0\ncorrect {p} {m} -o out.nc --tolerance-um nan\ncorrect {p} {m} -o mill
        correct {p} {m} -o out.nc --report out.nc\ncorrect {p} {m} -o out.nc --report r.txt\ncorrect {p} {m} -o out.nc --date 1.1.26
        correct {p} -m mill/calibration.toml -o out.nc\ncorrect {p} -m {p} -o out.nc\ncorrect mill/machine.toml {m} -o out.nc
        correct {p} {m} -o out.nc --dialect nothing\ncorrect {p} {m} -o out.nc --dialect grbl\ncorrect {p} {m} -o out.nc --dialect apt
        correct {p} {m} -o out.nc --peck-clearance-mm 1\ncorrect {p} {m} -o out.nc --tool 1\ncorrect {p} {m} -o - --json
        correct {p} {m} -o - --diff\ncorrect {p} {m} -o out.nc\ncorrect {p} {m} -o out.nc\ncorrect {p} {m} -o out.nc --force -q
        correct out.nc {m} -o twice.nc\nverify {p} none.nc {m}\nverify {p} {m}\nverify - - {m}\nverify {p} mill/manifold.nc {m}
        verify {p} {p} -m none.toml\nsimulate {p} {m} --step-mm 0\nsimulate {p} {m} -o none/x.csv\nretime {p} {m} -o x.rsf
        retime {p} {m} -o x.csv --stretch 99\nretime {p} {m} --plot x.bmp\nretime {p} {m} -o x.parquet\nretime {p} {m} --cycle-ms 0
        retime {p} {m} --proof {p}\nretime {p} {m} --nominal none.nc\nretime {p} {m} -o - --cycle-ms 100 -q\nretime {p} {m} --shared-feed least --write-feed f.nc
        retime {p} {m} --plot s.png --plot-span 1 2 -q\nretime {p} {m} --plot t.svg --plot-span 2 1\nretime {p} {m} --blend-study
        check {p} {m} --select OLP9\ncheck {p} {m} --select OLP4,OLP1\ncheck {p} {m} --ignore OLP --format json\ncheck {p} {m} --format xml
        check {p} {m} -o c.html\nview {p} {m} -o v.html --step-mm 0\nview {p} {m} --live --port 99999\nview {p} {m} --measured none.csv
        view {p} {m} -o v.htm\ncompare {p} none.csv {m}\ncompare {p} mill/x.csv {m}\ncompare mill/x.csv mill/y.csv
        compare {p} mill/x.csv {m} --column Q=1\ncompare {p} mill/x.csv {m} --unit mile\ncompare mill/x.csv mill/x.csv --poses
        inspect none.toml\ninspect {p}\ninspect mill/machine.toml --at 1 2\ninspect {p} {m} --at 1 2 3\ninspect mill/machine.toml --plot x.bmp
        calibrate read none.csv\ncalibrate read {p}\ncalibrate fit none -o c.toml\ncalibrate fit mill -o c.toml\ncalibrate evaluate mill
        calibrate import {p} --format isg -o c.toml\ncalibrate import {p} --format none\ncalibrate export {m} --format none -o x
        calibrate export {m} --format isg\ncalibrate export -c mill/calibration.toml --chain XYFZ --format isg -o t.csv
        calibrate export -c mill/calibration.toml --compare --program {p}\ncalibrate export {m} --compare --program {p}
        calibrate doctor mill/calibration.toml mill/x.csv {m}\ncalibrate refine mill/calibration.toml mill/x.csv {m} -o n.toml
        calibrate plan {m} --uncertainty-um 0\ncalibrate plan {m} --box 0 1 0 1 0 1\ncalibrate thermal mill/x.csv {m}
        calibrate ballbar mill/x.csv\ncalibrate diagonals mill/x.csv\ncalibrate go-return mill/x.csv\ncalibrate postures mill/x.csv {m}
        calibrate squareness Q=1\ncalibrate squareness C0Y=1 --from none\ncalibrate squareness --frame C0Y=1,2""")  # fmt: skip
    wrong += [olp(f"{t} {m}", (mill / "bracket.nc").read_bytes()) for t in (
        "correct - -o -", "correct - -o - --json", "inspect -", "check -", "simulate - --step-mm 50", "retime -",
        "verify - mill/bracket.nc", "view - -o stdin.html --no-time", "correct -", "correct - -o x.nc --report r.json")]  # fmt: skip
    ini = b"[EMC]\nMACHINE = Big Mill\n[KINS]\nKINEMATICS = trivkins coordinates=XYYZ\n[TRAJ]\nCOORDINATES = X Y Y Z\n" \
        b"LINEAR_UNITS = inch\n[EMCIO]\nTOOL_TABLE = mill.tbl\n[AXIS_X]\nMIN_LIMIT = -10.0\nMAX_LIMIT = 10\nMAX_VELOCITY = 2\n" \
        b"MAX_ACCELERATION = 20.0\n[AXIS_Y]\nMIN_LIMIT = 0\nMAX_LIMIT = 8\n[AXIS_Z]\nMIN_LIMIT = -4\nMAX_LIMIT = 0\n[JOINT_0]\n" \
        b"BACKLASH = 0.001\nCOMP_FILE = x.comp\n"  # fmt: skip
    new = each("""init mill\ninit mill\ninit mill --force --name shop\ninspect mill/machine.toml --json\ninit a/b
        init m2 --chain XYFZ --controller fanuc --travel X -600 0 --travel Y -400 0 --travel Z -500 0\ninit m3 --chain XXYZ
        init m4 --from-linuxcnc mill.ini\ninspect m4/machine.toml\ninit m5 --controller none\ninit m6 --travel X 5 1
        init m7 --controller haas\ninit m8 --controller dmis\ninit m9 --controller apt\ninit m10 --controller list
        init m11 --controller grbl --chain YFXZ\ninit m12 --controller kawasaki-as\ninspect m12/machine.toml""")
    tools = {"mill.ini": ini, "mill.tbl": b"T1 P1 Z+2.5 D0.25 ; quarter\nT2 P2 X.1 Z-3.0\n"}
    return [
        Case("words/help", [], each("\n".join(helps))),
        Case("words/schema", [], each("\n".join(schemas))),
        Case("words/explain", [], each("\n".join(explained))),
        Case("words/wrong", [(mill, "mill")], wrong),
        Case("words/init", [], new, tools),
        Case("python/names", [], [("python", API, b"")]),
        Case("python/calls", [(mill, "programs/haas-mill")], [("python", CALLS, b"")]),
    ]


def of_readme(source: Path) -> list[Case]:
    """Every command and example of the README."""
    fence = re.compile(r"(<!-- [^\n]* -->\n)?^```(\w+)\n(.*?)^```\n", re.DOTALL | re.MULTILINE)
    blocks = fence.findall((source / "README.md").read_text("utf-8"))
    texts = {
        b.splitlines()[0].removeprefix("# "): b.encode() for _, kind, b in blocks if kind in ("toml", "csv")
    }
    kinds = {"sh": "shell", "python": "python"}
    asked = [(kinds[kind], body) for mark, kind, body in blocks if kind in kinds and "set-up" not in mark]
    names = ["-".join(re.findall(r"[a-z.-]+", body)[:8]) for _, body in asked]
    copy = [(source / "programs", "programs")]
    return [
        Case(f"readme/{k:02}-{name}"[:90], copy, [(*step, b"")], texts)
        for k, (step, name) in enumerate(zip(asked, names, strict=True))
    ]


def of_made(made: Path) -> list[Case]:
    """What the base's tests write: a job for each finding, random machines and programs."""
    cases = []
    for folder in sorted((made / "gate").iterdir()):
        words = shlex.join(json.loads((folder / "options.json").read_text()))
        nominal = "--nominal nominal.ngc" if (folder / "nominal.ngc").exists() else ""
        setup = "-m machine.toml -j job.toml"
        steps = each(
            f"check part.ngc {setup} {nominal} {words}\ncheck part.ngc {setup} {nominal} {words} --format json"
        )
        steps += each(f"correct part.ngc {setup} -o out.ngc --json {words}")
        steps += each(
            f"verify nominal.ngc part.ngc {setup}" if nominal else f"simulate part.ngc {setup} --step-mm 20"
        )
        cases.append(Case(f"gate/{folder.name}", [(folder, "")], steps))
    for folder in sorted((made / "random").iterdir()):
        m, steps = "-m machine.toml", []
        for name in ("part.ngc", "post.ngc", "post.apt"):
            steps += each(
                f"correct {name} {m} -o out.{name} --json {DAY}\nverify {name} out.{name} {m} --json"
            )
        steps += each(f"""correct part.ngc {m} -o split.ngc --split-rapids --tolerance-um 0.2 -q
            correct part.ngc {m} -o cycles.ngc --expand-cycles --diff -q\nsimulate part.ngc {m} --step-mm 5
            retime motion.ngc {m} --json --lines l.csv\ncheck part.ngc {m} --format json\ninspect machine.toml --json
            inspect machine.toml --at 400 300 -200 --tool 2\ncalibrate export {m} --compare --json""")
        cases.append(Case(f"random/{folder.name}", [(folder, "")], steps))
    described = {
        "kawasaki-as": ".PROGRAM demo()\nSPEED 100 MM/S ALWAYS ; fast\nJMOVE TRANS(10.000, 20.000, 30.000, 0, 180, 0)\n"
        "LMOVE TRANS(60.000, 20.000, 30.000, 0, 180, 0)\nLMOVE p1\nDRAW 0.000, 5.000, 10.000\n.END\n.TRANS\n"
        "p1 80.000000 90.000000 30.000000 0.000000 180.000000 0.000000\n.END\n",
        "val2": ".PROGRAM demo\n10 SPEED 50.00 ALWAYS\n20 SET a = TRANS(10.000, 20.000, 30.000, 0, 180, 0)\n30 MOVE a\n"
        "40 MOVES TRANS(60.000, 25.000, 30.000, 0, 180, 180)\nDRAW 0.000, 5.000, 0.000\n.END\n",
        "karel": "PROGRAM demo\nVAR\np1 : POSITION\nBEGIN\n$SPEED = 100\np1 = POS(10.000, 20.000, 30.000, 0, 180, 0, config)\n"
        "MOVE TO p1 -- first\nEND demo\n",
        "irl": "MOVE LIN p1;\n",
    }
    for name, text in described.items():
        steps = short_tour("demo.as", f"-m machine.toml -j job.toml --dialect {name}") + each(
            "inspect demo.as -m machine.toml"
        )
        cases.append(
            Case(f"described/{name}", [(made / "machines/linuxcnc", "")], steps, {"demo.as": text.encode()})
        )
    return cases


def of_golden(source: Path, shared: Path) -> list[Case]:
    cases = []
    folders = [*(source / "tests/golden").iterdir(), *(shared / "golden/kinematics").glob("*")]
    for folder in sorted(f for f in folders if (f / "machine.toml").exists()):
        steps = each("inspect machine.toml --json\ninspect machine.toml\ninspect machine.toml --plot c.svg")
        if (folder / "expected.json").exists():
            for point in json.loads((folder / "expected.json").read_text())["points"][:12]:
                steps += each(
                    f"inspect machine.toml --json --at {' '.join(str(v) for v in point['axis_mm'])}"
                )
            steps += each(
                "calibrate export -m machine.toml --compare\ncalibrate export -m machine.toml --format isg -o t.csv"
            )
        cases.append(Case(f"golden/{folder.name}", [(folder, "")], steps))
    return cases


def of_repro(shared: Path) -> list[Case]:
    """Known defects: they stay as they are until they are mended on purpose."""
    cases = []
    endings = (".ngc", ".nc", ".gcode", ".prg")
    for path in sorted((shared / "repro").rglob("*")):
        part = path.relative_to(shared / "repro")
        skip = part.parts[:2] in (("interpreter", "7"), ("interpreter", "9"))
        if (
            (path.suffix not in endings and "synthetos" not in path.name)
            or skip
            or part.parts[0] == "calibration"
        ):
            continue
        near = [*path.parent.glob("*.toml"), *path.parent.glob("*/machine*.toml")]
        near += (path.parents[1] / "machine").glob("*.toml") if part.parts[0] == "interpreter" else []
        machines = [m for m in sorted(near) if "olp-machine-1" in m.read_text()]
        top = path.parents[1] if part.parts[0] == "interpreter" else path.parent
        for machine in machines:
            job = machine.with_name("job.toml")
            setup = f"-m {machine.relative_to(top)}" + (f" -j {job.relative_to(top)}" if job.exists() else "")
            more = "--contour" if part.parts[0] == "start" else ""
            steps = short_tour(str(path.relative_to(top)), setup, path.stat().st_size, more)
            steps += each(f"inspect {machine.relative_to(top)} --at 100 200 0 --json")
            case = Case(f"repro/{part.with_suffix('')} {machine.stem}", [(top, "")], steps)
            calibration = machine.with_name("calibration.toml")
            if part.parts[0] == "retime" and calibration.exists():  # theirs is of another name
                name = re.search(r"(?m)^name = .*", machine.read_text())[0].replace("name", "machine")  # type: ignore
                text = re.sub(r"(?m)^machine = .*", name, calibration.read_text())
                case.texts[str(calibration.relative_to(top))] = text.encode()
                for axis in "XYZ" if "x.csv" in text else "":  # and its curves are not there
                    curve = f"{axis}_mm,E{axis}{axis}_um\n-5000,0\n0,2\n5000,9\n"
                    case.texts[str(calibration.with_name(f"{axis.lower()}.csv").relative_to(top))] = (
                        curve.encode()
                    )
            cases.append(case)
    for folder in sorted(p for p in (shared / "repro/calibration").iterdir() if p.is_dir()):
        files = {p.name for p in folder.iterdir()}
        steps = each("calibrate evaluate . --json\ncalibrate read exx.csv") if "exx.csv" in files else []
        if "machine.toml" in files:
            m = "-m machine.toml"
            steps += each(
                f"calibrate fit . {m} -o calibration.toml --force --json\ncalibrate fit . {m} -o b.toml --report f.md"
            )
        if "points.csv" in files:
            steps += each(
                f"calibrate doctor calibration.toml points.csv {m} --sigma-um 8 -o right.toml --json\ninspect machine.toml --json"
            )
            steps += each(
                f"calibrate refine calibration.toml points.csv {m} --sigma-um 8 -o refined.toml --json {DAY}"
            )
        if "p.ngc" in files:
            steps += each(f"correct p.ngc {m} -o out.ngc --json")
        steps += [
            olp(f"calibrate import {f} --format siemens-cec --chain FXYZ -o {f}.toml --sense error")
            for f in sorted(files)
            if ".SPF" in f
        ]
        steps += (
            each("calibrate read x.rtl --profile rtl.toml\ncalibrate read x.rtl") if "x.rtl" in files else []
        )
        cases.append(Case(f"repro/calibration/{folder.name}", [(folder, "")], steps))
    return cases


def of_corpus(shared: Path, made: Path) -> list[Case]:
    """Real programs, each with a big machine of its dialect; large ones are corrected only."""
    control = {"gcode_cncjs": "grbl", "gcode_fanuc": "fanuc-calculator", "gcode_fanuc_haas_nist": "haas",
               "apt_cldata": "apt", "dmis": "dmis", "robodk_csv": "list"}  # fmt: skip
    cases = []
    for row in (shared / "corpus/MANIFEST.tsv").read_text("utf-8").splitlines()[1:]:
        folder, name = row.split("\t")[:2]
        path, setup = shared / "corpus" / folder / name, "-m machine.toml -j job.toml"
        p, size = shlex.quote(name), path.stat().st_size
        steps = each(f"correct {p} {setup} -o out --json {DAY}")
        if folder in control and size < 250_000:
            steps += each(
                f"inspect {p} {setup} --json\nverify {p} out {setup} --json\ncheck {p} {setup} --format json {DAY}"
            )
            steps += each(
                f"correct {p} {setup} -o flat --flatten --expand-cycles --peck-clearance-mm 0.5 -q {DAY}"
            )
        if folder in control and size < 6_000:
            steps += each(f"simulate {p} {setup} --step-mm 20\nretime {p} {setup} --json --lines l.csv")
            steps += each(f"view {p} {setup} -o v.html --no-time") if size < 2_000 else []
        if folder not in control and len(cases) % 4 == 0:
            steps += each(f"inspect {p} {setup}\ncorrect {p} {setup} -o flat --flatten")
        machine = made / "machines" / control.get(folder, "linuxcnc")
        cases.append(Case(f"corpus/{folder}/{name}", [(machine, ""), (path, name)], steps))
    return cases


def damaged(data: bytes, how: str, draw: random.Random) -> bytes:
    rows = data.splitlines(keepends=True)
    at = draw.randrange(max(len(data), 1))
    if how == "cut":
        return data[:at]
    if how == "flip":
        return bytes(
            b ^ (1 << draw.randrange(8)) if k in {at, at // 2, at // 3} else b for k, b in enumerate(data)
        )
    if how == "drop":
        return b"".join(row for k, row in enumerate(rows) if k != at % len(rows))
    if how == "twice":
        return b"".join(row * (1 + (k == at % len(rows))) for k, row in enumerate(rows))
    digits = [k for k, b in enumerate(data) if 48 <= b < 58]
    where = draw.choice(digits) if digits else 0
    return data[:where] + (b"9" if how == "digit" else b"x") + data[where + 1 :]


def of_damage(source: Path, made: Path) -> list[Case]:
    """Inputs cut off, flipped and changed, by seed; and every line of good files, one at a time."""
    cases = []

    def case(folder: str, target: str, steps: list[tuple[str, Any, bytes]], more: str = "") -> None:
        here = source / "programs" / folder
        copies = [(source / "programs" / f, f"programs/{f}") for f in (folder, *more.split())]
        for how in ("cut", "flip", "drop", "twice", "digit", "letter"):
            name = f"damage/{folder}/{target} {how}"
            text = damaged((here / target).read_bytes(), how, random.Random(name))
            cases.append(Case(name, copies, steps, {f"programs/{folder}/{target}": text}))

    def job(folder: str, program: str) -> list[tuple[str, Any, bytes]]:
        words = f"programs/{folder}/{program} -j programs/{folder}/job.toml"
        return each(f"correct {words} -o out --json {DAY}\ncheck {words}\ninspect {words} --json")

    mill = dict.fromkeys(
        ("bracket.nc", "machine.toml", "calibration.toml", "job.toml", "x.csv"), "bracket.nc"
    )
    for target in mill:
        case("haas-mill", target, job("haas-mill", "bracket.nc"))
    for name in ("modal.ngc", "cycles.ngc", "planes.ngc"):
        case("nasty", name, job("nasty", name))
    case("apt-flavours", "creo.ncl", job("apt-flavours", "creo.ncl"), "gantry-plate")
    case("apt-flavours", "nx.cls", job("apt-flavours", "nx.cls"), "gantry-plate")
    case("dmis-housing", "housing.dmi", job("dmis-housing", "housing.dmi"), "bridge-cmm")
    g = "programs/gantry-lines"
    for target in ("laser-x.txt", "laser.toml"):
        case("gantry-lines", target, each(f"calibrate read {g}/laser-x.txt --profile {g}/laser.toml"))
    for target in ("measurements.toml", "exy.csv", "machine.toml"):
        case("gantry-lines", target, each(f"calibrate evaluate {g} -m {g}/machine.toml --json"))
    checks = "programs/gantry-checks"
    for target, words in (("ballbar-xy.csv", "ballbar"), ("diagonal-ppp.csv", "diagonals"), ("go-return-z.csv", "go-return"),
                          ("postures.csv", "postures -m programs/gantry-plate/machine.toml")):  # fmt: skip
        case("gantry-checks", target, each(f"calibrate {words} {checks}/{target} --json"), "gantry-plate")
    harm = ("from pathlib import Path\np = Path({!r})\nd = p.read_bytes()\n"
            "p.with_name('bad' + p.suffix).write_bytes({})\n")  # fmt: skip
    ways = (
        "d[:len(d) // 2]",
        "d[:100] + bytes([d[100] ^ 8]) + d[101:]",
        "b''",
        "d + d",
        "d.replace(b'1', b'x', 3)",
    )
    p, m = "programs/haas-mill/bracket.nc", "-m programs/haas-mill/machine.toml"
    steps = each(f"simulate {p} {m} -o raw.csv")
    for way in ways:
        steps += [
            ("python", harm.format("raw.csv", way), b""),
            *each(f"compare {p} bad.csv {m} --json\nview {p} {m} --measured bad.csv -o v.html --no-time"),
        ]
    cases.append(Case("damage/measured run", [(source / "programs/haas-mill", "programs/haas-mill")], steps))
    npz = f"{g}/calibration-covariance.npz"
    steps = each(f"calibrate fit {g} -m {g}/machine.toml -o {g}/calibration.toml -q")
    for way in ways:
        move = f"\np.with_name('bad.npz').replace(p) if {way!r} else None\n"
        undo = harm.format(npz, way) + "p.with_name('good').write_bytes(d)\n" + move
        back = f"from pathlib import Path\np = Path({npz!r})\np.with_name('good').replace(p)\n"
        steps += [("python", undo, b""), *each(f"inspect {g}/machine.toml --json"), ("python", back, b"")]
    cases.append(Case("damage/covariance", [(source / g, g)], steps))
    good = source / "tests/broken/good"
    for file in sorted(good.glob("*.toml")):
        rows = file.read_text().splitlines()
        check = (
            "simulate -j job.toml --step-mm 50" if file.name == "job.toml" else "inspect machine.toml --json"
        )
        for k, row in enumerate(rows):
            key, equals, value = row.partition(" = ")
            ways = {
                "drop": None,
                "name": f"{key[:-1]}{equals}{value}",
                "text": f'{key} = "?"',
                "minus": f"{key} = -7",
            }
            for how, new in ways.items():
                if row and (equals or how in ("drop", "name")):
                    changed = "\n".join([*rows[:k], *([] if new is None else [new]), *rows[k + 1 :]]).encode()
                    texts = {
                        file.name: changed,
                        "parts/part.nc": b"G21 G90 G54\nG0 X10 Y10 Z-10\nG1 X50 F600\nM2\n",
                    }
                    cases.append(Case(f"broken/{file.name}:{k + 1} {how}", [(good, "")], each(check), texts))
    return cases


def all_cases(place: Place, shared: Path) -> list[Case]:
    cases = of_readme(place.source) + of_programs(place.source) + of_words(place.source)
    cases += of_repro(shared) if (shared / "repro").is_dir() else []
    cases += of_corpus(shared, place.made) if (shared / "corpus").is_dir() else []
    return cases + of_made(place.made) + of_golden(place.source, shared) + of_damage(place.source, place.made)


# -- the run -------------------------------------------------------------------------------------------------


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--base", default="27681ad", help="commit to compare with")
    parser.add_argument("--tree", type=Path, default=ROOT, help="folder that holds olp/")
    parser.add_argument(
        "--work", type=Path, default=Path("/tmp/olp-compare"), help="what is kept from run to run"
    )
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", default="", help="cases whose name holds this text")
    parser.add_argument("--expect", type=Path, help="patterns of what may differ")
    parser.add_argument("--self", action="store_true", dest="same", help="the base against itself")
    options = parser.parse_args()
    place = Place(options.work.resolve(), options.base)
    tree = place.base if options.same else options.tree.resolve()
    cases = [c for c in all_cases(place, ROOT.parent / "shared") if options.only in c.name and c.steps]
    assert len({c.name for c in cases}) == len(cases), Counter(c.name for c in cases).most_common(3)
    rows = options.expect.read_text().splitlines() if options.expect else []
    allowed = [row.split("#")[0].strip() for row in rows if row.split("#")[0].strip()]
    kept = place.work / "done"
    keep = place.work / "differences" / re.sub(r"\W+", "_", f"{tree} {options.only}").strip("_")
    shutil.rmtree(keep, ignore_errors=True)
    own = threading.local()
    lock, started = threading.Lock(), time.monotonic()
    count: Counter[str] = Counter()
    times: list[tuple[float, str]] = []

    def server(side: str) -> Server:
        if not hasattr(own, side):
            setattr(own, side, Server(place, place.base if side == "base" else tree))
            with lock:
                say(f"{side}: {getattr(own, side).package}\n")
        return getattr(own, side)  # type: ignore[no-any-return]

    def run(case: Case) -> None:
        store = kept / case.key(place)
        with place.alone(case.slug()):
            base = pickle.loads(zlib.decompress(store.read_bytes())) if store.exists() else None
            if base is None or any(done.code == "timeout" for done in base):
                base = perform(case, server("base"), place, None)
                store.with_suffix(".part").write_bytes(zlib.compress(pickle.dumps(base), 1))
                store.with_suffix(".part").rename(store)
            found = perform(case, server("tree"), place, base)
        with lock:
            times.append((sum(done.seconds for done in found), case.name))
            for k, (step, a, b) in enumerate(zip(case.steps, base, found, strict=True)):
                name = f"{case.name}: {title(step)}"
                verb = (
                    step[0]
                    if isinstance(step[1], str)
                    else " ".join(step[1][: 1 + (step[1][:1] == ["calibrate"])])
                )
                count["steps"] += 1
                count[f"of {verb}"] += 1
                count["timeouts of the base"] += a.code == "timeout"
                count[f"exit {a.code}"] += 1
                if a == b:
                    count["equal"] += 1
                    continue
                if any(fnmatch.fnmatch(text, pattern) for pattern in allowed for text in (name, case.name)):
                    count["expected differences"] += 1
                    continue
                count["differences"] += 1
                shown = difference(a, b, keep / case.slug() / str(k))
                say("\n".join([f"\nDIFFERS {name[:300]}", *shown]) + "\n")

    with ThreadPoolExecutor(options.jobs) as pool:
        for done in [pool.submit(run, case) for case in cases]:
            done.result()
    say(
        "\n"
        + ", ".join(
            f"{n} {k.removeprefix('of ')}" for k, n in sorted(count.items()) if k.startswith(("of ", "exit "))
        )
    )
    say(
        f"\nCPU of the tree's side {sum(t for t, _ in times):.0f} s; slowest: "
        + ", ".join(f"{name} {t:.0f} s" for t, name in sorted(times)[:-9:-1])
        + "\n"
    )
    say(
        f"{len(cases)} cases, {count['steps']} steps, {count['equal']} equal, {count['expected differences']} differ as expected, "
    )
    say(
        f"{count['differences']} differ; {count['timeouts of the base']} timeouts; {time.monotonic() - started:.0f} s\n"
    )
    return int(count["differences"] > 0)


if __name__ == "__main__":
    serve() if "--serve" in sys.argv else sys.exit(main())
