"""The formats of control code, by name."""

from __future__ import annotations

from pathlib import Path

from olp.files.control_code import c99, linuxcnc_kins
from olp.files.control_code.base import Code, CodeFormat

#: The formats by name.
CODE: dict[str, CodeFormat] = {form.key: form for form in (c99.FORMAT, linuxcnc_kins.FORMAT)}


def write_code(code: Code, key: str, target: Path) -> dict[Path, bytes]:
    """The files of a format, the source first. Raises ConfigError, UsageError for what it cannot hold."""
    return dict(CODE[key].write(code, target))
