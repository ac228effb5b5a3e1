"""A correction reaches out to nothing: no socket, no other process, and nothing that meshcat brings along."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import olp

ROOT = Path(olp.__file__).parents[1]
#: What meshcat brings along: the packages of a fresh environment with it alone, by the names to import.
BROUGHT_BY_MESHCAT = (
    "meshcat", "IPython", "tornado", "zmq", "pyngrok", "umsgpack", "PIL", "jedi", "parso", "pygments",
    "prompt_toolkit", "traitlets", "psutil", "pexpect", "ptyprocess", "stack_data", "executing", "asttokens",
    "pure_eval", "matplotlib_inline", "ipython_pygments_lexers", "decorator", "wcwidth", "yaml",
)  # fmt: skip
#: Events of the interpreter that open a connection, or start another process.
REACHES_OUT = (
    "socket.", "subprocess.", "os.exec", "os.fork", "os.posix_spawn", "os.spawn", "os.startfile", "os.system",
    "pty.", "urllib.", "http.client.", "ftplib.", "smtplib.", "webbrowser.",
)  # fmt: skip

_WATCHED = """
import json, sys
events = []
sys.addaudithook(lambda event, _: events.append(event) if event.startswith({reaches!r}) else None)
{act}
from olp.cli import main
try:
    main({words!r})
except SystemExit as end:
    assert end.code in (0, None), end.code
loaded = sorted({{name.partition(".")[0] for name in sys.modules}})
print("\\n" + json.dumps([events, loaded]))
"""


def watched(*words: str, act: str = "") -> tuple[list[str], set[str]]:
    """Events by which a call reaches out, and the packages that it loads."""
    code = _WATCHED.format(reaches=REACHES_OUT, words=list(words), act=act)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    events, loaded = json.loads(done.stdout.splitlines()[-1])
    return events, set(loaded)


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["verify", "check", "simulate", "inspect", "view", "fit"])
def test_no_verb_reaches_out(verb: str, tmp_path: Path) -> None:
    machine = ("-m", "programs/nasty/machine.toml")
    program, out = "programs/nasty/modal.ngc", str(tmp_path / "out.ngc")
    lines = ("programs/gantry-lines", "-m", "programs/gantry-lines/machine.toml")
    words = {
        "correct": ("correct", program, *machine, "-o", out, "--report", str(tmp_path / "r.json")),
        "verify": ("verify", program, out, *machine),
        "check": ("check", program, *machine),
        "simulate": ("simulate", program, *machine, "-o", str(tmp_path / "run.csv")),
        "inspect": ("inspect", program, *machine),
        "view": ("view", program, *machine, "--no-time", "-o", str(tmp_path / "review.html")),
        "fit": ("calibrate", "fit", *lines, "-o", str(tmp_path / "calibration.toml")),
    }
    for each in ("correct", "verify") if verb == "verify" else (verb,):
        events, loaded = watched(*words[each])
        assert events == []
        assert loaded & set(BROUGHT_BY_MESHCAT) == set()


@pytest.mark.slow
def test_the_watch_sees_what_reaches_out() -> None:
    words = ("inspect", "programs/table-router/machine.toml")
    assert "socket.__new__" in watched(*words, act="import socket; socket.socket().close()")[0]
    act = "import subprocess; subprocess.run([sys.executable, '-c', ''])"
    assert "subprocess.Popen" in watched(*words, act=act)[0]
    assert "tornado" in watched(*words, act="import tornado")[1]


def pip(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    call = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--retries", "0", "--timeout", "20"]
    return subprocess.run([*call, *words], cwd=folder, capture_output=True, text=True, check=False)


def commands() -> list[list[str]]:
    """The calls of pip of the page, as words."""
    page = (ROOT / "olp" / "docs" / "howto" / "offline.md").read_text("utf-8")
    return [shlex.split(line.split("-m pip ")[1]) for line in page.splitlines() if "-m pip " in line]


def needs(wheel: Path, environment: dict[str, str]) -> list[Requirement]:
    """What a wheel needs in an environment."""
    with zipfile.ZipFile(wheel) as archive:
        name = next(n for n in archive.namelist() if n.endswith(".dist-info/METADATA"))
        text = archive.read(name).decode()
    stated = [line for line in text.splitlines() if line.startswith("Requires-Dist: ")]
    needed = [Requirement(line.partition(": ")[2]) for line in stated]
    return [r for r in needed if r.marker is None or r.marker.evaluate(environment | {"extra": ""})]


def missing(wheelhouse: Path, environment: dict[str, str]) -> list[str]:
    """What no wheel of a folder provides and one of them, or olp itself, needs."""
    wheels = {canonicalize_name(path.name.split("-")[0]): path for path in wheelhouse.glob("*.whl")}
    waiting, seen = ["olp-corrector", "matplotlib"], set[str]()
    absent = []
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        if name not in wheels:
            absent.append(name)
            continue
        waiting += [canonicalize_name(r.name) for r in needs(wheels[name], environment)]
    return absent


@pytest.mark.slow
def test_the_wheelhouse_for_windows_holds_all_that_is_needed_there(tmp_path: Path) -> None:
    """The calls of the page, from another system; skipped where no registry answers."""
    build, download = commands()[1:3]
    assert (build[0], download[0]) == ("wheel", "download")
    built = pip(*build[:-1], str(ROOT), folder=tmp_path)
    if built.returncode:
        pytest.skip("no registry answers for the tools that build a wheel")
    filled = pip(*download, folder=tmp_path)
    if filled.returncode:
        pytest.skip("no registry answers")
    windows = {str(k): str(v) for k, v in default_environment().items()} | {
        "sys_platform": "win32", "platform_system": "Windows", "os_name": "nt", "platform_machine": "AMD64",
        "python_version": "3.12", "python_full_version": "3.12.4", "implementation_name": "cpython",
        "platform_python_implementation": "CPython",
    }  # fmt: skip
    assert missing(tmp_path / "wheelhouse", windows) == []
    names = [path.name for path in (tmp_path / "wheelhouse").iterdir()]
    assert all(name.endswith((".whl",)) and re.search(r"-(any|win_amd64)\.whl$", name) for name in names)
    assert any(name.startswith("numpy") and "cp312-win_amd64" in name for name in names)
    (tmp_path / "wheelhouse" / next(n for n in names if n.startswith("colorama"))).unlink()
    assert missing(tmp_path / "wheelhouse", windows) == ["colorama"]


@pytest.mark.slow
def test_files_for_other_tools_are_in_the_wheel(tmp_path: Path) -> None:
    built = pip(*commands()[1][:-1], str(ROOT), folder=tmp_path)
    if built.returncode:
        pytest.skip("no registry answers for the tools that build a wheel")
    (wheel,) = (tmp_path / "wheelhouse").glob("olp_corrector-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        shipped = {n for n in archive.namelist() if n.startswith("olp/_shop/")}
    assert shipped == {f"olp/_shop/{path.name}" for path in (ROOT / "programs" / "shop").iterdir()}
