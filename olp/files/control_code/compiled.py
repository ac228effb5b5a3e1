"""Compiles control code on this machine, and compares it with the model by its test vectors."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

from olp.core.errors import CannotCompute, UsageError
from olp.files.control_code.base import CodeFormat, vectors_beside

#: Compilers that are tried, the first that is installed.
_COMPILERS = ("cc", "gcc", "clang")
_LIMIT_S = 120.0


def self_test(form: CodeFormat, files: Mapping[Path, bytes]) -> str:
    """What the self-test of written code says. Raises UsageError where there is no compiler,
    CannotCompute where the code and the model differ."""
    compiler = next((found for name in _COMPILERS if (found := shutil.which(name))), None)
    if compiler is None:
        raise UsageError(
            f"--self-test needs a C compiler, and none of {', '.join(_COMPILERS)} is installed; install one, "
            "or compile the file where it will run"
        )
    target = next(iter(files))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        text, vectors, program = folder / "model.c", folder / "vectors.txt", folder / "model"
        text.write_bytes(form.plain(files[target]))
        vectors.write_bytes(files[vectors_beside(target)])
        flags = ["-std=c99", "-O2", "-DOLP_SELF_TEST", "-o", str(program)]
        built = _run([compiler, *flags, str(text), "-lm"])
        if built.returncode:
            raise CannotCompute(f"the C compiler refuses the code: {built.stderr.strip()[:500]}")
        ran = _run([str(program), str(vectors)])
        if ran.returncode:
            raise CannotCompute(
                f"the code does not agree with the model: {(ran.stdout + ran.stderr).strip()}"
            )
        return ran.stdout.strip()


def _run(words: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, capture_output=True, text=True, timeout=_LIMIT_S, check=False)
