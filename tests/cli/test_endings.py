"""How calls end that do not end well: one sentence and an exit code, whatever happens to them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from cases.acceptance import TRUE_ZERO, machine
from cases.fast import some_fast
from cli.test_cli import run

import olp

ROOT = Path(olp.__file__).parents[1]
POSIX = pytest.mark.skipif(os.name == "nt", reason="streams and links of POSIX")
PROGRAM = "G21 G90 G54 G64 P0.02\nG1 X40 F3000\nY40\nX0\nM2\n"


def shell(folder: Path, words: str) -> subprocess.CompletedProcess[str]:
    """A call through a shell, which has `olp` as a function."""
    head = f'olp() {{ "{sys.executable}" -m olp "$@"; }}\n'
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run(
        ["sh", "-c", head + words], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    machine(tmp_path, tables=TRUE_ZERO, job="start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }\n")
    (tmp_path / "part.ngc").write_text(PROGRAM)
    return tmp_path


def one_sentence(stderr: str) -> str:
    assert stderr.count("\n") == 1 and stderr.startswith("olp: error: "), stderr
    assert "Traceback" not in stderr
    return stderr


@pytest.mark.parametrize(
    "raised", [ZeroDivisionError("division by\nzero"), RecursionError(), KeyError("X"), ImportError("no x")]
)
def test_a_defect_is_one_sentence_with_the_file_and_what_to_send(
    folder: Path, raised: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise raised

    monkeypatch.setattr("olp.workflows.correct.run", fail)
    words = ("correct", folder / "part.ngc", "-m", folder / "machine.toml")
    result = run(*words)
    assert result.exit_code == 4
    message = one_sentence(result.stderr)
    assert message.startswith(f"olp: error: {folder / 'part.ngc'}: this is a defect of olp")
    assert type(raised).__name__ in message and "cli/correct.py:" in message and "send this line" in message
    monkeypatch.setenv("OLP_TRACEBACK", "1")
    assert "Traceback" in run(*words).stderr


@pytest.mark.parametrize(
    ("raised", "expected"),
    [
        (MemoryError(), "part.ngc: needs more memory than there is"),
        (OSError(12, "Cannot allocate memory"), "part.ngc: needs more memory than there is"),
        (ImportError("x.so: failed to map segment from shared object"), "part.ngc: needs more memory"),
        (OSError(36, "File name too long", "long"), "long: cannot be used (File name too long)"),
        (OSError(5, "Input/output error"), "the system refuses (Input/output error)"),
    ],
)
def test_what_the_system_refuses_is_no_defect(
    folder: Path, raised: Exception, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise raised

    monkeypatch.setattr("olp.cli.endings.silence", lambda _: None)
    monkeypatch.setattr("olp.workflows.correct.run", fail)
    result = run("correct", folder / "part.ngc", "-m", folder / "machine.toml")
    assert result.exit_code == 4
    assert expected in one_sentence(result.stderr)


@POSIX
@pytest.mark.parametrize(
    ("words", "code", "expected"),
    [
        ("olp explain OLP101 >&-", 4, "<stdout>: is closed"),
        ("olp explain OLP101 2>&-", 0, None),
        ("olp frob 2>&-", 2, None),
        ("olp frob 2>/dev/full", 2, None),
        ("olp inspect - -j job.toml <&-", 3, "<stdin>: is closed"),
        ("olp explain OLP101 >/dev/full", 4, "<stdout>: cannot be written (No space left on device)"),
        ("olp --help >/dev/full", 4, "the system refuses (No space left on device)"),
    ],
)
def test_closed_and_full_streams_end_in_one_sentence(
    folder: Path, words: str, code: int, expected: str | None
) -> None:
    done = shell(folder, words)
    assert done.returncode == code, done.stderr
    if expected is None:
        assert done.stderr == ""
    else:
        assert expected in one_sentence(done.stderr)


@POSIX
@pytest.mark.slow
@pytest.mark.parametrize("stream", [">&-", ">/dev/full", "2>&-", ">&- 2>&- <&-"])
def test_an_output_file_is_whole_where_a_stream_fails(folder: Path, stream: str) -> None:
    call = "olp correct part.ngc -j job.toml -o out.ngc --force"
    assert shell(folder, call).returncode == 0
    good = (folder / "out.ngc").read_bytes()
    done = shell(folder, f"{call} {stream}")
    assert done.returncode in (0, 4) and "Traceback" not in done.stderr
    assert (folder / "out.ngc").read_bytes() == good


@POSIX
@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("inspect {} -j job.toml", 3),
        ("correct part.ngc -j {}", 3),
        ("correct part.ngc -j job.toml -o {} --force", None),
        ("init {}", None),
        ("help --html {}", None),
        ("compare {} {}", 3),
    ],
)
@pytest.mark.parametrize("name", some_fast(["a" * 300, "loop", "a" * 300 + "/b", "part.ngc/b"], 4))
def test_names_that_the_system_refuses(
    folder: Path, words: str, code: int | None, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    (folder / "loop").symlink_to("loop")
    result = run(*words.replace("{}", name).split())
    assert "defect" not in one_sentence(result.stderr)
    assert result.exit_code in ((2, 3, 4) if code is None else (code,))


_INTERRUPTING = """
import sys
wanted = sys.argv.pop(1)
class Interrupt:
    def find_spec(self, name, *rest):
        if name == wanted:
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupt())
from olp.__main__ import run
run()
"""


@pytest.mark.parametrize("module", ["olp.cli", "click", "olp.cli.correct", "olp.workflows.correct", "numpy"])
def test_an_interrupt_while_modules_are_imported_ends_as_any_other(folder: Path, module: str) -> None:
    words = [sys.executable, "-c", _INTERRUPTING, module, "correct", "part.ngc", "-j", "job.toml"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, "Traceback" in done.stderr) == (130, False), done.stderr
    assert not (folder / "part.corrected.ngc").exists()


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a program that needs more memory than its test gives."""
    folder = tmp_path_factory.mktemp("large")
    machine(folder, tables=TRUE_ZERO, job="start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }\n")
    (folder / "part.ngc").write_text(PROGRAM.replace("Y40\n", "Y40\nX41\n" * 600_000))
    return folder


@POSIX
@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    ["correct part.ngc -j job.toml", "inspect part.ngc -j job.toml", "check part.ngc -j job.toml",
     "verify part.ngc part.ngc -j job.toml", "simulate part.ngc -j job.toml",
     "flatten part.ngc -j job.toml"],
)  # fmt: skip
def test_too_little_memory_is_one_sentence_of_every_verb(large: Path, words: str) -> None:
    """But `view`: the OpenBLAS of its motion asks for memory for ever where there is none."""
    done = shell(large, f"ulimit -v 180000; olp {words} >/dev/null")
    assert done.returncode == 4, done.stderr
    assert "part.ngc: needs more memory than there is" in one_sentence(done.stderr)
