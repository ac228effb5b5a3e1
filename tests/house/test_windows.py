"""Nothing of POSIX alone in the package: names, paths, processes, text without its encoding."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from cases.fast import in_each
from house.trees import parsed

import olp

PACKAGE = Path(olp.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))
#: Modules that Windows does not have.
MODULES_OF_POSIX = frozenset((
    *("curses", "crypt", "fcntl", "grp", "nis", "posix", "pty", "pwd", "readline", "resource"),
    *("spwd", "syslog", "termios", "tty"),
))  # fmt: skip
#: Functions of `os` that Windows does not have, or that end a process there.
OF_OS = frozenset((
    *("abort", "chown", "chroot", "ctermid", "fchmod", "fchown", "fork", "forkpty", "getegid", "geteuid"),
    *("getgid", "getgroups", "getloadavg", "getpgid", "getpriority", "getsid", "getuid", "initgroups"),
    *("kill", "killpg", "lchown", "lockf", "major", "makedev", "minor", "mkfifo", "mknod", "nice", "openpty"),
    *("pipe2", "posix_fadvise", "posix_fallocate", "posix_spawn", "pread", "pwrite", "sched_getaffinity"),
    *("sched_setaffinity", "sendfile", "setgid", "setpgid", "setpriority", "setsid", "setuid", "statvfs"),
    *("sync", "sysconf", "tcgetpgrp", "ttyname", "uname", "wait", "wait3", "wait4", "waitid", "O_NOFOLLOW"),
    *("O_DIRECTORY", "O_CLOEXEC", "O_NONBLOCK", "sched_yield", "register_at_fork"),
))  # fmt: skip
#: Signals that Windows has.
SIGNALS = frozenset(
    (
        "SIGINT",
        "SIGTERM",
        "SIGABRT",
        "SIGFPE",
        "SIGILL",
        "SIGSEGV",
        "SIGBREAK",
        "SIG_IGN",
        "SIG_DFL",
        "Signals",
    )
)
FOLDERS = ("/bin/", "/dev/", "/etc/", "/home/", "/proc/", "/root/", "/tmp", "/usr/", "/var/")
#: Methods that read or write text in the encoding of the system unless they are told another.
TEXT = frozenset(("open", "read_text", "write_text"))


def findings(tree: ast.Module) -> Iterator[str]:
    """What would not work on Windows, with its line."""
    guarded = {id(n) for block in ast.walk(tree) for n in _guarded(block)}
    for node in ast.walk(tree):
        for what in _of(node):
            if id(node) not in guarded:
                yield f"line {getattr(node, 'lineno', 0)}: {what}"


def _guarded(block: ast.AST) -> Iterator[ast.AST]:
    """What runs only where a test says that the system has it: after hasattr(os, ...), not on "nt"."""
    if isinstance(block, ast.If) and "hasattr(os, " in ast.unparse(block.test):
        yield from ast.walk(block)
    if isinstance(block, ast.FunctionDef):
        for k, statement in enumerate(block.body):
            leaves = isinstance(statement, ast.If) and isinstance(statement.body[-1], ast.Return)
            if leaves and ast.unparse(statement.test) == "os.name == 'nt'":
                for rest in block.body[k + 1 :]:
                    yield from ast.walk(rest)


def _of(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (a.name for a in node.names if a.name.split(".")[0] in MODULES_OF_POSIX)
    if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in MODULES_OF_POSIX:
        yield str(node.module)
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        name = f"{node.value.id}.{node.attr}"
        if node.value.id == "os" and node.attr in OF_OS:
            yield name
        if node.value.id == "signal" and node.attr.startswith("SIG") and node.attr not in SIGNALS:
            yield name
        if node.value.id == "multiprocessing" and node.attr in ("Pool", "Process", "Manager", "Queue"):
            yield f"{name}: take get_context('spawn')"
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        if node.value.startswith(FOLDERS):
            yield repr(node.value)
        if "%-" in node.value and "%Y" in node.value:
            yield f"{node.value!r}: a format of days"
    if isinstance(node, ast.Call):
        yield from _of_call(node)


def _of_call(node: ast.Call) -> Iterator[str]:
    name = ast.unparse(node.func).rpartition(".")[2]
    words = {word.arg for word in node.keywords}
    values = [a.value for a in node.args if isinstance(a, ast.Constant)]
    if name == "get_context" and values != ["spawn"]:
        yield "get_context without spawn"
    if name == "ProcessPoolExecutor" and "mp_context" not in words:
        yield "processes that are not spawned: state mp_context"
    binary = any(isinstance(v, str) and "b" in v for v in values) or "O_" in ast.unparse(node)
    zipped = any(isinstance(v, str) and v in ("r", "w") for v in values) and "force_zip64" in words
    told = "encoding" in words or any(isinstance(v, str) and v.startswith("utf") for v in values)
    if name in TEXT and not (binary or zipped or told):
        yield f"{name}: text without an encoding"


@pytest.mark.slow
@in_each(MODULES, lambda path: path.relative_to(PACKAGE).as_posix())
def test_nothing_is_of_posix_alone(path: Path) -> None:
    assert list(findings(parsed(path))) == []


@pytest.mark.parametrize("line", [
    "import fcntl", "from pwd import getpwnam", "os.fork()", "os.kill(1, 0)", "signal.SIGKILL",
    "Path('/tmp/x')", "day.strftime('%-d.%m.%Y')", "path.read_text()", "open('x')", "open('x', 'w')",
    "multiprocessing.Pool(2)", "get_context('fork')", "ProcessPoolExecutor(2)", "os.sysconf('x')",
])  # fmt: skip
def test_what_it_refuses(line: str) -> None:
    assert len(list(findings(ast.parse(line)))) == 1


@pytest.mark.parametrize("line", [
    "open('x', 'rb')", "path.read_text('utf-8')", "open('x', encoding='utf-8')", "get_context('spawn')",
    "ProcessPoolExecutor(2, mp_context=get_context('spawn'))", "os.replace(a, b)", "signal.SIGINT",
    "if hasattr(os, 'chown'):\n    os.chown(a, 1, 1)",
    "def f():\n    if os.name == 'nt':\n        return\n    os.kill(1, 0)",
])  # fmt: skip
def test_what_it_lets_pass(line: str) -> None:
    assert list(findings(ast.parse(line))) == []


@pytest.mark.slow
def test_programs_of_the_project_have_names_that_windows_takes() -> None:
    from olp.files.names import wrong_on_windows

    ours = [p.relative_to(PACKAGE.parent) for room in ("olp", "programs", "viewer", "tests")
            for p in (PACKAGE.parent / room).rglob("*") if "__pycache__" not in p.parts]  # fmt: skip
    assert [str(path) for path in ours if wrong_on_windows(str(path))] == []
    spelt = {str(path).lower() for path in ours}
    assert len(spelt) == len(ours), "names that differ in case alone"
    assert max(len(str(path)) for path in ours) < 130
